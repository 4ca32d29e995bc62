//! How far fitted controls can be believed: the covariance from J^T J on the controls that are free.

use nalgebra::{DMatrix, SymmetricEigen};

/// Where a fitted control lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Between its bounds.
    Free,
    /// On its lower bound.
    Lower,
    /// On its upper bound.
    Upper,
}

/// Directions with less than this part of the largest information are not determined by the markers.
const UNSEEN: f64 = 1e-12;

/// Standard deviations of the controls for weighted residuals of unit variance: sqrt diag (J_f^T J_f)^-1 on the free set.
///
/// `j` holds d(weighted residual)/d(control), one column per control. `None` for a control on a bound, where the model
/// of a normal error does not hold, and for one that the markers do not determine.
pub fn standard_deviations(j: &DMatrix<f64>, bounds: &[Bound]) -> Vec<Option<f64>> {
    let mut all = vec![None; bounds.len()];
    let free: Vec<usize> = (0..bounds.len()).filter(|k| bounds[*k] == Bound::Free).collect();
    if free.is_empty() {
        return all;
    }
    // scaled to unit diagonal, so that "unseen" does not depend on the units of the controls
    let j = j.select_columns(&free);
    let sizes: Vec<f64> = j.column_iter().map(|c| c.norm()).collect();
    if sizes.contains(&0.0) {
        return remove_unseen(&j, &sizes, &free, all);
    }
    let information = j.tr_mul(&j);
    let scaled = DMatrix::from_fn(free.len(), free.len(), |a, b| information[(a, b)] / (sizes[a] * sizes[b]));
    let eigen = SymmetricEigen::new(scaled);
    let largest = eigen.eigenvalues.max();
    for (a, k) in free.iter().enumerate() {
        let mut variance = 0.0;
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > UNSEEN * largest {
                variance += vector[a] * vector[a] / value;
            } else if vector[a].abs() > 1e-6 {
                variance = f64::INFINITY;
            }
        }
        let sd = variance.sqrt() / sizes[a];
        all[*k] = sd.is_finite().then_some(sd);
    }
    all
}

/// The standard deviations of the controls that some marker sees.
fn remove_unseen(j: &DMatrix<f64>, sizes: &[f64], free: &[usize], mut all: Vec<Option<f64>>) -> Vec<Option<f64>> {
    let seen: Vec<usize> = (0..free.len()).filter(|a| sizes[*a] > 0.0).collect();
    let found = standard_deviations(&j.select_columns(&seen), &vec![Bound::Free; seen.len()]);
    for (a, sd) in seen.iter().zip(found) {
        all[free[*a]] = sd;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_inverse_on_the_free_set() {
        let j = DMatrix::from_row_slice(4, 3, &[1.0, 0.2, 5.0, 0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 0.3, 0.1, 2.0]);
        let sd = standard_deviations(&j, &[Bound::Free, Bound::Free, Bound::Upper]);
        let part = j.columns(0, 2).into_owned();
        let inverse = part.tr_mul(&part).try_inverse().expect("regular");
        assert!((sd[0].expect("free") - inverse[(0, 0)].sqrt()).abs() < 1e-12);
        assert!((sd[1].expect("free") - inverse[(1, 1)].sqrt()).abs() < 1e-12);
        assert_eq!(sd[2], None);
    }

    #[test]
    fn what_no_marker_sees_has_no_deviation() {
        let j = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 2.0, 2.0, 0.0, 0.5, 0.5, 0.0]);
        assert_eq!(standard_deviations(&j, &[Bound::Free; 3]), vec![None; 3]);
        let j = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 2.0, 0.0]);
        let sd = standard_deviations(&j, &[Bound::Free; 2]);
        assert!((sd[0].expect("seen") - 1.0 / 5.0_f64.sqrt()).abs() < 1e-14);
        assert_eq!(sd[1], None);
    }
}
