//! Paths: no load, too much load, many loads, guesses that are no good.

use crate::record::{assert_in_balance, attempt, cantilever, clamped_with_pull, difference, drive, solver, stable};
use crate::support::{Discretisation, slab_beam};
use risorius::Error;
use risorius::forward::{Settings, Solver, evaluate};
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::State;

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
    let model = clamped_with_pull(mesh, 10.0, [0.0, 0.0, -0.04]);
    let mut solver = solver(&model);
    let first = stable("first of two hundred reversals", &mut solver, &model.rest(), &drive(&[], 1.0)).state;
    let mut state = first.clone();
    for reversal in 0..199 {
        let load = if reversal % 2 == 0 { -1.0 } else { 1.0 };
        let found = solver.equilibrium(&state, &drive(&[], load)).unwrap_or_else(|failure| panic!("{}", failure.error));
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
    let from = solver.equilibrium_near(&full, &model.rest(), &to).unwrap_or_else(|failure| panic!("{}", failure.error));
    assert_in_balance("from an inverted guess", &model, &from.state);
    let walked = stable("slab at 0.2 beside an inverted guess", &mut solver, &model.rest(), &to);
    assert!(difference(&walked.state, &near.state).max(difference(&walked.state, &from.state)) < 1e-6);
    let damped = near.history.iter().chain(&walked.history).flat_map(|step| &step.iterations);
    assert!(damped.into_iter().any(|iteration| iteration.factor < 1.0), "no step was damped");
}

/// Loads out of reach: the failure says how far it came, and what it kept is an equilibrium. Compression crushes the
/// beam on the way. Bending has an answer, a beam of 4 m that hangs down, but its first step must be below 0.01 kPa, the
/// shortest allowed: either answer is honest.
#[test]
fn an_impossible_load_is_refused_with_its_numbers() {
    for (what, pull, has_answer) in
        [("bending by 100 kPa", [0.0, 0.0, -100.0], true), ("compression by 100 kPa", [-100.0, 0.0, 0.0], false)]
    {
        let model = cantilever(10.0, pull);
        let mut solver = solver(&model);
        let step_min = solver.settings().step_min;
        let failure = match attempt(what, &mut solver, &model.rest(), &drive(&[], 1.0)) {
            Ok(_) => {
                assert!(has_answer, "{what}");
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
        assert!(cuts > 0 && step < step_min, "{cuts} cuts, step {step}");
        assert!(element < 4 && point < 64 && det_f.is_finite(), "element {element}, point {point}, det F {det_f}");
        assert!(residual.is_nan() || residual > required, "residual {residual}, required {required}");
        assert_eq!(failure.last_good.load, reached);
        assert!(has_answer || reached > 0.05, "reached {reached}");
        assert_eq!(failure.error.code(), "S003");
    }
}
