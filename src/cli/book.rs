//! All that a fit writes of its frames: rows, shapes, the page.

use super::Flags;
use super::estimate::Estimates;
use super::noticed::noticed;
use super::outer::PAGE;
use super::progress::{Meter, took};
use super::run::{Run, Tally};
use super::telling::Telling;
use super::terminal::print;
use crate::error::{Result, Warning};
use crate::fit::advise::MarkerHelp;
use crate::fit::free_head::{FreeHead, page};
use crate::fit::registration::Registration;
use crate::fit::{Estimate, Fit};
use crate::forward::Work;
use crate::model::Model;
use crate::report::state::SavedFrame;
use crate::report::summary::{FitSummary, FittedFrame, MarkerErrors, Outliers};
use crate::report::{Frame, MarkerPair, MeshError, Outlier, Record};
use crate::scene::{ControlRange, Scene};

/// The frames so far.
pub(super) struct Book<'a> {
    model: &'a Model,
    /// Names of markers, and of controls with their units.
    pub names: Vec<String>,
    pub labels: Vec<String>,
    pub record: Record<'a>,
    telling: Telling,
    pub estimates: Estimates<'a>,
    pub tally: Tally,
    /// The head in every frame where it was estimated.
    pub heads: Vec<(usize, FreeHead)>,
    fitted: Vec<FittedFrame>,
    errors: MarkerErrors,
    outliers: Outliers,
}

/// What a frame was found to be besides its fit, or what an earlier process had found.
pub(super) enum Beside<'f, 'm> {
    /// To be found now, with the fit as the frame left it.
    Fresh(&'f Fit<'m>),
    /// Known.
    Known { error: Option<MeshError>, unestimated: Option<String>, help: Option<MarkerHelp> },
}

impl<'a> Book<'a> {
    pub fn new(
        model: &'a Model,
        scene: &Scene,
        fit: &Fit<'_>,
        record: Record<'a>,
        estimates: Estimates<'a>,
    ) -> Book<'a> {
        let ranges = scene.control_ranges();
        let labels: Vec<String> = model.controls().iter().map(|control| label(&control.name, &ranges)).collect();
        Book {
            model,
            names: fit.markers().iter().map(|m| m.name.clone()).collect(),
            telling: Telling::new(model.mesh(), fit, labels.clone()),
            labels,
            record,
            estimates,
            tally: Tally::default(),
            heads: Vec::new(),
            fitted: Vec::new(),
            errors: MarkerErrors::default(),
            outliers: Outliers::default(),
        }
    }

    /// Writes a frame that converged; gives back all that it was made of.
    pub fn frame(
        &mut self,
        estimate: Estimate,
        fit: &Fit<'_>,
        beside: Beside<'_, '_>,
        meter: &mut Meter,
        flags: &Flags,
    ) -> Result<SavedFrame> {
        let frame = Frame { index: estimate.frame, time_s: estimate.time_s };
        let markers = pairs(&self.names, &estimate);
        let aside = set_aside(&self.names, &markers, &estimate);
        self.errors.add(frame, &markers);
        self.outliers.add(&aside);
        self.record.frame(frame, &estimate.equilibrium, &markers, &estimate.iterations)?;
        self.record.objectives(frame, &estimate.costs, &aside)?;
        let is_known = matches!(beside, Beside::Known { .. });
        let mut warn = |tally: &mut Tally, warnings: Vec<Warning>| match is_known {
            true => tally.keep(frame, &warnings),
            false => tally.warn(frame, warnings, meter, flags),
        };
        warn(&mut self.tally, noticed(frame, self.model, &estimate.equilibrium));
        let (error, unestimated, live, known_help) = match beside {
            Beside::Fresh(fit) => {
                let found = self.estimates.fit(frame, &estimate, fit, &self.labels, &mut self.record)?;
                let unestimated = found.warning.as_ref().map(|warning| warning.message.clone());
                warn(&mut self.tally, found.warning.into_iter().collect());
                (found.error, unestimated, true, None)
            }
            Beside::Known { error, unestimated, help } => {
                if let Some(error) = &error {
                    self.estimates.known(frame, error, &mut self.record)?;
                }
                let warning =
                    |message: &String| Warning { code: "S013", message: message.clone(), place: None, help: None };
                warn(&mut self.tally, unestimated.iter().map(warning).collect());
                (error, unestimated, false, help)
            }
        };
        let biases: Vec<_> = error.iter().flat_map(|e| e.biases.iter().map(|(_, bias)| *bias)).collect();
        let help = self.telling.frame(frame, &estimate, fit, (live, known_help), &biases, &mut self.record)?;
        self.record.done(frame, &estimate.equilibrium, &estimate.sd)?;
        // one that is bridged stays among those that failed
        self.tally.frames_ok += usize::from(!estimate.bridged);
        self.heads.extend(estimate.head.clone().map(|head| (estimate.frame, head)));
        self.fitted.push(FittedFrame {
            frame,
            values: estimate.equilibrium.state.controls.clone(),
            deviations: estimate.sd.clone(),
            bounds: estimate.bounds.clone(),
        });
        Ok(SavedFrame { estimate, error, unestimated, help })
    }

    /// Writes what is known at the end, prints the page.
    pub fn finish(
        mut self,
        scene: &Scene,
        (fit, registration): (&Fit<'_>, &Registration),
        work: &Work,
        run: &Run,
        (meter, flags): (&mut Meter, &Flags),
    ) -> Result<Tally> {
        if let Some((frame, warning)) = self.telling.warning() {
            self.tally.warn(frame, vec![warning], meter, flags);
        }
        self.record.told_of_clip(&self.telling.clip, &self.labels)?;
        took(&run.log, flags, "of that: write tables and shapes", self.record.seconds());
        self.record.finish(work, self.estimates.cost().as_ref().map(|(work, seconds)| (work, *seconds)))?;
        let controls: Vec<&str> = self.labels.iter().map(String::as_str).collect();
        let sought: Vec<&str> = fit.unknowns().iter().map(|k| self.labels[*k].as_str()).collect();
        // none where all frames share nothing that was sought
        let shared = std::fs::read_to_string(run.folder.path().join(PAGE)).unwrap_or_default();
        let summary = FitSummary {
            name: &scene.name,
            recording: &(shared + &page(&self.heads, registration.centre, &sought) + &registration.to_string()),
            controls: &controls,
            bones: !self.model.bones().is_empty(),
            frames: &self.fitted,
            frames_failed: self.tally.failed.len(),
            errors: &self.errors,
            mesh_errors: &self.estimates.errors,
            objective: &fit.words(),
            outliers: &self.outliers,
            told: &self.telling.clip,
            markers: &self.names,
            iterations: work.iterations,
            seconds: run.start.elapsed().as_secs_f64(),
            folder: &run.folder.path().display().to_string(),
        };
        let text = summary.to_string();
        run.folder.write("summary.txt", &text)?;
        print(&text)?;
        Ok(self.tally)
    }
}

/// The name of a control, with its unit where it has one.
fn label(name: &str, ranges: &[ControlRange]) -> String {
    let unit = ranges.iter().find(|range| range.name == name).map_or("", |range| range.kind.unit());
    format!("{name} {unit}").trim_end().to_owned()
}

fn pairs<'n>(names: &'n [String], estimate: &Estimate) -> Vec<MarkerPair<'n>> {
    names
        .iter()
        .zip(&estimate.positions_mm)
        .zip(&estimate.measured_mm)
        .map(|((name, model), measured)| MarkerPair { name, model: *model, measured: *measured })
        .collect()
}

/// Markers that count less than half of what one nearby does.
fn set_aside<'n>(names: &'n [String], pairs: &[MarkerPair<'_>], estimate: &Estimate) -> Vec<Outlier<'n>> {
    let shown = (0..names.len()).filter(|marker| estimate.measured_mm[*marker].is_some());
    let outlier = |(at, marker): (usize, usize)| {
        let sds: f64 = estimate.residuals[3 * at..3 * at + 3].iter().map(|r| r * r).sum();
        let distance_mm = pairs[marker].distance().unwrap_or(0.0);
        Outlier { name: &names[marker], distance_mm, distance_sds: sds.sqrt(), weight: estimate.weights[at] }
    };
    shown.enumerate().map(outlier).filter(|outlier| outlier.weight < 0.5 && !estimate.bridged).collect()
}
