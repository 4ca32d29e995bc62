//! Newton's method with an admissible region, a line search on the residual and prescribed motion that is taken along.

use crate::error::Result;

/// A system of nonlinear equations r(x) = 0 as Newton's method sees it.
pub trait Equations {
    /// The unknowns, and whatever else moves with them.
    type State: Clone;
    /// A search direction.
    type Step;

    /// Residual at a state. With `linearise` the derivative is kept for [`Equations::step`].
    fn assess(&mut self, state: &Self::State, linearise: bool) -> Assessment;

    /// The Newton step at the state last assessed with `linearise`, from a factorisation.
    fn step(&mut self) -> Result<Self::Step>;

    /// The state at `factor` along a step.
    fn advance(&self, state: &Self::State, step: &Self::Step, factor: f64) -> Self::State;
}

/// What an assessment says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Assessment {
    /// Norm of the residual.
    pub residual: f64,
    /// The norm at which the state counts as a solution.
    pub required: f64,
    /// Whether the state lies in the admissible region and all numbers are finite.
    pub admissible: bool,
    /// Whether prescribed motion is still outstanding.
    pub outstanding: bool,
}

impl Assessment {
    fn converged(&self) -> bool {
        self.admissible && !self.outstanding && self.residual <= self.required
    }
}

/// Limits of the iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Newton iterations before giving up.
    pub iterations: usize,
    /// Halvings of a step before giving up.
    pub halvings: usize,
}

/// One iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Norm of the residual before it.
    pub residual: f64,
    /// The norm required.
    pub required: f64,
    /// Part of the full step that was taken.
    pub factor: f64,
}

/// Why the iteration ended without a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The first state was not admissible.
    Inadmissible,
    /// No step along the Newton direction was admissible and reduced the residual.
    NoDescent,
    /// The iterations were used up.
    Iterations,
    /// The iteration crawled: several short steps in a row.
    Crawling,
}

/// A solution, or how far the iteration came.
#[derive(Debug, Clone)]
pub struct Outcome<S> {
    /// The last state: the solution if `stop` is `None`.
    pub state: S,
    /// Residual at the last state.
    pub last: Assessment,
    /// Every iteration.
    pub iterations: Vec<Iteration>,
    /// Why it ended without a solution.
    pub stop: Option<Stop>,
}

/// Steps shorter than this in a row mean that the iteration crawls.
const SHORT: f64 = 0.1;
/// How many of them.
const SHORT_IN_A_ROW: usize = 4;

/// Iterates from `start` until the residual is as small as required.
///
/// Each iteration solves K d = - r. The step is halved until the state is admissible and the residual falls; while
/// prescribed motion is outstanding, which comes with the step in proportion, admissible is enough.
///
/// # Errors
/// Where the tangent cannot be factorised.
pub fn newton<E: Equations>(equations: &mut E, start: E::State, limits: Limits) -> Result<Outcome<E::State>> {
    let mut state = start;
    let mut iterations = Vec::new();
    let mut short = 0;
    let mut now = equations.assess(&state, false);
    let stop = loop {
        if now.converged() {
            break None;
        }
        if !now.admissible {
            break Some(Stop::Inadmissible);
        }
        if iterations.len() >= limits.iterations {
            break Some(Stop::Iterations);
        }
        equations.assess(&state, true);
        let step = equations.step()?;
        let mut factor = 1.0;
        let mut accepted = None;
        for _ in 0..=limits.halvings {
            let trial = equations.advance(&state, &step, factor);
            let then = equations.assess(&trial, false);
            // at least a tenth of the decrease that the linear model promises
            let falls = then.residual <= (1.0 - 0.1 * factor) * now.residual;
            if then.admissible && (falls || now.outstanding || then.converged()) {
                accepted = Some((trial, then));
                break;
            }
            factor *= 0.5;
        }
        let Some((trial, then)) = accepted else { break Some(Stop::NoDescent) };
        iterations.push(Iteration { residual: now.residual, required: now.required, factor });
        (state, now) = (trial, then);
        short = if factor < SHORT { short + 1 } else { 0 };
        if short >= SHORT_IN_A_ROW {
            break Some(Stop::Crawling);
        }
    };
    Ok(Outcome { state, last: now, iterations, stop })
}
