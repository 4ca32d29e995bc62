//! Task `fit`: activations from a recording, frame after frame, in chunks side by side.

use super::book::{Book, Names};
use super::chunk::{Bench, Done, Job, Live, Spent};
use super::forward::probes;
use super::prepare::{Clip, Prepared};
use super::progress::Meter;
use super::run::{Run, Tally};
use super::writer::{Desk, Writer, beside};
use super::{Flags, thread_pool};
use crate::error::{Result, Warning};
use crate::fit::chunks::{Apart, Chunk, apart, chunks};
use crate::fit::free_head::FreeHead;
use crate::fit::head::{HeadFrame, HeadMotion};
use crate::fit::placement::Marker;
use crate::fit::registration::Registration;
use crate::fit::{Estimate, Fit};
use crate::forward::Work;
use crate::markers::Recording;
use crate::math::motion::Motion;
use crate::math::tensor::subtract;
use crate::report::state::{Checkpoints, Left, SavedOutcome};
use crate::report::tables::{FreeHeadRow, HeadRow, Placement, write_free_head, write_head, write_registration};
use crate::report::{FailedFrame, Frame, Record};
use crate::scene::{ClipSpec, FitSpec, Scene};
use rayon::ThreadPool;
use std::collections::BTreeMap;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// Two answers of a frame that are farther apart than this are two, standard deviations.
const APART_SDS: f64 = 0.5;

/// A chunk of the clip and its checkpoints.
pub(super) struct Part {
    chunk: Chunk,
    checkpoints: Checkpoints,
}

/// The chunks of a clip, and what an earlier process left of each.
///
/// # Errors
/// [`Error::BadCheckpoint`].
pub(super) fn parts(spec: &FitSpec, clip: &Clip, checkpoints: &Checkpoints) -> Result<Vec<(Part, Left)>> {
    let chunks = chunks(spec, &clip.markers, &clip.recording, &clip.frames)?;
    let part = |(k, chunk): (usize, Chunk)| {
        let checkpoints = checkpoints.of_chunk(k)?;
        let left = checkpoints.left(chunk.start)?;
        Ok((Part { chunk, checkpoints }, left))
    };
    chunks.into_iter().enumerate().map(part).collect()
}

/// Frames of the clip that an earlier process has done.
pub(super) fn done(parts: &[(Part, Left)]) -> usize {
    parts.iter().map(|(part, left)| left.next.saturating_sub(part.chunk.first)).sum()
}

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
        pass(&mut bench, &mut intake, lefts, &mut spent)?;
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

/// Fits the chunks side by side, on so many threads in all as there are, and takes their frames in the order of the clip.
fn pass(bench: &mut Bench<'_>, intake: &mut Intake<'_, '_>, lefts: Vec<Left>, spent: &mut Spent) -> Result<()> {
    let (job, parts) = (intake.job, intake.parts);
    let threads = rayon::current_num_threads();
    let workers = parts.len().min(threads);
    let pools = (0..workers).map(|_| thread_pool(threads / workers)).collect::<Result<Vec<_>>>()?;
    let mut chunks = parts.iter().zip(lefts).enumerate();
    let mut first = chunks.next().map(|chunk| (bench, chunk));
    let others = Mutex::new(chunks);
    let (tell, told) = channel();
    thread::scope(|scope| {
        let worker = |pool: ThreadPool| {
            let (first, others, tell) = (first.take(), &others, tell.clone());
            scope.spawn(move || pool.install(|| labour(job, first, others, &tell)))
        };
        let workers: Vec<_> = pools.into_iter().map(worker).collect();
        drop(tell);
        let taken = intake.all(told);
        for worker in workers {
            spent.add(&worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
        taken
    })
}

/// A chunk that has not begun: its number, what it is, and what an earlier process left of it.
type Todo<'p> = (usize, (&'p Part, Left));

/// Does the first chunk with a bench that there is, then others with benches of their own while there are any; gives back what those
/// have cost.
fn labour<'p>(
    job: &Job<'_>,
    first: Option<(&mut Bench<'_>, Todo<'p>)>,
    others: &Mutex<impl Iterator<Item = Todo<'p>>>,
    tell: &Sender<Result<(usize, Done)>>,
) -> Spent {
    let mut spent = Spent::default();
    let chunk = |bench: &mut Bench<'_>, (k, (part, left)): Todo<'p>| {
        bench.work(job, &part.chunk, (&part.checkpoints, left), &mut |done| tell.send(Ok((k, done))).is_ok())
    };
    let work = || -> Result<()> {
        if let Some((bench, todo)) = first
            && !chunk(bench, todo)?
        {
            return Ok(());
        }
        loop {
            // no thread panics with the lock in its hands
            let todo = others.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(todo) = todo else { return Ok(()) };
            let mut bench = Bench::new(job)?;
            let ended = chunk(&mut bench, todo);
            spent.add(&bench.cost());
            if !ended? {
                return Ok(());
            }
        }
    };
    if let Err(error) = work() {
        // nobody asks where the run has ended with an error already
        let _ = tell.send(Err(error));
    }
    spent
}

/// Where frames are taken that are done.
struct Intake<'w, 'a> {
    job: &'w Job<'a>,
    parts: &'w [Part],
    smoothed: bool,
    /// Those that wait for the others, `None` for each that failed.
    passed: Vec<Option<Estimate>>,
    book: &'w mut Book<'a>,
    writer: &'w mut Writer<'a>,
    flags: &'a Flags,
}

impl<'a> Intake<'_, 'a> {
    /// Takes frames in the order of the clip; those of later chunks wait in their checkpoints.
    fn all(&mut self, told: Receiver<Result<(usize, Done)>>) -> Result<()> {
        let parts = self.parts;
        let mut order =
            parts.iter().enumerate().flat_map(|(k, part)| part.chunk.all().map(move |at| (k, at))).peekable();
        let mut waiting = BTreeMap::new();
        for told in told {
            let (k, done) = told?;
            waiting.insert((k, done.at), done);
            while let Some(done) = order.peek().and_then(|next| waiting.remove(next)) {
                if let Some((k, _)) = order.next() {
                    self.one(k, done)?;
                }
            }
        }
        self.book.tally.interrupted = order.next().is_some();
        Ok(())
    }

    /// Takes a frame of a chunk: hands it over to be written.
    fn one(&mut self, k: usize, Done { at, live }: Done) -> Result<()> {
        let Part { chunk, checkpoints } = &self.parts[k];
        if chunk.settles(at) {
            return if chunk.seam() == Some(at) { self.seam(k, at, live.is_some()) } else { Ok(()) };
        }
        let mut entry = None;
        match checkpoints.frame(at)? {
            SavedOutcome::Fitted(saved) if self.smoothed => self.passed.push(Some(saved.estimate)),
            SavedOutcome::Fitted(saved) => entry = Some(self.book.frame(*saved, live.is_some())?),
            SavedOutcome::Failed(failed) => {
                self.passed.push(None);
                self.book.tally.failed.push(failed);
            }
        }
        let (run, flags, status) = (self.job.run, self.flags, self.book.tally.running());
        self.writer.write(move |desk| {
            entry.map_or(Ok(()), |entry| entry.write(desk, flags))?;
            status.write(&run.folder)?;
            let Some(Live { cost, said, numbers, error }) = live else {
                desk.meter.frame("done before", &[]);
                return Ok(());
            };
            desk.record.solved(cost);
            if let Some(error) = error {
                desk.meter.fail(&error, flags);
            }
            desk.meter.frame(&said, &numbers);
            Ok(())
        })
    }

    /// Compares the two answers of the frame at which a chunk and the one before it meet.
    fn seam(&mut self, k: usize, at: usize, live: bool) -> Result<()> {
        let [before, after] = [&self.parts[k - 1], &self.parts[k]].map(|part| part.checkpoints.frame(at));
        let (SavedOutcome::Fitted(before), SavedOutcome::Fitted(after)) = (before?, after?) else { return Ok(()) };
        let (before, after) = (before.estimate, after.estimate);
        let Some(found) = apart(&before, &after) else { return Ok(()) };
        let frame = Frame { index: before.frame, time_s: before.time_s };
        let warning = (found.sds > APART_SDS).then(|| two_answers(frame, &found, &self.job.names.controls));
        self.book.tally.keep(frame, warning.as_slice());
        if !live {
            return Ok(());
        }
        let flags = self.flags;
        let line = format!(
            "chunk {} of {}: of frame {} the answer of the chunk before, within {:.2} standard deviations\n",
            k + 1,
            self.parts.len(),
            frame.index,
            found.sds
        );
        self.writer.write(move |desk| {
            match warning {
                Some(warning) => desk.meter.warn(&warning, flags),
                None if flags.quiet => {}
                None => desk.meter.say(&line),
            }
            Ok(())
        })
    }
}

/// F015: it matters where the fit of a frame starts.
fn two_answers(Frame { index, .. }: Frame, found: &Apart, names: &[String]) -> Warning {
    let [before, after] = found.values;
    Warning {
        code: "F015",
        message: format!(
            "two chunks found two answers of frame {index}, where they meet: `{}` is {before:.4} and {after:.4}, {:.1} standard deviations \
             apart",
            names[found.control], found.sds
        ),
        place: None,
        help: Some(
            "let chunks overlap more (chunks = { count = .., overlap = .. } in [fit]); if they still differ there is more than one answer"
                .into(),
        ),
    }
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
