//! Writing on a thread of its own: a frame is solved while the one before it is written.
//!
//! What is to be written is handed over in pages, and a page is taken when the one before it is on the disk. So pages are written in
//! their order, a kill loses no more than the frame in work and the one that is being written, and an error of writing ends
//! the run before another page is begun.

use super::progress::{Meter, took};
use super::{Flags, thread_pool};
use crate::error::Result;
use crate::forward::Work;
use crate::report::{Log, Record};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;

/// What a run writes on.
pub(super) struct Desk<'a> {
    pub record: Record<'a>,
    /// What is said of a frame is said when it is on the disk.
    pub meter: Meter,
}

/// Something to write.
type Page<'a> = Box<dyn FnOnce(&mut Desk<'a>) -> Result<()> + Send + 'a>;

/// Takes pages.
pub(super) struct Writer<'a> {
    pages: Sender<Page<'a>>,
    written: Receiver<Result<()>>,
    /// Whether a page is out of which is not known how it ended.
    out: bool,
    /// Time that was spent in waiting, s.
    waited: f64,
}

impl Desk<'_> {
    /// Writes what is known at the end, `estimate` of work and seconds of estimates, and says what writing took.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn finish(&self, work: &Work, estimate: Option<(Work, f64)>, log: &Log, flags: &Flags) -> Result<()> {
        let seconds = self.record.seconds();
        took(log, flags, "of that: wait for tables and shapes", seconds.waited);
        took(log, flags, "beside that: write tables and shapes", seconds.written);
        self.record.finish(work, estimate.as_ref().map(|(work, seconds)| (work, *seconds)))
    }
}

impl<'a> Writer<'a> {
    /// Hands a page over as soon as the one before it is written.
    ///
    /// # Errors
    /// Those of the page before.
    pub fn write(&mut self, page: impl FnOnce(&mut Desk<'a>) -> Result<()> + Send + 'a) -> Result<()> {
        self.wait()?;
        self.out = true;
        self.pages.send(Box::new(page)).unwrap_or_else(|_| unreachable!("{STAYS}"));
        Ok(())
    }

    /// Waits until the last page is written.
    fn wait(&mut self) -> Result<()> {
        if !std::mem::take(&mut self.out) {
            return Ok(());
        }
        let start = Instant::now();
        let written = self.written.recv().unwrap_or_else(|_| unreachable!("{STAYS}"));
        self.waited += start.elapsed().as_secs_f64();
        written
    }
}

const STAYS: &str = "the thread that writes stays while there may be pages";

/// Does `work`, and beside it writes the pages that it hands over; all of them are written when this ends.
///
/// # Errors
/// Those of the work and of its pages.
pub(super) fn beside<'a, T>(desk: &mut Desk<'a>, work: impl FnOnce(&mut Writer<'a>) -> Result<T>) -> Result<T> {
    // parallel loops of writing stay on its thread and out of the way of the solver's
    let aside = thread_pool(1)?;
    let (pages, to_write) = channel::<Page<'a>>();
    let (say, written) = channel();
    let (done, waited) = aside.in_place_scope(|scope| {
        scope.spawn(|_| {
            for page in to_write {
                let start = Instant::now();
                let outcome = page(desk);
                desk.record.wrote_since(start);
                // nobody asks where the work itself failed
                let _ = say.send(outcome);
            }
        });
        let mut writer = Writer { pages, written, out: false, waited: 0.0 };
        let done = work(&mut writer).and_then(|done| writer.wait().map(|()| done));
        (done, writer.waited)
    });
    desk.record.waited(waited);
    done
}

#[cfg(test)]
mod tests {
    use super::super::Cli;
    use super::*;
    use crate::error::Error;
    use crate::model::build::build;
    use crate::report::RunFolder;
    use crate::scene::Scene;
    use clap::Parser;
    use std::path::Path;
    use std::time::Duration;

    const PROBLEM: &str = "[task]\nkind = \"forward\"\n[mesh]\nblock = { origin_mm = [0, 0, 0], size_mm = [10, 10, 10], \
        elements = [1, 1, 1] }\n[tissue]\nneo-hookean = { mu_kpa = 1 }\n[[support]]\nclamp = { face = \"xi1=0\" }\n";

    /// A desk on which the work writes.
    fn at_a_desk(work: impl FnOnce(&mut Writer<'_>) -> Result<()>) -> (Result<()>, f64) {
        let folder = tempfile::tempdir().expect("a folder");
        let run = RunFolder::create(folder.path(), "run").expect("made");
        let scene = Scene::parse(PROBLEM, "problem.toml", Path::new("."), &[]).expect("a scene");
        let model = build(&scene).expect("a model").model;
        let record = Record::create(&run, &model, &[], &scene.output, false).expect("tables");
        let flags = Cli::parse_from(["risorius", "run", "--quiet"]).flags;
        let mut desk = Desk { record, meter: Meter::new(&flags, 1, None) };
        let done = beside(&mut desk, |writer| work(writer));
        (done, desk.record.seconds().waited)
    }

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn work_goes_on_while_a_page_is_written_and_pages_keep_their_order() {
        let (tell, told) = channel();
        let (went_on, wait) = channel();
        let (done, waited) = at_a_desk(|writer| {
            let first = tell.clone();
            writer.write(move |_| {
                // written only when the work has gone on
                wait.recv_timeout(LONG).expect("the work waits for a page that is not the last");
                std::thread::sleep(Duration::from_millis(50));
                first.send("first").expect("heard");
                Ok(())
            })?;
            went_on.send(()).expect("heard");
            let second = tell.clone();
            writer.write(move |_| {
                second.send("second").expect("heard");
                Ok(())
            })?;
            // a page is taken when the one before it is written
            assert_eq!(told.recv_timeout(LONG), Ok("first"));
            Ok(())
        });
        done.expect("written");
        assert_eq!(told.try_iter().collect::<Vec<_>>(), ["second"]);
        assert!((0.04..60.0).contains(&waited), "{waited} s");
    }

    #[test]
    fn an_error_of_a_page_ends_the_work_before_another_is_begun() {
        let error = || Error::NoShapes { path: "here".into() };
        let (tell, told) = channel();
        let (done, _) = at_a_desk(|writer| {
            writer.write(move |_| Err(error()))?;
            writer.write(move |_| {
                tell.send(()).expect("heard");
                Ok(())
            })
        });
        assert!(matches!(done, Err(Error::NoShapes { .. })), "{done:?}");
        assert!(told.recv().is_err(), "a page after one that failed was written");
        // also that of the last page
        let (done, _) = at_a_desk(|writer| writer.write(move |_| Err(error())));
        assert!(matches!(done, Err(Error::NoShapes { .. })), "{done:?}");
    }
}
