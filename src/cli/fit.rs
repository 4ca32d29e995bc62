//! Task `fit`: activations from a recording, frame after frame.

use super::Flags;
use super::book::{Beside, Book, Entry, Names};
use super::estimate::Estimates;
use super::forward::probes;
use super::prepare::{Clip, Prepared};
use super::progress::Meter;
use super::run::{Run, Tally};
use super::writer::{Desk, Writer, beside};
use crate::error::{Error, Result};
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
use crate::report::tables::{
    FrameCost, FreeHeadRow, HeadRow, Placement, write_free_head, write_head, write_registration,
};
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
    let names = Names::new(&built.model, scene, &fit);
    let mut book = Book::new(&built.model, &names, &fit, estimates);
    for (frame, warning) in &run.noticed {
        book.tally.keep(*frame, std::slice::from_ref(warning));
    }
    let meter = Meter::new(flags, frames.len(), Some(&run.log));
    fit.set_watch(meter.steps(flags));
    let mut desk = Desk { record, meter };
    // frames wait for the others where the clip is smoothed
    let smoothed = spec.objectives.clip == ClipSpec::Smoother;
    beside(&mut desk, |writer| {
        let clip = (recording, frames.as_slice());
        let passed = pass(&mut fit, clip, smoothed, (checkpoints, left), &mut book, writer, (run, flags))?;
        match smoothed && !book.tally.interrupted {
            true => smooth(&mut fit, clip, &passed, &mut book, writer, (run, flags)),
            false => Ok(()),
        }
    })?;
    desk.meter.finish();
    *work = fit.work();
    let sought: Vec<&str> = fit.unknowns().iter().map(|k| names.controls[*k].as_str()).collect();
    if !book.heads.is_empty() {
        write_free_head(&run.folder, &sought, &free_heads(&book.heads, registration, recording))?;
    }
    book.finish(scene, (&fit, registration), work, run, (desk, flags))
}

/// How a frame ended.
enum Ended<'a> {
    /// It is written.
    Fitted(Box<Entry<'a>>),
    /// It waits for the others.
    Waits(Box<Estimate>),
    Failed(Error),
}

impl Ended<'_> {
    /// Writes and says what is to be known of a frame; gives back what is kept of it.
    fn write(self, frame: Frame, desk: &mut Desk<'_>, flags: &Flags) -> Result<SavedOutcome> {
        Ok(match self {
            Ended::Fitted(entry) => {
                entry.write(desk, flags)?;
                SavedOutcome::Fitted(Box::new(entry.saved))
            }
            Ended::Waits(estimate) => {
                let saved = SavedFrame { estimate: *estimate, error: None, unestimated: None, help: None };
                SavedOutcome::Fitted(Box::new(saved))
            }
            Ended::Failed(error) => {
                desk.meter.fail(&error, flags);
                SavedOutcome::Failed(FailedFrame::new(frame.index, &error))
            }
        })
    }
}

/// Takes the frames that are done, fits the others one after the other, and hands each over to be written and kept; gives back those
/// that wait for the others, `None` for each that failed.
fn pass<'a>(
    fit: &mut Fit<'_>,
    (recording, frames): (&Recording, &[usize]),
    smoothed: bool,
    (checkpoints, left): (&'a Checkpoints, Option<Left>),
    book: &mut Book<'a>,
    writer: &mut Writer<'a>,
    (run, flags): (&'a Run, &'a Flags),
) -> Result<Vec<Option<Estimate>>> {
    let mut done = 0;
    let mut passed: Vec<Option<Estimate>> = Vec::new();
    if let Some(Left { frames, carried }) = left {
        done = frames.len();
        for outcome in frames {
            let mut entry = None;
            match outcome {
                SavedOutcome::Fitted(saved) if smoothed => passed.push(Some(saved.estimate)),
                SavedOutcome::Fitted(saved) => {
                    let SavedFrame { estimate, error, unestimated, help } = *saved;
                    entry = Some(book.frame(estimate, fit, Beside::Known { error, unestimated, help })?);
                }
                SavedOutcome::Failed(failed) => {
                    passed.push(None);
                    book.tally.failed.push(failed);
                }
            }
            writer.write(move |desk| {
                entry.map_or(Ok(()), |entry| entry.write(desk, flags))?;
                desk.meter.frame("done before", &[]);
                Ok(())
            })?;
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
        let (start, before) = (Instant::now(), fit.work().linear.factorisations);
        let said;
        let mut numbers = vec![("frame", index as f64), ("frame_time_s", frame.time_s)];
        let ended = match fit.frame(recording, index) {
            Ok(estimate) => {
                let steps = estimate.iterations.len();
                let factorisations = fit.work().linear.factorisations - before;
                said = format!(
                    "t {:.3} s: rms {:.3} mm, {steps} steps, {factorisations} factorisations",
                    frame.time_s, estimate.rms_mm
                );
                numbers.extend([
                    ("rms_mm", estimate.rms_mm),
                    ("steps", steps as f64),
                    ("factorisations", factorisations as f64),
                ]);
                if smoothed {
                    passed.push(Some(estimate.clone()));
                    Ended::Waits(Box::new(estimate))
                } else {
                    Ended::Fitted(Box::new(book.frame(estimate, fit, Beside::Fresh(fit))?))
                }
            }
            Err(error) => {
                said = format!("t {:.3} s: failed", frame.time_s);
                passed.push(None);
                book.tally.failed.push(FailedFrame::new(index, &error));
                Ended::Failed(error)
            }
        };
        let factorisations = fit.work().linear.factorisations - before;
        let cost = FrameCost { seconds: start.elapsed().as_secs_f64(), factorisations };
        let carried = Carried { fit: fit.memory(), halved: book.estimates.tangent_states() };
        let status = book.tally.running();
        writer.write(move |desk| {
            desk.record.solved(cost);
            let outcome = ended.write(frame, desk, flags)?;
            checkpoints.save(at, &outcome, &carried)?;
            status.write(&run.folder)?;
            desk.meter.frame(&said, &numbers);
            Ok(())
        })?;
    }
    Ok(passed)
}

/// Smooths the clip and hands its frames over; those of the pass before where that fails.
fn smooth<'a>(
    fit: &mut Fit<'_>,
    (recording, frames): (&Recording, &[usize]),
    passed: &[Option<Estimate>],
    book: &mut Book<'a>,
    writer: &mut Writer<'a>,
    (run, flags): (&'a Run, &'a Flags),
) -> Result<()> {
    if passed.iter().all(Option::is_none) {
        return Ok(());
    }
    let estimates = match fit.smooth(recording, frames, passed, &|| run.is_interrupted()) {
        Ok(Some(smoothed)) => {
            let line = format!("smoothed over {} frames in {} sweeps\n", frames.len(), smoothed.sweeps.len());
            writer.write(move |desk| {
                desk.meter.say(&line);
                Ok(())
            })?;
            smoothed.frames.into_iter().map(Result::ok).collect()
        }
        Ok(None) => {
            book.tally.interrupted = true;
            return Ok(());
        }
        Err(error) => {
            book.tally.failed.push(FailedFrame::new(frames[0], &error));
            writer.write(move |desk| {
                desk.meter.fail(&error, flags);
                Ok(())
            })?;
            passed.to_vec()
        }
    };
    for estimate in estimates.into_iter().flatten() {
        let entry = book.frame(estimate, fit, Beside::Fresh(fit))?;
        writer.write(move |desk| entry.write(desk, flags))?;
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
