//! Smooth penalty: a spring per area that sets in over a range, so that Newton's method sees no kink where points open and
//! close. C2; the gap that it leaves is at most pressure / stiffness + half of the range. With the depth d = -g and the range r:
//!
//! ```text
//! psi = k d^3 / (6 r) for 0 < d < r,  k/2 (d - r/2)^2 + k r^2 / 24 beyond,  0 for d < 0
//! ```

use super::{Allows, ContactLaw, Response};

/// psi of the stiffness k and the range r.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smooth {
    /// k, kPa/mm.
    pub stiffness: f64,
    /// r, mm.
    pub range: f64,
}

impl ContactLaw for Smooth {
    fn name(&self) -> &'static str {
        "smooth"
    }

    fn eases(&self) -> Option<f64> {
        Some(self.range)
    }

    fn eased(&self, easing: f64, gap: f64, allows: Allows, multiplier: f64) -> Response {
        Smooth { range: self.range + easing, ..*self }.response(gap, allows, multiplier)
    }

    fn stiffness(&self) -> f64 {
        self.stiffness
    }

    fn response(&self, gap: f64, _allows: Allows, _multiplier: f64) -> Response {
        let (k, r, d) = (self.stiffness, self.range, -gap);
        if d <= 0.0 {
            return Response::NONE;
        }
        if d < r {
            return Response { energy: k * d * d * d / (6.0 * r), slope: -0.5 * k * d * d / r, stiffness: k * d / r };
        }
        let beyond = d - 0.5 * r;
        Response { energy: 0.5 * k * beyond * beyond + k * r * r / 24.0, slope: -k * beyond, stiffness: k }
    }
}
