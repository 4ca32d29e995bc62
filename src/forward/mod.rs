//! Equilibrium: from one state to another along a path of controls, loads and prescribed motion.

mod balance;
pub mod drives;
pub mod estimate;
mod release;
mod work;

use crate::error::{Error, Likely, Result};
use crate::math::factor::Precision;
use crate::model::{Evaluation, Model, Renewal, State, Workspace, WorstPoint};
use crate::solve::newton::{Assessment, Equations, Iteration, Limits, Outcome, Stop, Test, chord, newton};
use crate::solve::path::{StepLimits, Stepper};
use crate::term::Want;
use crate::term::bone::Bone;
use balance::Balance;
use std::sync::Arc;
use std::time::Instant;

pub use release::Snap;
pub use work::Work;

/// First and longest step of a path, as changes of ln(activation + onset): the response is about even in it.
const FIRST_STEP: f64 = 0.5;
/// A Newton step that must be damped below this is left for a shorter step of the path.
const DAMPING: f64 = 0.1;
/// What Newton's method does where nothing else is said.
const LIMITS: Limits = Limits { iterations: 30, damping: DAMPING, test: Test::Monotone, otherwise: None };
/// Residual, in relation to the element forces, of the states on the way with contact to the equilibrium that is asked for: each is no more than
/// the guess for the next.
const ON_THE_WAY: f64 = 1e-3;
/// By how much contact is eased on a path, as a part of an element.
const EASING: f64 = 0.125;
/// To this part the range over which it sets in is narrowed at once, and the part that is too little to go on with.
const HARDENED: f64 = 0.2;
const HARDENED_LEAST: f64 = 0.8;
/// Corrections with the tangent at hand before a new one is made.
const CHORD_ITERATIONS: usize = 8;
/// Iterations that a guess is given before the path is walked instead.
const NEAR_ITERATIONS: usize = 8;
/// Below this length a step onto a saddle is believed.
const SHORT_FOR_A_JUMP: f64 = 0.02;
/// Rounds of multipliers before a gap counts as one that does not close.
const MULTIPLIER_ROUNDS: usize = 200;
const LONGEST_STEP: f64 = 2.0;
/// How far beyond the last equilibrium that could be reached the body is let go, as a part of the path.
const BEYOND_A_LIMIT: f64 = 0.01;
/// A support or a bone rotates by no more than this in one step, radians.
const LARGEST_ROTATION: f64 = std::f64::consts::PI / 8.0;

/// What drives a model to an equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Controls in the order of the model.
    pub controls: Vec<f64>,
    /// Factor on dead loads and prescribed motions, 1 for what the scene says.
    pub load: f64,
}

/// How equilibria are sought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Residual in relation to the element forces, at the end of a path.
    pub tolerance: f64,
    /// Newton iterations for each step of the path.
    pub max_iterations: usize,
    /// Longest step of the path, as a part of the whole.
    pub step_max: f64,
    /// Shortest step.
    pub step_min: f64,
    /// Whether a body that loses its balance on the path is let go ([`Snap`]). The answer then jumps with the controls, which
    /// a fit cannot use.
    pub release: bool,
    /// In which the tangent is factorised; taken when the solver is made.
    pub precision: Precision,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            tolerance: 1e-8,
            max_iterations: 30,
            step_max: 1.0,
            step_min: 1e-4,
            release: true,
            precision: Precision::Double,
        }
    }
}

/// One step of a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Where on the path, 0 to 1.
    pub place: f64,
    /// How it was made.
    pub kind: StepKind,
    /// Newton iterations of the step.
    pub iterations: Vec<Iteration>,
    /// Residual at the end, mN; above what is required only where it is rounding, or in a failed step.
    pub residual: f64,
    /// The residual required, mN.
    pub required: f64,
}

/// How a step of a path was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepKind {
    /// By Newton's method from the step before.
    Walked,
    /// The body was let go where the path turned back, or left a saddle: see [`Snap`].
    Snapped,
    /// Contact that was eased sets in over a narrower range.
    Hardened,
    /// It did not converge.
    Failed,
}

impl StepKind {
    /// The word in tables.
    pub fn word(self) -> &'static str {
        match self {
            StepKind::Walked => "walked",
            StepKind::Snapped => "snapped",
            StepKind::Hardened => "hardened",
            StepKind::Failed => "failed",
        }
    }
}

/// A converged state, how it was reached, and what is known about it.
#[derive(Debug, Clone)]
pub struct Equilibrium {
    /// The state.
    pub state: State,
    /// Energies, forces with reactions, range of det F.
    pub evaluation: Evaluation,
    /// Steps of the path to it.
    pub history: Vec<Step>,
    /// Where the body lost its balance on the path and came to another state.
    pub snaps: Vec<Snap>,
    /// Negative eigenvalues of the tangent beyond one per pressure, at the last factorisation: more than none means a
    /// saddle. `None` where nothing had to be factorised.
    pub negative_modes: Option<usize>,
}

/// No equilibrium: why, and the last one that was found.
#[derive(Debug)]
pub struct Failure {
    /// What went wrong, with its numbers.
    pub error: Error,
    /// The last equilibrium on the path.
    pub last_good: State,
    /// The part of the path at which it lies.
    pub reached: f64,
    /// The iterate at which Newton's method gave up.
    pub failed: State,
    /// Steps of the path, the failed one at the end.
    pub history: Vec<Step>,
}

impl From<Box<Failure>> for Error {
    fn from(failure: Box<Failure>) -> Error {
        failure.error
    }
}

/// Finds equilibria of one model. Holds the memory for it: the tangent, its factor, the element systems.
pub struct Solver<'m> {
    balance: Balance<'m>,
    settings: Settings,
    watch: Option<Watch>,
}

/// The end of a path, the steps to it, and where the body snapped.
type Walked = (State, Vec<Step>, Vec<Snap>);

/// Sees every step of every path when it is done, those that failed and were cut too.
pub type Watch = Arc<dyn Fn(&Step) + Send + Sync>;

impl<'m> Solver<'m> {
    /// # Errors
    /// Where the factor does not fit into memory.
    pub fn new(model: &'m Model, settings: Settings) -> Result<Solver<'m>> {
        Ok(Solver { balance: Balance::new(model, settings.tolerance, settings.precision)?, settings, watch: None })
    }

    /// Shows the steps of paths to `watch` from now on.
    pub fn set_watch(&mut self, watch: Watch) {
        self.watch = Some(watch);
    }

    /// A step with what it took, once it has been seen.
    fn seen(&self, step: Step) -> Step {
        if let Some(watch) = &self.watch {
            watch(&step);
        }
        step
    }

    /// The model.
    pub fn model(&self) -> &'m Model {
        self.balance.model
    }

    /// How equilibria are sought.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Seeks the next equilibria in another way.
    pub fn set_settings(&mut self, settings: Settings) {
        self.balance.tolerance = settings.tolerance;
        self.settings = settings;
    }

    /// Work done since the solver was made.
    pub fn work(&self) -> Work {
        self.balance.work()
    }

    /// The equilibrium at `to`, sought from a guess of it: a state whose unknowns are near. Where that fails, the same with
    /// contact that is eased first; where that fails too, along the path from the equilibrium `from`.
    ///
    /// # Errors
    /// As [`Solver::equilibrium`].
    pub fn equilibrium_near(
        &mut self,
        guess: &State,
        from: &State,
        to: &Drive,
    ) -> std::result::Result<Equilibrium, Box<Failure>> {
        self.balance.set_target(to.clone());
        let guess = self.balance.carried(self.balance.at_target(guess.clone()));
        if self.balance.has_tangent() {
            let limits = Limits { iterations: CHORD_ITERATIONS, damping: 1.0, ..LIMITS };
            if let Ok(Some(outcome)) = chord(&mut self.balance, guess.clone(), limits) {
                let history = vec![step(1.0, StepKind::Walked, outcome.last, outcome.iterations)];
                if let Ok(found) = self.close_gaps(outcome.state, history, Vec::new()) {
                    return Ok(found);
                }
            }
        }
        let limits = Limits { iterations: self.settings.max_iterations.min(NEAR_ITERATIONS), ..LIMITS };
        self.balance.keeps_factor = true;
        let near = self.solve(guess.clone(), limits);
        self.balance.keeps_factor = false;
        if let Ok(outcome) = near {
            let stable = self.balance.negative_modes().unwrap_or(0) == 0;
            if outcome.stop.is_none() && stable {
                let history = vec![step(1.0, StepKind::Walked, outcome.last, outcome.iterations)];
                if let Ok(found) = self.close_gaps(outcome.state, history, Vec::new()) {
                    return Ok(found);
                }
            }
        }
        if let Some(range) = self.balance.model.eases() {
            let eased = self.eased_near(&guess, self.on_the_way(), range);
            self.balance.easing = 0.0;
            if let Some((state, history)) = eased
                && let Ok(found) = self.close_gaps(state, history, Vec::new())
            {
                return Ok(found);
            }
        }
        self.equilibrium(from, to)
    }

    /// The residual of states on the way with contact: where points open and close, their last digits are dear.
    fn on_the_way(&self) -> f64 {
        self.settings.tolerance.max(ON_THE_WAY)
    }

    /// The equilibrium at `to`, sought along the straight path of controls and load from the equilibrium `from`. Where the
    /// path turns back or comes to a saddle, the body is let go: see [`Snap`]. Contact that may be eased is walked into softly
    /// and then hardened.
    ///
    /// # Errors
    /// [`Failure`] with the last equilibrium that was found on the path.
    pub fn equilibrium(&mut self, from: &State, to: &Drive) -> std::result::Result<Equilibrium, Box<Failure>> {
        let loose = self.on_the_way();
        if let Some(range) = self.balance.model.eases() {
            let eased = self.eased(from, to, loose, range);
            self.balance.easing = 0.0;
            if let Some((state, history)) = eased
                && let Ok(found) = self.close_gaps(state, history, Vec::new())
            {
                return Ok(found);
            }
        }
        if self.balance.model.contacts().next().is_some() {
            let found = self.follow(from, to, loose);
            if let Ok(found) = found
                && found.negative_modes.unwrap_or(0) == 0
            {
                return Ok(found);
            }
            // a loose state is no witness of a loss of balance or of a path that ends
        }
        self.follow(from, to, self.settings.tolerance)
    }

    /// The same along the path with contact that sets in over a wider range, which is then narrowed to the `range` of its law. `None`
    /// where that does not lead to a stable equilibrium.
    fn eased(&mut self, from: &State, to: &Drive, loose: f64, range: f64) -> Option<(State, Vec<Step>)> {
        self.balance.easing = EASING * self.balance.model.element_size();
        let (state, history, snaps) = self.walk_path(from, to, [loose; 2]).ok()?;
        if !snaps.is_empty() {
            return None;
        }
        self.balance.set_target(to.clone());
        self.hardened(state, history, loose, range)
    }

    /// The same from a guess of the eased equilibrium instead of along a path.
    fn eased_near(&mut self, guess: &State, loose: f64, range: f64) -> Option<(State, Vec<Step>)> {
        self.balance.easing = EASING * self.balance.model.element_size();
        self.balance.tolerance = loose;
        let limits = Limits { iterations: NEAR_ITERATIONS, ..LIMITS };
        match self.attempt(guess.clone(), guess, limits).ok()? {
            Outcome { state, last, iterations, stop: None } => {
                let history = vec![self.seen(step(1.0, StepKind::Walked, last, iterations))];
                self.hardened(state, history, loose, range)
            }
            Outcome { last, iterations, .. } => {
                self.seen(step(1.0, StepKind::Failed, last, iterations));
                self.balance.count_cut();
                None
            }
        }
    }

    /// Narrows contact that is eased to the `range` of its law, from one state to the next.
    fn hardened(
        &mut self,
        mut state: State,
        mut history: Vec<Step>,
        loose: f64,
        range: f64,
    ) -> Option<(State, Vec<Step>)> {
        let limits = Limits { iterations: NEAR_ITERATIONS, ..LIMITS };
        let mut part = HARDENED;
        while self.balance.easing > 0.0 {
            let before = self.balance.easing;
            let left = part * (before + range) - range;
            self.balance.easing = if left > range { left } else { 0.0 };
            self.balance.tolerance = if left > range { loose } else { self.settings.tolerance };
            match self.attempt(state.clone(), &state, limits).ok()? {
                Outcome { state: hard, last, iterations, stop: None } => {
                    history.push(self.seen(step(1.0, StepKind::Hardened, last, iterations)));
                    (state, part) = (hard, HARDENED);
                }
                Outcome { last, iterations, .. } => {
                    self.seen(step(1.0, StepKind::Failed, last, iterations));
                    self.balance.count_cut();
                    (self.balance.easing, part) = (before, part.sqrt());
                    if part > HARDENED_LEAST {
                        return None;
                    }
                }
            }
        }
        (self.balance.negative_modes() == Some(0)).then_some((state, history))
    }

    /// The equilibrium at `to` along the path from `from`, with contact as its law says and states on the way that are balanced to
    /// `on_the_way`.
    fn follow(
        &mut self,
        from: &State,
        to: &Drive,
        on_the_way: f64,
    ) -> std::result::Result<Equilibrium, Box<Failure>> {
        let (state, history, snaps) = self.walk_path(from, to, [on_the_way, self.settings.tolerance])?;
        self.balance.set_target(to.clone());
        self.close_gaps(state, history, snaps)
    }

    /// The end of the path, the steps to it and where the body snapped. States on the way are balanced to the first tolerance, the
    /// last one to the second; where those on the way are looser than settings ask for, no body is let go.
    fn walk_path(
        &mut self,
        from: &State,
        to: &Drive,
        [on_the_way, end]: [f64; 2],
    ) -> std::result::Result<Walked, Box<Failure>> {
        let loose = on_the_way > self.settings.tolerance;
        let start = Drive { controls: from.controls.clone(), load: from.load };
        let (warp, limits) = self.walk(&start, to);
        let mut stepper = Stepper::new(limits);
        let mut history: Vec<Step> = Vec::new();
        let mut snaps: Vec<Snap> = Vec::new();
        let mut last = from.clone();
        let mut before: Option<(f64, State)> = None;
        let mut modes = 0;
        let limits = Limits { iterations: self.settings.max_iterations, ..LIMITS };
        while let Some(place) = stepper.next() {
            self.balance.set_target(between(&start, to, warp.place(place)));
            self.balance.tolerance = if place < 1.0 { on_the_way } else { end };
            let guess = match &before {
                Some((earlier, state)) => {
                    let ratio = (place - stepper.reached()) / (stepper.reached() - earlier);
                    let predicted = self.balance.extrapolate(state, &last, ratio);
                    self.nearer(predicted, &last)
                }
                None => last.clone(),
            };
            let outcome = match self.attempt(guess, &last, limits) {
                Ok(outcome) => outcome,
                Err(error) => {
                    let (reached, last_good) = (stepper.reached(), last.clone());
                    return Err(Box::new(Failure { error, last_good, reached, failed: last, history }));
                }
            };
            let earlier = history.last().map_or(0.0, |step| step.place);
            match outcome.stop {
                None if self.jumped(modes, stepper.length()) => {
                    self.balance.count_cut();
                    self.seen(step(place, StepKind::Failed, outcome.last, outcome.iterations));
                    stepper.failed();
                }
                None => {
                    let found = self.balance.negative_modes().unwrap_or(0);
                    if found > modes
                        && !loose
                        && let Some(released) = self.release(&snaps, &outcome.state, &last)
                    {
                        stepper.resumed(place);
                        snaps.push(released.snap(place, found, &last));
                        history.push(self.seen(released.step(place)));
                        (before, last) = (None, released.state);
                        continue;
                    }
                    modes = modes.max(found);
                    stepper.succeeded(place, outcome.iterations.len());
                    history.push(self.seen(step(place, StepKind::Walked, outcome.last, outcome.iterations)));
                    before = Some((earlier, std::mem::replace(&mut last, outcome.state)));
                }
                Some(stop) => {
                    self.balance.count_cut();
                    let failed = self.seen(step(place, StepKind::Failed, outcome.last, outcome.iterations.clone()));
                    if stepper.failed() {
                        continue;
                    }
                    let error = self.not_converged(&stepper, stop, &outcome);
                    let beyond = (stepper.reached() + BEYOND_A_LIMIT).min(1.0);
                    self.balance.set_target(between(&start, to, warp.place(beyond)));
                    // where even longer steps were not allowed, a shorter one may lead on
                    if stepper.length() < BEYOND_A_LIMIT
                        && !loose
                        && let Some(released) = self.release(&snaps, &last, &last)
                    {
                        stepper.resumed(beyond);
                        snaps.push(released.snap(beyond, 0, &last));
                        history.push(self.seen(released.step(beyond)));
                        (before, last) = (None, released.state);
                        continue;
                    }
                    history.push(failed);
                    let reached = stepper.reached();
                    return Err(Box::new(Failure {
                        error,
                        last_good: last,
                        reached,
                        failed: outcome.state,
                        history,
                    }));
                }
            }
        }
        Ok((last, history, snaps))
    }

    /// Uzawa's method: multipliers and balance in turn, until every constraint is as closed as it should be.
    fn close_gaps(
        &mut self,
        start: State,
        mut history: Vec<Step>,
        snaps: Vec<Snap>,
    ) -> std::result::Result<Equilibrium, Box<Failure>> {
        let mut state = start;
        let limits = Limits { iterations: self.settings.max_iterations, ..LIMITS };
        for round in 0.. {
            let model = self.balance.model;
            let Some(Renewal { multipliers, term, gap, tolerance }) = model.renew_multipliers(&state) else { break };
            if gap <= tolerance {
                break;
            }
            let fail = |error: Error, failed: State, last_good: State, history: Vec<Step>| {
                Err(Box::new(Failure { error, last_good, reached: 1.0, failed, history }))
            };
            if round == MULTIPLIER_ROUNDS {
                let name = model.terms()[term].name().into();
                let error = Error::GapNotClosed { name, gap, tolerance, rounds: round };
                return fail(error, state.clone(), state, history);
            }
            let next = State { multipliers, ..state.clone() };
            let limits_near = Limits { iterations: CHORD_ITERATIONS, damping: 1.0, ..LIMITS };
            let near = if self.balance.has_tangent() {
                chord(&mut self.balance, next.clone(), limits_near)
            } else {
                Ok(None)
            };
            let found = match near {
                Ok(Some(outcome)) => Ok(outcome),
                _ => self.solve(next, limits),
            };
            match found {
                Ok(Outcome { state: balanced, last, iterations, stop: None }) => {
                    history.push(step(1.0, StepKind::Walked, last, iterations));
                    state = balanced;
                }
                Ok(outcome) => {
                    let error =
                        self.not_converged(&Stepper::at_end(), outcome.stop.unwrap_or(Stop::Iterations), &outcome);
                    history.push(step(1.0, StepKind::Failed, outcome.last, outcome.iterations));
                    return fail(error, outcome.state, state, history);
                }
                Err(error) => return fail(error, state.clone(), state, history),
            }
        }
        Ok(self.finish(state, history, snaps))
    }

    fn finish(&mut self, state: State, history: Vec<Step>, snaps: Vec<Snap>) -> Equilibrium {
        let evaluation = self.balance.evaluation_at(&state);
        Equilibrium { state, evaluation, history, snaps, negative_modes: self.balance.negative_modes() }
    }

    /// Whether a step has landed on a saddle though the path so far was stable: another branch was met, and a shorter
    /// step will follow the own one. A step that is short already has found a real loss of stability.
    fn jumped(&self, modes: usize, length: f64) -> bool {
        length > SHORT_FOR_A_JUMP && self.balance.negative_modes().is_some_and(|now| now > modes)
    }

    /// How the path to `to` is walked, and in which steps.
    fn walk(&self, from: &Drive, to: &Drive) -> (Warp, StepLimits) {
        let model = self.balance.model;
        let changes = model.controls().iter().zip(&from.controls).zip(&to.controls).map(|((control, a), b)| {
            let above = |value: f64| (value - control.lower).max(0.0) + control.onset;
            (above(*b) / above(*a)).ln()
        });
        let exponent = changes.fold(0.0, |most: f64, change| if change.abs() > most.abs() { change } else { most });
        let angle = model.supports().largest_rotation() * (to.load - from.load).abs();
        let rotation = LARGEST_ROTATION / angle.max(f64::MIN_POSITIVE);
        let rotation = rotation.min(self.bones_per_step(exponent.abs(), from, to));
        let first = (FIRST_STEP / exponent.abs().max(f64::MIN_POSITIVE)).min(rotation);
        let max = self.settings.step_max.min(LONGEST_STEP / exponent.abs().max(f64::MIN_POSITIVE)).min(rotation);
        (Warp { exponent }, StepLimits { first, max, min: self.settings.step_min.min(max) })
    }

    /// The longest step in which no bone turns by more than a support may, or slides by more than an element.
    fn bones_per_step(&self, exponent: f64, from: &Drive, to: &Drive) -> f64 {
        let model = self.balance.model;
        let steps = |bone: &Arc<Bone>| {
            let angle = bone.angle(&to.controls) - bone.angle(&from.controls);
            let way = bone.way(&to.controls) - bone.way(&from.controls);
            (angle.abs() / LARGEST_ROTATION).max(way.abs() / model.element_size())
        };
        let most = model.bones().iter().map(steps).fold(0.0, f64::max);
        // steps along the path grow by exp(exponent) from one end to the other; the longest counts
        let stretch = if exponent < 1e-3 { 1.0 } else { exponent / -(-exponent).exp_m1() };
        1.0 / (most * stretch).max(f64::MIN_POSITIVE)
    }

    /// Where contacts open and close a prediction may be worse than the last equilibrium: the one of the two with the smaller
    /// residual.
    fn nearer(&mut self, predicted: State, last: &State) -> State {
        if self.balance.model.contacts().next().is_none() {
            return predicted;
        }
        let [a, b] = [&predicted, last].map(|state| {
            let state = self.balance.at_target(state.clone());
            self.balance.assess(&state)
        });
        if b.outstanding || (a.admissible && a.residual <= b.residual) { predicted } else { last.clone() }
    }

    /// From the predicted state, and from the last equilibrium if the prediction is not admissible.
    fn attempt(&mut self, guess: State, last: &State, limits: Limits) -> Result<Outcome<State>> {
        self.balance.off_surface = None;
        let guess = self.balance.at_target(guess);
        let mut outcome = self.solve(guess, limits)?;
        if outcome.stop == Some(Stop::Inadmissible) {
            let last = self.balance.at_target(last.clone());
            outcome = self.solve(last, limits)?;
        }
        // Newton's method factorises the states before its solution; where there was one at most, that is a guess
        let unseen = match outcome.iterations.len() {
            0 => outcome.state.controls != last.controls || outcome.state.easing != last.easing,
            1 => true,
            _ => false,
        };
        if outcome.stop.is_none() && unseen {
            self.balance.inspect(&outcome.state)?;
        }
        Ok(outcome)
    }

    /// Newton's method. Where a contact opens or closes its forces have a kink, of which a tangent sees one side; the forces
    /// of fibres have kinks too, but there only a body that is let go has no shorter step to get past them.
    fn solve(&mut self, start: State, limits: Limits) -> Result<Outcome<State>> {
        let model = self.balance.model;
        let contacts = model.contacts().next().is_some();
        let kinks = contacts || (self.balance.drag.is_some() && model.muscles().next().is_some());
        let test = if contacts { Test::MonotoneOrLower } else { limits.test };
        let otherwise = kinks.then_some(Test::Slope);
        newton(&mut self.balance, start, Limits { test, otherwise, ..limits })
    }

    fn not_converged(&self, stepper: &Stepper, stop: Stop, outcome: &Outcome<State>) -> Error {
        let likely = self.likely(&outcome.state);
        let off = matches!(likely, Some(Likely::OffSurface { .. }));
        let reason = match stop {
            Stop::Inadmissible | Stop::NoDescent if off => "every step leads off a surface that a face must stay on",
            Stop::Inadmissible => "no admissible state to start from",
            Stop::NoDescent => "no step keeps det F positive and comes nearer",
            Stop::Iterations => "the iterations were used up",
        };
        let WorstPoint { min, element, point, .. } = self.balance.worst_point();
        Error::NotConverged {
            reached: stepper.reached(),
            cuts: stepper.cuts(),
            step: stepper.length(),
            reason,
            element,
            point,
            det_f: min,
            residual: outcome.last.residual,
            required: outcome.last.required,
            likely: likely.map(Box::new),
        }
    }

    /// What the trials of the last attempt, or else the state at which Newton's method gave up, show of the cause.
    fn likely(&self, failed: &State) -> Option<Likely> {
        let model = self.balance.model;
        if let Some(off) = self.balance.off_surface {
            let name = model.terms()[off.term].name().to_owned();
            return Some(Likely::OffSurface { name, element: off.at.element, position: off.position });
        }
        let most = model.descending_fibres(failed).into_iter().max_by(|a, b| a.stretch.total_cmp(&b.stretch))?;
        Some(most.told(model))
    }

    /// The states at which the tangent at hand was factorised and assembled: what further answers depend on, to the last bit,
    /// beside what is asked. `None` where there is none.
    pub fn tangent_states(&self) -> Option<[State; 2]> {
        self.balance.tangent_states()
    }

    /// Makes the tangent anew from such states, or forgets the one at hand.
    ///
    /// # Errors
    /// Where it cannot be factorised.
    pub fn restore_tangent(&mut self, states: Option<&[State; 2]>) -> Result<()> {
        self.balance.restore_tangent(states)
    }

    /// Solves K x = b with the tangent at the equilibrium `state` for several right-hand sides, one after the other in
    /// `rhs`. The factor of Newton's last iteration is reused and the solution refined against the tangent at `state`.
    ///
    /// # Errors
    /// Where the tangent cannot be factorised, or the refined solution does not reach 1e-9.
    pub fn solve_with_tangent(&mut self, state: &State, rhs: &mut [f64], columns: usize) -> Result<()> {
        self.balance.solve_with_tangent(state, rhs, columns)
    }

    /// The equilibrium near `state`, in which all prescribed motion is done, by undamped Newton steps that end with one that
    /// is no more than `part` of the whole way. Where such a step does not lower the residual, `state` is not near, and the
    /// equilibrium is sought in full, with damped steps and if need be by letting the body go.
    ///
    /// # Errors
    /// As [`Solver::solve_with_tangent`]; no equilibrium.
    pub fn corrected(&mut self, state: &State, part: f64) -> Result<State> {
        if let Some(corrected) = self.balance.corrected(state, part, self.settings.max_iterations)? {
            return Ok(corrected);
        }
        self.balance.set_target(Drive { controls: state.controls.clone(), load: state.load });
        let limits = Limits { iterations: self.settings.max_iterations, ..LIMITS };
        let outcome = self.solve(state.clone(), limits)?;
        let found = match outcome.stop {
            None => outcome.state,
            Some(stop) => match self.release(&[], state, state) {
                Some(released) => released.state,
                None => return Err(self.not_converged(&Stepper::at_end(), stop, &outcome)),
            },
        };
        Ok(self.close_gaps(found, Vec::new(), Vec::new())?.state)
    }

    /// d(unknowns)/d(control) at the equilibrium `state` by the implicit function theorem, for each of `controls`.
    /// [`Model::displacement_rate`] adds the motion of faces on bones.
    ///
    /// # Errors
    /// As [`Solver::solve_with_tangent`].
    pub fn rates(&mut self, state: &State, controls: &[usize]) -> Result<Vec<Vec<f64>>> {
        let n = self.model().numbering().unknowns();
        Ok(self.balance.rates(state, controls)?.chunks_exact(n.max(1)).map(<[f64]>::to_vec).collect())
    }

    /// d(b . du)/d(control) for the forces b on all displacement parameters and each of `controls`: the pull-back of
    /// [`Solver::rates`] with the motion of faces on bones, by one solve for all controls (the adjoint of the tangent). `None`
    /// where the factor at hand is too old for it: a new one serves all the rates.
    ///
    /// # Errors
    /// As [`Solver::solve_with_tangent`].
    pub fn pulled_back(&mut self, state: &State, pull: &[[f64; 3]], controls: &[usize]) -> Result<Option<Vec<f64>>> {
        self.balance.pulled_back(state, pull, controls)
    }

    /// Negative modes at the last factorisation: see [`Equilibrium::negative_modes`].
    pub fn negative_modes(&self) -> Option<usize> {
        self.balance.negative_modes()
    }
}

fn step(place: f64, kind: StepKind, last: Assessment, iterations: Vec<Iteration>) -> Step {
    Step { place, kind, iterations, residual: last.residual, required: last.required }
}

/// Even steps along a path are even in ln(activation + onset) of the control that changes most:
/// s(t) = (exp(c t) - 1) / (exp(c) - 1), or s = t where no control changes.
struct Warp {
    exponent: f64,
}

impl Warp {
    fn place(&self, t: f64) -> f64 {
        if self.exponent.abs() < 1e-3 || t == 1.0 { t } else { (self.exponent * t).exp_m1() / self.exponent.exp_m1() }
    }
}

/// The drive at a place on the straight path.
fn between(from: &Drive, to: &Drive, place: f64) -> Drive {
    let mix = |a: f64, b: f64| if place == 1.0 { b } else { a + place * (b - a) };
    Drive {
        controls: from.controls.iter().zip(&to.controls).map(|(a, b)| mix(*a, *b)).collect(),
        load: mix(from.load, to.load),
    }
}

/// Evaluates a model once, with a workspace of its own.
pub fn evaluate(model: &Model, state: &State) -> Evaluation {
    model.evaluate(state, Want::Force, None, &mut Workspace::default())
}

/// Seconds since an instant.
fn seconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64()
}
