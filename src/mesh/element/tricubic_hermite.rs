//! The tricubic Hermite hexahedron: eight parameters a node, C1 across shared faces (Wu et al. 2013, section 2.1).

use super::{Element, ends};

/// Parameters at a node, by bit mask d1 + 2 d2 + 4 d3 of the directions that are differentiated:
/// value, d1, d2, d12, d3, d13, d23, d123 (per unit xi).
#[derive(Debug)]
pub struct TricubicHermite;

impl Element for TricubicHermite {
    fn name(&self) -> &'static str {
        "tricubic-hermite"
    }

    fn parameters_per_node(&self) -> usize {
        8
    }

    // 1 - 3x^2 + 2x^3,  x - 2x^2 + x^3,  3x^2 - 2x^3,  x^3 - x^2
    #[inline]
    fn values_1d(&self, x: f64) -> [f64; 4] {
        let y = 1.0 - x;
        [y * y * (1.0 + 2.0 * x), x * y * y, x * x * (3.0 - 2.0 * x), -x * x * y]
    }

    #[inline]
    fn slopes_1d(&self, x: f64) -> [f64; 4] {
        let y = 1.0 - x;
        [-6.0 * x * y, y * (1.0 - 3.0 * x), 6.0 * x * y, x * (3.0 * x - 2.0)]
    }

    fn factors(&self, a: usize) -> [usize; 3] {
        let (node, derivative) = (ends(a / 8), ends(a % 8));
        std::array::from_fn(|d| 2 * node[d] + derivative[d])
    }
}
