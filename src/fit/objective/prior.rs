//! What controls are expected to be over time (surface EMG, action units, an earlier fit):
//!   sum of (a - gain x(t - delay))^2 / (2 sd^2)

use super::{Instant, Objective, Sum};
use crate::error::Result;
use crate::model::Model;
use crate::scene::{Curves, PriorSpec, Scene, expected_ranges};

/// Expected curves.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    spec: PriorSpec,
    curves: Curves,
    /// Index of an unknown, the column that belongs to it, lower bound and size of its range.
    columns: Vec<(usize, String, f64, f64)>,
}

impl Prior {
    /// For those of the controls `unknowns` that the table has.
    ///
    /// # Errors
    /// A table that cannot be read.
    pub fn new(spec: &PriorSpec, scene: &Scene, model: &Model, unknowns: &[usize]) -> Result<Prior> {
        let curves = Curves::read(&spec.csv, &expected_ranges(scene.control_ranges()))?;
        let mut columns = Vec::new();
        for name in &curves.names {
            let own = model.controls_of(name);
            for (at, control) in unknowns.iter().enumerate().filter(|(_, control)| own.contains(control)) {
                let control = &model.controls()[*control];
                columns.push((at, name.clone(), control.lower, control.upper - control.lower));
            }
        }
        Ok(Prior { spec: spec.clone(), curves, columns })
    }
}

impl Objective for Prior {
    fn name(&self) -> &'static str {
        "prior"
    }

    fn words(&self) -> String {
        let PriorSpec { csv, sd, gain, delay_s } = &self.spec;
        let file = csv.file_name().unwrap_or_default().to_string_lossy();
        format!("{} columns of {file} x {gain}, {delay_s} s later (sd {sd})", self.columns.len())
    }

    fn add(&self, at: &Instant<'_>, sum: &mut Sum) {
        let weight = 1.0 / (self.spec.sd * self.spec.sd);
        for (k, name, lower, size) in &self.columns {
            let Some(value) = self.curves.at(name, at.time_s - self.spec.delay_s) else { continue };
            let difference = at.a[*k] - (self.spec.gain * value - lower) / size;
            sum.value += 0.5 * weight * difference * difference;
            sum.gradient[*k] += weight * difference;
            sum.hessian[(*k, *k)] += weight;
        }
    }
}
