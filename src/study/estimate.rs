//! The errors that a solution estimates of itself, in the measures of a study.

use super::norms::{self, Errors, Seen};
use super::solution::{Prepared, Solution};
use crate::error::{Error, Warning};
use crate::fit::bias::bias;
use crate::fit::sequence::{settings, sought};
use crate::forward::estimate::{BEYOND_HALVED, Estimator};
use crate::forward::evaluate;
use crate::model::State;
use crate::model::halved::Halved;
use crate::scene::Measure;
use std::time::Instant;

/// Estimated errors and what they cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// The errors; activations only of a fit.
    pub errors: Errors,
    /// Wall time of building the model on halved elements and of the Newton steps there, s.
    pub seconds: f64,
}

/// Estimates the errors of a solution.
///
/// # Errors
/// The warning to give where there is no estimate.
pub fn estimate(prepared: &Prepared, solution: &Solution) -> Result<Estimated, Box<Warning>> {
    let start = Instant::now();
    let (scene, model) = (&prepared.scene, &prepared.built.model);
    let halved = Halved::new(scene, model)?;
    let fine = &halved.built.model;
    let failed = |error: Error| {
        Box::new(Warning { code: error.code(), message: error.to_string(), place: None, help: error.help() })
    };
    let mut estimator = Estimator::new(model, &halved, settings(scene)).map_err(failed)?;
    let states: Vec<&State> = solution.frames.iter().map(|frame| &frame.state).collect();
    let corrected: Vec<State> =
        states.iter().map(|state| estimator.corrected(state)).collect::<Result<_, _>>().map_err(failed)?;
    let mut squares = Vec::new();
    if let Some(spec) = &scene.fit {
        let unknowns = sought(spec, model);
        for ((fitted, state), corrected) in solution.fits.iter().zip(&states).zip(&corrected) {
            let shift = estimator.shift(state, corrected, &solution.points());
            let biases = bias(fitted, &solution.markers, &unknowns, &shift);
            squares.extend(biases.iter().map(|bias| bias.unwrap_or(0.0).powi(2)));
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    let points = |all: &[crate::mesh::MaterialPoint]| all.iter().map(|at| halved.point(*at)).collect::<Vec<_>>();
    let (probes, markers) = (points(&prepared.built.probes), points(&solution.points()));
    let last = corrected.last().map(|state| evaluate(fine, state));
    let better = Seen {
        model: fine,
        probes: &probes,
        markers: &markers,
        states: corrected.iter().collect(),
        last: last.as_ref(),
    };
    let mut errors = norms::between(&solution.seen(prepared, &solution.points()), &better).scaled(BEYOND_HALVED);
    errors.set(Measure::Activations, norms::root_mean(squares.into_iter()));
    Ok(Estimated { errors, seconds })
}
