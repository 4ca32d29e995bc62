//! One side of an element as a bicubic Bezier patch: its derivatives, and the closest point on it.

use crate::math::tensor::{Vector, cross, dot, norm, subtract};
use crate::mesh::bezier::control_values;
use crate::mesh::element::Element;
use crate::mesh::face::Side;
use rstar::primitives::Rectangle;

/// A step below this is taken as Newton's method gives it: the distance no longer tells better from worse.
const LOCAL: f64 = 1e-3;

/// A bicubic Bezier patch over the unit square.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Patch {
    /// Control points, s fastest.
    pub control: [Vector; 16],
    /// +1 where y_s x y_t points out of the mesh.
    pub outward: f64,
}

/// A point of a patch with its derivatives.
pub(super) struct Jet {
    pub y: Vector,
    /// y_s, y_t
    pub first: [Vector; 2],
    /// y_ss, y_st, y_tt
    pub second: [Vector; 3],
}

/// The foot of a projection on one patch.
pub(super) struct Foot {
    pub jet: Jet,
    /// (s, t) on the patch.
    pub st: [f64; 2],
    pub distance: f64,
    /// Whether the projection is perpendicular: not held back by the border of the patch.
    pub perpendicular: bool,
}

impl Jet {
    /// The unit normal sign (y_s x y_t) / |y_s x y_t|.
    pub fn normal(&self, sign: f64) -> Vector {
        let area = cross(self.first[0], self.first[1]);
        let length = norm(area);
        area.map(|n| sign * n / length)
    }

    /// With the metric m, the curvature k along the unit normal n and the gap g: m^-1 k (m - g k)^-1 and (m - g k)^-1, both
    /// symmetric 2 x 2 matrices.
    pub fn curvature(&self, normal: Vector, gap: f64) -> [[[f64; 2]; 2]; 2] {
        let [a, b] = self.first;
        let metric = [dot(a, a), dot(a, b), dot(b, b)];
        let k = self.second.map(|y| dot(normal, y));
        let moved = square(inverse_2(std::array::from_fn(|e| metric[e] - gap * k[e])));
        let (m, k) = (square(inverse_2(metric)), square(k));
        let mut bend = [[0.0; 2]; 2];
        for (p, q, r, s) in (0..16).map(|n| (n & 1, n >> 1 & 1, n >> 2 & 1, n >> 3)) {
            bend[p][s] += m[p][q] * k[q][r] * moved[r][s];
        }
        [bend, moved]
    }
}

impl Patch {
    /// The side of an element with the local parameters `local`.
    pub fn new(element: &dyn Element, local: &[[f64; 64]; 3], side: Side) -> Patch {
        let values = local.map(|component| control_values(element, &component));
        let [p, q] = side.tangents();
        let stride = |d: usize| [1, 4, 16][d];
        let first = 3 * side.end * stride(side.direction);
        let at = |k: usize| first + k % 4 * stride(p) + k / 4 * stride(q);
        Patch {
            control: std::array::from_fn(|k| std::array::from_fn(|i| values[i][at(k)])),
            outward: if side.end == 1 { 1.0 } else { -1.0 },
        }
    }

    /// The smallest box that holds the control points; the patch lies inside.
    pub fn bounds(&self) -> Rectangle<Vector> {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in &self.control {
            low = std::array::from_fn(|i| low[i].min(point[i]));
            high = std::array::from_fn(|i| high[i].max(point[i]));
        }
        Rectangle::from_corners(low, high)
    }

    /// The same polynomial over s in [s0, s1], t in [t0, t1], these mapped to [0, 1].
    pub fn over(&self, s: [f64; 2], t: [f64; 2]) -> Patch {
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

    /// y(s, t) alone.
    fn position(&self, [s, t]: [f64; 2]) -> Vector {
        let (bs, bt) = (bernstein(s)[0], bernstein(t)[0]);
        let mut total = [0.0; 3];
        for (k, point) in self.control.iter().enumerate() {
            let weight = bs[k % 4] * bt[k / 4];
            (0..3).for_each(|i| total[i] += weight * point[i]);
        }
        total
    }

    pub fn jet(&self, [s, t]: [f64; 2]) -> Jet {
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
    pub fn closest(&self, x: Vector) -> Foot {
        let distance = |st| norm(subtract(self.position(st), x));
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
        Foot { distance: norm(subtract(now.y, x)), jet: now, st, perpendicular }
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
pub(super) fn bernstein(x: f64) -> [[f64; 4]; 3] {
    let y = 1.0 - x;
    [
        [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x],
        [-3.0 * y * y, 3.0 * y * (y - 2.0 * x), 3.0 * x * (2.0 * y - x), 3.0 * x * x],
        [6.0 * y, 6.0 * (x - 2.0 * y), 6.0 * (y - 2.0 * x), 6.0 * x],
    ]
}

/// The inverse of the symmetric matrix (xx, xy, yy).
fn inverse_2([a, b, c]: [f64; 3]) -> [f64; 3] {
    let det = a * c - b * b;
    [c / det, -b / det, a / det]
}

fn square([a, b, c]: [f64; 3]) -> [[f64; 2]; 2] {
    [[a, b], [b, c]]
}
