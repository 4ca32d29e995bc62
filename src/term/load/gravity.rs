//! Forces on the volume: f = integral over the reference volume of b N_a with a force b per volume; for weight b = rho g.
//! With rho in kg/m3 and g in m/s2, rho g is in N/m3 = 1e-6 mN/mm3.

use super::DeadLoad;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Vector, determinant};
use crate::mesh::{Mesh, position_and_jacobian};

/// Gravity on the whole host: density in kg/m3, acceleration in m/s2, `gauss` points per direction.
pub fn gravity(mesh: &Mesh, density: f64, acceleration: Vector, gauss: usize) -> DeadLoad {
    DeadLoad { name: "gravity", ..body_force(mesh, acceleration.map(|a| 1e-6 * density * a), gauss) }
}

/// A force in mN/mm3 of reference volume on the whole host, `gauss` points per direction.
pub fn body_force(mesh: &Mesh, per_volume: Vector, gauss: usize) -> DeadLoad {
    let rule = GaussRule::new(gauss);
    let forces = (0..mesh.elements()).map(|element| {
        let local = mesh.local(element);
        let mut integral = [0.0; 64];
        for (xi, weight) in rule.cube() {
            let (_, jacobian) = position_and_jacobian(mesh.element, &local, xi);
            let w = weight * determinant(&jacobian);
            for (sum, n) in integral.iter_mut().zip(mesh.element.values(xi)) {
                *sum += w * n;
            }
        }
        Some(per_volume.map(|f| integral.map(|n| f * n)))
    });
    DeadLoad { name: "body_force", forces: forces.collect(), points: rule.len().pow(3) }
}
