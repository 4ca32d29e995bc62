//! A plane through c with the unit normal n towards the free side.
//!
//! ```text
//! g = n . (x - c),  dg/dx = n,  d2g/dx2 = 0
//! ```

use super::{Gap, RigidSurface};
use crate::math::tensor::{Vector, dot, subtract};

/// g = n . (x - c)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point of it, mm.
    pub through: Vector,
    /// The unit normal towards the free side.
    pub normal: Vector,
}

impl RigidSurface for Plane {
    fn name(&self) -> &'static str {
        "plane"
    }

    fn gap(&self, x: Vector) -> Option<Gap> {
        let value = dot(self.normal, subtract(x, self.through));
        Some(Gap { value, normal: self.normal, curvature: [[0.0; 3]; 3] })
    }
}
