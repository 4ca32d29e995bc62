//! Gauss-Newton with bounds and a trust region, as an argmin solver.
//!
//! The response to an activation is about even in t = ln(1 + (q - lower) / onset): steps are made in t. With S = dq/dt,
//! H = S H_q S and g = S g_q of the objective's model ([`LeastSquares`]; J^T J and J^T r of plain squares) each iteration solves
//!   minimise 1/2 d^T H d + g^T d,   bounds of t,   |d_i| <= trust
//! and takes the step if the true objective falls as the model says, else shrinks the trust region.

use super::bounded_step::bounded_step;
use crate::error::Error;
use crate::model::Control;
use argmin::core::{
    Error as ArgminError, IterState, Jacobian, KV, Operator, Problem, Solver, State, TerminationReason,
    TerminationStatus,
};
use argmin::kv;
use nalgebra::{DMatrix, DVector};

/// argmin's state for this solver: parameters, gradient, Jacobian, residuals.
pub type GaussNewtonState = IterState<Vec<f64>, Vec<f64>, DMatrix<f64>, (), Vec<f64>, f64>;

/// A control that is sought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Smallest value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
    /// Value above the lower bound at which the response begins to saturate.
    pub onset: f64,
}

impl Range {
    /// The range of a control.
    pub fn of(control: &Control) -> Range {
        Range { lower: control.lower, upper: control.upper, onset: control.onset }
    }

    /// dq/dt at `from` times the change of t on the way to `to`: how far a body goes whose response is even in t, in units of dx/dq.
    pub fn even_change(&self, from: f64, to: f64) -> f64 {
        (from - self.lower + self.onset) * (self.to_even(to) - self.to_even(from))
    }

    /// The ratio of dt/dq at `to` and at `from`: how dx/dq of such a response changes.
    pub fn even_stretch(&self, from: f64, to: f64) -> f64 {
        (from - self.lower + self.onset) / (to - self.lower + self.onset)
    }

    fn to_even(self, q: f64) -> f64 {
        ((q - self.lower) / self.onset).ln_1p()
    }

    fn at_even(self, t: f64) -> f64 {
        (self.lower + self.onset * t.exp_m1()).clamp(self.lower, self.upper)
    }
}

/// Where a search ends; the step that shows it is still taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tolerance {
    /// The largest change of a control in a step, as a part of its range.
    Change(f64),
    /// How far the answer may be from the optimum, in standard deviations of it. A step is sqrt(d^T H d) of them long, with the
    /// second derivative H of the objective: the root of twice what the model promises; where H is in units of a variance that
    /// is not known, over its root. Steps that shrink by theta leave theta times the last one.
    Sds {
        /// So many.
        sds: f64,
        /// Whether residuals count by the standard deviations that they have.
        known: bool,
    },
}

/// A step of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Length {
    /// Largest change of a control, as a part of its range.
    pub change: f64,
    /// What the model promises of it.
    pub promised: f64,
    /// The objective before it.
    pub cost: f64,
    /// How many residuals there are beyond the number of controls.
    pub surplus: usize,
    /// Whether the trust region cut it: it then tells nothing of how far the optimum is.
    pub cut: bool,
}

impl Tolerance {
    /// What a step leaves that follows one of `before` standard deviations, in the units of [`Tolerance::size`], and its own
    /// length in standard deviations.
    pub fn left(self, step: Length, before: Option<f64>) -> (f64, f64) {
        let Length { change, promised, cost, surplus, cut } = step;
        let variance = match self {
            Tolerance::Sds { known: false, .. } => 2.0 * cost / surplus.max(1) as f64,
            _ => 1.0,
        };
        let sds = (2.0 * promised.max(0.0) / variance.max(f64::MIN_POSITIVE)).sqrt();
        match self {
            Tolerance::Change(_) => (change, sds),
            Tolerance::Sds { .. } if cut => (f64::INFINITY, sds),
            Tolerance::Sds { .. } => (before.map_or(sds, |before| sds * (sds / before).min(1.0)), sds),
        }
    }

    /// As a part of a range, or as a number of standard deviations.
    pub fn size(self) -> f64 {
        match self {
            Tolerance::Change(size) | Tolerance::Sds { sds: size, .. } => size,
        }
    }
}

/// What is minimised, seen from residuals.
pub trait LeastSquares {
    /// The objective at q, where the residuals are these.
    fn cost(&self, q: &[f64], residuals: &[f64]) -> f64;

    /// Makes the problem take its next Jacobian anew, where it keeps them.
    fn renew(&self) {}

    /// Its gradient and a positive semidefinite second derivative by q, where the residuals have the derivative `j`.
    fn model(&self, q: &[f64], residuals: &[f64], j: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>);
}

/// The solver.
pub struct GaussNewton {
    ranges: Vec<Range>,
    tolerance: Tolerance,
    /// Largest change of t in one step.
    trust: f64,
    /// Whether the last step was short enough to be the last.
    converged: bool,
    /// Its length in standard deviations of the answer.
    last_sds: Option<f64>,
    /// Whether the problem keeps Jacobians from step to step.
    keeps: bool,
    /// Whether the Jacobian at hand was taken where it is used.
    fresh: bool,
}

/// First trust region: a factor e^2 in (activation + onset).
const FIRST_TRUST: f64 = 2.0;
/// A step must bring at least this part of what the model promises.
const SUFFICIENT: f64 = 1e-4;
/// The trust region is not shrunk below this.
const SMALLEST_TRUST: f64 = 1e-10;
/// Rejected steps after which a Jacobian that was kept is taken anew, and the least trust region then.
const REJECTED_WITH_KEPT: u64 = 2;
const KEPT_TRUST: f64 = 0.1;
/// Part of what the model promised that a step must bring for its Jacobian to be kept.
const KEPT_RATIO: f64 = 0.9;
/// Longest step, as a change of t, behind which a Jacobian is kept.
const KEPT_STEP: f64 = 0.3;
/// Part of the largest curvature that holds controls still which no marker sees.
const STILL: f64 = 1e-11;

impl GaussNewton {
    /// For controls with the given ranges.
    pub fn new(ranges: Vec<Range>, tolerance: Tolerance) -> GaussNewton {
        GaussNewton {
            ranges,
            tolerance,
            trust: FIRST_TRUST,
            converged: false,
            last_sds: None,
            keeps: false,
            fresh: true,
        }
    }

    /// For a problem that keeps Jacobians until it is told to renew them.
    pub fn with_kept_jacobians(self) -> GaussNewton {
        GaussNewton { keeps: true, fresh: false, ..self }
    }
}

impl<O> Solver<O, GaussNewtonState> for GaussNewton
where
    O: LeastSquares
        + Operator<Param = Vec<f64>, Output = Vec<f64>>
        + Jacobian<Param = Vec<f64>, Jacobian = DMatrix<f64>>,
{
    fn name(&self) -> &str {
        "Gauss-Newton with bounds"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: GaussNewtonState,
    ) -> Result<(GaussNewtonState, Option<KV>), ArgminError> {
        let q = state.take_param().ok_or_else(|| ArgminError::msg("a fit starts from initial controls"))?;
        let q: Vec<f64> = q.iter().zip(&self.ranges).map(|(q, r)| q.clamp(r.lower, r.upper)).collect();
        let residuals = residuals(problem, &q)?;
        let jacobian = jacobian(problem, &q)?;
        let cost = cost(problem, &q, &residuals)?;
        Ok((state.param(q).residuals(residuals).jacobian(jacobian).cost(cost), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        mut state: GaussNewtonState,
    ) -> Result<(GaussNewtonState, Option<KV>), ArgminError> {
        let missing = || ArgminError::msg("the state of the fit is incomplete");
        let q = state.take_param().ok_or_else(missing)?;
        let r = state.take_residuals().ok_or_else(missing)?;
        let j = state.take_jacobian().ok_or_else(missing)?;
        let before = state.get_cost();
        let n = q.len();

        let slopes: Vec<f64> = q.iter().zip(&self.ranges).map(|(q, r)| q - r.lower + r.onset).collect();
        let (gradient, hessian) = model(problem, &q, &r, &j)?;
        let g: DVector<f64> = DVector::from_fn(n, |k, _| gradient[k] * slopes[k]);
        let mut h = DMatrix::from_fn(n, n, |a, b| hessian[(a, b)] * slopes[a] * slopes[b]);
        let still = STILL * h.diagonal().amax();
        for k in 0..n {
            h[(k, k)] += still;
        }
        let t: Vec<f64> = q.iter().zip(&self.ranges).map(|(q, r)| r.to_even(*q)).collect();

        let mut rejected = 0_u64;
        loop {
            let lower: Vec<f64> = t.iter().map(|t| (-t).max(-self.trust)).collect();
            let upper: Vec<f64> =
                t.iter().zip(&self.ranges).map(|(t, r)| (r.to_even(r.upper) - t).max(0.0).min(self.trust)).collect();
            let d = bounded_step(&h, g.as_slice(), &lower, &upper)?;
            let trial: Vec<f64> = (0..n).map(|k| self.ranges[k].at_even(t[k] + d[k])).collect();
            let part = |((a, b), r): ((&f64, &f64), &Range)| (a - b).abs() / (r.upper - r.lower);
            let step = trial.iter().zip(&q).zip(&self.ranges).map(part).fold(0.0, f64::max);
            let d = DVector::from_vec(d);
            let promised = -(g.dot(&d) + 0.5 * d.dot(&(&h * &d)));
            let (surplus, cut) = (r.len().saturating_sub(n), d.amax() > 0.99 * self.trust);
            let length = Length { change: step, promised, cost: before, surplus, cut };
            let (left, sds) = self.tolerance.left(length, self.last_sds);
            let last = left <= self.tolerance.size();
            if !self.fresh && (last || rejected == REJECTED_WITH_KEPT) {
                // neither rest nor failure is believed before the derivative was taken here
                renew(problem)?;
                let jacobian = jacobian(problem, &q)?;
                (self.fresh, self.trust) = (true, self.trust.max(KEPT_TRUST));
                let gradient = model(problem, &q, &r, &jacobian)?.0;
                let report = kv!("step" => 0.0; "left" => left; "trust" => self.trust; "rejected" => rejected;);
                let state = state.param(q).residuals(r).jacobian(jacobian).gradient(gradient).cost(before);
                return Ok((state, Some(report)));
            }

            let outcome = residuals(problem, &trial);
            let after = match &outcome {
                Ok(residuals) => cost(problem, &trial, residuals)?,
                // a step beyond what the forward model can follow is too long, not the end
                Err(error) if !last && is_not_converged(error) => f64::INFINITY,
                Err(_) => f64::NAN,
            };
            if after.is_nan() {
                outcome?;
                return Err(ArgminError::msg("the residual of the fit is not a number"));
            }
            let ratio = (before - after) / promised.max(f64::MIN_POSITIVE);
            if last || ratio > SUFFICIENT {
                if ratio > 0.75 && d.amax() > 0.9 * self.trust {
                    self.trust *= 3.0;
                } else if ratio < 0.25 {
                    self.trust = (0.5 * d.amax()).max(SMALLEST_TRUST);
                }
                let residuals = outcome?;
                let served = last || (ratio > KEPT_RATIO && d.amax() < KEPT_STEP && rejected == 0);
                if self.keeps && !served {
                    renew(problem)?;
                }
                let jacobian = jacobian(problem, &trial)?;
                self.fresh = !(self.keeps && served);
                let gradient = model(problem, &trial, &residuals, &jacobian)?.0;
                (self.converged, self.last_sds) = (last, Some(sds));
                let report = kv!("step" => step; "left" => left; "trust" => self.trust; "rejected" => rejected;);
                let state = state.param(trial).residuals(residuals).jacobian(jacobian).gradient(gradient).cost(after);
                return Ok((state, Some(report)));
            }
            rejected += 1;
            self.trust = 0.3 * d.amax();
            if self.trust < SMALLEST_TRUST {
                let state = state.param(q).residuals(r).jacobian(j).cost(before);
                let reason = TerminationReason::SolverExit("no step lowers the objective".into());
                return Ok((state.terminate_with(reason), None));
            }
        }
    }

    fn terminate(&mut self, _state: &GaussNewtonState) -> TerminationStatus {
        if self.converged {
            TerminationStatus::Terminated(TerminationReason::SolverConverged)
        } else {
            TerminationStatus::NotTerminated
        }
    }
}

fn residuals<O>(problem: &mut Problem<O>, q: &Vec<f64>) -> Result<Vec<f64>, ArgminError>
where
    O: Operator<Param = Vec<f64>, Output = Vec<f64>>,
{
    problem.problem("residual_evaluations", |p| p.apply(q))
}

fn jacobian<O>(problem: &mut Problem<O>, q: &Vec<f64>) -> Result<DMatrix<f64>, ArgminError>
where
    O: Jacobian<Param = Vec<f64>, Jacobian = DMatrix<f64>>,
{
    problem.problem("jacobian_evaluations", |p| p.jacobian(q))
}

fn is_not_converged(error: &ArgminError) -> bool {
    error.downcast_ref::<Error>().is_some_and(Error::is_not_converged)
}

fn renew<O: LeastSquares>(problem: &mut Problem<O>) -> Result<(), ArgminError> {
    problem.problem("renewals", |p| {
        p.renew();
        Ok(())
    })
}

fn cost<O: LeastSquares>(problem: &mut Problem<O>, q: &[f64], residuals: &[f64]) -> Result<f64, ArgminError> {
    problem.problem("cost_evaluations", |p| Ok(p.cost(q, residuals)))
}

fn model<O: LeastSquares>(
    problem: &mut Problem<O>,
    q: &[f64],
    residuals: &[f64],
    j: &DMatrix<f64>,
) -> Result<(Vec<f64>, DMatrix<f64>), ArgminError> {
    problem.problem("model_evaluations", |p| Ok(p.model(q, residuals, j)))
}
