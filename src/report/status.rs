//! `status.json`: how a run stands or ended, for whoever asks while it goes on or afterwards.

use super::run_folder::{RunFolder, write_over};
use crate::error::{Error, Result, Warning};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How a run stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// It goes on; or it was killed and could not say so.
    Running,
    /// Every frame converged.
    Converged,
    /// Some frames converged.
    Partial,
    /// No frame converged, or something else went wrong.
    Failed,
    /// Ctrl-C: what was finished before is there.
    Interrupted,
}

/// A frame that did not converge.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedFrame {
    /// The frame, from 0.
    pub frame: usize,
    /// The stable code of the error, for example `S003`.
    pub code: String,
    /// What went wrong, with its numbers.
    pub message: String,
}

/// What the reader of a frame must know: it converged, and is perhaps not what was meant.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameWarning {
    /// The frame, from 0.
    pub frame: usize,
    /// The stable code of the warning, for example `S007`.
    pub code: String,
    /// What was noticed, with its numbers.
    pub message: String,
}

impl FrameWarning {
    /// From the warning of a frame.
    pub fn new(frame: usize, warning: &Warning) -> FrameWarning {
        FrameWarning { frame, code: warning.code.into(), message: warning.message.clone() }
    }
}

/// An error that belongs to no frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fatal {
    /// The stable code.
    pub code: String,
    /// What went wrong, with its numbers.
    pub message: String,
}

/// The contents of `status.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// How the run stands.
    pub status: Outcome,
    /// The exit code of the process; `None` while it goes on.
    pub exit: Option<u8>,
    /// Frames that converged.
    pub frames_ok: usize,
    /// Frames that did not, in their order.
    pub frames_failed: Vec<FailedFrame>,
    /// What was noticed in frames, in their order.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub warnings: Vec<FrameWarning>,
    /// What ended the run, if it was not a frame.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error: Option<Fatal>,
}

impl FailedFrame {
    /// From the error of a frame.
    pub fn new(frame: usize, error: &Error) -> FailedFrame {
        FailedFrame { frame, code: error.code().into(), message: error.to_string() }
    }
}

impl Status {
    /// Of a run that goes on.
    pub fn running(frames_ok: usize, frames_failed: Vec<FailedFrame>) -> Status {
        Status { status: Outcome::Running, exit: None, frames_ok, frames_failed, warnings: Vec::new(), error: None }
    }

    /// Of a run that came to its end: exit 0 if no frame failed, else 4.
    pub fn finished(frames_ok: usize, frames_failed: Vec<FailedFrame>) -> Status {
        let (status, exit) = match (frames_ok, frames_failed.len()) {
            (_, 0) => (Outcome::Converged, 0),
            (0, _) => (Outcome::Failed, 4),
            _ => (Outcome::Partial, 4),
        };
        Status { status, exit: Some(exit), ..Status::running(frames_ok, frames_failed) }
    }

    /// Of a run that was interrupted: exit 130.
    pub fn interrupted(frames_ok: usize, frames_failed: Vec<FailedFrame>) -> Status {
        Status { status: Outcome::Interrupted, exit: Some(130), ..Status::running(frames_ok, frames_failed) }
    }

    /// Of a run that an error ended which belongs to no frame.
    pub fn failed(frames_ok: usize, frames_failed: Vec<FailedFrame>, error: &Error) -> Status {
        let fatal = Fatal { code: error.code().into(), message: error.to_string() };
        Status {
            status: Outcome::Failed,
            exit: Some(error.exit_code()),
            error: Some(fatal),
            ..Status::running(frames_ok, frames_failed)
        }
    }

    /// Writes that an error ended the run: its frames are those of the last `status.json`. On a full disk the file is written
    /// over in its place; where even that fails it still says that the run goes on, as it does after a kill.
    pub fn write_failed(run: &RunFolder, error: &Error) {
        let before = Status::read(run.path()).unwrap_or_else(|| Status::running(0, Vec::new()));
        let status =
            Status { warnings: before.warnings, ..Status::failed(before.frames_ok, before.frames_failed, error) };
        // the error that ended the run is the one to tell
        if status.write(run).is_err()
            && let Ok(text) = json(run, "status.json", &Status { warnings: Vec::new(), ..status })
        {
            let _ = write_over(&run.path().join("status.json"), text.as_bytes());
        }
    }

    /// Reads that of a run; `None` where there is none.
    pub fn read(run: &Path) -> Option<Status> {
        serde_json::from_slice(&std::fs::read(run.join("status.json")).ok()?).ok()
    }

    /// Writes `status.json`, atomically.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, run: &RunFolder) -> Result<()> {
        write_json(run, "status.json", self)
    }
}

/// Writes a value as indented JSON that ends with a newline, atomically.
pub(in crate::report) fn write_json(run: &RunFolder, name: &str, value: &impl Serialize) -> Result<()> {
    run.write(name, json(run, name, value)?)
}

fn json(run: &RunFolder, name: &str, value: &impl Serialize) -> Result<String> {
    let json = serde_json::to_string_pretty(value).map_err(|error| Error::Io {
        action: "write",
        path: run.path().join(name),
        source: error.into(),
    })?;
    Ok(json + "\n")
}
