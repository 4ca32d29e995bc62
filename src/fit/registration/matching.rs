//! Which label is which marker, by geometry alone: `risorius markers match`.
//!
//! From every way to lay the principal axes of the two clouds on each other, and from the labels as they are: assign each
//! marker of the model the point that is nearest in all (least sum of squares), move the points to their markers, and again
//! until nothing changes. The best of these ends is the proposal; the best other one says how sure it is.

use super::{neutral_frames, turn_axes};
use crate::error::{Error, Result};
use crate::fit::placement::size_against;
use crate::markers::Recording;
use crate::math::assignment::assign;
use crate::math::motion::{Allowed, Motion, Pair, centre, least_squares, spread};
use crate::math::tensor::{Matrix, Vector, apply, norm, subtract};
use crate::mesh::Mesh;
use crate::mesh::surface::Surface;
use crate::scene::{FitSpec, RegisterSpec, Scene};
use nalgebra::{Matrix3, SymmetricEigen};

/// Which point is which marker.
#[derive(Debug, Clone, PartialEq)]
struct Matching {
    /// For each marker of the model its point, and how far that is from it, mm.
    points: Vec<Option<(usize, f64)>>,
    /// Root mean square of the distances, mm.
    rms_mm: f64,
    /// That of the best proposal in which some marker has another point, mm.
    second_mm: Option<f64>,
}

/// Labels for the markers of a problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// The frame of the recording that was compared with the model at rest.
    pub frame: usize,
    /// For each marker of the problem its label, and how far that is from it, mm.
    pub labels: Vec<Option<(String, f64)>>,
    /// Root mean square of the distances, mm.
    pub rms_mm: f64,
    /// That of the best other proposal, mm.
    pub second_mm: Option<f64>,
}

/// Proposes the labels of the markers of a scene, from the frame that shows the most of all labels, or of those that are called neutral.
///
/// # Errors
/// K001: wrong units; K004: no such frame; K017: fewer than three markers on either side, or all on a line.
pub fn propose(scene: &Scene, fit: &FitSpec, mesh: &Mesh, mut recording: Recording) -> Result<Proposal> {
    turn_axes(&mut recording, fit.registration.axes);
    let candidates = match fit.registration.neutral {
        Some(_) => neutral_frames(fit, &[], &recording)?,
        None => (0..recording.frames.len()).collect(),
    };
    let shown = |k: &usize| recording.frames[*k].positions_mm.iter().flatten().count();
    let frame = candidates.into_iter().rev().max_by_key(shown).unwrap_or(0);
    let nothing = || Error::NothingToMatch { place: Box::new(fit.markers_place.clone()) };
    let positions = &recording.frames.get(frame).ok_or_else(nothing)?.positions_mm;
    let shown = recording.labels.iter().zip(positions).filter_map(|(label, p)| Some((label.as_str(), (*p)?)));
    let (labels, points): (Vec<&str>, Vec<Vector>) = shown.unzip();
    let surface = Surface::new(mesh);
    let on_skin = |at: Vector| surface.project(at).map_or(at, |foot| mesh.position(foot.point));
    let model: Vec<Vector> = scene.markers.iter().map(|spec| on_skin(spec.position_mm)).collect();
    if let Some(units) = fit.units {
        size_against(reach(&points).1 / reach(&model).1, labels.len(), units, fit)?;
    }
    let guess = scene.markers.iter().enumerate();
    let guess: Vec<(usize, usize)> = guess
        .filter_map(|(marker, spec)| Some((labels.iter().position(|label| *label == spec.label)?, marker)))
        .collect();
    let similar = fit.registration.register == RegisterSpec::Similarity;
    let allowed = if similar { Allowed::SIMILARITY } else { Allowed::RIGID };
    let found = matching(&model, &points, &guess, allowed).ok_or_else(nothing)?;
    let label = |point: &Option<(usize, f64)>| point.map(|(point, mm)| (labels[point].to_owned(), mm));
    let Matching { points, rms_mm, second_mm } = &found;
    Ok(Proposal { frame, labels: points.iter().map(label).collect(), rms_mm: *rms_mm, second_mm: *second_mm })
}

/// The median of each coordinate, and the median distance from there: what a stray point does not change.
fn reach(points: &[Vector]) -> (Vector, f64) {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let middle = std::array::from_fn(|i| median(points.iter().map(|p| p[i]).collect()));
    (middle, median(points.iter().map(|p| norm(subtract(*p, middle))).collect()))
}

/// A point farther out than so many median distances does not decide how the clouds are laid on each other.
const STRAY: f64 = 4.0;

/// Rounds of assigning and moving.
const ROUNDS: usize = 50;

/// Matches points to the markers of the model; `guess` holds pairs (point, marker) that may be right. `None` where fewer than
/// three of either are there, or they lie on a line.
fn matching(model: &[Vector], points: &[Vector], guess: &[(usize, usize)], allowed: Allowed) -> Option<Matching> {
    if model.len().min(points.len()) < 3 {
        return None;
    }
    let guessed: Vec<Pair> = guess.iter().map(|(point, marker)| (points[*point], model[*marker])).collect();
    let (middle, size) = reach(points);
    let central: Vec<Vector> =
        points.iter().filter(|p| norm(subtract(**p, middle)) < STRAY * size).copied().collect();
    let starts = least_squares(&guessed, allowed).into_iter().chain(alignments(model, &central, allowed));
    let mut ends: Vec<End> = Vec::new();
    for start in starts {
        let Some(end) = settle(model, points, start, allowed) else { continue };
        if !ends.iter().any(|(_, pairs, _)| *pairs == end.1) {
            ends.push(end);
        }
    }
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (rms_mm, pairs, motion) = ends.first()?;
    let mut found = vec![None; model.len()];
    for (point, marker) in pairs {
        found[*marker] = Some((*point, norm(subtract(motion.place(points[*point]), model[*marker]))));
    }
    Some(Matching { points: found, rms_mm: *rms_mm, second_mm: ends.get(1).map(|end| end.0) })
}

/// Where a start leads: root mean square distance, pairs (point, marker), motion.
type End = (f64, Vec<(usize, usize)>, Motion);

/// Assigns and moves until nothing changes.
fn settle(model: &[Vector], points: &[Vector], start: Motion, allowed: Allowed) -> Option<End> {
    let (mut motion, mut known) = (start, Vec::new());
    for _ in 0..ROUNDS {
        let moved: Vec<Vector> = points.iter().map(|p| motion.place(*p)).collect();
        let square = |point: usize, marker: usize| norm(subtract(moved[point], model[marker])).powi(2);
        let mut pairs: Vec<(usize, usize)> = if points.len() <= model.len() {
            assign(points.len(), model.len(), square).into_iter().enumerate().collect()
        } else {
            let points_of = assign(model.len(), points.len(), |marker, point| square(point, marker));
            points_of.into_iter().enumerate().map(|(marker, point)| (point, marker)).collect()
        };
        pairs.sort_by_key(|(_, marker)| *marker);
        let placed: Vec<Pair> = pairs.iter().map(|(point, marker)| (points[*point], model[*marker])).collect();
        motion = least_squares(&placed, allowed)?;
        if pairs == known {
            return Some((motion.rms(&placed), pairs, motion));
        }
        known = pairs;
    }
    None
}

/// The turns that lay the principal axes of the points on those of the model, in all 24 ways.
fn alignments(model: &[Vector], points: &[Vector], allowed: Allowed) -> Vec<Motion> {
    let (to, from) = (axes(model), axes(points));
    let (there, here) = (centre(model.iter().copied()), centre(points.iter().copied()));
    let scale = if allowed.scale { spread(model) / spread(points) } else { 1.0 };
    let mut motions = Vec::new();
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for signs in 0..8 {
            let sign = |k: usize| if signs >> k & 1 == 0 { 1.0 } else { -1.0 };
            let r = (0..3).map(|k| sign(k) * to.column(k) * from.column(order[k]).transpose()).sum::<Matrix3<f64>>();
            if r.determinant() < 0.0 {
                continue;
            }
            let turn: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]));
            let turned = apply(&turn, here);
            motions.push(Motion { scale, turn, shift: std::array::from_fn(|i| there[i] - scale * turned[i]) });
        }
    }
    motions
}

/// Principal axes, one per column.
fn axes(points: &[Vector]) -> Matrix3<f64> {
    let middle = centre(points.iter().copied());
    let mut moments = Matrix3::zeros();
    for p in points {
        let p = subtract(*p, middle);
        moments += Matrix3::from_fn(|i, j| p[i] * p[j]);
    }
    SymmetricEigen::new(moments).eigenvectors
}
