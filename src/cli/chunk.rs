//! A chunk of a clip: its frames one after the other, each kept when it is done.

use super::book::Names;
use super::prepare::{Clip, Prepared};
use super::run::Run;
use super::scout::Scout;
use crate::error::{Error, Result};
use crate::fit::Fit;
use crate::fit::chunks::{Chunk, chunks};
use crate::forward::{Watch, Work};
use crate::report::FailedFrame;
use crate::report::state::{Carried, Checkpoints, Left, SavedFrame, SavedOutcome};
use crate::report::tables::FrameCost;
use crate::scene::{ClipSpec, FitSpec, Scene};
use std::sync::Arc;
use std::time::Instant;

/// A chunk of the clip and its checkpoints.
pub(super) struct Part {
    pub chunk: Chunk,
    pub checkpoints: Checkpoints,
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

/// What every chunk is fitted to and with.
pub(super) struct Job<'a> {
    pub scene: &'a Scene,
    pub spec: &'a FitSpec,
    pub prepared: &'a Prepared,
    pub clip: &'a Clip,
    pub names: &'a Names,
    pub run: &'a Run,
    /// Sees the steps of all.
    pub watch: Watch,
}

/// A fit and what goes along with it.
pub(super) struct Bench<'a> {
    pub fit: Fit<'a>,
    pub scout: Scout<'a>,
}

/// A frame is done, and lies in the checkpoint of its chunk.
pub(super) struct Done {
    /// Its place in the fit.
    pub at: usize,
    /// Absent where an earlier process has done it.
    pub live: Option<Live>,
}

/// What is told of a frame that was fitted in this process.
pub(super) struct Live {
    pub cost: FrameCost,
    pub said: String,
    pub numbers: Vec<(&'static str, f64)>,
    /// Why it failed.
    pub error: Option<Error>,
}

impl<'a> Bench<'a> {
    /// # Errors
    /// As [`Fit::new`] and [`Scout::new`].
    pub fn new(job: &Job<'a>) -> Result<Bench<'a>> {
        let fit = Fit::new(&job.prepared.built.model, job.scene, job.spec, &job.clip.recording)?;
        Bench::with(fit, job)
    }

    /// With a fit of the job.
    pub fn with(mut fit: Fit<'a>, job: &Job<'a>) -> Result<Bench<'a>> {
        fit.set_watch(Arc::clone(&job.watch));
        let scout = Scout::new(job.prepared, job.scene, &fit, &job.names.controls)?;
        Ok(Bench { fit, scout })
    }

    /// Does what is left of a chunk, until the run is interrupted or nobody listens to `tell` any more. Whether it came to the end.
    ///
    /// # Errors
    /// What cannot be restored, scouted or kept.
    pub fn work(
        &mut self,
        job: &Job<'_>,
        Part { chunk, checkpoints }: &Part,
        left: Left,
        tell: &mut dyn FnMut(Done) -> bool,
    ) -> Result<bool> {
        let Left { next, carried } = left;
        if !(chunk.start..next).all(|at| tell(Done { at, live: None })) {
            return Ok(false);
        }
        if let Some(Carried { fit, halved }) = carried {
            self.fit.restore(fit)?;
            self.scout.restore_tangent(halved.as_ref())?;
        }
        for at in next..chunk.end {
            if job.run.is_interrupted() {
                return Ok(false);
            }
            let (outcome, live) = self.frame(job, at, at > chunk.start)?;
            let carried = Carried { fit: self.fit.memory(), halved: self.scout.tangent_states() };
            checkpoints.save(at, &outcome, &carried)?;
            if !tell(Done { at, live: Some(live) }) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn frame(&mut self, job: &Job<'_>, at: usize, warm: bool) -> Result<(SavedOutcome, Live)> {
        let Clip { recording, frames, .. } = job.clip;
        let (index, time_s) = (frames[at], recording.frames[frames[at]].time_s);
        let (start, before) = (Instant::now(), self.fit.work().linear.factorisations);
        let mut numbers = vec![("frame", index as f64), ("frame_time_s", time_s)];
        let (outcome, said, error) = match self.fit.frame(recording, index) {
            Ok(estimate) => {
                let (rms, steps) = (estimate.rms_mm, estimate.iterations.len());
                let factorisations = self.fit.work().linear.factorisations - before;
                let counts = [("steps", steps as f64), ("factorisations", factorisations as f64)];
                numbers.extend([("rms_mm", rms)].into_iter().chain(counts));
                let saved = match job.spec.objectives.clip {
                    // the rest is found when it is smoothed
                    ClipSpec::Smoother => SavedFrame { estimate, error: None, unestimated: None, help: None },
                    ClipSpec::Causal => self.scout.frame(estimate, &self.fit)?,
                };
                let said =
                    format!("t {time_s:.3} s: rms {rms:.3} mm, {steps} steps, {factorisations} factorisations");
                (SavedOutcome::Fitted(Box::new(saved)), said, None)
            }
            Err(error) => {
                let failed = FailedFrame::new(index, &error);
                (SavedOutcome::Failed(failed), format!("t {time_s:.3} s: failed"), Some(error))
            }
        };
        let factorisations = self.fit.work().linear.factorisations - before;
        let cost = FrameCost { seconds: start.elapsed().as_secs_f64(), factorisations, warm };
        Ok((outcome, Live { cost, said, numbers, error }))
    }

    /// What the bench has cost: the work of the fit; work and seconds of the scout, if there were any.
    pub fn cost(&self) -> Spent {
        Spent { work: self.fit.work(), estimates: self.scout.cost() }
    }
}

/// Work of benches.
#[derive(Default)]
pub(super) struct Spent {
    pub work: Work,
    pub estimates: Option<(Work, f64)>,
}

impl Spent {
    /// Adds that of another bench.
    pub fn add(&mut self, other: &Spent) {
        self.work.add(&other.work);
        if let Some((work, seconds)) = &other.estimates {
            let (sum, total) = self.estimates.get_or_insert_default();
            sum.add(work);
            *total += seconds;
        }
    }
}
