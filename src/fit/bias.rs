//! What an error of the model does to fitted controls.
//!
//! A better model has its markers at m + dm where this one has them at m. To first order its fit would move the controls by
//!   dq = - (J^T J)^-1 J^T W dm,   J = W dm/dq on the controls that are free
//! and the controls that were fitted are off by the opposite.

use super::covariance::Bound;
use super::placement::Marker;
use super::sequence::Estimate;
use nalgebra::{DMatrix, DVector};

/// Directions with less than this part of the largest singular value are not determined by the markers.
const UNSEEN: f64 = 1e-6;

/// By how much each control of the model is too great where the markers of a better model lie `shift` (mm) from where they
/// should; `None` for a control on a bound or not sought, or where the markers do not determine the free ones.
///
/// `unknowns`: the controls that the fit sought, the columns of its derivative.
pub fn bias(estimate: &Estimate, markers: &[Marker], unknowns: &[usize], shift: &[[f64; 3]]) -> Vec<Option<f64>> {
    let mut all = vec![None; estimate.bounds.len()];
    let free: Vec<usize> = (0..unknowns.len()).filter(|k| estimate.bounds[unknowns[*k]] == Bound::Free).collect();
    let shown = markers.iter().zip(shift).zip(&estimate.measured_mm).filter(|(_, measured)| measured.is_some());
    let weighted = shown.flat_map(|((marker, shift), _)| shift.map(|s| s / marker.sd.unwrap_or(1.0)));
    let weighted = DVector::from_iterator(estimate.jacobian.nrows(), weighted);
    for (k, value) in free.iter().zip(least_squares(&estimate.jacobian.select_columns(&free), &weighted)) {
        all[unknowns[*k]] = Some(value);
    }
    all
}

/// The x that makes |J x - b| least; empty where J does not determine it.
fn least_squares(j: &DMatrix<f64>, b: &DVector<f64>) -> Vec<f64> {
    if j.ncols() == 0 {
        return Vec::new();
    }
    // columns of unit length, so that "unseen" does not depend on the units of the controls
    let sizes: Vec<f64> = j.column_iter().map(|c| c.norm()).collect();
    let scaled = DMatrix::from_fn(j.nrows(), j.ncols(), |r, c| j[(r, c)] / sizes[c]);
    if sizes.iter().any(|size| !(*size > 0.0 && size.is_finite())) {
        return Vec::new();
    }
    let svd = scaled.svd(true, true);
    if svd.singular_values.min() <= UNSEEN * svd.singular_values.max() {
        return Vec::new();
    }
    let x = svd.solve(b, 0.0).unwrap_or_else(|_| DVector::zeros(0));
    x.iter().zip(sizes).map(|(x, size)| x / size).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_along_the_sensitivities_is_found_again() {
        let j = DMatrix::from_row_slice(4, 2, &[1.0, 0.2e-3, 0.0, 2.0e-3, 1.0, 1.0e-3, 0.3, 0.1e-3]);
        let x = DVector::from_vec(vec![0.25, -40.0]);
        let found = least_squares(&j, &(&j * &x));
        assert!((found[0] - 0.25).abs() < 1e-12 && (found[1] + 40.0).abs() < 1e-9, "{found:?}");
        let alike = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 2.0, 4.0, 0.5, 1.0]);
        assert!(least_squares(&alike, &DVector::zeros(3)).is_empty());
    }
}
