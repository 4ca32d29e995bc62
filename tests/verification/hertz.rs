//! Hertz (1881): a rigid sphere of radius R pressed by d into an incompressible half-space needs F = 16/9 E sqrt(R) d^(3/2).
//!
//! The block has a finite depth H and is fixed below: the factor 1 + 1.133 c + 1.283 c^2 + 0.769 c^3 + 0.0975 c^4 with
//! c = sqrt(R d) / H (Dimitriadis et al. 2002, Eq. 12). A quarter is meshed, fine elements near the contact.

use super::contact_closed_forms::{contact, contact_points, solve_to};
use super::support::{Discretisation, model, side};
use risorius::math::tensor::norm;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::supports::Support;
use risorius::term::contact::law::{Allows, Penalty};
use risorius::term::contact::surface::{FreeSide, Sphere};

const RADIUS: f64 = 10.0;
const DEPTH: f64 = 0.1;
const SIZE: f64 = 12.0;

/// Force in mN of a whole sphere, from a quarter of n x n x n elements graded towards the contact.
fn force(n: usize) -> f64 {
    let mut mesh = block(&TricubicHermite, [0.0; 3], [1.0; 3], [n, n, n]);
    // s -> SIZE (s + c s^3) / (1 + c): the elements at the contact are 1 + c times smaller than the mean
    const GRADE: f64 = 5.0;
    let at = |s: f64| SIZE * (s + GRADE * s * s * s) / (1.0 + GRADE);
    let slope = |s: f64| SIZE * (1.0 + 3.0 * GRADE * s * s) / (1.0 + GRADE) / n as f64;
    for parameter in (0..mesh.parameters.len()).step_by(8) {
        let s = mesh.parameters[parameter];
        // the contact is at z = 0, the depth at z < 0
        let below = 1.0 - s[2];
        mesh.parameters[parameter] = [at(s[0]), at(s[1]), -at(below)];
        mesh.parameters[parameter + 1] = [slope(s[0]), 0.0, 0.0];
        mesh.parameters[parameter + 2] = [0.0, slope(s[1]), 0.0];
        mesh.parameters[parameter + 4] = [0.0, 0.0, slope(below)];
    }
    let sphere = Sphere { centre: [0.0, 0.0, RADIUS - DEPTH], radius: RADIUS, free: FreeSide::Outside };
    let law = Box::new(Penalty { stiffness: 2000.0 });
    let term = contact(&mesh, &side(&mesh, 2, 1), Allows::ClosedOrOpen, sphere, law);
    let supports = vec![
        Support::Symmetry { faces: side(&mesh, 0, 0), axis: 0 },
        Support::Symmetry { faces: side(&mesh, 1, 0), axis: 1 },
        Support::Clamp { faces: side(&mesh, 2, 0) },
    ];
    let model = model(mesh, Discretisation::trilinear(10.0, 4), Vec::new(), vec![term], supports);
    let (found, iterations) = solve_to(&model, 1e-7);
    let points = contact_points(&model, &found);
    let total: [f64; 3] =
        std::array::from_fn(|i| points.iter().map(|p| -p.pressure * p.area * p.normal[i]).sum::<f64>());
    let closed = points.iter().filter(|p| p.pressure > 0.0).count();
    println!("n {n}: {closed} points closed, {iterations} iterations, |F| {:.4}", norm(total));
    4.0 * total[2].abs()
}

#[test]
fn a_sphere_pressed_into_a_thick_block() {
    // E = 6 (c1 + c2)
    let young: f64 = 6.0 * 0.7;
    let c = (RADIUS * DEPTH).sqrt() / SIZE;
    let thick = 1.0 + 1.133 * c + 1.283 * c * c + 0.769 * c.powi(3) + 0.0975 * c.powi(4);
    let exact = 16.0 / 9.0 * young * RADIUS.sqrt() * DEPTH.powf(1.5) * thick;
    let errors = [3, 4, 5].map(|n| force(n) / exact - 1.0);
    println!("exact {exact:.4} (thickness {thick:.4}), errors {errors:?}");
    assert!(errors[2].abs() < 0.02, "{errors:?}");
}
