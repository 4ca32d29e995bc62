//! Dead traction: a force per reference area that keeps its direction, f = integral over the faces of t N_a.

use super::DeadLoad;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Vector, norm};
use crate::mesh::face::Face;
use crate::mesh::{Mesh, position_and_jacobian};

/// Traction in kPa on `faces`, `gauss` points per direction on each.
pub fn traction(mesh: &Mesh, faces: &[Face], traction: Vector, gauss: usize) -> DeadLoad {
    let rule = GaussRule::new(gauss);
    let mut forces: Vec<Option<[[f64; 64]; 3]>> = vec![None; mesh.elements()];
    for face in faces {
        let local = mesh.local(face.element);
        let force = forces[face.element].get_or_insert([[0.0; 64]; 3]);
        for (st, weight) in rule.square() {
            let xi = face.side.lift(st);
            let (_, jacobian) = position_and_jacobian(mesh.element, &local, xi);
            let w = weight * norm(face.side.area_vector(&jacobian));
            for (a, n) in mesh.element.values(xi).iter().enumerate() {
                for i in 0..3 {
                    force[i][a] += w * traction[i] * n;
                }
            }
        }
    }
    DeadLoad { name: "traction", forces, points: rule.len().pow(2) }
}
