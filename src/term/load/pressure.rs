//! Follower pressure: a force per current area that stays normal to the surface, f = - p n da.
//!
//! With the surface x(s, t) and da = x,s x x,t (outward):
//!   r_ia     = load p sum w N_a da_i
//!   K_ia,kb  = load p sum w N_a e_ikm (N_b,s x,t_m - N_b,t x,s_m)
//!
//! Where the surface is closed, or its rim is held, this is the gradient of load p V with V = 1/3 sum w x . da, the
//! volume behind the surface, and K is symmetric after assembly (Bufler 1984). Where the rim is free there is no energy:
//! K has an antisymmetric part, which lives on the rim. Our tangents are symmetric, so that (K + K^T)/2 is added. The
//! equilibrium is not touched by that; Newton's method comes to it a little more slowly, and sensitivities from the
//! tangent are approximate. The energy told is load p (V - V at rest), and means something only without a free rim.

use crate::material::PAIRS;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Vector, cross, dot};
use crate::mesh::Mesh;
use crate::mesh::face::Face;
use crate::term::{Contribution, ElementState, ElementSystem, Term, Want};

/// A pressure on faces of the host that follows them.
pub struct FollowerPressure {
    /// kPa at full load; positive pushes into the body.
    pressure: f64,
    /// Quadrature points of each element's faces.
    points: Vec<Vec<Point>>,
    /// 1/3 sum w X . dA of each element.
    volume_at_rest: Vec<f64>,
}

/// A quadrature point of a face.
struct Point {
    /// Gauss weight; negative where x,s x x,t points inwards.
    weight: f64,
    /// N_a.
    values: [f64; 64],
    /// N_a,s and N_a,t.
    slopes: [[f64; 64]; 2],
}

impl Point {
    /// x and x,s and x,t from the local parameters of x.
    fn surface(&self, x: &[[f64; 64]; 3]) -> (Vector, [Vector; 2]) {
        let along = |n: &[f64; 64]| x.map(|x| x.iter().zip(n).map(|(x, n)| x * n).sum());
        (along(&self.values), [along(&self.slopes[0]), along(&self.slopes[1])])
    }

    /// x and the weighted outward da.
    fn area(&self, x: &[[f64; 64]; 3]) -> (Vector, Vector) {
        let (position, [s, t]) = self.surface(x);
        (position, cross(s, t).map(|a| self.weight * a))
    }
}

impl FollowerPressure {
    /// `pressure` in kPa on `faces`, `gauss` points per direction on each.
    pub fn new(mesh: &Mesh, faces: &[Face], pressure: f64, gauss: usize) -> FollowerPressure {
        let rule = GaussRule::new(gauss);
        let mut points: Vec<Vec<Point>> = (0..mesh.elements()).map(|_| Vec::new()).collect();
        let mut volume_at_rest = vec![0.0; mesh.elements()];
        for face in faces {
            let local = mesh.local(face.element);
            let tangents = face.side.tangents();
            for (st, weight) in rule.square() {
                let xi = face.side.lift(st);
                let gradients = mesh.element.gradients(xi);
                let point = Point {
                    weight: if face.side.end == 1 { weight } else { -weight },
                    values: mesh.element.values(xi),
                    slopes: tangents.map(|d| gradients.map(|g| g[d])),
                };
                let (position, area) = point.area(&local);
                volume_at_rest[face.element] += dot(position, area) / 3.0;
                points[face.element].push(point);
            }
        }
        FollowerPressure { pressure, points, volume_at_rest }
    }

    /// force += scale sum w N_a da; returns 1/3 sum w x . da.
    fn push(&self, state: &ElementState<'_>, scale: f64, force: &mut [[f64; 64]; 3]) -> f64 {
        let mut volume = 0.0;
        for point in &self.points[state.element] {
            let (position, area) = point.area(state.x);
            volume += dot(position, area) / 3.0;
            for i in 0..3 {
                for (target, n) in force[i].iter_mut().zip(&point.values) {
                    *target += scale * area[i] * n;
                }
            }
        }
        volume
    }
}

impl Term for FollowerPressure {
    fn name(&self) -> &str {
        "pressure"
    }

    fn acts_on(&self, element: usize) -> bool {
        !self.points[element].is_empty()
    }

    fn add(&self, state: &ElementState<'_>, want: Want, system: &mut ElementSystem) -> Contribution {
        let scale = state.load * self.pressure;
        let volume = self.push(state, scale, &mut system.force);
        if want == Want::Stiffness {
            for point in &self.points[state.element] {
                let (_, [s, t]) = point.surface(state.x);
                for (block, (i, k)) in system.stiffness.iter_mut().zip(PAIRS).filter(|(_, (i, k))| i != k) {
                    // e_ikm with i < k
                    let m = 3 - i - k;
                    let half = if m == 1 { -0.5 } else { 0.5 } * scale * point.weight;
                    let slope: [f64; 64] =
                        std::array::from_fn(|b| half * (point.slopes[0][b] * t[m] - point.slopes[1][b] * s[m]));
                    for (a, row) in block.chunks_exact_mut(64).enumerate() {
                        let (n, g) = (point.values[a], slope[a]);
                        // only the functions of the face's own corners are not zero on it
                        if n == 0.0 && g == 0.0 {
                            continue;
                        }
                        for ((target, value), slope) in row.iter_mut().zip(&point.values).zip(&slope) {
                            *target += n * slope - value * g;
                        }
                    }
                }
            }
        }
        Contribution { energy: scale * (volume - self.volume_at_rest[state.element]), det_f: None }
    }

    fn add_load_force(&self, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        self.push(state, self.pressure, force);
    }

    fn is_load(&self) -> bool {
        true
    }

    fn points(&self, element: usize) -> usize {
        self.points[element].len()
    }
}
