//! Where the frames of chunks come together: in the order of the clip they are taken from their checkpoints, entered in the book and
//! handed over to be written.

use super::Flags;
use super::book::Book;
use super::chunk::{Done, Job, Live, Part};
use super::side_by_side::Told;
use super::writer::Writer;
use crate::error::{Result, Warning};
use crate::fit::Estimate;
use crate::fit::chunks::{Apart, apart};
use crate::report::Frame;
use crate::report::state::SavedOutcome;
use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;

/// Two answers of a frame that are farther apart than this are two, standard deviations.
const APART_SDS: f64 = 0.5;

/// Where frames are taken that are done.
pub(super) struct Intake<'w, 'a> {
    pub job: &'w Job<'a>,
    pub parts: &'w [Part],
    /// Whether they wait for the others.
    pub smoothed: bool,
    /// Those that wait for the others, `None` for each that failed.
    pub passed: Vec<Option<Estimate>>,
    pub book: &'w mut Book<'a>,
    pub writer: &'w mut Writer<'a>,
    pub flags: &'a Flags,
}

impl<'a> Intake<'_, 'a> {
    /// Takes frames in the order of the clip; those of later chunks wait in their checkpoints.
    ///
    /// # Errors
    /// Those of the chunks; what cannot be written.
    pub fn all(&mut self, told: Receiver<Told>) -> Result<()> {
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
