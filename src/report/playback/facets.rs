//! Faces of hexahedra as flat quadrilaterals, for everything that cannot draw curved ones.

use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::element::ends;
use crate::mesh::face::Face;
use crate::mesh::{MaterialPoint, Mesh};
use std::collections::HashMap;

/// Quadrilaterals between material points, anticlockwise from outside. Neighbouring faces share points, the two sides of a
/// slit do not. The order depends on the mesh alone.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Facets {
    /// The corners.
    pub points: Vec<MaterialPoint>,
    /// Four of them each.
    pub quads: Vec<[u32; 4]>,
}

/// Where a point lies on the mesh of nodes: faces that meet there name it alike.
#[derive(PartialEq, Eq, Hash)]
enum Key {
    Node(usize),
    /// Step of an edge, counted from its lower node.
    Edge([usize; 2], usize),
}

/// Points closer than this, in lengths of the face, are one where they have one key: an edge can have versions.
const SAME: f64 = 1e-6;

impl Facets {
    /// Cuts every face into `cuts` x `cuts`.
    pub fn new(mesh: &Mesh, faces: &[Face], cuts: usize) -> Facets {
        let mut facets = Facets::default();
        let mut known: HashMap<Key, Vec<(u32, Vector)>> = HashMap::new();
        for face in faces {
            let corner = |s: usize, t: usize| {
                let xi = face.side.lift([s as f64, t as f64]);
                let local = (0..8).find(|k| ends(*k).map(|end| end as f64) == xi).unwrap_or(0);
                mesh.corners[face.element][local]
            };
            let mut place = |i: usize, j: usize| -> u32 {
                let xi = face.side.lift([i, j].map(|step| step as f64 / cuts as f64));
                let at = MaterialPoint { element: face.element, xi };
                let new = facets.points.len() as u32;
                let key = match ([0, cuts].contains(&i), [0, cuts].contains(&j)) {
                    (true, true) => Some(Key::Node(corner(i / cuts, j / cuts))),
                    (false, true) => Some(edge(corner(0, j / cuts), corner(1, j / cuts), i, cuts)),
                    (true, false) => Some(edge(corner(i / cuts, 0), corner(i / cuts, 1), j, cuts)),
                    (false, false) => None,
                };
                if let Some(key) = key {
                    let position = mesh.position(at);
                    let size = norm(subtract(
                        mesh.position(MaterialPoint { element: face.element, xi: face.side.lift([0.0; 2]) }),
                        mesh.position(MaterialPoint { element: face.element, xi: face.side.lift([1.0; 2]) }),
                    ));
                    let there = known.entry(key).or_default();
                    let same = |(_, other): &&(u32, Vector)| norm(subtract(*other, position)) <= SAME * size;
                    if let Some((point, _)) = there.iter().find(same) {
                        return *point;
                    }
                    there.push((new, position));
                }
                facets.points.push(at);
                new
            };
            let grid: Vec<u32> =
                (0..(cuts + 1) * (cuts + 1)).map(|k| place(k % (cuts + 1), k / (cuts + 1))).collect();
            for j in 0..cuts {
                for i in 0..cuts {
                    let at = |di: usize, dj: usize| grid[i + di + (cuts + 1) * (j + dj)];
                    let mut quad = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
                    // s, t and the direction of the side are right-handed
                    if face.side.end == 0 {
                        quad.reverse();
                    }
                    facets.quads.push(quad);
                }
            }
        }
        facets
    }
}

/// The point after `step` of `cuts` steps from node a to node b; an edge that has collapsed is its node.
fn edge(a: usize, b: usize, step: usize, cuts: usize) -> Key {
    match a.cmp(&b) {
        std::cmp::Ordering::Less => Key::Edge([a, b], step),
        std::cmp::Ordering::Equal => Key::Node(a),
        std::cmp::Ordering::Greater => Key::Edge([b, a], cuts - step),
    }
}
