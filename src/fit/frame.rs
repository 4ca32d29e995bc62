//! One frame of a recording as a least-squares problem in the controls.

use super::free_head;
use super::gauss_newton::{LeastSquares, Range};
use super::objective::{Instant, Objective as _, Objectives, Past, Sum};
use super::placement::Marker;
use super::sensitivity::{Reuse, Sensitivity, rates_at, sensitivities};
use crate::error::{Error, Result};
use crate::forward::{Drive, Equilibrium, Solver};
use crate::math::motion::Motion;
use crate::mesh::MaterialPoint;
use argmin::core::{Jacobian, Operator};
use nalgebra::{DMatrix, DVector};
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
    reuse: Reuse,
    drive: Drive,
    aims: Aims<'f>,
    /// Whether the head moves as it fits best.
    free_head: bool,
    inner: RefCell<Inner<'f, 'm>>,
}

/// What a frame minimises.
#[derive(Clone, Copy)]
pub struct Aims<'f> {
    /// All parts.
    pub objectives: &'f Objectives,
    /// Time of the frame, s.
    pub time_s: f64,
    /// Frames before it, the last one first.
    pub before: &'f [Past],
}

impl Aims<'_> {
    /// All but the markers, by the controls in parts of their ranges.
    pub fn rest(&self, q: &[f64]) -> Sum {
        let a = self.objectives.parts_of(q);
        self.objectives.rest(&Instant { time_s: self.time_s, a: &a, before: self.before })
    }

    /// Name and value of every part; the markers first.
    pub fn values(&self, q: &[f64], residuals: &[f64]) -> Vec<(String, f64)> {
        let a = self.objectives.parts_of(q);
        let rest = self.objectives.values(&Instant { time_s: self.time_s, a: &a, before: self.before });
        let all = std::iter::once(("markers", self.objectives.loss.cost(residuals))).chain(rest);
        all.map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// The second derivative of what ties the frame to those before, by the controls in their units.
    pub fn tied(&self, q: &[f64]) -> DMatrix<f64> {
        let a = self.objectives.parts_of(q);
        let mut sum = Sum::zero(q.len());
        if let Some(smoothness) = &self.objectives.smoothness {
            smoothness.add(&Instant { time_s: self.time_s, a: &a, before: self.before }, &mut sum);
        }
        let sizes: Vec<f64> = self.objectives.sizes().collect();
        DMatrix::from_fn(q.len(), q.len(), |a, b| sum.hessian[(a, b)] / (sizes[a] * sizes[b]))
    }

    /// The second derivative of all but the markers, by the controls in their units.
    pub fn prior(&self, q: &[f64]) -> DMatrix<f64> {
        let sizes: Vec<f64> = self.objectives.sizes().collect();
        let hessian = self.rest(q).hessian;
        DMatrix::from_fn(q.len(), q.len(), |a, b| hessian[(a, b)] / (sizes[a] * sizes[b]))
    }
}

impl LeastSquares for Aims<'_> {
    fn cost(&self, q: &[f64], residuals: &[f64]) -> f64 {
        self.objectives.loss.cost(residuals) + self.rest(q).value
    }

    fn model(&self, q: &[f64], residuals: &[f64], j: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
        let (mut g, mut h) = self.objectives.loss.model(residuals, j);
        let rest = self.rest(q);
        g.iter_mut().zip(rest.gradient.iter().zip(self.objectives.sizes())).for_each(|(g, (r, size))| *g += r / size);
        h += self.prior(q);
        (g, h)
    }
}

impl LeastSquares for FrameProblem<'_, '_> {
    fn renew(&self) {
        self.inner.borrow_mut().renew = true;
    }

    fn cost(&self, q: &[f64], residuals: &[f64]) -> f64 {
        self.aims.cost(q, residuals)
    }

    fn model(&self, q: &[f64], residuals: &[f64], j: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
        self.aims.model(q, residuals, j)
    }
}

struct Inner<'f, 'm> {
    solver: &'f mut Solver<'m>,
    /// The equilibrium from which the next one is sought.
    base: Equilibrium,
    /// dx/dq at `base`, once it is known.
    directions: Option<Directions>,
    /// Whether sensitivities that are kept are not wanted.
    renew: bool,
    /// The equilibrium last found, if it is another one.
    trial: Option<Equilibrium>,
    /// d(weighted residual)/dq at `base` with the head held, where that is free.
    held_head: Option<DMatrix<f64>>,
}

/// dx/dq for the unknowns, one direction each.
#[derive(Debug, Clone)]
pub struct Directions {
    /// One direction in the unknowns of the balance per control.
    pub columns: Vec<Vec<f64>>,
    /// Whether they were found at the equilibrium where they are used, and not kept from another.
    pub fresh: bool,
}

impl Directions {
    /// D + (dx - D dq) dq^T / |dq|^2 for the step dq from one equilibrium to another; dq in parts of each control's range.
    fn learn(&mut self, dx: &[f64], dq: &[f64], ranges: &[f64]) {
        let parts: Vec<f64> = dq.iter().zip(ranges).map(|(d, r)| d / r).collect();
        let square: f64 = parts.iter().map(|d| d * d).sum();
        if square == 0.0 {
            return;
        }
        let mut missed = dx.to_vec();
        for (column, by) in self.columns.iter().zip(dq) {
            missed.iter_mut().zip(column).for_each(|(m, d)| *m -= by * d);
        }
        for ((column, part), range) in self.columns.iter_mut().zip(&parts).zip(ranges) {
            column.iter_mut().zip(&missed).for_each(|(d, m)| *d += m * part / (square * range));
        }
    }
}

impl<'f, 'm> FrameProblem<'f, 'm> {
    /// A frame that starts from an equilibrium, with its sensitivities if they are known.
    #[allow(clippy::too_many_arguments)] // what a frame is made of
    pub fn new(
        solver: &'f mut Solver<'m>,
        markers: &'f [Marker],
        measured: Vec<Measured>,
        unknowns: &'f [usize],
        (sensitivity, reuse): (Sensitivity, Reuse),
        (drive, aims): (Drive, Aims<'f>),
        start: Equilibrium,
        directions: Option<Directions>,
    ) -> FrameProblem<'f, 'm> {
        let inner =
            RefCell::new(Inner { solver, base: start, directions, renew: false, trial: None, held_head: None });
        FrameProblem { markers, measured, unknowns, sensitivity, reuse, drive, aims, free_head: false, inner }
    }

    /// With a head that moves as it fits best.
    pub fn with_free_head(self, free_head: bool) -> Self {
        FrameProblem { free_head, ..self }
    }

    /// The derivative that was last asked for with the head held, where the head is free.
    pub fn take_held_head(&self) -> Option<DMatrix<f64>> {
        self.inner.borrow_mut().held_head.take()
    }

    /// The motion that takes the measured markers nearest to those of the model, where the head is free.
    fn back(&self, model: &[[f64; 3]]) -> Motion {
        let loss = self.aims.objectives.loss;
        let nearest = if self.free_head { free_head::nearest(model, &self.measured, loss) } else { None };
        nearest.unwrap_or(Motion::REST)
    }

    /// The equilibrium at which the derivative was last asked for, the last one that the iteration accepted, and the
    /// sensitivities there.
    pub fn into_equilibrium(self) -> (Equilibrium, Option<Directions>) {
        let inner = self.inner.into_inner();
        (inner.base, inner.directions)
    }

    /// The equilibrium last found, whether or not the derivative was asked for there, and the sensitivities if it was.
    pub fn into_found(self) -> (Equilibrium, Option<Directions>) {
        let Inner { base, directions, trial, .. } = self.inner.into_inner();
        match trial {
            Some(trial) => (trial, None),
            None => (base, directions),
        }
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
        let place = |m: &Measured| model.mesh().interpolate(self.markers[m.marker].point, &x);
        let positions: Vec<[f64; 3]> = self.measured.iter().map(place).collect();
        let back = self.back(&positions);
        let residual = |(m, position): (&Measured, &[f64; 3])| {
            let measured = back.place(m.position);
            std::array::from_fn::<f64, 3, _>(|i| m.weight * (position[i] - measured[i]))
        };
        self.measured.iter().zip(&positions).flat_map(residual).collect()
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
            // to first order in t the body moves along the sensitivities
            Some(directions) => {
                let mut guess = inner.base.state.clone();
                for (control, direction) in self.unknowns.iter().zip(&directions.columns) {
                    let range = Range::of(&inner.solver.model().controls()[*control]);
                    let (from, to) = (inner.base.state.controls[*control], drive.controls[*control]);
                    inner.solver.model().advance(&mut guess, direction, range.even_change(from, to));
                }
                inner.solver.equilibrium_near(&guess, &inner.base.state, &drive)?
            }
            None => inner.solver.equilibrium_near(&inner.base.state, &inner.base.state, &drive)?,
        };
        let residuals = self.residuals(inner, &found);
        inner.trial = Some(found);
        Ok(residuals)
    }

    /// What is kept of the sensitivities at the base when the iteration goes on to `next`.
    fn carry(&self, inner: &mut Inner<'_, '_>, next: &Equilibrium) {
        let Some(mut known) = inner.directions.take() else { return };
        let model = inner.solver.model();
        match self.reuse {
            Reuse::Fresh => return,
            Reuse::Frozen => {}
            Reuse::Adjoint => {
                for (control, column) in self.unknowns.iter().zip(&mut known.columns) {
                    let range = Range::of(&model.controls()[*control]);
                    let [from, to] = [&inner.base, next].map(|at| at.state.controls[*control]);
                    let stretch = range.even_stretch(from, to);
                    column.iter_mut().for_each(|d| *d *= stretch);
                }
            }
            Reuse::Broyden => {
                let (before, after) = (model.unknowns(&inner.base.state), model.unknowns(&next.state));
                let dx: Vec<f64> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
                let change = |k: &usize| next.state.controls[*k] - inner.base.state.controls[*k];
                let range = |k: &usize| model.controls()[*k].upper - model.controls()[*k].lower;
                let dq: Vec<f64> = self.unknowns.iter().map(change).collect();
                known.learn(&dx, &dq, &self.unknowns.iter().map(range).collect::<Vec<f64>>());
            }
        }
        known.fresh = false;
        inner.directions = Some(known);
    }

    /// d(weighted residual)/dq with the head held, from dx/dq at the base.
    fn derivative(&self, inner: &Inner<'_, '_>, columns: &[Vec<f64>]) -> DMatrix<f64> {
        let points: Vec<MaterialPoint> = self.measured.iter().map(|m| self.markers[m.marker].point).collect();
        let rates = rates_at(inner.solver.model(), &inner.base.state, self.unknowns, columns, &points);
        let mut j = DMatrix::zeros(3 * self.measured.len(), self.unknowns.len());
        for (row, (m, rate)) in self.measured.iter().zip(&rates).enumerate() {
            j.rows_mut(3 * row, 3).copy_from(&(rate * m.weight));
        }
        j
    }

    /// The same from what is known, if it serves.
    fn kept(&self, inner: &mut Inner<'_, '_>) -> Result<Option<DMatrix<f64>>> {
        let Some(known) = inner.directions.take() else { return Ok(None) };
        let mut j = self.derivative(inner, &known.columns);
        let serves = known.fresh || self.reuse != Reuse::Adjoint || self.correct(inner, &mut j)?;
        inner.directions = serves.then_some(known);
        Ok(serves.then_some(j))
    }

    /// Gives a kept derivative the exact product with the residuals s as the objective weighs them, and so the exact gradient,
    /// by one solve (adjoint Broyden update, Schlenkrich, Griewank and Walther 2010):
    ///   J + s (g - J^T s)^T / |s|^2,   g = J(q)^T s
    ///
    /// `false` where that takes a new factor, which serves the whole derivative.
    fn correct(&self, inner: &mut Inner<'_, '_>, j: &mut DMatrix<f64>) -> Result<bool> {
        let residuals = self.residuals(inner, &inner.base);
        let rho = self.aims.objectives.loss.weights(&residuals);
        let s = DVector::from_fn(residuals.len(), |row, _| rho[row / 3] * residuals[row]);
        let square = s.norm_squared();
        if square == 0.0 {
            return Ok(true);
        }
        let mesh = inner.solver.model().mesh();
        let mut pull = vec![[0.0; 3]; mesh.parameters.len()];
        for (m, s) in self.measured.iter().zip(s.as_slice().chunks_exact(3)) {
            mesh.add_force(self.markers[m.marker].point, std::array::from_fn(|i| m.weight * s[i]), &mut pull);
        }
        let Some(exact) = inner.solver.pulled_back(&inner.base.state, &pull, self.unknowns)? else {
            return Ok(false);
        };
        let missed = DVector::from_vec(exact) - j.tr_mul(&s);
        j.ger(1.0 / square, &s, &missed, 1.0);
        Ok(true)
    }

    fn jacobian_at(&self, q: &[f64]) -> Result<DMatrix<f64>> {
        let drive = self.drive(q);
        let matches = |at: &Equilibrium| at.state.controls == drive.controls;
        if !self.inner.borrow().trial.as_ref().is_some_and(matches) && !matches(&self.inner.borrow().base) {
            self.residuals_at(q)?;
        }
        let inner = &mut *self.inner.borrow_mut();
        if let Some(trial) = inner.trial.take_if(|trial| matches(trial)) {
            self.carry(inner, &trial);
            inner.base = trial;
        }
        let renew = std::mem::take(&mut inner.renew);
        inner.directions.take_if(|known| renew && !known.fresh);
        let mut j = match self.kept(inner)? {
            Some(j) => j,
            None => {
                let columns = sensitivities(self.sensitivity, inner.solver, &inner.base, self.unknowns)?;
                inner.base.negative_modes = inner.solver.negative_modes();
                let j = self.derivative(inner, &columns);
                inner.directions = Some(Directions { columns, fresh: true });
                j
            }
        };
        if self.free_head {
            let model = inner.solver.model();
            let x = model.current(&inner.base.state);
            let place = |m: &Measured| model.mesh().interpolate(self.markers[m.marker].point, &x);
            let positions: Vec<[f64; 3]> = self.measured.iter().map(place).collect();
            let back = self.back(&positions);
            let rho = free_head::weights(&positions, &self.measured, &back, self.aims.objectives.loss);
            let reduced = free_head::project(&j, &back, &self.measured, &rho);
            inner.held_head = Some(std::mem::replace(&mut j, reduced));
        }
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
