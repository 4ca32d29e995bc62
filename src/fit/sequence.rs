//! A clip, frame after frame: each fit starts where the last one ended.

use super::covariance::{Bound, standard_deviations};
use super::frame::{FrameProblem, Measured};
use super::gauss_newton::{GaussNewton, GaussNewtonState, Range};
use super::placement::{Marker, check_units, place};
use super::sensitivity::Sensitivity;
use crate::error::{Error, Result};
use crate::forward::{Drive, Equilibrium, Settings, Solver, Work};
use crate::markers::Recording;
use crate::model::{Model, State};
use crate::scene::{FitSpec, Scene, SensitivitySpec};
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{Executor, KV, State as _, TerminationReason, TerminationStatus};
use std::sync::{Arc, Mutex, PoisonError};

/// The fit of a recording.
pub struct Fit<'m> {
    solver: Solver<'m>,
    markers: Vec<Marker>,
    /// Controls that are sought.
    unknowns: Vec<usize>,
    /// Values of all controls where they are not sought.
    held: Vec<f64>,
    sensitivity: Sensitivity,
    tolerance: f64,
    max_iterations: usize,
    /// Whether every marker has a standard deviation; otherwise the residuals estimate one.
    known_sd: bool,
    /// The equilibrium of the last frame.
    last: Equilibrium,
}

/// One iteration of a frame's fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitIteration {
    /// 1/2 sum of squared weighted residuals after it.
    pub cost: f64,
    /// Largest change of a control.
    pub step: f64,
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
}

impl<'m> Fit<'m> {
    /// Prepares the fit of a recording with the model of a scene.
    ///
    /// # Errors
    /// Markers that do not belong to the recording or the surface, units that look wrong, no equilibrium at the start.
    pub fn new(model: &'m Model, scene: &Scene, fit: &FitSpec, recording: &Recording) -> Result<Fit<'m>> {
        let markers = place(scene, fit, model.mesh(), recording)?;
        check_units(&markers, model.mesh(), recording, fit)?;
        let settings = settings(scene);
        let mut solver = Solver::new(model, settings)?;
        let unknowns: Vec<usize> =
            fit.unknowns.iter().flat_map(|name| model.muscle_controls(name)).copied().collect();
        let mut held = vec![0.0; model.controls().len()];
        for control in &scene.controls {
            let own = model.muscle_controls(&control.name);
            for (k, value) in own.iter().zip(control.value.constants(own.len()).unwrap_or_default()) {
                if !unknowns.contains(k) {
                    held[*k] = value;
                }
            }
        }
        let start = Drive { controls: held.clone(), load: 1.0 };
        let last = solver.equilibrium(&model.rest(), &start)?;
        let sensitivity = match fit.sensitivity {
            SensitivitySpec::Tangent => Sensitivity::Tangent,
            SensitivitySpec::FiniteDifference => Sensitivity::FiniteDifference { step: fit.finite_difference_step },
        };
        Ok(Fit {
            known_sd: markers.iter().all(|m| m.sd.is_some()),
            solver,
            markers,
            unknowns,
            held,
            sensitivity,
            tolerance: fit.tolerance,
            max_iterations: fit.max_iterations,
            last,
        })
    }

    /// The markers as they were placed.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// Indices of the controls that are sought.
    pub fn unknowns(&self) -> &[usize] {
        &self.unknowns
    }

    /// Work done so far.
    pub fn work(&self) -> Work {
        self.solver.work()
    }

    /// Fits one frame, starting from the last one that was fitted.
    ///
    /// # Errors
    /// A frame without markers, a fit that does not converge, an equilibrium that is not found. The next frame then starts
    /// from the last good one.
    pub fn frame(&mut self, recording: &Recording, frame: usize) -> Result<Estimate> {
        let shown = &recording.frames[frame];
        let measured_mm: Vec<Option<[f64; 3]>> = self.markers.iter().map(|m| shown.positions_mm[m.column]).collect();
        let measured: Vec<Measured> = measured_mm
            .iter()
            .enumerate()
            .filter_map(|(marker, position)| {
                let weight = 1.0 / self.markers[marker].sd.unwrap_or(1.0);
                position.map(|position| Measured { marker, position, weight })
            })
            .collect();
        if measured.is_empty() {
            return Err(Error::NoMarkersInFrame { frame, time_s: shown.time_s });
        }

        let controls = self.solver.model().controls();
        let ranges: Vec<Range> = self
            .unknowns
            .iter()
            .map(|k| Range { lower: controls[*k].lower, upper: controls[*k].upper, onset: controls[*k].onset })
            .collect();
        let start: Vec<f64> = self.unknowns.iter().map(|k| self.last.state.controls[*k]).collect();
        let log = Log::default();
        let residual_count = 3 * measured.len();
        let problem = FrameProblem::new(
            &mut self.solver,
            &self.markers,
            measured,
            &self.unknowns,
            self.sensitivity,
            Drive { controls: self.held.clone(), load: 1.0 },
            self.last.clone(),
        );
        let solver = GaussNewton::new(ranges.clone(), self.tolerance);
        let iterations = self.max_iterations as u64;
        let mut result = Executor::new(problem, solver)
            .configure(|state: GaussNewtonState| state.param(start).max_iters(iterations))
            .add_observer(log.clone(), ObserverMode::Always)
            .timer(false)
            .ctrlc(false)
            .run()
            .map_err(own_error)?;

        let iterations = log.take();
        let reason = match result.state.get_termination_status() {
            TerminationStatus::Terminated(TerminationReason::SolverConverged) => None,
            TerminationStatus::Terminated(TerminationReason::SolverExit(_)) => Some("no step lowers the objective"),
            TerminationStatus::Terminated(TerminationReason::MaxItersReached) => Some("the iterations were used up"),
            TerminationStatus::Terminated(_) | TerminationStatus::NotTerminated => Some("it was ended from outside"),
        };
        if let Some(reason) = reason {
            return Err(Error::FitNotConverged {
                frame,
                iterations: iterations.len(),
                reason,
                step: iterations.last().map_or(f64::INFINITY, |i| i.step),
                required: self.tolerance,
            });
        }
        let jacobian = result.state.take_jacobian();
        let cost = result.state.get_cost();
        let Some(problem) = result.problem.take_problem() else {
            return Err(Error::FitNotConverged {
                frame,
                iterations: iterations.len(),
                reason: "the problem was lost",
                step: f64::INFINITY,
                required: self.tolerance,
            });
        };
        self.last = problem.into_equilibrium();

        let model = self.solver.model();
        let state: &State = &self.last.state;
        let mut bounds = vec![Bound::Free; model.controls().len()];
        for (k, bound) in bounds.iter_mut().enumerate() {
            let (value, control) = (state.controls[k], &model.controls()[k]);
            if value <= control.lower {
                *bound = Bound::Lower;
            } else if value >= control.upper {
                *bound = Bound::Upper;
            }
        }
        let mut sd = vec![None; model.controls().len()];
        if let Some(jacobian) = jacobian {
            let sought: Vec<Bound> = self.unknowns.iter().map(|k| bounds[*k]).collect();
            let free = sought.iter().filter(|b| **b == Bound::Free).count();
            // unit variance where deviations are known, the residuals' own where they are not
            let variance = if self.known_sd {
                Some(1.0)
            } else {
                (residual_count > free).then(|| 2.0 * cost / (residual_count - free) as f64)
            };
            if let Some(variance) = variance {
                for (k, unit) in self.unknowns.iter().zip(standard_deviations(&jacobian, &sought)) {
                    sd[*k] = unit.map(|unit| unit * variance.sqrt());
                }
            }
        }
        let x = model.current(state);
        let positions_mm: Vec<[f64; 3]> =
            self.markers.iter().map(|m| model.mesh().interpolate(m.point, &x)).collect();
        let distances: Vec<f64> = positions_mm
            .iter()
            .zip(&measured_mm)
            .filter_map(|(x, z)| z.map(|z| crate::math::tensor::norm(crate::math::tensor::subtract(*x, z))))
            .collect();
        let rms_mm = (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt();
        let max_mm = distances.iter().copied().fold(0.0, f64::max);
        Ok(Estimate {
            frame,
            time_s: shown.time_s,
            equilibrium: self.last.clone(),
            sd,
            bounds,
            positions_mm,
            measured_mm,
            rms_mm,
            max_mm,
            iterations,
        })
    }
}

/// The solver settings of a scene.
pub fn settings(scene: &Scene) -> Settings {
    let s = &scene.solver;
    Settings { tolerance: s.tolerance, max_iterations: s.max_iterations, step_max: s.step_max, step_min: s.step_min }
}

/// argmin wraps errors; ours come out again as they went in.
fn own_error(error: argmin::core::Error) -> Error {
    error.downcast::<Error>().unwrap_or_else(|other| Error::Optimiser { message: other.to_string() })
}

/// An argmin observer that keeps what each iteration did.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<FitIteration>>>);

impl Log {
    fn take(&self) -> Vec<FitIteration> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Observe<GaussNewtonState> for Log {
    fn observe_iter(&mut self, state: &GaussNewtonState, kv: &KV) -> std::result::Result<(), argmin::core::Error> {
        let number = |key: &str| kv.get(key).and_then(|v| v.get_float()).unwrap_or(f64::NAN);
        let rejected = kv.get("rejected").and_then(|v| v.get_uint()).unwrap_or(0);
        let iteration =
            FitIteration { cost: state.get_cost(), step: number("step"), trust: number("trust"), rejected };
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(iteration);
        Ok(())
    }
}
