//! Muscles beyond what a face does with them.

use super::record::{difference, drive, solver, stable};
use crate::verification::support::{Discretisation, FIBRE, TISSUE, model, side, slab_beam};
use risorius::forward::Equilibrium;
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::model::build::build;
use risorius::model::supports::Support;
use risorius::model::{Model, State};
use risorius::scene::Scene;
use risorius::term::Term;
use risorius::term::load::traction;
use std::path::Path;

fn shipped(problem: &str, overrides: &[&str]) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems").join(problem).join("problem.toml");
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).into()).collect();
    build(&Scene::read(&path, &overrides).expect("a scene")).expect("a model").model
}

/// sigma_max is 400 times the tissue's stiffness: the slab shortens to about half its length and the beam curls up.
#[test]
fn every_slab_is_activated_in_full() {
    for degrees in [0, 36, 60, 90] {
        let model = shipped("slab", &[&format!("muscle.slab.fibre_angles_deg=[{degrees},0,0]")]);
        let mut solver = solver(&model);
        let case = format!("slab at {degrees} degrees, activation 1");
        let found = stable(&case, &mut solver, &model.rest(), &drive(&[1.0], 1.0));
        assert!(found.evaluation.det_f.min > 0.5, "{case}: {:?}", found.evaluation.det_f);
        if degrees == 36 {
            // and back: the body is elastic
            let back = stable(&format!("{case}, and back"), &mut solver, &found.state, &drive(&[0.0], 0.0));
            let left = back.state.u.iter().flatten().fold(0.0_f64, |most, u| most.max(u.abs()));
            assert!(left < 1e-5, "{left:.1e} mm are left");
        }
    }
}

#[test]
fn both_slabs_of_the_default_problem_are_activated_in_full() {
    let model = shipped("beam", &["tissue.gauss=4"]);
    for (top, bottom) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let case = format!("default problem, activations {top} and {bottom}");
        stable(&case, &mut solver(&model), &model.rest(), &drive(&[top, bottom], 1.0));
    }
}

/// Two slabs in the same place, one along, one across.
#[test]
fn muscles_that_cross_do_not_hinder_each_other() {
    let place = [4.5, 2.0, 8.0];
    let model = slab_beam(Discretisation::trilinear(10.0, 4), &[("along", place, 0.0), ("across", place, 90.0)]);
    let mut solver = solver(&model);
    let mut state = model.rest();
    for (along, across) in [(0.3, 0.3), (1.0, 0.01), (0.01, 1.0)] {
        let case = format!("muscles that cross, activations {along} and {across}");
        state = stable(&case, &mut solver, &state, &drive(&[along, across], 1.0)).state;
    }
    // the way there does not matter
    let direct = stable("the last of these from rest", &mut solver, &model.rest(), &drive(&[0.01, 1.0], 1.0));
    assert!(difference(&direct.state, &state) < 1e-6, "{:.1e}", difference(&direct.state, &state));
}

/// A cube of 10 mm in two elements, all of it muscle along x, free to become thinner; its end is a smooth plate that the
/// load factor moves, or carries a dead traction in kPa.
pub fn muscle_cube(offset: Option<f64>, pull: f64) -> Model {
    let mesh = block(&TricubicHermite, [0.0; 3], [10.0; 3], [2, 1, 1]);
    let muscle = block(&Trilinear, [0.0; 3], [10.0; 3], [2, 1, 1]);
    let angles = FibreAngles::uniform(&muscle, [0.0; 3]);
    let mut supports: Vec<Support> =
        (0..3).map(|axis| Support::Symmetry { faces: side(&mesh, axis, 0), axis }).collect();
    let mut loads: Vec<Box<dyn Term>> = Vec::new();
    match offset {
        Some(offset) => supports.push(Support::Plate { faces: side(&mesh, 0, 1), axis: 0, offset }),
        None => loads.push(Box::new(traction(&mesh, &side(&mesh, 0, 1), [pull, 0.0, 0.0], 4))),
    }
    model(mesh, Discretisation::trilinear(10.0, 4), vec![("all", muscle, angles)], loads, supports)
}

/// Nominal stress along the fibres (kPa) of an incompressible body that is stretched along them.
pub fn nominal_stress(stretch: f64, activation: f64) -> f64 {
    let tissue = 2.0 * (TISSUE.c1 + TISSUE.c2 / stretch) * (stretch - stretch.powi(-2));
    tissue + FIBRE.tension(stretch, activation).force
}

/// Held at a stretch of 1.5 and activated. Beyond an activation of about 0.26 each fibre would rather be longer or
/// shorter: the uniform state, still an equilibrium, loses its stability, and one part of the body stretches the other.
#[test]
fn a_fibre_is_stretched_by_half_and_then_activated() {
    let model = muscle_cube(Some(5.0), 0.0);
    let mut solver = solver(&model);
    let stretched = stable("muscle stretched by 50 %", &mut solver, &model.rest(), &drive(&[0.0], 1.0));
    // weak enough, it stays uniform: its sides come in by 1/sqrt(1.5)
    let weak = stable("then activated by 0.2", &mut solver, &stretched.state, &drive(&[0.2], 1.0));
    let uniform = |found: &Equilibrium| {
        (0..model.mesh().nodes).all(|node| {
            let (x, u) = (model.mesh().parameters[8 * node], found.state.u[8 * node]);
            let expected = [0.5 * x[0], (1.5_f64.powf(-0.5) - 1.0) * x[1], (1.5_f64.powf(-0.5) - 1.0) * x[2]];
            (0..3).all(|i| (u[i] - expected[i]).abs() < 1e-6)
        })
    };
    assert!(uniform(&weak));
    let descending =
        |activation| model.descending_fibres(&State { controls: vec![activation], ..weak.state.clone() });
    assert!(descending(0.1).is_empty(), "the passive force rises faster than the active one falls");
    // active enough, every fibre of the uniform state is on its descending limb
    let descending = descending(0.2);
    let [all] = descending[..] else { panic!("{descending:?}") };
    assert!(all.points == 54 && all.of == 54 && (all.stretch - 1.5).abs() < 1e-6, "{all:?}");
    let strong = stable("then activated by 0.4", &mut solver, &weak.state, &drive(&[0.4], 1.0));
    assert!(!strong.snaps.is_empty() && strong.snaps[0].modes > 0, "{:?}", strong.snaps);
    assert!(!uniform(&strong));
    let [some] = model.descending_fibres(&strong.state)[..] else { panic!("no fibre is long") };
    assert!(some.points < 54 && some.stretch > 1.5, "{some:?}");
}
