//! The page of a fit.

use super::{MarkerErrors, MeshErrors, Outliers, ToldSummary, columns, count, optional};
use crate::fit::covariance::Bound;
use crate::fit::identifiability::ClipKnowledge;
use crate::report::frame::Frame;
use std::fmt;

/// Markers shown as the worst.
const WORST: usize = 5;

/// The controls of a frame, one entry per control in each list.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedFrame {
    /// The frame.
    pub frame: Frame,
    /// Activations; degrees of hinges, mm of slides.
    pub values: Vec<f64>,
    /// Their standard deviations; `None` for one that was given, not found, or that the markers do not determine.
    pub deviations: Vec<Option<f64>>,
    /// Whether they ended at a bound.
    pub bounds: Vec<Bound>,
}

/// What the page shows. `Display` is the page; it ends with a newline.
#[derive(Debug, Clone)]
pub struct FitSummary<'a> {
    /// Name of the problem.
    pub name: &'a str,
    /// How the recording was brought to the model: whole lines, or nothing.
    pub recording: &'a str,
    /// Names of the controls, those of bones with their unit.
    pub controls: &'a [&'a str],
    /// Whether some of them are of bones.
    pub bones: bool,
    /// Frames that converged.
    pub frames: &'a [FittedFrame],
    /// Frames that did not.
    pub frames_failed: usize,
    /// Distances of the markers.
    pub errors: &'a MarkerErrors,
    /// What was estimated of the mesh's error.
    pub mesh_errors: &'a MeshErrors,
    /// What was minimised.
    pub objective: &'a str,
    /// Markers that a robust loss set aside.
    pub outliers: &'a Outliers,
    /// What the markers tell.
    pub told: &'a ClipKnowledge,
    /// Names of the markers.
    pub markers: &'a [String],
    /// Newton iterations of all frames.
    pub iterations: usize,
    /// Wall time, s.
    pub seconds: f64,
    /// The folder of the run.
    pub folder: &'a str,
}

/// A standard deviation with two significant digits, since a fixed number of them would show most as 0.
fn deviation(sd: Option<f64>) -> String {
    let Some(sd) = sd.filter(|sd| sd.is_finite()) else { return "-".into() };
    if sd > 0.0 && sd < 1e-3 { format!("{sd:.1e}") } else { format!("{sd:.4}") }
}

impl fmt::Display for FitSummary<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}: {} fitted", self.name, count(self.frames.len(), "frame"))?;
        if self.frames_failed > 0 {
            write!(out, ", {} NOT CONVERGED (see status.json)", count(self.frames_failed, "frame"))?;
        }
        writeln!(out, "; {}, {:.2} s", count(self.iterations, "Newton iteration"), self.seconds)?;
        match self.frames {
            [] => return Ok(()),
            [only] => self.of_frame(only, out)?,
            frames => self.of_clip(frames, out)?,
        }
        self.of_markers(out)?;
        write!(out, "{}", self.outliers)?;
        writeln!(out, "  minimised: {}", self.objective)?;
        if !self.recording.is_empty() {
            write!(out, "\n{}", self.recording)?;
        }
        write!(out, "{}", self.mesh_errors)?;
        let kind = if self.bones { "control" } else { "muscle" };
        let told = ToldSummary { clip: self.told, controls: self.controls, markers: self.markers, kind };
        write!(out, "{told}")?;
        let folder = self.folder;
        writeln!(out, "\nnext: shapes and residuals in {folder}/view/result.pvd and markers.pvd (ParaView)")?;
        writeln!(out, "      numbers in {folder}/tables/activations.csv and markers.csv")
    }
}

impl FitSummary<'_> {
    fn of_frame(&self, fitted: &FittedFrame, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "\nframe {} at {:.3} s", fitted.frame.index, fitted.frame.time_s)?;
        let row = |(control, name): (usize, &&str)| {
            let bound = match fitted.bounds[control] {
                Bound::Free => "",
                Bound::Lower => "at its lower bound",
                Bound::Upper => "at its upper bound",
            };
            let value = format!("{:.4}", fitted.values[control]);
            [name.to_string(), value, deviation(fitted.deviations[control]), bound.to_owned()]
        };
        let rows: Vec<_> = self.controls.iter().enumerate().map(row).collect();
        let [kind, value] = if self.bones { ["control", "value"] } else { ["muscle", "activation"] };
        out.write_str(&columns([kind, value, "sd", ""], &rows))
    }

    fn of_clip(&self, frames: &[FittedFrame], out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "\nover the clip")?;
        let row = |(control, name): (usize, &&str)| {
            let value = |fitted: &&FittedFrame| fitted.values[control];
            let least = frames.iter().map(|fitted| value(&fitted)).fold(f64::INFINITY, f64::min);
            let peak = frames.iter().reduce(|a, b| if value(&b) > value(&a) { b } else { a });
            let peak = peak.unwrap_or(&frames[0]);
            let at = |bound: Bound| frames.iter().filter(|fitted| fitted.bounds[control] == bound).count();
            [
                name.to_string(),
                format!("{least:.4}"),
                format!("{:.4}", peak.values[control]),
                deviation(peak.deviations[control]),
                peak.frame.index.to_string(),
                at(Bound::Lower).to_string(),
                at(Bound::Upper).to_string(),
            ]
        };
        let rows: Vec<_> = self.controls.iter().enumerate().map(row).collect();
        let kind = if self.bones { "control" } else { "muscle" };
        let header = [kind, "least", "peak", "sd there", "in frame", "frames at lower", "frames at upper bound"];
        out.write_str(&columns(header, &rows))
    }

    fn of_markers(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = &self.errors.all;
        let Some(rms) = all.rms_mm() else { return writeln!(out, "\nno marker was measured in these frames") };
        let samples = count(all.count, "sample");
        writeln!(
            out,
            "\nmarkers against the model: rms {rms:.3} mm, max {:.3} mm in frame {}, {samples}",
            all.max_mm, all.max_frame
        )?;
        let worst = self.errors.worst(WORST);
        let row = |(name, errors): &(&str, super::ErrorsOf)| {
            let max = format!("{:.3}", errors.max_mm);
            [
                name.to_string(),
                optional(errors.rms_mm(), 3),
                max,
                errors.max_frame.to_string(),
                errors.count.to_string(),
            ]
        };
        let rows: Vec<_> = worst.iter().map(row).collect();
        out.write_str(&columns(["worst markers", "rms mm", "max mm", "in frame", "samples"], &rows))
    }
}
