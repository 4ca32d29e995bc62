//! Everything that comes before the first solve: the model, the recording, and what is wrong with either.

use super::problem::{Source, recording_warnings};
use crate::error::{Error, Result, Warning};
use crate::fit::placement::{Marker, place};
use crate::fit::recording::chosen_frames;
use crate::fit::registration::{Registration, register};
use crate::markers::Recording;
use crate::model::build::{Built, build, host};
use crate::model::halved::Halved;
use crate::scene::{FitSpec, Scene, Task};

/// A problem that can be solved.
pub(super) struct Prepared {
    pub built: Built,
    /// Present where the task is a fit.
    pub clip: Option<Clip>,
    /// The same on halved elements, where an estimate of the error is asked for and can be had.
    pub halved: Option<Halved>,
    pub warnings: Vec<Warning>,
}

/// A recording on a model.
pub(super) struct Clip {
    /// In the coordinates of the model.
    pub recording: Recording,
    pub registration: Registration,
    /// The frames to fit.
    pub frames: Vec<usize>,
    pub markers: Vec<Marker>,
    pub warnings: Vec<Warning>,
}

/// Builds the model and places the recording on it.
///
/// # Errors
/// All mistakes of geometry, recording and markers at once.
pub(super) fn prepare(source: &Source) -> Result<Prepared> {
    let scene = &source.scene;
    let built = build(scene);
    let clip = match (scene.task, &scene.fit) {
        (Task::Fit, Some(fit)) => clip(source, scene, fit).map(Some),
        _ => Ok(None),
    };
    match (built, clip) {
        (Ok(built), Ok(clip)) => {
            let mut warnings = scene.warnings.clone();
            warnings.extend(built.warnings.iter().cloned());
            warnings.extend(clip.iter().flat_map(|clip| clip.warnings.iter().cloned()));
            let halved = scene.output.estimate.then(|| Halved::new(scene, &built.model));
            let halved = halved.and_then(|halved| halved.map_err(|warning| warnings.push(*warning)).ok());
            Ok(Prepared { built, clip, halved, warnings })
        }
        (built, clip) => {
            let mistakes = [built.err(), clip.err()].into_iter().flatten();
            Err(Error::all(mistakes.flat_map(Error::into_mistakes).collect()))
        }
    }
}

fn clip(source: &Source, scene: &Scene, fit: &FitSpec) -> Result<Clip> {
    let mut recording = source.recording(fit)?;
    let mut warnings = recording_warnings(&recording);
    let frames = chosen_frames(fit, &recording);
    let placed = match host(&scene.mesh) {
        Ok(mesh) => place(scene, fit, &mesh, &recording).and_then(|markers| {
            let poses = source.poses(fit, &recording)?;
            let (registration, odd) = register(scene, fit, &mesh, &markers, &mut recording, poses.as_ref())?;
            warnings.extend(odd);
            Ok((markers, registration))
        }),
        // building the model tells what is wrong with the host
        Err(_) => Err(Error::Mistakes(Vec::new())),
    };
    match (frames, placed) {
        (Ok(frames), Ok((markers, registration))) => Ok(Clip { recording, registration, frames, markers, warnings }),
        (frames, placed) => {
            let mistakes = [frames.err(), placed.err()].into_iter().flatten();
            Err(Error::all(mistakes.flat_map(Error::into_mistakes).collect()))
        }
    }
}
