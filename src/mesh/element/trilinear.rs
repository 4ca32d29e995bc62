//! The trilinear hexahedron: values at eight corners.

use super::{Element, ends};

/// One parameter, the value, at each corner.
#[derive(Debug)]
pub struct Trilinear;

impl Element for Trilinear {
    fn name(&self) -> &'static str {
        "trilinear"
    }

    fn parameters_per_node(&self) -> usize {
        1
    }

    #[inline]
    fn values_1d(&self, x: f64) -> [f64; 4] {
        [1.0 - x, x, 0.0, 0.0]
    }

    #[inline]
    fn slopes_1d(&self, _x: f64) -> [f64; 4] {
        [-1.0, 1.0, 0.0, 0.0]
    }

    fn factors(&self, a: usize) -> [usize; 3] {
        ends(a)
    }
}
