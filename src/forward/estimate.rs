//! An estimate of the discretisation error: what Newton steps on halved elements move.
//!
//! The space of the halved elements contains the one that was solved in. With the solution carried over, its residual r
//! there is what the coarse space could not see, and a few steps
//!   d = - K^-1 r,   until |d| is a tenth of the way,   error at a point = |way| / (1 - 2^-p)
//! lead nearly to the solution on halved elements. One step is not enough where bodies bend much: its stretch is as large as
//! the second order of its rotation, and on the beam it moves markers by up to ten times too much. The divisor adds what
//! the halved elements still lack where errors fall with order p. It is taken as 2: solutions with edges in their loads or
//! muscles have about 1 or 2, smooth ones up to 4, where the divisor hardly matters.

use super::{Settings, Solver, Work};
use crate::error::Result;
use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::MaterialPoint;
use crate::model::halved::Halved;
use crate::model::{Model, State};
use std::time::Instant;

/// 1 / (1 - 2^-p) with p = 2: the error over the difference to halved elements.
pub const BEYOND_HALVED: f64 = 4.0 / 3.0;

/// Steps end with one that is no more than this part of the whole way.
const LAST_STEP: f64 = 0.1;

/// Estimates the errors of states of one model.
pub struct Estimator<'m> {
    coarse: &'m Model,
    halved: &'m Halved,
    solver: Solver<'m>,
    seconds: f64,
}

impl<'m> Estimator<'m> {
    /// Of the states of `coarse`, whose scene is halved in `halved`.
    ///
    /// # Errors
    /// Where the factor does not fit into memory.
    pub fn new(coarse: &'m Model, halved: &'m Halved, settings: Settings) -> Result<Estimator<'m>> {
        let solver = Solver::new(&halved.built.model, settings)?;
        Ok(Estimator { coarse, halved, solver, seconds: 0.0 })
    }

    /// The corrected state on the halved elements for an equilibrium of the coarse model.
    ///
    /// # Errors
    /// Where the tangent on the halved elements cannot be factorised, or they have no equilibrium there.
    pub fn corrected(&mut self, state: &State) -> Result<State> {
        let start = Instant::now();
        let carried = self.halved.carry(self.coarse, state);
        let corrected = self.solver.corrected(&carried, LAST_STEP);
        self.seconds += start.elapsed().as_secs_f64();
        corrected
    }

    /// By how much material points of the coarse model are estimated to be off, mm: from where they are to where they belong.
    pub fn shift(&self, state: &State, corrected: &State, points: &[MaterialPoint]) -> Vec<Vector> {
        let (coarse, fine) = (self.coarse.mesh(), self.halved.built.model.mesh());
        let moved = |at: &MaterialPoint| {
            let better = fine.interpolate(self.halved.point(*at), &corrected.u);
            subtract(better, coarse.interpolate(*at, &state.u)).map(|d| BEYOND_HALVED * d)
        };
        points.iter().map(moved).collect()
    }

    /// The largest estimated error at a corner of a halved element, mm.
    pub fn largest(&self, state: &State, corrected: &State) -> f64 {
        let carried = self.halved.carry(self.coarse, state);
        let mesh = self.halved.built.model.mesh();
        let values = (0..mesh.parameters.len()).filter(|k| mesh.parameter_derivative[*k] == 0);
        BEYOND_HALVED * values.map(|k| norm(subtract(corrected.u[k], carried.u[k]))).fold(0.0, f64::max)
    }

    /// See [`Solver::tangent_states`].
    pub fn tangent_states(&self) -> Option<[State; 2]> {
        self.solver.tangent_states()
    }

    /// See [`Solver::restore_tangent`].
    ///
    /// # Errors
    /// Where the tangent cannot be factorised.
    pub fn restore_tangent(&mut self, states: Option<&[State; 2]>) -> Result<()> {
        self.solver.restore_tangent(states)
    }

    /// The work on the halved elements.
    pub fn work(&self) -> Work {
        self.solver.work()
    }

    /// The wall time of all corrections, s.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}
