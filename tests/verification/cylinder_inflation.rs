//! Inflation and extension of a thick tube of incompressible Mooney-Rivlin tissue (Rivlin 1949; Ogden, Non-linear Elastic
//! Deformations, 1984, section 5.3.3), numbers of the FE literature's usual case: c1 = 2, c2 = 6, radii 1 and 1.2, axial
//! stretch 1.1, inner pressure 1.
//!
//! r^2 = a^2 + (R^2 - A^2)/lambda_z keeps the volume, and with lambda_t = r/R, lambda_r = 1/(lambda_t lambda_z)
//!   pressure = integral over r of 2 (lambda_t^2 - lambda_r^2) (c1 + c2 lambda_z^2) / r
//! gives r_i = 1.0705817593, r_o = 1.2434409127. A quarter of the tube between symmetry planes; plates pull its ends.

use super::support::{Discretisation, body, moved, side, solve};
use risorius::material::MooneyRivlin;
use risorius::math::tensor::Vector;
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::supports::Support;
use risorius::term::load::FollowerPressure;
use std::f64::consts::FRAC_PI_2;

const RADII: [f64; 2] = [1.0, 1.2];
const LENGTH: f64 = 0.5;
const STRETCH: f64 = 1.1;

/// A quarter tube: xi1 = r, xi2 = theta, xi3 = z.
fn quarter_tube([radial, around]: [usize; 2]) -> Mesh {
    let mut mesh = block(&TricubicHermite, [0.0; 3], [1.0, 1.0, LENGTH], [radial, around, 1]);
    let (dr, dt) = ((RADII[1] - RADII[0]) / radial as f64, FRAC_PI_2 / around as f64);
    for node in mesh.parameters.chunks_exact_mut(8) {
        let [u, v, z] = node[0];
        let (r, (sine, cosine)) = (RADII[0] + u * (RADII[1] - RADII[0]), (v * FRAC_PI_2).sin_cos());
        let (outwards, along): (Vector, Vector) = ([cosine, sine, 0.0], [-sine, cosine, 0.0]);
        node[0] = [r * cosine, r * sine, z];
        node[1] = outwards.map(|c| dr * c);
        node[2] = along.map(|c| r * dt * c);
        node[3] = along.map(|c| dr * dt * c);
    }
    mesh
}

/// Inner and outer radius of the inflated tube on its symmetry plane.
fn radii(elements: [usize; 2]) -> [f64; 2] {
    let mesh = quarter_tube(elements);
    let load = FollowerPressure::new(&mesh, &side(&mesh, 0, 0), 1.0, 5);
    let supports = vec![
        Support::Symmetry { faces: side(&mesh, 1, 0), axis: 1 },
        Support::Symmetry { faces: side(&mesh, 1, 1), axis: 0 },
        Support::Symmetry { faces: side(&mesh, 2, 0), axis: 2 },
        Support::Plate { faces: side(&mesh, 2, 1), axis: 2, offset: (STRETCH - 1.0) * LENGTH },
    ];
    let law = MooneyRivlin { c1: 2.0, c2: 6.0 };
    let model = body(mesh, law, Discretisation::trilinear(100.0, 5), vec![Box::new(load)], supports);
    let found = solve(&model, &[], 1.0);
    assert_eq!(found.negative_modes, Some(0));
    let inner = moved(&model, &found, 0, [0.0, 0.0, 1.0]);
    let outer = moved(&model, &found, elements[0] - 1, [1.0, 0.0, 1.0]);
    assert!((inner[2] - STRETCH * LENGTH).abs() < 1e-12);
    [inner[0], outer[0]]
}

#[test]
fn the_radii_of_an_inflated_tube_converge_to_the_closed_form() {
    let exact = [1.0705817593, 1.2434409127];
    let levels = [[1, 2], [2, 4], [3, 6]].map(|elements| (elements[0] as f64, radii(elements)));
    for (k, what) in ["inner", "outer"].into_iter().enumerate() {
        let errors = levels.map(|(n, radii)| (n, (radii[k] - exact[k]).abs()));
        println!("{what} radius: {errors:?}");
        for pair in errors.windows(2) {
            let order = (pair[0].1 / pair[1].1).ln() / (pair[1].0 / pair[0].0).ln();
            assert!(order > 3.5, "{what} radius: {errors:?}, order {order:.2}");
        }
        assert!(errors[2].1 < 1e-5, "{what} radius: {errors:?}");
    }
}
