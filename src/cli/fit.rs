//! Task `fit`: activations from a recording, frame after frame.

use super::Flags;
use super::book::{Beside, Book};
use super::estimate::Estimates;
use super::forward::probes;
use super::prepare::{Clip, Prepared};
use super::progress::Meter;
use super::run::{Run, Tally};
use crate::error::{Result, Warning};
use crate::fit::free_head::FreeHead;
use crate::fit::head::{HeadFrame, HeadMotion};
use crate::fit::placement::Marker;
use crate::fit::registration::Registration;
use crate::fit::sequence::settings;
use crate::fit::{Estimate, Fit};
use crate::forward::Work;
use crate::markers::Recording;
use crate::math::motion::Motion;
use crate::math::tensor::subtract;
use crate::report::state::{Carried, Checkpoints, Left, SavedFrame, SavedOutcome};
use crate::report::tables::{FreeHeadRow, HeadRow, Placement, write_free_head, write_head, write_registration};
use crate::report::{FailedFrame, Frame, Record};
use crate::scene::{ClipSpec, FitSpec, Scene};
use std::time::Instant;

/// Fits every frame that is not done, keeps and writes it, prints the page.
pub(super) fn fit(
    scene: &Scene,
    spec: &FitSpec,
    prepared: &Prepared,
    Clip { recording, registration, frames, .. }: &Clip,
    (run, flags): (&Run, &Flags),
    (checkpoints, left): (&Checkpoints, Option<Left>),
    work: &mut Work,
) -> Result<Tally> {
    let built = &prepared.built;
    let probes = probes(scene, built);
    let mut fit = Fit::new(&built.model, scene, spec, recording)?;
    write_registration(&run.folder, &placements(fit.markers(), registration))?;
    if let Some(head) = &registration.head {
        write_head(&run.folder, &heads(head, registration, recording))?;
    }
    let record = Record::create(&run.folder, &built.model, &probes, &scene.output, true)?;
    let placed = fit.markers().iter().map(|m| (m.name.clone(), m.point));
    let estimates = Estimates::new(prepared, settings(scene), placed)?;
    let mut book = Book::new(&built.model, scene, &fit, record, estimates);
    for (frame, warning) in &run.noticed {
        book.tally.keep(*frame, std::slice::from_ref(warning));
    }
    let mut meter = Meter::new(flags, frames.len(), Some(&run.log));
    let mut done = 0;
    // frames wait for the others where the clip is smoothed
    let smoothed = spec.objectives.clip == ClipSpec::Smoother;
    let mut passed: Vec<Option<Estimate>> = Vec::new();
    if let Some(Left { frames, carried }) = left {
        done = frames.len();
        for outcome in frames {
            match outcome {
                SavedOutcome::Fitted(saved) if smoothed => passed.push(Some(saved.estimate)),
                SavedOutcome::Fitted(saved) => {
                    let SavedFrame { estimate, error, unestimated, help } = *saved;
                    book.frame(estimate, &fit, Beside::Known { error, unestimated, help }, &mut meter, flags)?;
                }
                SavedOutcome::Failed(failed) => {
                    passed.push(None);
                    book.tally.failed.push(failed);
                }
            }
            meter.frame("done before", &[]);
        }
        if let Some(Carried { fit: memory, halved }) = carried {
            fit.restore(memory)?;
            book.estimates.restore_tangent(halved.as_ref())?;
        }
    }
    for (at, &index) in frames.iter().enumerate().skip(done) {
        if run.is_interrupted() {
            book.tally.interrupted = true;
            break;
        }
        let frame = Frame { index, time_s: recording.frames[index].time_s };
        let before = fit.work().linear.factorisations;
        let said;
        let mut numbers = vec![("frame", index as f64), ("frame_time_s", frame.time_s)];
        let outcome = match fit.frame(recording, index) {
            Ok(estimate) => {
                let (steps, factorisations) = (estimate.iterations.len(), fit.work().linear.factorisations - before);
                said = format!(
                    "t {:.3} s: rms {:.3} mm, {steps} steps, {factorisations} factorisations",
                    frame.time_s, estimate.rms_mm
                );
                numbers.extend([
                    ("rms_mm", estimate.rms_mm),
                    ("steps", steps as f64),
                    ("factorisations", factorisations as f64),
                ]);
                let saved = if smoothed {
                    passed.push(Some(estimate.clone()));
                    SavedFrame { estimate, error: None, unestimated: None, help: None }
                } else {
                    book.frame(estimate, &fit, Beside::Fresh(&fit), &mut meter, flags)?
                };
                SavedOutcome::Fitted(Box::new(saved))
            }
            Err(error) => {
                meter.fail(&error, flags);
                said = format!("t {:.3} s: failed", frame.time_s);
                passed.push(None);
                let failed = FailedFrame::new(index, &error);
                book.tally.failed.push(failed.clone());
                SavedOutcome::Failed(failed)
            }
        };
        let start = Instant::now();
        checkpoints.save(at, &outcome, &Carried { fit: fit.memory(), halved: book.estimates.tangent_states() })?;
        run.write_running(&book.tally)?;
        book.record.wrote_since(start);
        meter.frame(&said, &numbers);
    }
    meter.finish();
    if smoothed && !book.tally.interrupted {
        smooth(&mut fit, recording, (frames, &passed), &mut book, run, (&mut meter, flags))?;
    }
    *work = fit.work();
    let sought: Vec<&str> = fit.unknowns().iter().map(|k| book.labels[*k].as_str()).collect();
    if !book.heads.is_empty() {
        write_free_head(&run.folder, &sought, &free_heads(&book.heads, registration, recording))?;
    }
    book.finish(scene, (&fit, registration), work, run, (&mut meter, flags))
}

/// Smooths the clip and writes its frames; those of the pass before where that fails.
fn smooth(
    fit: &mut Fit<'_>,
    recording: &Recording,
    (frames, passed): (&[usize], &[Option<Estimate>]),
    book: &mut Book<'_>,
    run: &Run,
    (meter, flags): (&mut Meter, &Flags),
) -> Result<()> {
    let named = |at: usize| Frame { index: frames[at], time_s: recording.frames[frames[at]].time_s };
    if passed.iter().all(Option::is_none) {
        return Ok(());
    }
    let estimates = match fit.smooth(recording, frames, passed, &|| run.is_interrupted()) {
        Ok(Some(smoothed)) => {
            meter.say(&format!("smoothed over {} frames in {} sweeps\n", frames.len(), smoothed.sweeps.len()));
            smoothed.frames.into_iter().map(Result::ok).collect()
        }
        Ok(None) => {
            book.tally.interrupted = true;
            return Ok(());
        }
        Err(error) => {
            meter.fail(&error, flags);
            book.tally.failed.push(FailedFrame::new(frames[0], &error));
            passed.to_vec()
        }
    };
    for (at, estimate) in estimates.into_iter().enumerate() {
        let Some(estimate) = estimate else { continue };
        if estimate.bridged {
            let warning = Warning {
                code: "F012",
                message: format!(
                    "frame {} failed and is bridged: what stands there is what its neighbours say",
                    frames[at]
                ),
                place: None,
                help: None,
            };
            book.tally.warn(named(at), vec![warning], meter, flags);
        }
        book.frame(estimate, fit, Beside::Fresh(fit), meter, flags)?;
    }
    Ok(())
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
