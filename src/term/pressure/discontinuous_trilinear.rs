//! Trilinear pressure of its own in every element: eight parameters each.

use super::{PressurePlace, PressureSpace};
use crate::mesh::Mesh;
use crate::mesh::element::{self, Element};
use crate::term::MAX_PRESSURES;

/// p at the corners of each element, kPa; it may jump from element to element.
#[derive(Debug)]
pub struct DiscontinuousTrilinear;

impl PressureSpace for DiscontinuousTrilinear {
    fn name(&self) -> &'static str {
        "discontinuous-trilinear"
    }

    fn values(&self, xi: [f64; 3]) -> [f64; MAX_PRESSURES] {
        let n = element::Trilinear.values(xi);
        std::array::from_fn(|c| n[c])
    }

    fn count(&self, mesh: &Mesh) -> usize {
        MAX_PRESSURES * mesh.elements()
    }

    fn parameters(&self, _mesh: &Mesh, element: usize) -> Vec<usize> {
        (0..MAX_PRESSURES).map(|c| element * MAX_PRESSURES + c).collect()
    }

    fn place(&self, index: usize) -> PressurePlace {
        PressurePlace::Element(index / MAX_PRESSURES)
    }
}
