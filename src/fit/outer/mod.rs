//! What does not change from frame to frame, found from several of them: stiffness, strength, the angle of fibres.
//!
//! With p these unknowns (factors as their logarithms, angles in degrees) and q_t the controls of frame t,
//!
//!   minimise over p:  V(p) = sum over t  min over q_t of the objective of frame t  + 1/2 sum (p - p_0)^2 / sd^2
//!
//! The inner minimum is the fit of a frame as it is everywhere else; p changes the scene, and the model is built anew. V has the
//! gradient of the objective by p alone, since that by q vanishes on controls that are free. Its second derivative is the Schur
//! complement of the joint one (variable projection, Golub and Pereyra 1973; with the derivative of Kaufman 1975)
//!
//!   D - B^T A^-1 B,   A = the objective's by q,   B = J_q^T W J_p,   D = J_p^T W J_p
//!
//! J_p = d(weighted residual)/dp at fixed q is a difference of equilibria on both sides. The iteration is Gauss-Newton with
//! bounds, run by argmin ([`gauss_newton`](super::gauss_newton)).
//!
//! [`confounding`] says how far the answer can be told from the controls.

mod confounding;
mod profile;

pub use confounding::{Confounding, FrameConfounding};

use super::Estimate;
use super::covariance::SymmetricInverse;
use super::estimate::FitIteration;
use super::gauss_newton::{GaussNewton, GaussNewtonState, Range, Tolerance};
use super::identifiability::RANGE_ALONE;
use super::observed::{Log, own_error};
use crate::error::{Error, Result};
use crate::markers::Recording;
use crate::math::normal::TWO_SIDED_95;
use crate::scene::{FitSpec, OuterSpec, OuterUnknown, Scene};
use argmin::core::observers::ObserverMode;
use argmin::core::{Executor, State as _, TerminationReason, TerminationStatus};
use nalgebra::DMatrix;
use profile::Profile;

/// Posterior over prior variance above which an unknown has not been told.
const PRIOR_DOMINATED: f64 = 0.5;
/// The response to an outer unknown is about even in itself: its onset lies this many ranges away.
const EVEN: f64 = 1e3;

/// An unknown that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// What it is.
    pub unknown: OuterUnknown,
    /// Its value: a factor, or degrees.
    pub value: f64,
    /// Its standard deviation: of the logarithm of a factor, or degrees; `None` where it lies on a bound.
    pub sd: Option<f64>,
    /// The same if the controls of all frames were known.
    pub sd_with_known_controls: Option<f64>,
    /// The standard deviation that it has without any marker.
    pub prior_sd: f64,
    /// The values that hold it with a probability of 95 %, within its bounds; all of them where it lies on one.
    pub interval: [f64; 2],
    /// Whether the markers take less than half of the variance away that it has without them.
    pub prior_dominated: bool,
}

/// Frames of which the fit without and with what was found is compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compared {
    /// Index of the frame in the recording.
    pub frame: usize,
    /// Whether it had no say.
    pub held_out: bool,
    /// Root mean square distance of its markers with the problem as it was, mm; `None` where that fit failed.
    pub before_mm: Option<f64>,
    /// The same with what was found.
    pub after_mm: Option<f64>,
}

/// The end of the search.
pub struct Outcome {
    /// One per unknown.
    pub found: Vec<Found>,
    /// The scene with them.
    pub scene: Scene,
    /// Correlations between their errors.
    pub correlation: DMatrix<f64>,
    /// What they have to do with the controls, frame by frame.
    pub confounding: Confounding,
    /// The frames that were used, then those held out.
    pub frames: Vec<Compared>,
    /// Estimates of the frames that were used, with what was found.
    pub estimates: Vec<Estimate>,
    /// Gauss-Newton iterations.
    pub iterations: Vec<FitIteration>,
}

impl Outcome {
    /// The values that were found.
    pub fn values(&self) -> Vec<f64> {
        self.found.iter().map(|found| found.value).collect()
    }
}

/// Finds what `[fit.outer]` of a scene asks for. `frames` are those that the fit chose; `stop` is asked between evaluations, and
/// `None` comes back where it says so; `tell` hears of every iteration.
///
/// # Errors
/// A frame that does not exist; a frame that cannot be fitted with the problem as it is; no convergence.
pub fn find(
    scene: &Scene,
    specs: (&FitSpec, &OuterSpec),
    clip: (&Recording, &[usize]),
    stop: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(String),
) -> Result<Option<Outcome>> {
    match search(scene, specs, clip, stop, tell) {
        Err(_) if stop() => Ok(None),
        outcome => outcome.map(Some),
    }
}

/// Whether the recording has the frames that are named.
///
/// # Errors
/// [`Error::NoSuchFrame`].
pub fn exist(outer: &OuterSpec, recording: &Recording) -> Result<()> {
    let count = recording.frames.len();
    match outer.frames.iter().flatten().chain(&outer.held_out).find(|frame| **frame >= count) {
        Some(&frame) => Err(Error::NoSuchFrame { frame, count, place: Box::new(outer.place.clone()) }),
        None => Ok(()),
    }
}

fn search(
    scene: &Scene,
    (fit, outer): (&FitSpec, &OuterSpec),
    (recording, frames): (&Recording, &[usize]),
    stop: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(String),
) -> Result<Outcome> {
    let used = outer.frames.as_deref().unwrap_or(frames).iter().copied();
    let used: Vec<usize> = used.filter(|frame| !outer.held_out.contains(frame)).collect();
    exist(outer, recording)?;
    let range = |unknown: &OuterUnknown| {
        let [lower, upper] = unknown.bounds.map(|bound| searched(unknown, bound));
        Range { lower, upper, onset: EVEN * (upper - lower) }
    };
    let ranges: Vec<Range> = outer.unknowns.iter().map(range).collect();
    let start: Vec<f64> = outer.unknowns.iter().map(|unknown| searched(unknown, unknown.what.neutral())).collect();
    let prior: Vec<f64> =
        outer.unknowns.iter().zip(&ranges).map(|(unknown, range)| prior_sd(unknown, range)).collect();
    let profile = Profile::new(scene, fit, outer, recording, (used, start.clone(), prior.clone()), stop);
    let log = Log::default();
    let most = outer.max_iterations as u64;
    let before = profile.marker_rms(&start, &outer.held_out);
    tell(format!("{} frames with the problem as it is: {}", profile.frames().len(), profile.told(&start)?));
    let run = Executor::new(profile, GaussNewton::new(ranges.clone(), Tolerance::Change(outer.tolerance)))
        .configure(|state: GaussNewtonState| state.param(start.clone()).max_iters(most))
        .add_observer(log.clone(), ObserverMode::Always)
        .timer(false)
        .ctrlc(false)
        .run();
    let mut result = run.map_err(own_error)?;
    let iterations = log.take();
    let reason = match result.state.get_termination_status() {
        TerminationStatus::Terminated(TerminationReason::SolverConverged) => None,
        TerminationStatus::Terminated(TerminationReason::SolverExit(_)) => Some("no step lowers the objective"),
        TerminationStatus::Terminated(TerminationReason::MaxItersReached) => Some("the iterations were used up"),
        TerminationStatus::Terminated(_) | TerminationStatus::NotTerminated => Some("it was ended from outside"),
    };
    let (Some(mut profile), Some(p), None) = (result.problem.take_problem(), result.state.take_param(), reason)
    else {
        return Err(Error::OuterNotConverged {
            iterations: iterations.len(),
            reason: reason.unwrap_or("the optimiser lost its state"),
            step: iterations.last().map_or(f64::INFINITY, |i| i.step),
            required: outer.tolerance,
            place: Box::new(outer.place.clone()),
        });
    };
    tell(format!("after {} iterations: {}", iterations.len(), profile.told(&p)?));
    let after = profile.marker_rms(&p, &outer.held_out);
    let first = profile.marker_rms_used(&start);
    let second = profile.marker_rms_used(&p);
    let compared = |held_out: bool| {
        move |((frame, before_mm), after_mm): ((&usize, Option<f64>), Option<f64>)| Compared {
            frame: *frame,
            held_out,
            before_mm,
            after_mm,
        }
    };
    let mut compare: Vec<Compared> = profile.frames().iter().zip(first).zip(second).map(compared(false)).collect();
    compare.extend(outer.held_out.iter().zip(before).zip(after).map(compared(true)));

    let values: Vec<f64> = outer.unknowns.iter().zip(&p).map(|(unknown, p)| value(unknown, *p)).collect();
    let joint = profile.joint(&p)?;
    let free: Vec<usize> = (0..p.len()).filter(|k| p[*k] > ranges[*k].lower && p[*k] < ranges[*k].upper).collect();
    let part = |m: &DMatrix<f64>| m.select_rows(&free).select_columns(&free);
    let prior_information = DMatrix::from_fn(p.len(), p.len(), |a, b| if a == b { prior[a].powi(-2) } else { 0.0 });
    let covariance = inverse(&part(&(joint.reduced() + &prior_information)));
    let alone = SymmetricInverse::new(&part(&(joint.alone() + &prior_information)));
    let confounding = Confounding::new(&joint, &free, &covariance, profile.frames());
    let size = |a: usize| covariance[(a, a)].max(0.0).sqrt();
    let found = |(k, unknown): (usize, &OuterUnknown)| {
        let at = free.iter().position(|f| *f == k);
        let sd = at.map(size);
        let interval = match sd {
            Some(sd) => [-1.0, 1.0].map(|side| {
                let end = p[k] + side * TWO_SIDED_95 * sd;
                value(unknown, end.clamp(ranges[k].lower, ranges[k].upper))
            }),
            None => unknown.bounds,
        };
        Found {
            unknown: unknown.clone(),
            value: values[k],
            sd,
            sd_with_known_controls: at.and_then(|at| alone.variance(at)).map(f64::sqrt),
            prior_sd: prior[k],
            interval,
            prior_dominated: sd.is_none_or(|sd| sd * sd > PRIOR_DOMINATED * prior[k] * prior[k]),
        }
    };
    let mut correlation = DMatrix::identity(p.len(), p.len());
    for (a, k) in free.iter().enumerate() {
        for (b, l) in free.iter().enumerate() {
            correlation[(*k, *l)] = covariance[(a, b)] / (size(a) * size(b)).max(f64::MIN_POSITIVE);
        }
    }
    Ok(Outcome {
        found: outer.unknowns.iter().enumerate().map(found).collect(),
        scene: outer.applied(&values, scene),
        correlation,
        confounding,
        frames: compare,
        estimates: profile.take_estimates(&p),
        iterations,
    })
}

/// As the search sees a value: the logarithm of a factor.
fn searched(unknown: &OuterUnknown, value: f64) -> f64 {
    if unknown.what.is_factor() { value.ln() } else { value }
}

/// The value that the search means.
fn value(unknown: &OuterUnknown, p: f64) -> f64 {
    if unknown.what.is_factor() { p.exp() } else { p }
}

/// What is given, or that of a uniform distribution over the range.
fn prior_sd(unknown: &OuterUnknown, range: &Range) -> f64 {
    unknown.sd.unwrap_or((range.upper - range.lower) / RANGE_ALONE.sqrt())
}

/// Of a symmetric positive definite matrix.
fn inverse(m: &DMatrix<f64>) -> DMatrix<f64> {
    match m.clone().cholesky() {
        Some(factor) => factor.inverse(),
        None => DMatrix::from_diagonal_element(m.nrows(), m.nrows(), f64::INFINITY),
    }
}
