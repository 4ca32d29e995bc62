//! The error of one axis, and how it counts.

use crate::scene::LossSpec;

/// The error of a fitted axis against a measured one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// The angle between the lines, from 0 to pi/2.
    pub theta: f64,
    /// The way from the fitted to the measured axis along the directions of growing A and B, radians.
    pub along: [f64; 2],
    /// The length of dn/dA, cos B.
    pub cosine: f64,
}

/// n = (cos B cos A, cos B sin A, -sin B) in the frame; dn/dA = cos B (-sin A, cos A, 0); dn/dB = (-sin B cos A, -sin B sin A,
/// -cos B), at right angles to it. The way is the logarithm on the sphere, with the sign of m that is nearer.
pub fn misfit([a, b]: [f64; 2], m: [f64; 3]) -> Misfit {
    let ((sa, ca), (sb, cb)) = (a.sin_cos(), b.sin_cos());
    let in_plane = ca * m[0] + sa * m[1];
    let dot = cb * in_plane - sb * m[2];
    let side = if dot < 0.0 { -1.0 } else { 1.0 };
    let u = side * (ca * m[1] - sa * m[0]);
    let v = -side * (sb * in_plane + cb * m[2]);
    let sine = u.hypot(v);
    let theta = sine.atan2(dot.abs());
    let scale = if sine > 1e-12 { theta / sine } else { 1.0 };
    Misfit { theta, along: [u * scale, v * scale], cosine: cb }
}

/// rho(theta), its weight omega = rho'(theta) / (2 theta), and omega'(theta) / theta.
pub fn loss(spec: LossSpec, theta: f64) -> [f64; 3] {
    match spec {
        LossSpec::Quadratic => [theta * theta, 1.0, 0.0],
        LossSpec::HuberDeg(scale) => {
            let k = scale.to_radians();
            if theta <= k {
                [theta * theta, 1.0, 0.0]
            } else {
                [2.0 * k * theta - k * k, k / theta, -k / theta.powi(3)]
            }
        }
        LossSpec::CauchyDeg(scale) => {
            let k2 = scale.to_radians().powi(2);
            let omega = 1.0 / (1.0 + theta * theta / k2);
            [k2 * (theta * theta / k2).ln_1p(), omega, -2.0 * omega * omega / k2]
        }
    }
}
