//! What the conformance tests share: random numbers, rotations, curved meshes.
#![allow(dead_code)] // every test file is a crate of its own and uses a part

pub mod twin;

use risorius::math::tensor::{Matrix, Vector, determinant, normalised, rotation};
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::Element;

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
