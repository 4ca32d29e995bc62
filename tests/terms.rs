//! Every term: force = dPi/dx, stiffness = dforce/dx, control and load forces; rigid motion costs nothing; parameter
//! maps assemble like the mesh they stand for; the same bits on any number of threads.

use crate::common;
use crate::common::{Random, assert_close, curved_block, product};
use risorius::forward::{Drive, Settings, Solver};
use risorius::material::MooneyRivlin;
use risorius::material::fibre::Blemker;
use risorius::math::tensor::{Matrix, Vector, apply, normalised};
use risorius::mesh::block::block;
use risorius::mesh::element::{Element, TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::join::join;
use risorius::mesh::location::Locator;
use risorius::mesh::map::{ElementMap, Term as MapTerm};
use risorius::mesh::{MaterialPoint, Mesh};
use risorius::model::supports::{Support, Supports};
use risorius::model::{Control, Evaluation, Ingredients, Model, State, Workspace};
use risorius::term::bone::{Bone, Hinge, Slide};
use risorius::term::contact::law::{Allows, Augmented, Barrier, ContactLaw, Penalty};
use risorius::term::contact::mutual::{Between, Manner, Mutual};
use risorius::term::contact::surface::{Arch, Capsule, Cylinder, FreeSide, Patches, Plane, RigidSurface, Sphere};
use risorius::term::contact::{Contact, Interface};
use risorius::term::load::{FollowerPressure, body_force, gravity, nodal_force, traction};
use risorius::term::muscle::{Activation, Muscle};
use risorius::term::muscle_rule::MuscleRule;
use risorius::term::pressure::{self, PRESSURE_SPACES, PressureSpace};
use risorius::term::spring::{Resists, Springs};
use risorius::term::tie::RigidTies;
use risorius::term::tissue::Tissue;
use risorius::term::{Term, Want};
use std::sync::Arc;

const TISSUE: MooneyRivlin = MooneyRivlin { c1: 0.5, c2: 0.2 };
const FIBRE: Blemker = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };

fn host() -> Mesh {
    curved_block(&TricubicHermite, [2, 2, 1], 0.05, 21)
}

fn tissue(mesh: &Mesh, kappa: f64, space: &dyn PressureSpace) -> Box<dyn Term> {
    Box::new(Tissue::new(mesh, TISSUE, kappa, space, 4).expect("sound geometry"))
}

/// A muscle of 2 x 1 x 1 curved elements, its fibres twisted, in the middle of the host.
fn muscle(host: &Mesh, element: &'static dyn Element) -> Box<dyn Term> {
    activated(host, element, Activation::Uniform(0))
}

fn activated(host: &Mesh, element: &'static dyn Element, activation: Activation) -> Box<dyn Term> {
    let (mesh, angles) = twisted(element);
    let muscle = Muscle::new("muscle", &Locator::new(host), &mesh, &angles, 3, FIBRE, activation).expect("embedded");
    Box::new(muscle)
}

/// The same with a rule that is cut and fibres that end softly.
fn tapered(host: &Mesh) -> Box<dyn Term> {
    let (mesh, angles) = twisted(&Trilinear);
    let locator = Locator::new(host);
    let rule = MuscleRule::cut(&mesh, &locator, 2);
    let muscle = Muscle::with_rule("muscle", &locator, &mesh, &angles, &rule, FIBRE, 0).expect("embedded");
    Box::new(muscle.tapered(&Locator::new(&mesh), 3.0))
}

fn twisted(element: &'static dyn Element) -> (Mesh, FibreAngles) {
    let mut mesh = block(element, [3.0, 4.0, 3.0], [14.0, 11.0, 4.0], [2, 1, 1]);
    let mut random = Random::new(22);
    mesh.parameters.iter_mut().flatten().for_each(|x| *x += 0.2 * random.next());
    let angles = FibreAngles::at_nodes((0..mesh.nodes).map(|_| random.triple()).collect());
    (mesh, angles)
}

/// A model of the host with the given terms alone.
fn model(mesh: Mesh, space: &'static dyn PressureSpace, terms: Vec<Box<dyn Term>>, supports: Vec<Support>) -> Model {
    let supports = Supports::new(&mesh, supports).expect("supports agree");
    let count = terms.iter().flat_map(|t| t.controls()).max().map_or(1, |most| most + 1);
    let control = |k| Control { name: format!("muscle[{k}]"), lower: 0.0, upper: 1.0, onset: 1.4 / 300.0 };
    let controls = (0..count).map(control).collect();
    Model::new(Ingredients { mesh, space, terms, supports, controls, shear_modulus: 1.4, volume: 4000.0 })
        .expect("a model")
}

/// Every term by itself, in a body without supports.
fn cases() -> Vec<(String, Model)> {
    let mut all = Vec::new();
    for space in PRESSURE_SPACES {
        for kappa in [0.0, 10.0] {
            let mesh = host();
            let terms = vec![tissue(&mesh, kappa, space)];
            all.push((format!("tissue, {}, kappa {kappa}", space.name()), model(mesh, space, terms, Vec::new())));
        }
    }
    let mut single = |name: &str, term: &dyn Fn(&Mesh) -> Box<dyn Term>| {
        let mesh = host();
        let terms = vec![term(&mesh)];
        all.push((name.to_owned(), model(mesh, &pressure::Trilinear, terms, Vec::new())));
    };
    single("muscle of Hermite elements", &|mesh| muscle(mesh, &TricubicHermite));
    single("muscle of trilinear elements", &|mesh| muscle(mesh, &Trilinear));
    single("muscle with a field of activations", &|mesh| activated(mesh, &Trilinear, Activation::Field(0)));
    single("muscle with a cut rule and tapered fibres", &|mesh| tapered(mesh));
    single("traction", &|mesh| Box::new(traction(mesh, &mesh.named_faces["xi1=1"], [0.3, -0.2, 0.5], 4)));
    // gauss = 3: 36 points; the plane and the sphere meet a part of them
    for (name, allows, surface, law, relax) in contacts() {
        single(&name, &|mesh| {
            let faces = &mesh.named_faces["xi3=0"];
            let interface = Interface { allows, surface: surface(mesh), law: law(), relax };
            Box::new(Contact::new("contact", interface, mesh, faces, 3))
        });
    }
    for (name, law, relax) in mutual_contacts() {
        // a barrier stays before the other body
        let mesh = facing(if law.range() > 0.0 { 6.0 } else { 0.0 });
        let between = Between::Two(mesh.named_faces["lower:xi3=1"].clone(), mesh.named_faces["upper:xi3=0"].clone());
        let manner = Manner { law, relax, depth: Some(4.0) };
        let term: Box<dyn Term> = Box::new(Mutual::new("lips", manner, &mesh, between, 3));
        all.push((name.to_owned(), model(mesh, &pressure::Trilinear, vec![term], Vec::new())));
    }
    let mut single = |name: &str, term: &dyn Fn(&Mesh) -> Box<dyn Term>| {
        let mesh = host();
        let terms = vec![term(&mesh)];
        all.push((name.to_owned(), model(mesh, &pressure::Trilinear, terms, Vec::new())));
    };
    single("gravity", &|mesh| Box::new(gravity(mesh, 1000.0, [0.0, 3.0, -9.81], 4)));
    single("body force", &|mesh| Box::new(body_force(mesh, [0.01, 0.0, -0.02], 4)));
    let at = MaterialPoint { element: 2, xi: [0.3, 1.0, 0.8] };
    single("nodal force", &|mesh| Box::new(nodal_force(mesh, at, [4.0, -3.0, 2.0])));
    single("springs", &|mesh| Box::new(Springs::foundation(mesh, &mesh.named_faces["xi3=0"], 0.3, Resists::All, 4)));
    single("springs along the normal", &|mesh| {
        Box::new(Springs::foundation(mesh, &mesh.named_faces["xi1=0"], 0.3, Resists::Normal, 4))
    });
    let other = MaterialPoint { element: 0, xi: [0.0, 0.0, 0.5] };
    single("attachments", &|mesh| Box::new(Springs::attachments(mesh, &[(at, 12.0), (other, 5.0)])));
    for (name, _, surface, ..) in contacts().into_iter().filter(|(name, ..)| {
        ["sliding, cylinder, augmented", "sliding, reference, augmented"].contains(&name.as_str())
    }) {
        single(&format!("{name}, on a bone"), &|mesh| {
            let law = Box::new(Augmented { stiffness: 2.0, tolerance: 1e-6 });
            let interface = Interface { allows: Allows::Closed, surface: surface(mesh), law, relax: false };
            Box::new(Contact::new("contact", interface, mesh, &mesh.named_faces["xi3=0"], 3).on(bone()))
        });
    }
    single("attachments on a bone", &|mesh| {
        Box::new(Springs::attachments(mesh, &[(at, 12.0), (other, 5.0)]).on(bone()))
    });
    single("rigid attachments", &|mesh| Box::new(RigidTies::new(mesh, &[at, other], None, 30.0, 1e-6)));
    single("rigid attachments on a bone", &|mesh| {
        Box::new(RigidTies::new(mesh, &[at, other], Some(bone()), 30.0, 1e-6))
    });
    // a pressure has an energy where its surface is closed
    single("pressure", &|mesh| Box::new(FollowerPressure::new(mesh, &whole_surface(mesh), 0.3, 6)));
    all
}

fn bone() -> Arc<Bone> {
    let hinge = Hinge { axis: normalised([1.0, 2.0, -0.5]), through: [40.0, 0.0, -30.0], control: 1 };
    let slide = Slide { direction: normalised([1.0, 0.0, 3.0]), control: 0 };
    Arc::new(Bone::new("jaw", Some(hinge), Some(slide)))
}

fn whole_surface(mesh: &Mesh) -> Vec<risorius::mesh::face::Face> {
    mesh.named_faces.values().flatten().copied().collect()
}

/// Two curved bodies that face each other, of which the upper one is wider.
fn facing(apart: f64) -> Mesh {
    let lower = curved_block(&TricubicHermite, [2, 1, 1], 0.03, 29);
    let mut upper = curved_block(&TricubicHermite, [2, 2, 1], 0.03, 29);
    for (k, x) in upper.parameters.iter_mut().enumerate() {
        if k % 8 == 0 {
            *x = [x[0] - 1.0, x[1] - 4.0, x[2] + 9.9 + apart];
        }
    }
    join(&[("lower".into(), lower), ("upper".into(), upper)])
}

type MutualCase = (&'static str, Box<dyn ContactLaw>, bool);

fn mutual_contacts() -> Vec<MutualCase> {
    let penalty = || Box::new(Penalty { stiffness: 2.0 });
    let augmented = || Box::new(Augmented { stiffness: 2.0, tolerance: 1e-6 });
    vec![
        ("contact of two bodies, penalty", penalty(), false),
        ("contact of two bodies, penalty, relaxing", penalty(), true),
        ("contact of two bodies, augmented", augmented(), false),
        ("contact of two bodies, barrier", Box::new(Barrier { stiffness: 2.0, range: 9.0 }), false),
    ]
}

type MakeSurface = fn(&Mesh) -> Box<dyn RigidSurface>;
type MakeLaw = fn() -> Box<dyn ContactLaw>;

/// Every surface with every law: (name, what it allows, surface, law, whether it relaxes).
fn contacts() -> Vec<(String, Allows, MakeSurface, MakeLaw, bool)> {
    const FREE: FreeSide = FreeSide::Outside;
    let surfaces: [(&str, MakeSurface); 6] = [
        ("plane", |_| Box::new(Plane { through: [10.0, 10.0, 0.7], normal: normalised([0.1, -0.1, 1.0]) })),
        ("sphere", |_| Box::new(Sphere { centre: [10.0, 9.0, -18.0], radius: 19.0, free: FREE })),
        ("cylinder", |_| {
            let axis = normalised([1.0, 0.2, 0.1]);
            Box::new(Cylinder { through: [0.0, 8.0, -30.0], axis, radius: 30.0, free: FREE })
        }),
        ("capsule", |_| {
            Box::new(Capsule { ends: [[7.0, 8.0, -20.0], [14.0, 9.0, -19.0]], radius: 21.0, free: FREE })
        }),
        ("reference", |mesh| Box::new(Patches::new(mesh, &mesh.named_faces["xi3=0"], FreeSide::Inside))),
        ("arch", |mesh| Box::new(Arch::new(mesh, &mesh.named_faces["xi3=0"]))),
    ];
    let laws: [(&str, MakeLaw); 2] = [
        ("penalty", || Box::new(Penalty { stiffness: 2.0 })),
        ("augmented", || Box::new(Augmented { stiffness: 2.0, tolerance: 1e-6 })),
    ];
    let mut all = Vec::new();
    for (surface, make_surface) in surfaces {
        for (law, make_law) in laws {
            for (kind, allows) in [("sliding", Allows::Closed), ("contact", Allows::ClosedOrOpen)] {
                let relax = surface == "sphere";
                let relaxing = if relax { ", relaxing" } else { "" };
                all.push((format!("{kind}, {surface}, {law}{relaxing}"), allows, make_surface, make_law, relax));
            }
        }
    }
    let below: MakeSurface = |_| Box::new(Plane { through: [0.0, 0.0, -8.0], normal: [0.0, 0.0, 1.0] });
    let barrier: MakeLaw = || Box::new(Barrier { stiffness: 2.0, range: 9.0 });
    all.push(("contact, plane, barrier".into(), Allows::ClosedOrOpen, below, barrier, false));
    all
}

/// A state in which det F stays well above zero: a stretch and a shear with random wiggles, random pressures.
fn random_state(model: &Model, seed: u64) -> State {
    let mut random = Random::new(seed);
    let gradient: Matrix = std::array::from_fn(|_| std::array::from_fn(|_| 0.15 * random.next()));
    let mut state = model.rest();
    for (u, x) in state.u.iter_mut().zip(&model.mesh().parameters) {
        let (bent, wiggle) = (apply(&gradient, *x), random.triple());
        *u = std::array::from_fn(|i| bent[i] + 0.3 * wiggle[i]);
    }
    state.p.iter_mut().for_each(|p| *p = random.next());
    state.controls.iter_mut().enumerate().for_each(|(k, a)| *a = 0.4 / (k + 1) as f64);
    state.load = 0.7;
    state.multipliers.iter_mut().flatten().for_each(|m| *m = 0.5 * random.next());
    state
}

fn evaluate(model: &Model, state: &State) -> Evaluation {
    risorius::forward::evaluate(model, state)
}

fn energy(model: &Model, state: &State) -> f64 {
    evaluate(model, state).energies.iter().sum()
}

fn moved(model: &Model, state: &State, direction: &[f64], by: f64) -> State {
    let mut state = state.clone();
    model.advance(&mut state, direction, by);
    state
}

/// K v with the assembled tangent.
fn tangent_times(model: &Model, state: &State, v: &[f64]) -> Vec<f64> {
    let mut workspace = Workspace::default();
    model.evaluate(state, Want::Stiffness, None, &mut workspace);
    let mut tangent = model.tangent();
    model.assemble(&workspace, &mut tangent);
    let mut product = vec![0.0; v.len()];
    tangent.matrix.multiply(v, &mut product);
    product
}

/// Directions with displacements and pressures, displacements alone, pressures alone.
fn directions(model: &Model, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Random::new(seed);
    let n = model.numbering().unknowns();
    let mut all: Vec<Vec<f64>> = (0..6).map(|_| random.vector(n)).collect();
    for index in 0..model.numbering().pressures() {
        let unknown = model.numbering().pressure_unknown(index);
        all[1][unknown] = 0.0;
        all[3][unknown] = 0.0;
    }
    let only_pressure = all[2].clone();
    all[2] = vec![0.0; n];
    for index in 0..model.numbering().pressures() {
        let unknown = model.numbering().pressure_unknown(index);
        all[2][unknown] = only_pressure[unknown];
    }
    all
}

/// Differences of fourth order: (8 (f(h) - f(-h)) - (f(2h) - f(-2h))) / 12h.
fn slope(f: impl Fn(f64) -> Vec<f64>, h: f64) -> Vec<f64> {
    let [a, b, c, d] = [-2.0 * h, -h, h, 2.0 * h].map(f);
    (0..a.len()).map(|k| (8.0 * (c[k] - b[k]) - (d[k] - a[k])) / (12.0 * h)).collect()
}

/// Small where points open and close, so that few of them do within it.
fn step_for(name: &str) -> f64 {
    if name.starts_with("contact of two") { 1e-4 } else { 1e-3 }
}

#[test]
fn forces_are_slopes_of_the_energy() {
    for (name, model) in cases() {
        let state = random_state(&model, 31);
        let residual = evaluate(&model, &state).residual;
        assert!(common::largest(&residual) > 0.0, "{name}: no force to test");
        for v in directions(&model, 32) {
            let power: f64 = residual.iter().zip(&v).map(|(r, v)| r * v).sum();
            let found = slope(|h| vec![energy(&model, &moved(&model, &state, &v, h))], step_for(&name))[0];
            // a sum of forces of both signs is measured against their size
            let size: f64 = residual.iter().zip(&v).map(|(r, v)| (r * v).powi(2)).sum::<f64>().sqrt();
            assert!((power - found).abs() <= 1e-8 * size, "{name}: {power} instead of {found}");
        }
    }
}

#[test]
fn stiffness_is_the_slope_of_the_forces() {
    for (name, model) in cases() {
        let state = random_state(&model, 33);
        let is_dead = model.terms().iter().all(|t| t.is_load() && t.name() != "pressure");
        for v in directions(&model, 34) {
            let ours = tangent_times(&model, &state, &v);
            let differences = slope(|h| evaluate(&model, &moved(&model, &state, &v, h)).residual, step_for(&name));
            if is_dead {
                assert!(
                    ours.iter().chain(&differences).all(|k| k.abs() < 1e-9),
                    "{name}: a dead load has no stiffness"
                );
            } else {
                assert_close(&name, &ours, &differences, 1e-8);
            }
        }
    }
}

#[test]
fn controls_and_loads_have_their_forces() {
    for (name, model) in cases() {
        let state = random_state(&model, 35);
        let residual = |state: State| evaluate(&model, &state).residual;
        let loads = |h: f64| residual(State { load: state.load + h, ..state.clone() });
        // both enter linearly, but for the poses of bones
        for control in 0..state.controls.len() {
            let along = |h: f64| {
                let mut state = state.clone();
                state.controls[control] += h;
                residual(state)
            };
            let (by_control, found) = (model.control_force(&state, control), slope(along, 0.1));
            if name.starts_with("muscle") {
                assert!(common::largest(&found) > 0.0);
                assert_close(&name, &by_control, &found, 1e-12);
            } else if name.ends_with("on a bone") {
                assert!(common::largest(&found) > 0.0);
                assert_close(&name, &by_control, &found, 1e-8);
            } else {
                assert!(by_control.iter().chain(&found).all(|f| *f == 0.0), "{name}: depends on a control");
            }
        }
        let (by_load, found_load) =
            (model.load_force(&state), slope(loads, if name.starts_with("contact of two") { 1e-4 } else { 0.1 }));
        if name.ends_with("relaxing") {
            assert!(common::largest(&by_load) > 0.0, "{name}: the load relaxes it");
            assert_close(&name, &by_load, &found_load, 1e-10);
        } else if model.terms()[0].is_load() {
            assert_close(&name, &by_load, &found_load, 1e-12);
            // the work of a load is minus its energy
            let work = model.external_work(&state);
            assert_close(&name, &[-energy(&model, &state)], &[work], 1e-13);
        } else {
            assert!(by_load.iter().chain(&found_load).all(|f| *f == 0.0), "{name}: depends on the load");
        }
    }
}

/// x -> R x + t leaves the energies of tissue, muscle, enclosed pressure and contact of two bodies alone and turns their
/// forces.
#[test]
fn rigid_motion_costs_nothing() {
    let mut random = Random::new(36);
    let free = |name: &str| {
        let both = name.starts_with("contact of two") && !name.ends_with("relaxing");
        name.starts_with("tissue") || name.starts_with("muscle") || name == "pressure" || both
    };
    for (name, model) in cases().into_iter().filter(|(name, _)| free(name)) {
        let state = random_state(&model, 37);
        let (turn, shift) = (random.rotation(), random.triple().map(|t| 10.0 * t));
        let mut turned = state.clone();
        for (parameter, x) in model.current(&state).iter().enumerate() {
            let value = model.mesh().parameter_derivative[parameter] == 0;
            let (rotated, start) = (apply(&turn, *x), model.mesh().parameters[parameter]);
            turned.u[parameter] = std::array::from_fn(|i| rotated[i] + if value { shift[i] } else { 0.0 } - start[i]);
        }
        let (before, after) = (evaluate(&model, &state), evaluate(&model, &turned));
        assert_close(&name, &after.energies, &before.energies, 1e-12);
        let rotated: Vec<Vector> = before.force.iter().map(|f| apply(&turn, *f)).collect();
        assert_close(&name, after.force.as_flattened(), rotated.as_flattened(), 1e-11);
    }
}

/// A body and its surface that move together keep the energy of their contact, and its forces turn with them.
#[test]
fn a_body_moves_with_its_surface() {
    let mut random = Random::new(38);
    let (turn, shift) = (random.rotation(), random.triple().map(|t| 10.0 * t));
    let carry = |mesh: &Mesh, at: &[Vector]| -> Vec<Vector> {
        let one = |(k, x): (usize, &Vector)| {
            let rotated = apply(&turn, *x);
            if mesh.parameter_derivative[k] == 0 { std::array::from_fn(|i| rotated[i] + shift[i]) } else { rotated }
        };
        at.iter().enumerate().map(one).collect()
    };
    let build = |mesh: Mesh| {
        let faces = mesh.named_faces["xi3=0"].clone();
        let surface = Box::new(Patches::new(&mesh, &faces, FreeSide::Inside));
        let law = Box::new(Penalty { stiffness: 2.0 });
        let interface = Interface { allows: Allows::Closed, surface, law, relax: false };
        let term: Box<dyn Term> = Box::new(Contact::new("contact", interface, &mesh, &faces, 3));
        model(mesh, &pressure::Trilinear, vec![term], Vec::new())
    };
    let here = build(host());
    let there = build(Mesh { parameters: carry(&host(), &host().parameters), ..host() });
    let state = random_state(&here, 39);
    let turned_u = state.u.iter().map(|u| apply(&turn, *u)).collect();
    let (before, after) = (evaluate(&here, &state), evaluate(&there, &State { u: turned_u, ..state.clone() }));
    assert_close("energy", &after.energies, &before.energies, 1e-11);
    let rotated: Vec<Vector> = before.force.iter().map(|f| apply(&turn, *f)).collect();
    assert_close("forces", after.force.as_flattened(), rotated.as_flattened(), 1e-10);
}

/// At rest the tissue is free of force, and a rigid motion of it has no stiffness.
#[test]
fn rest_is_an_equilibrium() {
    for (name, model) in cases().into_iter().filter(|(name, _)| name.starts_with("tissue")) {
        let found = evaluate(&model, &model.rest());
        let scale = model.force_scale();
        assert!(found.residual.iter().all(|r| r.abs() < 1e-12 * scale), "{name}");
        assert_close(&name, &[found.det_f.min, found.det_f.max], &[1.0, 1.0], 1e-13);
        // the rotation du = w x X
        let spin: Matrix = [[0.0, -0.3, 0.2], [0.3, 0.0, -0.5], [-0.2, 0.5, 0.0]];
        let mut v = vec![0.0; model.numbering().unknowns()];
        for (parameter, x) in model.mesh().parameters.iter().enumerate() {
            for (i, du) in apply(&spin, *x).into_iter().enumerate() {
                v[model.numbering().displacement_unknown(parameter, i).expect("free")] = du;
            }
        }
        let force = tangent_times(&model, &model.rest(), &v);
        assert!(common::largest(&force) < 1e-11 * scale, "{name}: {:.1e}", common::largest(&force));
    }
}

/// Under a face with a free rim a pressure has no energy, and its tangent is the symmetric part of the slope of its force.
#[test]
fn the_tangent_of_a_pressure_is_symmetrised_at_a_free_rim() {
    let mesh = host();
    let faces = mesh.named_faces["xi3=1"].clone();
    let terms: Vec<Box<dyn Term>> = vec![Box::new(FollowerPressure::new(&mesh, &faces, 0.3, 6))];
    let model = model(mesh, &pressure::Trilinear, terms, Vec::new());
    let state = random_state(&model, 38);
    let all = directions(&model, 39);
    let along = |v: &[f64]| slope(|h| evaluate(&model, &moved(&model, &state, v, h)).residual, 1e-3);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut asymmetry: f64 = 0.0;
    for (v, w) in all[..2].iter().zip(&all[4..]) {
        let (vkw, wkv) = (dot(v, &along(w)), dot(w, &along(v)));
        let ours = dot(v, &tangent_times(&model, &state, w));
        let size = vkw.abs().max(wkv.abs());
        assert!((ours - 0.5 * (vkw + wkv)).abs() < 1e-7 * size, "{ours} instead of ({vkw} + {wkv})/2");
        asymmetry = asymmetry.max((vkw - wkv).abs() / size);
    }
    // there is something to symmetrise
    assert!(asymmetry > 0.1, "{asymmetry}");
}

/// A field that is the same in every node is one activation; a field that is not varies from point to point.
#[test]
fn a_constant_field_of_activations_is_one_activation() {
    let build = |activation| {
        let mesh = host();
        let terms = vec![activated(&mesh, &TricubicHermite, activation)];
        model(mesh, &pressure::Trilinear, terms, Vec::new())
    };
    let (one, field) = (build(Activation::Uniform(0)), build(Activation::Field(0)));
    assert_eq!((one.controls().len(), field.controls().len()), (1, 12));
    let state = random_state(&one, 48);
    let same = State { controls: vec![0.4; 12], ..state.clone() };
    assert_close("forces", &evaluate(&field, &same).residual, &evaluate(&one, &state).residual, 1e-13);
    // the forces of all nodes together are the force of the one activation
    let mut sum = vec![0.0; one.numbering().unknowns()];
    for control in 0..12 {
        sum.iter_mut().zip(field.control_force(&same, control)).for_each(|(s, f)| *s += f);
    }
    assert_close("forces per activation", &sum, &one.control_force(&state, 0), 1e-13);
    let (_, muscle) = field.muscles().next().expect("a muscle");
    assert!((muscle.mean_activation(&same.controls) - 0.4).abs() < 1e-14);
    let ramp: Vec<f64> = (0..12).map(|node| 0.1 * (node % 3) as f64).collect();
    let values: Vec<f64> = muscle.points().iter().map(|p| p.activation(&ramp)).collect();
    let (min, max) = values.iter().fold((1.0_f64, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
    assert!(min > 0.0 && min < 0.02 && max < 0.2 && max > 0.18, "{min} to {max}");
}

/// A mesh whose node 1 hangs between its nodes 0 and 2: its parameters are sums over theirs, so the mesh has none
/// for it. Also gives the expanded mesh, with a parameter for everything, and the matrix T with
/// expanded = T x hanging, row by row.
fn hanging() -> (Mesh, Mesh, Vec<Vec<MapTerm>>) {
    let mut expanded = curved_block(&TricubicHermite, [2, 2, 1], 0.05, 41);
    let global = |parameter: usize| if parameter < 8 { parameter } else { parameter - 8 } as u32;
    let single = |parameter: usize| vec![MapTerm { global: global(parameter), scale: 1.0 }];
    let rows: Vec<Vec<MapTerm>> = (0..expanded.parameters.len())
        .map(|parameter| {
            let (node, mask) = (parameter / 8, parameter % 8);
            match (node, mask & 1) {
                // half way on the line from node 0 to node 2: values are means, slopes along it are half differences
                (1, 0) => [mask, 16 + mask].map(|p| MapTerm { global: global(p), scale: 0.5 }).to_vec(),
                (1, _) => {
                    let (start, end) = (global(mask - 1), global(16 + mask - 1));
                    vec![MapTerm { global: start, scale: -0.5 }, MapTerm { global: end, scale: 0.5 }]
                }
                _ => single(parameter),
            }
        })
        .collect();
    let keep = |parameter: &usize| !(8..16).contains(parameter);
    let kept: Vec<usize> = (0..expanded.parameters.len()).filter(keep).collect();
    let parameters: Vec<Vector> = kept.iter().map(|p| expanded.parameters[*p]).collect();
    expanded.parameters = expand(&rows, &parameters);
    let locals = expanded.corners.as_flattened().iter().flat_map(|node| rows[8 * node..8 * node + 8].to_vec());
    let hanging = Mesh {
        map: ElementMap::new(64, locals),
        parameters,
        parameter_node: kept.iter().map(|p| expanded.parameter_node[*p]).collect(),
        parameter_derivative: kept.iter().map(|p| expanded.parameter_derivative[*p]).collect(),
        ..expanded.clone()
    };
    (hanging, expanded, rows)
}

/// T x global
fn expand(rows: &[Vec<MapTerm>], global: &[Vector]) -> Vec<Vector> {
    let row = |terms: &Vec<MapTerm>| {
        std::array::from_fn(|i| terms.iter().map(|t| t.scale * global[t.global as usize][i]).sum())
    };
    rows.iter().map(row).collect()
}

/// energy and T^T force, T^T K T agree, for both pressure spaces and with supports.
#[test]
fn a_hanging_node_assembles_like_its_expansion() {
    for space in PRESSURE_SPACES {
        let (hanging, expanded, rows) = hanging();
        let build = |mesh: Mesh| {
            let terms = vec![tissue(&mesh, 10.0, space), muscle(&mesh, &TricubicHermite)];
            model(mesh, space, terms, Vec::new())
        };
        let (small, large) = (build(hanging), build(expanded));
        let state = random_state(&small, 42);
        let state_of_large = |state: &State| State { u: expand(&rows, &state.u), ..state.clone() };
        let (ours, theirs) = (evaluate(&small, &state), evaluate(&large, &state_of_large(&state)));
        assert_close("energies", &ours.energies, &theirs.energies, 1e-12);
        let mut gathered = vec![[0.0; 3]; small.mesh().parameters.len()];
        for (terms, force) in rows.iter().zip(&theirs.force) {
            for term in terms {
                (0..3).for_each(|i| gathered[term.global as usize][i] += term.scale * force[i]);
            }
        }
        assert_close("forces", ours.force.as_flattened(), gathered.as_flattened(), 1e-12);

        // w . K v for random v, w
        let pick = |model: &Model, u: &[Vector], p: &[f64]| {
            let mut v = vec![0.0; model.numbering().unknowns()];
            for (parameter, u) in u.iter().enumerate() {
                for (i, u) in u.iter().enumerate() {
                    v[model.numbering().displacement_unknown(parameter, i).expect("free")] = *u;
                }
            }
            p.iter().enumerate().for_each(|(k, p)| v[model.numbering().pressure_unknown(k)] = *p);
            v
        };
        let mut random = Random::new(43);
        for _ in 0..4 {
            let mut sample = || {
                let u: Vec<Vector> = state.u.iter().map(|_| random.triple()).collect();
                let p = random.vector(state.p.len());
                (pick(&small, &u, &p), pick(&large, &expand(&rows, &u), &p))
            };
            let ((v, v_large), (w, w_large)) = (sample(), sample());
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let small_product = tangent_times(&small, &state, &v);
            let large_product = tangent_times(&large, &state_of_large(&state), &v_large);
            let size = dot(&small_product, &small_product).sqrt() * dot(&w, &w).sqrt();
            let difference = dot(&w, &small_product) - dot(&w_large, &large_product);
            assert!(difference.abs() < 1e-13 * size, "{}: {difference:.1e} of {size:.1e}", space.name());
        }
    }
}

/// What a prescribed motion leaves outstanding enters the Newton step through K: K gap over the unknowns.
#[test]
fn prescribed_motion_is_lifted_through_the_tangent() {
    let mesh = host();
    let terms = vec![tissue(&mesh, 10.0, &pressure::Trilinear), muscle(&mesh, &TricubicHermite)];
    let clamp = Support::Clamp { faces: mesh.named_faces["xi1=0"].clone() };
    let held = model(mesh, &pressure::Trilinear, terms, vec![clamp]);
    let state = random_state(&held, 44);
    let mut random = Random::new(45);
    let mut gap = vec![[0.0; 3]; state.u.len()];
    for (parameter, gap) in gap.iter_mut().enumerate() {
        for (i, gap) in gap.iter_mut().enumerate() {
            if held.supports().fixes(parameter, i) {
                *gap = random.next();
            }
        }
    }
    let lifted = held.evaluate(&state, Want::Stiffness, Some(&gap), &mut Workspace::default()).lifted;
    let along = |h: f64| {
        let u = state.u.iter().zip(&gap).map(|(u, g)| std::array::from_fn(|i| u[i] + h * g[i])).collect();
        evaluate(&held, &State { u, ..state.clone() }).residual
    };
    assert_close("K gap", &lifted, &slope(along, 1e-3), 1e-8);
}

/// Evaluation, tangent and a solved equilibrium have the same bits on one, two and four threads.
#[test]
fn threads_change_no_bit() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mesh = host();
            let terms = vec![
                tissue(&mesh, 10.0, &pressure::Trilinear),
                muscle(&mesh, &TricubicHermite),
                Box::new(gravity(&mesh, 1000.0, [0.0, 0.0, -9.81], 4)),
            ];
            let clamp = Support::Clamp { faces: mesh.named_faces["xi1=0"].clone() };
            let model = model(mesh, &pressure::Trilinear, terms, vec![clamp]);
            let state = random_state(&model, 46);
            let mut workspace = Workspace::default();
            let found = model.evaluate(&state, Want::Stiffness, None, &mut workspace);
            let mut tangent = model.tangent();
            model.assemble(&workspace, &mut tangent);
            let drive = Drive { controls: vec![0.02], load: 1.0 };
            let mut solver = Solver::new(&model, Settings::default()).expect("memory");
            let solved = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|f| panic!("{}", f.error));
            let mut numbers = found.energies;
            numbers.extend(found.residual);
            numbers.extend(found.force.as_flattened());
            numbers.extend(&tangent.matrix.values);
            numbers.extend(solved.state.u.as_flattened());
            numbers.extend(solved.state.p);
            numbers.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        })
    };
    let one = run(1);
    assert!(one == run(2), "two threads");
    assert!(one == run(4), "four threads");
}

/// The rotations used here are rotations.
#[test]
fn random_rotations_are_orthogonal() {
    let mut random = Random::new(47);
    for _ in 0..20 {
        let turn = random.rotation();
        let unit = product(&turn, &common::transposed(&turn));
        assert_close("R R^T", unit.as_flattened(), risorius::math::tensor::IDENTITY.as_flattened(), 1e-15);
    }
}
