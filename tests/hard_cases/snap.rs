//! Paths that turn back: a shallow arch, a column, a muscle on its descending limb.

use super::muscles::{muscle_cube, nominal_stress};
use super::record::{clamped_with_pull, difference, drive, solver, stable};
use crate::verification::support::{Discretisation, model, side};
use risorius::forward::Equilibrium;
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::model::Model;
use risorius::model::supports::Support;
use risorius::term::Term;
use risorius::term::load::traction;
use std::f64::consts::PI;

/// Half of a clamped arch: 20 mm to its crown, 4 mm wide, 1 mm thick, bent up by z + rise sin^2(pi x / 40).
fn half_arch(rise: f64) -> Mesh {
    let length = 20.0;
    let mut mesh = block(&TricubicHermite, [0.0; 3], [length, 4.0, 1.0], [4, 1, 1]);
    let straight = mesh.parameters.clone();
    for node in 0..mesh.nodes {
        let (x, step) = (straight[8 * node][0], straight[8 * node + 1][0]);
        let angle = PI * x / (2.0 * length);
        mesh.parameters[8 * node][2] += rise * angle.sin().powi(2);
        mesh.parameters[8 * node + 1][2] += rise * (2.0 * angle).sin() * PI / (2.0 * length) * step;
    }
    mesh
}

/// Pressed at its crown by half a dead force (kPa on the cut through the crown), or moved there by a distance (mm).
fn pressed_arch(rise: f64, pressure: f64, distance: Option<f64>) -> Model {
    let mesh = half_arch(rise);
    let crown = side(&mesh, 0, 1);
    let mut supports =
        vec![Support::Clamp { faces: side(&mesh, 0, 0) }, Support::Symmetry { faces: crown.clone(), axis: 0 }];
    let mut loads: Vec<Box<dyn Term>> = Vec::new();
    match distance {
        Some(distance) => supports.push(Support::Plate { faces: crown, axis: 2, offset: -distance }),
        None => loads.push(Box::new(traction(&mesh, &crown, [0.0, 0.0, -pressure], 4))),
    }
    model(mesh, Discretisation::trilinear(10.0, 4), Vec::new(), loads, supports)
}

/// Force (mN, downwards) that holds the crown.
fn force_on_crown(model: &Model, found: &Equilibrium) -> f64 {
    let mesh = model.mesh();
    let at_crown =
        |parameter: &usize| mesh.parameter_derivative[*parameter] == 0 && mesh.parameters[*parameter][0] == 20.0;
    -(0..mesh.parameters.len()).filter(at_crown).map(|k| found.evaluation.force[k][2]).sum::<f64>()
}

fn crown(found: &Equilibrium, model: &Model) -> f64 {
    let mesh = model.mesh();
    let top = (0..mesh.nodes).find(|node| mesh.parameters[8 * node][0] == 20.0).unwrap_or(0);
    found.state.u[8 * top][2]
}

/// Moved at its crown, the arch goes through all its states, and the force rises, falls and rises again.
#[test]
fn an_arch_is_pushed_through() {
    for rise in [3.0, 6.0] {
        let model = pressed_arch(rise, 0.0, Some(2.5 * rise));
        let mut solver = solver(&model);
        let mut state = model.rest();
        let mut forces = vec![0.0];
        for k in 1..=10 {
            let case = format!("arch of rise {rise}, crown moved by {} mm", 0.25 * rise * f64::from(k));
            let found = stable(&case, &mut solver, &state, &drive(&[], 0.1 * f64::from(k)));
            forces.push(force_on_crown(&model, &found));
            state = found.state;
        }
        let turns = forces.windows(3).filter(|f| (f[1] - f[0]) * (f[2] - f[1]) < 0.0).count();
        assert_eq!(turns, 2, "{forces:?}");
        assert!(forces.iter().any(|f| *f < 0.0), "it stays on its other side by itself: {forces:?}");
    }
}

/// Pressed beyond the limit load by a dead force it snaps through; the state beyond is the one that is reached from a
/// higher load too, and when the load is taken away it stays there.
#[test]
fn an_arch_snaps_through_under_a_dead_force() {
    for rise in [3.0, 6.0] {
        let model = pressed_arch(rise, 0.02, None);
        let mut solver = solver(&model);
        let case = |what: &str| format!("arch of rise {rise}, {what}");
        let found = stable(&case("pressed beyond its limit"), &mut solver, &model.rest(), &drive(&[], 1.0));
        assert_eq!(found.snaps.len(), 1);
        assert!(crown(&found, &model) < -1.8 * rise);
        let more = stable(&case("pressed further"), &mut solver, &found.state, &drive(&[], 3.0));
        assert!(more.snaps.is_empty());
        let again = stable(&case("and back to that"), &mut solver, &more.state, &drive(&[], 1.0));
        assert!(difference(&again.state, &found.state) < 1e-6, "{:.1e}", difference(&again.state, &found.state));
        // without a load it stays on its other side; pulled, it snaps back, and ends where it began
        let free = stable(&case("let go"), &mut solver, &again.state, &drive(&[], 0.0));
        assert!(free.snaps.is_empty() && crown(&free, &model) < -1.5 * rise, "{}", crown(&free, &model));
        let back = stable(&case("pulled back"), &mut solver, &free.state, &drive(&[], -1.0));
        assert_eq!(back.snaps.len(), 1);
        let rest = stable(&case("and let go again"), &mut solver, &back.state, &drive(&[], 0.0));
        let left = rest.state.u.iter().flatten().fold(0.0_f64, |most, u| most.max(u.abs()));
        assert!(left < 1e-6, "{left:.1e} mm are left");
    }
}

/// A column that is pressed at its end buckles to a side: the straight state, an equilibrium at any load, is left where it
/// turns into a saddle, near Euler's load.
#[test]
fn a_column_buckles() {
    let [length, width] = [40.0, 4.0];
    let mesh = block(&TricubicHermite, [0.0; 3], [length, 1.5 * width, width], [4, 1, 1]);
    // one end clamped, the other free: F = pi^2 E I / (4 l^2)
    let young = 6.0 * 0.7;
    let euler = PI * PI * young * width * width / 12.0 / (4.0 * length * length);
    let model = clamped_with_pull(mesh, 10.0, [-2.0 * euler, 0.0, 0.0]);
    let mut solver = solver(&model);
    let below = stable("column at 0.8 of Euler's load", &mut solver, &model.rest(), &drive(&[], 0.4));
    assert!(below.snaps.is_empty());
    let found = stable("column at 2 times Euler's load", &mut solver, &below.state, &drive(&[], 1.0));
    assert_eq!((found.snaps.len(), found.snaps[0].modes), (1, 1));
    // the path goes from 0.8 to 2 times Euler's load
    let lost = 0.8 + 1.2 * found.snaps[0].place;
    assert!((0.98..1.15).contains(&lost), "lost at {lost} of Euler's load");
    let aside = found.state.u.iter().step_by(8).fold(0.0_f64, |most, u| most.max(u[2].abs()));
    assert!(aside > 0.6 * length, "{aside}");
}

/// A muscle that hangs from a dead force which stretches it by half shortens at once when its activation passes the limit
/// on the descending limb. The state beyond is uniform: force balance in one dimension tells its stretch.
#[test]
fn a_muscle_snaps_off_its_descending_limb() {
    let pull = nominal_stress(1.5, 0.0);
    let model = muscle_cube(None, pull);
    let mut solver = solver(&model);
    let start =
        stable("muscle under a force that stretches it by half", &mut solver, &model.rest(), &drive(&[0.0], 1.0));
    let activation = 0.15;
    let found = stable("then activated by 0.15", &mut solver, &start.state, &drive(&[activation], 1.0));
    assert_eq!(found.snaps.len(), 1);
    // the root below the maximum of force
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if nominal_stress(middle, activation) < pull { low = middle } else { high = middle }
    }
    for node in 0..model.mesh().nodes {
        let (x, u) = (model.mesh().parameters[8 * node], found.state.u[8 * node]);
        if x[0] == 10.0 {
            assert!((1.0 + 0.1 * u[0] - low).abs() < 1e-6, "stretch {} instead of {low}", 1.0 + 0.1 * u[0]);
        }
    }
}
