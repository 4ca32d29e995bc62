//! The profiled objective: for every value of the outer unknowns the frames fitted anew.

use super::super::covariance::{Bound, SymmetricInverse};
use super::super::gauss_newton::LeastSquares;
use super::super::objective::loss::Loss;
use super::super::{Estimate, Fit};
use super::value;
use crate::error::{Error, Result};
use crate::forward::Equilibrium;
use crate::markers::Recording;
use crate::model::build::build;
use crate::scene::{FitSpec, OuterSpec, OuterUnknown, Scene};
use argmin::core::{Jacobian, Operator};
use nalgebra::DMatrix;
use std::cell::RefCell;

/// How much tighter than a fit's own equilibria those of differences are solved.
const TIGHTER: f64 = 1e-4;
/// The change of the logarithm of a factor, and of an angle (degrees), to both sides.
const FACTOR_STEP: f64 = 1e-3;
const ANGLE_STEP: f64 = 0.1;
/// Evaluations that are kept: the start, the base of a step and the last trials.
const KEPT: usize = 4;

/// The objective of the outer unknowns.
pub(super) struct Profile<'a> {
    scene: &'a Scene,
    fit: &'a FitSpec,
    outer: &'a OuterSpec,
    recording: &'a Recording,
    frames: Vec<usize>,
    start: Vec<f64>,
    prior_sd: Vec<f64>,
    stop: &'a dyn Fn() -> bool,
    known: RefCell<Vec<Evaluation>>,
}

/// The frames at one value of the unknowns.
struct Evaluation {
    p: Vec<f64>,
    estimates: Vec<Estimate>,
    /// The controls that are sought.
    unknowns: Vec<usize>,
    /// d(weighted residual)/dp of every frame, once it is asked for.
    rates: Option<Vec<DMatrix<f64>>>,
}

/// Second derivative and gradient of the objective by the controls of every frame and the outer unknowns.
pub(super) struct Joint {
    /// Of every frame.
    pub frames: Vec<JointFrame>,
    unknowns: usize,
}

/// The blocks of a frame; controls are those that are free.
pub(super) struct JointFrame {
    /// How many controls are sought.
    pub controls: usize,
    /// The free controls, as indices of those that are sought.
    pub free: Vec<usize>,
    /// A^-1.
    pub inverse: DMatrix<f64>,
    /// B, a row for every free control.
    pub across: DMatrix<f64>,
    /// D.
    pub alone: DMatrix<f64>,
    /// By the outer unknowns.
    pub gradient: Vec<f64>,
}

impl Joint {
    /// The sum of D - B^T A^-1 B.
    pub fn reduced(&self) -> DMatrix<f64> {
        let own = |f: &JointFrame| &f.alone - f.across.transpose() * &f.inverse * &f.across;
        self.frames.iter().map(own).fold(DMatrix::zeros(self.unknowns, self.unknowns), |sum, own| sum + own)
    }

    /// The sum of D: with known controls.
    pub fn alone(&self) -> DMatrix<f64> {
        self.frames.iter().fold(DMatrix::zeros(self.unknowns, self.unknowns), |sum, f| sum + &f.alone)
    }

    fn gradient(&self) -> Vec<f64> {
        (0..self.unknowns).map(|k| self.frames.iter().map(|f| f.gradient[k]).sum()).collect()
    }
}

impl<'a> Profile<'a> {
    pub fn new(
        scene: &'a Scene,
        fit: &'a FitSpec,
        outer: &'a OuterSpec,
        recording: &'a Recording,
        (frames, start, prior_sd): (Vec<usize>, Vec<f64>, Vec<f64>),
        stop: &'a dyn Fn() -> bool,
    ) -> Profile<'a> {
        let known = RefCell::default();
        Profile { scene, fit, outer, recording, frames, start, prior_sd, stop, known }
    }

    /// The frames that are used.
    pub fn frames(&self) -> &[usize] {
        &self.frames
    }

    /// A line about an evaluation.
    pub fn told(&self, p: &[f64]) -> Result<String> {
        let rms = self.at(p, |at| mean_square(at.estimates.iter().map(|e| e.rms_mm)).sqrt())?;
        let values = self.outer.unknowns.iter().zip(p).map(|(unknown, p)| {
            format!("{} {:.4} {}", unknown.what.label(), value(unknown, *p), unknown.what.unit())
        });
        Ok(format!("{}; markers {rms:.4} mm", values.collect::<Vec<_>>().join(", ")))
    }

    /// Root mean square distances of the markers in the frames that are used.
    pub fn marker_rms_used(&self, p: &[f64]) -> Vec<Option<f64>> {
        let rms = self.at(p, |at| at.estimates.iter().map(|e| Some(e.rms_mm)).collect());
        rms.unwrap_or_else(|_| vec![None; self.frames.len()])
    }

    /// The same in other frames, which are fitted for it.
    pub fn marker_rms(&self, p: &[f64], frames: &[usize]) -> Vec<Option<f64>> {
        if frames.is_empty() {
            return Vec::new();
        }
        let fitted = self.with_model(p, 1.0, |fit| {
            Ok(frames.iter().map(|frame| fit.frame(self.recording, *frame).ok().map(|e| e.rms_mm)).collect())
        });
        fitted.unwrap_or_else(|_| vec![None; frames.len()])
    }

    /// The estimates at a value that was evaluated.
    pub fn take_estimates(&mut self, p: &[f64]) -> Vec<Estimate> {
        let known = self.known.get_mut();
        let at = known.iter().position(|at| at.p == p);
        at.map_or_else(Vec::new, |at| known.swap_remove(at).estimates)
    }

    /// All second derivatives.
    pub fn joint(&self, p: &[f64]) -> Result<Joint> {
        self.derive(p)?;
        let loss = Loss::from(self.fit.objectives.loss);
        self.at(p, |at| {
            let rates = at.rates.as_deref().unwrap_or_default();
            let frames = at.estimates.iter().zip(rates);
            let frames = frames.map(|(estimate, rate)| joint_frame(loss, estimate, &at.unknowns, rate));
            Joint { frames: frames.collect(), unknowns: p.len() }
        })
    }

    /// Calls `f` with the evaluation at p, which is made if it is not known.
    fn at<R>(&self, p: &[f64], f: impl FnOnce(&Evaluation) -> R) -> Result<R> {
        if !self.known.borrow().iter().any(|at| at.p == p) {
            let (estimates, unknowns) = self.fitted(p)?;
            let mut known = self.known.borrow_mut();
            if known.len() == KEPT {
                // the start, which comes first, stays: it is compared with at the end
                let rest = known.iter().enumerate().skip(1);
                let farthest = rest.max_by(|a, b| distance(&a.1.p, p).total_cmp(&distance(&b.1.p, p)));
                let farthest = farthest.map_or(KEPT - 1, |(at, _)| at);
                known.remove(farthest);
            }
            known.push(Evaluation { p: p.to_vec(), estimates, unknowns, rates: None });
        }
        let known = self.known.borrow();
        let at = known.iter().find(|at| at.p == p);
        Ok(f(at.unwrap_or_else(|| unreachable!("it was just made"))))
    }

    /// Calls `f` with a fit whose model has the unknowns p and whose equilibria are solved to `tighter` times the tolerance.
    fn with_model<R>(&self, p: &[f64], tighter: f64, f: impl FnOnce(&mut Fit<'_>) -> Result<R>) -> Result<R> {
        if (self.stop)() {
            return Err(Error::Optimiser { message: "it was stopped".into() });
        }
        let values: Vec<f64> = self.outer.unknowns.iter().zip(p).map(|(unknown, p)| value(unknown, *p)).collect();
        let mut scene = self.outer.applied(&values, self.scene);
        scene.solver.tolerance *= tighter;
        let built = build(&scene)?;
        let mut fit = Fit::new(&built.model, &scene, self.fit, self.recording)?;
        f(&mut fit)
    }

    /// Every frame fitted, from where the nearest evaluation has it.
    fn fitted(&self, p: &[f64]) -> Result<(Vec<Estimate>, Vec<usize>)> {
        let known = self.known.borrow();
        let near = known.iter().min_by(|a, b| distance(&a.p, p).total_cmp(&distance(&b.p, p)));
        self.with_model(p, 1.0, |fit| {
            let frame = |(k, frame): (usize, &usize)| {
                if let Some(near) = near {
                    fit.settle(&near.estimates[k].equilibrium)?;
                }
                fit.frame(self.recording, *frame)
            };
            let estimates = self.frames.iter().enumerate().map(frame).collect::<Result<_>>()?;
            Ok((estimates, fit.unknowns().to_vec()))
        })
    }

    /// Finds the derivatives at p, if they are not known.
    fn derive(&self, p: &[f64]) -> Result<()> {
        if self.at(p, |at| at.rates.is_some())? {
            return Ok(());
        }
        let equilibria: Vec<Equilibrium> =
            self.at(p, |at| at.estimates.iter().map(|e| e.equilibrium.clone()).collect())?;
        let mut rates: Vec<DMatrix<f64>> =
            self.at(p, |at| at.estimates.iter().map(|e| DMatrix::zeros(e.residuals.len(), p.len())).collect())?;
        for (k, unknown) in self.outer.unknowns.iter().enumerate() {
            let step = step(unknown);
            for side in [1.0, -1.0] {
                let mut moved = p.to_vec();
                moved[k] += side * step;
                self.with_model(&moved, TIGHTER, |fit| {
                    for ((frame, from), rate) in self.frames.iter().zip(&equilibria).zip(&mut rates) {
                        let residuals = fit.residuals_near(self.recording, *frame, from)?;
                        let column = rate.column_mut(k);
                        let scale = side / (2.0 * step);
                        column.into_iter().zip(residuals).for_each(|(rate, r)| *rate += scale * r);
                    }
                    Ok(())
                })?;
            }
        }
        if let Some(at) = self.known.borrow_mut().iter_mut().find(|at| at.p == p) {
            at.rates = Some(rates);
        }
        Ok(())
    }

    /// 1/2 sum (p - p_0)^2 / sd^2 with its gradient.
    fn prior(&self, p: &[f64]) -> (f64, Vec<f64>) {
        let pull = |((p, start), sd): ((&f64, &f64), &f64)| (p - start) / (sd * sd);
        let gradient: Vec<f64> = p.iter().zip(&self.start).zip(&self.prior_sd).map(pull).collect();
        let value = gradient.iter().zip(p.iter().zip(&self.start)).map(|(g, (p, start))| 0.5 * g * (p - start)).sum();
        (value, gradient)
    }
}

fn step(unknown: &OuterUnknown) -> f64 {
    if unknown.what.is_factor() { FACTOR_STEP } else { ANGLE_STEP }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v * v, count + 1));
    sum / f64::from(count.max(1))
}

/// The blocks of a frame from its derivatives by the controls and by the outer unknowns.
fn joint_frame(loss: Loss, estimate: &Estimate, unknowns: &[usize], rate: &DMatrix<f64>) -> JointFrame {
    let (n, m) = (estimate.jacobian.ncols(), rate.ncols());
    let both =
        DMatrix::from_fn(
            rate.nrows(),
            n + m,
            |row, k| {
                if k < n { estimate.jacobian[(row, k)] } else { rate[(row, k - n)] }
            },
        );
    let (gradient, hessian) = loss.model(&estimate.residuals, &both);
    let free: Vec<usize> = (0..n).filter(|k| estimate.bounds[unknowns[*k]] == Bound::Free).collect();
    let outer: Vec<usize> = (n..n + m).collect();
    let block = |rows: &[usize], columns: &[usize]| hessian.select_rows(rows).select_columns(columns);
    let own = block(&free, &free) + estimate.prior.select_rows(&free).select_columns(&free);
    JointFrame {
        controls: n,
        inverse: SymmetricInverse::new(&own).matrix(),
        across: block(&free, &outer),
        alone: block(&outer, &outer),
        gradient: gradient[n..].to_vec(),
        free,
    }
}

impl LeastSquares for Profile<'_> {
    fn cost(&self, p: &[f64], _: &[f64]) -> f64 {
        let total = |at: &Evaluation| at.estimates.iter().flat_map(|e| &e.costs).map(|(_, cost)| cost).sum::<f64>();
        self.at(p, total).map_or(f64::NAN, |cost| cost + self.prior(p).0)
    }

    fn model(&self, p: &[f64], _: &[f64], _: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
        let Ok(joint) = self.joint(p) else {
            return (vec![f64::NAN; p.len()], DMatrix::from_element(p.len(), p.len(), f64::NAN));
        };
        let prior = self.prior(p).1;
        let gradient = joint.gradient().iter().zip(&prior).map(|(g, prior)| g + prior).collect();
        let mut hessian = joint.reduced();
        self.prior_sd.iter().enumerate().for_each(|(k, sd)| hessian[(k, k)] += 1.0 / (sd * sd));
        (gradient, hessian)
    }
}

impl Operator for Profile<'_> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;

    fn apply(&self, p: &Vec<f64>) -> std::result::Result<Vec<f64>, argmin::core::Error> {
        self.at(p, |at| at.estimates.iter().flat_map(|e| e.residuals.clone()).collect()).map_err(Error::into)
    }
}

impl Jacobian for Profile<'_> {
    type Param = Vec<f64>;
    type Jacobian = DMatrix<f64>;

    fn jacobian(&self, p: &Vec<f64>) -> std::result::Result<DMatrix<f64>, argmin::core::Error> {
        let all = |at: &Evaluation| {
            let rates = at.rates.as_deref().unwrap_or_default();
            let rows: Vec<_> = rates.iter().flat_map(|rate| rate.row_iter().map(|row| row.into_owned())).collect();
            DMatrix::from_rows(&rows)
        };
        self.derive(p).and_then(|()| self.at(p, all)).map_err(Error::into)
    }
}
