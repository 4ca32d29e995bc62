//! Rigid ties of material points to space or to a bone: sum N_a x_a = y(q), exactly.
//!
//! With multipliers l (mN), renewed by the outer loop, and the gap g = x - y:
//! ```text
//! Pi = sum over ties l . g + k/2 g . g
//! dPi/du_ia = (l + k g)_i N_a,  d2Pi/du_ia du_kb = k delta_ik N_a N_b
//! ```
//! Multipliers and not elimination: a point inside an element or a face hangs on all its parameters, and with one of
//! them eliminated each of its neighbours would couple with each. So the tangent keeps its pattern, and stays definite.

use super::bone::{Bone, Carried, Wrench};
use super::constraint::Constraint;
use super::{Contribution, ElementState, ElementSystem, Term, Want};
use crate::material::PAIRS;
use crate::math::tensor::{Vector, add_scaled, norm, subtract};
use crate::mesh::{MaterialPoint, Mesh};
use std::sync::Arc;

/// Ties of some material points to one body.
pub struct RigidTies {
    name: String,
    /// `None` where it is space.
    bone: Option<Arc<Bone>>,
    ties: Vec<Tie>,
    /// The ties in each element of the host.
    of_element: Vec<Vec<usize>>,
    /// k, mN/mm.
    stiffness: f64,
    /// The gap that may remain, mm.
    tolerance: f64,
}

/// One tie; its multipliers are 3 k to 3 k + 2 for the k-th.
struct Tie {
    /// N_a at its point.
    values: [f64; 64],
    /// X, mm.
    reference: Vector,
}

/// A tie at a state.
struct Met {
    /// y, mm.
    anchor: Vector,
    /// g, mm.
    gap: Vector,
    /// l + k g, mN.
    force: Vector,
}

impl RigidTies {
    /// Ties of `points` to a bone, or to where they were, closed to a gap of `tolerance` (mm). The stiffness k (mN/mm) does
    /// not change what is found: a larger one takes fewer rounds to close the gaps, until the tangent becomes inaccurate.
    pub fn new(
        mesh: &Mesh,
        points: &[MaterialPoint],
        bone: Option<Arc<Bone>>,
        stiffness: f64,
        tolerance: f64,
    ) -> RigidTies {
        let mut of_element = vec![Vec::new(); mesh.elements()];
        let mut ties = Vec::with_capacity(points.len());
        for at in points {
            of_element[at.element].push(ties.len());
            ties.push(Tie { values: mesh.element.values(at.xi), reference: mesh.position(*at) });
        }
        let on = bone.as_ref().map(|bone| format!(" on {}", bone.name())).unwrap_or_default();
        RigidTies { name: format!("rigid attachment{on}"), bone, ties, of_element, stiffness, tolerance }
    }

    fn meet(&self, index: usize, state: &ElementState<'_>) -> Met {
        let tie = &self.ties[index];
        let motion = self.bone.as_ref().map_or([0.0; 3], |bone| bone.pose(state.controls).motion(tie.reference));
        let gap = subtract(tie.value(state.u), motion);
        let multiplier = |i: usize| state.multipliers.get(3 * index + i).copied().unwrap_or(0.0);
        let force = std::array::from_fn(|i| multiplier(i) + self.stiffness * gap[i]);
        Met { anchor: add_scaled(tie.reference, 1.0, motion), gap, force }
    }
}

impl Tie {
    /// sum N_a f_a
    fn value(&self, local: &[[f64; 64]; 3]) -> Vector {
        local.map(|f| f.iter().zip(&self.values).map(|(f, n)| f * n).sum())
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

impl Term for RigidTies {
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
        for &index in &self.of_element[state.element] {
            let (tie, Met { gap, force, .. }) = (&self.ties[index], self.meet(index, state));
            // l . g + k/2 g . g with l = f - k g
            energy += (0..3).map(|i| (force[i] - 0.5 * self.stiffness * gap[i]) * gap[i]).sum::<f64>();
            tie.add_force(force, &mut system.force);
            if want == Want::Stiffness {
                for (block, _) in system.stiffness.iter_mut().zip(PAIRS).filter(|(_, (i, k))| i == k) {
                    for (row, n) in block.chunks_exact_mut(64).zip(&tie.values).filter(|(_, n)| **n != 0.0) {
                        row.iter_mut().zip(&tie.values).for_each(|(target, m)| *target += self.stiffness * n * m);
                    }
                }
            }
        }
        Contribution { energy, det_f: None }
    }

    fn controls(&self) -> &[usize] {
        self.bone.as_ref().map_or(&[], |bone| bone.controls())
    }

    /// - k v_i N_a
    fn add_control_force(&self, control: usize, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        let Some(twist) = self.bone.as_ref().and_then(|bone| bone.twist(control, state.controls)) else { return };
        for &index in &self.of_element[state.element] {
            let velocity = twist.velocity(self.meet(index, state).anchor);
            self.ties[index].add_force(velocity.map(|v| -self.stiffness * v), force);
        }
    }

    fn as_constraint(&self) -> Option<&dyn Constraint> {
        Some(self)
    }

    fn as_carried(&self) -> Option<&dyn Carried> {
        Some(self)
    }
}

impl Constraint for RigidTies {
    fn multipliers(&self) -> usize {
        3 * self.ties.len()
    }

    fn tolerance(&self) -> f64 {
        self.tolerance
    }

    fn renew(&self, state: &ElementState<'_>, multipliers: &mut [f64]) -> f64 {
        let mut worst: f64 = 0.0;
        for &index in &self.of_element[state.element] {
            let Met { gap, force, .. } = self.meet(index, state);
            worst = worst.max(norm(gap));
            multipliers[3 * index..3 * index + 3].copy_from_slice(&force);
        }
        worst
    }

    fn add_constraint_force(&self, state: &ElementState<'_>, z: &[f64], force: &mut [[f64; 64]; 3]) {
        for &index in &self.of_element[state.element] {
            self.ties[index].add_force(std::array::from_fn(|i| z[3 * index + i]), force);
        }
    }

    fn constraint_rate(&self, state: &ElementState<'_>, du: &[[f64; 64]; 3], z: &mut [f64]) {
        for &index in &self.of_element[state.element] {
            z[3 * index..3 * index + 3].copy_from_slice(&self.ties[index].value(du));
        }
    }

    fn add_control_rate(&self, control: usize, state: &ElementState<'_>, z: &mut [f64]) {
        let Some(twist) = self.bone.as_ref().and_then(|bone| bone.twist(control, state.controls)) else { return };
        for &index in &self.of_element[state.element] {
            let velocity = twist.velocity(self.meet(index, state).anchor);
            z[3 * index..3 * index + 3].iter_mut().zip(velocity).for_each(|(z, v)| *z -= v);
        }
    }
}

impl Carried for RigidTies {
    fn bone(&self) -> Option<&Arc<Bone>> {
        self.bone.as_ref()
    }

    fn wrench(&self, state: &ElementState<'_>) -> Wrench {
        let mut wrench = Wrench::default();
        for &index in &self.of_element[state.element] {
            let Met { anchor, force, .. } = self.meet(index, state);
            wrench.add_force(force.map(|f| -f), anchor);
        }
        wrench
    }
}
