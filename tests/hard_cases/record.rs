//! What every hard case must show, and the row that tells how it ended.

use crate::verification::support::{Discretisation, model, side};
use risorius::forward::{Drive, Equilibrium, Failure, Settings, Solver, StepKind, evaluate};
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::supports::Support;
use risorius::model::{Model, State};
use risorius::term::load::traction;

/// What an equilibrium may lack, in relation to the element forces.
const IMBALANCE: f64 = 1e-7;
/// At rest there are no element forces: in relation to mu V^(2/3).
const ROUNDING: f64 = 1e-12;

pub type Ended = Result<Equilibrium, Box<Failure>>;

/// A 40 x 10 x 10 beam of 4 x 1 x 1 elements, clamped at xi1 = 0, with a dead traction (kPa) on xi1 = 1.
pub fn cantilever(kappa: f64, pull: [f64; 3]) -> Model {
    clamped_with_pull(block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [4, 1, 1]), kappa, pull)
}

/// A body that is clamped at xi1 = 0, with a dead traction (kPa) on xi1 = 1.
pub fn clamped_with_pull(mesh: Mesh, kappa: f64, pull: [f64; 3]) -> Model {
    let load = traction(&mesh, &side(&mesh, 0, 1), pull, 4);
    let clamp = Support::Clamp { faces: side(&mesh, 0, 0) };
    model(mesh, Discretisation::trilinear(kappa, 4), Vec::new(), vec![Box::new(load)], vec![clamp])
}

pub fn solver(model: &Model) -> Solver<'_> {
    Solver::new(model, Settings::default()).expect("memory")
}

pub fn drive(controls: &[f64], load: f64) -> Drive {
    Drive { controls: controls.to_vec(), load }
}

/// Solves, prints a row, and holds the answer to what it claims: a state in balance without an inverted point, or an error
/// whose last good state is one.
pub fn attempt(case: &str, solver: &mut Solver<'_>, from: &State, to: &Drive) -> Ended {
    let before = solver.work();
    let ended = solver.equilibrium(from, to);
    let after = solver.work();
    let how = match &ended {
        Ok(found) => match found.negative_modes {
            Some(modes) if modes > 0 => format!("a saddle of {modes} modes"),
            _ if !found.snaps.is_empty() => format!("converged, snapped {} times", found.snaps.len()),
            _ => "converged".into(),
        },
        Err(failure) => format!("{} at {:.2} %", failure.error.code(), 100.0 * failure.reached),
    };
    println!(
        "| {case} | {how} | {} | {} | {} |",
        after.iterations - before.iterations,
        after.linear.factorisations - before.linear.factorisations,
        after.cuts - before.cuts
    );
    match &ended {
        Ok(found) => {
            assert_in_balance(case, solver.model(), &found.state);
            assert_eq!((found.state.load, &found.state.controls), (to.load, &to.controls), "{case}");
            assert!(found.history.iter().all(|step| step.kind != StepKind::Failed), "{case}");
            let snapped = found.history.iter().filter(|step| step.kind == StepKind::Snapped);
            assert!(snapped.map(|step| step.place).eq(found.snaps.iter().map(|snap| snap.place)), "{case}");
        }
        Err(failure) => {
            assert!((0.0..=1.0).contains(&failure.reached), "{case}: reached {}", failure.reached);
            if failure.last_good != *from {
                assert_in_balance(case, solver.model(), &failure.last_good);
            }
        }
    }
    ended
}

/// As [`attempt`], for a case that must converge to a stable state.
#[track_caller]
pub fn stable(case: &str, solver: &mut Solver<'_>, from: &State, to: &Drive) -> Equilibrium {
    let found = attempt(case, solver, from, to).unwrap_or_else(|failure| panic!("{case}: {}", failure.error));
    assert_eq!(found.negative_modes.unwrap_or(0), 0, "{case}");
    found
}

pub fn assert_in_balance(case: &str, model: &Model, state: &State) {
    let found = evaluate(model, state);
    // volumes times mu / h are forces
    let mut forces = found.residual.clone();
    for index in 0..model.numbering().pressures() {
        forces[model.numbering().pressure_unknown(index)] *= model.volume_scale();
    }
    let residual = forces.iter().map(|r| r * r).sum::<f64>().sqrt();
    let allowed = IMBALANCE * found.magnitude + ROUNDING * model.force_scale();
    assert!(residual <= allowed, "{case}: imbalance {residual:.1e} mN, allowed {allowed:.1e}");
    assert!(found.det_f.min > 0.0 && found.det_f.max.is_finite(), "{case}: det F {:?}", found.det_f);
    for (parameter, component, value) in model.supports().prescribed(model.mesh(), state.load, &state.controls) {
        let missing = (state.u[parameter][component] - value).abs();
        assert!(missing <= 1e-12 * model.element_size(), "{case}: {missing:.1e} mm of prescribed motion are missing");
    }
}

/// The largest difference of displacements over the largest displacement.
pub fn difference(a: &State, b: &State) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most: f64, v| most.max(v.abs()));
    let (u, v) = (a.u.iter().flatten(), b.u.iter().flatten());
    let difference = largest(&mut u.clone().zip(v).map(|(a, b)| a - b));
    difference / largest(&mut u.copied()).max(f64::MIN_POSITIVE)
}
