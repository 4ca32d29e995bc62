//! What must not matter: units and the direction of the axes.

use super::record::{drive, solver, stable};
use crate::verification::support::{Discretisation, model, side};
use risorius::forward::{Equilibrium, Settings};
use risorius::math::tensor::{Matrix, Vector, apply, rotation};
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::model::Model;
use risorius::model::build::build;
use risorius::model::supports::Support;
use risorius::scene::Scene;
use risorius::term::Term;
use risorius::term::contact::law::{Allows, Penalty};
use risorius::term::contact::surface::{FreeSide, Plane, Sphere};
use risorius::term::contact::{Contact, Interface};
use risorius::term::load::{FollowerPressure, body_force, traction};
use risorius::term::spring::{Resists, Springs};
use std::path::Path;

/// A beam with an active muscle, weight, traction, pressure, springs, an attachment, a sliding and a contact, all lengths
/// times `l` and all stresses times `s`.
fn scaled_scene(l: f64, s: f64, law: &str) -> Scene {
    let law = match law {
        "penalty" => format!("penalty = {{ kpa_per_mm = {} }}", 2.0 * s / l),
        "augmented" => format!("augmented = {{ kpa_per_mm = {}, gap_mm = {} }}", 5.0 * s / l, 1e-3 * l),
        _ => format!("barrier = {{ kpa_per_mm = {}, range_mm = {} }}", 2.0 * s / l, 1.5 * l),
    };
    let text = format!(
        r#"
[task]
kind = "forward"
[mesh]
block = {{ origin_mm = [0, 0, 0], size_mm = [{}, {}, {}], elements = [3, 1, 1] }}
[tissue]
mooney-rivlin = {{ c1_kpa = {}, c2_kpa = {} }}
kappa_kpa = {}
gauss = 4
[[muscle]]
name = "slab"
block = {{ origin_mm = [{}, {}, {}], size_mm = [{}, {}, {}], elements = [3, 1, 1] }}
fibre_angles_deg = [20, 0, 0]
blemker = {{ sigma_max_kpa = {}, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }}
[[support]]
clamp = {{ face = "xi1=0" }}
[[load]]
gravity = {{ density_kg_m3 = 1040, acceleration_m_s2 = [0, 0, {}] }}
[[load]]
traction = {{ face = "xi1=1", kpa = [0, {}, 0] }}
[[load]]
pressure = {{ face = "xi2=0", kpa = {} }}
[[load]]
spring = {{ face = "xi2=1", kpa_per_mm = {} }}
[[attachment]]
position_mm = [{}, {}, {}]
stiffness_mn_per_mm = {}
[[contact]]
face = "xi3=1"
surface = {{ sphere = {{ centre_mm = [{}, {}, {}], radius_mm = {}, inside = false }} }}
law = {{ {law} }}
[controls]
slab = 0.05
"#,
        30.0 * l,
        10.0 * l,
        10.0 * l,
        0.5 * s,
        0.2 * s,
        10.0 * s,
        3.0 * l,
        1.0 * l,
        6.0 * l,
        24.0 * l,
        8.0 * l,
        3.0 * l,
        300.0 * s,
        -4.0 * s / l,
        0.01 * s,
        0.005 * s,
        0.002 * s / l,
        30.0 * l,
        5.0 * l,
        5.0 * l,
        0.1 * s * l,
        26.0 * l,
        5.0 * l,
        30.2 * l,
        20.0 * l,
    );
    Scene::parse(&text, "scaled.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// The largest |a - b| over the largest |b|, where a is in units of `unit`.
fn relative(ours: impl Iterator<Item = f64>, unit: f64, theirs: impl Iterator<Item = f64> + Clone) -> f64 {
    let scale = theirs.clone().fold(0.0_f64, |most, b| most.max(b.abs()));
    ours.zip(theirs).fold(0.0_f64, |most, (a, b)| most.max((a / unit - b).abs())) / scale
}

#[test]
fn units_do_not_matter() {
    for law in ["penalty", "augmented", "barrier"] {
        let solved = |l: f64, s: f64| {
            let model = build(&scaled_scene(l, s, law)).unwrap_or_else(|error| panic!("{error}")).model;
            let case = format!("{law}, lengths x {l:e}, stresses x {s:e}");
            let mut solver = solver(&model);
            solver.set_settings(Settings { tolerance: 1e-11, ..Settings::default() });
            let found = stable(&case, &mut solver, &model.rest(), &drive(&[0.05], 1.0));
            assert!(risorius::report::contact_states(&model, &found.state)[0].area > 0.0, "{case}: no contact");
            found
        };
        let plain = solved(1.0, 1.0);
        for (l, s) in [(1e-3, 1.0), (1e3, 1.0), (1.0, 1e-3), (1.0, 1e3), (1e-3, 1e3)] {
            let found = solved(l, s);
            let u = relative(found.state.u.iter().flatten().copied(), l, plain.state.u.iter().flatten().copied());
            let p = relative(found.state.p.iter().copied(), s, plain.state.p.iter().copied());
            assert!(u < 1e-9 && p < 1e-9, "{law}, lengths x {l:e}, stresses x {s:e}: {u:.1e}, {p:.1e}");
        }
    }
}

/// What counts as rounding in the reference shape goes with the size of its elements.
#[test]
fn a_gap_at_the_start_is_judged_by_the_size_of_the_body() {
    for l in [1e-3, 1.0, 1e3] {
        for (depth, refused) in [(1e-5, true), (1e-8, false)] {
            let text = format!(
                r#"
[task]
kind = "forward"
[mesh]
block = {{ origin_mm = [0, 0, 0], size_mm = [{0}, {0}, {0}], elements = [1, 1, 1] }}
[tissue]
mooney-rivlin = {{ c1_kpa = 0.5, c2_kpa = 0.2 }}
[[support]]
clamp = {{ face = "xi1=0" }}
[[sliding]]
face = "xi3=0"
surface = {{ plane = {{ through_mm = [0, 0, {1}], normal = [0, 0, 1] }} }}
law = {{ penalty = {{ kpa_per_mm = 5 }} }}
"#,
                10.0 * l,
                10.0 * l * depth
            );
            let scene =
                Scene::parse(&text, "gap.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{error}"));
            let built = build(&scene).map(|_| ());
            assert_eq!(built.is_err(), refused, "length {l:e}, gap {depth:e}: {built:?}");
        }
    }
}

/// As above, built by hand and turned by `q` about the origin.
fn turned(q: &Matrix) -> Model {
    let turn = |v: Vector| apply(q, v);
    let mut mesh = block(&TricubicHermite, [0.0; 3], [30.0, 10.0, 10.0], [3, 1, 1]);
    mesh.parameters.iter_mut().for_each(|x| *x = turn(*x));
    let mut muscle = block(&Trilinear, [3.0, 1.0, 6.0], [24.0, 8.0, 3.0], [3, 1, 1]);
    muscle.parameters.iter_mut().for_each(|x| *x = turn(*x));
    let angles = FibreAngles::uniform(&muscle, [20.0_f64.to_radians(), 0.1, 0.0]);
    let contact = |name: &str, surface, direction, end| -> Box<dyn Term> {
        let interface = Interface {
            allows: Allows::ClosedOrOpen,
            surface,
            law: Box::new(Penalty { stiffness: 2.0 }),
            relax: false,
        };
        Box::new(Contact::new(name, interface, &mesh, &side(&mesh, direction, end), 5))
    };
    let loads: Vec<Box<dyn Term>> = vec![
        Box::new(body_force(&mesh, turn([0.0, 0.0, -0.004]), 4)),
        Box::new(traction(&mesh, &side(&mesh, 0, 1), turn([0.0, 0.01, 0.0]), 4)),
        Box::new(FollowerPressure::new(&mesh, &side(&mesh, 1, 0), 0.005, 4)),
        Box::new(Springs::foundation(&mesh, &side(&mesh, 1, 1), 0.002, Resists::Normal, 4)),
        contact(
            "sphere",
            Box::new(Sphere { centre: turn([26.0, 5.0, 30.2]), radius: 20.0, free: FreeSide::Outside }),
            2,
            1,
        ),
        contact("plane", Box::new(Plane { through: turn([0.0, 10.0, 0.0]), normal: turn([0.0, -1.0, 0.0]) }), 1, 1),
    ];
    let axis = turn([1.0, 0.0, 0.0]);
    let wring = Support::Rotate { faces: side(&mesh, 0, 0), axis, through: turn([0.0, 5.0, 5.0]), angle: 0.5 };
    model(mesh, Discretisation::trilinear(10.0, 4), vec![("slab", muscle, angles)], loads, vec![wring])
}

#[test]
fn the_axes_do_not_matter() {
    let solved = |q: &Matrix, what: &str| -> Equilibrium {
        let model = turned(q);
        let mut solver = solver(&model);
        solver.set_settings(Settings { tolerance: 1e-10, ..Settings::default() });
        let found = stable(&format!("whole scene turned, {what}"), &mut solver, &model.rest(), &drive(&[0.05], 1.0));
        let contacts = risorius::report::contact_states(&model, &found.state);
        assert!(contacts.iter().any(|contact| contact.area > 0.0), "no contact");
        found
    };
    let plain = solved(&rotation([0.0, 0.0, 1.0], 0.0), "by nothing");
    for (what, axis, angle) in [
        ("by 90 degrees about z", [0.0, 0.0, 1.0], 0.5 * std::f64::consts::PI),
        ("by 1 about (2, -1, 2)", [2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0], 1.0),
        ("by 3 about (-2, 6, 3)", [-2.0 / 7.0, 6.0 / 7.0, 3.0 / 7.0], 3.0),
    ] {
        let q = rotation(axis, angle);
        let found = solved(&q, what);
        let expected: Vec<Vector> = plain.state.u.iter().map(|u| apply(&q, *u)).collect();
        let u = relative(found.state.u.iter().flatten().copied(), 1.0, expected.iter().flatten().copied());
        let p = relative(found.state.p.iter().copied(), 1.0, plain.state.p.iter().copied());
        assert!(u < 1e-9 && p < 1e-9, "turned {what}: {u:.1e}, {p:.1e}");
    }
}
