//! Weight: f = integral over the reference volume of rho g N_a. With rho in kg/m3 and g in m/s2, rho g is in
//! N/m3 = 1e-6 mN/mm3.

use super::DeadLoad;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Vector, determinant};
use crate::mesh::{Mesh, position_and_jacobian};

/// Gravity on the whole host: density in kg/m3, acceleration in m/s2, `gauss` points per direction.
pub fn gravity(mesh: &Mesh, density: f64, acceleration: Vector, gauss: usize) -> DeadLoad {
    let per_volume = acceleration.map(|a| 1e-6 * density * a);
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
    DeadLoad { name: "gravity", forces: forces.collect(), points: rule.len().pow(3) }
}
