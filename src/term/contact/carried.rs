//! A surface on a bone: the gap is measured where the bone was at rest, and turned back.
//!
//! With X = R^T (x - c - s d) + c and the gap g0(X) of the surface at rest:
//! ```text
//! g(x) = g0(X),  dg/dx = n = R n0,  d2g/dx2 = H = R H0 R^T
//! ```
//! A point of the surface moves with velocity v and turns with spin w per unit of a control q. At a fixed x
//! ```text
//! dg/dq = - n . v,  dn/dq = w x n - H v
//! ```

use super::surface::{Gap, RigidSurface};
use crate::math::tensor::{Vector, apply, dot, subtract};
use crate::term::bone::{Pose, Twist};

/// The gap of a point at `x` (mm) to a surface that a bone carries.
pub(super) fn gap(surface: &dyn RigidSurface, pose: &Pose, x: Vector) -> Option<Gap> {
    let at_rest = surface.gap(pose.reference(x))?;
    Some(Gap {
        value: at_rest.value,
        normal: pose.turn(at_rest.normal),
        curvature: pose.turn_both(&at_rest.curvature),
    })
}

/// dg/dq of a gap at a fixed x, mm per unit of the control.
pub(super) fn gap_rate(gap: &Gap, twist: &Twist, x: Vector) -> f64 {
    -dot(gap.normal, twist.velocity(x))
}

/// dn/dq of a gap at a fixed x.
pub(super) fn normal_rate(gap: &Gap, twist: &Twist, x: Vector) -> Vector {
    subtract(twist.turning(gap.normal), apply(&gap.curvature, twist.velocity(x)))
}
