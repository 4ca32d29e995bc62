//! Cook's membrane of nearly incompressible neo-Hookean rubber in plane strain (Simo and Armero 1992): a tapered panel
//! with corners (0, 0), (48, 44), (48, 60), (0, 44), held at the left, sheared by a dead force of 100 per thickness on the
//! edge of length 16 at the right; mu = 80.1938, bulk modulus 400889.8. The upper right corner rises by about 6.92.
//!
//! The bulk modulus is 5000 times the shear modulus: the pressure takes its part, and the body is incompressible. The
//! energy of volume beside the pressure is a numerical choice, 10 mu here.

use super::support::{Discretisation, body, moved, side, solve};
use risorius::material::NeoHookean;
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::supports::Support;
use risorius::term::load::traction;

const MU: f64 = 80.1938;

/// n x n x 1 elements, one thick.
fn membrane(n: usize) -> Mesh {
    let mut mesh = block(&TricubicHermite, [0.0; 3], [1.0, 1.0, 48.0 / n as f64], [n, n, 1]);
    let step = 1.0 / n as f64;
    for node in mesh.parameters.chunks_exact_mut(8) {
        // y = 44 s + (44 - 28 s) t
        let [s, t, z] = node[0];
        node[0] = [48.0 * s, 44.0 * s + (44.0 - 28.0 * s) * t, z];
        node[1] = [48.0 * step, (44.0 - 28.0 * t) * step, 0.0];
        node[2] = [0.0, (44.0 - 28.0 * s) * step, 0.0];
        node[3] = [0.0, -28.0 * step * step, 0.0];
    }
    mesh
}

fn rise(n: usize) -> f64 {
    let mesh = membrane(n);
    let shear = traction(&mesh, &side(&mesh, 0, 1), [0.0, 100.0 / 16.0, 0.0], 5);
    let supports = vec![
        Support::Clamp { faces: side(&mesh, 0, 0) },
        Support::Symmetry { faces: side(&mesh, 2, 0), axis: 2 },
        Support::Symmetry { faces: side(&mesh, 2, 1), axis: 2 },
    ];
    let how = Discretisation::trilinear(10.0 * MU, 5);
    let model = body(mesh, NeoHookean { mu: MU }, how, vec![Box::new(shear)], supports);
    let found = solve(&model, &[], 1.0);
    assert_eq!(found.negative_modes, Some(0));
    moved(&model, &found, n * n - 1, [1.0, 1.0, 0.0])[1] - 60.0
}

/// The corners of the clamp let the error fall slowly, by a constant part from mesh to mesh; Aitken's limit takes the rest.
#[test]
fn the_corner_of_cooks_membrane_rises_as_published() {
    let [coarse, middle, fine] = [4, 8, 16].map(rise);
    let part = (fine - middle) / (middle - coarse);
    let limit = fine + (fine - middle) * part / (1.0 - part);
    println!("rise of the corner: {coarse}, {middle}, {fine}, limit {limit}");
    assert!((0.3..0.5).contains(&part), "errors fall by {part}");
    assert!((fine - 6.92).abs() < 0.02 && (limit - 6.92).abs() < 0.01, "{fine}, limit {limit}");
}
