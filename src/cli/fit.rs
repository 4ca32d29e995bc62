//! Task `fit`: activations from a recording, frame after frame.

use super::Flags;
use super::estimate::Estimates;
use super::forward::probes;
use super::noticed::noticed;
use super::prepare::{Clip, Prepared};
use super::progress::Meter;
use super::run::{Run, Tally};
use super::terminal::print;
use crate::cli::diagnostics::render_error;
use crate::error::Result;
use crate::fit::free_head::{FreeHead, page};
use crate::fit::head::{HeadFrame, HeadMotion};
use crate::fit::placement::Marker;
use crate::fit::registration::Registration;
use crate::fit::sequence::settings;
use crate::fit::{Estimate, Fit};
use crate::forward::Work;
use crate::markers::Recording;
use crate::math::motion::Motion;
use crate::math::tensor::subtract;
use crate::report::summary::{FitSummary, FittedFrame, MarkerErrors};
use crate::report::tables::{FreeHeadRow, HeadRow, Placement, write_free_head, write_head, write_registration};
use crate::report::{FailedFrame, Frame, MarkerPair, Record};
use crate::scene::{ControlRange, FitSpec, Scene};

/// Fits every frame, writes it, prints the page.
pub(super) fn fit(
    scene: &Scene,
    spec: &FitSpec,
    prepared: &Prepared,
    Clip { recording, registration, frames, .. }: &Clip,
    run: &Run,
    flags: &Flags,
    work: &mut Work,
) -> Result<Tally> {
    let built = &prepared.built;
    let model = &built.model;
    let probes = probes(scene, built);
    let mut fit = Fit::new(model, scene, spec, recording)?;
    let names: Vec<String> = fit.markers().iter().map(|m| m.name.clone()).collect();
    write_registration(&run.folder, &placements(fit.markers(), registration))?;
    if let Some(head) = &registration.head {
        write_head(&run.folder, &heads(head, registration, recording))?;
    }
    let mut record = Record::create(&run.folder, model, &probes, &scene.output, true)?;
    let ranges = scene.control_ranges();
    let labels: Vec<String> = model.controls().iter().map(|control| label(&control.name, &ranges)).collect();
    let placed = fit.markers().iter().map(|m| (m.name.clone(), m.point));
    let mut estimates = Estimates::new(prepared, settings(scene), placed)?;
    let mut meter = Meter::new(flags, frames.len());
    let mut tally = Tally::default();
    let mut fitted = Vec::new();
    let mut errors = MarkerErrors::default();
    let mut heads: Vec<(usize, FreeHead)> = Vec::new();
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
                let warning = estimates.fit(frame, &estimate, &fit, &labels, &mut record)?;
                tally.warn(frame, warning.into_iter().collect(), &mut meter, flags);
                heads.extend(estimate.head.clone().map(|head| (index, head)));
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
    *work = fit.work();
    record.finish(work, estimates.cost().as_ref().map(|(work, seconds)| (work, *seconds)))?;
    let controls: Vec<&str> = labels.iter().map(String::as_str).collect();
    let sought: Vec<&str> = fit.unknowns().iter().map(|k| labels[*k].as_str()).collect();
    if !heads.is_empty() {
        write_free_head(&run.folder, &sought, &free_heads(&heads, registration, recording))?;
    }
    let summary = FitSummary {
        name: &scene.name,
        recording: &(page(&heads, registration.centre, &sought) + &registration.to_string()),
        controls: &controls,
        bones: !model.bones().is_empty(),
        frames: &fitted,
        frames_failed: tally.failed.len(),
        errors: &errors,
        mesh_errors: &estimates.errors,
        iterations: work.iterations,
        seconds: run.start.elapsed().as_secs_f64(),
        folder: &run.folder.path().display().to_string(),
    };
    let text = summary.to_string();
    run.folder.write("summary.txt", &text)?;
    print(&text)?;
    Ok(tally)
}

/// Where each marker sits, and how the neutral frame fits there.
fn placements<'m>(markers: &'m [Marker], registration: &Registration) -> Vec<Placement<'m>> {
    let shown = |m: &Marker| registration.markers.iter().find(|registered| registered.name == m.name);
    let placement = |m: &'m Marker| Placement {
        name: &m.name,
        skin_mm: m.distance,
        neutral_mm: shown(m).map(|registered| registered.distance_mm),
        counted: shown(m).is_some_and(|registered| !registered.off),
    };
    markers.iter().map(placement).collect()
}

/// The head in every frame where it was estimated.
fn free_heads(heads: &[(usize, FreeHead)], registration: &Registration, recording: &Recording) -> Vec<FreeHeadRow> {
    let of = registration.centre;
    let row = |(index, head): &(usize, FreeHead)| FreeHeadRow {
        frame: Frame { index: *index, time_s: recording.frames[*index].time_s },
        motion: [head.motion.rotation_vector().map(f64::to_degrees), subtract(head.motion.place(of), of)],
        sd: head.sd,
        confounding: head.correlation.iter().zip(&head.inflation).map(|(c, i)| [*c, *i]).collect(),
    };
    heads.iter().map(row).collect()
}

/// The head in every frame of the recording.
fn heads(head: &HeadMotion, registration: &Registration, recording: &Recording) -> Vec<HeadRow> {
    let of = registration.centre;
    let sizes = |motion: Motion| {
        [motion.rotation_vector().map(f64::to_degrees), std::array::from_fn(|i| motion.place(of)[i] - of[i])]
    };
    let row = |(index, frame): (usize, &HeadFrame)| HeadRow {
        frame: Frame { index, time_s: recording.frames[index].time_s },
        motion: frame.motion.map(sizes),
        rms_mm: frame.rms_mm,
        markers: frame.markers,
    };
    head.frames.iter().enumerate().map(row).collect()
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
