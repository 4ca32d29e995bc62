//! A cube of incompressible Mooney-Rivlin tissue that is filled by a muscle, contracting freely along its fibres.
//!
//! F = diag(lambda, lambda^-1/2, lambda^-1/2); with free sides and free ends the nominal stress along the fibres
//! vanishes:
//!
//!   2 (lambda - lambda^-2)(c1 + c2/lambda) + sigma_max/lambda_ofl (a f_act + f_pas)(lambda/lambda_ofl) = 0
//!
//! The stretches below are roots of this equation with Table 2 of Wu et al. 2013, found independently; the equation is
//! solved here once more.

use super::support::{Discretisation, FIBRE, TISSUE, model, side, solve};
use risorius::mesh::MaterialPoint;
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::model::supports::Support;

/// (activation, stretch)
const STRETCHES: [(f64, f64); 10] = [
    (0.001, 0.9356379402452),
    (0.002, 0.8850914442533),
    (0.005, 0.7888954507266),
    (0.01, 0.7100289920636),
    (0.02, 0.6411423656595),
    (0.05, 0.5752759412247),
    (0.1, 0.5374513819781),
    (0.2, 0.5061324450579),
    (0.5, 0.4737541685867),
    (1.0, 0.4551561534359),
];

/// The root of the scalar equation between 0.4 and 1, by bisection: the stress rises with the stretch there.
fn closed_form(activation: f64) -> f64 {
    let active = |s: f64| match s {
        s if s <= 0.4 => 0.0,
        s if s <= 0.6 => 9.0 * (s - 0.4) * (s - 0.4),
        s => 1.0 - 4.0 * (1.0 - s) * (1.0 - s),
    };
    // below its optimal stretch a fibre has no passive force
    let stress =
        |l: f64| 2.0 * (l - l.powi(-2)) * (TISSUE.c1 + TISSUE.c2 / l) + FIBRE.sigma_max * activation * active(l);
    let (mut low, mut high) = (0.4, 1.0);
    while high - low > 1e-15 {
        let middle = 0.5 * (low + high);
        if middle == low || middle == high {
            break;
        }
        *(if stress(middle) < 0.0 { &mut low } else { &mut high }) = middle;
    }
    0.5 * (low + high)
}

#[test]
fn a_free_fibre_shortens_as_the_scalar_equation_says() {
    const SIDE: f64 = 2.0;
    let mesh = block(&TricubicHermite, [0.0; 3], [SIDE; 3], [1, 1, 1]);
    let fibres = block(&Trilinear, [0.0; 3], [SIDE; 3], [1, 1, 1]);
    let along_x = FibreAngles::uniform(&fibres, [0.0; 3]);
    let planes = (0..3).map(|axis| Support::Symmetry { faces: side(&mesh, axis, 0), axis }).collect();
    let model =
        model(mesh, Discretisation::trilinear(10.0, 4), vec![("muscle", fibres, along_x)], Vec::new(), planes);
    for (activation, published) in STRETCHES {
        let root = closed_form(activation);
        assert!((root - published).abs() < 1e-12, "a = {activation}: the equation gives {root}");
        let found = solve(&model, &[activation], 1.0);
        let x = model.current(&found.state);
        let corner = model.mesh().interpolate(MaterialPoint { element: 0, xi: [1.0; 3] }, &x);
        let stretches = corner.map(|c| c / SIDE);
        let expected = [root, root.powf(-0.5), root.powf(-0.5)];
        for (ours, theirs) in stretches.iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-9, "a = {activation}: {stretches:?} instead of {expected:?}");
        }
        assert_eq!(found.negative_modes, Some(0), "a = {activation}");
    }
}
