//! Contact of faces of the host with a rigid surface, without friction; with each other: [`mutual`].
//!
//! Pi = sum over points w psi(g(x)), with the reference area w of a point and the gap g of its current position:
//! ```text
//! dPi/du_ia       = sum w psi' n_i N_a
//! d2Pi/du_ia du_kb = sum w (psi'' n_i n_k + psi' d2g/dx_i dx_k) N_a N_b
//! ```
//! A bone may carry the surface. Where the reference shape already penetrates and that is to be relaxed, g is measured from there and the load factor
//! takes the difference away: g(x) - (1 - load) g(X).

mod carried;
pub mod law;
pub mod mutual;
mod patch;
pub mod surface;

use super::bone::{Bone, Carried, Wrench};
use super::constraint::Constraint;
use super::{Contribution, ElementState, ElementSystem, Term, Want};
use crate::material::PAIRS;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Vector, add_scaled, dot, norm};
use crate::mesh::face::Face;
use crate::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use law::{Allows, ContactLaw, Response};
use std::ops::Range;
use std::sync::Arc;
use surface::{Gap, RigidSurface};

/// What a body meets, and how.
pub struct Interface {
    /// Whether it may lift off.
    pub allows: Allows,
    /// The surface.
    pub surface: Box<dyn RigidSurface>,
    /// What keeps the gap.
    pub law: Box<dyn ContactLaw>,
    /// Whether what the reference shape violates is taken away in proportion to the load factor; if not, it acts at once.
    pub relax: bool,
}

/// Contact of a set of faces with one surface.
pub struct Contact {
    name: String,
    interface: Interface,
    /// The bone that carries the surface.
    bone: Option<Arc<Bone>>,
    points: Vec<Point>,
    /// The points of each element of the host.
    of_element: Vec<Range<usize>>,
}

/// A quadrature point.
struct Point {
    at: MaterialPoint,
    /// Reference area, mm2.
    weight: f64,
    /// The functions that are not zero on the face, with their values.
    shape: Vec<(usize, f64)>,
    /// The gap in the reference shape, mm; `None` beyond the edge of the surface.
    start: Option<f64>,
    /// What of it the load factor takes away, mm; zero or less unless the contact may not open.
    relaxed: f64,
}

/// A quadrature point at a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPoint {
    /// Where on the host.
    pub at: MaterialPoint,
    /// Current position, mm.
    pub position: Vector,
    /// Signed distance to the surface, mm; `None` beyond its edge.
    pub gap: Option<f64>,
    /// The normal of the surface towards the host; zero beyond its edge.
    pub normal: Vector,
    /// Pressure on the host along the normal per reference area, kPa; negative where it is held back.
    pub pressure: f64,
    /// Reference area, mm2.
    pub area: f64,
    /// Whether it counts in sums: of two faces that meet, the points of the first do.
    pub counted: bool,
}

impl Contact {
    /// Contact of `faces` of `mesh`, `gauss` points per direction on each.
    pub fn new(name: &str, interface: Interface, mesh: &Mesh, faces: &[Face], gauss: usize) -> Contact {
        let rule = GaussRule::new(gauss);
        let mut faces = faces.to_vec();
        faces.sort_unstable();
        let mut points = Vec::with_capacity(faces.len() * gauss * gauss);
        let mut of_element = vec![0..0; mesh.elements()];
        for in_element in faces.chunk_by(|a, b| a.element == b.element) {
            let (element, first) = (in_element[0].element, points.len());
            let local = mesh.local(element);
            for face in in_element {
                for (st, weight) in rule.square() {
                    let xi = face.side.lift(st);
                    let (position, jacobian) = position_and_jacobian(mesh.element, &local, xi);
                    let values = mesh.element.values(xi);
                    let start = interface.surface.gap(position).map(|gap| gap.value);
                    let violated = start.map_or(0.0, |gap| violation(interface.allows, gap));
                    points.push(Point {
                        at: MaterialPoint { element, xi },
                        weight: weight * norm(face.side.area_vector(&jacobian)),
                        shape: values.into_iter().enumerate().filter(|(_, n)| *n != 0.0).collect(),
                        start,
                        relaxed: if interface.relax { violated } else { 0.0 },
                    });
                }
            }
            of_element[element] = first..points.len();
        }
        Contact { name: name.to_owned(), interface, bone: None, points, of_element }
    }

    /// The same contact with its surface on a bone.
    pub fn on(self, bone: Arc<Bone>) -> Contact {
        Contact { bone: Some(bone), ..self }
    }

    /// The point where the reference shape violates the contact most, or comes nearest to it, with its position (mm) and gap
    /// (mm).
    pub fn worst_start(&self, mesh: &Mesh) -> Option<(MaterialPoint, Vector, f64)> {
        let room = |p: &Point| match (p.start, self.interface.allows) {
            (None, _) => f64::INFINITY,
            (Some(gap), Allows::Closed) => -gap.abs(),
            (Some(gap), Allows::ClosedOrOpen) => gap,
        };
        let worst = self.points.iter().min_by(|a, b| room(a).total_cmp(&room(b)))?;
        Some((worst.at, mesh.position(worst.at), worst.start?))
    }

    /// Whether the body may lift off.
    pub fn allows(&self) -> Allows {
        self.interface.allows
    }

    /// See [`ContactLaw::eases`].
    pub fn eases(&self) -> Option<f64> {
        self.interface.law.eases()
    }

    /// The elements of the host that it acts on.
    pub fn elements(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.of_element.len()).filter(|element| !self.of_element[*element].is_empty())
    }

    /// All points in an element at a state.
    pub fn points_at<'a>(&'a self, state: &'a ElementState<'_>) -> impl Iterator<Item = ContactPoint> + 'a {
        self.of_element[state.element].clone().map(|index| {
            let (point, position) = (&self.points[index], self.position(index, state));
            let (gap, response) = match self.meet(index, state) {
                Some((gap, response)) => (Some(gap), response),
                None => (None, Response::NONE),
            };
            ContactPoint {
                at: point.at,
                position,
                // as it is, not as it is measured while it relaxes
                gap: gap.map(|gap| gap.value + (1.0 - state.load) * point.relaxed),
                normal: gap.map_or([0.0; 3], |gap| gap.normal),
                pressure: -response.slope,
                area: point.weight,
                counted: true,
            }
        })
    }

    fn position(&self, index: usize, state: &ElementState<'_>) -> Vector {
        self.points[index].value(state.x)
    }

    /// Gap and response at a point; `None` where a contact that may open has no surface to meet.
    fn meet(&self, index: usize, state: &ElementState<'_>) -> Option<(Gap, Response)> {
        let point = &self.points[index];
        let (surface, position) = (self.interface.surface.as_ref(), self.position(index, state));
        let gap = match &self.bone {
            Some(bone) => carried::gap(surface, &bone.pose(state.controls), position),
            None => surface.gap(position),
        };
        let gap = match gap {
            Some(gap) => Gap { value: gap.value - (1.0 - state.load) * point.relaxed, ..gap },
            None if self.interface.allows == Allows::ClosedOrOpen => return None,
            // the body has slid off the surface it must stay on: no admissible state
            None => Gap { value: f64::NAN, normal: [f64::NAN; 3], curvature: [[f64::NAN; 3]; 3] },
        };
        let multiplier = state.multipliers.get(index).copied().unwrap_or(0.0);
        Some((gap, self.interface.law.eased(state.easing, gap.value, self.interface.allows, multiplier)))
    }
}

/// The part of a gap that should not be.
fn violation(allows: Allows, gap: f64) -> f64 {
    match allows {
        Allows::Closed => gap,
        Allows::ClosedOrOpen => gap.min(0.0),
    }
}

impl Point {
    /// sum N_a f_a
    fn value(&self, local: &[[f64; 64]; 3]) -> Vector {
        std::array::from_fn(|i| self.shape.iter().map(|(a, n)| n * local[i][*a]).sum())
    }

    /// force_ia += f_i N_a
    fn add_force(&self, f: Vector, force: &mut [[f64; 64]; 3]) {
        for i in 0..3 {
            for (a, n) in &self.shape {
                force[i][*a] += f[i] * n;
            }
        }
    }
}

impl Term for Contact {
    fn name(&self) -> &str {
        &self.name
    }

    fn acts_on(&self, element: usize) -> bool {
        !self.of_element[element].is_empty()
    }

    fn points(&self, element: usize) -> usize {
        self.of_element[element].len()
    }

    fn add(&self, state: &ElementState<'_>, want: Want, system: &mut ElementSystem) -> Contribution {
        let mut energy = 0.0;
        for index in self.of_element[state.element].clone() {
            let Some((gap, response)) = self.meet(index, state) else { continue };
            let point = &self.points[index];
            energy += point.weight * response.energy;
            if response == (Response { energy: response.energy, ..Response::NONE }) {
                continue;
            }
            point.add_force(gap.normal.map(|n| point.weight * response.slope * n), &mut system.force);
            if want == Want::Stiffness {
                for ((i, k), block) in PAIRS.into_iter().zip(&mut system.stiffness) {
                    let along = response.stiffness * gap.normal[i] * gap.normal[k];
                    let stiffness = point.weight * (along + response.slope * gap.curvature[i][k]);
                    for (a, n) in &point.shape {
                        for (b, m) in &point.shape {
                            block[64 * a + b] += stiffness * n * m;
                        }
                    }
                }
            }
        }
        Contribution { energy, det_f: None }
    }

    /// dg/dload = g(X) where that is relaxed.
    fn add_load_force(&self, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        for index in self.of_element[state.element].clone() {
            let point = &self.points[index];
            if point.relaxed == 0.0 {
                continue;
            }
            let Some((gap, response)) = self.meet(index, state) else { continue };
            let rate = point.weight * response.stiffness * point.relaxed;
            point.add_force(gap.normal.map(|n| rate * n), force);
        }
    }

    fn controls(&self) -> &[usize] {
        self.bone.as_ref().map_or(&[], |bone| bone.controls())
    }

    /// w (psi'' dg/dq n_i + psi' dn_i/dq) N_a where a bone carries the surface.
    fn add_control_force(&self, control: usize, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        let Some(twist) = self.bone.as_ref().and_then(|bone| bone.twist(control, state.controls)) else { return };
        for index in self.of_element[state.element].clone() {
            let Some((gap, response)) = self.meet(index, state) else { continue };
            let (point, position) = (&self.points[index], self.position(index, state));
            let along = point.weight * response.stiffness * carried::gap_rate(&gap, &twist, position);
            let turned = carried::normal_rate(&gap, &twist, position).map(|n| point.weight * response.slope * n);
            point.add_force(add_scaled(turned, along, gap.normal), force);
        }
    }

    fn as_contact(&self) -> Option<&Contact> {
        Some(self)
    }

    fn as_carried(&self) -> Option<&dyn Carried> {
        Some(self)
    }

    fn as_constraint(&self) -> Option<&dyn Constraint> {
        self.interface.law.gap_tolerance().map(|_| self as &dyn Constraint)
    }
}

impl Constraint for Contact {
    fn multipliers(&self) -> usize {
        self.points.len()
    }

    fn tolerance(&self) -> f64 {
        self.interface.law.gap_tolerance().unwrap_or(f64::INFINITY)
    }

    fn renew(&self, state: &ElementState<'_>, multipliers: &mut [f64]) -> f64 {
        let mut worst: f64 = 0.0;
        for index in self.of_element[state.element].clone() {
            let Some((_, response)) = self.meet(index, state) else {
                multipliers[index] = 0.0;
                continue;
            };
            // |g| where closed; where open, what the multiplier still holds, as a gap
            worst = worst.max((response.slope - multipliers[index]).abs() / self.interface.law.stiffness());
            multipliers[index] = response.slope;
        }
        worst
    }

    fn add_constraint_force(&self, state: &ElementState<'_>, z: &[f64], force: &mut [[f64; 64]; 3]) {
        for index in self.of_element[state.element].clone().filter(|index| z[*index] != 0.0) {
            let Some((gap, _)) = self.meet(index, state) else { continue };
            let point = &self.points[index];
            let scale = point.weight.sqrt() * z[index];
            point.add_force(gap.normal.map(|n| scale * n), force);
        }
    }

    fn constraint_rate(&self, state: &ElementState<'_>, du: &[[f64; 64]; 3], z: &mut [f64]) {
        for index in self.of_element[state.element].clone() {
            let point = &self.points[index];
            z[index] = match self.meet(index, state) {
                Some((gap, response)) if response.stiffness > 0.0 => {
                    point.weight.sqrt() * dot(gap.normal, point.value(du))
                }
                _ => 0.0,
            };
        }
    }

    fn add_control_rate(&self, control: usize, state: &ElementState<'_>, z: &mut [f64]) {
        let Some(twist) = self.bone.as_ref().and_then(|bone| bone.twist(control, state.controls)) else { return };
        for index in self.of_element[state.element].clone() {
            let Some((gap, response)) = self.meet(index, state) else { continue };
            if response.stiffness > 0.0 {
                let rate = carried::gap_rate(&gap, &twist, self.position(index, state));
                z[index] += self.points[index].weight.sqrt() * rate;
            }
        }
    }
}

impl Carried for Contact {
    fn bone(&self) -> Option<&Arc<Bone>> {
        self.bone.as_ref()
    }

    fn wrench(&self, state: &ElementState<'_>) -> Wrench {
        let mut wrench = Wrench::default();
        for index in self.of_element[state.element].clone() {
            let Some((gap, response)) = self.meet(index, state) else { continue };
            let push = -self.points[index].weight * response.slope;
            wrench.add_force(gap.normal.map(|n| push * n), self.position(index, state));
        }
        wrench
    }
}
