//! Homogeneous deformations of incompressible Mooney-Rivlin tissue (Rivlin 1948; Ogden, Non-linear Elastic Deformations,
//! 1984, section 4.3.6).
//!
//! Uniaxial stretch lambda: nominal stress 2 (lambda - lambda^-2)(c1 + c2/lambda).
//! Simple shear gamma: shear stress 2 (c1 + c2) gamma, energy (c1 + c2) gamma^2 per volume.

use super::support::{Discretisation, TISSUE, model, side, solve};
use risorius::mesh::MaterialPoint;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::supports::Support;
use risorius::term::load::traction;
use risorius::term::pressure::PRESSURE_SPACES;

#[test]
fn a_bar_under_dead_traction_has_the_closed_stretch() {
    for space in PRESSURE_SPACES {
        for kappa in [0.0, 10.0] {
            for stretch in [0.7_f64, 1.3, 2.0] {
                let mesh = block(&TricubicHermite, [0.0; 3], [20.0, 10.0, 10.0], [2, 1, 1]);
                let stress = 2.0 * (stretch - stretch.powi(-2)) * (TISSUE.c1 + TISSUE.c2 / stretch);
                let load = traction(&mesh, &side(&mesh, 0, 1), [stress, 0.0, 0.0], 4);
                let planes = (0..3).map(|axis| Support::Symmetry { faces: side(&mesh, axis, 0), axis }).collect();
                let how = Discretisation { kappa, gauss: 4, space };
                let model = model(mesh, how, Vec::new(), vec![Box::new(load)], planes);
                let found = solve(&model, &[], 1.0);
                let x = model.current(&found.state);
                let corner = model.mesh().interpolate(MaterialPoint { element: 1, xi: [1.0; 3] }, &x);
                let stretches = [corner[0] / 20.0, corner[1] / 10.0, corner[2] / 10.0];
                let expected = [stretch, stretch.powf(-0.5), stretch.powf(-0.5)];
                for (ours, theirs) in stretches.iter().zip(expected) {
                    assert!((ours - theirs).abs() < 1e-10, "{}, kappa {kappa}: {stretches:?}", space.name());
                }
                let det = found.evaluation.det_f;
                assert!((det.min - 1.0).abs() < 1e-9 && (det.max - 1.0).abs() < 1e-9, "{det:?}");
            }
        }
    }
}

/// u1 = gamma X2 on four sides, no motion out of the plane on the fifth, the sixth free.
#[test]
fn a_sheared_block_has_the_closed_stress() {
    for space in PRESSURE_SPACES {
        for gamma in [0.1, 0.8, 2.0] {
            let mesh = block(&TricubicHermite, [0.0; 3], [10.0, 10.0, 10.0], [2, 2, 1]);
            let faces = [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().flat_map(|(d, end)| side(&mesh, d, end));
            let gradient = [[0.0, gamma, 0.0], [0.0; 3], [0.0; 3]];
            let shear = Support::Affine { faces: faces.collect(), gradient, offset: [0.0; 3] };
            let bottom = Support::Symmetry { faces: side(&mesh, 2, 0), axis: 2 };
            let how = Discretisation { kappa: 10.0, gauss: 4, space };
            let model = model(mesh, how, Vec::new(), Vec::new(), vec![shear, bottom]);
            let found = solve(&model, &[], 1.0);
            let mesh = model.mesh();
            let volume = 1000.0;
            // the field is homogeneous everywhere, though only the sides were prescribed
            for (parameter, u) in found.state.u.iter().enumerate() {
                let expected = [gamma * mesh.parameters[parameter][1], 0.0, 0.0];
                for i in 0..3 {
                    assert!((u[i] - expected[i]).abs() < 1e-9, "gamma {gamma}: {u:?} instead of {expected:?}");
                }
            }
            // the work of all reactions in a further shear d(gamma): stress x volume
            let work: f64 = found.evaluation.force.iter().zip(&mesh.parameters).map(|(f, x)| f[0] * x[1]).sum();
            let stress = 2.0 * (TISSUE.c1 + TISSUE.c2) * gamma;
            assert!((work / volume - stress).abs() < 1e-10 * stress, "{} instead of {stress}", work / volume);
            let energy = (TISSUE.c1 + TISSUE.c2) * gamma * gamma * volume;
            assert!((found.evaluation.energies[0] - energy).abs() < 1e-10 * energy);
        }
    }
}
