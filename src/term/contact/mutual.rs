//! Contact between two deformable faces, or of a set of faces with itself, without friction.
//!
//! The foot y(s, t) of a point x of one face on the other makes |x - y| stationary; n is the outward normal there. With
//! the functions N_a of the point and M_b of the foot, A_ia = (N_a, - M_b) is how the distance x - y follows the
//! parameters, and
//! ```text
//! g = n . (x - y),   dg = n . A =: G
//! d2g = - a^T m^-1 k (m - g k)^-1 a - a^T (m - g k)^-1 b - b^T (m - g k)^-1 a - g b^T (m - g k)^-1 b
//! a_d = y_d . A,   b_d = n . M_d  (slopes of the functions of the foot),  metric m, curvature k along n
//! ```
//! which is the derivative through the moving foot (Wriggers 2006, Computational Contact Mechanics, sec. 6.1).
//!
//! Both faces are asked in turn, each for half of the energy, so that neither is preferred (two half passes, Sauer and De
//! Lorenzis 2015):  Pi = sum over points w/2 psi(g). In contact with itself both sides of a fold are points of the set.

use super::ContactPoint;
use super::law::{Allows, ContactLaw, Response};
use super::patch::{Jet, Patch};
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Vector, dot, norm, subtract};
use crate::mesh::face::Face;
use crate::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use crate::term::coupling::{BodyState, Coupled, Coupling, FacePair};
use crate::term::{Contribution, ElementState, ElementSystem, Term, Want};
use rayon::prelude::*;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{PointDistance, RTree};
use std::collections::BTreeMap;

/// Which faces may meet.
#[derive(Debug, Clone)]
pub enum Between {
    /// The first set meets the second.
    Two(Vec<Face>, Vec<Face>),
    /// Every face of the set may meet every other that shares no node with it.
    Itself(Vec<Face>),
}

/// How they meet.
pub struct Manner {
    /// What keeps the gap.
    pub law: Box<dyn ContactLaw>,
    /// Whether what the reference shape violates is taken away in proportion to the load factor.
    pub relax: bool,
    /// Penetration that is still taken as contact, mm: less than the bodies are thick. A state with more, up to twice as
    /// much, is not admissible; beyond that the other side of a thin body is meant. `None`: half of the smallest thickness
    /// of an element behind a face.
    pub depth: Option<f64>,
}

/// Contact between deformable faces.
pub struct Mutual {
    name: String,
    manner: Manner,
    depth: f64,
    /// The first set, then the second.
    faces: Vec<Face>,
    /// Faces of the first set; all, in contact with itself.
    first: usize,
    itself: bool,
    /// Of contact with itself, the faces that each face shares a node with; ascending.
    touching: Vec<Vec<usize>>,
    points: Vec<Point>,
    /// Distance beyond which a face is not looked for, mm.
    reach: f64,
    neighbours: Vec<[Face; 2]>,
}

/// A quadrature point.
struct Point {
    face: usize,
    st: [f64; 2],
    /// Half of the reference area, the part of the energy that is asked from this side, mm2.
    weight: f64,
    /// Reference area, mm2.
    area: f64,
    /// Gap in the reference shape, mm.
    start: Option<f64>,
    /// What of it the load factor takes away, mm; zero or less.
    relaxed: f64,
}

/// What a point finds opposite.
enum Opposite {
    /// Nothing near.
    Nothing,
    /// A face so far in front of it that the bodies would have passed through each other.
    Through,
    /// A foot on a face.
    Foot(Foot),
}

struct Foot {
    face: usize,
    st: [f64; 2],
    jet: Jet,
    normal: Vector,
    gap: f64,
}

/// All faces at a state.
struct Faces {
    patches: Vec<Patch>,
    /// Boxes of the faces that the first set, and the second, may meet.
    trees: [RTree<GeomWithData<Rectangle<Vector>, usize>>; 2],
}

impl Mutual {
    /// Contact of faces of `mesh`, `gauss` points per direction on each.
    pub fn new(name: &str, manner: Manner, mesh: &Mesh, between: Between, gauss: usize) -> Mutual {
        let itself = matches!(between, Between::Itself(_));
        let (mut faces, second) = match between {
            Between::Two(first, second) => (first, second),
            Between::Itself(faces) => (faces, Vec::new()),
        };
        let first = faces.len();
        faces.extend(second);
        let nodes = |face: &Face| face.side.nodes().map(|k| mesh.corners[face.element][k]);
        let touching = faces.iter().map(|face| {
            let own = nodes(face);
            let shares = |k: &usize| nodes(&faces[*k]).iter().any(|node| own.contains(node));
            (0..faces.len()).filter(|k| itself && shares(k)).collect()
        });
        let touching = touching.collect();
        let (thickness, extent) = sizes(mesh, &faces);
        let depth = manner.depth.unwrap_or(0.5 * thickness);
        let reach = extent.max(2.0 * depth).max(manner.law.range());
        let mut contact = Mutual {
            name: name.to_owned(),
            depth,
            faces,
            first,
            itself,
            touching,
            points: Vec::new(),
            reach,
            neighbours: Vec::new(),
            manner,
        };
        contact.points = contact.lay_points(mesh, gauss);
        let body = BodyState { mesh, x: &mesh.parameters, load: 1.0, easing: 0.0, multipliers: &[] };
        let mut near = Vec::new();
        for (index, opposite) in contact.opposites(&body).into_iter().enumerate() {
            let Opposite::Foot(foot) = opposite else { continue };
            let point = &mut contact.points[index];
            point.start = Some(foot.gap);
            if contact.manner.relax {
                point.relaxed = foot.gap.min(0.0);
            }
            near.push([contact.faces[point.face], contact.faces[foot.face]]);
        }
        near.sort_unstable();
        near.dedup();
        contact.neighbours = near;
        contact
    }

    fn lay_points(&self, mesh: &Mesh, gauss: usize) -> Vec<Point> {
        let rule = GaussRule::new(gauss);
        let of_face = |(index, face): (usize, &Face)| {
            let local = mesh.local(face.element);
            let point = |(st, weight): ([f64; 2], f64)| {
                let (_, jacobian) = position_and_jacobian(mesh.element, &local, face.side.lift(st));
                let area = weight * norm(face.side.area_vector(&jacobian));
                Point { face: index, st, weight: 0.5 * area, area, start: None, relaxed: 0.0 }
            };
            rule.square().map(point).collect::<Vec<_>>()
        };
        self.faces.iter().enumerate().flat_map(of_face).collect()
    }

    /// The point with the smallest gap in the reference shape, with its position (mm) and gap (mm); `None` where no faces are
    /// near each other.
    pub fn worst_start(&self, mesh: &Mesh) -> Option<(MaterialPoint, Vector, f64)> {
        let start = |p: &Point| p.start.unwrap_or(f64::INFINITY);
        let worst = self.points.iter().min_by(|a, b| start(a).total_cmp(&start(b)))?;
        let at = self.material(worst);
        Some((at, mesh.position(at), worst.start?))
    }

    fn material(&self, point: &Point) -> MaterialPoint {
        let face = self.faces[point.face];
        MaterialPoint { element: face.element, xi: face.side.lift(point.st) }
    }

    /// The faces at a state.
    fn faces_at(&self, body: &BodyState<'_>) -> Faces {
        let patch = |face: &Face| Patch::new(body.mesh.element, &body.mesh.local_of(face.element, body.x), face.side);
        let patches: Vec<Patch> = self.faces.iter().map(patch).collect();
        let tree = |range: std::ops::Range<usize>| {
            RTree::bulk_load(range.map(|k| GeomWithData::new(patches[k].bounds(), k)).collect())
        };
        let count = patches.len();
        let trees =
            if self.itself { [tree(0..count), RTree::new()] } else { [tree(self.first..count), tree(0..self.first)] };
        Faces { trees, patches }
    }

    /// What every point finds opposite at a state.
    fn opposites(&self, body: &BodyState<'_>) -> Vec<Opposite> {
        let faces = self.faces_at(body);
        self.points.par_iter().map(|point| self.opposite(point, &faces)).collect()
    }

    /// The nearest foot of a point on a face that looks towards it.
    fn opposite(&self, point: &Point, faces: &Faces) -> Opposite {
        let own = &faces.patches[point.face];
        let jet = own.jet(point.st);
        let (x, outward) = (jet.y, jet.normal(own.outward));
        if x.iter().chain(&outward).any(|x| !x.is_finite()) {
            return Opposite::Through;
        }
        let tree = &faces.trees[usize::from(point.face >= self.first)];
        let mut best: Option<(f64, Foot)> = None;
        for candidate in tree.nearest_neighbor_iter(x) {
            let (box_distance, face) = (candidate.geom().distance_2(&x).sqrt(), candidate.data);
            if box_distance > best.as_ref().map_or(self.reach, |(distance, _)| *distance) {
                break;
            }
            if self.touching[point.face].binary_search(&face).is_ok() {
                continue;
            }
            let patch = &faces.patches[face];
            let foot = patch.closest(x);
            let nearer = foot.distance < best.as_ref().map_or(self.reach, |(distance, _)| *distance);
            if !nearer || !foot.perpendicular {
                continue;
            }
            let normal = foot.jet.normal(patch.outward);
            let gap = dot(normal, subtract(x, foot.jet.y));
            if dot(normal, outward) < 0.0 && gap >= -2.0 * self.depth {
                best = Some((foot.distance, Foot { face, st: foot.st, jet: foot.jet, normal, gap }));
            }
        }
        match best {
            None => Opposite::Nothing,
            Some((_, foot)) if foot.gap < -self.depth => Opposite::Through,
            Some((_, foot)) => Opposite::Foot(foot),
        }
    }

    /// The response at a point to its gap as it is measured while it relaxes.
    fn response(&self, index: usize, gap: f64, body: &BodyState<'_>) -> Response {
        let gap = gap - (1.0 - body.load) * self.points[index].relaxed;
        let multiplier = body.multipliers.get(index).copied().unwrap_or(0.0);
        self.manner.law.eased(body.easing, gap, Allows::ClosedOrOpen, multiplier)
    }

    /// Calls `f` for every point that has a face opposite, with its index and foot.
    fn for_each_foot(&self, body: &BodyState<'_>, mut f: impl FnMut(usize, &Foot)) {
        for (index, opposite) in self.opposites(body).iter().enumerate() {
            if let Opposite::Foot(foot) = opposite {
                f(index, foot);
            }
        }
    }

    /// How the distance x - y at a point and its foot follows the parameters.
    fn lever(&self, mesh: &Mesh, point: &Point, foot: &Foot) -> Lever {
        let values = |face: usize, st: [f64; 2]| {
            let side = self.faces[face].side;
            let all = mesh.element.values(side.lift(st));
            side.functions(mesh.element).into_iter().map(|a| all[a]).collect::<Vec<f64>>()
        };
        let side = self.faces[foot.face].side;
        let [p, q] = side.tangents();
        let gradients = mesh.element.gradients(side.lift(foot.st));
        Lever {
            point: values(point.face, point.st),
            foot: values(foot.face, foot.st),
            slopes: [p, q].map(|d| side.functions(mesh.element).into_iter().map(|a| gradients[a][d]).collect()),
        }
    }

    /// Sums f_i A_ia over points into one system for each pair of faces.
    fn forces(&self, body: &BodyState<'_>, size: impl Fn(usize, &Foot) -> f64) -> Vec<FacePair> {
        let mut pairs = Pairs::default();
        self.for_each_foot(body, |index, foot| {
            let size = size(index, foot);
            if size != 0.0 {
                let point = &self.points[index];
                let lever = self.lever(body.mesh, point, foot);
                let pair = pairs.of(self, point, foot, lever.entries(), false);
                lever.along(foot.normal).iter().zip(&mut pair.force).for_each(|(g, f)| *f += size * g);
            }
        });
        pairs.0.into_values().collect()
    }
}

/// Values of the functions of a point and of its foot, and the slopes of those of the foot along s and t.
struct Lever {
    point: Vec<f64>,
    foot: Vec<f64>,
    slopes: [Vec<f64>; 2],
}

impl Lever {
    fn entries(&self) -> usize {
        3 * (self.point.len() + self.foot.len())
    }

    /// d . A, one per local entry.
    fn along(&self, d: Vector) -> Vec<f64> {
        let own = d.into_iter().flat_map(|d| self.point.iter().map(move |n| d * n));
        own.chain(d.into_iter().flat_map(|d| self.foot.iter().map(move |n| -d * n))).collect()
    }

    /// n . M_d, one per local entry.
    fn turn(&self, normal: Vector, d: usize) -> Vec<f64> {
        let own = std::iter::repeat_n(0.0, 3 * self.point.len());
        own.chain(normal.into_iter().flat_map(|n| self.slopes[d].iter().map(move |m| n * m))).collect()
    }
}

/// One system for each pair of faces, in the order of the faces.
#[derive(Default)]
struct Pairs(BTreeMap<[usize; 2], FacePair>);

impl Pairs {
    fn of(&mut self, contact: &Mutual, point: &Point, foot: &Foot, entries: usize, stiff: bool) -> &mut FacePair {
        self.0.entry([point.face, foot.face]).or_insert_with(|| FacePair {
            faces: [contact.faces[point.face], contact.faces[foot.face]],
            force: vec![0.0; entries],
            stiffness: vec![0.0; if stiff { entries * entries } else { 0 }],
        })
    }
}

/// The smallest thickness of an element behind a face, and the largest extent of a face, mm.
fn sizes(mesh: &Mesh, faces: &[Face]) -> (f64, f64) {
    let (mut thickness, mut extent) = (f64::INFINITY, 0.0_f64);
    for face in faces {
        let at = |xi| mesh.position(MaterialPoint { element: face.element, xi });
        let here = face.side.lift([0.5, 0.5]);
        let mut behind = here;
        behind[face.side.direction] = 1.0 - here[face.side.direction];
        thickness = thickness.min(norm(subtract(at(here), at(behind))));
        for (a, b) in [([0.0, 0.0], [1.0, 1.0]), ([1.0, 0.0], [0.0, 1.0])] {
            extent = extent.max(norm(subtract(at(face.side.lift(a)), at(face.side.lift(b)))));
        }
    }
    (thickness, extent)
}

impl Coupling for Mutual {
    fn points(&self) -> usize {
        self.points.len()
    }

    fn eases(&self) -> Option<f64> {
        self.manner.law.eases()
    }

    fn neighbours(&self) -> &[[Face; 2]] {
        &self.neighbours
    }

    fn add(&self, body: &BodyState<'_>, want: Want) -> Coupled {
        let mut energy = 0.0;
        let mut pairs = Pairs::default();
        for (index, opposite) in self.opposites(body).iter().enumerate() {
            let foot = match opposite {
                Opposite::Foot(foot) => foot,
                Opposite::Nothing => continue,
                Opposite::Through => {
                    energy = f64::NAN;
                    continue;
                }
            };
            let response = self.response(index, foot.gap, body);
            let point = &self.points[index];
            energy += point.weight * response.energy;
            if response == (Response { energy: response.energy, ..Response::NONE }) {
                continue;
            }
            let lever = self.lever(body.mesh, point, foot);
            let pair = pairs.of(self, point, foot, lever.entries(), want == Want::Stiffness);
            let g = lever.along(foot.normal);
            g.iter().zip(&mut pair.force).for_each(|(g, f)| *f += point.weight * response.slope * g);
            if want == Want::Stiffness {
                add_stiffness(
                    pair,
                    &lever,
                    foot,
                    &g,
                    point.weight * response.stiffness,
                    point.weight * response.slope,
                );
            }
        }
        Coupled { energy, pairs: pairs.0.into_values().collect() }
    }

    /// dg/dload = g(X) where that is relaxed.
    fn load_force(&self, body: &BodyState<'_>) -> Vec<FacePair> {
        self.forces(body, |index, foot| {
            let point = &self.points[index];
            point.weight * self.response(index, foot.gap, body).stiffness * point.relaxed
        })
    }

    fn contact_points(&self, body: &BodyState<'_>) -> Vec<ContactPoint> {
        let faces = self.faces_at(body);
        let at = |(index, point): (usize, &Point)| {
            let foot = match self.opposite(point, &faces) {
                Opposite::Foot(foot) => Some(foot),
                _ => None,
            };
            ContactPoint {
                at: self.material(point),
                position: faces.patches[point.face].jet(point.st).y,
                gap: foot.as_ref().map(|foot| foot.gap),
                normal: foot.as_ref().map_or([0.0; 3], |foot| foot.normal),
                pressure: foot.as_ref().map_or(0.0, |foot| -self.response(index, foot.gap, body).slope),
                area: point.area,
                counted: point.face < self.first,
            }
        };
        self.points.par_iter().enumerate().map(at).collect()
    }

    fn multipliers(&self) -> usize {
        if self.manner.law.gap_tolerance().is_some() { self.points.len() } else { 0 }
    }

    fn tolerance(&self) -> f64 {
        self.manner.law.gap_tolerance().unwrap_or(f64::INFINITY)
    }

    fn renew(&self, body: &BodyState<'_>, multipliers: &mut [f64]) -> f64 {
        let mut worst: f64 = 0.0;
        for (index, opposite) in self.opposites(body).iter().enumerate() {
            let Opposite::Foot(foot) = opposite else {
                multipliers[index] = 0.0;
                continue;
            };
            // |g| where closed; where open, what the multiplier still holds, as a gap
            let slope = self.response(index, foot.gap, body).slope;
            worst = worst.max((slope - multipliers[index]).abs() / self.manner.law.stiffness());
            multipliers[index] = slope;
        }
        worst
    }

    fn constraint_force(&self, body: &BodyState<'_>, z: &[f64]) -> Vec<FacePair> {
        self.forces(body, |index, _| self.points[index].weight.sqrt() * z[index])
    }

    fn constraint_rate(&self, body: &BodyState<'_>, du: &[Vector], z: &mut [f64]) {
        z.fill(0.0);
        self.for_each_foot(body, |index, foot| {
            let point = &self.points[index];
            if self.response(index, foot.gap, body).stiffness > 0.0 {
                let own = body.mesh.interpolate(self.material(point), du);
                let face = self.faces[foot.face];
                let at = MaterialPoint { element: face.element, xi: face.side.lift(foot.st) };
                let apart = subtract(own, body.mesh.interpolate(at, du));
                z[index] = point.weight.sqrt() * dot(foot.normal, apart);
            }
        });
    }
}

/// K += along G G^T + slope d2g, with the lever's a and b as four columns beside G.
fn add_stiffness(pair: &mut FacePair, lever: &Lever, foot: &Foot, g: &[f64], along: f64, slope: f64) {
    let [bend, moved] = foot.jet.curvature(foot.normal, foot.gap);
    let a = foot.jet.first.map(|y| lever.along(y));
    let b = [0, 1].map(|d| lever.turn(foot.normal, d));
    let columns = [g, &a[0], &a[1], &b[0], &b[1]];
    let mut weights = [[0.0; 5]; 5];
    weights[0][0] = along;
    for (d, e) in (0..4).map(|n| (n & 1, n >> 1)) {
        weights[1 + d][1 + e] = -slope * bend[d][e];
        weights[1 + d][3 + e] = -slope * moved[d][e];
        weights[3 + d][1 + e] = -slope * moved[d][e];
        weights[3 + d][3 + e] = -slope * foot.gap * moved[d][e];
    }
    let n = g.len();
    for (r, row) in pair.stiffness.chunks_exact_mut(n).enumerate() {
        let mut left = [0.0; 5];
        for (c, left) in left.iter_mut().enumerate() {
            *left = (0..5).map(|d| columns[d][r] * weights[d][c]).sum();
        }
        for (left, column) in left.iter().zip(columns).filter(|(left, _)| **left != 0.0) {
            row.iter_mut().zip(column).for_each(|(k, c)| *k += left * c);
        }
    }
}

/// Nothing of it lives inside a single element: see [`Coupling`].
impl Term for Mutual {
    fn name(&self) -> &str {
        &self.name
    }

    fn acts_on(&self, _element: usize) -> bool {
        false
    }

    fn add(&self, _state: &ElementState<'_>, _want: Want, _system: &mut ElementSystem) -> Contribution {
        Contribution { energy: 0.0, det_f: None }
    }

    fn points(&self, _element: usize) -> usize {
        0
    }

    fn as_coupling(&self) -> Option<&dyn Coupling> {
        Some(self)
    }
}
