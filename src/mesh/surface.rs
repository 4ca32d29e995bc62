//! The outer surface of a mesh: closest-point projection onto its boundary faces.

use super::bezier::control_values;
use super::face::{Face, boundary_faces};
use super::{MaterialPoint, Mesh, position_and_jacobian};
use crate::math::tensor::{Vector, dot, norm, subtract};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{PointDistance, RTree};

/// Boundary faces with a tree of their boxes.
pub struct Surface<'m> {
    mesh: &'m Mesh,
    faces: Vec<(Face, [[f64; 64]; 3])>,
    tree: RTree<GeomWithData<Rectangle<[f64; 3]>, usize>>,
}

/// The foot of a projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// Where on the surface.
    pub point: MaterialPoint,
    /// The boundary face it lies on.
    pub face: Face,
    /// How far the projected point was, mm.
    pub distance: f64,
}

impl<'m> Surface<'m> {
    /// The whole boundary of `mesh` in its reference geometry.
    pub fn new(mesh: &'m Mesh) -> Surface<'m> {
        let faces: Vec<_> = boundary_faces(mesh).into_iter().map(|f| (f, mesh.local(f.element))).collect();
        let boxes = faces
            .iter()
            .enumerate()
            .map(|(index, (face, local))| {
                let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
                for i in 0..3 {
                    // the control points of the side bound the side
                    let control = control_values(mesh.element, &local[i]);
                    let stride = [1, 4, 16][face.side.direction];
                    for q in (0..64).filter(|q| (q / stride) % 4 == 3 * face.side.end) {
                        low[i] = low[i].min(control[q]);
                        high[i] = high[i].max(control[q]);
                    }
                }
                GeomWithData::new(Rectangle::from_corners(low, high), index)
            })
            .collect();
        Surface { mesh, faces, tree: RTree::bulk_load(boxes) }
    }

    /// The boundary faces.
    pub fn faces(&self) -> impl Iterator<Item = Face> + '_ {
        self.faces.iter().map(|(face, _)| *face)
    }

    /// The point of the surface closest to `x` (mm). Of equally close points the one on the lowest face wins. `None`
    /// only for a mesh without faces.
    pub fn project(&self, x: Vector) -> Option<Foot> {
        let mut best: Option<(usize, Foot)> = None;
        for candidate in self.tree.nearest_neighbor_iter(x) {
            let tie = 1e-9 * best.map_or(1.0, |(_, b)| b.distance.max(1.0));
            if best.is_some_and(|(_, b)| candidate.geom().distance_2(&x).sqrt() > b.distance + tie) {
                break;
            }
            let (face, local) = &self.faces[candidate.data];
            let ([s, t], distance) = self.closest_on(*face, local, x);
            let foot = Foot {
                point: MaterialPoint { element: face.element, xi: face.side.lift([s, t]) },
                face: *face,
                distance,
            };
            let better = match best {
                None => true,
                Some((index, b)) => {
                    distance < b.distance - tie || (distance <= b.distance + tie && candidate.data < index)
                }
            };
            if better {
                best = Some((candidate.data, foot));
            }
        }
        best.map(|(_, foot)| foot)
    }

    /// Minimises |x(s, t) - x|^2 over the unit square: Newton with exact first and Gauss-Newton second derivatives,
    /// kept in the square, from the best of a 5 x 5 grid.
    fn closest_on(&self, face: Face, local: &[[f64; 64]; 3], x: Vector) -> ([f64; 2], f64) {
        let [p, q] = face.side.tangents();
        let at = |st: [f64; 2]| position_and_jacobian(self.mesh.element, local, face.side.lift(st));
        let distance = |st| norm(subtract(at(st).0, x));
        let grid = (0..25).map(|k| [(k % 5) as f64 / 4.0, (k / 5) as f64 / 4.0]);
        let mut st = grid.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or([0.5; 2]);
        let mut best = distance(st);
        for _ in 0..60 {
            let (position, jacobian) = at(st);
            let gap = subtract(position, x);
            let tangent = |d: usize| [jacobian[0][d], jacobian[1][d], jacobian[2][d]];
            let (u, v) = (tangent(p), tangent(q));
            let gradient = [dot(u, gap), dot(v, gap)];
            let free: [bool; 2] = std::array::from_fn(|d| {
                !((st[d] <= 0.0 && gradient[d] > 0.0) || (st[d] >= 1.0 && gradient[d] < 0.0))
            });
            let (a, b, c) = (dot(u, u), dot(u, v), dot(v, v));
            let step = match free {
                [true, true] => {
                    let det = (a * c - b * b).max(1e-300);
                    [(-c * gradient[0] + b * gradient[1]) / det, (b * gradient[0] - a * gradient[1]) / det]
                }
                [true, false] => [-gradient[0] / a.max(1e-300), 0.0],
                [false, true] => [0.0, -gradient[1] / c.max(1e-300)],
                [false, false] => break,
            };
            let mut factor = 1.0;
            let mut moved = false;
            for _ in 0..30 {
                let trial = std::array::from_fn(|d| (st[d] + factor * step[d]).clamp(0.0, 1.0));
                let value = distance(trial);
                if value < best {
                    (st, best, moved) = (trial, value, true);
                    break;
                }
                factor *= 0.5;
            }
            if !moved {
                break;
            }
        }
        (st, best)
    }
}
