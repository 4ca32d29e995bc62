//! The error of the mesh, estimated in the frames of a run: for the page, the tables and the cost.

use super::prepare::Prepared;
use crate::error::{Result, Warning};
use crate::fit::{Estimate, Fit, bias::bias};
use crate::forward::estimate::Estimator;
use crate::forward::{Settings, Work};
use crate::math::tensor::norm;
use crate::mesh::MaterialPoint;
use crate::model::State;
use crate::report::{Frame, MeshError, Probe};

/// The outcome of one estimate; neither where none was asked for.
#[derive(Default)]
pub(super) struct Estimated {
    pub error: Option<MeshError>,
    /// Why there is none.
    pub warning: Option<Warning>,
}

/// What a run estimates; nothing where it was not asked for.
pub(super) struct Estimates<'m> {
    estimator: Option<Estimator<'m>>,
    names: Vec<String>,
    points: Vec<MaterialPoint>,
}

impl<'m> Estimates<'m> {
    /// Of points with names.
    pub fn new(
        prepared: &'m Prepared,
        settings: Settings,
        points: impl Iterator<Item = (String, MaterialPoint)>,
    ) -> Result<Estimates<'m>> {
        let estimator = match &prepared.halved {
            Some(halved) => Some(Estimator::new(&prepared.built.model, halved, settings)?),
            None => None,
        };
        let (names, points) = points.unzip();
        Ok(Estimates { estimator, names, points })
    }

    /// Estimates the errors of the probes in an equilibrium.
    pub fn forward(&mut self, frame: Frame, state: &State) -> Estimated {
        self.frame(frame, "probe", state, |_| Vec::new())
    }

    /// The same of the markers and of the controls that were fitted.
    pub fn fit(&mut self, frame: Frame, fitted: &Estimate, fit: &Fit<'_>, labels: &[String]) -> Estimated {
        self.frame(frame, "marker", &fitted.equilibrium.state, |shift| {
            let biases = bias(fitted, fit.markers(), fit.unknowns(), shift);
            fit.unknowns().iter().map(|control| (labels[*control].clone(), biases[*control])).collect()
        })
    }

    fn frame(
        &mut self,
        frame: Frame,
        kind: &'static str,
        state: &State,
        biases: impl FnOnce(&[[f64; 3]]) -> Vec<(String, Option<f64>)>,
    ) -> Estimated {
        let Some(estimator) = &mut self.estimator else { return Estimated::default() };
        let corrected = match estimator.corrected(state) {
            Ok(corrected) => corrected,
            Err(error) => {
                let warning = Warning {
                    code: "S013",
                    message: format!("frame {}: no estimate of the error: {error}", frame.index),
                    place: None,
                    help: error.help(),
                };
                return Estimated { error: None, warning: Some(warning) };
            }
        };
        let shift = estimator.shift(state, &corrected, &self.points);
        let error = MeshError {
            kind,
            largest_mm: estimator.largest(state, &corrected),
            points: self.names.iter().cloned().zip(shift.iter().map(|s| norm(*s))).collect(),
            biases: biases(&shift),
        };
        Estimated { error: Some(error), warning: None }
    }

    /// What further estimates depend on.
    pub fn tangent_states(&self) -> Option<[State; 2]> {
        self.estimator.as_ref()?.tangent_states()
    }

    pub fn restore_tangent(&mut self, states: Option<&[State; 2]>) -> Result<()> {
        self.estimator.as_mut().map_or(Ok(()), |estimator| estimator.restore_tangent(states))
    }

    /// Work and seconds, if anything was estimated.
    pub fn cost(&self) -> Option<(Work, f64)> {
        self.estimator.as_ref().map(|estimator| (estimator.work(), estimator.seconds()))
    }
}

/// The points of probes.
pub(super) fn of_probes(probes: &[Probe]) -> impl Iterator<Item = (String, MaterialPoint)> + '_ {
    probes.iter().map(|probe| (probe.name.clone(), probe.at))
}
