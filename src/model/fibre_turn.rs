//! Degrees that are added to the fibres of a muscle.

use crate::mesh::fibre_angles::FibreAngles;
use crate::mesh::{MaterialPoint, Mesh};

/// Fibre angles with degrees added to A: the same everywhere, then from minus to plus so many along x, y and z from one side to
/// the other of the box around the mesh.
pub(super) fn turned(mesh: &Mesh, mut angles: FibreAngles, turn_deg: [f64; 4]) -> FibreAngles {
    if turn_deg == [0.0; 4] {
        return angles;
    }
    let mut places = vec![[0.0; 3]; mesh.nodes];
    for (element, corners) in mesh.corners.iter().enumerate() {
        for (corner, node) in corners.iter().enumerate() {
            let xi = std::array::from_fn(|d| (corner >> d & 1) as f64);
            places[*node] = mesh.position(MaterialPoint { element, xi });
        }
    }
    let [all, along @ ..] = turn_deg;
    let ends = |d: usize| {
        let of = |end: fn(f64, f64) -> f64, start: f64| places.iter().map(|x| x[d]).fold(start, end);
        (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY))
    };
    let ends = [0, 1, 2].map(ends);
    let turn = |node: usize| {
        let part = |d: usize| {
            let (low, high) = ends[d];
            if high > low { (2.0 * places[node][d] - low - high) / (high - low) } else { 0.0 }
        };
        (all + (0..3).map(|d| along[d] * part(d)).sum::<f64>()).to_radians()
    };
    let nodes: Vec<f64> = (0..mesh.nodes).map(turn).collect();
    angles.add(mesh, &nodes);
    angles
}
