//! What is known of a frame that was fitted.

use super::covariance::Bound;
use super::frame::Directions;
use super::free_head::FreeHead;
use super::objective::Past;
use crate::forward::Equilibrium;
use crate::model::State;
use nalgebra::DMatrix;

/// What goes from one frame to the next: with it a fit goes on with the same bits.
#[derive(Debug, Clone)]
pub struct Memory {
    /// The last equilibrium.
    pub last: Equilibrium,
    /// The sensitivities there.
    pub directions: Option<Directions>,
    /// What the next frame is expected to be like.
    pub before: Vec<Past>,
    /// See [`Solver::tangent_states`](crate::forward::Solver::tangent_states).
    pub tangent: Option<[State; 2]>,
}

/// One iteration of a frame's fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitIteration {
    /// The objective after it: 1/2 sum of squared weighted residuals, and what else is asked for.
    pub cost: f64,
    /// Largest change of a control, as a part of its range.
    pub step: f64,
    /// What it leaves, as the tolerance of the fit counts it.
    pub left: f64,
    /// Trust radius after it.
    pub trust: f64,
    /// Steps that were tried and rejected.
    pub rejected: u64,
}

/// The answer of a fit for a frame.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Index of the frame in the recording.
    pub frame: usize,
    /// Its time, s.
    pub time_s: f64,
    /// The equilibrium; all controls are in its state.
    pub equilibrium: Equilibrium,
    /// Standard deviation of each control of the model; `None` on a bound, or where it is not sought or not determined.
    pub sd: Vec<Option<f64>>,
    /// Where each control of the model lies.
    pub bounds: Vec<Bound>,
    /// Model position of every marker, mm.
    pub positions_mm: Vec<[f64; 3]>,
    /// Measured position of every marker, mm; `None` where lost.
    pub measured_mm: Vec<Option<[f64; 3]>>,
    /// Root mean square distance between model and measured markers, mm.
    pub rms_mm: f64,
    /// Largest distance, mm.
    pub max_mm: f64,
    /// Gauss-Newton iterations.
    pub iterations: Vec<FitIteration>,
    /// d(weighted residual)/d(control) at the equilibrium: three rows for every marker that was measured, a column for every
    /// control that is sought.
    pub jacobian: DMatrix<f64>,
    /// Weighted residuals (model - measured) / sd, in the order of those rows.
    pub residuals: Vec<f64>,
    /// How much each measured marker counts with a robust loss, from 1 down to 0.
    pub weights: Vec<f64>,
    /// Name and value of every part of the objective, the markers first.
    pub costs: Vec<(String, f64)>,
    /// What the markers know of the controls that are sought, per unit variance of a weighted residual: J^T J, with a robust
    /// loss less of what lies far off.
    pub information: DMatrix<f64>,
    /// What the rest of the objective adds to it.
    pub prior: DMatrix<f64>,
    /// The second derivative of the objective of this frame alone, without smoothness: an error that all frames share moves the
    /// controls as it says, however they are tied to each other.
    pub response: DMatrix<f64>,
    /// Gradient of the whole objective by the controls that are sought.
    pub gradient: Vec<f64>,
    /// The variance of a weighted residual: 1 where all markers have a standard deviation, else what the residuals of the
    /// frame estimate; `None` where they are too few.
    pub variance: Option<f64>,
    /// Whether its markers were not used: it had failed, and smoothness bridges it.
    pub bridged: bool,
    /// The motion of the head, where it is estimated; measured positions then have it taken out.
    pub head: Option<FreeHead>,
}

/// Where the iteration of a frame ended.
pub(super) struct Optimum {
    pub(super) equilibrium: Equilibrium,
    pub(super) directions: Option<Directions>,
    /// d(weighted residual)/d(unknown control).
    pub(super) jacobian: DMatrix<f64>,
    /// The same with the head held, where that is free.
    pub(super) held_head: Option<DMatrix<f64>>,
    pub(super) residuals: Vec<f64>,
    /// 1/2 sum of squared weighted residuals.
    pub(super) cost: f64,
    pub(super) iterations: Vec<FitIteration>,
}
