//! A cylinder without ends about the line through c along the unit vector a, with the radius r, solid (s = 1) or hollow (s = -1).
//!
//! ```text
//! y = c + a (a . (x - c)),  g = s (|x - y| - r),  dg/dx = n = s (x - y) / |x - y|,  d2g/dx2 = s (I - a (x) a - n (x) n) / |x - y|
//! ```

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
