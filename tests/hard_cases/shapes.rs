//! Turned, thin and squeezed elements; volumetric terms from none to very stiff.

use super::record::{attempt, cantilever, clamped_with_pull, drive, solver, stable};
use crate::verification::support::{Discretisation, model, moved, side, slab_beam_of};
use risorius::forward::Equilibrium;
use risorius::math::tensor::{apply, rotation};
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::Model;
use risorius::model::supports::Support;

/// A beam of 40 x 10 x 10 mm, one end turned about its axis.
fn twisted(degrees: f64) -> Model {
    let mesh = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [4, 1, 1]);
    let clamp = Support::Clamp { faces: side(&mesh, 0, 0) };
    let (axis, through) = ([1.0, 0.0, 0.0], [0.0, 5.0, 5.0]);
    let turn = Support::Rotate { faces: side(&mesh, 0, 1), axis, through, angle: degrees.to_radians() };
    model(mesh, Discretisation::trilinear(10.0, 4), Vec::new(), Vec::new(), vec![clamp, turn])
}

#[test]
fn a_beam_is_twisted_by_half_a_turn_and_by_a_whole_one() {
    let mut torque = 0.0;
    for degrees in [180.0, 360.0_f64] {
        let model = twisted(degrees);
        let case = format!("twist of {degrees} degrees");
        let found = stable(&case, &mut solver(&model), &model.rest(), &drive(&[], 1.0));
        assert!(found.history.len() >= (degrees / 22.5) as usize, "steps of at most pi/8");
        // the turned face: by half a turn on its head, by a whole one where it was
        let (sine, cosine) = degrees.to_radians().sin_cos();
        for node in 0..model.mesh().nodes {
            let (x, u) = (model.mesh().parameters[8 * node], found.state.u[8 * node]);
            if x[0] == 40.0 {
                let (y, z) = (x[1] - 5.0, x[2] - 5.0);
                let expected = [40.0, 5.0 + cosine * y - sine * z, 5.0 + sine * y + cosine * z];
                assert!((0..3).all(|i| (x[i] + u[i] - expected[i]).abs() < 1e-12), "{case}: {u:?}");
            }
        }
        // the section in the middle has turned by half of it
        let [_, y, z] = moved(&model, &found, 1, [1.0, 0.5, 0.0]);
        let angle = (y - 5.0).atan2(-(z - 5.0)).rem_euclid(2.0 * std::f64::consts::PI);
        assert!((angle - 0.5 * degrees.to_radians()).abs() < 1e-6, "{case}: middle at {angle}");
        let x = model.current(&found.state);
        let now = model.supports().rotation_reactions(model.mesh(), &found.evaluation.force, &x)[0].0;
        assert!(now > torque, "{case}: torque {now} mN mm after {torque}");
        torque = now;
    }
}

/// The mean lowering of the end face, mm.
fn sag(model: &Model, found: &Equilibrium) -> f64 {
    let last = model.mesh().elements() - 1;
    let at = |y: f64, z: f64| {
        let before = model
            .mesh()
            .interpolate(risorius::mesh::MaterialPoint { element: last, xi: [1.0, y, z] }, &model.mesh().parameters);
        before[2] - moved(model, found, last, [1.0, y, z])[2]
    };
    0.25 * (at(0.0, 0.0) + at(1.0, 0.0) + at(0.0, 1.0) + at(1.0, 1.0))
}

/// A sheet of 10 x 10 x 0.1 elements, and a needle of 100 x 1 x 1: beams with E = 6 (c1 + c2), each deflected a little and
/// then far. They are as stiff as a free strip or stiffer: the clamp holds the width, and how that fades along the beam is
/// shorter than an element. A strip that keeps its width is 4/3 as stiff.
#[test]
fn thin_elements_bend_as_beams_do() {
    let young = 6.0 * 0.7;
    for (what, size, elements, stiffening) in [
        ("sheet, aspect 100", [40.0, 10.0, 0.1], [4, 1, 1], 1.3),
        ("needle, aspect 100", [400.0, 1.0, 1.0], [4, 1, 1], 1.2),
    ] {
        let [length, width, height]: [f64; 3] = size;
        let inertia = width * height * height * height / 12.0;
        // deflected by a hundredth of its length: F = 3 E I w / l^3
        let force = 3.0 * young * inertia * 0.01 * length / length.powi(3);
        let mesh = block(&TricubicHermite, [0.0; 3], size, elements);
        let model = clamped_with_pull(mesh, 10.0, [0.0, 0.0, -force / (width * height)]);
        let mut solver = solver(&model);
        let little = stable(&format!("{what}, bent by 1 %"), &mut solver, &model.rest(), &drive(&[], 1.0));
        let ratio = 0.01 * length / sag(&model, &little);
        assert!((0.97..stiffening).contains(&ratio), "{what}: {ratio} times as stiff as a strip");
        let far =
            stable(&format!("{what}, bent by 100 times the force"), &mut solver, &little.state, &drive(&[], 100.0));
        assert!(sag(&model, &far) > 0.4 * length, "{what}: {}", sag(&model, &far));
    }
}

/// X -> (x, y s, z s) with s falling from 1 at xi1 = 0 to `tip` at xi1 = 1: at its end hardly anything is left.
fn tapered(mut mesh: Mesh, length: f64, tip: f64) -> Mesh {
    let straight = mesh.parameters.clone();
    for node in 0..mesh.nodes {
        let at = |derivative: usize| straight[8 * node + derivative];
        let step = at(1)[0];
        let (s, slope) = (1.0 - (1.0 - tip) * at(0)[0] / length, -(1.0 - tip) / length * step);
        for derivative in [0, 2, 4, 6] {
            for i in 1..3 {
                mesh.parameters[8 * node + derivative][i] = s * at(derivative)[i];
                // the derivative along xi1 of y s: y slope
                mesh.parameters[8 * node + derivative + 1][i] = slope * at(derivative)[i];
            }
        }
    }
    mesh
}

/// Elements that end in a face of a hundredth or a thousandth of their width, turned by a right angle at their thick end:
/// all the rest must follow as a rigid body.
#[test]
fn nearly_collapsed_elements_follow_a_turn() {
    for tip in [1e-2, 1e-3] {
        let mesh = tapered(block(&TricubicHermite, [0.0; 3], [20.0; 3], [2, 2, 2]), 20.0, tip);
        let (axis, angle) = ([0.6, 0.0, 0.8], 0.5 * std::f64::consts::PI);
        let turn = Support::Rotate { faces: side(&mesh, 0, 0), axis, through: [0.0; 3], angle };
        let model = model(mesh, Discretisation::trilinear(10.0, 5), Vec::new(), Vec::new(), vec![turn]);
        let case = format!("elements collapsed to {tip}, turned");
        let found = stable(&case, &mut solver(&model), &model.rest(), &drive(&[], 1.0));
        let turn = rotation(axis, angle);
        for (u, x) in found.state.u.iter().zip(&model.mesh().parameters) {
            let now = apply(&turn, *x);
            assert!((0..3).all(|i| (x[i] + u[i] - now[i]).abs() < 1e-5), "{case}: {u:?} at {x:?}");
        }
    }
}

#[test]
fn a_nearly_collapsed_tip_bends() {
    let mesh = tapered(block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [4, 1, 1]), 40.0, 1e-2);
    let model = clamped_with_pull(mesh, 10.0, [0.0, 0.0, -1.0]);
    let found = stable("tip collapsed to 0.01, bent", &mut solver(&model), &model.rest(), &drive(&[], 1.0));
    assert!(sag(&model, &found) > 0.0);
}

/// Without the volumetric term the discrete problem has several solutions; with a stiff one it has one.
#[test]
fn kappa_from_nothing_to_very_stiff() {
    for kappa in [0.0, 1e5] {
        let model = cantilever(kappa, [0.0, 0.0, -0.04]);
        let found = stable(&format!("bending, kappa {kappa}"), &mut solver(&model), &model.rest(), &drive(&[], 1.0));
        // about 18 mm on fine meshes, more of this element without the term
        let tip = sag(&model, &found);
        assert!((16.0..if kappa == 0.0 { 23.0 } else { 19.0 }).contains(&tip), "kappa {kappa}: {tip} mm");
        let slab = slab_beam_of(Discretisation::trilinear(kappa, 4), &[("slab", [4.5, 2.0, 14.2], 0.0)], [3, 1, 1]);
        // stiff, each step is short: to an activation of 1 it is 2400 iterations
        for activation in if kappa == 0.0 { vec![0.01, 1.0] } else { vec![0.01] } {
            let case = format!("slab at activation {activation}, kappa {kappa}");
            let ended = attempt(&case, &mut solver(&slab), &slab.rest(), &drive(&[activation], 1.0));
            match ended {
                Ok(found) => assert_eq!(found.negative_modes, Some(0), "{case}"),
                Err(failure) => assert!(kappa == 0.0 && failure.error.code() == "S003", "{case}: {}", failure.error),
            }
        }
    }
}
