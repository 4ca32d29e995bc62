//! Gauss-Newton steps on the true angular error, as an argmin solver.
//!
//! The residuals of a million axes are summed up as they come, and the normal equations are sparse: argmin's own
//! Gauss-Newton, which wants both as dense matrices, does not serve.

use super::embed::{Sample, Samples};
use super::normal::{Sums, sums};
use super::pattern::{Pattern, solve};
use super::roughness::Roughness;
use super::space::{Angles, Space};
use crate::error::{Error, Result};
use crate::scene::LossSpec;
use argmin::core::{
    Error as ArgminError, Executor, IterState, KV, Problem, Solver, State, TerminationReason, TerminationStatus,
};
use argmin::kv;

/// A step of every angle that is smaller than this ends the search, radians.
const TOLERANCE: f64 = 1e-8;
/// A step that lowers the sum by less than this part of it ends the search: it is a millionth of what the data leave open.
const GAIN: f64 = 1e-12;
/// The most halvings of a step.
const HALVINGS: u64 = 12;
/// A search whose steps no longer go down has converged where they are smaller than this, radians.
const SMALL: f64 = 1e-4;

/// What is minimised, but for the smoothness.
pub struct Search<'a> {
    /// Where pairs of parameters stand in matrices.
    pub pattern: &'a Pattern,
    /// The data.
    pub samples: &'a Samples,
    /// How angles follow from parameters.
    pub space: &'a Space,
    /// How an error counts.
    pub loss: LossSpec,
    /// 1: only A is sought. 2: A and B.
    pub sought: usize,
    /// Parameters that do not change.
    pub fixed: &'a [bool],
    /// The smoothness.
    pub roughness: &'a Roughness,
}

/// How a search ended.
#[derive(Debug, Clone)]
pub struct Descent {
    /// Steps that were taken.
    pub steps: usize,
    /// Whether the last one was below the tolerance.
    pub converged: bool,
    /// The sums at the end.
    pub sums: Sums,
}

impl Search<'_> {
    /// lambda for a smoothness: it is in relation to the weight of the data of an average element.
    pub fn lambda(&self, smoothness: f64) -> f64 {
        smoothness * self.samples.all.len() as f64 / self.samples.elements() as f64
    }

    /// The sums at some angles, over the samples that `take` takes.
    pub fn sums(&self, angles: &Angles, take: impl Fn(&Sample) -> bool + Sync) -> Sums {
        sums(self.pattern, self.samples, self.space, angles, self.loss, self.sought, take)
    }

    /// The Gauss-Newton step from some angles, per sought angle and parameter; `sums` are those there.
    ///
    /// # Errors
    /// [`Error::FibreSystem`].
    pub fn step(&self, angles: &Angles, sums: &Sums, lambda: f64) -> Result<Vec<Vec<f64>>> {
        let (_, rough) = self.roughness.at(self.space, angles);
        let one = |k: usize| {
            let factor = self.pattern.factor(&sums.normal[k], lambda, &self.roughness.matrices[k], self.fixed)?;
            let right: Vec<f64> = (0..angles.len())
                .map(|p| if self.fixed[p] { 0.0 } else { sums.gradient[k][p] - lambda * rough[k][p] })
                .collect();
            Ok(solve(&factor, &right))
        };
        (0..self.sought).map(one).collect()
    }

    /// The most by which one parameter of a step changes an angle anywhere, radians.
    pub fn longest(&self, step: &[Vec<f64>]) -> f64 {
        let reached =
            step.iter().flat_map(|step| step.iter().zip(&self.space.reach).map(|(x, reach)| x.abs() * reach));
        reached.fold(0.0, f64::max)
    }

    /// Moves angles along `part` of a step.
    pub fn moved(&self, angles: &Angles, step: &[Vec<f64>], part: f64) -> Angles {
        let mut moved = angles.clone();
        for (k, step) in step.iter().enumerate() {
            moved.iter_mut().zip(step).for_each(|(angles, step)| angles[k] += part * step);
        }
        moved
    }

    /// What is minimised, where the sums are these.
    pub fn value(&self, angles: &Angles, sums: &Sums, lambda: f64) -> f64 {
        sums.cost + lambda * self.roughness.at(self.space, angles).0
    }

    /// Goes downhill until steps are small, at most `most` of them.
    ///
    /// # Errors
    /// [`Error::FibreSystem`].
    pub fn descend(&self, angles: &mut Angles, lambda: f64, most: usize) -> Result<Descent> {
        let begun = self.sums(angles, |_| true);
        let solver = Damped { sums: begun, settled: None };
        let found = Executor::new(Objective { search: self, lambda }, solver)
            .configure(|state: AngleState| state.param(std::mem::take(angles)).max_iters(most as u64))
            .ctrlc(false)
            .timer(false)
            .run()
            .map_err(|error| match error.downcast::<Error>() {
                Ok(error) => error,
                Err(error) => Error::FibreSystem { message: error.to_string().into() },
            })?;
        let mut state = found.state;
        let lost = || Error::FibreSystem { message: "the search lost its angles".into() };
        *angles = state.take_param().ok_or_else(lost)?;
        let converged = found.solver.settled == Some(true);
        Ok(Descent { steps: state.get_iter() as usize, converged, sums: found.solver.sums })
    }
}

/// A search with its smoothness.
struct Objective<'s, 'a> {
    search: &'s Search<'a>,
    lambda: f64,
}

/// argmin's state for this solver: of a place nothing but its parameters and its value.
type AngleState = IterState<Angles, (), (), (), (), f64>;

/// Gauss-Newton steps; one that does not go down is halved.
struct Damped {
    /// The sums where the search stands.
    sums: Sums,
    /// Whether it converged, once it ended.
    settled: Option<bool>,
}

impl<'s, 'a> Solver<Objective<'s, 'a>, AngleState> for Damped {
    fn name(&self) -> &str {
        "damped Gauss-Newton"
    }

    fn init(
        &mut self,
        problem: &mut Problem<Objective<'s, 'a>>,
        mut state: AngleState,
    ) -> std::result::Result<(AngleState, Option<KV>), ArgminError> {
        let angles = state.take_param().ok_or_else(|| ArgminError::msg("a search starts from angles"))?;
        let sums = &self.sums;
        let cost = problem.problem("cost_count", |p| Ok(p.search.value(&angles, sums, p.lambda)))?;
        Ok((state.param(angles).cost(cost), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<Objective<'s, 'a>>,
        mut state: AngleState,
    ) -> std::result::Result<(AngleState, Option<KV>), ArgminError> {
        let angles = state.take_param().ok_or_else(|| ArgminError::msg("the state of the search is incomplete"))?;
        let before = state.get_cost();
        let sums = &self.sums;
        let (step, longest) = problem.problem("step_count", |p| {
            let step = p.search.step(&angles, sums, p.lambda)?;
            let longest = p.search.longest(&step);
            Ok((step, longest))
        })?;
        // a step of more than a radian leaves the chart in which it was made
        let mut part = if longest > 1.0 { 1.0 / longest } else { 1.0 };
        for halvings in 0..HALVINGS {
            let (trial, there, after) = problem.problem("cost_count", |p| {
                let trial = p.search.moved(&angles, &step, part);
                let there = p.search.sums(&trial, |_| true);
                let after = p.search.value(&trial, &there, p.lambda);
                Ok((trial, there, after))
            })?;
            // of equal values the newer is as good: at the bottom rounding decides
            if after <= before * (1.0 + 1e-12) {
                self.sums = there;
                if longest < TOLERANCE || (part == 1.0 && before - after <= GAIN * before) {
                    self.settled = Some(true);
                }
                let report = kv!("step" => longest; "halvings" => halvings;);
                return Ok((state.param(trial).cost(after), Some(report)));
            }
            part *= 0.5;
        }
        self.settled = Some(longest < SMALL);
        Ok((state.param(angles).cost(before), None))
    }

    fn terminate(&mut self, _state: &AngleState) -> TerminationStatus {
        match self.settled {
            Some(true) => TerminationStatus::Terminated(TerminationReason::SolverConverged),
            Some(false) => {
                TerminationStatus::Terminated(TerminationReason::SolverExit("no step lowers the errors".into()))
            }
            None => TerminationStatus::NotTerminated,
        }
    }
}
