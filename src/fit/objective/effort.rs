//! Effort: sum over muscles w |a / sd|^p / p, w = 1 or the volume of the muscle over the mean of all.

use super::{Instant, Objective, Sum, activations};
use crate::model::Model;
use crate::scene::EffortSpec;

/// The cost of activity.
#[derive(Debug, Clone, PartialEq)]
pub struct Effort {
    spec: EffortSpec,
    /// Index of each activation among the unknowns, and its weight.
    weights: Vec<(usize, f64)>,
}

impl Effort {
    /// Of the activations among the controls `unknowns`.
    pub fn new(spec: &EffortSpec, model: &Model, unknowns: &[usize]) -> Effort {
        let volumes: Vec<(&str, f64)> =
            model.muscles().map(|(term, muscle)| (model.terms()[term].name(), muscle.volume())).collect();
        let mean = volumes.iter().map(|(_, volume)| volume).sum::<f64>() / volumes.len().max(1) as f64;
        let volume = |name: &str| volumes.iter().find(|(known, _)| *known == name).map_or(1.0, |(_, v)| v / mean);
        let weight =
            |(at, name, share): (usize, String, f64)| (at, share * if spec.by_volume { volume(&name) } else { 1.0 });
        Effort { spec: *spec, weights: activations(model, unknowns).into_iter().map(weight).collect() }
    }
}

impl Objective for Effort {
    fn name(&self) -> &'static str {
        "effort"
    }

    fn words(&self) -> String {
        let EffortSpec { sd, exponent, by_volume } = self.spec;
        let by = if by_volume { ", muscles by volume" } else { "" };
        format!("effort (activation / {sd})^{exponent} / {exponent}{by}")
    }

    fn add(&self, at: &Instant<'_>, sum: &mut Sum) {
        let EffortSpec { sd, exponent: p, .. } = self.spec;
        for (k, weight) in &self.weights {
            let part = at.a[*k].max(0.0) / sd;
            sum.value += weight * part.powf(p) / p;
            sum.gradient[*k] += weight * part.powf(p - 1.0) / sd;
            sum.hessian[(*k, *k)] += weight * (p - 1.0) * part.powf(p - 2.0) / (sd * sd);
        }
    }
}
