//! Where a problem comes from: a file, or the one that is built in.

use super::Flags;
use crate::error::{Error, Result, Warning};
use crate::markers::{self, ReadOptions, Recording, read, read_bytes};
use crate::scene::{FitSpec, FramesSpec, Scene, Units};
use std::path::Path;

/// The problem that runs without a file.
const PROBLEM: &str = include_str!("../../problems/beam/problem.toml");
/// Its recording.
const RECORDING: &[u8] = include_bytes!("../../data/beam.mcap");
/// What messages about them call the files.
const NAME: &str = "beam/problem.toml (built in)";
const RECORDING_NAME: &str = "beam.mcap (built in)";

/// A scene and how to read its recording.
pub(super) struct Source {
    pub scene: Scene,
    built_in: bool,
}

impl Source {
    /// Reads a problem file, or the built-in problem, with the `--set` overrides.
    pub fn read(path: Option<&Path>, flags: &Flags) -> Result<Source> {
        match path {
            Some(path) => Ok(Source { scene: Scene::read(path, &flags.set)?, built_in: false }),
            None => {
                let mut scene = Scene::parse(PROBLEM, NAME, Path::new(""), &flags.set)?;
                "beam".clone_into(&mut scene.name);
                Ok(Source { scene, built_in: true })
            }
        }
    }

    /// Reads the recording that a fit names.
    pub fn recording(&self, fit: &FitSpec) -> Result<Recording> {
        let options = ReadOptions {
            topic: fit.topic.clone(),
            units: fit.units,
            zero_is_missing: fit.zero_is_missing,
            allow_truncated: fit.allow_truncated,
            allow_unchecked: fit.allow_unchecked,
        };
        let recording = if self.embeds(fit) {
            read_bytes(Path::new(RECORDING_NAME), RECORDING, &options)
        } else {
            read(&fit.markers, &options)
        };
        recording.map_err(|error| Error::Named(Box::new((error, fit.markers_place.clone()))))
    }

    /// The recording as bytes, if it is the built-in one: a run keeps a copy, so that its lock file can be run again.
    pub fn embedded_recording(&self, fit: &FitSpec) -> Option<&'static [u8]> {
        self.embeds(fit).then_some(RECORDING)
    }

    /// The built-in problem uses the built-in recording unless `--set fit.markers` names another.
    fn embeds(&self, fit: &FitSpec) -> bool {
        self.built_in && &*fit.markers_place.file == NAME
    }
}

/// What a recording warns of, as messages.
pub(super) fn recording_warnings(recording: &Recording) -> Vec<Warning> {
    use markers::Warning as Noticed;
    let message = |noticed: &Noticed| Warning {
        code: "M020",
        message: format!("{}: {noticed}", recording.source.path.display()),
        place: None,
        help: match noticed {
            Noticed::Truncated { .. } => Some("copy the file again from where it was recorded".into()),
            Noticed::Unchecked { .. } | Noticed::ChunksWithoutChecksum { .. } => {
                Some("rewrite it with checksums: mcap recover IN -o OUT".into())
            }
            Noticed::ClockFallback { .. } => Some("have the driver stamp its messages when it measures".into()),
            Noticed::UnitsDisagree { declared, .. } => match Units::from_name(declared) {
                Some(units) => Some(format!("if the file is right, write units = \"{units}\" in [fit]")),
                None => Some("check which of the two is right; nothing was converted".into()),
            },
            Noticed::ZerosKept { .. } => Some("remove zero_is_missing = false from [fit] to leave them out".into()),
        },
    };
    recording.health.warnings.iter().map(message).collect()
}

/// The frames of a recording that a fit asks for.
///
/// # Errors
/// Where the recording does not have the first or the last of them.
pub(super) fn chosen_frames(fit: &FitSpec, recording: &Recording) -> Result<Vec<usize>> {
    let count = recording.frames.len();
    let FramesSpec { first, last, step } = fit.frames;
    let last = last.unwrap_or(count.saturating_sub(1));
    if let Some(frame) = [first, last].into_iter().find(|frame| *frame >= count) {
        return Err(Error::NoSuchFrame { frame, count, place: Box::new(fit.frames_place.clone()) });
    }
    Ok((first..=last).step_by(step).collect())
}
