//! An embedded muscle: fibres at the quadrature points of the muscle's own mesh, acting on the host that holds them
//! (Wu et al. 2013, Eqs. 7 to 11).
//!
//! Pi = sum over points w sigma_max (a G_act(s) + G_pas(s)),  s = |F n0| / lambda_ofl
//!
//! A fibre acts along one direction. With g_a = dN_a/dX . n0 computed once, v = F n0 = sum x_a g_a, lambda = |v|,
//! n = v / lambda, T = dW/dlambda:
//! ```text
//! dPi/du_a     = sum w T n g_a
//! d2Pi/du du   = sum w D g_a g_b,   D = T' n (x) n + T/lambda (I - n (x) n)
//! d2Pi/du da   = sum w (dT/da) n g_a
//! ```
//!
//! The activation is one control everywhere, or a field: a = sum over the muscle's nodes of psi_n a_n, trilinear in its
//! elements, with a control a_n for every node; then d2Pi/du da_n has psi_n as a further factor.

use super::muscle_rule::MuscleRule;
use super::taper::part_of_fibres;
use super::{Contribution, ElementState, ElementSystem, Term, Want};
use crate::material::PAIRS;
use crate::material::fibre::Blemker;
use crate::math::tensor::{Vector, apply_transposed, determinant, dot, inverse, norm};
use crate::mesh::element::{Element, Trilinear};
use crate::mesh::fibre_angles::FibreAngles;
use crate::mesh::location::{Locator, Outside};
use crate::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use pulp::{Arch, Simd, WithSimd};

/// A muscle embedded in a host mesh.
pub struct Muscle {
    name: String,
    law: Blemker,
    /// The controls that are its activation.
    controls: Vec<usize>,
    /// All points, sorted by host element.
    points: Vec<Point>,
    /// `starts[e]..starts[e + 1]` are the points in host element e.
    starts: Vec<usize>,
    arch: Arch,
}

/// A quadrature point of a muscle.
#[derive(Debug, Clone)]
pub struct Point {
    /// Where it lies in the host.
    pub host: MaterialPoint,
    /// Which point of the muscle's rule it is: element by element, first direction fastest.
    pub index: usize,
    /// Reference position, mm.
    pub position: Vector,
    /// Weight of the rule x det(dX/deta) x the part of the fibres that is left here, mm3.
    pub weight: f64,
    /// Unit fibre direction in the reference state.
    pub fibre: Vector,
    /// Controls with their weights psi: the activation here is the sum of weight x control.
    shares: Vec<(usize, f64)>,
    /// g_a = dN_a/dX . n0, 1/mm.
    gradient: [f64; 64],
}

/// Which controls activate a muscle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activation {
    /// One everywhere, with this index.
    Uniform(usize),
    /// One for every node of the muscle's mesh in turn, from this index on; trilinear between them.
    Field(usize),
}

/// One control everywhere.
impl From<usize> for Activation {
    fn from(control: usize) -> Activation {
        Activation::Uniform(control)
    }
}

impl Activation {
    /// The controls of a muscle whose mesh has so many nodes.
    pub fn controls(self, nodes: usize) -> std::ops::Range<usize> {
        match self {
            Activation::Uniform(control) => control..control + 1,
            Activation::Field(first) => first..first + nodes,
        }
    }

    /// Controls and weights at a point of an element of the muscle's mesh.
    fn shares(self, mesh: &Mesh, element: usize, eta: [f64; 3]) -> Vec<(usize, f64)> {
        match self {
            Activation::Uniform(control) => vec![(control, 1.0)],
            Activation::Field(first) => {
                let weights = Trilinear.values(eta);
                mesh.corners[element].iter().zip(weights).map(|(node, psi)| (first + node, psi)).collect()
            }
        }
    }
}

/// Points of a muscle that the host does not hold, or that lie in an inverted element.
#[derive(Debug, Clone, PartialEq)]
pub enum NotEmbedded {
    /// Some quadrature points lie outside the host.
    Outside {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
        /// The muscle element of the farthest one.
        element: usize,
        /// Position of the farthest one, mm.
        position: Vector,
        /// Its distance to the host, mm.
        distance: f64,
    },
    /// det(dX/deta) of the muscle's own mesh is not positive at a point.
    Inverted {
        /// The muscle element.
        element: usize,
        /// det(dX/deta), mm3.
        det: f64,
    },
}

impl Muscle {
    /// Embeds `mesh` with its fibre angles in the host that `locator` searches; `gauss` points per direction in each of
    /// its elements.
    pub fn new(
        name: &str,
        locator: &Locator<'_>,
        mesh: &Mesh,
        angles: &FibreAngles,
        gauss: usize,
        law: Blemker,
        activation: impl Into<Activation>,
    ) -> Result<Muscle, NotEmbedded> {
        Muscle::with_rule(name, locator, mesh, angles, &MuscleRule::uniform(mesh, gauss), law, activation)
    }

    /// The same with the points of `rule`, a rule of `mesh`.
    pub fn with_rule(
        name: &str,
        locator: &Locator<'_>,
        mesh: &Mesh,
        angles: &FibreAngles,
        rule: &MuscleRule,
        law: Blemker,
        activation: impl Into<Activation>,
    ) -> Result<Muscle, NotEmbedded> {
        let activation = activation.into();
        let host = locator.mesh();
        let mut points = Vec::new();
        let mut farthest: Option<(usize, Vector, Outside)> = None;
        let (mut all, mut outside) = (0, 0);
        let mut local = (0, mesh.local(0));
        for (index, (element, eta, weight)) in rule.points().enumerate() {
            if local.0 != element {
                local = (element, mesh.local(element));
            }
            let (position, jacobian) = position_and_jacobian(mesh.element, &local.1, eta);
            let det = determinant(&jacobian);
            if det.is_nan() || det <= 0.0 {
                return Err(NotEmbedded::Inverted { element, det });
            }
            all += 1;
            let fibre = angles.direction(mesh, element, &local.1, eta);
            match locator.locate(position) {
                Ok(at) => points.push(Point {
                    host: at,
                    index,
                    position,
                    weight: weight * det,
                    fibre,
                    shares: activation.shares(mesh, element, eta),
                    gradient: directional_gradient(host, at, fibre),
                }),
                Err(found) => {
                    outside += 1;
                    if farthest.is_none_or(|(_, _, f)| found.distance > f.distance) {
                        farthest = Some((element, position, found));
                    }
                }
            }
        }
        if let Some((element, position, Outside { distance, .. })) = farthest {
            return Err(NotEmbedded::Outside { count: outside, of: all, element, position, distance });
        }
        points.sort_by_key(|p| (p.host.element, p.index));
        let mut starts = vec![0; host.elements() + 1];
        for p in &points {
            starts[p.host.element + 1] += 1;
        }
        for e in 0..host.elements() {
            starts[e + 1] += starts[e];
        }
        let controls = activation.controls(mesh.nodes).collect();
        Ok(Muscle { name: name.to_owned(), law, controls, points, starts, arch: Arch::new() })
    }

    /// With fibres that end softly over `taper` mm ([`super::taper`]); `own` searches the muscle's mesh.
    pub fn tapered(mut self, own: &Locator<'_>, taper: f64) -> Muscle {
        for point in &mut self.points {
            point.weight *= part_of_fibres(own, point.position, point.fibre, taper);
        }
        self
    }

    /// Its activation; of a field the mean over the volume of its fibres.
    pub fn mean_activation(&self, controls: &[f64]) -> f64 {
        match self.controls[..] {
            [control] => controls[control],
            _ => self.points.iter().map(|p| p.weight * p.activation(controls)).sum::<f64>() / self.volume(),
        }
    }

    /// Its points, sorted by host element.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The reference volume of its fibres, mm3: that of the muscle, less by what a taper takes.
    pub fn volume(&self) -> f64 {
        self.points.iter().map(|p| p.weight).sum()
    }

    /// The constants of its law.
    pub fn law(&self) -> &Blemker {
        &self.law
    }

    fn points_in(&self, element: usize) -> &[Point] {
        &self.points[self.starts[element]..self.starts[element + 1]]
    }
}

impl Point {
    /// The activation here.
    pub fn activation(&self, controls: &[f64]) -> f64 {
        self.shares.iter().map(|(control, psi)| psi * controls[*control]).sum()
    }

    /// v = F n0 from the local parameters of x in the point's host element; |v| is the stretch.
    #[inline(always)]
    pub fn deformed_fibre(&self, x: &[[f64; 64]; 3]) -> Vector {
        // eight partial sums, so that the sum does not wait for itself
        std::array::from_fn(|i| {
            let mut partial = [0.0; 8];
            for (x, g) in x[i].chunks_exact(8).zip(self.gradient.chunks_exact(8)) {
                for l in 0..8 {
                    partial[l] += x[l] * g[l];
                }
            }
            partial.iter().sum()
        })
    }
}

/// g_a = dN_a/dX . n0 = dN_a/dxi . (dxi/dX n0).
fn directional_gradient(host: &Mesh, at: MaterialPoint, fibre: Vector) -> [f64; 64] {
    let jacobian = host.jacobian(at);
    let inverse = inverse(&jacobian, determinant(&jacobian));
    let along: Vector = std::array::from_fn(|d| dot(inverse[d], fibre));
    let gradients = host.element.gradients(at.xi);
    debug_assert!((norm(apply_transposed(&inverse, [1.0; 3]))).is_finite());
    std::array::from_fn(|a| dot(gradients[a], along))
}

impl Term for Muscle {
    fn name(&self) -> &str {
        &self.name
    }

    fn acts_on(&self, element: usize) -> bool {
        self.starts[element] < self.starts[element + 1]
    }

    fn points(&self, element: usize) -> usize {
        self.starts[element + 1] - self.starts[element]
    }

    fn controls(&self) -> &[usize] {
        &self.controls
    }

    fn as_muscle(&self) -> Option<&Muscle> {
        Some(self)
    }

    fn add(&self, state: &ElementState<'_>, want: Want, system: &mut ElementSystem) -> Contribution {
        let points = self.points_in(state.element);
        self.arch.dispatch(Add { law: &self.law, points, state, want, system })
    }

    fn add_control_force(&self, control: usize, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        for point in self.points_in(state.element) {
            let Some((_, psi)) = point.shares.iter().find(|(own, _)| *own == control) else { continue };
            let v = point.deformed_fibre(state.x);
            let lambda = norm(v);
            let per_activation = self.law.tension_per_activation(lambda).force * psi * point.weight / lambda;
            for i in 0..3 {
                for (target, g) in force[i].iter_mut().zip(&point.gradient) {
                    *target += per_activation * v[i] * g;
                }
            }
        }
    }
}

/// [`Term::add`] for the points of one element, compiled once per instruction set.
struct Add<'a> {
    law: &'a Blemker,
    points: &'a [Point],
    state: &'a ElementState<'a>,
    want: Want,
    system: &'a mut ElementSystem,
}

impl WithSimd for Add<'_> {
    type Output = Contribution;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Contribution {
        let mut energy = 0.0;
        // w D of every point, for each pair of components
        let mut weighted: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::with_capacity(self.points.len()));
        for point in self.points {
            let v = point.deformed_fibre(self.state.x);
            let lambda = norm(v);
            let n = v.map(|c| c / lambda);
            let tension = self.law.tension(lambda, point.activation(self.state.controls));
            energy += point.weight * tension.energy;
            for i in 0..3 {
                let force = point.weight * tension.force * n[i];
                for (target, g) in self.system.force[i].iter_mut().zip(&point.gradient) {
                    *target += force * g;
                }
            }
            let across = tension.force / lambda;
            for (values, (i, k)) in weighted.iter_mut().zip(PAIRS) {
                let d = (tension.slope - across) * n[i] * n[k] + if i == k { across } else { 0.0 };
                values.push(point.weight * d);
            }
        }
        if self.want == Want::Stiffness {
            let gradients: Vec<[f64; 64]> = self.points.iter().map(|p| p.gradient).collect();
            let mut scaled = Vec::with_capacity(gradients.len());
            for (block, values) in self.system.stiffness.iter_mut().zip(&weighted) {
                if S::IS_SCALAR {
                    add_outer_products::<false>(&gradients, values, &mut scaled, block);
                } else {
                    add_outer_products::<true>(&gradients, values, &mut scaled, block);
                }
            }
        }
        Contribution { energy, det_f: None }
    }
}

/// block += sum over points d g g^T. The sum is symmetric: tiles of 4 x 8 are done from the diagonal on and mirrored. A tile
/// is small enough to stay in registers while it runs over the points.
#[inline(always)]
fn add_outer_products<const FMA: bool>(
    gradients: &[[f64; 64]],
    values: &[f64],
    scaled: &mut Vec<[f64; 64]>,
    block: &mut [f64; 4096],
) {
    const ROWS: usize = 4;
    const COLUMNS: usize = 8;
    scaled.clear();
    scaled.extend(gradients.iter().zip(values).map(|(g, d)| g.map(|g| d * g)));
    for first_row in (0..64).step_by(ROWS) {
        for first_column in ((first_row / COLUMNS) * COLUMNS..64).step_by(COLUMNS) {
            let mut sum = [[0.0; COLUMNS]; ROWS];
            for (scaled, gradient) in scaled.iter().zip(gradients) {
                let mut rows = [0.0; ROWS];
                rows.copy_from_slice(&scaled[first_row..first_row + ROWS]);
                let mut columns = [0.0; COLUMNS];
                columns.copy_from_slice(&gradient[first_column..first_column + COLUMNS]);
                for a in 0..ROWS {
                    for b in 0..COLUMNS {
                        sum[a][b] = if FMA {
                            rows[a].mul_add(columns[b], sum[a][b])
                        } else {
                            sum[a][b] + rows[a] * columns[b]
                        };
                    }
                }
            }
            // the two tiles that share a diagonal square fill it; the others are mirrored
            let mirrored = first_column > first_row;
            for (a, row) in sum.iter().enumerate() {
                for (b, value) in row.iter().enumerate() {
                    let (a, b) = (first_row + a, first_column + b);
                    block[64 * a + b] += value;
                    if mirrored {
                        block[64 * b + a] += value;
                    }
                }
            }
        }
    }
}
