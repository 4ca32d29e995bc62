//! Progress of long work on standard error: a bar on a terminal, a plain line per frame elsewhere.

use super::terminal::tell;
use super::{Flags, Progress};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;

/// Shows how far a run is.
pub(super) enum Meter {
    Bar(ProgressBar),
    Plain { done: usize, of: usize },
    Silent,
}

impl Meter {
    /// For work of a number of frames.
    pub fn new(flags: &Flags, frames: usize) -> Meter {
        if flags.quiet || flags.progress == Progress::None {
            return Meter::Silent;
        }
        if flags.progress == Progress::Plain || !std::io::stderr().is_terminal() {
            return Meter::Plain { done: 0, of: frames };
        }
        let bar = ProgressBar::new(frames as u64);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} frames, {eta} left  {msg}") {
            bar.set_style(style);
        }
        Meter::Bar(bar)
    }

    /// A frame is done; `what` says how.
    pub fn frame(&mut self, what: String) {
        match self {
            Meter::Bar(bar) => {
                bar.inc(1);
                bar.set_message(what);
            }
            Meter::Plain { done, of } => {
                *done += 1;
                tell(&format!("{done}/{of} {what}\n"));
            }
            Meter::Silent => {}
        }
    }

    /// A line that stays.
    pub fn say(&self, line: &str) {
        match self {
            Meter::Bar(bar) => bar.suspend(|| tell(line)),
            Meter::Plain { .. } | Meter::Silent => tell(line),
        }
    }

    /// The work is over.
    pub fn finish(&self) {
        if let Meter::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
