//! Progress of long work on standard error: a bar on a terminal, a plain line per frame elsewhere; and in the log of the run.

use super::diagnostics::{render_error, render_warning};
use super::terminal::tell;
use super::{Flags, Progress};
use crate::error::{Error, Warning};
use crate::forward::{Step, StepKind, Watch};
use crate::report::{Level, Log};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Arc;
use std::time::Instant;

/// Shows how far a run is.
pub(super) struct Meter {
    shown: Shown,
    log: Option<Arc<Log>>,
}

/// How it is shown.
enum Shown {
    Bar(ProgressBar),
    Plain { done: usize, of: usize },
    Silent,
}

impl Meter {
    /// For work of a number of frames, of a run that has a log.
    pub fn new(flags: &Flags, frames: usize, log: Option<&Arc<Log>>) -> Meter {
        Meter { shown: Shown::new(flags, frames), log: log.cloned() }
    }

    /// A frame is done; `what` says how, and `numbers` are those of it.
    pub fn frame(&mut self, what: &str, numbers: &[(&str, f64)]) {
        if let Some(log) = &self.log {
            log.add(Level::Info, None, what, numbers);
        }
        match &mut self.shown {
            Shown::Bar(bar) => {
                bar.inc(1);
                bar.set_message(what.to_owned());
            }
            Shown::Plain { done, of } => {
                *done += 1;
                tell(&format!("{done}/{of} {what}\n"));
            }
            Shown::Silent => {}
        }
    }

    /// A line that stays.
    pub fn say(&self, line: &str) {
        if let Some(log) = &self.log {
            log.add(Level::Info, None, line, &[]);
        }
        self.show(line);
    }

    /// Tells every step of a path: in the log of the run, beside the bar, and under `-v` as a line.
    pub fn steps(&self, flags: &Flags) -> Watch {
        let log = self.log.clone();
        let verbose = flags.verbose;
        let bar = match &self.shown {
            Shown::Bar(bar) => Some(bar.clone()),
            Shown::Plain { .. } | Shown::Silent => None,
        };
        Arc::new(move |Step { place, kind, iterations, residual, required }: &Step| {
            let (way, taken) = (100.0 * place, iterations.len());
            let told = match kind {
                StepKind::Walked => format!("{way:.3} % of the way: {taken} iterations"),
                StepKind::Snapped => format!("{way:.3} % of the way: let go, {taken} iterations"),
                StepKind::Hardened => format!("contact is hardened: {taken} iterations"),
                StepKind::Failed => format!(
                    "{way:.3} % of the way: not found, {taken} iterations, residual {residual:.1e} of {required:.1e} mN"
                ),
            };
            if let Some(log) = &log {
                let numbers = [
                    ("place", *place),
                    ("iterations", taken as f64),
                    ("residual_mn", *residual),
                    ("required_mn", *required),
                ];
                log.add(Level::Info, None, &told, &numbers);
            }
            let line = || tell(&format!("  {told}\n"));
            match &bar {
                Some(bar) if verbose => bar.suspend(line),
                Some(bar) => bar.set_message(told.clone()),
                None if verbose => line(),
                None => {}
            }
        })
    }

    /// What a frame gave notice of.
    pub fn warn(&self, warning: &Warning, flags: &Flags) {
        if let Some(log) = &self.log {
            log.warn(warning);
        }
        if flags.shows_warnings() {
            self.show(&render_warning(warning, flags.colour()));
        }
    }

    /// Why a frame failed.
    pub fn fail(&self, error: &Error, flags: &Flags) {
        if let Some(log) = &self.log {
            log.error(error);
        }
        self.show(&render_error(error, flags.colour()));
    }

    fn show(&self, line: &str) {
        match &self.shown {
            Shown::Bar(bar) => bar.suspend(|| tell(line)),
            Shown::Plain { .. } | Shown::Silent => tell(line),
        }
    }

    /// The work is over.
    pub fn finish(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

impl Shown {
    fn new(flags: &Flags, frames: usize) -> Shown {
        if flags.quiet || flags.progress == Progress::None {
            return Shown::Silent;
        }
        if flags.progress == Progress::Plain || !std::io::stderr().is_terminal() {
            return Shown::Plain { done: 0, of: frames };
        }
        let bar = ProgressBar::new(frames as u64);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} frames, {eta} left  {msg}") {
            bar.set_style(style);
        }
        Shown::Bar(bar)
    }
}

/// Does a stage of a run; the log says what it took, and under `-v` the terminal.
pub(super) fn stage<T>(log: &Log, flags: &Flags, what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let done = work();
    took(log, flags, what, start.elapsed().as_secs_f64());
    done
}

/// Says what a stage took.
pub(super) fn took(log: &Log, flags: &Flags, what: &str, seconds: f64) {
    log.add(Level::Stage, None, what, &[("seconds", seconds)]);
    if flags.verbose {
        tell(&format!("{seconds:>9.3} s  {what}\n"));
    }
}
