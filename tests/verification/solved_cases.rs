//! Solved cases of an independent implementation: bending, torsion, a contracting slab, two slabs with sensitivities.
//!
//! All with Table 2 of Wu et al. 2013, trilinear pressure and 4 x 4 x 4 Gauss points. Files: `u[node][derivative]
//! [component]` (mm), `p[node]` (kPa), energies (uJ), the range of det F over the Gauss points.

use super::support::{
    Discretisation, SolvedState, assert_close, model, parameters, reference, side, slab_beam, solve,
};
use risorius::forward::{Drive, Settings, Solver};
use risorius::mesh::MaterialPoint;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::Model;
use risorius::model::supports::Support;
use risorius::term::load::traction;
use serde::Deserialize;

#[derive(Deserialize)]
struct States {
    states: Vec<SolvedState>,
}

/// A 40 x 10 x 10 beam of 4 x 1 x 1 elements, clamped at xi1 = 0, dead traction (0, 0, -0.04) kPa on xi1 = 1.
fn cantilever(kappa: f64) -> Model {
    let mesh = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [4, 1, 1]);
    let load = traction(&mesh, &side(&mesh, 0, 1), [0.0, 0.0, -0.04], 4);
    let clamp = Support::Clamp { faces: side(&mesh, 0, 0) };
    model(mesh, Discretisation::trilinear(kappa, 4), Vec::new(), vec![Box::new(load)], vec![clamp])
}

#[test]
fn bending_with_kappa_10() {
    let model = cantilever(10.0);
    let found = solve(&model, &[], 1.0);
    assert_eq!(found.negative_modes, Some(0));
    reference::<States>("bend_kappa10").states[0].assert_matches(&model, &found, 1e-6);
}

#[test]
fn bending_with_kappa_0() {
    let model = cantilever(0.0);
    let found = solve(&model, &[], 1.0);
    reference::<States>("bend_kappa0").states[0].assert_matches(&model, &found, 1e-6);
}

/// The beam twisted by 90 degrees about its axis; reference torque and axial force on the turned face.
#[test]
fn twist_by_90_degrees() {
    #[derive(Deserialize)]
    struct Twist {
        torque_x: f64,
        axial_force_x: f64,
    }
    let mesh = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [4, 1, 1]);
    let clamp = Support::Clamp { faces: side(&mesh, 0, 0) };
    let turn = Support::Rotate {
        faces: side(&mesh, 0, 1),
        axis: [1.0, 0.0, 0.0],
        through: [0.0, 5.0, 5.0],
        angle: std::f64::consts::FRAC_PI_2,
    };
    let model = model(mesh, Discretisation::trilinear(0.0, 4), Vec::new(), Vec::new(), vec![clamp, turn]);
    let found = solve(&model, &[], 1.0);
    let states: serde_json::Value = reference("twist_90");
    let state: SolvedState = serde_json::from_value(states["states"][0].clone()).expect("a state");
    state.assert_matches(&model, &found, 1e-6);
    let twist: Twist = serde_json::from_value(states["states"][0].clone()).expect("reactions");
    let x = model.current(&found.state);
    let (torque, axial) = model.supports().rotation_reactions(model.mesh(), &found.evaluation.force, &x)[0];
    assert_close("torque", [torque], [twist.torque_x], 1e-6);
    assert_close("axial force", [axial], [twist.axial_force_x], 1e-6);
}

#[test]
fn contracting_slab() {
    let model = slab_beam(Discretisation::trilinear(10.0, 4), &[("slab", [4.5, 2.0, 14.2], 0.0)]);
    for state in reference::<States>("slab_beam").states {
        let found = solve(&model, &state.activations, 1.0);
        assert_eq!(found.negative_modes, Some(0), "a = {:?}", state.activations);
        state.assert_matches(&model, &found, 1e-6);
    }
}

/// From rest to full activation without a failed run, in at most 60 Newton iterations.
#[test]
fn slab_at_full_activation() {
    let model = slab_beam(Discretisation::trilinear(10.0, 4), &[("slab", [4.5, 2.0, 14.2], 0.0)]);
    let mut solver = Solver::new(&model, Settings::default()).expect("memory");
    let drive = Drive { controls: vec![1.0], load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    let work = solver.work();
    for step in &found.history {
        println!(
            "{:.4} {} {:?}",
            step.place,
            step.iterations.len(),
            step.iterations.iter().map(|i| i.factor).collect::<Vec<_>>()
        );
    }
    println!("iterations {} cuts {}", work.iterations, work.cuts);
    assert!(work.iterations <= 60, "{} Newton iterations", work.iterations);
    assert_eq!(found.negative_modes, Some(0));
}

/// Slabs at activations (0.03, 0.07), fibre angles 0 and 36 degrees: state, sensitivities and markers.
#[test]
fn two_slabs_and_their_sensitivities() {
    #[derive(Deserialize)]
    #[allow(non_snake_case)] // the symbols of the reference file
    struct TwoSlabs {
        markers_X: Vec<[f64; 3]>,
        markers_x: Vec<[f64; 3]>,
        dmarkers_da: Vec<[[f64; 2]; 3]>,
        du_da: Vec<Vec<[[f64; 3]; 8]>>,
        dp_da: Vec<Vec<f64>>,
    }
    let slabs = [("top", [4.5, 2.0, 14.2], 0.0), ("bottom", [4.5, 2.0, 1.8], 36.0)];
    let model = slab_beam(Discretisation::trilinear(10.0, 4), &slabs);
    let mut solver = Solver::new(&model, Settings { tolerance: 1e-10, ..Settings::default() }).expect("memory");
    let drive = Drive { controls: vec![0.03, 0.07], load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    let state: SolvedState = reference("two_slabs");
    state.assert_matches(&model, &found, 1e-6);

    let theirs: TwoSlabs = reference("two_slabs");
    let surface = risorius::mesh::surface::Surface::new(model.mesh());
    let points: Vec<MaterialPoint> =
        theirs.markers_X.iter().map(|x| surface.project(*x).expect("a surface").point).collect();
    let x = model.current(&found.state);
    let markers = points.iter().flat_map(|p| model.mesh().interpolate(*p, &x));
    assert_close("markers", markers, theirs.markers_x.iter().flatten().copied(), 1e-6);
    for control in 0..2 {
        // K dx/da = - dr/da
        let mut dx: Vec<f64> = model.control_force(&found.state, control).iter().map(|f| -f).collect();
        solver.solve_with_tangent(&found.state, &mut dx, 1).expect("a regular tangent");
        let du = model.displacement_of(&dx);
        assert_close(
            "du/da",
            du.iter().flatten().copied(),
            parameters(&theirs.du_da[control]).into_iter().flatten(),
            1e-6,
        );
        let dp = (0..model.numbering().pressures()).map(|k| dx[model.numbering().pressure_unknown(k)]);
        assert_close("dp/da", dp, theirs.dp_da[control].iter().copied(), 1e-6);
        let dm = points.iter().flat_map(|p| model.mesh().interpolate(*p, &du));
        let theirs = theirs.dmarkers_da.iter().flatten().map(|m| m[control]);
        assert_close("dmarkers/da", dm, theirs, 1e-6);
    }
}
