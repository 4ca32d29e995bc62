//! The constraints of a model as a whole: renewing their multipliers, and the operator B with its transpose.

use super::{Model, State};
use crate::term::ElementState;

/// What renewing the multipliers found.
#[derive(Debug, Clone, PartialEq)]
pub struct Renewal {
    /// The new multipliers, as in [`State::multipliers`].
    pub multipliers: Vec<Vec<f64>>,
    /// The term whose gap is worst in relation to its tolerance.
    pub term: usize,
    /// That gap, mm.
    pub gap: f64,
    /// Its tolerance, mm.
    pub tolerance: f64,
}

impl Model {
    /// New multipliers at a state in balance with its own; `None` for a model without constraints.
    pub fn renew_multipliers(&self, state: &State) -> Option<Renewal> {
        let mut worst: Option<Renewal> = None;
        let mut multipliers = state.multipliers.clone();
        let mut found = Vec::new();
        for (term, constraint) in self.terms().iter().enumerate().filter_map(|(k, t)| Some((k, t.as_constraint()?))) {
            let mut gap: f64 = 0.0;
            for element in self.elements_of(term) {
                self.with_own(state, term, element, |at| {
                    gap = gap.max(constraint.renew(at, &mut multipliers[term]));
                });
            }
            found.push((term, gap, constraint.tolerance()));
        }
        for (term, coupling) in self.couplings().filter(|(_, c)| c.multipliers() > 0) {
            let gap = self.with_body(state, term, |body| coupling.renew(body, &mut multipliers[term]));
            found.push((term, gap, coupling.tolerance()));
        }
        for (term, gap, tolerance) in found {
            if worst.as_ref().is_none_or(|w| gap * w.tolerance > w.gap * tolerance) {
                worst = Some(Renewal { multipliers: Vec::new(), term, gap, tolerance });
            }
        }
        worst.map(|worst| Renewal { multipliers, ..worst })
    }

    /// z = B dx over the closed points of all constraints, for a direction in the unknowns.
    pub fn constraint_rate(&self, state: &State, direction: &[f64]) -> Vec<Vec<f64>> {
        self.constraint_rate_along(state, &self.displacement_of(direction))
    }

    /// sqrt(w) dg/dq over the closed points for a control q that moves what they meet, or faces with them; `None` for one
    /// that moves neither.
    pub fn constraint_control_rate(&self, state: &State, control: usize) -> Option<Vec<Vec<f64>>> {
        let moved = self.supports().rate(self.mesh(), control, &state.controls);
        let own = |term: &usize| self.terms()[*term].controls().contains(&control);
        let constraints = self.terms().iter().enumerate().filter_map(|(k, t)| Some((k, t.as_constraint()?)));
        let meant: Vec<_> = constraints.filter(|(term, _)| own(term)).collect();
        if moved.is_none() && meant.is_empty() {
            return None;
        }
        let still = || state.multipliers.iter().map(|m| vec![0.0; m.len()]).collect();
        let mut z = moved.map_or_else(still, |moved| self.constraint_rate_along(state, &moved));
        for (term, constraint) in meant {
            for element in self.elements_of(term) {
                self.with_own(state, term, element, |at| constraint.add_control_rate(control, at, &mut z[term]));
            }
        }
        Some(z)
    }

    /// B du for any change of the displacement, one triple per global parameter.
    fn constraint_rate_along(&self, state: &State, du: &[[f64; 3]]) -> Vec<Vec<f64>> {
        let mut z: Vec<Vec<f64>> = state.multipliers.iter().map(|m| vec![0.0; m.len()]).collect();
        for (term, constraint) in self.terms().iter().enumerate().filter_map(|(k, t)| Some((k, t.as_constraint()?))) {
            for element in self.elements_of(term) {
                let local = self.mesh().local_of(element, du);
                self.with_own(state, term, element, |at| constraint.constraint_rate(at, &local, &mut z[term]));
            }
        }
        for (term, coupling) in self.couplings().filter(|(_, c)| c.multipliers() > 0) {
            self.with_body(state, term, |body| coupling.constraint_rate(body, du, &mut z[term]));
        }
        z
    }

    /// B^T z for the unknowns.
    pub fn constraint_force(&self, state: &State, z: &[Vec<f64>]) -> Vec<f64> {
        let mut total = vec![0.0; self.numbering.unknowns()];
        for (term, constraint) in self.terms().iter().enumerate().filter_map(|(k, t)| Some((k, t.as_constraint()?))) {
            for element in self.elements_of(term) {
                let mut force = [[0.0; 64]; 3];
                self.with_own(state, term, element, |at| constraint.add_constraint_force(at, &z[term], &mut force));
                self.scatter(element, &force, &mut total);
            }
        }
        for (term, coupling) in self.couplings().filter(|(_, c)| c.multipliers() > 0) {
            let pairs = self.with_body(state, term, |body| coupling.constraint_force(body, &z[term]));
            self.scatter_pairs(&pairs, &mut total);
        }
        total
    }

    /// Calls `f` with the local view of a state that a term has in one element.
    pub fn with_own<R>(
        &self,
        state: &State,
        term: usize,
        element: usize,
        f: impl FnOnce(&ElementState<'_>) -> R,
    ) -> R {
        self.with_local(state, element, |at| f(&ElementState { multipliers: &state.multipliers[term], ..*at }))
    }

    fn elements_of(&self, term: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.mesh().elements()).filter(move |element| self.terms()[term].acts_on(*element))
    }
}
