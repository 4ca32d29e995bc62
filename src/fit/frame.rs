//! One frame of a recording as a least-squares problem in the controls.

use super::placement::Marker;
use super::sensitivity::{Sensitivity, sensitivities};
use crate::error::{Error, Result};
use crate::forward::{Drive, Equilibrium, Solver};
use argmin::core::{Jacobian, Operator};
use nalgebra::DMatrix;
use std::cell::RefCell;

/// A marker that the frame shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Index in the list of fitted markers.
    pub marker: usize,
    /// Measured position, mm.
    pub position: [f64; 3],
    /// 1 / standard deviation, 1/mm.
    pub weight: f64,
}

/// Weighted residuals (m_k(q) - z_k) / sd_k of a frame and their derivatives; controls that are not unknown keep the values
/// of `drive`.
pub struct FrameProblem<'f, 'm> {
    markers: &'f [Marker],
    measured: Vec<Measured>,
    unknowns: &'f [usize],
    sensitivity: Sensitivity,
    drive: Drive,
    inner: RefCell<Inner<'f, 'm>>,
}

struct Inner<'f, 'm> {
    solver: &'f mut Solver<'m>,
    /// The equilibrium from which the next one is sought.
    base: Equilibrium,
    /// dx/dq at `base`, once it is known.
    directions: Option<Vec<Vec<f64>>>,
    /// The equilibrium last found, if it is another one.
    trial: Option<Equilibrium>,
}

impl<'f, 'm> FrameProblem<'f, 'm> {
    /// A frame that starts from an equilibrium.
    pub fn new(
        solver: &'f mut Solver<'m>,
        markers: &'f [Marker],
        measured: Vec<Measured>,
        unknowns: &'f [usize],
        sensitivity: Sensitivity,
        drive: Drive,
        start: Equilibrium,
    ) -> FrameProblem<'f, 'm> {
        let inner = RefCell::new(Inner { solver, base: start, directions: None, trial: None });
        FrameProblem { markers, measured, unknowns, sensitivity, drive, inner }
    }

    /// The equilibrium at which the derivative was last taken: the last one that the iteration accepted.
    pub fn into_equilibrium(self) -> Equilibrium {
        self.inner.into_inner().base
    }

    /// The controls of the model for values of the unknowns.
    fn drive(&self, q: &[f64]) -> Drive {
        let mut drive = self.drive.clone();
        for (control, value) in self.unknowns.iter().zip(q) {
            drive.controls[*control] = *value;
        }
        drive
    }

    /// Weighted residuals at an equilibrium, three per measured marker.
    fn residuals(&self, inner: &Inner<'_, '_>, at: &Equilibrium) -> Vec<f64> {
        let model = inner.solver.model();
        let x = model.current(&at.state);
        let residual = |m: &Measured| {
            let position = model.mesh().interpolate(self.markers[m.marker].point, &x);
            std::array::from_fn::<f64, 3, _>(|i| m.weight * (position[i] - m.position[i]))
        };
        self.measured.iter().flat_map(residual).collect()
    }

    fn residuals_at(&self, q: &[f64]) -> Result<Vec<f64>> {
        let drive = self.drive(q);
        let inner = &mut *self.inner.borrow_mut();
        let here = |at: &Equilibrium| at.state.controls == drive.controls && at.state.load == drive.load;
        if here(&inner.base) {
            inner.trial = None;
            return Ok(self.residuals(inner, &inner.base));
        }
        let found = match &inner.directions {
            // to first order the body moves along the sensitivities
            Some(directions) => {
                let mut guess = inner.base.state.clone();
                for (control, direction) in self.unknowns.iter().zip(directions) {
                    let by = drive.controls[*control] - inner.base.state.controls[*control];
                    inner.solver.model().advance(&mut guess, direction, by);
                }
                inner.solver.equilibrium_near(&guess, &inner.base.state, &drive)?
            }
            None => inner.solver.equilibrium_near(&inner.base.state, &inner.base.state, &drive)?,
        };
        let residuals = self.residuals(inner, &found);
        inner.trial = Some(found);
        Ok(residuals)
    }

    fn jacobian_at(&self, q: &[f64]) -> Result<DMatrix<f64>> {
        let drive = self.drive(q);
        let matches = |at: &Equilibrium| at.state.controls == drive.controls;
        if !self.inner.borrow().trial.as_ref().is_some_and(matches) && !matches(&self.inner.borrow().base) {
            self.residuals_at(q)?;
        }
        let inner = &mut *self.inner.borrow_mut();
        if let Some(trial) = inner.trial.take_if(|trial| matches(trial)) {
            inner.base = trial;
        }
        let directions = sensitivities(self.sensitivity, inner.solver, &inner.base, self.unknowns)?;
        let model = inner.solver.model();
        let mut j = DMatrix::zeros(3 * self.measured.len(), self.unknowns.len());
        for (column, (control, direction)) in self.unknowns.iter().zip(&directions).enumerate() {
            let du = model.displacement_rate(&inner.base.state, *control, direction);
            for (row, m) in self.measured.iter().enumerate() {
                let change = model.mesh().interpolate(self.markers[m.marker].point, &du);
                for (i, change) in change.iter().enumerate() {
                    j[(3 * row + i, column)] = m.weight * change;
                }
            }
        }
        inner.directions = Some(directions);
        Ok(j)
    }
}

impl Operator for FrameProblem<'_, '_> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;

    fn apply(&self, q: &Vec<f64>) -> std::result::Result<Vec<f64>, argmin::core::Error> {
        self.residuals_at(q).map_err(Error::into)
    }
}

impl Jacobian for FrameProblem<'_, '_> {
    type Param = Vec<f64>;
    type Jacobian = DMatrix<f64>;

    fn jacobian(&self, q: &Vec<f64>) -> std::result::Result<DMatrix<f64>, argmin::core::Error> {
        self.jacobian_at(q).map_err(Error::into)
    }
}
