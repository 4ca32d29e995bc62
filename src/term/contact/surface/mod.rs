//! FAMILY of rigid surfaces: the signed distance of a point, with its exact first and second derivatives.
//!
//! g(x) > 0 on the free side. dg/dx = n is the unit normal towards the free side, d2g/dx2 its curvature; n . d2g/dx2 = 0.
//! To add a surface: one file here, its line in the scene, and its case in the conformance tests (`src/guide/adding.md`).

pub mod arch;
pub mod capsule;
pub mod cylinder;
pub mod patches;
pub mod plane;
pub mod sphere;

pub use arch::Arch;
pub use capsule::Capsule;
pub use cylinder::Cylinder;
pub use patches::Patches;
pub use plane::Plane;
pub use sphere::Sphere;

use crate::math::tensor::{Matrix, Vector, norm, subtract};

/// The signed distance of a point to a surface, and its derivatives by the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// g, mm; negative behind the surface.
    pub value: f64,
    /// dg/dx, a unit vector.
    pub normal: Vector,
    /// d2g/dx2, 1/mm; symmetric.
    pub curvature: Matrix,
}

/// A surface that neither moves nor yields.
pub trait RigidSurface: Send + Sync + std::fmt::Debug {
    /// The name used in problem files.
    fn name(&self) -> &'static str;

    /// The gap of a point at `x` (mm); `None` where the surface has an edge and the point lies beyond it. NaN where the
    /// distance has no derivative: at the centre of a sphere, on the axis of a cylinder.
    fn gap(&self, x: Vector) -> Option<Gap>;
}

/// Which side of a surface that closes around something is free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FreeSide {
    /// The outside: the surface bounds a solid.
    Outside,
    /// The inside: the surface bounds a cavity.
    Inside,
}

impl FreeSide {
    /// +1 for the outside, -1 for the inside.
    fn sign(self) -> f64 {
        match self {
            FreeSide::Outside => 1.0,
            FreeSide::Inside => -1.0,
        }
    }
}

/// The gap to what lies `radius` around a point, line or segment: `foot` is its point closest to x, and `projector` maps
/// a motion of x to the part that leaves the foot behind.
///
/// d = |x - foot|,  g = +-(d - radius),  n = +-(x - foot)/d,  d2g/dx2 = +-(projector - n n^T)/d
fn around(x: Vector, foot: Vector, projector: &Matrix, radius: f64, free: FreeSide) -> Gap {
    let sign = free.sign();
    let away = subtract(x, foot);
    let distance = norm(away);
    let unit = away.map(|a| a / distance);
    Gap {
        value: sign * (distance - radius),
        normal: unit.map(|n| sign * n),
        curvature: std::array::from_fn(|i| {
            std::array::from_fn(|j| sign * (projector[i][j] - unit[i] * unit[j]) / distance)
        }),
    }
}

/// I - a a^T for a unit vector a.
fn across(axis: Vector) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)) - axis[i] * axis[j]))
}
