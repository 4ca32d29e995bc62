//! A set of faces of a mesh as a rigid surface: bicubic patches, C1 where the mesh is.
//!
//! The foot of x on a patch y(s, t) makes |y - x| stationary: y_a . (y - x) = 0. With the metric m_ab = y_a . y_b and the
//! curvature k_ab = n . y_ab of the surface along its normal n,
//! ```text
//! g = n . (x - y),  dg/dx = n,  d2g/dx2 = - A m^-1 k (m - g k)^-1 A^T,  A = [y_s y_t]
//! ```
//! Where the set has an edge, the patches go on beyond it by one element as the polynomials that they are; further
//! out there is no surface.

use super::super::patch::{Foot, Jet, Patch};
use super::{FreeSide, Gap, RigidSurface};
use crate::math::tensor::{Vector, dot, subtract};
use crate::mesh::Mesh;
use crate::mesh::element::ends;
use crate::mesh::face::Face;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{PointDistance, RTree};
use std::collections::HashMap;

/// How far a patch goes on beyond an edge of the whole set, in element lengths.
const BEYOND: f64 = 1.0;

/// Parts of a patch along each direction, each with a box of its own: a point near the surface then lies in the boxes of few
/// patches.
const PARTS: usize = 4;

/// A surface of bicubic patches.
pub struct Patches {
    patches: Vec<Patch>,
    /// Boxes of the parts with their patch.
    tree: RTree<GeomWithData<Rectangle<Vector>, usize>>,
    sign: f64,
}

impl Patches {
    /// The `faces` of `mesh` in its reference geometry; `free` is the outside or the inside of the mesh.
    pub fn new(mesh: &Mesh, faces: &[Face], free: FreeSide) -> Patches {
        let mut uses: HashMap<[usize; 2], usize> = HashMap::new();
        for face in faces {
            for edge in edges(mesh, *face) {
                *uses.entry(edge).or_default() += 1;
            }
        }
        let patches: Vec<Patch> = faces
            .iter()
            .map(|face| {
                let beyond = edges(mesh, *face).map(|edge| if uses[&edge] == 1 { BEYOND } else { 0.0 });
                Patch::new(mesh.element, &mesh.local(face.element), face.side)
                    .over([-beyond[0], 1.0 + beyond[1]], [-beyond[2], 1.0 + beyond[3]])
            })
            .collect();
        Patches::of(patches, free.sign())
    }

    /// A single patch whose outward side is free.
    pub(super) fn one(patch: Patch) -> Patches {
        Patches::of(vec![patch], 1.0)
    }

    fn of(patches: Vec<Patch>, sign: f64) -> Patches {
        let ends = |k: usize| [k, k + 1].map(|k| k as f64 / PARTS as f64);
        let boxes = patches.iter().enumerate().flat_map(|(index, patch)| {
            (0..PARTS * PARTS)
                .map(move |k| GeomWithData::new(patch.over(ends(k % PARTS), ends(k / PARTS)).bounds(), index))
        });
        Patches { tree: RTree::bulk_load(boxes.collect()), patches, sign }
    }
}

impl std::fmt::Debug for Patches {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Patches({} patches)", self.patches.len())
    }
}

impl RigidSurface for Patches {
    fn name(&self) -> &'static str {
        "reference"
    }

    fn gap(&self, x: Vector) -> Option<Gap> {
        if x.iter().any(|x| !x.is_finite()) {
            return None;
        }
        // over the patches in order of the distance of their boxes, until no box can be nearer than what was found
        let mut best: Option<(Foot, f64)> = None;
        let mut seen: Vec<usize> = Vec::new();
        for candidate in self.tree.nearest_neighbor_iter(x) {
            if best.as_ref().is_some_and(|(foot, _)| candidate.geom().distance_2(&x).sqrt() > foot.distance) {
                break;
            }
            if seen.contains(&candidate.data) {
                continue;
            }
            seen.push(candidate.data);
            let patch = &self.patches[candidate.data];
            let foot = patch.closest(x);
            if best.as_ref().is_none_or(|(b, _)| foot.distance < b.distance) {
                best = Some((foot, self.sign * patch.outward));
            }
        }
        let (foot, sign) = best.filter(|(foot, _)| foot.perpendicular)?;
        Some(gap_from(x, &foot.jet, sign))
    }
}

/// The gap along sign (y_s x y_t) from the jet at the foot.
fn gap_from(x: Vector, jet: &Jet, sign: f64) -> Gap {
    let normal = jet.normal(sign);
    let value = dot(normal, subtract(x, jet.y));
    let [bend, _] = jet.curvature(normal, value);
    let curvature = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            (0..4).map(|n| -jet.first[n & 1][i] * bend[n & 1][n >> 1] * jet.first[n >> 1][j]).sum()
        })
    });
    Gap { value, normal, curvature }
}

/// The nodes of the edges s = 0, s = 1, t = 0, t = 1 of a face, each pair ascending.
fn edges(mesh: &Mesh, face: Face) -> [[usize; 2]; 4] {
    let [p, q] = face.side.tangents();
    [(p, 0), (p, 1), (q, 0), (q, 1)].map(|(direction, end)| {
        let mut nodes = face.side.nodes().into_iter().filter(|k| ends(*k)[direction] == end);
        let mut edge = [(); 2].map(|()| nodes.next().map_or(usize::MAX, |k| mesh.corners[face.element][k]));
        edge.sort_unstable();
        edge
    })
}
