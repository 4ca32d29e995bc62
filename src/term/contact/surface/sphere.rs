//! A sphere, solid or hollow.

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
