//! Augmented Lagrangian: a penalty about a multiplier, renewed until the gap is closed (Alart and Curnier 1991).
//!
//! ```text
//! psi = l g + k/2 g^2 where l + k g < 0,  else - l^2 / 2k;  of a sliding, which may not open, the former;  then l := psi'
//! ```

use super::{Allows, ContactLaw, Response};

/// psi = l g + k/2 g^2 where closed, - l^2 / 2k where open; it is open where l + k g > 0 and the law allows it. The new
/// multiplier is psi'.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Augmented {
    /// k, kPa/mm.
    pub stiffness: f64,
    /// The gap, or the penetration, that may remain, mm.
    pub tolerance: f64,
}

impl ContactLaw for Augmented {
    fn name(&self) -> &'static str {
        "augmented"
    }

    fn stiffness(&self) -> f64 {
        self.stiffness
    }

    fn response(&self, gap: f64, allows: Allows, multiplier: f64) -> Response {
        let k = self.stiffness;
        let slope = multiplier + k * gap;
        if allows == Allows::ClosedOrOpen && slope > 0.0 {
            return Response { energy: -0.5 * multiplier * multiplier / k, ..Response::NONE };
        }
        Response { energy: (multiplier + 0.5 * k * gap) * gap, slope, stiffness: k }
    }

    fn gap_tolerance(&self) -> Option<f64> {
        Some(self.tolerance)
    }
}
