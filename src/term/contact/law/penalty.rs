//! Penalty: a spring per area. C1; the gap that it leaves is pressure / stiffness.
//!
//! ```text
//! psi = k/2 g^2 for g < 0,  else 0;  of a sliding, which may not open, for every g
//! ```

use super::{Allows, ContactLaw, Response};

/// psi = k/2 g^2, of a contact that may open only for g <= 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalty {
    /// k, kPa/mm.
    pub stiffness: f64,
}

impl ContactLaw for Penalty {
    fn name(&self) -> &'static str {
        "penalty"
    }

    fn stiffness(&self) -> f64 {
        self.stiffness
    }

    fn response(&self, gap: f64, allows: Allows, _multiplier: f64) -> Response {
        let k = self.stiffness;
        // a body that just touches is held: it has nothing else to rest on
        if allows == Allows::ClosedOrOpen && gap > 0.0 {
            return Response::NONE;
        }
        Response { energy: 0.5 * k * gap * gap, slope: k * gap, stiffness: k }
    }
}
