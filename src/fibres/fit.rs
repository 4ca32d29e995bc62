//! The whole fit, from axes to angles with their certainty.

use super::branches::unwrap;
use super::certainty::{at, certainty, errors, held_out};
use super::data::Axis;
use super::descent::{Descent, Search};
use super::embed::{Outside, Samples, across, angles_of, chart, embed, frame, in_frame, recharted};
use super::normal::{Angles, Corners, Pattern, roughness, smooth};
use super::outcome::{ElementErrors, FibreFit, NodeAngles, Spread, warnings};
use super::smoothness::{Trace, Tried, choose};
use super::start::start;
use crate::error::{Error, Result, Warning};
use crate::mesh::cycled::cycled;
use crate::mesh::element::ends;
use crate::mesh::exf::ExFile;
use crate::mesh::fibre_angles::{FibreAngles, axes};
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use crate::model::build::{host, muscle_mesh};
use crate::scene::{AnglesSpec, FibreBody, FibreProblem, GeometrySpec, LossSpec, SmoothnessSpec};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// The smoothness of the first search where it is chosen afterwards.
const FIRST: f64 = 1e-6;
/// The smoothness of the tensors of the start, and of the second start where data are sparse.
const STARTS: [f64; 2] = [1e-3, 1e-1];
/// The searches before the first where data are sparse.
const SMOOTHER: [f64; 2] = [1e-2, 1e-4];
/// Fewer axes per element than this are sparse.
const SPARSE: usize = 30;
/// The most steps of a search.
const MOST_STEPS: usize = 60;

/// The mesh of a problem, the names of its nodes, and the warning where the mesh can only come close to what its file
/// holds.
///
/// # Errors
/// An EX file that cannot be read.
pub fn mesh(body: &FibreBody) -> Result<(Mesh, Vec<i64>, Option<Warning>)> {
    let (geometry, place) = match body {
        FibreBody::Mesh(spec) => (&spec.geometry, &spec.place),
        FibreBody::Muscle(spec) => (&spec.geometry, &spec.place),
    };
    let (mesh, names, warning) = match (geometry, body) {
        // of any element, with the names of its nodes
        (GeometrySpec::Exf(spec), _) => {
            let geometry = ExFile::read(&spec.path)?.geometry(spec.field.as_deref())?;
            let warning = geometry.warning(place);
            (geometry.mesh, geometry.nodes, warning)
        }
        (_, FibreBody::Mesh(spec)) => (host(spec)?, Vec::new(), None),
        (_, FibreBody::Muscle(spec)) => (muscle_mesh(spec)?.0, Vec::new(), None),
    };
    let names = if names.is_empty() { (0..mesh.nodes as i64).collect() } else { names };
    Ok((mesh, names, warning))
}

/// A corner of an element for each node.
fn corner_of_nodes(mesh: &Mesh) -> Vec<Option<MaterialPoint>> {
    let mut found = vec![None; mesh.nodes];
    for (element, corners) in mesh.corners.iter().enumerate() {
        for (corner, node) in corners.iter().enumerate() {
            found[*node].get_or_insert(MaterialPoint { element, xi: ends(corner).map(|end| end as f64) });
        }
    }
    found
}

/// Where the axes lie in a mesh: in the first list the fibres, in the second the sheets.
///
/// # Errors
/// [`Error::NoAxes`] where none lies in the mesh.
pub fn place(problem: &FibreProblem, mesh: &Mesh, data: &[Axis]) -> Result<(Samples, Samples, Outside)> {
    let placed = embed(&Locator::new(mesh), data, problem.outside);
    if placed.0.all.is_empty() {
        let Outside { count, distance, .. } = placed.2;
        return Err(Error::NoAxes { count, distance, place: Box::new(problem.place.clone()) });
    }
    Ok(placed)
}

/// Fits the angles of a mesh, whose nodes have the names `names`, to axes.
///
/// # Errors
/// [`Error::NoAxes`] where no axis lies in the mesh; a fixed node that is not there; [`Error::FibreSystem`].
pub fn fit(problem: &FibreProblem, mesh: &Mesh, names: &[i64], data: &[Axis]) -> Result<FibreFit> {
    let (as_is, sheets, outside) = place(problem, mesh, data)?;
    // a field without B stays in the surfaces that its user means
    let shift = if problem.angles == AnglesSpec::A { 0 } else { chart(mesh, &as_is) };
    let renamed = cycled(mesh, shift);
    let samples = if shift == 0 { as_is } else { recharted(mesh, &renamed, &as_is, shift) };
    let sheets = if shift == 0 { sheets } else { recharted(mesh, &renamed, &sheets, shift) };
    let fixed = fixed_angles(problem, mesh, &renamed, names)?;
    let sought = problem.angles.count().min(2);

    let pattern = Pattern::new(mesh.nodes, &renamed.corners)?;
    let plain = Corners::plain(&renamed);
    let is_fixed: Vec<bool> = (0..mesh.nodes).map(|node| fixed.contains_key(&node)).collect();
    let pick = |k: [usize; 2]| -> BTreeMap<usize, [f64; 2]> {
        fixed.iter().map(|(node, angles)| (*node, [angles[k[0]], angles[k[1]]])).collect()
    };
    let main = Fitted::new(problem, &pattern, &samples, &plain, &is_fixed, pick([0, 1]), sought)?;
    let search = main.search(&pattern, &samples, &is_fixed, problem.loss);
    let sums = search.sums(&main.angles, |_| true);
    let lambda = search.lambda(main.smoothness);
    let noise = sums.noise(main.freedom);
    let sure = certainty(&search, &sums, lambda, noise)?;
    let errors = errors(&search, &main.angles);
    let held_out = match problem.folds {
        0 => None,
        folds => Spread::of(&held_out(&search, &main.angles, &sums, lambda, folds)?),
    };

    // sheets: an angle in the plane across the fitted fibre, found in the same way
    let mut sheet = None;
    if problem.angles == AnglesSpec::ABG && !sheets.all.is_empty() {
        let usable =
            sheets.all.iter().filter(|one| main.corners.turns[one.element as usize].iter().all(|k| k % 2 == 0));
        let turned: Vec<_> = usable
            .filter_map(|one| {
                let [a, b] = at(&search, &main.angles, one);
                across(one, [a, b, 0.0])
            })
            .collect();
        let turned = Samples::new(turned, mesh.elements());
        if !turned.all.is_empty() {
            let plane = Fitted::new(problem, &pattern, &turned, &plain, &is_fixed, pick([2, 2]), 1)?;
            let search = plane.search(&pattern, &turned, &is_fixed, problem.loss);
            let sums = search.sums(&plane.angles, |_| true);
            let noise = sums.noise(plane.freedom);
            let sure = certainty(&search, &sums, search.lambda(plane.smoothness), noise)?;
            let spread = Spread::of(&super::certainty::errors(&search, &plane.angles));
            sheet = Some((plane, sure, spread));
        }
    }

    let angles = fibre_angles(&main, sheet.as_ref().map(|sheet| &sheet.0));
    let corners = corner_of_nodes(&renamed);
    let nodes: Vec<NodeAngles> = (0..mesh.nodes)
        .map(|n| NodeAngles {
            name: names[n],
            position: corners[n].map_or([f64::NAN; 3], |at| renamed.position(at)),
            angles: angles.nodes[n],
            sd: [
                Some(sure.sd[0][n]),
                sure.sd.get(1).map(|sd| sd[n]),
                sheet.as_ref().map(|(_, sure, _)| sure.sd[0][n]),
            ],
            determined: sure.determined[n] && sheet.as_ref().is_none_or(|(_, sure, _)| sure.determined[n]),
            fixed: is_fixed[n],
        })
        .collect();
    let elements = (0..samples.elements()).filter_map(|element| {
        let spread = Spread::of(&errors[samples.starts[element]..samples.starts[element + 1]])?;
        Some(ElementErrors { element, spread })
    });
    let elements = elements.collect();
    let mut fit = FibreFit {
        chart: shift,
        nodes,
        outside,
        spread: Spread::of(&errors).unwrap_or(Spread { count: 0, rms: 0.0, median: 0.0, p95: 0.0, most: 0.0 }),
        elements,
        errors,
        held_out,
        sheets: sheet.as_ref().and_then(|(_, _, spread)| *spread),
        smoothness: main.smoothness,
        tried: main.tried.clone(),
        freedom: main.freedom,
        unknowns: sought * is_fixed.iter().filter(|fixed| !**fixed).count(),
        noise,
        steps: main.steps,
        converged: main.converged && sheet.as_ref().is_none_or(|(plane, _, _)| plane.converged),
        warnings: Vec::new(),
        mesh: renamed,
        angles,
        samples,
    };
    fit.warnings = warnings(&fit, problem);
    Ok(fit)
}

/// The angles of fixed nodes in the renamed mesh: the same axes.
fn fixed_angles(
    problem: &FibreProblem,
    mesh: &Mesh,
    renamed: &Mesh,
    names: &[i64],
) -> Result<BTreeMap<usize, [f64; 3]>> {
    let (corners, new_corners) = (corner_of_nodes(mesh), corner_of_nodes(renamed));
    let (mut fixed, mut mistakes) = (BTreeMap::new(), Vec::new());
    for spec in &problem.fixed {
        // a node with several versions of its position is several nodes of the mesh
        let named = (0..names.len()).filter(|node| names[*node] == spec.node);
        let places: Vec<_> = named.filter_map(|node| Some((node, corners[node]?, new_corners[node]?))).collect();
        if places.is_empty() {
            let (low, high) = (names.iter().min().copied().unwrap_or(0), names.iter().max().copied().unwrap_or(0));
            mistakes.push(Error::UnknownName {
                kind: "node",
                name: spec.node.to_string(),
                help: format!("the nodes of the mesh are numbered from {low} to {high}"),
                place: spec.place.clone(),
            });
            continue;
        }
        let given = spec.angles_deg.map(f64::to_radians);
        for (node, old, new) in places {
            let angles = if mesh.corners == renamed.corners {
                given
            } else {
                // corners of the same element: the first that holds the node
                let [fibre, sheet, _] = axes(&mesh.jacobian(old), given);
                let frame = frame(&renamed.jacobian(new));
                angles_of(in_frame(&frame, fibre), Some(in_frame(&frame, sheet)))
            };
            fixed.insert(node, angles);
        }
    }
    if mistakes.is_empty() { Ok(fixed) } else { Err(Error::all(mistakes)) }
}

/// A field that was found.
struct Fitted {
    angles: Angles,
    corners: Corners,
    sought: usize,
    smooth: Vec<Vec<f64>>,
    smoothness: f64,
    tried: Vec<Tried>,
    freedom: f64,
    steps: usize,
    converged: bool,
}

impl Fitted {
    fn new(
        problem: &FibreProblem,
        pattern: &Pattern,
        samples: &Samples,
        plain: &Corners,
        is_fixed: &[bool],
        fixed: BTreeMap<usize, [f64; 2]>,
        sought: usize,
    ) -> Result<Fitted> {
        let (smoothness, chosen) = match problem.smoothness {
            SmoothnessSpec::Weight(weight) => (weight, true),
            SmoothnessSpec::Gcv => (FIRST, false),
        };
        let first = fixed.keys().next().copied().unwrap_or(0);
        let begun = |smoothness: f64, unwraps: bool| -> Result<(Angles, Corners)> {
            let mut angles = start(pattern, samples, plain, sought, smoothness)?;
            fixed.iter().for_each(|(node, given)| angles[*node] = *given);
            let corners = if unwraps { unwrap(samples, plain, &mut angles, first) } else { plain.clone() };
            Ok((angles, corners))
        };
        let mut starts = vec![begun(STARTS[0], true)?];
        let mut smoothnesses = vec![smoothness];
        if samples.all.len() < SPARSE * samples.elements() {
            // few data leave several valleys: go down from the smooth end, and from several places
            smoothnesses = SMOOTHER.into_iter().filter(|smoother| *smoother > smoothness).collect();
            smoothnesses.push(smoothness);
            starts.push(begun(STARTS[0], false)?);
            starts.push(begun(STARTS[1], true)?);
            starts.push(begun(STARTS[1], false)?);
            starts.dedup();
        }
        let mut best: Option<(f64, Fitted, Descent)> = None;
        for (mut angles, corners) in starts {
            let smooth = smooth(pattern, &corners, sought);
            let search =
                Search { pattern, samples, corners: &corners, loss: problem.loss, sought, fixed: is_fixed, smooth };
            let mut steps = 0;
            let mut end = None;
            for smoothness in &smoothnesses {
                let descent = search.descend(&mut angles, search.lambda(*smoothness), MOST_STEPS)?;
                steps += descent.steps;
                end = Some(descent);
            }
            let Some(end) = end else { continue };
            let value = end.sums.cost + search.lambda(smoothness) * roughness(&corners, &angles, sought).0;
            if best.as_ref().is_none_or(|(least, _, _)| value < *least) {
                let (smooth, tried) = (search.smooth.clone(), Vec::new());
                let fitted = Fitted {
                    angles,
                    corners,
                    sought,
                    smooth,
                    smoothness,
                    tried,
                    freedom: 0.0,
                    steps,
                    converged: false,
                };
                best = Some((value, fitted, end));
            }
        }
        let Some((_, mut fitted, mut end)) = best else {
            return Err(Error::FibreSystem { message: "a value is not a number".into() });
        };
        let search = fitted.search(pattern, samples, is_fixed, problem.loss);
        let mut angles = fitted.angles.clone();
        let mut steps = fitted.steps;
        let (mut smoothness, mut tried) = (smoothness, Vec::new());
        let mut near = None;
        // the choice is made for the problem as it is linear here: twice, as it moves what it depends on
        for _ in 0..if chosen { 0 } else { 2 } {
            let (best, all) = choose(&search, &angles, &end.sums, near)?;
            smoothness = best.smoothness;
            near = Some(smoothness);
            tried.extend(all);
            end = search.descend(&mut angles, search.lambda(smoothness), MOST_STEPS)?;
            steps += end.steps;
        }
        let trace = Trace::new(&search, &end.sums);
        let freedom = trace.score(&search, &angles, &end.sums, smoothness)?.freedom;
        (fitted.angles, fitted.smoothness, fitted.freedom) = (angles, smoothness, freedom);
        (fitted.tried, fitted.steps, fitted.converged) = (tried, steps, end.converged);
        Ok(fitted)
    }

    fn search<'a>(
        &'a self,
        pattern: &'a Pattern,
        samples: &'a Samples,
        fixed: &'a [bool],
        loss: LossSpec,
    ) -> Search<'a> {
        let (corners, sought, smooth) = (&self.corners, self.sought, self.smooth.clone());
        Search { pattern, samples, corners, loss, sought, fixed, smooth }
    }
}

/// The angles of nodes, and of the elements with half turns of their own: there (A, B, G) is (A + k pi, (-1)^k B, (-1)^k G), and G
/// may have half turns too.
fn fibre_angles(main: &Fitted, sheet: Option<&Fitted>) -> FibreAngles {
    let g = |node: usize| sheet.map_or(0.0, |sheet| sheet.angles[node][0]);
    let nodes = main.angles.iter().enumerate().map(|(node, [a, b])| [*a, *b, g(node)]).collect();
    let mut own = BTreeMap::new();
    for (e, turns) in main.corners.turns.iter().enumerate() {
        let of_sheet = sheet.map_or([0; 8], |sheet| sheet.corners.turns[e]);
        if turns.iter().chain(&of_sheet).any(|k| *k != 0) {
            let local = main.corners.angles(e, &main.angles);
            let corner = |c: usize| {
                let turned = g(main.corners.nodes[e][c]) + PI * f64::from(of_sheet[c]);
                [local[c][0], local[c][1], main.corners.sign(e, c) * turned]
            };
            own.insert(e, std::array::from_fn(corner));
        }
    }
    FibreAngles { nodes, own }
}
