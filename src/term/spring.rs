//! Springs from material points to where they were at rest: a foundation under faces, or attachments of single points.
//!
//! Pi = sum over points 1/2 u . k u with a symmetric matrix k, so that
//! ```text
//! dPi/du_ia = sum k_ij u_j N_a,   d2Pi/du du = sum k_ij N_a N_b
//! ```
//! Where a bone carries the other ends of attachments, u is the motion beyond that of the bone.

use super::bone::{Bone, Carried, Wrench};
use super::{Contribution, ElementState, ElementSystem, Term, Want};
use crate::material::PAIRS;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{IDENTITY, Matrix, Vector, add_scaled, apply, dot, norm, subtract};
use crate::mesh::face::Face;
use crate::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use std::sync::Arc;

/// Springs between a host and space, or a bone.
pub struct Springs {
    name: String,
    bone: Option<Arc<Bone>>,
    /// The springs in each element.
    points: Vec<Vec<Spring>>,
}

/// One spring.
struct Spring {
    /// N_a at its point.
    values: [f64; 64],
    /// mN/mm.
    stiffness: Matrix,
    /// Its point at rest, mm.
    reference: Vector,
}

/// What a foundation resists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resists {
    /// Every motion.
    All,
    /// Motion along the normal of the reference surface.
    Normal,
}

impl Springs {
    /// A foundation of `stiffness` in kPa/mm, a force per reference area and motion, under `faces`; `gauss` points per
    /// direction on each.
    pub fn foundation(mesh: &Mesh, faces: &[Face], stiffness: f64, resists: Resists, gauss: usize) -> Springs {
        let rule = GaussRule::new(gauss);
        let mut points: Vec<Vec<Spring>> = (0..mesh.elements()).map(|_| Vec::new()).collect();
        for face in faces {
            let local = mesh.local(face.element);
            for (st, weight) in rule.square() {
                let xi = face.side.lift(st);
                let (reference, jacobian) = position_and_jacobian(mesh.element, &local, xi);
                let area = face.side.area_vector(&jacobian);
                let size = norm(area);
                let direction: Matrix = match resists {
                    Resists::All => IDENTITY,
                    // n (x) n; a collapsed point has no area and no normal
                    Resists::Normal => area.map(|a| area.map(|b| a * b / (size * size).max(f64::MIN_POSITIVE))),
                };
                let stiffness = direction.map(|row| row.map(|d| weight * size * stiffness * d));
                points[face.element].push(Spring { values: mesh.element.values(xi), stiffness, reference });
            }
        }
        Springs { name: "spring".into(), bone: None, points }
    }

    /// A spring at each of some material points, its stiffness in mN/mm.
    pub fn attachments(mesh: &Mesh, ties: &[(MaterialPoint, f64)]) -> Springs {
        let mut points: Vec<Vec<Spring>> = (0..mesh.elements()).map(|_| Vec::new()).collect();
        for (at, stiffness) in ties {
            let stiffness = IDENTITY.map(|row| row.map(|d| stiffness * d));
            let reference = mesh.position(*at);
            points[at.element].push(Spring { values: mesh.element.values(at.xi), stiffness, reference });
        }
        Springs { name: "attachment".into(), bone: None, points }
    }

    /// The same springs with their other ends on a bone.
    pub fn on(self, bone: Arc<Bone>) -> Springs {
        Springs { name: format!("{} on {}", self.name, bone.name()), bone: Some(bone), ..self }
    }
}

impl Spring {
    /// Its elongation at a state, mm: the motion of its point, less that of its other end.
    fn elongation(&self, bone: Option<&Arc<Bone>>, state: &ElementState<'_>) -> Vector {
        let u = state.u.map(|u| u.iter().zip(&self.values).map(|(u, n)| u * n).sum());
        bone.map_or(u, |bone| subtract(u, bone.pose(state.controls).motion(self.reference)))
    }

    /// force_ia += f_i N_a
    fn add_force(&self, f: Vector, force: &mut [[f64; 64]; 3]) {
        for i in 0..3 {
            for (target, n) in force[i].iter_mut().zip(&self.values) {
                *target += f[i] * n;
            }
        }
    }
}

impl Term for Springs {
    fn name(&self) -> &str {
        &self.name
    }

    fn acts_on(&self, element: usize) -> bool {
        !self.points[element].is_empty()
    }

    fn add(&self, state: &ElementState<'_>, want: Want, system: &mut ElementSystem) -> Contribution {
        let mut energy = 0.0;
        for spring in &self.points[state.element] {
            let Spring { values, stiffness, .. } = spring;
            let u = spring.elongation(self.bone.as_ref(), state);
            let force = apply(stiffness, u);
            energy += 0.5 * dot(u, force);
            spring.add_force(force, &mut system.force);
            if want == Want::Stiffness {
                for (block, (i, k)) in system.stiffness.iter_mut().zip(PAIRS) {
                    for (row, n) in block.chunks_exact_mut(64).zip(values).filter(|(_, n)| **n != 0.0) {
                        for (target, m) in row.iter_mut().zip(values) {
                            *target += stiffness[i][k] * n * m;
                        }
                    }
                }
            }
        }
        Contribution { energy, det_f: None }
    }

    fn points(&self, element: usize) -> usize {
        self.points[element].len()
    }

    fn controls(&self) -> &[usize] {
        self.bone.as_ref().map_or(&[], |bone| bone.controls())
    }

    /// - k v N_a, with the velocity v of the other end per unit of the control.
    fn add_control_force(&self, control: usize, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        let Some(bone) = &self.bone else { return };
        let Some(twist) = bone.twist(control, state.controls) else { return };
        let pose = bone.pose(state.controls);
        for spring in &self.points[state.element] {
            let velocity = twist.velocity(pose.place(spring.reference));
            spring.add_force(apply(&spring.stiffness, velocity).map(|f| -f), force);
        }
    }

    fn as_carried(&self) -> Option<&dyn Carried> {
        Some(self)
    }
}

impl Carried for Springs {
    fn bone(&self) -> Option<&Arc<Bone>> {
        self.bone.as_ref()
    }

    fn wrench(&self, state: &ElementState<'_>) -> Wrench {
        let mut wrench = Wrench::default();
        for spring in &self.points[state.element] {
            let pull = apply(&spring.stiffness, spring.elongation(self.bone.as_ref(), state));
            let motion =
                self.bone.as_ref().map_or([0.0; 3], |bone| bone.pose(state.controls).motion(spring.reference));
            wrench.add_force(pull.map(|f| -f), add_scaled(spring.reference, 1.0, motion));
        }
        wrench
    }
}
