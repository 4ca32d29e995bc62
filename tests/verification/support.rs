//! What the verification cases share: reading reference numbers, building models by hand, comparing.

use risorius::forward::{Drive, Equilibrium, Settings, Solver};
use risorius::material::fibre::Blemker;
use risorius::material::{Law, MooneyRivlin};
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::face::Side;
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::location::Locator;
use risorius::mesh::{MaterialPoint, Mesh};
use risorius::model::supports::{Support, Supports};
use risorius::model::{Control, Ingredients, Model, State};
use risorius::term::Term;
use risorius::term::muscle::Muscle;
use risorius::term::pressure::{self, PressureSpace};
use risorius::term::tissue::Tissue;
use serde::de::DeserializeOwned;

/// Table 2 of Wu et al. 2013.
pub const TISSUE: MooneyRivlin = MooneyRivlin { c1: 0.5, c2: 0.2 };
pub const FIBRE: Blemker = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };

/// Reads `tests/reference/<name>.json`.
pub fn reference<T: DeserializeOwned>(name: &str) -> T {
    let path = format!("{}/tests/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// How a model's tissue is discretised.
#[derive(Clone, Copy)]
pub struct Discretisation {
    pub kappa: f64,
    pub gauss: usize,
    pub space: &'static dyn PressureSpace,
}

impl Discretisation {
    pub fn trilinear(kappa: f64, gauss: usize) -> Discretisation {
        Discretisation { kappa, gauss, space: &pressure::Trilinear }
    }
}

/// A body of one law without muscles.
pub fn body<L: Law + 'static>(
    mesh: Mesh,
    law: L,
    how: Discretisation,
    loads: Vec<Box<dyn Term>>,
    supports: Vec<Support>,
) -> Model {
    let shear_modulus = law.shear_modulus();
    let tissue = Tissue::new(&mesh, law, how.kappa, how.space, how.gauss).expect("reference geometry is sound");
    let volume = tissue.volume();
    let mut terms: Vec<Box<dyn Term>> = vec![Box::new(tissue)];
    terms.extend(loads);
    let supports = Supports::new(&mesh, supports).expect("supports agree");
    Model::new(Ingredients { mesh, space: how.space, terms, supports, controls: Vec::new(), shear_modulus, volume })
        .expect("a model")
}

/// Where the material point that lies at the corner `xi` of `element` has come to.
pub fn moved(model: &Model, found: &Equilibrium, element: usize, xi: [f64; 3]) -> [f64; 3] {
    model.mesh().interpolate(MaterialPoint { element, xi }, &model.current(&found.state))
}

/// A model of Table 2's tissue with muscles (activation k is control k), loads and supports.
pub fn model(
    mesh: Mesh,
    how: Discretisation,
    muscles: Vec<(&str, Mesh, FibreAngles)>,
    loads: Vec<Box<dyn Term>>,
    supports: Vec<Support>,
) -> Model {
    let tissue = Tissue::new(&mesh, TISSUE, how.kappa, how.space, how.gauss).expect("reference geometry is sound");
    let volume = tissue.volume();
    let mut terms: Vec<Box<dyn Term>> = vec![Box::new(tissue)];
    let mut controls = Vec::new();
    let locator = Locator::new(&mesh);
    for (index, (name, muscle, angles)) in muscles.into_iter().enumerate() {
        let muscle = Muscle::new(name, &locator, &muscle, &angles, 3, FIBRE, index).expect("embedded");
        terms.push(Box::new(muscle));
        controls.push(Control { name: name.to_owned(), lower: 0.0, upper: 1.0, onset: 1.4 / 300.0 });
    }
    terms.extend(loads);
    let supports = Supports::new(&mesh, supports).expect("supports agree");
    drop(locator);
    Model::new(Ingredients { mesh, space: how.space, terms, supports, controls, shear_modulus: 1.4, volume })
        .expect("a model")
}

/// The 60 x 20 x 20 beam of 6 x 2 x 2 elements, clamped at xi1 = 0, with slabs (name, lower corner, angle in degrees)
/// of 50 x 16 x 4 mm and 5 x 2 x 1 trilinear elements.
pub fn slab_beam(how: Discretisation, slabs: &[(&str, [f64; 3], f64)]) -> Model {
    slab_beam_of(how, slabs, [6, 2, 2])
}

pub fn slab_beam_of(how: Discretisation, slabs: &[(&str, [f64; 3], f64)], elements: [usize; 3]) -> Model {
    let mesh = block(&TricubicHermite, [0.0; 3], [60.0, 20.0, 20.0], elements);
    let clamp = Support::Clamp { faces: mesh.named_faces["xi1=0"].clone() };
    let muscles = slabs
        .iter()
        .map(|(name, origin, degrees)| {
            let slab = block(&Trilinear, *origin, [50.0, 16.0, 4.0], [5, 2, 1]);
            let angles = FibreAngles::uniform(&slab, [degrees.to_radians(), 0.0, 0.0]);
            (*name, slab, angles)
        })
        .collect();
    model(mesh, how, muscles, Vec::new(), vec![clamp])
}

/// The equilibrium from rest.
pub fn solve(model: &Model, controls: &[f64], load: f64) -> Equilibrium {
    // a closed form may be a saddle: a short bar under a dead force would rather turn over
    let settings = Settings { tolerance: 1e-10, release: false, ..Settings::default() };
    let mut solver = Solver::new(model, settings).expect("memory");
    solver
        .equilibrium(&model.rest(), &Drive { controls: controls.to_vec(), load })
        .unwrap_or_else(|failure| panic!("{}", failure.error))
}

/// max |a - b| <= tolerance x max |b|
pub fn assert_close(
    what: &str,
    ours: impl IntoIterator<Item = f64>,
    theirs: impl IntoIterator<Item = f64>,
    tolerance: f64,
) {
    let (ours, theirs): (Vec<f64>, Vec<f64>) = (ours.into_iter().collect(), theirs.into_iter().collect());
    assert_eq!(ours.len(), theirs.len(), "{what}: lengths");
    let scale = theirs.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let (at, error) = ours
        .iter()
        .zip(&theirs)
        .map(|(a, b)| (a - b).abs())
        .enumerate()
        .fold((0, 0.0_f64), |worst, (k, e)| if e > worst.1 || e.is_nan() { (k, e) } else { worst });
    assert!(
        error <= tolerance * scale,
        "{what}: relative difference {:.2e} at {at}: {} instead of {}",
        error / scale,
        ours[at],
        theirs[at]
    );
}

/// [node][derivative][component] flattened to one triple per parameter.
pub fn parameters(nodes: &[[[f64; 3]; 8]]) -> Vec<[f64; 3]> {
    nodes.iter().flatten().copied().collect()
}

/// One solved state of a reference file.
#[derive(serde::Deserialize)]
pub struct SolvedState {
    pub activations: Vec<f64>,
    pub u: Vec<[[f64; 3]; 8]>,
    pub p: Vec<f64>,
    pub energy_host: f64,
    pub energy_muscles: Vec<f64>,
    pub external_work: f64,
    pub det_f: [f64; 2],
}

impl SolvedState {
    /// Compares everything that the file holds with an equilibrium.
    pub fn assert_matches(&self, model: &Model, found: &Equilibrium, tolerance: f64) {
        let State { u, p, .. } = &found.state;
        // values and derivatives differ in size: compare derivative by derivative
        for derivative in 0..8 {
            let pick = |k: usize| k % 8 == derivative;
            let ours = u.iter().enumerate().filter(|(k, _)| pick(*k)).flat_map(|(_, u)| *u);
            let theirs = self.u.iter().flat_map(|node| node[derivative]);
            let scale = if derivative == 0 { 1.0 } else { 10.0 };
            assert_close(&format!("u, derivative {derivative}"), ours, theirs, scale * tolerance);
        }
        assert_close("p", p.iter().copied(), self.p.iter().copied(), tolerance);
        let energies = &found.evaluation.energies;
        assert_close("tissue energy", [energies[0]], [self.energy_host], tolerance);
        for (k, energy) in self.energy_muscles.iter().enumerate() {
            assert_close("muscle energy", [energies[1 + k]], [*energy], tolerance);
        }
        let work = model.external_work(&found.state);
        assert!((work - self.external_work).abs() <= tolerance * self.external_work.abs(), "external work {work}");
        let range = found.evaluation.det_f;
        assert_close("det F", [range.min, range.max], self.det_f, tolerance);
    }
}

/// All faces of a block side.
pub fn side(mesh: &Mesh, direction: usize, end: usize) -> Vec<risorius::mesh::face::Face> {
    mesh.named_faces[&Side { direction, end }.to_string()].clone()
}
