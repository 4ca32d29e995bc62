//! Contact of two deformable bodies where the answer is known: uniform pressure through meshes that do not match, and a
//! body that meets its mirror image as it meets a rigid plane.

use super::contact_closed_forms::{contact, contact_points, solve_to};
use super::support::{Discretisation, assert_close, model, side};
use risorius::fit::sensitivity::{Sensitivity, sensitivities};
use risorius::forward::{Drive, Equilibrium, Settings, Solver};
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::join::join;
use risorius::mesh::{MaterialPoint, Mesh};
use risorius::model::supports::Support;
use risorius::model::{Model, State};
use risorius::term::Term;
use risorius::term::contact::law::{Allows, Augmented, ContactLaw, Penalty};
use risorius::term::contact::mutual::{Between, Manner, Mutual};
use risorius::term::contact::surface::Plane;
use risorius::term::load::traction;

/// The contact of the top of `lower` with the bottom of `upper`, with `gauss` points per direction.
pub fn mutual(mesh: &Mesh, law: Box<dyn ContactLaw>, gauss: usize) -> Box<dyn Term> {
    let between = Between::Two(side_of(mesh, "lower:xi3=1"), side_of(mesh, "upper:xi3=0"));
    Box::new(Mutual::new("contact", Manner { law, relax: false, depth: None }, mesh, between, gauss))
}

fn side_of(mesh: &Mesh, name: &str) -> Vec<risorius::mesh::face::Face> {
    mesh.named_faces[name].clone()
}

fn two(lower: Mesh, upper: Mesh) -> Mesh {
    join(&[("lower".into(), lower), ("upper".into(), upper)])
}

/// Two cubes of 20 mm, one on the other, meshes of 2 x 2 x 1 and 3 x 3 x 1, under a dead traction: t everywhere between
/// them. Neither face knows where the elements of the other end, so the forces on it are only as good as its rule.
#[test]
fn a_uniform_pressure_passes_between_meshes_that_do_not_match() {
    const TRACTION: f64 = -0.9;
    for (name, lower, gauss, bound) in [
        ("matching", [2, 2, 1], 5, 1e-6),
        ("not matching", [3, 3, 1], 5, 3e-2),
        ("not matching, 12 points", [3, 3, 1], 12, 1e-2),
    ] {
        let mesh = two(
            block(&TricubicHermite, [0.0; 3], [20.0; 3], lower),
            block(&TricubicHermite, [0.0, 0.0, 20.0], [20.0; 3], [2, 2, 1]),
        );
        let meets = mutual(&mesh, Box::new(Penalty { stiffness: 20.0 }), gauss);
        let top = traction(&mesh, &side_of(&mesh, "upper:xi3=1"), [0.0, 0.0, TRACTION], 5);
        let bottom = Support::Symmetry { faces: side_of(&mesh, "lower:xi3=0"), axis: 2 };
        let walls = [0, 1].map(|axis| Support::Symmetry { faces: side(&mesh, axis, 0), axis });
        let supports = [bottom].into_iter().chain(walls).collect();
        let model = model(mesh, Discretisation::trilinear(10.0, 5), Vec::new(), vec![meets, Box::new(top)], supports);
        let (found, iterations) = solve_to(&model, 1e-10);
        let points = contact_points(&model, &found);
        let error = points.iter().map(|p| (p.pressure / -TRACTION - 1.0).abs()).fold(0.0, f64::max);
        println!("{name}: pressure within {error:.1e}, {iterations} iterations");
        assert!(error < bound, "{name}: {error:.1e}");
        assert_eq!(found.negative_modes, Some(0));
    }
}

/// A block of 20 x 20 x 10 mm whose lower face bulges down (`sign` 1), or whose upper face bulges up, to z = 0.
fn bulging(sign: f64, elements: [usize; 3]) -> Mesh {
    const BULGE: f64 = 0.015;
    let low = if sign > 0.0 { 0.0 } else { -10.0 };
    let mut mesh = block(&TricubicHermite, [0.0, 0.0, low], [20.0, 20.0, 10.0], elements);
    let h = [20.0 / elements[0] as f64, 20.0 / elements[1] as f64];
    for node in 0..mesh.nodes {
        let x = mesh.parameters[8 * node];
        if x[2] == 0.0 {
            let (a, b) = (x[0] - 10.0, x[1] - 10.0);
            // z = c (a^2 + b^2), its slopes per unit xi
            mesh.parameters[8 * node][2] += sign * BULGE * (a * a + b * b);
            mesh.parameters[8 * node + 1][2] += sign * BULGE * 2.0 * a * h[0];
            mesh.parameters[8 * node + 2][2] += sign * BULGE * 2.0 * b * h[1];
        }
    }
    mesh
}

/// What two mirrored bodies do to each other with half of the stiffness, a plane does to one of them, but for the slope
/// that a penalty leaves between the two: the foot of a point is not quite its mirror image.
#[test]
fn a_mirror_image_is_a_plane() {
    let elements = [3, 3, 1];
    let push = |mesh: &Mesh, name: &str, sign: f64| Support::Plate {
        faces: side_of(mesh, name),
        axis: 2,
        offset: -1.5 * sign,
    };
    let hold = |mesh: &Mesh| [0, 1].map(|axis| Support::Symmetry { faces: side(mesh, axis, 0), axis }).to_vec();
    let how = Discretisation::trilinear(10.0, 5);
    let plane = Plane { through: [0.0; 3], normal: [0.0, 0.0, 1.0] };
    let law = |stiffness: f64| Box::new(Penalty { stiffness });
    let mesh = bulging(1.0, elements);
    let meets = contact(&mesh, &side(&mesh, 2, 0), Allows::ClosedOrOpen, plane, law(20.0));
    let supports = [hold(&mesh), vec![push(&mesh, "xi3=1", 1.0)]].concat();
    let one = model(mesh, how, Vec::new(), vec![meets], supports);
    let mesh = two(bulging(-1.0, elements), bulging(1.0, elements));
    let meets = mutual(&mesh, law(10.0), 5);
    let plates = vec![push(&mesh, "upper:xi3=1", 1.0), push(&mesh, "lower:xi3=0", -1.0)];
    let supports = [hold(&mesh), plates].concat();
    let both = model(mesh, how, Vec::new(), vec![meets], supports);
    let (alone, _) = solve_to(&one, 1e-11);
    let (pair, iterations) = solve_to(&both, 1e-11);
    let closed = contact_points(&one, &alone).iter().filter(|p| p.pressure > 0.0).count();
    let all = contact_points(&one, &alone).len();
    println!("mirror: {closed} of {all} points closed, {iterations} iterations");
    assert!(closed > 20 && closed < all, "{closed} of {all} points closed");
    let moved = |model: &Model, found: &Equilibrium, first: usize, flip: bool| -> Vec<f64> {
        let x = model.current(&found.state);
        let place = |k: usize| [k % 3, k / 3 % 3, k / 9].map(|i| i as f64 / 2.0);
        let at = |element: usize| (0..27).map(move |k| (element, place(k)));
        let position = |(element, xi): (usize, [f64; 3])| {
            let xi = if flip { [xi[0], xi[1], 1.0 - xi[2]] } else { xi };
            let [a, b, c] = model.mesh().interpolate(MaterialPoint { element, xi }, &x);
            [a, b, if flip { -c } else { c }]
        };
        (first..first + 9).flat_map(at).flat_map(position).collect()
    };
    let known = moved(&one, &alone, 0, false);
    assert_close("upper", moved(&both, &pair, 9, false), known.clone(), 1e-5);
    assert_close("lower", moved(&both, &pair, 0, true), known, 1e-5);
}

/// A clamped beam that a slab bends down onto a layer that is held below: implicit sensitivities against differences of
/// whole equilibria.
#[test]
fn sensitivities_through_contact_of_two_bodies() {
    let laws: [(&str, Box<dyn ContactLaw>); 2] = [
        ("penalty", Box::new(Penalty { stiffness: 20.0 })),
        ("augmented", Box::new(Augmented { stiffness: 1000.0, tolerance: 1e-9 })),
    ];
    for (name, law) in laws {
        let mesh = two(
            block(&TricubicHermite, [0.0, 0.0, -10.1], [52.0, 16.0, 10.0], [3, 1, 1]),
            block(&TricubicHermite, [0.0; 3], [48.0, 16.0, 12.0], [4, 1, 1]),
        );
        let meets = mutual(&mesh, law, 5);
        let clamps = [side(&mesh, 0, 0), side_of(&mesh, "lower:xi3=0")].map(|faces| Support::Clamp { faces });
        let slab = block(&Trilinear, [4.0, 2.0, 1.0], [40.0, 12.0, 3.0], [4, 1, 1]);
        let angles = FibreAngles::uniform(&slab, [0.0; 3]);
        let muscles = vec![("slab", slab, angles)];
        let model = model(mesh, Discretisation::trilinear(10.0, 4), muscles, vec![meets], clamps.to_vec());
        let mut solver = Solver::new(&model, Settings { tolerance: 1e-9, ..Settings::default() }).expect("memory");
        let drive = Drive { controls: vec![0.03], load: 1.0 };
        let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|f| panic!("{name}: {}", f.error));
        let closed = contact_points(&model, &found).iter().filter(|p| p.pressure > 0.0).count();
        assert!(closed > 2, "{name}: {closed} points closed");
        let ours = sensitivities(Sensitivity::Tangent, &mut solver, &found, &[0]).expect("a regular tangent");
        let differences = sensitivities(Sensitivity::FiniteDifference { step: 2e-4 }, &mut solver, &found, &[0])
            .expect("neighbours");
        let moved = |direction: &[f64]| -> Vec<f64> {
            let du = model.displacement_of(direction);
            let place = |k: usize| [k % 3, k / 3 % 3, k / 9].map(|i| i as f64 / 2.0);
            let at = |element: usize| (0..27).map(move |k| MaterialPoint { element, xi: place(k) });
            (0..7).flat_map(at).flat_map(|point| model.mesh().interpolate(point, &du)).collect()
        };
        println!("{name}: {closed} points closed, {} iterations", solver.work().iterations);
        assert_close(name, moved(&ours[0]), moved(&differences[0]), 1e-5);
    }
}

/// A strip whose end is turned over onto its beginning while what comes above is pressed down: without contact it passes through
/// itself.
#[test]
fn a_strip_is_bent_until_it_touches_itself() {
    let fold = |touches: bool| {
        let mesh = block(&TricubicHermite, [0.0; 3], [40.0, 6.0, 3.0], [10, 1, 1]);
        let manner = Manner { law: Box::new(Penalty { stiffness: 20.0 }), relax: false, depth: None };
        let meets = Mutual::new("fold", manner, &mesh, Between::Itself(side(&mesh, 2, 1)), 4);
        let far = side(&mesh, 2, 0).into_iter().filter(|face| face.element >= 6).collect::<Vec<_>>();
        let press = traction(&mesh, &far, [0.0, 0.0, -0.3], 4);
        let mut terms: Vec<Box<dyn Term>> = vec![Box::new(press)];
        if touches {
            terms.push(Box::new(meets));
        }
        let near = side(&mesh, 2, 0).into_iter().filter(|face| face.element < 4);
        let clamp = Support::Clamp { faces: side(&mesh, 0, 0).into_iter().chain(near).collect() };
        let turn = Support::Rotate {
            faces: side(&mesh, 0, 1),
            axis: [0.0, -1.0, 0.0],
            through: [20.0, 3.0, 4.0],
            angle: std::f64::consts::PI,
        };
        model(mesh, Discretisation::trilinear(10.0, 4), Vec::new(), terms, vec![clamp, turn])
    };
    let (free, held) = (fold(false), fold(true));
    let (through, _) = solve_to(&free, 1e-8);
    let (touching, iterations) = solve_to(&held, 1e-8);
    let contact = held.contacts().next().expect("the fold").0;
    let look = |state: &State| {
        let points = held.contact_points(state, contact);
        let deepest = points.iter().filter_map(|p| p.gap).fold(0.0, |most: f64, gap| most.max(-gap));
        (points.iter().filter(|p| p.pressure > 0.0).count(), deepest)
    };
    let ((closed, deepest), (_, without)) =
        (look(&touching.state), look(&State { multipliers: touching.state.multipliers.clone(), ..through.state }));
    println!(
        "{closed} points closed, {deepest:.3} mm deep, without contact {without:.3} mm, {iterations} iterations"
    );
    assert_eq!(touching.negative_modes, Some(0));
    assert!(closed > 20 && deepest < 0.04 && without > 10.0 * deepest, "{closed} closed, {deepest} mm, {without} mm");
}
