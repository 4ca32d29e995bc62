//! What a fit finds, frame by frame: what is written of each, and the page at the end.

use super::Flags;
use super::noticed::noticed;
use super::outer::PAGE;
use super::run::{Run, Tally};
use super::telling::Telling;
use super::terminal::print;
use super::writer::Desk;
use crate::error::{Result, Warning};
use crate::fit::free_head::{FreeHead, page};
use crate::fit::identifiability::Told;
use crate::fit::registration::Registration;
use crate::fit::{Estimate, Fit};
use crate::forward::Work;
use crate::model::Model;
use crate::report::state::SavedFrame;
use crate::report::summary::{FitSummary, FittedFrame, MarkerErrors, MeshErrors, Outliers};
use crate::report::{Frame, MarkerPair, MeshError, Outlier};
use crate::scene::{ControlRange, Scene};

/// The frames so far.
pub(super) struct Book<'a> {
    model: &'a Model,
    names: &'a Names,
    telling: Telling<'a>,
    mesh_errors: MeshErrors,
    pub tally: Tally,
    /// The head in every frame where it was estimated.
    pub heads: Vec<(usize, FreeHead)>,
    fitted: Vec<FittedFrame>,
    errors: MarkerErrors,
    outliers: Outliers,
}

/// What is named in rows.
pub(super) struct Names {
    pub markers: Vec<String>,
    /// Controls with their units.
    pub controls: Vec<String>,
}

/// A frame that converged, with all that is written of it.
pub(super) struct Entry<'a> {
    names: &'a Names,
    saved: SavedFrame,
    told: Option<Told>,
    /// What is shown of it.
    warnings: Vec<Warning>,
}

impl Names {
    pub fn new(model: &Model, scene: &Scene, fit: &Fit<'_>) -> Names {
        let ranges = scene.control_ranges();
        Names {
            markers: fit.markers().iter().map(|m| m.name.clone()).collect(),
            controls: model.controls().iter().map(|control| label(&control.name, &ranges)).collect(),
        }
    }
}

impl Entry<'_> {
    /// Writes rows and shapes, and shows what is to be known of the frame.
    pub fn write(&self, Desk { record, meter }: &mut Desk<'_>, flags: &Flags) -> Result<()> {
        let Entry { names, saved: SavedFrame { estimate, error, .. }, told, warnings } = self;
        let frame = Frame { index: estimate.frame, time_s: estimate.time_s };
        let markers = pairs(&names.markers, estimate);
        let aside = set_aside(&names.markers, &markers, estimate);
        record.frame(frame, &estimate.equilibrium, &markers, &estimate.iterations)?;
        record.objectives(frame, &estimate.costs, &aside)?;
        if let Some(error) = error {
            record.estimate(frame, error)?;
        }
        if let Some(told) = told {
            record.told(frame, told, (&names.controls, &names.markers), &biases(error.as_ref()))?;
        }
        record.done(frame, &estimate.equilibrium, &estimate.sd)?;
        warnings.iter().for_each(|warning| meter.warn(warning, flags));
        Ok(())
    }
}

impl<'a> Book<'a> {
    pub fn new(model: &'a Model, names: &'a Names, fit: &Fit<'a>) -> Book<'a> {
        Book {
            model,
            names,
            telling: Telling::new(fit, &names.controls),
            mesh_errors: MeshErrors::default(),
            tally: Tally::default(),
            heads: Vec::new(),
            fitted: Vec::new(),
            errors: MarkerErrors::default(),
            outliers: Outliers::default(),
        }
    }

    /// Takes a frame that converged, in this process (`live`) or in an earlier one; gives back what is to be written of it.
    pub fn frame(&mut self, saved: SavedFrame, live: bool) -> Result<Entry<'a>> {
        let SavedFrame { estimate, error, unestimated, help } = &saved;
        let frame = Frame { index: estimate.frame, time_s: estimate.time_s };
        let markers = pairs(&self.names.markers, estimate);
        self.errors.add(frame, &markers);
        self.outliers.add(&set_aside(&self.names.markers, &markers, estimate));
        error.iter().for_each(|error| self.mesh_errors.add(frame, error));
        let mut warnings: Vec<Warning> = estimate.bridged.then(|| bridged(frame)).into_iter().collect();
        warnings.extend(noticed(frame, self.model, &estimate.equilibrium));
        let warning = |(message, help)| Warning { code: "S013", message, place: None, help };
        warnings.extend(unestimated.clone().map(warning));
        self.tally.keep(frame, &warnings);
        if !live {
            // an earlier process has shown them
            warnings.clear();
        }
        let biases = biases(error.as_ref());
        let told = self.telling.frame(frame, estimate, *help, &biases)?;
        // one that is bridged stays among those that failed
        self.tally.frames_ok += usize::from(!estimate.bridged);
        self.heads.extend(estimate.head.clone().map(|head| (estimate.frame, head)));
        self.fitted.push(FittedFrame {
            frame,
            values: estimate.equilibrium.state.controls.clone(),
            deviations: estimate.sd.clone(),
            bounds: estimate.bounds.clone(),
        });
        Ok(Entry { names: self.names, saved, told, warnings })
    }

    /// Writes what is known at the end, prints the page.
    pub fn finish(
        mut self,
        scene: &Scene,
        (fit, registration): (&Fit<'_>, &Registration),
        (work, estimates): (&Work, Option<(Work, f64)>),
        run: &Run,
        (mut desk, flags): (Desk<'_>, &Flags),
    ) -> Result<Tally> {
        if let Some((frame, warning)) = self.telling.warning() {
            self.tally.warn(frame, vec![warning], &desk.meter, flags);
        }
        desk.record.told_of_clip(&self.telling.clip, &self.names.controls)?;
        estimates.iter().for_each(|(work, seconds)| self.mesh_errors.took(work.iterations, *seconds));
        desk.finish(work, estimates, &run.log, flags)?;
        let controls: Vec<&str> = self.names.controls.iter().map(String::as_str).collect();
        let sought: Vec<&str> = fit.unknowns().iter().map(|k| controls[*k]).collect();
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
            mesh_errors: &self.mesh_errors,
            objective: &fit.words(),
            outliers: &self.outliers,
            told: &self.telling.clip,
            markers: &self.names.markers,
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

fn bridged(Frame { index, .. }: Frame) -> Warning {
    Warning {
        code: "F012",
        message: format!("frame {index} failed and is bridged: what stands there is what its neighbours say"),
        place: None,
        help: None,
    }
}

/// What every control that is sought is too great by; nothing where the error was not estimated.
fn biases(error: Option<&MeshError>) -> Vec<Option<f64>> {
    error.iter().flat_map(|error| error.biases.iter().map(|(_, bias)| *bias)).collect()
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
