//! Follower pressure: a force per current area that stays normal to the surface, f = - p n da.
//!
//! With the surface x(s, t) and da = x,s x x,t (outward):
//! ```text
//! r_ia     = load p sum w N_a da_i
//! K_ia,kb  = load p sum w N_a e_ikm (N_b,s x,t_m - N_b,t x,s_m)
//! ```
//!
//! Where the surface is closed, or its rim is held, this is the gradient of load p V with V the volume behind the surface,
//! and K is symmetric after assembly (Bufler 1984). Where the rim is free there is no energy: K has an antisymmetric part,
//! which lives on the rim. Our tangents are symmetric, so that (K + K^T)/2 is added. The equilibrium is not touched by
//! that; Newton's method comes to it a little more slowly, and sensitivities from the tangent are approximate.
//!
//! The work told is that of the pressure on the straight way from X to x = X + u,
//! ```text
//! W = - load p sum w u . (da(X) + 4 da(X + u/2) + da(x))/6,
//! ```
//! which is exact, for da is quadratic along it; the energy is its opposite. Both depend on the way at a free rim alone.

use crate::material::PAIRS;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Vector, add_scaled, cross, dot};
use crate::mesh::Mesh;
use crate::mesh::face::Face;
use crate::term::{Contribution, ElementState, ElementSystem, Term, Want};

/// A pressure on faces of the host that follows them.
pub struct FollowerPressure {
    /// kPa at full load; positive pushes into the body.
    pressure: f64,
    /// Quadrature points of each element's faces.
    points: Vec<Vec<Point>>,
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
    /// x,s and x,t from the local parameters of x.
    fn tangents(&self, x: &[[f64; 64]; 3]) -> [Vector; 2] {
        [interpolated(&self.slopes[0], x), interpolated(&self.slopes[1], x)]
    }

    /// w u . (da(X) + 4 da(X + u/2) + da(x))/6 with u = x - X.
    fn volume_swept(&self, state: &ElementState<'_>) -> f64 {
        let [s, t] = self.tangents(state.x);
        let [us, ut] = self.tangents(state.u);
        let area = |part: f64| cross(add_scaled(s, -part, us), add_scaled(t, -part, ut));
        let mean = add_scaled(add_scaled(area(0.0), 4.0, area(0.5)), 1.0, area(1.0));
        self.weight * dot(interpolated(&self.values, state.u), mean) / 6.0
    }
}

/// The sum of n_a times local parameter a.
fn interpolated(n: &[f64; 64], local: &[[f64; 64]; 3]) -> Vector {
    local.map(|x| x.iter().zip(n).map(|(x, n)| x * n).sum())
}

impl FollowerPressure {
    /// `pressure` in kPa on `faces`, `gauss` points per direction on each.
    pub fn new(mesh: &Mesh, faces: &[Face], pressure: f64, gauss: usize) -> FollowerPressure {
        let rule = GaussRule::new(gauss);
        let mut points: Vec<Vec<Point>> = (0..mesh.elements()).map(|_| Vec::new()).collect();
        for face in faces {
            let tangents = face.side.tangents();
            for (st, weight) in rule.square() {
                let xi = face.side.lift(st);
                let gradients = mesh.element.gradients(xi);
                let point = Point {
                    weight: if face.side.end == 1 { weight } else { -weight },
                    values: mesh.element.values(xi),
                    slopes: tangents.map(|d| gradients.map(|g| g[d])),
                };
                points[face.element].push(point);
            }
        }
        FollowerPressure { pressure, points }
    }

    /// force += scale sum w N_a da
    fn push(&self, state: &ElementState<'_>, scale: f64, force: &mut [[f64; 64]; 3]) {
        for point in &self.points[state.element] {
            let [s, t] = point.tangents(state.x);
            let area = cross(s, t).map(|a| point.weight * a);
            for i in 0..3 {
                for (target, n) in force[i].iter_mut().zip(&point.values) {
                    *target += scale * area[i] * n;
                }
            }
        }
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
        self.push(state, scale, &mut system.force);
        if want == Want::Stiffness {
            for point in &self.points[state.element] {
                let [s, t] = point.tangents(state.x);
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
        Contribution { energy: -self.external_work(state), det_f: None }
    }

    fn add_load_force(&self, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        self.push(state, self.pressure, force);
    }

    fn external_work(&self, state: &ElementState<'_>) -> f64 {
        let swept: f64 = self.points[state.element].iter().map(|point| point.volume_swept(state)).sum();
        -state.load * self.pressure * swept
    }

    fn is_load(&self) -> bool {
        true
    }

    fn points(&self, element: usize) -> usize {
        self.points[element].len()
    }
}
