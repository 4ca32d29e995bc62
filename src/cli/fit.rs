//! Task `fit`: activations from a recording, frame after frame.

use super::Flags;
use super::estimate::Estimates;
use super::forward::probes;
use super::noticed::noticed;
use super::prepare::{Clip, Prepared};
use super::progress::Meter;
use super::run::{Run, Tally};
use super::telling::Telling;
use super::terminal::print;
use crate::cli::diagnostics::render_error;
use crate::error::Result;
use crate::fit::sequence::settings;
use crate::fit::{Estimate, Fit};
use crate::forward::Work;
use crate::report::summary::{FitSummary, FittedFrame, MarkerErrors, Outliers};
use crate::report::{FailedFrame, Frame, MarkerPair, Outlier, Record};
use crate::scene::{ControlRange, FitSpec, Scene};

/// Fits every frame, writes it, prints the page.
pub(super) fn fit(
    scene: &Scene,
    spec: &FitSpec,
    prepared: &Prepared,
    Clip { recording, frames, .. }: &Clip,
    run: &Run,
    flags: &Flags,
    work: &mut Work,
) -> Result<Tally> {
    let built = &prepared.built;
    let model = &built.model;
    let probes = probes(scene, built);
    let mut fit = Fit::new(model, scene, spec, recording)?;
    let names: Vec<String> = fit.markers().iter().map(|m| m.name.clone()).collect();
    let mut record = Record::create(&run.folder, model, &probes, &scene.output, true)?;
    let ranges = scene.control_ranges();
    let labels: Vec<String> = model.controls().iter().map(|control| label(&control.name, &ranges)).collect();
    let placed = fit.markers().iter().map(|m| (m.name.clone(), m.point));
    let mut estimates = Estimates::new(prepared, settings(scene), placed)?;
    let mut telling = Telling::new(model.mesh(), &fit, labels.clone());
    let mut meter = Meter::new(flags, frames.len());
    let mut tally = Tally::default();
    let mut fitted = Vec::new();
    let mut errors = MarkerErrors::default();
    let mut outliers = Outliers::default();
    for &index in frames {
        if run.is_interrupted() {
            tally.interrupted = true;
            break;
        }
        let frame = Frame { index, time_s: recording.frames[index].time_s };
        let before = fit.work().linear.factorisations;
        match fit.frame(recording, index) {
            Ok(estimate) => {
                let markers = pairs(&names, &estimate);
                errors.add(frame, &markers);
                record.frame(frame, &estimate.equilibrium, &estimate.sd, &markers, &estimate.iterations)?;
                tally.frames_ok += 1;
                meter.frame(format!(
                    "t {:.3} s: rms {:.3} mm, {} steps, {} factorisations",
                    frame.time_s,
                    estimate.rms_mm,
                    estimate.iterations.len(),
                    fit.work().linear.factorisations - before
                ));
                tally.warn(frame, noticed(frame, model, &estimate.equilibrium), &mut meter, flags);
                let aside = set_aside(&names, &estimate);
                record.objectives(frame, &estimate.costs, &aside)?;
                outliers.add(&aside);
                let estimated = estimates.fit(frame, &estimate, &fit, &labels, &mut record)?;
                tally.warn(frame, estimated.warning.into_iter().collect(), &mut meter, flags);
                let biases: Vec<_> =
                    estimated.error.iter().flat_map(|e| e.biases.iter().map(|(_, bias)| *bias)).collect();
                telling.frame(frame, &estimate, &fit, &biases, &mut record)?;
                fitted.push(FittedFrame {
                    frame,
                    values: estimate.equilibrium.state.controls.clone(),
                    deviations: estimate.sd.clone(),
                    bounds: estimate.bounds.clone(),
                });
            }
            Err(error) => {
                meter.say(&render_error(&error, flags.colour()));
                meter.frame(format!("t {:.3} s: failed", frame.time_s));
                tally.failed.push(FailedFrame::new(index, &error));
            }
        }
        run.write_running(&tally)?;
    }
    meter.finish();
    if let Some((frame, warning)) = telling.warning() {
        tally.warn(frame, vec![warning], &mut meter, flags);
    }
    record.told_of_clip(&telling.clip, &labels)?;
    *work = fit.work();
    record.finish(work, estimates.cost().as_ref().map(|(work, seconds)| (work, *seconds)))?;
    let controls: Vec<&str> = labels.iter().map(String::as_str).collect();
    let summary = FitSummary {
        name: &scene.name,
        controls: &controls,
        bones: !model.bones().is_empty(),
        frames: &fitted,
        frames_failed: tally.failed.len(),
        errors: &errors,
        mesh_errors: &estimates.errors,
        objective: &fit.words(),
        outliers: &outliers,
        told: &telling.clip,
        markers: &names,
        iterations: work.iterations,
        seconds: run.start.elapsed().as_secs_f64(),
        folder: &run.folder.path().display().to_string(),
    };
    let page = summary.to_string();
    run.folder.write("summary.txt", &page)?;
    print(&page)?;
    Ok(tally)
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
fn set_aside<'n>(names: &'n [String], estimate: &Estimate) -> Vec<Outlier<'n>> {
    let shown = (0..names.len()).filter(|marker| estimate.measured_mm[*marker].is_some());
    let pairs = pairs(names, estimate);
    let outlier = |(at, marker): (usize, usize)| {
        let sds: f64 = estimate.residuals[3 * at..3 * at + 3].iter().map(|r| r * r).sum();
        let distance_mm = pairs[marker].distance().unwrap_or(0.0);
        Outlier { name: &names[marker], distance_mm, distance_sds: sds.sqrt(), weight: estimate.weights[at] }
    };
    shown.enumerate().map(outlier).filter(|outlier| outlier.weight < 0.5).collect()
}
