//! Continuous trilinear pressure: one parameter per node, the paper's choice (Wu et al. 2013, section 2.1).

use super::{PressurePlace, PressureSpace};
use crate::mesh::Mesh;
use crate::mesh::element::{self, Element};
use crate::term::MAX_PRESSURES;

/// p at the nodes, kPa.
#[derive(Debug)]
pub struct Trilinear;

impl PressureSpace for Trilinear {
    fn name(&self) -> &'static str {
        "trilinear"
    }

    fn values(&self, xi: [f64; 3]) -> [f64; MAX_PRESSURES] {
        let n = element::Trilinear.values(xi);
        std::array::from_fn(|c| n[c])
    }

    fn count(&self, mesh: &Mesh) -> usize {
        mesh.nodes
    }

    fn parameters(&self, mesh: &Mesh, element: usize) -> Vec<usize> {
        mesh.corners[element].to_vec()
    }

    fn place(&self, index: usize) -> PressurePlace {
        PressurePlace::Node(index)
    }
}
