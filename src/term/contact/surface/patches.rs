//! A set of faces of a mesh as a rigid surface: bicubic patches, C1 where the mesh is.
//!
//! The foot of x on a patch y(s, t) makes |y - x| stationary: y_a . (y - x) = 0. With the metric m_ab = y_a . y_b and the
//! curvature k_ab = n . y_ab of the surface along its normal n,
//!   g = n . (x - y),  dg/dx = n,  d2g/dx2 = - A m^-1 k (m - g k)^-1 A^T,  A = [y_s y_t]
//! Where the set has an edge, the patches go on beyond it by one element as the polynomials that they are; further
//! out there is no surface.

use super::{FreeSide, Gap, RigidSurface};
use crate::math::tensor::{Vector, cross, dot, norm, subtract};
use crate::mesh::Mesh;
use crate::mesh::bezier::control_values;
use crate::mesh::element::ends;
use crate::mesh::face::Face;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{PointDistance, RTree};
use std::collections::HashMap;

/// How far a patch goes on beyond an edge of the whole set, in element lengths.
const BEYOND: f64 = 1.0;
/// A step below this is taken as Newton's method gives it: the distance no longer tells better from worse.
const LOCAL: f64 = 1e-3;

/// A surface of bicubic patches.
pub struct Patches {
    patches: Vec<Patch>,
    tree: RTree<GeomWithData<Rectangle<Vector>, usize>>,
    sign: f64,
}

/// A bicubic Bezier patch over the unit square.
#[derive(Debug, Clone, PartialEq)]
struct Patch {
    /// Control points, s fastest.
    control: [Vector; 16],
    /// +1 where y_s x y_t points out of the mesh.
    outward: f64,
}

/// A point of a patch with its derivatives.
struct Jet {
    y: Vector,
    /// y_s, y_t
    first: [Vector; 2],
    /// y_ss, y_st, y_tt
    second: [Vector; 3],
}

/// The foot of a projection on one patch.
struct Foot {
    jet: Jet,
    distance: f64,
    /// Whether the projection is perpendicular: not held back by the border of the patch.
    perpendicular: bool,
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
                Patch::new(mesh, *face).over([-beyond[0], 1.0 + beyond[1]], [-beyond[2], 1.0 + beyond[3]])
            })
            .collect();
        let boxes = patches.iter().enumerate().map(|(index, patch)| {
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for point in &patch.control {
                low = std::array::from_fn(|i| low[i].min(point[i]));
                high = std::array::from_fn(|i| high[i].max(point[i]));
            }
            GeomWithData::new(Rectangle::from_corners(low, high), index)
        });
        Patches { tree: RTree::bulk_load(boxes.collect()), patches, sign: free.sign() }
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
        for candidate in self.tree.nearest_neighbor_iter(x) {
            if best.as_ref().is_some_and(|(foot, _)| candidate.geom().distance_2(&x).sqrt() > foot.distance) {
                break;
            }
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
    let [a, b] = jet.first;
    let area = cross(a, b);
    let length = norm(area);
    let normal = area.map(|n| sign * n / length);
    let value = dot(normal, subtract(x, jet.y));
    let metric = [dot(a, a), dot(a, b), dot(b, b)];
    let k = jet.second.map(|y| dot(normal, y));
    // - m^-1 k (m - g k)^-1, a symmetric 2 x 2 matrix
    let m_inverse = inverse_2(metric);
    let moved = inverse_2(std::array::from_fn(|e| metric[e] - value * k[e]));
    let (m, k, moved) = (square(m_inverse), square(k), square(moved));
    let mut middle = [[0.0; 2]; 2];
    for (p, q, r, s) in (0..16).map(|n| (n & 1, n >> 1 & 1, n >> 2 & 1, n >> 3)) {
        middle[p][s] -= m[p][q] * k[q][r] * moved[r][s];
    }
    let curvature = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            (0..4).map(|n| jet.first[n & 1][i] * middle[n & 1][n >> 1] * jet.first[n >> 1][j]).sum()
        })
    });
    Gap { value, normal, curvature }
}

/// The inverse of the symmetric matrix (xx, xy, yy).
fn inverse_2([a, b, c]: [f64; 3]) -> [f64; 3] {
    let det = a * c - b * b;
    [c / det, -b / det, a / det]
}

fn square([a, b, c]: [f64; 3]) -> [[f64; 2]; 2] {
    [[a, b], [b, c]]
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

impl Patch {
    fn new(mesh: &Mesh, face: Face) -> Patch {
        let local = mesh.local(face.element);
        let values = local.map(|component| control_values(mesh.element, &component));
        let [p, q] = face.side.tangents();
        let stride = |d: usize| [1, 4, 16][d];
        let first = 3 * face.side.end * stride(face.side.direction);
        let at = |k: usize| first + k % 4 * stride(p) + k / 4 * stride(q);
        Patch {
            control: std::array::from_fn(|k| std::array::from_fn(|i| values[i][at(k)])),
            outward: if face.side.end == 1 { 1.0 } else { -1.0 },
        }
    }

    /// The same polynomial over s in [s0, s1], t in [t0, t1], these mapped to [0, 1].
    fn over(&self, s: [f64; 2], t: [f64; 2]) -> Patch {
        let mut control = self.control;
        for (stride, [low, high]) in [(1, s), (4, t)] {
            let mut next = control;
            for start in (0..16).filter(|k| k / stride % 4 == 0) {
                let line: [Vector; 4] = std::array::from_fn(|k| control[start + k * stride]);
                // the control points are the values of the blossom at (low or high)^3
                for k in 0..4 {
                    let arguments = std::array::from_fn(|n| if n < 3 - k { low } else { high });
                    next[start + k * stride] = blossom(line, arguments);
                }
            }
            control = next;
        }
        Patch { control, ..*self }
    }

    fn jet(&self, [s, t]: [f64; 2]) -> Jet {
        let (bs, bt) = (bernstein(s), bernstein(t));
        let sum = |ds: usize, dt: usize| {
            let mut total = [0.0; 3];
            for (k, point) in self.control.iter().enumerate() {
                let weight = bs[ds][k % 4] * bt[dt][k / 4];
                (0..3).for_each(|i| total[i] += weight * point[i]);
            }
            total
        };
        Jet { y: sum(0, 0), first: [sum(1, 0), sum(0, 1)], second: [sum(2, 0), sum(1, 1), sum(0, 2)] }
    }

    /// Minimises |y(s, t) - x|^2 over the unit square: Newton's method with exact second derivatives, kept in the square,
    /// from the best of a 4 x 4 grid.
    fn closest(&self, x: Vector) -> Foot {
        let distance = |st| norm(subtract(self.jet(st).y, x));
        let grid = (0..16).map(|k| [(k % 4) as f64 / 3.0, (k / 4) as f64 / 3.0]);
        let mut st = grid.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or([0.5; 2]);
        let mut now = self.jet(st);
        let mut perpendicular = false;
        for _ in 0..40 {
            let away = subtract(now.y, x);
            let gradient = now.first.map(|y| dot(y, away));
            let free: [bool; 2] = std::array::from_fn(|d| {
                !((st[d] <= 0.0 && gradient[d] > 0.0) || (st[d] >= 1.0 && gradient[d] < 0.0))
            });
            let size = norm(away) + norm(now.first[0]) + norm(now.first[1]);
            perpendicular = (0..2).all(|d| free[d] || gradient[d].abs() <= 1e-10 * size * norm(now.first[d]));
            let step = step(&now, away, gradient, free);
            let length = step[0].hypot(step[1]);
            let mut factor = 1.0;
            let mut next = None;
            while factor > 1e-6 {
                let trial: [f64; 2] = std::array::from_fn(|d| (st[d] + factor * step[d]).clamp(0.0, 1.0));
                let jet = self.jet(trial);
                if length < LOCAL || norm(subtract(jet.y, x)) < norm(away) {
                    next = Some((trial, jet));
                    break;
                }
                factor *= 0.5;
            }
            let Some((trial, jet)) = next else { break };
            let moved = (trial[0] - st[0]).hypot(trial[1] - st[1]);
            (st, now) = (trial, jet);
            if moved < 1e-15 {
                break;
            }
        }
        Foot { distance: norm(subtract(now.y, x)), jet: now, perpendicular }
    }
}

/// The Newton step on the free coordinates; where the second derivatives are not positive, without the curvature.
fn step(jet: &Jet, away: Vector, gradient: [f64; 2], free: [bool; 2]) -> [f64; 2] {
    let [a, b] = jet.first;
    let metric = [dot(a, a), dot(a, b), dot(b, b)];
    let full: [f64; 3] = std::array::from_fn(|e| metric[e] + dot(away, jet.second[e]));
    let positive = full[0] > 0.0 && full[2] > 0.0 && full[0] * full[2] > full[1] * full[1];
    let [p, q, r] = if positive { full } else { metric };
    match free {
        [true, true] => {
            let [a, b, c] = inverse_2([p, q, r]);
            [-(a * gradient[0] + b * gradient[1]), -(b * gradient[0] + c * gradient[1])]
        }
        [true, false] => [-gradient[0] / p, 0.0],
        [false, true] => [0.0, -gradient[1] / r],
        [false, false] => [0.0; 2],
    }
}

/// The blossom of a cubic with control points b: de Casteljau's algorithm with an argument of its own in each round.
fn blossom(b: [Vector; 4], arguments: [f64; 3]) -> Vector {
    let mut points = b;
    for (round, x) in arguments.into_iter().enumerate() {
        for k in 0..3 - round {
            points[k] = std::array::from_fn(|i| (1.0 - x) * points[k][i] + x * points[k + 1][i]);
        }
    }
    points[0]
}

/// The cubic Bernstein polynomials at x, their first and their second derivatives.
fn bernstein(x: f64) -> [[f64; 4]; 3] {
    let y = 1.0 - x;
    [
        [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x],
        [-3.0 * y * y, 3.0 * y * (y - 2.0 * x), 3.0 * x * (2.0 * y - x), 3.0 * x * x],
        [6.0 * y, 6.0 * (x - 2.0 * y), 6.0 * (y - 2.0 * x), 6.0 * x],
    ]
}
