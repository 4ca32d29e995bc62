//! Sensitivities through converged sliding and contact: implicit against differences of whole equilibria, on an active
//! set that is partly closed and the same on both sides.

use super::contact_closed_forms::{contact, contact_points};
use super::support::{Discretisation, assert_close, model, side};
use crate::common::assert_pulled_back;
use risorius::fit::sensitivity::{Sensitivity, sensitivities};
use risorius::forward::{Drive, Settings, Solver};
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::{MaterialPoint, Mesh};
use risorius::model::Model;
use risorius::model::supports::Support;
use risorius::term::Term;
use risorius::term::contact::law::{Allows, Augmented, Barrier, Penalty};
use risorius::term::contact::surface::{FreeSide, Patches, Plane, Sphere};

/// A clamped beam of 48 x 16 x 12 mm whose bottom meets something; a slab at its bottom bends it down.
fn beam(meets: impl Fn(&Mesh) -> Box<dyn Term>) -> Model {
    let mesh = block(&TricubicHermite, [0.0; 3], [48.0, 16.0, 12.0], [4, 1, 1]);
    let clamp = Support::Clamp { faces: side(&mesh, 0, 0) };
    let slab = block(&Trilinear, [4.0, 2.0, 1.0], [40.0, 12.0, 3.0], [4, 1, 1]);
    let angles = FibreAngles::uniform(&slab, [0.0; 3]);
    let term = meets(&mesh);
    model(mesh, Discretisation::trilinear(10.0, 4), vec![("slab", slab, angles)], vec![term], vec![clamp])
}

/// Returns how many points are closed, and of how many.
fn check(name: &str, model: &Model, tolerance: f64) -> (usize, usize) {
    let mut solver = Solver::new(model, Settings { tolerance: 1e-9, ..Settings::default() }).expect("memory");
    let drive = Drive { controls: vec![0.03], load: 1.0 };
    let found =
        solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{name}: {}", failure.error));
    let closed = |found: &risorius::forward::Equilibrium| {
        contact_points(model, found).iter().map(|p| p.pressure != 0.0).collect::<Vec<bool>>()
    };
    let active = closed(&found);
    let iterations = solver.work().iterations;
    let ours = sensitivities(Sensitivity::Tangent, &mut solver, &found, &[0]).expect("a regular tangent");
    assert_pulled_back(name, &mut solver, &found, &ours);
    let step = 2e-4;
    let differences =
        sensitivities(Sensitivity::FiniteDifference { step }, &mut solver, &found, &[0]).expect("neighbours");
    for sign in [-1.0, 1.0] {
        let controls = vec![0.03 + sign * step * (0.03 + 1.4 / 300.0)];
        let near = solver.equilibrium_near(&found.state, &found.state, &Drive { controls, load: 1.0 });
        let near = near.unwrap_or_else(|failure| panic!("{name}: {}", failure.error));
        assert_eq!(active, closed(&near), "{name}: the active set differs");
    }
    let (now, all) = (active.iter().filter(|a| **a).count(), active.len());
    let gap = contact_points(model, &found).iter().filter_map(|p| p.gap).fold(f64::INFINITY, f64::min);
    let largest = contact_points(model, &found).iter().filter_map(|p| p.gap).fold(0.0, |m: f64, g| m.max(g.abs()));
    println!("{name}: {now} of {all} points closed, {iterations} iterations, gap {gap:.2e} to {largest:.2e} mm");
    // what markers see: the motion of material points. Mixed derivatives at the corner of a contact are hardly determined.
    let moved = |direction: &[f64]| -> Vec<f64> {
        let du = model.displacement_of(direction);
        let place = |k: usize| [k % 3, k / 3 % 3, k / 9].map(|i| i as f64 / 2.0);
        let at = |element: usize| (0..27).map(move |k| MaterialPoint { element, xi: place(k) });
        (0..model.mesh().elements()).flat_map(at).flat_map(|point| model.mesh().interpolate(point, &du)).collect()
    };
    assert_close(name, moved(&ours[0]), moved(&differences[0]), tolerance);
    (now, all)
}

fn low_plane() -> Plane {
    Plane { through: [0.0, 0.0, -0.8], normal: [0.0, 0.0, 1.0] }
}

#[test]
fn through_contact_with_a_penalty() {
    let meets = |mesh: &Mesh| {
        let law = Box::new(Penalty { stiffness: 20.0 });
        contact(mesh, &side(mesh, 2, 0), Allows::ClosedOrOpen, low_plane(), law)
    };
    let (closed, all) = check("plane, penalty", &beam(meets), 1e-5);
    assert!(closed > 0 && closed < all);
}

#[test]
fn through_contact_with_multipliers() {
    let meets = |mesh: &Mesh| {
        // stiff: the rounds close weak combinations of points slowly, and differences of equilibria see what is left
        let law = Box::new(Augmented { stiffness: 4000.0, tolerance: 1e-9 });
        let sphere = Sphere { centre: [44.0, 8.0, -60.8], radius: 60.0, free: FreeSide::Outside };
        contact(mesh, &side(mesh, 2, 0), Allows::ClosedOrOpen, sphere, law)
    };
    let (closed, all) = check("sphere, augmented", &beam(meets), 1e-5);
    assert!(closed > 0 && closed < all);
}

#[test]
fn through_contact_with_a_barrier() {
    let meets = |mesh: &Mesh| {
        let law = Box::new(Barrier { stiffness: 20.0, range: 0.3 });
        contact(mesh, &side(mesh, 2, 0), Allows::ClosedOrOpen, low_plane(), law)
    };
    let (closed, all) = check("plane, barrier", &beam(meets), 1e-5);
    assert!(closed > 0 && closed < all);
}

/// The bottom may slide on where it was.
#[test]
fn through_sliding_on_the_reference_shape() {
    let meets = |stiffness: f64, tolerance: Option<f64>| {
        move |mesh: &Mesh| {
            let faces = side(mesh, 2, 0);
            let surface = Patches::new(mesh, &faces, FreeSide::Inside);
            match tolerance {
                None => contact(mesh, &faces, Allows::Closed, surface, Box::new(Penalty { stiffness })),
                Some(tolerance) => {
                    contact(mesh, &faces, Allows::Closed, surface, Box::new(Augmented { stiffness, tolerance }))
                }
            }
        }
    };
    let (closed, all) = check("reference, penalty", &beam(meets(20.0, None)), 1e-5);
    assert_eq!(closed, all);
    let (closed, all) = check("reference, augmented", &beam(meets(100.0, Some(1e-9))), 1e-5);
    assert_eq!(closed, all);
}
