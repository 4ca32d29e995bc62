//! What the markers tell of the controls, and what they do not.
//!
//! Near the answer of a frame the objective is, with controls in parts of their ranges and marker errors of unit variance,
//!   1/2 d^T (A + P) d + g^T d,
//! A what the markers know (J^T J), P what everything else of the objective adds, g the gradient, which is not zero on bounds.
//! A control that is free has the variance of (A + P)^-1 on the free ones, one on a bound the density exp(- g u - h u^2 / 2),
//! u >= 0, with the Schur complement h. The singular values of J say which combinations no marker sees.

mod clip;
mod pairs;

pub use clip::{ClipKnowledge, Weak};
pub use pairs::{Pair, TOO_ALIKE};

use super::bounded_step::bounded_step;
use super::covariance::{Bound, SymmetricInverse};
use super::estimate::Estimate;
use super::placement::Marker;
use crate::error::Result;
use crate::math::normal::{TWO_SIDED_95, one_sided_95};
use crate::math::tensor::norm;
use crate::model::Control;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// 1 / variance of a control of which nothing is known but its range, in parts of it.
pub const RANGE_ALONE: f64 = 12.0;
/// Markers that leave more than this part of the variance known without them have not told the control.
const PRIOR_DOMINATED: f64 = 0.5;
/// Directions with less than this part of the largest information are not determined.
const UNSEEN: f64 = 1e-12;
/// The least variance of a residual that is believed where residuals estimate it, as in data without noise.
const LEAST_VARIANCE: f64 = 1e-24;

/// The objective of a frame near its answer. Controls in parts of their ranges, marker errors of unit variance.
pub struct Evidence {
    /// The controls that were sought, as indices of the model's.
    pub unknowns: Vec<usize>,
    /// Their lower and upper bounds, in their units.
    pub ranges: Vec<[f64; 2]>,
    /// Their values, in their units.
    pub values: Vec<f64>,
    /// Where they lie.
    pub bounds: Vec<Bound>,
    /// d(weighted residual)/d(control), three rows for every measured marker.
    pub j: DMatrix<f64>,
    /// Weighted residuals.
    pub residuals: Vec<f64>,
    /// Information of the markers.
    pub information: DMatrix<f64>,
    /// Information of the rest of the objective.
    pub prior: DMatrix<f64>,
    /// Gradient of the whole objective.
    pub gradient: Vec<f64>,
    /// The standard deviation that weighted residuals have: 1 where those of markers are given.
    pub sigma: f64,
    /// Whether the frame is bridged: its markers say nothing.
    pub bridged: bool,
}

/// What is known of a control.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// Its index in the model.
    pub control: usize,
    /// Its value.
    pub value: f64,
    /// Where it lies.
    pub bound: Bound,
    /// Its standard deviation; `None` on a bound, or where it is not determined.
    pub sd: Option<f64>,
    /// The values that hold it with a probability of 95 %, within its bounds; on a bound, from there to one side.
    pub interval: [f64; 2],
    /// The standard deviation that it would have without any marker, by its range and by the other objectives.
    pub prior_sd: f64,
    /// Whether the markers take less than half of that variance away.
    pub prior_dominated: bool,
    /// Of one on a bound: where it would go without it.
    pub wants: Option<f64>,
}

/// A combination of controls and how well the markers see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Combination {
    /// By how many standard deviations of theirs the markers move per unit of it, controls in parts of their ranges.
    pub singular: f64,
    /// Its controls, as indices of the model's, with their parts; those that matter, the greatest first.
    pub parts: Vec<(usize, f64)>,
}

impl Combination {
    /// Its controls with their parts, for example `0.71 a - 0.70 b`; `names` are those of all controls of the model.
    pub fn words(&self, names: &[impl AsRef<str>]) -> String {
        let mut words = String::new();
        for (k, part) in &self.parts {
            words += match (words.is_empty(), *part < 0.0) {
                (true, false) => "",
                (true, true) => "-",
                (false, false) => " + ",
                (false, true) => " - ",
            };
            words += &format!("{:.2} {}", part.abs(), names[*k].as_ref());
        }
        words
    }

    /// The standard deviation along it, in parts of ranges.
    pub fn sd(&self) -> f64 {
        1.0 / self.singular
    }

    /// Whether the markers tell more of it than the ranges do.
    pub fn is_determined(&self) -> bool {
        self.singular * self.singular * PRIOR_DOMINATED > RANGE_ALONE
    }
}

/// What remains of the residual of a marker whatever admissible controls do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unexplained {
    /// Index of the marker.
    pub marker: usize,
    /// Model minus measured with the best admissible controls, to first order, mm.
    pub left_mm: [f64; 3],
    /// The root mean square length that noise alone would leave, mm.
    pub expected_mm: f64,
}

/// What a frame tells.
pub struct Told {
    /// Of every control that was sought.
    pub controls: Vec<Known>,
    /// All combinations, the one best seen first.
    pub combinations: Vec<Combination>,
    /// Pairs of free controls that are told together better than apart.
    pub pairs: Vec<Pair>,
    /// Of every marker that was measured.
    pub unexplained: Vec<Unexplained>,
    /// Whether the frame is bridged: its markers were not used.
    pub bridged: bool,
}

impl Evidence {
    /// Of a fitted frame; `None` where the residuals are too few to say how large marker errors are.
    pub fn of(estimate: &Estimate, controls: &[Control], unknowns: &[usize]) -> Option<Evidence> {
        let variance = estimate.variance?.max(LEAST_VARIANCE);
        let ranges: Vec<[f64; 2]> = unknowns.iter().map(|k| [controls[*k].lower, controls[*k].upper]).collect();
        let n = unknowns.len();
        let size = |k: usize| ranges[k][1] - ranges[k][0];
        let square = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |a, b| m[(a, b)] * size(a) * size(b) / variance);
        let j = &estimate.jacobian;
        Some(Evidence {
            values: unknowns.iter().map(|k| estimate.equilibrium.state.controls[*k]).collect(),
            bounds: unknowns.iter().map(|k| estimate.bounds[*k]).collect(),
            j: DMatrix::from_fn(j.nrows(), n, |row, k| j[(row, k)] * size(k) / variance.sqrt()),
            residuals: estimate.residuals.iter().map(|r| r / variance.sqrt()).collect(),
            information: square(&estimate.information),
            prior: square(&estimate.prior),
            gradient: estimate.gradient.iter().enumerate().map(|(k, g)| g * size(k) / variance).collect(),
            sigma: variance.sqrt(),
            bridged: estimate.bridged,
            unknowns: unknowns.to_vec(),
            ranges,
        })
    }

    fn size(&self, k: usize) -> f64 {
        self.ranges[k][1] - self.ranges[k][0]
    }

    /// The controls between their bounds, as indices of those that were sought.
    pub fn free(&self) -> Vec<usize> {
        (0..self.unknowns.len()).filter(|k| self.bounds[*k] == Bound::Free).collect()
    }

    /// All that the frame tells. `markers` are those of the fit, `measured` says which of them the frame shows.
    ///
    /// # Errors
    /// Where the quadratic program of the residuals is not solved.
    pub fn told(&self, markers: &[Marker], measured: &[bool]) -> Result<Told> {
        Ok(Told {
            controls: self.controls(),
            combinations: combinations(&self.unknowns, &self.j.tr_mul(&self.j)),
            pairs: pairs::pairs(self),
            unexplained: self.unexplained(markers, measured)?,
            bridged: self.bridged,
        })
    }

    /// The covariance of the controls in parts of their ranges: of those that are free, and on the diagonal the square of what a
    /// one-sided interval has for a standard deviation. What is not determined is known by its range.
    pub fn covariance(&self) -> DMatrix<f64> {
        let n = self.unknowns.len();
        let free = self.free();
        let whole = &self.information + &self.prior;
        let ranges = DMatrix::from_diagonal_element(free.len(), free.len(), RANGE_ALONE);
        let known = whole.select_rows(&free).select_columns(&free) + ranges;
        let mut covariance = DMatrix::zeros(n, n);
        if let Some(inverse) = known.cholesky().map(|c| c.inverse()) {
            for (a, k) in free.iter().enumerate() {
                free.iter().enumerate().for_each(|(b, l)| covariance[(*k, *l)] = inverse[(a, b)]);
            }
        }
        for (k, known) in self.controls().iter().enumerate().filter(|(_, known)| known.bound != Bound::Free) {
            let spread = (known.interval[1] - known.interval[0]) / self.size(k) / TWO_SIDED_95;
            covariance[(k, k)] = spread * spread;
        }
        covariance
    }

    fn controls(&self) -> Vec<Known> {
        let whole = &self.information + &self.prior;
        let free = self.free();
        let known = SymmetricInverse::new(&whole.select_rows(&free).select_columns(&free));
        let n = self.unknowns.len();
        let alone = &self.prior + DMatrix::from_diagonal_element(n, n, RANGE_ALONE);
        let alone = SymmetricInverse::new(&alone);
        (0..self.unknowns.len())
            .map(|k| {
                let (size, [lower, upper]) = (self.size(k), self.ranges[k]);
                let prior_sd = alone.variance(k).unwrap_or(1.0 / RANGE_ALONE).sqrt();
                let value = self.values[k];
                // spread: standard deviation, or what of a one-sided interval is one
                let (sd, spread, interval, wants) = match self.bounds[k] {
                    Bound::Free => {
                        let at = free.iter().position(|f| *f == k).unwrap_or(0);
                        let sd = known.variance(at).map(f64::sqrt);
                        let half = sd.map_or(f64::INFINITY, |sd| TWO_SIDED_95 * sd * size);
                        (sd, sd, [(value - half).max(lower), (value + half).min(upper)], None)
                    }
                    bound => {
                        let inwards = if bound == Bound::Lower { 1.0 } else { -1.0 };
                        let across: Vec<f64> = free.iter().map(|f| whole[(*f, k)]).collect();
                        let stiffness = (whole[(k, k)] - known.square(&across)).max(0.0);
                        let push = (inwards * self.gradient[k]).max(0.0);
                        let spread = one_sided(push, stiffness);
                        let end = (value + inwards * spread * size).clamp(lower, upper);
                        let wants = (stiffness > 0.0).then(|| value - inwards * push / stiffness * size);
                        (None, Some(spread / TWO_SIDED_95), [value.min(end), value.max(end)], wants)
                    }
                };
                let told = spread.is_some_and(|s| s * s < PRIOR_DOMINATED * prior_sd * prior_sd);
                Known {
                    control: self.unknowns[k],
                    value,
                    bound: self.bounds[k],
                    sd: sd.map(|sd| sd * size),
                    interval,
                    prior_sd: prior_sd * size,
                    prior_dominated: !told,
                    wants,
                }
            })
            .collect()
    }

    /// min |r + J d| over the controls within their bounds, marker by marker.
    fn unexplained(&self, markers: &[Marker], measured: &[bool]) -> Result<Vec<Unexplained>> {
        let n = self.unknowns.len();
        let mut h = self.j.tr_mul(&self.j);
        let largest = h.diagonal().iter().copied().fold(0.0, f64::max);
        let left = if largest > 0.0 {
            let g = self.j.tr_mul(&DVector::from_column_slice(&self.residuals));
            (0..n).for_each(|k| h[(k, k)] += UNSEEN * largest);
            let to = |k: usize, end: usize| (self.ranges[k][end] - self.values[k]) / self.size(k);
            let lower: Vec<f64> = (0..n).map(|k| to(k, 0).min(0.0)).collect();
            let upper: Vec<f64> = (0..n).map(|k| to(k, 1).max(0.0)).collect();
            let d = bounded_step(&h, g.as_slice(), &lower, &upper)?;
            &self.j * DVector::from_vec(d) + DVector::from_column_slice(&self.residuals)
        } else {
            DVector::from_column_slice(&self.residuals)
        };
        let free = self.free();
        let j = self.j.select_columns(&free);
        let inverse = SymmetricInverse::new(&j.tr_mul(&j));
        let shown = (0..markers.len()).filter(|m| measured[*m]);
        Ok(shown
            .enumerate()
            .map(|(at, marker)| {
                let sd = self.sigma * markers[marker].sd.unwrap_or(1.0);
                let leverage = |i: usize| inverse.square(&j.row(3 * at + i).iter().copied().collect::<Vec<f64>>());
                let noise: f64 = (0..3).map(|i| (1.0 - leverage(i)).max(0.0)).sum();
                Unexplained {
                    marker,
                    left_mm: std::array::from_fn(|i| sd * left[3 * at + i]),
                    expected_mm: sd * noise.sqrt(),
                }
            })
            .collect())
    }
}

/// The u below which 95 % of exp(- push u - stiffness u^2 / 2) lies, at most all of a range.
fn one_sided(push: f64, stiffness: f64) -> f64 {
    let sd = stiffness.sqrt();
    let u = match sd > 0.0 {
        true => one_sided_95(push / sd) / sd,
        false if push > 0.0 => 20.0_f64.ln() / push,
        false => 1.0,
    };
    u.min(0.95)
}

/// Combinations from the information of the markers, controls in parts of their ranges: its eigenvectors.
pub(super) fn combinations(unknowns: &[usize], information: &DMatrix<f64>) -> Vec<Combination> {
    /// Parts smaller than this part of the greatest are not told.
    const MATTERS: f64 = 0.15;
    let eigen = SymmetricEigen::new(information.clone());
    let mut all: Vec<Combination> = (0..unknowns.len())
        .map(|k| {
            let vector = eigen.eigenvectors.column(k);
            let greatest = vector.amax();
            let mut parts: Vec<(usize, f64)> = unknowns.iter().copied().zip(vector.iter().copied()).collect();
            parts.retain(|(_, part)| part.abs() >= MATTERS * greatest);
            parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            // the first counts as raised
            let sign = parts.first().map_or(1.0, |(_, part)| part.signum());
            parts.iter_mut().for_each(|(_, part)| *part *= sign);
            Combination { singular: eigen.eigenvalues[k].max(0.0).sqrt(), parts }
        })
        .collect();
    all.sort_by(|a, b| b.singular.total_cmp(&a.singular));
    all
}

impl Unexplained {
    /// Length of [`Unexplained::left_mm`].
    pub fn distance_mm(&self) -> f64 {
        norm(self.left_mm)
    }
}
