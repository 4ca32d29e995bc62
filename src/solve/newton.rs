//! Newton's method with an admissible region and an affine-invariant damping (Deuflhard, Newton Methods for Nonlinear
//! Problems, 2004, algorithm NLEQ-ERR).
//!
//! A step d = - K^-1 r(x) is damped by a factor f until the natural monotonicity test holds:
//! ```text
//! theta = |c| / |d| < 1 - f/4,   c = - K^-1 r(x + f d)
//! ```
//! c is the correction that the old tangent K sees at the trial. Unlike a test on |r| it does not depend on how the
//! equations are scaled, and it lets a slender body turn through the large residuals that full steps meet. Where K serves
//! well (theta small at f = 1) the corrections are taken too: steps without a factorisation.

use crate::error::Result;

/// A system of nonlinear equations r(x) = 0 as Newton's method sees it.
pub trait Equations {
    /// The unknowns, and whatever else moves with them.
    type State: Clone;
    /// A direction in which a state can be moved.
    type Step;

    /// Residual at a state.
    fn assess(&mut self, state: &Self::State) -> Assessment;

    /// The Newton step at a state: a new tangent, factorised.
    fn step(&mut self, state: &Self::State) -> Result<Self::Step>;

    /// The correction at the state last assessed as the last factorised tangent sees it.
    fn correction(&mut self) -> Result<Self::Step>;

    /// The state at `factor` along a step.
    fn advance(&self, state: &Self::State, step: &Self::Step, factor: f64) -> Self::State;

    /// step . r at the state last assessed: the slope of the energy along the step.
    fn slope(&self, step: &Self::Step) -> f64;

    /// The size of a + weight b, dimensionless; a step of size one is large.
    fn size(&self, a: &Self::Step, weight: f64, b: &Self::Step) -> f64;
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
    /// Whether the state counts as a solution.
    pub fn converged(&self) -> bool {
        self.admissible && !self.outstanding && self.residual <= self.required
    }
}

/// Limits of the iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Newton iterations with one test before giving up.
    pub iterations: usize,
    /// The smallest damping factor before giving up.
    pub damping: f64,
    /// The test that steps must pass.
    pub test: Test,
    /// The test that takes its place from the first step on of which no part passes.
    pub otherwise: Option<Test>,
}

/// A test of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Test {
    /// Natural monotonicity, for smooth equations.
    Monotone,
    /// Natural monotonicity, or a residual that has lost half of the part of the step: for equations with kinks, where the
    /// old tangent makes much of a small residual behind a kink.
    MonotoneOrLower,
    /// The slope d . r of the energy along the step must have lost a part of its size, for equations with kinks. Just
    /// before a kink no step is monotone, however short; this search ends behind it, where the tangent is another.
    Slope,
}

/// A Newton step below this is rounding: where no such step makes the residual smaller, nothing will.
const NEGLIGIBLE: f64 = 1e-10;
/// Part of the residual that a whole step must take away to be taken for that alone.
const RESIDUAL_LOST: f64 = 0.5;
/// Part of the slope that may remain.
const SLOPE_LEFT: f64 = 0.5;
/// Part of the step at which the search for it ends.
const SHORTEST: f64 = 1e-3;

/// One iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Norm of the residual before it.
    pub residual: f64,
    /// The norm required.
    pub required: f64,
    /// Part of the full step that was taken.
    pub factor: f64,
    /// Corrections with the same tangent that followed.
    pub corrections: usize,
}

/// Why the iteration ended without a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The first state was not admissible.
    Inadmissible,
    /// No step along the Newton direction was admissible and passed the monotonicity test.
    NoDescent,
    /// The iterations were used up.
    Iterations,
}

/// A solution, or how far the iteration came.
#[derive(Debug, Clone)]
pub struct Outcome<S> {
    /// The last state: the solution if `stop` is `None`.
    pub state: S,
    /// Residual at the last state: not more than required, or so small that Newton's step from there is rounding.
    pub last: Assessment,
    /// Every iteration.
    pub iterations: Vec<Iteration>,
    /// Why it ended without a solution.
    pub stop: Option<Stop>,
}

/// Corrections with an old tangent go on while each is smaller than the one before by this factor.
const CONTRACTION: f64 = 0.1;

/// Iterates from `start` until the residual is as small as required.
///
/// # Errors
/// Where a tangent cannot be factorised.
pub fn newton<E: Equations>(equations: &mut E, start: E::State, limits: Limits) -> Result<Outcome<E::State>> {
    let mut state = start;
    let mut iterations = Vec::new();
    let mut now = equations.assess(&state);
    let (mut test, mut otherwise) = (limits.test, limits.otherwise);
    // iterations that the test before has had
    let mut earlier = 0;
    // the last step with its factor, and the correction that its tangent saw at its end
    let mut previous: Option<(E::Step, f64, E::Step)> = None;
    let stop = loop {
        if now.converged() {
            break None;
        }
        if !now.admissible {
            break Some(Stop::Inadmissible);
        }
        if iterations.len() - earlier >= limits.iterations {
            break Some(Stop::Iterations);
        }
        let step = equations.step(&state)?;
        let length = equations.size(&step, 0.0, &step);
        let slope = equations.slope(&step);
        // the a-priori factor: how far the last tangent could be trusted
        let mut factor = 1.0;
        if let Some((last, last_factor, correction)) = &previous {
            let change = equations.size(correction, -1.0, &step);
            let trust = equations.size(last, 0.0, last) * equations.size(correction, 0.0, correction) * last_factor
                / (change * length);
            if test != Test::Slope && trust.is_finite() {
                factor = trust.clamp(limits.damping, 1.0);
            }
        }
        let mut accepted: Option<(E::State, Assessment, E::Step, f64)> = None;
        // factors with their slopes: still downhill, uphill again
        let mut bracket = ((0.0, slope), (factor, 0.0));
        loop {
            let trial = equations.advance(&state, &step, factor);
            let then = equations.assess(&trial);
            if !then.admissible {
                if let Some((.., smaller)) = &accepted {
                    // the longer step that was tried for good measure is no good: keep the shorter one
                    factor = *smaller;
                    break;
                }
                factor *= 0.5;
                if factor < limits.damping {
                    break;
                }
                continue;
            }
            if test == Test::Slope {
                let left = equations.slope(&step);
                if left > 0.0 {
                    bracket.1 = (factor, left)
                } else {
                    bracket.0 = (factor, left)
                }
                let ((low, before), (high, beyond)) = bracket;
                // not downhill, or prescribed motion comes with it: nothing to compare with
                let comparable = slope < 0.0 && !now.outstanding && !then.converged();
                if comparable && left.abs() > SLOPE_LEFT * slope.abs() && high - low > SHORTEST * high && beyond > 0.0
                {
                    // behind a kink the slope is steep: a secant alone would creep up to it
                    let secant = low + (high - low) * before / (before - beyond);
                    factor = secant.clamp(low + 0.25 * (high - low), high - 0.25 * (high - low));
                    continue;
                }
                let correction = equations.correction()?;
                accepted = Some((trial, then, correction, factor));
                break;
            }
            let correction = equations.correction()?;
            let theta = equations.size(&correction, 0.0, &correction) / length;
            // c - (1 - f) d is the part of the correction that is due to curvature
            let curvature = equations.size(&correction, factor - 1.0, &step);
            let better = (0.5 * length * factor * factor / curvature).min(1.0);
            let lower = test == Test::MonotoneOrLower
                && !now.outstanding
                && then.residual < (1.0 - RESIDUAL_LOST * factor) * now.residual;
            if theta < 1.0 - 0.25 * factor || lower || then.converged() {
                let longer = better >= 4.0 * factor && accepted.is_none();
                accepted = Some((trial, then, correction, factor));
                if !longer {
                    break;
                }
                factor = better;
            } else if let Some((.., smaller)) = &accepted {
                factor = *smaller;
                break;
            } else {
                factor = better.min(0.5 * factor);
                if factor.is_nan() || factor < limits.damping {
                    let solved = length <= NEGLIGIBLE && !now.outstanding;
                    let Some(next) = otherwise.take().filter(|_| !solved) else { break };
                    // the same step, with the tangent at hand
                    (test, factor, earlier) = (next, 1.0, iterations.len());
                    bracket = ((0.0, slope), (factor, 0.0));
                }
            }
        }
        let Some((trial, then, correction, _)) = accepted else {
            let solved = length <= NEGLIGIBLE && !now.outstanding;
            break (!solved).then_some(Stop::NoDescent);
        };
        let mut iteration = Iteration { residual: now.residual, required: now.required, factor, corrections: 0 };
        (state, now) = (trial, then);
        let mut correction = correction;
        let mut last_size = length;
        while factor == 1.0 && !now.converged() {
            let size = equations.size(&correction, 0.0, &correction);
            if size > CONTRACTION * last_size {
                break;
            }
            let trial = equations.advance(&state, &correction, 1.0);
            let then = equations.assess(&trial);
            if !then.admissible || then.residual > now.residual {
                break;
            }
            correction = equations.correction()?;
            iteration.corrections += 1;
            (state, now, last_size) = (trial, then, size);
        }
        iterations.push(iteration);
        previous = (iteration.corrections == 0).then_some((step, factor, correction));
    };
    Ok(Outcome { state, last: now, iterations, stop })
}

/// Corrections with a tangent from nearby go on while each is smaller than the one before by this factor.
const CHORD_CONTRACTION: f64 = 0.5;

/// Solves r(x) = 0 near a state whose tangent is at hand: corrections c = - K^-1 r(x) with that one tangent (the chord
/// method), without a new factorisation. `None` where they do not contract; the caller then has Newton's method.
///
/// # Errors
/// Where a linear system cannot be solved.
pub fn chord<E: Equations>(equations: &mut E, start: E::State, limits: Limits) -> Result<Option<Outcome<E::State>>> {
    let mut state = start;
    let mut now = equations.assess(&state);
    let mut iterations = Vec::new();
    let mut last_size = f64::INFINITY;
    while !now.converged() {
        if !now.admissible || iterations.len() >= limits.iterations {
            return Ok(None);
        }
        let correction = equations.correction()?;
        let size = equations.size(&correction, 0.0, &correction);
        if size > CHORD_CONTRACTION * last_size {
            return Ok(None);
        }
        state = equations.advance(&state, &correction, 1.0);
        iterations.push(Iteration { residual: now.residual, required: now.required, factor: 1.0, corrections: 1 });
        now = equations.assess(&state);
        last_size = size;
    }
    Ok(Some(Outcome { state, last: now, iterations, stop: None }))
}
