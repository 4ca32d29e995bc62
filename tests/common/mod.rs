//! What the conformance tests share: random numbers, rotations, curved meshes.
#![allow(dead_code)] // every test file is a crate of its own and uses a part

pub mod clip_run;
pub mod clips;
pub mod twin;

use risorius::forward::{Equilibrium, Solver};
use risorius::math::tensor::{Matrix, Vector, determinant, normalised, rotation};
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::Element;

/// The start of a fit: a beam with two muscles, one along it and one oblique; markers and `[fit]` are to follow.
pub const BEAM_FIT: &str = r#"
[task]
kind = "fit"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
kappa_kpa = 10.0
gauss = 4
[[muscle]]
name = "top"
block = { origin_mm = [4.5, 2.0, 14.2], size_mm = [50, 16, 4], elements = [5, 2, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[muscle]]
name = "bottom"
block = { origin_mm = [4.5, 2.0, 1.8], size_mm = [50, 16, 4], elements = [5, 2, 1] }
fibre_angles_deg = [36, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = "xi1=0" }
"#;

/// A uniform random sequence in [-1, 1), the same on every machine.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        random.next();
        random
    }

    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (high - low) * (1.0 + self.next())
    }

    pub fn vector(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }

    pub fn triple(&mut self) -> Vector {
        std::array::from_fn(|_| self.next())
    }

    /// Uniform in the unit cube.
    pub fn xi(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.between(0.0, 1.0))
    }

    pub fn rotation(&mut self) -> Matrix {
        let axis = normalised(self.triple());
        rotation(axis, 3.0 * self.next())
    }

    /// Q diag(principal stretches from 0.5 to 2) R with rotations Q, R.
    pub fn deformation(&mut self) -> Matrix {
        let stretches: Vector = std::array::from_fn(|_| 2.0_f64.powf(self.next()));
        let stretch = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { stretches[i] } else { 0.0 }));
        let f = product(&product(&self.rotation(), &stretch), &self.rotation());
        assert!(determinant(&f) > 0.0);
        f
    }
}

/// a b
pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// The largest absolute value.
pub fn largest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |most, v| if v.is_nan() { f64::NAN } else { most.max(v.abs()) })
}

/// max |a - b| <= tolerance x max |b|
#[track_caller]
pub fn assert_close(what: &str, ours: &[f64], theirs: &[f64], tolerance: f64) {
    assert_eq!(ours.len(), theirs.len(), "{what}: lengths");
    let difference: Vec<f64> = ours.iter().zip(theirs).map(|(a, b)| a - b).collect();
    let (error, scale) = (largest(&difference), largest(theirs));
    assert!(error <= tolerance * scale, "{what}: relative difference {:.2e}", error / scale);
}

/// The pull-back of forces on all displacement parameters by one solve, against what the sensitivities `rates` of all controls
/// say: `displacement_rate` of each.
pub fn assert_pulled_back(name: &str, solver: &mut Solver<'_>, found: &Equilibrium, rates: &[Vec<f64>]) {
    let model = solver.model();
    let pull: Vec<[f64; 3]> =
        (0..model.mesh().parameters.len()).map(|k| [0.3, -0.7, 1.1].map(|c| (c * (k + 1) as f64).sin())).collect();
    let controls: Vec<usize> = (0..rates.len()).collect();
    let by_one_solve =
        solver.pulled_back(&found.state, &pull, &controls).expect("solved").expect("a factor that serves");
    let along = |control: usize| -> f64 {
        let du = model.displacement_rate(&found.state, control, &rates[control]);
        du.iter().flatten().zip(pull.iter().flatten()).map(|(du, b)| du * b).sum()
    };
    assert_close(name, &by_one_solve, &controls.into_iter().map(along).collect::<Vec<f64>>(), 1e-6);
}

/// A block of elements of about 10 mm whose parameters are all moved at random by up to `amount` x 10 mm.
pub fn curved_block(element: &'static dyn Element, elements: [usize; 3], amount: f64, seed: u64) -> Mesh {
    let size = elements.map(|n| 10.0 * n as f64);
    let mut mesh = block(element, [0.0; 3], size, elements);
    let mut random = Random::new(seed);
    for x in mesh.parameters.iter_mut().flatten() {
        *x += 10.0 * amount * random.next();
    }
    mesh
}
