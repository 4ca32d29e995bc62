//! A force on a material point, in a node or anywhere else: f_a = F N_a at the point.

use super::DeadLoad;
use crate::math::tensor::Vector;
use crate::mesh::{MaterialPoint, Mesh};

/// A force in mN that keeps its direction, on the material point `at`.
pub fn nodal_force(mesh: &Mesh, at: MaterialPoint, force: Vector) -> DeadLoad {
    let values = mesh.element.values(at.xi);
    let mut forces: Vec<Option<[[f64; 64]; 3]>> = vec![None; mesh.elements()];
    forces[at.element] = Some(force.map(|f| values.map(|n| f * n)));
    DeadLoad { name: "nodal_force", forces, points: 1 }
}
