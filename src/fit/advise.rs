//! Which further markers would tell more: a greedy choice among points of the surface.
//!
//! A marker at a point whose motion by the controls is B (3 x n, in standard deviations of it) takes the covariance C of the
//! controls in a frame to (C^-1 + B^T B)^-1. Over the frames it is chosen so that the volume of the ellipsoids of error shrinks
//! most, sum of ln det (1 + B C B^T) (D-optimal), or the sum of the variances (A-optimal); then the next one, with that marker there.

use super::identifiability::{Evidence, RANGE_ALONE};
use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::face::{Face, boundary_faces};
use crate::mesh::{MaterialPoint, Mesh};
use nalgebra::{DMatrix, Matrix3};

/// What is to become small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// The volume of the region where the controls may lie: the determinant of their covariance.
    D,
    /// The sum of their variances, in parts of their ranges.
    A,
}

/// A frame: what is known of its free controls, and what a marker at each candidate would add.
pub struct View {
    /// Covariance of the free controls in parts of their ranges. What no marker sees is known by its range.
    covariance: DMatrix<f64>,
    /// The free controls, as indices of the model's, with the sizes of their ranges.
    free: Vec<(usize, f64)>,
    /// Of every candidate d(position / sd)/d(free control).
    candidates: Vec<DMatrix<f64>>,
}

impl View {
    /// Of a frame with the rates (mm per unit of a control, a column for each that is sought) of all candidates; `sd_mm` is the
    /// standard deviation that a new marker would have.
    pub fn new(evidence: &Evidence, rates: &[DMatrix<f64>], sd_mm: f64) -> View {
        let free = evidence.free();
        let n = free.len();
        let whole = &evidence.information + &evidence.prior;
        let known =
            whole.select_rows(&free).select_columns(&free) + DMatrix::from_diagonal_element(n, n, RANGE_ALONE);
        let size = |k: &usize| evidence.ranges[*k][1] - evidence.ranges[*k][0];
        let scaled = |rate: &DMatrix<f64>| {
            DMatrix::from_fn(3, n, |i, k| rate[(i, free[k])] * size(&free[k]) / (sd_mm * evidence.sigma))
        };
        View {
            // the diagonal makes it positive
            covariance: known.cholesky().map_or_else(|| DMatrix::identity(n, n) / RANGE_ALONE, |c| c.inverse()),
            free: free.iter().map(|k| (evidence.unknowns[*k], size(k))).collect(),
            candidates: rates.iter().map(scaled).collect(),
        }
    }

    /// What a marker at a candidate is worth.
    fn gain(&self, candidate: usize, criterion: Criterion) -> f64 {
        let b = &self.candidates[candidate];
        let bc = b * &self.covariance;
        let seen = Matrix3::identity() + Matrix3::from_fn(|i, j| bc.row(i).dot(&b.row(j)));
        match (criterion, seen.try_inverse()) {
            (Criterion::D, _) => seen.determinant().ln(),
            (Criterion::A, Some(inverse)) => {
                let product = Matrix3::from_fn(|i, j| bc.row(i).dot(&bc.row(j)));
                (inverse * product).trace()
            }
            (Criterion::A, None) => 0.0,
        }
    }

    /// The candidate that makes the deviation of a control (an index of the model's) least, with the deviation before and after,
    /// in the units of the control.
    pub fn best_for(&self, control: usize, open: impl Fn(usize) -> bool) -> Option<(usize, f64, f64)> {
        let at = self.free.iter().position(|(k, _)| *k == control)?;
        let before = self.covariance[(at, at)];
        let after = |candidate: usize| {
            let bc = &self.candidates[candidate] * &self.covariance;
            let seen =
                Matrix3::identity() + Matrix3::from_fn(|i, j| bc.row(i).dot(&self.candidates[candidate].row(j)));
            let column = nalgebra::Vector3::from_fn(|i, _| bc[(i, at)]);
            before - seen.try_inverse().map_or(0.0, |inverse| column.dot(&(inverse * column)))
        };
        let all = (0..self.candidates.len()).filter(|c| open(*c)).map(|c| (c, after(c)));
        let (candidate, after) = all.reduce(|best, next| if next.1 < best.1 { next } else { best })?;
        let size = self.free[at].1;
        Some((candidate, before.sqrt() * size, after.max(0.0).sqrt() * size))
    }

    /// Puts a marker at a candidate: C - C B^T (1 + B C B^T)^-1 B C.
    fn add(&mut self, candidate: usize) {
        let bc = &self.candidates[candidate] * &self.covariance;
        let seen = DMatrix::identity(3, 3) + &bc * self.candidates[candidate].transpose();
        if let Some(inverse) = seen.try_inverse() {
            self.covariance -= bc.transpose() * inverse * &bc;
        }
    }
}

/// A marker that would tell a pair of controls apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerHelp {
    /// Its place, mm.
    pub place: Vector,
    /// The control of the pair that is less certain, as an index of the model's.
    pub control: usize,
    /// Its standard deviation without and with the marker.
    pub sd: [f64; 2],
}

/// A marker to add.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// Where, as an index of the candidates.
    pub candidate: usize,
    /// By how much the criterion falls per frame: ln of the ratio of determinants, or the sum of variances.
    pub gain: f64,
    /// Of every control that is free in some frame: its index in the model, its standard deviation before and with this marker
    /// (root mean square over those frames); the one that gains most first.
    pub effects: Vec<(usize, f64, f64)>,
}

/// Chooses up to `count` candidates, one after the other, each at least `apart` mm from all markers. `positions` are those of
/// the candidates, `taken` of the markers that there are.
pub fn advise(
    mut views: Vec<View>,
    positions: &[Vector],
    taken: &[Vector],
    (criterion, count, apart): (Criterion, usize, f64),
) -> Vec<Advice> {
    let mut taken = taken.to_vec();
    let mut chosen = Vec::new();
    for _ in 0..count {
        let open = (0..positions.len()).filter(|c| taken.iter().all(|t| norm(subtract(*t, positions[*c])) >= apart));
        let gains = open.map(|c| (c, views.iter().map(|view| view.gain(c, criterion)).sum::<f64>()));
        // of equal ones the first
        let best = gains.reduce(|best, next| if next.1 > best.1 { next } else { best });
        let Some((candidate, gain)) = best.filter(|(_, gain)| *gain > 0.0) else { break };
        let before = deviations(&views);
        views.iter_mut().for_each(|view| view.add(candidate));
        let after = deviations(&views);
        let mut effects: Vec<_> = before.into_iter().zip(after).map(|((k, b), (_, a))| (k, b, a)).collect();
        effects.sort_by(|x, y| (x.2 / x.1).total_cmp(&(y.2 / y.1)));
        chosen.push(Advice { candidate, gain: gain / views.len().max(1) as f64, effects });
        taken.push(positions[candidate]);
    }
    chosen
}

/// The root mean square deviation of every control over the frames in which it is free, in its units.
fn deviations(views: &[View]) -> Vec<(usize, f64)> {
    let mut sums: Vec<(usize, f64, usize)> = Vec::new();
    for view in views {
        for (a, (control, size)) in view.free.iter().enumerate() {
            let variance = view.covariance[(a, a)].max(0.0) * size * size;
            match sums.iter_mut().find(|(known, ..)| known == control) {
                Some((_, sum, count)) => (*sum, *count) = (*sum + variance, *count + 1),
                None => sums.push((*control, variance, 1)),
            }
        }
    }
    sums.sort_by_key(|(control, ..)| *control);
    sums.into_iter().map(|(control, sum, count)| (control, (sum / count as f64).sqrt())).collect()
}

/// Points where a marker could sit: nine on every face of the skin, or of the whole surface where none is called so.
pub fn candidates(mesh: &Mesh) -> Vec<MaterialPoint> {
    let places = [1.0 / 6.0, 0.5, 5.0 / 6.0];
    let on = |face: &Face| -> Vec<MaterialPoint> {
        let (element, side) = (face.element, face.side);
        let at = |k: usize| MaterialPoint { element, xi: side.lift([places[k % 3], places[k / 3]]) };
        (0..9).map(at).collect()
    };
    let faces = mesh.named_faces.get("skin").cloned().unwrap_or_else(|| boundary_faces(mesh));
    faces.iter().flat_map(on).collect()
}
