//! How the residual of a marker counts: rho(s) of its squared length s = |m - z|^2 / sd^2.
//!
//!   quadratic: s;   Huber (1964): s up to k^2, then 2 k sqrt s - k^2;   Cauchy: c^2 ln(1 + s / c^2)

use crate::scene::MarkerLossSpec;
use nalgebra::{DMatrix, DVector};

/// A loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// All residuals count by their square.
    Quadratic,
    /// Long residuals count by their length.
    Huber {
        /// Where that begins, in standard deviations.
        k: f64,
    },
    /// Long residuals count by the logarithm of their length.
    Cauchy {
        /// Where that begins, in standard deviations.
        c: f64,
    },
}

impl From<MarkerLossSpec> for Loss {
    fn from(spec: MarkerLossSpec) -> Loss {
        match spec {
            MarkerLossSpec::Quadratic => Loss::Quadratic,
            MarkerLossSpec::HuberSds(k) => Loss::Huber { k },
            MarkerLossSpec::CauchySds(c) => Loss::Cauchy { c },
        }
    }
}

impl Loss {
    /// rho, drho/ds, d2rho/ds2 at the square s.
    fn at(self, s: f64) -> [f64; 3] {
        match self {
            Loss::Huber { k } if s > k * k => {
                let length = s.sqrt();
                [2.0 * k * length - k * k, k / length, -0.5 * k / (s * length)]
            }
            Loss::Quadratic | Loss::Huber { .. } => [s, 1.0, 0.0],
            Loss::Cauchy { c } => {
                let t = 1.0 + s / (c * c);
                [c * c * t.ln(), 1.0 / t, -1.0 / (c * c * t * t)]
            }
        }
    }

    /// How much a marker still counts in relation to one that is near: drho/ds, from 1 down to 0; one entry per marker.
    pub fn weights(self, residuals: &[f64]) -> Vec<f64> {
        residuals.chunks_exact(3).map(|r| self.at(square(r))[1]).collect()
    }

    /// 1/2 sum of rho over the markers; `residuals` are weighted, three for each.
    pub fn cost(self, residuals: &[f64]) -> f64 {
        match self {
            Loss::Quadratic => 0.5 * residuals.iter().map(|r| r * r).sum::<f64>(),
            _ => 0.5 * residuals.chunks_exact(3).map(|r| self.at(square(r))[0]).sum::<f64>(),
        }
    }

    /// Gradient and second derivative by the controls, with `j` the derivative of the residuals:
    ///   g = sum rho' J_k^T r_k,   H = sum J_k^T (rho' 1 + 2 rho'' r_k r_k^T) J_k,
    /// the bracket made positive semidefinite (Triggs et al. 2000), without derivatives of J.
    pub fn model(self, residuals: &[f64], j: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
        if self == Loss::Quadratic {
            return (j.tr_mul(&DVector::from_column_slice(residuals)).as_slice().to_vec(), j.tr_mul(j));
        }
        let n = j.ncols();
        let (mut g, mut h) = (DVector::zeros(n), DMatrix::zeros(n, n));
        for (k, r) in residuals.chunks_exact(3).enumerate() {
            let own = j.rows(3 * k, 3);
            let s = square(r);
            let [_, slope, curvature] = self.at(s);
            let along = own.tr_mul(&DVector::from_column_slice(r));
            g += slope * &along;
            h += slope * own.tr_mul(&own);
            if s > 0.0 {
                let radial = (2.0 * curvature).max(-slope / s);
                h += radial * &along * along.transpose();
            }
        }
        (g.as_slice().to_vec(), h)
    }

    /// In a few words.
    pub fn words(self) -> String {
        match self {
            Loss::Quadratic => "markers by squares".into(),
            Loss::Huber { k } => format!("markers by squares up to {k} sd, then by length (Huber)"),
            Loss::Cauchy { c } => format!("markers by the logarithm beyond {c} sd (Cauchy)"),
        }
    }
}

fn square(r: &[f64]) -> f64 {
    r.iter().map(|r| r * r).sum()
}
