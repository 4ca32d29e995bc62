//! Paths: no load, too much load, many loads, guesses that are no good.

use super::record::{assert_in_balance, attempt, cantilever, clamped_with_pull, difference, drive, solver, stable};
use crate::verification::support::{Discretisation, slab_beam};
use risorius::Error;
use risorius::error::Likely;
use risorius::forward::{Settings, Solver, StepKind, evaluate};
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::State;
use risorius::model::build::build;
use risorius::scene::Scene;
use std::path::Path;

#[test]
fn a_zero_load_needs_no_factorisation() {
    let model = cantilever(10.0, [0.0, 0.0, -0.04]);
    let mut solver = solver(&model);
    let found = solver.equilibrium(&model.rest(), &drive(&[], 0.0)).expect("rest");
    assert_eq!(found.state, model.rest());
    assert_eq!((solver.work().iterations, solver.work().linear.factorisations), (0, 0));
    assert_eq!(found.negative_modes, None);
}

/// An equilibrium asked for again costs nothing and does not move.
#[test]
fn an_equilibrium_is_kept() {
    let model = cantilever(10.0, [0.0, 0.0, -0.04]);
    let mut solver = solver(&model);
    let first = solver.equilibrium(&model.rest(), &drive(&[], 1.0)).expect("bending");
    let before = solver.work();
    let second = solver.equilibrium(&first.state, &drive(&[], 1.0)).expect("the same");
    assert_eq!(first.state, second.state);
    assert_eq!(solver.work().linear.factorisations, before.linear.factorisations);
}

/// A beam that is bent up and down a hundred times ends where it was the first time.
#[test]
fn two_hundred_load_reversals_do_not_drift() {
    let mesh = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [2, 1, 1]);
    let model = clamped_with_pull(mesh, 10.0, [0.0, 0.0, -0.015]);
    let mut solver = solver(&model);
    let first = stable("first of two hundred reversals", &mut solver, &model.rest(), &drive(&[], 1.0)).state;
    let mut state = first.clone();
    for reversal in 0..199 {
        let load = if reversal % 2 == 0 { -1.0 } else { 1.0 };
        let found =
            solver.equilibrium(&state, &drive(&[], load)).unwrap_or_else(|failure| panic!("{}", failure.error));
        assert_eq!(found.negative_modes, Some(0));
        state = found.state;
    }
    let last = stable("last of two hundred reversals", &mut solver, &state, &drive(&[], 1.0)).state;
    assert!(difference(&first, &last) < 1e-7, "drifted by {:.1e}", difference(&first, &last));
}

/// The full Newton step from rest turns the body inside out; damping finds the way.
#[test]
fn inverted_trial_states_are_left() {
    let model = slab_beam(Discretisation::trilinear(10.0, 4), &[("slab", [4.5, 2.0, 14.2], 0.0)]);
    let mut solver = Solver::new(&model, Settings { step_max: 1.0, ..Settings::default() }).expect("memory");
    let to = drive(&[0.2], 1.0);
    let start = State { controls: to.controls.clone(), load: to.load, ..model.rest() };
    let mut step: Vec<f64> = evaluate(&model, &start).residual.iter().map(|r| -r).collect();
    solver.solve_with_tangent(&start, &mut step, 1).expect("a tangent");
    let mut full = start.clone();
    model.advance(&mut full, &step, 1.0);
    let inverted = evaluate(&model, &full).det_f.min;
    assert!(inverted.is_nan() || inverted <= 0.0, "the full step is admissible: det F {inverted}");
    // Newton's method alone, from rest in one step
    let near = solver.equilibrium_near(&model.rest(), &model.rest(), &to);
    let near = near.unwrap_or_else(|failure| panic!("{}", failure.error));
    assert_in_balance("from rest", &model, &near.state);
    // from an inverted guess: the path is walked instead
    let from =
        solver.equilibrium_near(&full, &model.rest(), &to).unwrap_or_else(|failure| panic!("{}", failure.error));
    assert_in_balance("from an inverted guess", &model, &from.state);
    let walked = stable("slab at 0.2 beside an inverted guess", &mut solver, &model.rest(), &to);
    assert!(difference(&walked.state, &near.state).max(difference(&walked.state, &from.state)) < 1e-6);
    let damped = near.history.iter().chain(&walked.history).flat_map(|step| &step.iterations);
    assert!(damped.into_iter().any(|iteration| iteration.factor < 1.0), "no step was damped");
}

/// Dead loads that no path leads to in steps of the shortest length allowed: they end in an answer (a beam that hangs
/// down, many times its length) or in a failure that says how far it came, and whose last good state is an equilibrium.
#[test]
fn a_load_out_of_reach_is_refused_with_its_numbers() {
    let mut refused = 0;
    for (what, pull) in [("bending by 100 kPa", [0.0, 0.0, -100.0]), ("compression by 100 kPa", [-100.0, 0.0, 0.0])] {
        let model = clamped_with_pull(block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [2, 1, 1]), 10.0, pull);
        for release in if pull[0] == 0.0 { vec![false] } else { vec![false, true] } {
            let mut solver = Solver::new(&model, Settings { release, ..Settings::default() }).expect("memory");
            let case = if release { format!("{what}, let go where it fails") } else { what.into() };
            let Err(failure) = attempt(&case, &mut solver, &model.rest(), &drive(&[], 1.0)) else {
                assert!(release, "{case}");
                continue;
            };
            refused += 1;
            let Error::NotConverged { reached, cuts, step, element, point, det_f, residual, required, .. } =
                failure.error
            else {
                panic!("{}", failure.error)
            };
            assert!((0.0..1.0).contains(&reached) && reached == failure.reached, "reached {reached}");
            assert!(cuts > 0 && step < solver.settings().step_min, "{cuts} cuts, step {step}");
            assert!(
                element < 2 && point < 64 && det_f.is_finite(),
                "element {element}, point {point}, det F {det_f}"
            );
            assert!(residual.is_nan() || residual > required, "residual {residual}, required {required}");
            assert_eq!(failure.last_good.load, reached);
            let kinds: Vec<StepKind> = failure.history.iter().map(|step| step.kind).collect();
            assert_eq!(kinds.last(), Some(&StepKind::Failed), "{kinds:?}");
            assert_eq!(failure.error.code(), "S003");
        }
    }
    assert!(refused >= 2);
}

/// A block that slides on the plane of its own lower side, pulled off the edge by more than an element.
#[test]
fn a_face_that_leaves_its_surface_is_named() {
    let text = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [20, 10, 10], elements = [2, 1, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
gauss = 4
[[sliding]]
name = "deep fascia"
face = "xi3=0"
surface = { reference = true }
law = { penalty = { kpa_per_mm = 5 } }
[[load]]
spring = { face = "xi1=0", kpa_per_mm = 0.02 }
[[load]]
traction = { face = "xi1=0", kpa = [0.6, 0, 0] }
"#;
    let scene = Scene::parse(text, "off.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{error}"));
    let model = build(&scene).unwrap_or_else(|error| panic!("{error}")).model;
    let mut solver = solver(&model);
    let failure =
        attempt("slid off its surface", &mut solver, &model.rest(), &drive(&[], 1.0)).expect_err("it is off");
    let Error::NotConverged { likely: Some(likely), reached, .. } = &failure.error else {
        panic!("{}", failure.error)
    };
    let Likely::OffSurface { name, position, .. } = &**likely else { panic!("{likely}") };
    assert_eq!(name, "deep fascia");
    // patches end an element, 10 mm, beyond their edge
    assert!(position[0] > 30.0 && position[2].abs() < 1.0, "{position:?}");
    assert!((0.25..0.4).contains(reached), "30 mm of force on a spring of 0.02 kPa/mm: {reached}");
    let told = failure.error.to_string();
    assert!(told.contains("every step leads off a surface") && told.contains("`deep fascia`"), "{told}");
}
