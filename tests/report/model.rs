//! A small body with everything that reports show: two muscles, a load, a clamp, a face that turns.

use risorius::material::MooneyRivlin;
use risorius::material::fibre::Blemker;
use risorius::mesh::MaterialPoint;
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::location::Locator;
use risorius::model::supports::{Support, Supports};
use risorius::model::{Control, Ingredients, Model, State};
use risorius::term::Term;
use risorius::term::load::traction;
use risorius::term::muscle::Muscle;
use risorius::term::pressure::PressureSpace;
use risorius::term::tissue::Tissue;

/// Names that are trouble in a table.
pub const MUSCLES: [&str; 2] = ["levator, upper", "the \"other\" one"];

/// 30 x 10 x 10 mm of 3 x 2 x 1 elements, clamped at xi1 = 0, turned by 10 degrees at xi1 = 1, pulled on xi3 = 1.
pub fn model(space: &'static dyn PressureSpace) -> Model {
    let mesh = block(&TricubicHermite, [1.0, 2.0, 3.0], [30.0, 10.0, 10.0], [3, 2, 1]);
    let side = |name: &str| mesh.named_faces[name].clone();
    let tissue = Tissue::new(&mesh, MooneyRivlin { c1: 0.5, c2: 0.2 }, 10.0, space, 4).expect("a sound mesh");
    let volume = tissue.volume();
    let mut terms: Vec<Box<dyn Term>> = vec![Box::new(tissue)];
    let locator = Locator::new(&mesh);
    let law = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };
    for (index, name) in MUSCLES.into_iter().enumerate() {
        let slab = block(&Trilinear, [4.0, 3.5, 4.0 + 4.0 * index as f64], [20.0, 7.0, 3.0], [2, 1, 1]);
        let angles = FibreAngles::uniform(&slab, [0.3 * index as f64, 0.1, 0.0]);
        terms.push(Box::new(Muscle::new(name, &locator, &slab, &angles, 3, law, index).expect("inside the host")));
    }
    drop(locator);
    terms.push(Box::new(traction(&mesh, &side("xi3=1"), [0.0, 0.0, 0.02], 3)));
    let turn = Support::Rotate {
        faces: side("xi1=1"),
        axis: [1.0, 0.0, 0.0],
        through: [1.0, 7.0, 8.0],
        angle: 10.0_f64.to_radians(),
    };
    let supports = Supports::new(&mesh, vec![Support::Clamp { faces: side("xi1=0") }, turn]).expect("no conflict");
    let control = |name: &str| Control { name: name.to_owned(), lower: 0.0, upper: 1.0, onset: 1.4 / 300.0 };
    let controls = MUSCLES.map(control).into();
    Model::new(Ingredients { mesh, space, terms, supports, controls, shear_modulus: 1.4, volume }).expect("a model")
}

/// A state in which every parameter is its own number and det F stays positive.
pub fn crumpled(model: &Model) -> State {
    let mut random = Random(7);
    let mut state = model.rest();
    state.u.iter_mut().flatten().for_each(|u| *u = random.between(-0.6, 0.6));
    state.p.iter_mut().for_each(|p| *p = random.between(-3.0, 3.0));
    state.controls = vec![0.25, 1.0 / 3.0];
    state.load = 0.7;
    state
}

/// Numbers that look random (Knuth's 64-bit linear congruential generator).
pub struct Random(pub u64);

impl Random {
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn point(&mut self, element: usize) -> MaterialPoint {
        MaterialPoint { element, xi: std::array::from_fn(|_| self.between(0.0, 1.0)) }
    }
}
