//! A sphere about c with the radius r, solid (s = 1) or hollow (s = -1).
//!
//! ```text
//! g = s (|x - c| - r),  dg/dx = n = s (x - c) / |x - c|,  d2g/dx2 = s (I - n (x) n) / |x - c|
//! ```

use super::{FreeSide, Gap, RigidSurface, around};
use crate::math::tensor::{IDENTITY, Vector};

/// All points at `radius` from `centre`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Centre, mm.
    pub centre: Vector,
    /// Radius, mm.
    pub radius: f64,
    /// The side where g > 0.
    pub free: FreeSide,
}

impl RigidSurface for Sphere {
    fn name(&self) -> &'static str {
        "sphere"
    }

    fn gap(&self, x: Vector) -> Option<Gap> {
        Some(around(x, self.centre, &IDENTITY, self.radius, self.free))
    }
}
