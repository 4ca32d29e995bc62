//! The cases that break solvers: each must converge, or say why not, and never lie.

#[path = "verification/support.rs"]
#[allow(dead_code)] // a part of what the verification cases share
mod support;

use risorius::Error;
use risorius::forward::{Drive, Settings, Solver, evaluate};
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::supports::Support;
use risorius::model::{Model, State};
use risorius::term::load::traction;
use std::f64::consts::PI;
use support::{Discretisation, model, side, slab_beam};

/// A 40 x 10 x 10 beam of 4 x 1 x 1 elements, clamped at xi1 = 0, with a dead traction (kPa) on xi1 = 1.
fn cantilever(kappa: f64, pull: [f64; 3]) -> Model {
    let mesh = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [4, 1, 1]);
    let load = traction(&mesh, &side(&mesh, 0, 1), pull, 4);
    let clamp = Support::Clamp { faces: side(&mesh, 0, 0) };
    model(mesh, Discretisation::trilinear(kappa, 4), Vec::new(), vec![Box::new(load)], vec![clamp])
}

/// The norm of the residual over that of the element forces.
fn imbalance(model: &Model, state: &State) -> f64 {
    let found = evaluate(model, state);
    found.residual.iter().map(|r| r * r).sum::<f64>().sqrt() / found.magnitude
}

#[test]
fn a_zero_load_needs_no_factorisation() {
    let model = cantilever(10.0, [0.0, 0.0, -0.04]);
    let mut solver = Solver::new(&model, Settings::default()).expect("memory");
    let found = solver.equilibrium(&model.rest(), &Drive { controls: Vec::new(), load: 0.0 }).expect("rest");
    assert_eq!(found.state, model.rest());
    assert_eq!((solver.work().iterations, solver.work().linear.factorisations), (0, 0));
    assert_eq!(found.negative_modes, None);
}

/// An equilibrium asked for again costs nothing and does not move.
#[test]
fn an_equilibrium_is_kept() {
    let model = cantilever(10.0, [0.0, 0.0, -0.04]);
    let mut solver = Solver::new(&model, Settings::default()).expect("memory");
    let drive = Drive { controls: Vec::new(), load: 1.0 };
    let first = solver.equilibrium(&model.rest(), &drive).expect("bending");
    let before = solver.work();
    let second = solver.equilibrium(&first.state, &drive).expect("the same");
    assert_eq!(first.state, second.state);
    assert_eq!(solver.work().linear.factorisations, before.linear.factorisations);
}

#[test]
fn full_activation_of_a_slab_converges() {
    let model = slab_beam(Discretisation::trilinear(10.0, 4), &[("slab", [4.5, 2.0, 14.2], 0.0)]);
    let mut solver = Solver::new(&model, Settings::default()).expect("memory");
    let drive = Drive { controls: vec![1.0], load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    assert_eq!(found.negative_modes, Some(0));
    assert!(found.evaluation.det_f.min > 0.5, "{:?}", found.evaluation.det_f);
    assert!(imbalance(&model, &found.state) < 1e-7);
    // and back: the body is elastic
    let back = solver.equilibrium(&found.state, &Drive { controls: vec![0.0], load: 0.0 });
    let back = back.unwrap_or_else(|failure| panic!("{}", failure.error));
    let largest = back.state.u.iter().flatten().fold(0.0_f64, |most, u| most.max(u.abs()));
    assert!(largest < 1e-5, "{largest:.1e} mm are left");
}

#[test]
fn a_beam_is_twisted_by_half_a_turn() {
    let mesh = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [4, 1, 1]);
    let clamp = Support::Clamp { faces: side(&mesh, 0, 0) };
    let (axis, through) = ([1.0, 0.0, 0.0], [0.0, 5.0, 5.0]);
    let turn = Support::Rotate { faces: side(&mesh, 0, 1), axis, through, angle: PI };
    let model = model(mesh, Discretisation::trilinear(10.0, 4), Vec::new(), Vec::new(), vec![clamp, turn]);
    let mut solver = Solver::new(&model, Settings::default()).expect("memory");
    let drive = Drive { controls: Vec::new(), load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    assert!(found.history.len() >= 8, "steps of at most pi/8");
    assert_eq!(found.negative_modes, Some(0));
    assert!(imbalance(&model, &found.state) < 1e-7);
    // the turned face stands on its head
    for node in 0..model.mesh().nodes {
        let x = model.mesh().parameters[8 * node];
        if x[0] == 40.0 {
            let u = found.state.u[8 * node];
            let now = [x[0] + u[0], x[1] + u[1], x[2] + u[2]];
            let expected = [40.0, 10.0 - x[1], 10.0 - x[2]];
            assert!(now.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{now:?}");
        }
    }
}

/// Without the volumetric term several solutions exist: the one found is stable.
#[test]
fn bending_without_kappa_is_stable() {
    let model = cantilever(0.0, [0.0, 0.0, -0.04]);
    let mut solver = Solver::new(&model, Settings::default()).expect("memory");
    let drive = Drive { controls: Vec::new(), load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    assert_eq!(found.negative_modes, Some(0));
    assert!(found.evaluation.det_f.min > 0.0);
}

/// Loads out of reach: the failure says how far it came, and what it kept is an equilibrium. Compression crushes the
/// beam on the way. Bending has an answer, a beam of 4 m that hangs down, but its first step must be below 0.01 kPa, the
/// shortest allowed: either answer is honest.
#[test]
fn an_impossible_load_is_refused_with_its_numbers() {
    for (pull, has_answer) in [([0.0, 0.0, -100.0], true), ([-100.0, 0.0, 0.0], false)] {
        let model = cantilever(10.0, pull);
        let settings = Settings::default();
        let mut solver = Solver::new(&model, settings).expect("memory");
        let drive = Drive { controls: Vec::new(), load: 1.0 };
        let failure = match solver.equilibrium(&model.rest(), &drive) {
            Ok(found) => {
                assert!(has_answer && imbalance(&model, &found.state) < 1e-7);
                continue;
            }
            Err(failure) => failure,
        };
        let Error::NotConverged { reached, cuts, step, element, point, det_f, residual, required, .. } =
            failure.error
        else {
            panic!("{}", failure.error)
        };
        assert!((0.0..1.0).contains(&reached) && reached == failure.reached, "reached {reached}");
        assert!(cuts > 0 && step < settings.step_min, "{cuts} cuts, step {step}");
        assert!(element < 4 && point < 64 && det_f.is_finite(), "element {element}, point {point}, det F {det_f}");
        assert!(residual.is_nan() || residual > required, "residual {residual}, required {required}");
        assert_eq!(failure.last_good.load, reached);
        assert!(has_answer || reached > 0.05, "reached {reached}");
        if reached > 0.0 {
            assert!(imbalance(&model, &failure.last_good) < 1e-7);
        } else {
            assert_eq!(failure.last_good, model.rest());
        }
        assert_eq!(failure.error.code(), "S003");
    }
}
