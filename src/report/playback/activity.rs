//! What was done to the body, frame by frame: a run without its shapes.

use super::tracks::{Control, controls, frames};
use super::{Sheet, not_a_run, problem, status};
use crate::error::{Error, Result};
use crate::report::frame::Frame;
use crate::report::status::Status;
use crate::scene::Scene;
use std::path::{Path, PathBuf};

/// Problem, status and controls of a run of the task `forward` or `fit`.
#[derive(Debug)]
pub struct Activity {
    /// The folder.
    pub folder: PathBuf,
    /// The problem, from its lock file.
    pub scene: Scene,
    /// Why its recording cannot be read any more; the scene is without its fit then.
    pub lost_recording: Option<String>,
    /// The text of its lock file.
    pub lock: String,
    /// How it ended.
    pub status: Status,
    /// The frames that converged.
    pub frames: Vec<Frame>,
    /// Activations and poses of bones: a value per frame each.
    pub controls: Vec<Control>,
}

impl Activity {
    /// Reads the lock file, the status and the tables of controls.
    ///
    /// # Errors
    /// [`Error::NotARun`] for another folder, or the run of a study or of fibres;
    /// [`Error::DamagedRun`]; [`Error::Io`].
    pub fn read(folder: &Path) -> Result<Activity> {
        let status = status(folder)?;
        let path = folder.join("problem.lock.toml");
        let lock = std::fs::read_to_string(&path).map_err(|_| not_a_run(folder, "problem.lock.toml"))?;
        let (scene, lost_recording) = problem(folder, &path)?;
        let tables = folder.join("tables");
        let activations =
            Sheet::find(&tables, "activations")?.ok_or_else(|| not_a_run(folder, "tables/activations.csv"))?;
        let frames = frames(&activations)?;
        if frames.len() < status.frames_ok {
            let message = format!("it has {} rows, status.json counts {} frames", frames.len(), status.frames_ok);
            return Err(activations.damaged(message));
        }
        let controls = controls(&activations, &scene, &tables)?;
        Ok(Activity { folder: folder.into(), scene, lost_recording, lock, status, frames, controls })
    }

    /// The frames whose shapes were kept, and their EX files.
    pub fn kept(&self) -> Vec<(Frame, PathBuf)> {
        let file = |frame: &Frame| (*frame, self.folder.join(format!("view/result_{:04}.exf", frame.index)));
        self.frames.iter().map(file).filter(|(_, path)| path.is_file()).collect()
    }

    /// The same, of which there is at least one.
    ///
    /// # Errors
    /// [`Error::NoShapes`].
    pub fn shown(&self) -> Result<Vec<(Frame, PathBuf)>> {
        let kept = self.kept();
        if kept.is_empty() { Err(Error::NoShapes { path: self.folder.clone() }) } else { Ok(kept) }
    }
}
