//! Sparsity: the sum of activations over a scale. They are not negative, so that its slope has no kink inside the bounds.

use super::{Instant, Objective, Sum, activations};
use crate::model::Model;

/// The sum of activations.
#[derive(Debug, Clone, PartialEq)]
pub struct Sparsity {
    scale: f64,
    weights: Vec<(usize, f64)>,
}

impl Sparsity {
    /// Of the activations among the controls `unknowns`; `scale` is the mean of what is expected of each.
    pub fn new(scale: f64, model: &Model, unknowns: &[usize]) -> Sparsity {
        let weights = activations(model, unknowns).into_iter().map(|(at, _, share)| (at, share)).collect();
        Sparsity { scale, weights }
    }
}

impl Objective for Sparsity {
    fn name(&self) -> &'static str {
        "sparsity"
    }

    fn words(&self) -> String {
        format!("sparsity (sum of activations / {})", self.scale)
    }

    fn add(&self, at: &Instant<'_>, sum: &mut Sum) {
        for (k, weight) in &self.weights {
            sum.value += weight * at.a[*k] / self.scale;
            sum.gradient[*k] += weight / self.scale;
        }
    }
}
