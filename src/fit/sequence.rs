//! A clip, frame after frame: each fit starts where the last one ended.

use super::covariance::{Bound, standard_deviations};
use super::estimate::{Estimate, Memory, Optimum};
use super::frame::{Aims, Directions, FrameProblem, Measured};
use super::free_head;
use super::gauss_newton::{GaussNewton, GaussNewtonState, LeastSquares, Range, Tolerance};
use super::head_error::{HeadError, taken};
use super::identifiability::Evidence;
use super::objective::loss::Loss;
use super::objective::{Objectives, Past};
use super::observed::{Log, own_error};
use super::placement::{Marker, check_units, place};
use super::sensitivity::{Reuse, Sensitivity, rates_at};
use crate::error::{Error, Result};
use crate::forward::{Drive, Equilibrium, Settings, Solver, Watch, Work};
use crate::markers::Recording;
use crate::math::tensor::{norm, subtract};
use crate::mesh::MaterialPoint;
use crate::model::{Control, Model, State};
use crate::scene::{ControlValue, Curves, FitSpec, FitToleranceSpec, HeadSpec, ReuseSpec, Scene, SensitivitySpec};
use argmin::core::observers::ObserverMode;
use argmin::core::{Executor, Jacobian, Operator, State as _, TerminationReason, TerminationStatus};
use nalgebra::DMatrix;

/// Positions of all markers in a frame, mm, and what of them it shows.
pub(super) type Shown = (Vec<Option<[f64; 3]>>, Vec<Measured>);

/// The fit of a recording.
pub struct Fit<'m> {
    pub(super) solver: Solver<'m>,
    pub(super) markers: Vec<Marker>,
    /// Controls that are sought.
    pub(super) unknowns: Vec<usize>,
    /// Values of all controls where they are not sought and do not change.
    pub(super) held: Vec<f64>,
    /// Controls that follow a table over the time of the recording.
    pub(super) held_curves: Vec<HeldCurve>,
    pub(super) sensitivity: Sensitivity,
    pub(super) reuse: Reuse,
    pub(super) tolerance: Tolerance,
    pub(super) max_iterations: usize,
    pub(super) objectives: Objectives,
    /// Frames that were fitted, the last one first.
    pub(super) before: Vec<Past>,
    /// Whether every marker has a standard deviation; otherwise the residuals estimate one.
    pub(super) known_sd: bool,
    /// Whether the motion of the head is estimated too.
    pub(super) free_head: bool,
    /// The equilibrium of the last frame, and the sensitivities there.
    pub(super) last: Equilibrium,
    pub(super) directions: Option<Directions>,
}

impl<'m> Fit<'m> {
    /// Prepares the fit of a recording with the model of a scene.
    ///
    /// # Errors
    /// Markers that do not belong to the recording or the surface, units that look wrong, no equilibrium at the start.
    pub fn new(model: &'m Model, scene: &Scene, fit: &FitSpec, recording: &Recording) -> Result<Fit<'m>> {
        let markers = place(scene, fit, model.mesh(), recording)?;
        check_units(&markers, model.mesh(), recording, fit)?;
        let settings = Settings { release: false, ..settings(scene) };
        let mut solver = Solver::new(model, settings)?;
        let unknowns = sought(fit, model);
        let objectives = Objectives::new(scene, fit, model, &unknowns)?;
        let mut held = vec![0.0; model.controls().len()];
        let mut held_curves = Vec::new();
        let ranges = scene.control_ranges();
        for control in &scene.controls {
            let own = model.controls_of(&control.name);
            if let ControlValue::Csv(path) = &control.value {
                let controls = own.iter().filter(|k| !unknowns.contains(k)).copied().collect();
                let curves = Curves::read(path, &ranges)?;
                held_curves.push(HeldCurve { controls, name: control.name.clone(), curves });
            }
            for (k, value) in own.iter().zip(control.value.constants(own.len()).unwrap_or_default()) {
                if !unknowns.contains(k) {
                    held[*k] = value;
                }
            }
        }
        let first_s = recording.frames.get(fit.frames.first).map_or(0.0, |frame| frame.time_s);
        let start = Drive { controls: held_at(&held, &held_curves, first_s), load: 1.0 };
        let last = solver.equilibrium(&model.rest(), &start)?;
        let sensitivity = match fit.sensitivity {
            SensitivitySpec::Tangent => Sensitivity::Tangent,
            SensitivitySpec::FiniteDifference => Sensitivity::FiniteDifference { step: fit.finite_difference_step },
        };
        let known_sd = markers.iter().all(|m| m.sd.is_some());
        Ok(Fit {
            known_sd,
            free_head: fit.registration.head == HeadSpec::Estimate,
            solver,
            markers,
            unknowns,
            held,
            held_curves,
            sensitivity,
            reuse: match fit.reuse {
                // finite differences are for those who do not trust a tangent
                ReuseSpec::Adjoint if fit.sensitivity == SensitivitySpec::FiniteDifference => Reuse::Fresh,
                ReuseSpec::Fresh => Reuse::Fresh,
                ReuseSpec::Frozen => Reuse::Frozen,
                ReuseSpec::Broyden => Reuse::Broyden,
                ReuseSpec::Adjoint => Reuse::Adjoint,
            },
            tolerance: match fit.tolerance {
                FitToleranceSpec::Change(part) => Tolerance::Change(part),
                FitToleranceSpec::Sds(sds) => Tolerance::Sds { sds, known: known_sd },
            },
            max_iterations: fit.max_iterations,
            objectives,
            before: Vec::new(),
            last,
            directions: None,
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

    /// What the next frame depends on.
    pub fn memory(&self) -> Memory {
        Memory {
            last: self.last.clone(),
            directions: self.directions.clone(),
            before: self.before.clone(),
            tangent: self.solver.tangent_states(),
        }
    }

    /// Goes on from there.
    ///
    /// # Errors
    /// Where the tangent cannot be factorised.
    pub fn restore(&mut self, memory: Memory) -> Result<()> {
        let Memory { last, directions, before, tangent } = memory;
        (self.last, self.directions, self.before) = (last, directions, before);
        self.solver.restore_tangent(tangent.as_ref())
    }

    /// Shows the steps of paths to `watch` from now on.
    pub fn set_watch(&mut self, watch: Watch) {
        self.solver.set_watch(watch);
    }

    /// Work done so far.
    pub fn work(&self) -> Work {
        self.solver.work()
    }

    /// All controls of the model.
    pub fn controls(&self) -> &'m [Control] {
        self.solver.model().controls()
    }

    /// How points of the body move with the controls that are sought, at the state of the frame that was fitted last: mm per
    /// unit of a control, three rows and a column for each. `None` at any other state.
    pub fn rates_at(&self, points: &[MaterialPoint], state: &State) -> Option<Vec<DMatrix<f64>>> {
        let columns = &self.directions.as_ref().filter(|_| self.last.state == *state)?.columns;
        Some(rates_at(self.solver.model(), state, &self.unknowns, columns, points))
    }

    /// Fits one frame, starting from the last one that was fitted.
    ///
    /// # Errors
    /// A frame without markers, a fit that does not converge, an equilibrium that is not found. The next frame then starts
    /// from the last good one.
    pub fn frame(&mut self, recording: &Recording, frame: usize) -> Result<Estimate> {
        let (measured_mm, measured) = self.shown(recording, frame)?;
        let optimum = self.optimise(frame, recording.frames[frame].time_s, measured.clone())?;
        Ok(self.estimate(recording, frame, (measured_mm, measured), optimum))
    }

    /// Lets a body come to rest that was in equilibrium with nearly the same model: same controls, same loads. The next frame
    /// starts from there.
    ///
    /// # Errors
    /// An equilibrium that is not found.
    pub fn settle(&mut self, near: &Equilibrium) -> Result<()> {
        let to = Drive { controls: near.state.controls.clone(), load: near.state.load };
        self.last = self.solver.equilibrium_near(&near.state, &near.state, &to)?;
        self.directions = None;
        Ok(())
    }

    /// Weighted residuals of a frame at the controls of an equilibrium of nearly the same model.
    ///
    /// # Errors
    /// A frame without markers, an equilibrium that is not found.
    pub fn residuals_near(&mut self, recording: &Recording, frame: usize, near: &Equilibrium) -> Result<Vec<f64>> {
        let (_, measured) = self.shown(recording, frame)?;
        self.settle(near)?;
        let q: Vec<f64> = self.unknowns.iter().map(|k| near.state.controls[*k]).collect();
        self.problem(recording.frames[frame].time_s, measured).apply(&q).map_err(own_error)
    }

    /// The estimate of a frame for controls that are known, one for each that is sought: nothing is searched.
    ///
    /// # Errors
    /// A frame without markers, an equilibrium that is not found.
    pub fn at(&mut self, recording: &Recording, frame: usize, q: Vec<f64>) -> Result<Estimate> {
        let (measured_mm, measured) = self.shown(recording, frame)?;
        let problem = self.problem(recording.frames[frame].time_s, measured.clone());
        let residuals = problem.apply(&q).map_err(own_error)?;
        problem.renew();
        let jacobian = problem.jacobian(&q).map_err(own_error)?;
        let held_head = problem.take_held_head();
        let (equilibrium, directions) = problem.into_equilibrium();
        let cost = self.objectives.loss.cost(&residuals);
        let optimum =
            Optimum { equilibrium, directions, jacobian, held_head, residuals, cost, iterations: Vec::new() };
        Ok(self.estimate(recording, frame, (measured_mm, measured), optimum))
    }

    /// Positions of all markers in a frame, and of those that it shows with their weights.
    pub(super) fn measured(&self, recording: &Recording, frame: usize) -> Shown {
        let shown = &recording.frames[frame];
        let all: Vec<Option<[f64; 3]>> = self.markers.iter().map(|m| shown.positions_mm[m.column]).collect();
        let weigh = |(marker, position): (usize, &Option<[f64; 3]>)| {
            let weight = 1.0 / self.markers[marker].sd.unwrap_or(1.0);
            position.map(|position| Measured { marker, position, weight })
        };
        let measured = all.iter().enumerate().filter_map(weigh).collect();
        (all, measured)
    }

    /// The same of a frame that must show some.
    fn shown(&self, recording: &Recording, frame: usize) -> Result<Shown> {
        let (all, measured) = self.measured(recording, frame);
        let time_s = recording.frames[frame].time_s;
        if measured.is_empty() {
            return Err(Error::NoMarkersInFrame { frame, time_s });
        }
        if self.free_head {
            let mesh = self.solver.model().mesh();
            let rest: Vec<[f64; 3]> = measured.iter().map(|m| mesh.position(self.markers[m.marker].point)).collect();
            if free_head::nearest(&rest, &measured, Loss::Quadratic).is_none() {
                return Err(Error::HeadNotSeen { frame, time_s, markers: measured.len() });
            }
        }
        Ok((all, measured))
    }

    /// What is known at the end of a frame, which the next one starts from.
    pub(super) fn estimate(
        &mut self,
        recording: &Recording,
        frame: usize,
        (mut measured_mm, measured): Shown,
        optimum: Optimum,
    ) -> Estimate {
        let time_s = recording.frames[frame].time_s;
        let q: Vec<f64> = self.unknowns.iter().map(|k| optimum.equilibrium.state.controls[*k]).collect();
        let aims = Aims { objectives: &self.objectives, time_s, before: &self.before };
        let (gradient, _) = aims.model(&q, &optimum.residuals, &optimum.jacobian);
        let mut information = self.objectives.loss.model(&optimum.residuals, &optimum.jacobian).1;
        let (prior, costs) = (aims.prior(&q), aims.values(&q, &optimum.residuals));
        let response = &information + &prior - aims.tied(&q);
        let (bounds, mut sd, variance) = self.uncertainty(&optimum, &(&information + &prior));
        if let (Some(error), Some(variance)) = (HeadError::of(recording, frame), variance.filter(|v| *v > 0.0)) {
            let sought: Vec<Bound> = self.unknowns.iter().map(|k| bounds[*k]).collect();
            let across = error.across(self.objectives.loss, (&optimum).into(), &measured);
            let whole = (error.own + error.common) / variance;
            information -= taken(&(&information + &prior), &across, &whole, &sought);
            for (k, unit) in self.unknowns.iter().zip(standard_deviations(&(&information + &prior), &sought)) {
                sd[*k] = unit.map(|unit| unit * variance.sqrt());
            }
        }
        (self.last, self.directions) = (optimum.equilibrium, optimum.directions);

        let model = self.solver.model();
        let x = model.current(&self.last.state);
        let positions_mm: Vec<[f64; 3]> =
            self.markers.iter().map(|m| model.mesh().interpolate(m.point, &x)).collect();
        let shown: Vec<[f64; 3]> = measured.iter().map(|m| positions_mm[m.marker]).collect();
        let loss = self.objectives.loss;
        let back = if self.free_head { free_head::nearest(&shown, &measured, loss) } else { None };
        let head = back.zip(optimum.held_head).map(|(back, held)| {
            measured_mm.iter_mut().flatten().for_each(|z| *z = back.place(*z));
            let sought: Vec<Bound> = self.unknowns.iter().map(|k| bounds[*k]).collect();
            let rho = free_head::weights(&shown, &measured, &back, loss);
            free_head::describe(&back, (&measured, &rho), &held, &sought, variance)
        });
        let pairs = positions_mm.iter().zip(&measured_mm);
        let distances: Vec<f64> = pairs.filter_map(|(x, z)| z.map(|z| norm(subtract(*x, z)))).collect();
        let estimate = Estimate {
            frame,
            time_s,
            equilibrium: self.last.clone(),
            sd,
            bounds,
            rms_mm: (distances.iter().map(|d| d * d).sum::<f64>() / distances.len().max(1) as f64).sqrt(),
            max_mm: distances.iter().copied().fold(0.0, f64::max),
            positions_mm,
            measured_mm,
            iterations: optimum.iterations,
            information,
            prior,
            response,
            gradient,
            weights: self.objectives.loss.weights(&optimum.residuals),
            costs,
            jacobian: optimum.jacobian,
            residuals: optimum.residuals,
            variance,
            bridged: false,
            head,
        };
        self.remember(&estimate);
        estimate
    }

    /// A frame as a least-squares problem that starts where the last frame ended.
    fn problem(&mut self, time_s: f64, measured: Vec<Measured>) -> FrameProblem<'_, 'm> {
        let aims = Aims { objectives: &self.objectives, time_s, before: &self.before };
        let drive = Drive { controls: held_at(&self.held, &self.held_curves, time_s), load: 1.0 };
        FrameProblem::new(
            &mut self.solver,
            &self.markers,
            measured,
            &self.unknowns,
            (self.sensitivity, self.reuse),
            (drive, aims),
            self.last.clone(),
            self.directions.clone(),
        )
        .with_free_head(self.free_head)
    }

    /// Runs the Gauss-Newton iteration of a frame through argmin's executor.
    fn optimise(&mut self, frame: usize, time_s: f64, measured: Vec<Measured>) -> Result<Optimum> {
        let model = self.solver.model();
        let ranges = self.unknowns.iter().map(|k| Range::of(&model.controls()[*k])).collect();
        let start: Vec<f64> = self.unknowns.iter().map(|k| self.last.state.controls[*k]).collect();
        let log = Log::default();
        let (tolerance, reuse) = (self.tolerance, self.reuse);
        let most = self.max_iterations as u64;
        let solver = GaussNewton::new(ranges, tolerance);
        let solver = if reuse == Reuse::Fresh { solver } else { solver.with_kept_jacobians() };
        let mut result = Executor::new(self.problem(time_s, measured), solver)
            .configure(|state: GaussNewtonState| state.param(start).max_iters(most))
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
        let residuals = result.state.take_residuals();
        match (reason, result.problem.take_problem(), result.state.take_jacobian().zip(residuals)) {
            (None, Some(problem), Some((jacobian, residuals))) => {
                let held_head = problem.take_held_head();
                let (equilibrium, directions) = problem.into_equilibrium();
                let cost = 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
                Ok(Optimum { equilibrium, directions, jacobian, held_head, residuals, cost, iterations })
            }
            (reason, ..) => Err(Error::FitNotConverged {
                frame,
                iterations: iterations.len(),
                reason: reason.unwrap_or("the optimiser lost its state"),
                left: iterations.last().map_or(f64::INFINITY, |i| i.left),
                required: tolerance.size(),
            }),
        }
    }

    /// Keeps what the next frames expect. A control on a bound is as uncertain as its one-sided interval says.
    fn remember(&mut self, estimate: &Estimate) {
        let Some(evidence) = Evidence::of(estimate, self.controls(), &self.unknowns) else { return };
        if self.objectives.smoothness.is_none() {
            return;
        }
        let covariance = evidence.covariance();
        self.before
            .insert(0, Past { time_s: estimate.time_s, a: self.objectives.parts_of(&evidence.values), covariance });
        self.before.truncate(Past::KEPT);
    }

    /// What is minimised, in a line.
    pub fn words(&self) -> String {
        self.objectives.words()
    }

    /// Where the controls lie, their standard deviations and the variance of a weighted residual: with the given deviations
    /// of the markers, or with what the residuals of the frame estimate where not all are given. `whole` is the information of the frame.
    #[allow(clippy::type_complexity)] // three things that belong together
    fn uncertainty(&self, optimum: &Optimum, whole: &DMatrix<f64>) -> (Vec<Bound>, Vec<Option<f64>>, Option<f64>) {
        let values = optimum.equilibrium.state.controls.iter();
        let bound = |(value, control): (&f64, &Control)| match value {
            value if *value <= control.lower => Bound::Lower,
            value if *value >= control.upper => Bound::Upper,
            _ => Bound::Free,
        };
        let bounds: Vec<Bound> = values.zip(self.solver.model().controls()).map(bound).collect();
        let sought: Vec<Bound> = self.unknowns.iter().map(|k| bounds[*k]).collect();
        let free = sought.iter().filter(|b| **b == Bound::Free).count();
        // where the head is estimated it takes six of them
        let residuals = optimum.residuals.len().saturating_sub(if self.free_head { 6 } else { 0 });
        let variance = if self.known_sd {
            Some(1.0)
        } else {
            (residuals > free).then(|| 2.0 * optimum.cost / (residuals - free) as f64)
        };
        let mut sd = vec![None; bounds.len()];
        for (k, unit) in self.unknowns.iter().zip(standard_deviations(whole, &sought)) {
            sd[*k] = unit.zip(variance).map(|(unit, variance)| unit * variance.sqrt());
        }
        (bounds, sd, variance)
    }
}

/// Controls of one name that are not sought and follow a table.
pub(super) struct HeldCurve {
    controls: Vec<usize>,
    name: String,
    curves: Curves,
}

/// The controls that are not sought, at a time in seconds; those that are, are 0.
pub(super) fn held_at(held: &[f64], curves: &[HeldCurve], time_s: f64) -> Vec<f64> {
    let mut held = held.to_vec();
    for HeldCurve { controls, name, curves } in curves {
        if let Some(value) = curves.at(name, time_s) {
            controls.iter().for_each(|k| held[*k] = value);
        }
    }
    held
}

/// The controls that a fit seeks, in its order.
pub fn sought(fit: &FitSpec, model: &Model) -> Vec<usize> {
    fit.unknowns.iter().flat_map(|name| model.controls_of(name)).collect()
}

/// The solver settings of a scene.
pub fn settings(scene: &Scene) -> Settings {
    let s = &scene.solver;
    Settings {
        tolerance: s.tolerance,
        max_iterations: s.max_iterations,
        step_max: s.step_max,
        step_min: s.step_min,
        precision: s.precision,
        ..Settings::default()
    }
}
