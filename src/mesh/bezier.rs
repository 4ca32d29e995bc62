//! The Bezier form of an element: the same polynomial, with control points whose hull contains it.

use super::element::Element;

/// Control values of the tricubic Bezier form of one component, from its local parameters. Index i + 4 j + 16 k along
/// (xi1, xi2, xi3).
///
/// In one direction a cubic Hermite (v0, d0, v1, d1) is b0 = v0, b1 = v0 + d0/3, b2 = v1 - d1/3, b3 = v1, and a linear
/// function is raised in degree: b1 = (2 v0 + v1)/3, b2 = (v0 + 2 v1)/3.
pub fn control_values(element: &dyn Element, local: &[f64; 64]) -> [f64; 64] {
    // rows: weights of the 1-D parameters in b0..b3
    let rows: [[f64; 4]; 4] = match element.parameters_per_node() {
        8 => [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0 / 3.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0 / 3.0], [0.0, 0.0, 1.0, 0.0]],
        _ => [
            [1.0, 0.0, 0.0, 0.0],
            [2.0 / 3.0, 1.0 / 3.0, 0.0, 0.0],
            [1.0 / 3.0, 2.0 / 3.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
        ],
    };
    let mut tensor = [0.0; 64];
    for (a, value) in local.iter().enumerate().take(element.functions()) {
        let [i, j, k] = element.factors(a);
        tensor[i + 4 * j + 16 * k] = *value;
    }
    for stride in [1, 4, 16] {
        let mut next = [0.0; 64];
        for start in (0..64).filter(|s| (s / stride) % 4 == 0) {
            for (b, row) in rows.iter().enumerate() {
                next[start + b * stride] = (0..4).map(|i| row[i] * tensor[start + i * stride]).sum();
            }
        }
        tensor = next;
    }
    tensor
}

/// The smallest box that holds all control points of an element: (lowest, highest) corner. The element lies inside.
pub fn bounding_box(element: &dyn Element, local: &[[f64; 64]; 3]) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for i in 0..3 {
        for value in control_values(element, &local[i]) {
            low[i] = low[i].min(value);
            high[i] = high[i].max(value);
        }
    }
    (low, high)
}

/// The value at xi of a Bezier form with the given control values.
pub fn evaluate(control: &[f64; 64], xi: [f64; 3]) -> f64 {
    // 1-D cubic Bernstein polynomials
    let b = xi.map(|x| {
        let y = 1.0 - x;
        [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x]
    });
    (0..64).map(|q| control[q] * b[0][q % 4] * b[1][q / 4 % 4] * b[2][q / 16]).sum()
}
