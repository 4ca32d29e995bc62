//! Pairs of controls that the markers see together and cannot tell apart.

use super::{Evidence, RANGE_ALONE};
use crate::math::normal::TWO_SIDED_95;
use nalgebra::DMatrix;

/// A pair whose errors correlate by more is told of.
pub const TOO_ALIKE: f64 = 0.9;

/// Two controls whose errors are correlated. Where one is thought too great the other is thought too small (a negative
/// correlation), and a sum of both is what the markers determine; with a positive one it is a difference.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Their indices in the model, ascending.
    pub controls: [usize; 2],
    /// Of their errors.
    pub correlation: f64,
    /// The w of the combination a + w b with the least variance, in the units of the controls.
    pub weight: f64,
    /// Value of that combination.
    pub together: f64,
    /// Its standard deviation.
    pub together_sd: f64,
    /// Standard deviations of both alone.
    pub apart_sd: [f64; 2],
    /// Whether the markers leave the split between both to what was known before.
    pub prior_dominated: bool,
}

impl Pair {
    /// The combination in words: `their sum`, or `a - 0.4 b`.
    pub fn words(&self, names: &[impl AsRef<str>]) -> String {
        let [a, b] = self.controls.map(|k| names[k].as_ref());
        match self.weight {
            w if (w - 1.0).abs() < 0.05 => "their sum".into(),
            w if (w + 1.0).abs() < 0.05 => format!("{a} minus {b}"),
            w if w < 0.0 => format!("{a} - {:.2} {b}", -w),
            w => format!("{a} + {w:.2} {b}"),
        }
    }

    /// How far they are from being one: 1 - |correlation|.
    pub fn distinct(&self) -> f64 {
        1.0 - self.correlation.abs()
    }

    /// The half width of the 95 % interval of the combination.
    pub fn together_95(&self) -> f64 {
        TWO_SIDED_95 * self.together_sd
    }
}

/// The pairs of a frame, most alike first. What is not seen at all is known by the range of the control.
pub(super) fn pairs(evidence: &Evidence) -> Vec<Pair> {
    let free = evidence.free();
    let n = free.len();
    let whole = &evidence.information + &evidence.prior;
    let known = whole.select_rows(&free).select_columns(&free) + DMatrix::from_diagonal_element(n, n, RANGE_ALONE);
    let Some(covariance) = known.cholesky().map(|c| c.inverse()) else { return Vec::new() };
    let mut found = Vec::new();
    for a in 0..n {
        for b in 0..a {
            let (va, vb, cov) = (covariance[(b, b)], covariance[(a, a)], covariance[(a, b)]);
            let correlation = cov / (va * vb).sqrt();
            if correlation.abs() <= TOO_ALIKE {
                continue;
            }
            let (k, l) = (free[b], free[a]);
            let (size_k, size_l) = (evidence.size(k), evidence.size(l));
            let weight = -cov / vb * size_k / size_l;
            let sds = [va.sqrt(), vb.sqrt()];
            found.push(Pair {
                controls: [evidence.unknowns[k], evidence.unknowns[l]],
                correlation,
                weight,
                together: evidence.values[k] + weight * evidence.values[l],
                together_sd: (va * (1.0 - correlation * correlation)).sqrt() * size_k,
                apart_sd: [sds[0] * size_k, sds[1] * size_l],
                prior_dominated: sds.iter().any(|sd| sd * sd * RANGE_ALONE > 0.5),
            });
        }
    }
    found.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    found
}
