//! Task `fit`: activations from a recording, frame after frame, in chunks side by side.

use super::Flags;
use super::book::{Book, Names};
use super::chunk::{Bench, Job, Part, Spent, parts};
use super::forward::probes;
use super::intake::Intake;
use super::prepare::{Clip, Prepared};
use super::progress::Meter;
use super::run::{Run, Tally};
use super::side_by_side::side_by_side;
use super::writer::{Desk, beside};
use crate::error::Result;
use crate::fit::Fit;
use crate::fit::free_head::FreeHead;
use crate::fit::head::{HeadFrame, HeadMotion};
use crate::fit::placement::Marker;
use crate::fit::registration::Registration;
use crate::forward::Work;
use crate::markers::Recording;
use crate::math::motion::Motion;
use crate::math::tensor::subtract;
use crate::report::state::{Checkpoints, Left};
use crate::report::tables::{FreeHeadRow, HeadRow, Placement, write_free_head, write_head, write_registration};
use crate::report::{FailedFrame, Frame, Record};
use crate::scene::{ClipSpec, FitSpec, Scene};

/// Fits every frame that is not done, keeps and writes it, prints the page.
pub(super) fn fit(
    scene: &Scene,
    spec: &FitSpec,
    prepared: &Prepared,
    clip: &Clip,
    (run, flags): (&Run, &Flags),
    checkpoints: &Checkpoints,
    work: &mut Work,
) -> Result<Tally> {
    let Clip { recording, registration, frames, .. } = clip;
    let built = &prepared.built;
    let probes = probes(scene, built);
    let (parts, lefts): (Vec<Part>, Vec<Left>) = parts(spec, clip, checkpoints)?.into_iter().unzip();
    let fit = Fit::new(&built.model, scene, spec, recording)?;
    write_registration(&run.folder, &placements(fit.markers(), registration))?;
    if let Some(head) = &registration.head {
        write_head(&run.folder, &heads(head, registration, recording))?;
    }
    let record = Record::create(&run.folder, &built.model, &probes, &scene.output, true)?;
    let names = Names::new(&built.model, scene, &fit);
    let mut book = Book::new(&built.model, &names, &fit);
    for (frame, warning) in &run.noticed {
        book.tally.keep(*frame, std::slice::from_ref(warning));
    }
    let mut desk = Desk { record, meter: Meter::new(flags, frames.len(), Some(&run.log)) };
    let job = Job { scene, spec, prepared, clip, names: &names, run, watch: desk.meter.steps(flags) };
    let mut bench = Bench::with(fit, &job)?;
    // frames wait for the others where the clip is smoothed
    let smoothed = spec.objectives.clip == ClipSpec::Smoother;
    let mut spent = Spent::default();
    beside(&mut desk, |writer| {
        let mut intake =
            Intake { job: &job, parts: &parts, smoothed, passed: Vec::new(), book: &mut book, writer, flags };
        side_by_side(&mut bench, (&job, &parts, lefts), &mut spent, |told| intake.all(told))?;
        match smoothed && !intake.book.tally.interrupted {
            true => smooth(&mut bench, intake),
            false => Ok(()),
        }
    })?;
    desk.meter.finish();
    spent.add(&bench.cost());
    *work = spent.work;
    let fit = &bench.fit;
    let sought: Vec<&str> = fit.unknowns().iter().map(|k| names.controls[*k].as_str()).collect();
    if !book.heads.is_empty() {
        write_free_head(&run.folder, &sought, &free_heads(&book.heads, registration, recording))?;
    }
    book.finish(scene, (fit, registration), (work, spent.estimates), run, (desk, flags))
}

/// Smooths the clip and hands its frames over; those of the pass before where that fails.
fn smooth(Bench { fit, scout }: &mut Bench<'_>, intake: Intake<'_, '_>) -> Result<()> {
    let Intake { job, passed, book, writer, flags, .. } = intake;
    let (run, Clip { recording, frames, .. }) = (job.run, job.clip);
    if passed.iter().all(Option::is_none) {
        return Ok(());
    }
    let estimates = match fit.smooth(recording, frames, &passed, &|| run.is_interrupted()) {
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
            passed
        }
    };
    for estimate in estimates.into_iter().flatten() {
        let entry = book.frame(scout.frame(estimate, fit)?, true)?;
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
