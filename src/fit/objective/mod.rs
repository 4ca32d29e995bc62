//! What a fit minimises: one sum, one file per part.
//!
//!   sum over markers 1/2 rho(|m - z|^2 / sd^2) ([`loss`])
//!   + [`effort`] + [`sparsity`] + [`similarity`] + [`smoothness`] + [`prior`]
//!
//! Every part is minus the logarithm of a probability, up to a constant: its weight is a standard deviation. All but the
//! markers depend on the controls alone, as parts a = (q - lower) / (upper - lower) of their ranges.

pub mod effort;
pub mod loss;
pub mod prior;
pub mod similarity;
pub mod smoothness;
pub mod sparsity;

use crate::error::Result;
use crate::model::Model;
use crate::scene::{FitSpec, Scene};
use loss::Loss;
use nalgebra::DMatrix;
use smoothness::Smoothness;

/// Something that is minimised beside the distances of markers.
pub trait Objective: Send + Sync {
    /// The word in tables: its key in the problem.
    fn name(&self) -> &'static str;

    /// What it does and its weight, in a few words.
    fn words(&self) -> String;

    /// Adds value, gradient and a positive semidefinite second derivative.
    fn add(&self, at: &Instant<'_>, sum: &mut Sum);
}

/// Controls at a time.
#[derive(Debug, Clone, Copy)]
pub struct Instant<'a> {
    /// Time, s.
    pub time_s: f64,
    /// The controls that are sought, in parts of their ranges.
    pub a: &'a [f64],
    /// Earlier frames that were fitted, the last one first; none for an objective of the frame alone.
    pub before: &'a [Past],
}

/// A frame that was fitted before.
#[derive(Debug, Clone, PartialEq)]
pub struct Past {
    /// Its time, s.
    pub time_s: f64,
    /// Its controls, in parts of their ranges.
    pub a: Vec<f64>,
    /// How uncertain they are, in parts of their ranges.
    pub covariance: DMatrix<f64>,
}

/// A value with its derivatives by the controls in parts of their ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct Sum {
    /// The value.
    pub value: f64,
    /// Its gradient.
    pub gradient: Vec<f64>,
    /// Its second derivative, or something positive semidefinite that comes near.
    pub hessian: DMatrix<f64>,
}

impl Sum {
    /// Nothing, of `n` controls.
    pub fn zero(n: usize) -> Sum {
        Sum { value: 0.0, gradient: vec![0.0; n], hessian: DMatrix::zeros(n, n) }
    }
}

/// All parts of the objective of a fit.
pub struct Objectives {
    /// How the residual of a marker counts.
    pub loss: Loss,
    /// What depends on the controls of one frame.
    pub parts: Vec<Box<dyn Objective>>,
    /// What ties frames to each other.
    pub smoothness: Option<Smoothness>,
    /// Lower bound, upper bound and size of the range of each control that is sought.
    ranges: Vec<(f64, f64, f64)>,
}

impl Objectives {
    /// As the problem says, for the controls `unknowns` of the model.
    ///
    /// # Errors
    /// A table of expected values that cannot be read.
    pub fn new(scene: &Scene, fit: &FitSpec, model: &Model, unknowns: &[usize]) -> Result<Objectives> {
        let spec = &fit.objectives;
        let mut parts: Vec<Box<dyn Objective>> = Vec::new();
        if let Some(effort) = &spec.effort {
            parts.push(Box::new(effort::Effort::new(effort, model, unknowns)));
        }
        if let Some(scale) = spec.sparsity {
            parts.push(Box::new(sparsity::Sparsity::new(scale, model, unknowns)));
        }
        if let Some(sd) = spec.similarity {
            parts.push(Box::new(similarity::Similarity::new(sd, model, unknowns)));
        }
        for prior in &spec.priors {
            parts.push(Box::new(prior::Prior::new(prior, scene, model, unknowns)?));
        }
        let range = |k: &usize| {
            let control = &model.controls()[*k];
            (control.lower, control.upper, control.upper - control.lower)
        };
        Ok(Objectives {
            loss: Loss::from(spec.loss),
            parts,
            smoothness: Smoothness::new(&spec.smoothness),
            ranges: unknowns.iter().map(range).collect(),
        })
    }

    /// Controls as parts of their ranges.
    pub fn parts_of(&self, q: &[f64]) -> Vec<f64> {
        q.iter().zip(&self.ranges).map(|(q, (lower, _, size))| (q - lower) / size).collect()
    }

    /// Controls from parts of their ranges; a bound is met exactly.
    pub fn values_of(&self, a: &[f64]) -> Vec<f64> {
        let value = |(a, (lower, upper, size)): (&f64, &(f64, f64, f64))| match *a {
            a if a <= 0.0 => *lower,
            a if a >= 1.0 => *upper,
            a => lower + a * size,
        };
        a.iter().zip(&self.ranges).map(value).collect()
    }

    /// Sizes of the ranges, in the units of the controls.
    pub fn sizes(&self) -> impl Iterator<Item = f64> + '_ {
        self.ranges.iter().map(|(.., size)| *size)
    }

    /// All but the markers, by the controls in parts of their ranges.
    pub fn rest(&self, at: &Instant<'_>) -> Sum {
        let mut sum = Sum::zero(at.a.len());
        self.parts.iter().for_each(|part| part.add(at, &mut sum));
        if let Some(smoothness) = &self.smoothness {
            smoothness.add(at, &mut sum);
        }
        sum
    }

    /// Name and value of every part but the markers.
    pub fn values(&self, at: &Instant<'_>) -> Vec<(&'static str, f64)> {
        let smoothness = self.smoothness.as_ref().map(|s| s as &dyn Objective);
        let parts = self.parts.iter().map(Box::as_ref).chain(smoothness);
        let value = |part: &dyn Objective| {
            let mut sum = Sum::zero(at.a.len());
            part.add(at, &mut sum);
            (part.name(), sum.value)
        };
        parts.map(value).collect()
    }

    /// What is minimised, in a line.
    pub fn words(&self) -> String {
        let smoothness = self.smoothness.as_ref().map(Objective::words);
        let words = std::iter::once(self.loss.words());
        let words: Vec<String> = words.chain(self.parts.iter().map(|part| part.words())).chain(smoothness).collect();
        words.join("; ")
    }
}

/// The muscles among the unknowns: index of the unknown, name of its muscle and its share of it (1, or 1 / nodes of a field).
fn activations(model: &Model, unknowns: &[usize]) -> Vec<(usize, String, f64)> {
    let mut all = Vec::new();
    for (term, _) in model.muscles() {
        let own = model.terms()[term].controls();
        let share = 1.0 / own.len().max(1) as f64;
        for (at, _) in unknowns.iter().enumerate().filter(|(_, control)| own.contains(control)) {
            all.push((at, model.terms()[term].name().to_owned(), share));
        }
    }
    all
}
