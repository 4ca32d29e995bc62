//! Which marker is the counterpart of which on the other side.

use crate::math::motion::{Allowed, Pair, centre, least_squares, rms, spread};
use crate::math::tensor::{Vector, add_scaled, dot, norm, subtract};
use nalgebra::{Matrix3, SymmetricEigen};

/// Points and their reflections may lie this part of the spread apart.
const NEAR: f64 = 0.2;

/// Every way to pair points with their counterparts across a plane near to one of symmetry: `pairing[k]` is the counterpart
/// of k, which is k itself on the plane. Empty for points that have no such plane.
pub fn pairings(points: &[Vector]) -> Vec<Vec<usize>> {
    if points.len() < 3 {
        return Vec::new();
    }
    let size = spread(points);
    let middle = centre(points.iter().copied());
    let mut moments = Matrix3::zeros();
    for p in points {
        let p = subtract(*p, middle);
        moments += Matrix3::from_fn(|i, j| p[i] * p[j]);
    }
    let axes = SymmetricEigen::new(moments).eigenvectors;
    let mut found: Vec<Vec<usize>> = Vec::new();
    for axis in axes.column_iter() {
        let normal = [axis[0], axis[1], axis[2]];
        let reflect = |p: &Vector| add_scaled(*p, -2.0 * dot(subtract(*p, middle), normal), normal);
        let mut images: Vec<Vector> = points.iter().map(reflect).collect();
        // the plane of symmetry is near to the principal one: pair, fit the reflection, pair again
        for _ in 0..5 {
            let pairing: Vec<usize> = images.iter().map(|image| nearest(points, *image)).collect();
            let pairs: Vec<Pair> = points.iter().zip(&pairing).map(|(p, k)| (*p, points[*k])).collect();
            let Some(reflection) = least_squares(&pairs, Allowed::RIGID.mirrored()) else { break };
            images = points.iter().map(|p| reflection.place(*p)).collect();
        }
        let pairing: Vec<usize> = images.iter().map(|image| nearest(points, *image)).collect();
        let mutual = pairing.iter().enumerate().all(|(k, other)| pairing[*other] == k);
        let moves = pairing.iter().enumerate().any(|(k, other)| *other != k);
        let apart: Vec<f64> = images.iter().zip(&pairing).map(|(i, k)| norm(subtract(*i, points[*k]))).collect();
        if mutual && moves && rms(&apart) < NEAR * size && !found.contains(&pairing) {
            found.push(pairing);
        }
    }
    found
}

/// Index of the nearest point.
pub fn nearest(points: &[Vector], to: Vector) -> usize {
    let distance = |k: usize| norm(subtract(points[k], to));
    (0..points.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0)
}
