//! A cylinder without ends, solid or hollow.

use super::{FreeSide, Gap, RigidSurface, across, around};
use crate::math::tensor::{Vector, add_scaled, dot, subtract};

/// All points at `radius` from a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// A point of the axis, mm.
    pub through: Vector,
    /// The unit vector along the axis.
    pub axis: Vector,
    /// Radius, mm.
    pub radius: f64,
    /// The side where g > 0.
    pub free: FreeSide,
}

impl RigidSurface for Cylinder {
    fn name(&self) -> &'static str {
        "cylinder"
    }

    fn gap(&self, x: Vector) -> Option<Gap> {
        let along = dot(self.axis, subtract(x, self.through));
        let foot = add_scaled(self.through, along, self.axis);
        Some(around(x, foot, &across(self.axis), self.radius, self.free))
    }
}
