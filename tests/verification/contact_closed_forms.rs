//! Contact where the answer is known: a block pressed on a plane, a sector that slides on a cylinder.

use super::support::{Discretisation, TISSUE, assert_close, model, side};
use risorius::forward::{Drive, Equilibrium, Settings, Solver};
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::mesh::face::Face;
use risorius::model::Model;
use risorius::model::supports::Support;
use risorius::term::Term;
use risorius::term::contact::law::{Allows, Augmented, Barrier, ContactLaw, Penalty};
use risorius::term::contact::surface::{Cylinder, FreeSide, Plane, RigidSurface};
use risorius::term::contact::{Contact, ContactPoint, Interface};
use risorius::term::load::traction;

/// A contact of five points per direction.
pub fn contact(
    mesh: &Mesh,
    faces: &[Face],
    allows: Allows,
    surface: impl RigidSurface + 'static,
    law: Box<dyn ContactLaw>,
) -> Box<dyn Term> {
    let interface = Interface { allows, surface: Box::new(surface), law, relax: false };
    Box::new(Contact::new("contact", interface, mesh, faces, 5))
}

/// All points of the contacts of a model at an equilibrium.
pub fn contact_points(model: &Model, found: &Equilibrium) -> Vec<ContactPoint> {
    model.contacts().flat_map(|(term, _)| model.contact_points(&found.state, term)).collect()
}

pub fn solve_to(model: &Model, tolerance: f64) -> (Equilibrium, usize) {
    let mut solver = Solver::new(model, Settings { tolerance, ..Settings::default() }).expect("memory");
    let drive = Drive { controls: Vec::new(), load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    (found, solver.work().iterations)
}

/// A cube of 20 mm on a plane, its top under the dead traction t: t everywhere below, whatever the law, and the
/// homogeneous stretch l with t = 2 (c1 + c2 / l)(l - 1 / l^2).
#[test]
fn a_block_pressed_on_a_plane() {
    const TRACTION: f64 = -0.9;
    let laws: [(&str, f64, Box<dyn ContactLaw>); 3] = [
        ("penalty", 0.0, Box::new(Penalty { stiffness: 20.0 })),
        ("augmented", 0.0, Box::new(Augmented { stiffness: 20.0, tolerance: 1e-9 })),
        ("barrier", 0.4, Box::new(Barrier { stiffness: 20.0, range: 0.5 })),
    ];
    for (name, above, law) in laws {
        let mesh = block(&TricubicHermite, [0.0, 0.0, above], [20.0; 3], [2, 2, 2]);
        let plane = Plane { through: [0.0; 3], normal: [0.0, 0.0, 1.0] };
        let bottom = contact(&mesh, &side(&mesh, 2, 0), Allows::ClosedOrOpen, plane, law);
        let top = traction(&mesh, &side(&mesh, 2, 1), [0.0, 0.0, TRACTION], 5);
        let symmetry = [0, 1].map(|axis| Support::Symmetry { faces: side(&mesh, axis, 0), axis });
        let how = Discretisation::trilinear(10.0, 5);
        let model = model(mesh, how, Vec::new(), vec![bottom, Box::new(top)], symmetry.to_vec());
        let (found, iterations) = solve_to(&model, 1e-10);
        let points = contact_points(&model, &found);
        assert_eq!(points.len(), 100);
        assert_close(name, points.iter().map(|p| p.pressure), [-TRACTION; 100], 1e-6);
        let largest = points.iter().map(|p| p.gap.expect("a plane has no edge")).fold(0.0, f64::max);
        let smallest = points.iter().map(|p| p.gap.expect("a plane has no edge")).fold(f64::INFINITY, f64::min);
        match name {
            // g = - p / k
            "penalty" => assert_close(name, [smallest], [TRACTION / 20.0], 1e-6),
            "augmented" => assert!(smallest > -1e-9 && largest < 1e-9, "{name}: gap {smallest} to {largest}"),
            _ => assert!(smallest > 0.0 && largest < 0.5, "{name}: gap {smallest} to {largest}"),
        }
        // the height of the cube
        let x = model.current(&found.state);
        let height = |z: f64| {
            let values = model.mesh().parameters.iter().zip(&model.mesh().parameter_derivative).zip(&x);
            values.filter(|((at, d), _)| **d == 0 && at[2] == z).map(|(_, x)| x[2]).fold(f64::NAN, f64::max)
        };
        let stretch = (height(above + 20.0) - height(above)) / 20.0;
        let stress = 2.0 * (TISSUE.c1 + TISSUE.c2 / stretch) * (stretch - stretch.powi(-2));
        assert_close(name, [stress], [TRACTION], 1e-6);
        println!("{name}: {iterations} iterations, stretch {stretch:.6}, gap {smallest:.2e}");
    }
}

/// A sector on a cylinder, its outer face turned by 40 degrees about the axis: it follows rigidly, and turning it takes
/// no torque and no work.
#[test]
fn a_sector_slides_on_a_cylinder_without_work() {
    const RADIUS: f64 = 20.0;
    const ANGLE: f64 = std::f64::consts::FRAC_PI_6;
    let mut mesh = block(&TricubicHermite, [0.0; 3], [1.0; 3], [2, 1, 1]);
    // (a, y, r) -> (r sin a, y, r cos a), with its derivatives by a and r
    let (step_a, step_r) = (0.5 * ANGLE, 8.0);
    for parameter in (0..mesh.parameters.len()).step_by(8) {
        let [a, y, r] = mesh.parameters[parameter];
        let (a, r) = (a * ANGLE, RADIUS + step_r * r);
        let (s, c) = a.sin_cos();
        mesh.parameters[parameter] = [r * s, 12.0 * y, r * c];
        mesh.parameters[parameter + 1] = [r * c * step_a, 0.0, -r * s * step_a];
        mesh.parameters[parameter + 2] = [0.0, 12.0, 0.0];
        mesh.parameters[parameter + 4] = [s * step_r, 0.0, c * step_r];
        mesh.parameters[parameter + 5] = [c * step_a * step_r, 0.0, -s * step_a * step_r];
    }
    let cylinder = Cylinder { through: [0.0; 3], axis: [0.0, 1.0, 0.0], radius: RADIUS, free: FreeSide::Outside };
    let law = Box::new(Penalty { stiffness: 50.0 });
    let below = contact(&mesh, &side(&mesh, 2, 0), Allows::Closed, cylinder, law);
    let turn = Support::Rotate {
        faces: side(&mesh, 2, 1),
        axis: [0.0, 1.0, 0.0],
        through: [0.0; 3],
        angle: 40.0_f64.to_radians(),
    };
    let model = model(mesh, Discretisation::trilinear(10.0, 5), Vec::new(), vec![below], vec![turn]);
    let (found, _) = solve_to(&model, 1e-10);
    let scale = model.shear_modulus() * model.volume();
    let x = model.current(&found.state);
    let (torque, axial) = model.supports().rotation_reactions(model.mesh(), &found.evaluation.force, &x)[0];
    assert!(torque.abs() < 1e-9 * scale, "torque {torque} mN mm of {scale}");
    assert!(axial.abs() < 1e-9 * scale, "axial force {axial} mN");
    let energy: f64 = found.evaluation.energies.iter().sum();
    // not zero: the elements are not quite round
    assert!(energy < 1e-7 * scale, "energy {energy} uJ of {scale}");
    let gap = contact_points(&model, &found).iter().map(|p| p.gap.expect("no edge").abs()).fold(0.0, f64::max);
    assert!(gap < 1e-3, "gap {gap} mm");
}
