//! Barrier: grows without bound as the gap closes, so that nothing ever penetrates (Li et al. 2020, Incremental Potential
//! Contact). C2; the gap that it leaves is a part of its range.
//!
//! ```text
//! psi = - k (g - r)^2 ln(g / r) for 0 < g < r,  0 beyond the range r
//! ```

use super::{Allows, ContactLaw, Response};

/// psi = - k (g - r)^2 ln(g / r) for 0 < g < r, zero beyond the range r.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barrier {
    /// k, kPa/mm.
    pub stiffness: f64,
    /// r, mm.
    pub range: f64,
}

impl ContactLaw for Barrier {
    fn name(&self) -> &'static str {
        "barrier"
    }

    fn stiffness(&self) -> f64 {
        self.stiffness
    }

    fn range(&self) -> f64 {
        self.range
    }

    fn response(&self, gap: f64, _allows: Allows, _multiplier: f64) -> Response {
        let (k, r) = (self.stiffness, self.range);
        if gap >= r {
            return Response::NONE;
        }
        if gap <= 0.0 {
            return Response { energy: f64::NAN, slope: f64::NAN, stiffness: f64::NAN };
        }
        let (d, log) = (gap - r, (gap / r).ln());
        Response {
            energy: -k * d * d * log,
            slope: -k * (2.0 * d * log + d * d / gap),
            stiffness: -k * (2.0 * log + 4.0 * d / gap - d * d / (gap * gap)),
        }
    }
}
