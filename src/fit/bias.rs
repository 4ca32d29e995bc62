//! What an error of the model does to fitted controls.
//!
//! A better model has its markers at m + dm where this one has them at m. To first order its fit would move the controls by
//!   dq = - (J^T J + P)^-1 J^T W dm,   J = W dm/dq on the controls that are free, P what else is asked for
//! but smoothness, whose other frames are off alike; and the controls that were fitted are off by the opposite.

use super::covariance::Bound;
use super::estimate::Estimate;
use super::placement::Marker;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Directions with less than this part of the largest singular value are not determined by the markers.
const UNSEEN: f64 = 1e-6;
/// A control with a smaller part in such a direction counts as determined.
const PART: f64 = 1e-4;

/// By how much each control of the model is too great where the markers of a better model lie `shift` (mm) from where they
/// should; `None` for a control on a bound or not sought, or that the markers do not determine.
///
/// `unknowns`: the controls that the fit sought, the columns of its derivative.
pub fn bias(estimate: &Estimate, markers: &[Marker], unknowns: &[usize], shift: &[[f64; 3]]) -> Vec<Option<f64>> {
    let mut all = vec![None; estimate.bounds.len()];
    let free: Vec<usize> = (0..unknowns.len()).filter(|k| estimate.bounds[unknowns[*k]] == Bound::Free).collect();
    let shown = markers.iter().zip(shift).zip(&estimate.measured_mm).filter(|(_, measured)| measured.is_some());
    let weights = shown.zip(&estimate.weights);
    let weighted = weights.flat_map(|(((marker, shift), _), w)| shift.map(|s| w * s / marker.sd.unwrap_or(1.0)));
    let weighted = DVector::from_iterator(estimate.jacobian.nrows(), weighted);
    let whole = estimate.response.select_rows(&free).select_columns(&free);
    let right = estimate.jacobian.select_columns(&free).tr_mul(&weighted);
    for (k, value) in free.iter().zip(solve(&whole, &right)) {
        all[unknowns[*k]] = value;
    }
    all
}

/// The x of M x = b, M symmetric and positive semidefinite; `None` for an entry that M does not determine.
fn solve(m: &DMatrix<f64>, b: &DVector<f64>) -> Vec<Option<f64>> {
    let n = m.ncols();
    if n == 0 {
        return Vec::new();
    }
    // scaled to a unit diagonal, so that "unseen" does not depend on the units of the controls
    let sizes: Vec<f64> = m.diagonal().iter().map(|d| d.max(0.0).sqrt()).collect();
    let part = |k: usize| if sizes[k] > 0.0 { 1.0 / sizes[k] } else { 0.0 };
    let scaled = DMatrix::from_fn(n, n, |r, c| m[(r, c)] * part(r) * part(c));
    let right = DVector::from_fn(n, |k, _| b[k] * part(k));
    if scaled.iter().chain(right.iter()).any(|value| !value.is_finite()) {
        return vec![None; n];
    }
    let eigen = SymmetricEigen::new(scaled);
    let seen = UNSEEN * UNSEEN * eigen.eigenvalues.max();
    let mut x = vec![Some(0.0); n];
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        let along = vector.dot(&right) / value;
        for (k, x) in x.iter_mut().enumerate() {
            match *value > seen {
                true => *x = x.map(|x| x + along * vector[k] / sizes[k]),
                false if vector[k].abs() > PART => *x = None,
                false => {}
            }
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_along_the_sensitivities_is_found_again() {
        let j = DMatrix::from_row_slice(4, 2, &[1.0, 0.2e-3, 0.0, 2.0e-3, 1.0, 1.0e-3, 0.3, 0.1e-3]);
        let x = DVector::from_vec(vec![0.25, -40.0]);
        let found = solve(&j.tr_mul(&j), &j.tr_mul(&(&j * &x)));
        let found: Vec<f64> = found.into_iter().flatten().collect();
        assert!((found[0] - 0.25).abs() < 1e-10 && (found[1] + 40.0).abs() < 1e-7, "{found:?}");
        // two that are alike are not determined, a third is
        let alike = DMatrix::from_row_slice(3, 3, &[1.0, 2.0, 0.0, 2.0, 4.0, 1.0, 0.5, 1.0, -2.0]);
        let found = solve(&alike.tr_mul(&alike), &alike.tr_mul(&DVector::from_vec(vec![0.0, 3.0, -6.0])));
        assert!(
            found[0].is_none() && found[1].is_none() && (found[2].unwrap_or(0.0) - 3.0).abs() < 1e-9,
            "{found:?}"
        );
    }
}
