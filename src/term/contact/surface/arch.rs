//! A smooth surface behind a set of faces: teeth and jaws behind the lips, whose own deep surface is uneven.
//!
//! A single bicubic patch, a graph z(x, y) that is even in x: with s from 0 to 1 over x from -half to half and t over y,
//! ```text
//! z(s, t) = sum c_kl [B_k(s) + B_3-k(s)] B_l(t),  k = 0, 1,  l = 0 .. 3, in Bernstein polynomials B,
//! ```
//! by least squares through points of the faces, then moved back until no point lies behind it.

use super::{Gap, Patches, RigidSurface};
use crate::math::tensor::Vector;
use crate::mesh::face::Face;
use crate::mesh::{MaterialPoint, Mesh};
use crate::term::contact::patch::{Patch, bernstein};
use nalgebra::{DMatrix, DVector};

/// Points per direction on each face, at both ends too.
const SAMPLES: usize = 9;
/// How far the patch goes on beyond the faces, in parts of their extent.
const BEYOND: f64 = 0.2;
/// Between the surface and the nearest point of the faces, mm.
const CLEARANCE: f64 = 0.05;

/// Teeth and jaws: x across, z forwards.
#[derive(Debug)]
pub struct Arch(Patches);

impl Arch {
    /// Behind the `faces` of `mesh`, whose body is in front of it.
    pub fn new(mesh: &Mesh, faces: &[Face]) -> Arch {
        let points: Vec<Vector> = faces.iter().flat_map(|face| samples(mesh, *face)).collect();
        let extent = |i: usize| {
            let values = points.iter().map(|x| x[i]);
            (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
        };
        let (left, right) = extent(0);
        let half = (1.0 + BEYOND) * left.abs().max(right.abs());
        let (below, above) = extent(1);
        let (low, high) = (below - BEYOND * (above - below), above + BEYOND * (above - below));
        let functions = |x: &Vector| -> [f64; 8] {
            let (bs, bt) = (bernstein(0.5 + 0.5 * x[0] / half)[0], bernstein((x[1] - low) / (high - low))[0]);
            std::array::from_fn(|n| (bs[n / 4] + bs[3 - n / 4]) * bt[n % 4])
        };
        let rows: Vec<[f64; 8]> = points.iter().map(functions).collect();
        let matrix = DMatrix::from_fn(points.len(), 8, |row, n| rows[row][n]);
        let heights = DVector::from_iterator(points.len(), points.iter().map(|x| x[2]));
        // few faces may not determine all functions; the smallest coefficients then
        let middle = heights.mean();
        let solution = matrix.clone().svd(true, true).solve(&heights.add_scalar(-middle), 1e-10);
        let solution = solution.unwrap_or_else(|_| DVector::zeros(8));
        let highest = (&matrix * &solution - &heights).max() + middle;
        let c = |k: usize, l: usize| solution[4 * k.min(3 - k) + l] + middle - highest - CLEARANCE;
        let control = std::array::from_fn(|n| {
            let (k, l) = (n % 4, n / 4);
            [half * (2.0 * k as f64 / 3.0 - 1.0), low + (high - low) * l as f64 / 3.0, c(k, l)]
        });
        Arch(Patches::one(Patch { control, outward: 1.0 }))
    }
}

impl RigidSurface for Arch {
    fn name(&self) -> &'static str {
        "arch"
    }

    fn gap(&self, x: Vector) -> Option<Gap> {
        self.0.gap(x)
    }
}

/// Positions on a face.
fn samples(mesh: &Mesh, face: Face) -> impl Iterator<Item = Vector> + '_ {
    let part = |k: usize| k as f64 / (SAMPLES - 1) as f64;
    (0..SAMPLES * SAMPLES).map(move |n| {
        let xi = face.side.lift([part(n % SAMPLES), part(n / SAMPLES)]);
        mesh.position(MaterialPoint { element: face.element, xi })
    })
}
