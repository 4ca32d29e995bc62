//! How far fitted controls can be believed: the covariance from their information on the controls that are free.

use nalgebra::{DMatrix, Dyn, SymmetricEigen};

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

/// Standard deviations of the controls, sqrt diag (A_ff)^-1 on the free set, from their information A (J^T J of weighted
/// residuals of unit variance, and what else is known). `None` for a control on a bound, where the model of a normal error does
/// not hold, and for one that is not determined.
pub fn standard_deviations(information: &DMatrix<f64>, bounds: &[Bound]) -> Vec<Option<f64>> {
    let mut all = vec![None; bounds.len()];
    let free: Vec<usize> = (0..bounds.len()).filter(|k| bounds[*k] == Bound::Free).collect();
    let inverse = SymmetricInverse::new(&information.select_rows(&free).select_columns(&free));
    for (at, k) in free.iter().enumerate() {
        all[*k] = inverse.variance(at).map(f64::sqrt);
    }
    all
}

/// The inverse of a positive semidefinite matrix on the directions that it sees. They are told apart with the diagonal scaled
/// to one, so that it does not depend on units.
pub struct SymmetricInverse {
    eigen: Option<SymmetricEigen<f64, Dyn>>,
    sizes: Vec<f64>,
}

impl SymmetricInverse {
    /// Of a symmetric matrix.
    pub fn new(m: &DMatrix<f64>) -> SymmetricInverse {
        let sizes: Vec<f64> = m.diagonal().iter().map(|d| d.max(0.0).sqrt()).collect();
        let part = |a: usize| if sizes[a] > 0.0 { 1.0 / sizes[a] } else { 0.0 };
        let scaled = DMatrix::from_fn(m.nrows(), m.nrows(), |a, b| m[(a, b)] * part(a) * part(b));
        // what is not finite is not seen
        let eigen = (m.nrows() > 0 && scaled.iter().all(|x| x.is_finite())).then(|| SymmetricEigen::new(scaled));
        SymmetricInverse { eigen, sizes }
    }

    /// Entry k, k of the inverse; `None` where a direction that is not seen has a part of k.
    pub fn variance(&self, k: usize) -> Option<f64> {
        let eigen = self.eigen.as_ref()?;
        let largest = eigen.eigenvalues.max();
        let mut variance = 0.0;
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > UNSEEN * largest {
                variance += vector[k] * vector[k] / value;
            } else if vector[k].abs() > 1e-6 {
                return None;
            }
        }
        let variance = variance / (self.sizes[k] * self.sizes[k]);
        variance.is_finite().then_some(variance)
    }

    /// M^-1 on the directions that are seen.
    pub fn matrix(&self) -> DMatrix<f64> {
        let n = self.sizes.len();
        let mut inverse = DMatrix::zeros(n, n);
        let Some(eigen) = &self.eigen else { return inverse };
        let largest = eigen.eigenvalues.max();
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > UNSEEN * largest {
                inverse += vector * vector.transpose() / *value;
            }
        }
        let part = |a: usize| if self.sizes[a] > 0.0 { 1.0 / self.sizes[a] } else { 0.0 };
        DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] * part(a) * part(b))
    }

    /// v^T M^-1 v on the directions that are seen.
    pub fn square(&self, v: &[f64]) -> f64 {
        let Some(eigen) = &self.eigen else { return 0.0 };
        let largest = eigen.eigenvalues.max();
        let part = |a: usize| if self.sizes[a] > 0.0 { v[a] / self.sizes[a] } else { 0.0 };
        eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
            .filter(|(value, _)| **value > UNSEEN * largest)
            .map(|(value, vector)| (0..v.len()).map(|a| vector[a] * part(a)).sum::<f64>().powi(2) / value)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_inverse_on_the_free_set() {
        let j = DMatrix::from_row_slice(4, 3, &[1.0, 0.2, 5.0, 0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 0.3, 0.1, 2.0]);
        let sd = standard_deviations(&j.tr_mul(&j), &[Bound::Free, Bound::Free, Bound::Upper]);
        let part = j.columns(0, 2).into_owned();
        let inverse = part.tr_mul(&part).try_inverse().expect("regular");
        assert!((sd[0].expect("free") - inverse[(0, 0)].sqrt()).abs() < 1e-12);
        assert!((sd[1].expect("free") - inverse[(1, 1)].sqrt()).abs() < 1e-12);
        assert_eq!(sd[2], None);
        let whole = SymmetricInverse::new(&j.tr_mul(&j)).matrix();
        assert!((whole * j.tr_mul(&j) - DMatrix::identity(3, 3)).amax() < 1e-10);
    }

    #[test]
    fn what_no_marker_sees_has_no_deviation() {
        let j = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 2.0, 2.0, 0.0, 0.5, 0.5, 0.0]);
        assert_eq!(standard_deviations(&j.tr_mul(&j), &[Bound::Free; 3]), vec![None; 3]);
        let j = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 2.0, 0.0]);
        let sd = standard_deviations(&j.tr_mul(&j), &[Bound::Free; 2]);
        assert!((sd[0].expect("seen") - 1.0 / 5.0_f64.sqrt()).abs() < 1e-14);
        assert_eq!(sd[1], None);
    }
}
