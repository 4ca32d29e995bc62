//! How far a solution is from a reference, in several norms.
//!
//! Fields are compared at the quadrature points X of the reference's host, w their volumes and V its own:
//!   displacement  sqrt(1/V sum w |u - u_ref|^2),   gradient  sqrt(1/V sum w |du/dX - du_ref/dX|^2),
//!   det F         sqrt(1/V sum w (J - J_ref)^2)
//! of the last frame. Probes, markers and activations are compared in all frames.

use super::solution::{Prepared, Solution};
use crate::error::{Error, Result};
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Matrix, Vector, determinant, inverse, norm, subtract};
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use crate::model::{Evaluation, Model, State};
use crate::scene::{Curves, Measure};
use rayon::prelude::*;
use std::path::Path;

/// Points per direction and element of the reference.
const GAUSS: usize = 3;

/// Errors by measure, in the order of [`Measure::ALL`]; `None` where a measure does not apply.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Errors([Option<f64>; Measure::ALL.len()]);

impl Errors {
    /// The error in one measure.
    pub fn get(&self, measure: Measure) -> Option<f64> {
        self.0[measure as usize]
    }

    /// All of them times a factor.
    pub(super) fn scaled(self, factor: f64) -> Errors {
        Errors(self.0.map(|error| error.map(|error| factor * error)))
    }

    pub(super) fn set(&mut self, measure: Measure, value: f64) {
        self.0[measure as usize] = value.is_finite().then_some(value);
    }
}

/// Frames of a model, and the material points that are looked at.
pub struct Seen<'a> {
    /// The model.
    pub model: &'a Model,
    /// Places of the probes.
    pub probes: &'a [MaterialPoint],
    /// Places of the markers.
    pub markers: &'a [MaterialPoint],
    /// The state of every frame.
    pub states: Vec<&'a State>,
    /// The evaluation of the last one.
    pub last: Option<&'a Evaluation>,
}

/// Against another solution of the same frames.
pub fn against_solution(own: (&Prepared, &Solution), reference: (&Prepared, &Solution)) -> Errors {
    let ((problem, found), (best, known)) = (own, reference);
    between(&found.seen(problem, &found.points()), &known.seen(best, &known.points()))
}

/// Against better states of the same frames.
pub fn between(found: &Seen<'_>, best: &Seen<'_>) -> Errors {
    let mut errors = Errors::default();
    let pairs = || found.states.iter().copied().zip(best.states.iter().copied());
    let (mesh, best_mesh) = (found.model.mesh(), best.model.mesh());
    let displaced = |mesh: &Mesh, at: MaterialPoint, state: &State| mesh.interpolate(at, &state.u);
    let distance = |a: MaterialPoint, b: MaterialPoint, (own, known): (&State, &State)| {
        norm(subtract(displaced(mesh, a, own), displaced(best_mesh, b, known)))
    };
    let probes = found.probes.iter().zip(best.probes);
    if found.probes.len() == best.probes.len() && !found.probes.is_empty() {
        let of_probe = |(a, b): (&MaterialPoint, &MaterialPoint)| {
            pairs().map(|states| distance(*a, *b, states)).fold(0.0, f64::max)
        };
        errors.set(Measure::Probes, probes.map(of_probe).fold(0.0, f64::max));
    }
    if !found.markers.is_empty() && found.markers.len() == best.markers.len() {
        let squares =
            found.markers.iter().zip(best.markers).flat_map(|(a, b)| pairs().map(|s| distance(*a, *b, s).powi(2)));
        errors.set(Measure::Markers, root_mean(squares));
        errors.set(
            Measure::Activations,
            root_mean(pairs().flat_map(|(a, b)| squares_between(&a.controls, &b.controls))),
        );
    }
    if let (Some(own), Some(known)) = (found.states.last(), best.states.last())
        && let Some([displacement, gradient, det_f]) = fields(mesh, own, best_mesh, known)
    {
        errors.set(Measure::Displacement, displacement);
        errors.set(Measure::Gradient, gradient);
        errors.set(Measure::DetF, det_f);
    }
    let stored = |seen: &Seen<'_>| -> Option<f64> {
        let terms = seen.model.terms().iter().zip(&seen.last?.energies);
        Some(terms.filter(|(t, _)| !t.is_load()).map(|(_, e)| e).sum())
    };
    if let (Some(own), Some(known)) = (stored(found), stored(best)) {
        errors.set(Measure::Energy, (own / known - 1.0).abs());
    }
    errors
}

/// Against known displacements of probes in the last frame, each `<probe>.ux_mm` and so on.
pub fn against_values(problem: &Prepared, found: &Solution, values: &[(String, f64)]) -> Errors {
    let mut errors = Errors::default();
    let Some(last) = found.frames.last() else { return errors };
    let mesh = problem.built.model.mesh();
    let difference = |(key, value): &(String, f64)| -> Option<f64> {
        let (probe, component) = key.rsplit_once('.')?;
        let index = problem.scene.probes.iter().position(|p| p.name == probe)?;
        let component = ["ux_mm", "uy_mm", "uz_mm"].iter().position(|c| *c == component)?;
        Some((mesh.interpolate(problem.built.probes[index], &last.state.u)[component] - value).abs())
    };
    let worst = values
        .iter()
        .map(|v| difference(v).unwrap_or(f64::NAN))
        .fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) });
    errors.set(Measure::Probes, worst);
    errors
}

/// Against known activations over time, a table `time_s,<control>,...`; other columns are passed over.
///
/// # Errors
/// A table that cannot be read.
pub fn against_activations(problem: &Prepared, found: &Solution, table: &Path) -> Result<Errors> {
    let names: Vec<&str> = problem.built.model.controls().iter().map(|c| c.name.as_str()).collect();
    let text =
        std::fs::read_to_string(table).map_err(|source| Error::Io { action: "read", path: table.into(), source })?;
    let truth =
        Curves::parse(&known_columns(&text, &names), &table.display().to_string(), &problem.scene.control_ranges())?;
    let squares = found.frames.iter().zip(&found.times_s).flat_map(|(frame, time_s)| {
        let known = names.iter().zip(&frame.state.controls);
        known.filter_map(|(name, value)| Some((truth.at(name, *time_s)? - value).powi(2))).collect::<Vec<f64>>()
    });
    let mut errors = Errors::default();
    errors.set(Measure::Activations, root_mean(squares));
    Ok(errors)
}

/// The columns `time_s` and `names` of a table.
fn known_columns(text: &str, names: &[&str]) -> String {
    let header: Vec<&str> = text.lines().next().unwrap_or_default().split(',').collect();
    let keep = |name: &&str| name.trim() == "time_s" || names.contains(&name.trim());
    let kept: Vec<usize> = (0..header.len()).filter(|k| keep(&header[*k])).collect();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        kept.iter().filter_map(|k| cells.get(*k).copied()).collect::<Vec<_>>().join(",") + "\n"
    };
    text.lines().map(row).collect()
}

fn squares_between<'a>(a: &'a [f64], b: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b))
}

pub(super) fn root_mean(squares: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = squares.fold((0.0, 0), |(sum, count), s| (sum + s, count + 1));
    (sum / f64::from(count)).sqrt()
}

/// Displacement, du/dX and det F at a material point.
fn field(mesh: &Mesh, state: &State, at: MaterialPoint, local: &[[f64; 64]; 3]) -> (Vector, Matrix, f64) {
    let u = mesh.local_of(at.element, &state.u);
    let (value, by_xi) = position_and_jacobian(mesh.element, &u, at.xi);
    let (_, jacobian) = position_and_jacobian(mesh.element, local, at.xi);
    let to_xi = inverse(&jacobian, determinant(&jacobian));
    let gradient: Matrix =
        std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|d| by_xi[i][d] * to_xi[d][j]).sum()));
    let f = std::array::from_fn(|i| std::array::from_fn(|j| gradient[i][j] + f64::from(u8::from(i == j))));
    (value, gradient, determinant(&f))
}

/// Root mean square differences of displacement, gradient and det F; `None` where the bodies do not cover each other.
fn fields(mesh: &Mesh, own: &State, best: &Mesh, known: &State) -> Option<[f64; 3]> {
    let locator = Locator::new(mesh);
    let rule = GaussRule::new(GAUSS);
    let of_element = |element: usize| -> Option<[f64; 4]> {
        let local = best.local(element);
        let mut sums = [0.0; 4];
        for (xi, weight) in rule.cube() {
            let (x, jacobian) = position_and_jacobian(best.element, &local, xi);
            let volume = weight * determinant(&jacobian);
            let at = locator.locate(x).ok()?;
            let (u, gradient, det) = field(mesh, own, at, &mesh.local(at.element));
            let (u_ref, gradient_ref, det_ref) = field(best, known, MaterialPoint { element, xi }, &local);
            let square = |a: &[f64], b: &[f64]| squares_between(a, b).sum::<f64>();
            sums[0] += volume;
            sums[1] += volume * square(&u, &u_ref);
            sums[2] += volume * square(gradient.as_flattened(), gradient_ref.as_flattened());
            sums[3] += volume * (det - det_ref) * (det - det_ref);
        }
        Some(sums)
    };
    let all: Vec<[f64; 4]> = (0..best.elements()).into_par_iter().map(of_element).collect::<Option<_>>()?;
    let sums = all.iter().fold([0.0; 4], |a, b| std::array::from_fn(|k| a[k] + b[k]));
    Some([1, 2, 3].map(|k| (sums[k] / sums[0]).sqrt()))
}
