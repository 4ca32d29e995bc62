//! What is found of a fitted frame while the fit stands where the frame left it: the error of the mesh, and the marker that would help.

use super::estimate::{Estimated, Estimates};
use super::prepare::Prepared;
use crate::error::Result;
use crate::fit::advise::{MarkerHelp, View, candidates};
use crate::fit::identifiability::{Evidence, Pair};
use crate::fit::sequence::settings;
use crate::fit::{Estimate, Fit};
use crate::forward::Work;
use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::MaterialPoint;
use crate::model::State;
use crate::report::Frame;
use crate::report::state::SavedFrame;
use crate::scene::Scene;

/// A marker is not proposed nearer than this to another, mm.
pub(super) const APART_MM: f64 = 5.0;

/// Goes along with a fit.
pub(super) struct Scout<'a> {
    estimates: Estimates<'a>,
    /// Names of all controls.
    labels: &'a [String],
    points: Vec<MaterialPoint>,
    positions: Vec<Vector>,
    taken: Vec<Vector>,
    /// One minus the correlation of the pair that is most alike so far.
    least: f64,
}

impl<'a> Scout<'a> {
    /// # Errors
    /// Where the halved elements do not fit into memory.
    pub fn new(prepared: &'a Prepared, scene: &Scene, fit: &Fit<'_>, labels: &'a [String]) -> Result<Scout<'a>> {
        let mesh = prepared.built.model.mesh();
        let points = candidates(mesh);
        let placed = fit.markers().iter().map(|m| (m.name.clone(), m.point));
        Ok(Scout {
            estimates: Estimates::new(prepared, settings(scene), placed)?,
            labels,
            positions: points.iter().map(|p| mesh.position(*p)).collect(),
            points,
            taken: fit.markers().iter().map(|m| mesh.position(m.point)).collect(),
            least: f64::INFINITY,
        })
    }

    /// A frame with which `fit` has just ended, and all that is to be known of it.
    ///
    /// # Errors
    /// Where what its markers tell cannot be computed.
    pub fn frame(&mut self, estimate: Estimate, fit: &Fit<'_>) -> Result<SavedFrame> {
        let frame = Frame { index: estimate.frame, time_s: estimate.time_s };
        let Estimated { error, warning } = self.estimates.fit(frame, &estimate, fit, self.labels);
        let help = self.help(&estimate, fit)?;
        Ok(SavedFrame { estimate, error, unestimated: warning.map(|warning| (warning.message, warning.help)), help })
    }

    /// The marker that tells the pair of a frame apart best, if no frame before had one that is more alike.
    fn help(&mut self, estimate: &Estimate, fit: &Fit<'_>) -> Result<Option<MarkerHelp>> {
        let Some(evidence) = Evidence::of(estimate, fit.controls(), fit.unknowns()) else { return Ok(None) };
        let measured: Vec<bool> = estimate.measured_mm.iter().map(Option::is_some).collect();
        let told = evidence.told(fit.markers(), &measured)?;
        let Some(pair) = told.pairs.first().filter(|pair| pair.distinct() < self.least) else { return Ok(None) };
        self.least = pair.distinct();
        Ok(self.best_marker(pair, &evidence, estimate, fit))
    }

    fn best_marker(
        &self,
        pair: &Pair,
        evidence: &Evidence,
        estimate: &Estimate,
        fit: &Fit<'_>,
    ) -> Option<MarkerHelp> {
        let rates = fit.rates_at(&self.points, &estimate.equilibrium.state)?;
        let view = View::new(evidence, &rates, new_marker_sd(fit));
        let control = pair.controls[usize::from(pair.apart_sd[1] > pair.apart_sd[0])];
        let open = |c: usize| self.taken.iter().all(|t| norm(subtract(*t, self.positions[c])) >= APART_MM);
        let (candidate, before, after) = view.best_for(control, open)?;
        Some(MarkerHelp { place: self.positions[candidate], control, sd: [before, after] })
    }

    /// What further frames depend on.
    pub fn tangent_states(&self) -> Option<[State; 2]> {
        self.estimates.tangent_states()
    }

    /// Goes on from there.
    ///
    /// # Errors
    /// Where a tangent cannot be factorised.
    pub fn restore_tangent(&mut self, states: Option<&[State; 2]>) -> Result<()> {
        self.estimates.restore_tangent(states)
    }

    /// Work and seconds of estimates, if there were any.
    pub fn cost(&self) -> Option<(Work, f64)> {
        self.estimates.cost()
    }
}

/// The deviation of a marker that is added: the median of those that there are, or as all of them where none is given.
pub(super) fn new_marker_sd(fit: &Fit<'_>) -> f64 {
    let mut all: Vec<f64> = fit.markers().iter().map(|m| m.sd.unwrap_or(1.0)).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(1.0)
}
