//! Where the search starts: a linear least-squares fit of the tensors m m^T, which have no sign and do not wrap.

use super::data::principal;
use super::embed::{Samples, angles_of};
use super::pattern::{Pattern, solve};
use super::roughness::Roughness;
use super::space::{Angles, Space};
use crate::error::Result;
use crate::mesh::element::{Element, Trilinear};
use rayon::prelude::*;

/// Angles (A, B) at the nodes of a trilinear space, A within (-pi/2, pi/2]: the principal axes of the fitted tensors, in the plane (f1, f2) if only A
/// is sought; the smoothness is as of [`super::descent::Search`].
///
/// # Errors
/// [`Error::FibreSystem`](crate::Error::FibreSystem).
pub fn start(pattern: &Pattern, samples: &Samples, space: &Space, sought: usize, smoothness: f64) -> Result<Angles> {
    /// m m^T of an axis: 11, 22, 33, 12, 23, 13.
    fn tensor([x, y, z]: [f64; 3]) -> [f64; 6] {
        [x * x, y * y, z * z, x * y, y * z, x * z]
    }
    /// The matrix of an element, and its right sides.
    type Part = ([[f64; 8]; 8], [[f64; 8]; 6]);
    let parts: Vec<Part> = (0..samples.elements())
        .into_par_iter()
        .map(|e| {
            let (mut normal, mut right) = ([[0.0; 8]; 8], [[0.0; 8]; 6]);
            for sample in samples.of(e) {
                let psi = Trilinear.values(sample.xi);
                let tensor = tensor(sample.axis);
                for i in 0..8 {
                    let weight = sample.weight * psi[i];
                    (0..8).for_each(|j| normal[i][j] += weight * psi[j]);
                    (0..6).for_each(|k| right[k][i] += weight * tensor[k]);
                }
            }
            (normal, right)
        })
        .collect();
    let mut normal = pattern.zeros();
    let mut right = vec![vec![0.0; pattern.parameters()]; 6];
    for (e, (of_element, tensors)) in parts.iter().enumerate() {
        pattern.scatter(space, e, 0, |i, j| of_element[i][j], &mut normal);
        for (i, node) in space.nodes[e].iter().enumerate() {
            (0..6).for_each(|k| right[k][*node] += tensors[k][i]);
        }
    }
    let roughness = Roughness::new(space, pattern, 1);
    let lambda = smoothness * samples.all.len() as f64 / samples.elements() as f64;
    let factor = pattern.factor(&normal, lambda, &roughness.matrices[0], &vec![false; pattern.parameters()])?;
    let fitted: Vec<Vec<f64>> = right.iter().map(|right| solve(&factor, right)).collect();
    let at_node = |n: usize| {
        let [xx, yy, zz, xy, yz, xz] = std::array::from_fn(|k| fitted[k][n]);
        if sought == 1 {
            return [0.5 * (2.0 * xy).atan2(xx - yy), 0.0];
        }
        let [a, b, _] = angles_of(principal(nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)), None);
        [a, b]
    };
    Ok((0..pattern.parameters()).map(at_node).collect())
}
