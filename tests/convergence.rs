//! Fields on finer and finer meshes: errors fall with the order of the element.

use risorius::math::quadrature::GaussRule;
use risorius::math::tensor::{Vector, determinant, norm, subtract};
use risorius::mesh::block::block;
use risorius::mesh::element::{ELEMENTS, Element};
use risorius::mesh::{MaterialPoint, Mesh};

/// A product of waves, component by component another; `mask` differentiates by x, y, z.
fn wave(x: Vector, mask: usize) -> Vector {
    std::array::from_fn(|i| {
        (0..3)
            .map(|d| {
                let k = 0.9 + 0.4 * ((i + d) % 3) as f64;
                let phase = k * x[d] + i as f64;
                if mask >> d & 1 == 1 { k * phase.cos() } else { phase.sin() }
            })
            .product()
    })
}

/// The parameters of the wave on a block of unit-xi derivatives: nodal values and, scaled to xi, nodal derivatives.
fn interpolated(mesh: &Mesh, step: f64) -> Vec<Vector> {
    let per_node = mesh.element.parameters_per_node();
    (0..mesh.parameters.len())
        .map(|parameter| {
            let x = mesh.parameters[parameter / per_node * per_node];
            let mask = parameter % per_node;
            wave(x, mask).map(|w| w * step.powi(mask.count_ones() as i32))
        })
        .collect()
}

/// L2 norms of the error of the interpolated wave and of its slopes on n^3 elements of a cube of side 2.
fn errors(element: &'static dyn Element, n: usize) -> [f64; 2] {
    let step = 2.0 / n as f64;
    let mesh = block(element, [0.0; 3], [2.0; 3], [n; 3]);
    let field = interpolated(&mesh, step);
    let rule = GaussRule::new(5);
    let (mut of_values, mut of_slopes) = (0.0, 0.0);
    for e in 0..mesh.elements() {
        let local = mesh.local_of(e, &field);
        for (xi, w) in rule.cube() {
            let at = MaterialPoint { element: e, xi };
            let (x, volume) = (mesh.position(at), determinant(&mesh.jacobian(at)));
            let (value, slopes) = risorius::mesh::position_and_jacobian(element, &local, xi);
            of_values += w * volume * norm(subtract(value, wave(x, 0))).powi(2);
            for d in 0..3 {
                let slope: Vector = slopes.map(|row| row[d] / step);
                of_slopes += w * volume * norm(subtract(slope, wave(x, 1 << d))).powi(2);
            }
        }
    }
    [of_values.sqrt(), of_slopes.sqrt()]
}

/// Cubic Hermite: h^4 for values and h^3 for slopes; linear: h^2 and h.
#[test]
fn interpolation_has_the_order_of_the_element() {
    for element in ELEMENTS {
        let order = if element.parameters_per_node() == 8 { 4.0 } else { 2.0 };
        let [coarse, fine] = [4, 8].map(|n| errors(element, n));
        for (what, expected, k) in [("values", order, 0), ("slopes", order - 1.0, 1)] {
            let found = (coarse[k] / fine[k]).log2();
            assert!((found - expected).abs() < 0.1, "{}: {what} of order {found:.2}", element.name());
        }
    }
}
