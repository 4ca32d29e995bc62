//! A capsule: a cylinder with half spheres as its ends, solid (s = 1) or hollow (s = -1).
//!
//! With the foot y on the segment between the ends and its unit vector a:
//!
//! ```text
//! g = s (|x - y| - r),  dg/dx = n = s (x - y) / |x - y|
//! d2g/dx2 = s (Q - n (x) n) / |x - y|,  Q = I - a (x) a beside the segment, I beyond its ends
//! ```

use super::{FreeSide, Gap, RigidSurface, across, around};
use crate::math::tensor::{IDENTITY, Vector, add_scaled, dot, norm, subtract};

/// All points at `radius` from a segment. The normal is continuous where the ends begin, the curvature is not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// The ends of the segment, mm; they differ.
    pub ends: [Vector; 2],
    /// Radius, mm.
    pub radius: f64,
    /// The side where g > 0.
    pub free: FreeSide,
}

impl RigidSurface for Capsule {
    fn name(&self) -> &'static str {
        "capsule"
    }

    fn gap(&self, x: Vector) -> Option<Gap> {
        let [start, end] = self.ends;
        let span = subtract(end, start);
        let length = norm(span);
        let axis = span.map(|s| s / length);
        let along = dot(axis, subtract(x, start));
        let foot = add_scaled(start, along.clamp(0.0, length), axis);
        let beside = (0.0..=length).contains(&along);
        let projector = if beside { across(axis) } else { IDENTITY };
        Some(around(x, foot, &projector, self.radius, self.free))
    }
}
