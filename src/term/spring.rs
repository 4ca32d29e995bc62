//! Springs from material points to where they were at rest: a foundation under faces, or attachments of single points.
//!
//! Pi = sum over points 1/2 u . k u with a symmetric matrix k, so that
//!   dPi/du_ia = sum k_ij u_j N_a,   d2Pi/du du = sum k_ij N_a N_b

use super::{Contribution, ElementState, ElementSystem, Term, Want};
use crate::material::PAIRS;
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{IDENTITY, Matrix, apply, dot, norm};
use crate::mesh::face::Face;
use crate::mesh::{MaterialPoint, Mesh, position_and_jacobian};

/// Springs between a host and space.
pub struct Springs {
    name: &'static str,
    /// The springs in each element.
    points: Vec<Vec<Spring>>,
}

/// One spring.
struct Spring {
    /// N_a at its point.
    values: [f64; 64],
    /// mN/mm.
    stiffness: Matrix,
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
                let (_, jacobian) = position_and_jacobian(mesh.element, &local, xi);
                let area = face.side.area_vector(&jacobian);
                let size = norm(area);
                let direction: Matrix = match resists {
                    Resists::All => IDENTITY,
                    // n (x) n; a collapsed point has no area and no normal
                    Resists::Normal => area.map(|a| area.map(|b| a * b / (size * size).max(f64::MIN_POSITIVE))),
                };
                let stiffness = direction.map(|row| row.map(|d| weight * size * stiffness * d));
                points[face.element].push(Spring { values: mesh.element.values(xi), stiffness });
            }
        }
        Springs { name: "spring", points }
    }

    /// A spring at each of some material points, its stiffness in mN/mm.
    pub fn attachments(mesh: &Mesh, ties: &[(MaterialPoint, f64)]) -> Springs {
        let mut points: Vec<Vec<Spring>> = (0..mesh.elements()).map(|_| Vec::new()).collect();
        for (at, stiffness) in ties {
            let stiffness = IDENTITY.map(|row| row.map(|d| stiffness * d));
            points[at.element].push(Spring { values: mesh.element.values(at.xi), stiffness });
        }
        Springs { name: "attachment", points }
    }
}

impl Term for Springs {
    fn name(&self) -> &str {
        self.name
    }

    fn acts_on(&self, element: usize) -> bool {
        !self.points[element].is_empty()
    }

    fn add(&self, state: &ElementState<'_>, want: Want, system: &mut ElementSystem) -> Contribution {
        let mut energy = 0.0;
        for Spring { values, stiffness } in &self.points[state.element] {
            let u = state.u.map(|u| u.iter().zip(values).map(|(u, n)| u * n).sum());
            let force = apply(stiffness, u);
            energy += 0.5 * dot(u, force);
            for i in 0..3 {
                for (target, n) in system.force[i].iter_mut().zip(values) {
                    *target += force[i] * n;
                }
            }
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
}
