//! Muscles of the face: strips of trilinear elements that follow a line on the sheet, straight, bent to a ring, or as a fan
//! whose fibres converge.
//!
//! A station of the strip is a point c of its centre line with the tangent T, the normal n of the sheet and b = n x T. Its
//! nodes lie at c + y b + z n in first order, and exactly on the map of the sheet, so that what has a depth between 0 and 1
//! is inside the face.

use super::sheet::Sheet;
use crate::math::tensor::{Vector, add_scaled, cross, dot, norm, normalised, subtract};
use crate::mesh::Mesh;
use crate::mesh::element::{Trilinear, ends};
use crate::mesh::fibre_angles::FibreAngles;

/// How a muscle of the left side lies in the face.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Its name.
    pub name: String,
    /// Its abbreviation, as of Wu et al. 2013, table 1; may be empty.
    pub abbreviation: String,
    /// Its number in the Foundational Model of Anatomy, where it has one.
    pub fma: Option<usize>,
    /// Points (u, v, w) of its centre line, from origin to insertion: u and v on the sheet in mm, w from 0 deep to 1 at the
    /// skin. At least two.
    pub path: Vec<[f64; 3]>,
    /// Its width at each point, mm.
    pub width: Vec<f64>,
    /// Its thickness at each point, mm.
    pub thickness: Vec<f64>,
    /// Elements along, across and through it.
    pub elements: [usize; 3],
    /// Whether the last point is followed by the first.
    pub closed: bool,
    /// Where its fibres converge, (u, v); without it they run along the strip.
    pub focus: Option<[f64; 2]>,
    /// Where on the deep surface it is fixed to bone, (u, v); may be empty.
    pub origin: Vec<[f64; 2]>,
}

/// Which side of the face; the subject's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodySide {
    /// x > 0.
    Left,
    /// x < 0: the mirror image.
    Right,
}

impl BodySide {
    /// Both.
    pub const ALL: [BodySide; 2] = [BodySide::Left, BodySide::Right];

    /// `L` or `R`.
    pub fn letter(self) -> &'static str {
        match self {
            BodySide::Left => "L",
            BodySide::Right => "R",
        }
    }

    /// The place on this side of a place on the left.
    pub fn of_left(self, [x, y, z]: Vector) -> Vector {
        match self {
            BodySide::Left => [x, y, z],
            BodySide::Right => [-x, y, z],
        }
    }
}

/// Steps per part of the centre line over which its length is added up.
const STEPS: usize = 40;

/// A station: (u, v, w), its derivative along the line, width and thickness.
struct Station {
    at: [f64; 3],
    tangent: [f64; 3],
    width: f64,
    thickness: f64,
}

impl Course {
    /// The mesh of the muscle on a side and the angles of its fibres. xi1 runs along the line, xi3 outwards; nodes are
    /// numbered along, then across, then through the muscle.
    pub fn mesh(&self, sheet: &Sheet, side: BodySide) -> (Mesh, FibreAngles) {
        let [n1, n2, n3] = self.elements;
        let stations = self.stations(sheet);
        let (along, across) = (stations.len(), n2 + 1);
        let mut places = Vec::with_capacity(along * across * (n3 + 1));
        for k in 0..=n3 {
            for j in 0..=n2 {
                places.extend(stations.iter().map(|s| s.node(sheet, j as f64 / n2 as f64, k as f64 / n3 as f64)));
            }
        }
        let position = |[u, v, w]: [f64; 3]| sheet.at(u, v, w).position;
        let nodes: Vec<Vector> = places.iter().map(|p| position(*p)).collect();
        let index = |i: usize, j: usize, k: usize| (i % along) + along * (j + across * k);
        let mut angles = vec![[0.0; 3]; nodes.len()];
        if let Some([u, v]) = self.focus {
            for (node, place) in places.iter().enumerate() {
                let (i, j, k) = (node % along, node / along % across, node / along / across);
                let (back, ahead) = match (self.closed, i) {
                    (true, i) => (i + along - 1, i + 1),
                    (false, i) => (i.saturating_sub(1), (i + 1).min(along - 1)),
                };
                let (low, high) = (j.saturating_sub(1), (j + 1).min(n2));
                let xi1 = normalised(subtract(nodes[index(ahead, j, k)], nodes[index(back, j, k)]));
                let xi2 = subtract(nodes[index(i, high, k)], nodes[index(i, low, k)]);
                let across = cross(normalised(cross(xi1, xi2)), xi1);
                let to = subtract(position([u, v, place[2]]), nodes[node]);
                angles[node][0] = dot(to, across).atan2(dot(to, xi1));
            }
        }
        let mut corners = Vec::with_capacity(n1 * n2 * n3);
        for k in 0..n3 {
            for j in 0..n2 {
                for i in 0..n1 {
                    corners.push(std::array::from_fn(|corner| {
                        let e = ends(corner);
                        index(i + e[0], j + e[1], k + e[2])
                    }));
                }
            }
        }
        if side == BodySide::Right {
            // across the muscle the other way round, so that its elements are not turned inside out
            let from = |node: usize| index(node % along, n2 - node / along % across, node / along / across);
            let mirrored = (0..nodes.len()).map(|node| side.of_left(nodes[from(node)])).collect();
            let angles = (0..nodes.len()).map(|node| angles[from(node)].map(|angle| -angle)).collect();
            return (Mesh::new(&Trilinear, mirrored, corners), FibreAngles::at_nodes(angles));
        }
        (Mesh::new(&Trilinear, nodes, corners), FibreAngles::at_nodes(angles))
    }

    /// Stations at equal distances along the centre line.
    fn stations(&self, sheet: &Sheet) -> Vec<Station> {
        let parts = if self.closed { self.path.len() } else { self.path.len() - 1 };
        let samples: Vec<f64> = (0..=parts * STEPS).map(|k| k as f64 / STEPS as f64).collect();
        let mut lengths = vec![0.0];
        let mut last: Option<Vector> = None;
        for x in &samples {
            let [u, v, w] = self.line(*x).0;
            let here = sheet.at(u, v, w).position;
            if let Some(last) = last {
                lengths.push(lengths[lengths.len() - 1] + norm(subtract(here, last)));
            }
            last = Some(here);
        }
        let whole = lengths[lengths.len() - 1];
        let count = if self.closed { self.elements[0] } else { self.elements[0] + 1 };
        (0..count)
            .map(|i| {
                let wanted = whole * i as f64 / self.elements[0] as f64;
                let k = lengths.partition_point(|l| *l <= wanted).clamp(1, samples.len() - 1);
                let part = (wanted - lengths[k - 1]) / (lengths[k] - lengths[k - 1]);
                let x = samples[k - 1] + part.clamp(0.0, 1.0) / STEPS as f64;
                let (at, tangent) = self.line(x);
                Station {
                    at,
                    tangent,
                    width: self.between(&self.width, x),
                    thickness: self.between(&self.thickness, x),
                }
            })
            .collect()
    }

    /// The centre line at x, 0 at its first point, 1 at its second: a cubic between two points, with the slope of the chord
    /// between the neighbours of each. A line that begins or ends on the midline meets its mirror image without a corner.
    fn line(&self, x: f64) -> ([f64; 3], [f64; 3]) {
        let n = self.path.len();
        let k = (x as usize).min(if self.closed { n - 1 } else { n - 2 });
        let q = x - k as f64;
        let slope = |k: usize| -> [f64; 3] {
            let (back, ahead) = match (self.closed, k) {
                (true, k) => (self.path[(k + n - 1) % n], self.path[(k + 1) % n]),
                (false, 0) => (beyond(self.path[0], self.path[1]), self.path[1]),
                (false, k) if k + 1 == n => (self.path[n - 2], beyond(self.path[n - 1], self.path[n - 2])),
                (false, k) => (self.path[k - 1], self.path[k + 1]),
            };
            std::array::from_fn(|i| 0.5 * (ahead[i] - back[i]))
        };
        let (a, b, m, p) = (self.path[k % n], self.path[(k + 1) % n], slope(k % n), slope((k + 1) % n));
        let r = 1.0 - q;
        let at = std::array::from_fn(|i| {
            (1.0 + 2.0 * q) * r * r * a[i] + q * r * r * m[i] + q * q * (3.0 - 2.0 * q) * b[i] - q * q * r * p[i]
        });
        let tangent = std::array::from_fn(|i| {
            6.0 * q * r * (b[i] - a[i]) + r * (1.0 - 3.0 * q) * m[i] + q * (3.0 * q - 2.0) * p[i]
        });
        (at, tangent)
    }

    /// One of the lists of values at the points, linear between them.
    fn between(&self, values: &[f64], x: f64) -> f64 {
        let k = (x as usize).min(if self.closed { values.len() - 1 } else { values.len() - 2 });
        let q = x - k as f64;
        (1.0 - q) * values[k] + q * values[(k + 1) % values.len()]
    }
}

/// The point before `end` in a line that goes on to `next`: its mirror image where the line meets the midline, else straight.
fn beyond(end: [f64; 3], next: [f64; 3]) -> [f64; 3] {
    if end[0] == 0.0 { [-next[0], next[1], next[2]] } else { std::array::from_fn(|i| 2.0 * end[i] - next[i]) }
}

impl Station {
    /// The place (u, v, w) of a node: `across` and `through` from 0 to 1.
    fn node(&self, sheet: &Sheet, across: f64, through: f64) -> [f64; 3] {
        let [u, v, w] = self.at;
        let spot = sheet.at(u, v, w);
        let [by_u, by_v, by_w] = spot.along;
        let zero = [0.0; 3];
        let tangent =
            spot.along.iter().zip(self.tangent).fold(zero, |sum: Vector, (a, rate)| add_scaled(sum, rate, *a));
        let normal = normalised(cross(by_u, by_v));
        let b = normalised(cross(normal, tangent));
        let y = (across - 0.5) * self.width;
        // the steps (du, dv) whose sum along the sheet is y b
        let (g11, g12, g22) = (dot(by_u, by_u), dot(by_u, by_v), dot(by_v, by_v));
        let (p, q, det) = (y * dot(by_u, b), y * dot(by_v, b), g11 * g22 - g12 * g12);
        let (du, dv) = ((g22 * p - g12 * q) / det, (g11 * q - g12 * p) / det);
        [u + du, v + dv, w + (through - 0.5) * self.thickness / dot(by_w, normal)]
    }
}
