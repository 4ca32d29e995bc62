//! Where a problem comes from: a file, or the one that is built in.

use super::Flags;
use super::terminal::tell;
use crate::error::{Error, Result, Warning};
use crate::fit::recording;
use crate::markers::{self, Poses, Recording, read_bytes};
use crate::report::study::read_choices;
use crate::scene::{FitSpec, Scene, Units};
use std::path::Path;

/// The problem that runs without a file.
const PROBLEM: &str = include_str!("../../problems/face/problem.toml");
/// Its recording.
const RECORDING: &[u8] = include_bytes!("../../data/face.mcap");
/// What messages about them call the files.
const NAME: &str = "face/problem.toml (built in)";
const RECORDING_NAME: &str = "face.mcap (built in)";

/// A scene and how to read its recording.
pub(super) struct Source {
    pub scene: Scene,
    built_in: bool,
}

impl Source {
    /// Reads a problem file, or the built-in problem, with the `--set` overrides, before them what `--accuracy` chose.
    pub fn read(path: Option<&Path>, flags: &Flags) -> Result<Source> {
        match path {
            Some(path) => {
                let chosen = flags.accuracy.map(|target| chosen(path, target, flags)).transpose()?;
                let set = [&chosen.unwrap_or_default()[..], &flags.set()].concat();
                Ok(Source { scene: Scene::read(path, &set)?, built_in: false })
            }
            None => {
                let mut scene = Scene::parse(PROBLEM, NAME, Path::new(""), &flags.set())?;
                "face".clone_into(&mut scene.name);
                Ok(Source { scene, built_in: true })
            }
        }
    }

    /// Reads the recording that a fit names.
    pub fn recording(&self, fit: &FitSpec) -> Result<Recording> {
        if !self.embeds(fit) {
            return recording::read(fit);
        }
        read_bytes(Path::new(RECORDING_NAME), RECORDING, &recording::options(fit))
            .map_err(|error| Error::Named(Box::new((error, fit.markers_place.clone()))))
    }

    /// The poses of the head, where the fit takes them from a topic of its recording.
    pub fn poses(&self, fit: &FitSpec, recording: &Recording) -> Result<Option<Poses>> {
        recording::poses(fit, recording, self.embedded_recording(fit))
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

/// The cheapest settings beside the problem file that are good enough.
fn chosen(problem: &Path, target: f64, flags: &Flags) -> Result<Vec<String>> {
    let path = problem.with_file_name("accuracy.toml");
    let (measure, settings) = read_choices(&path)?;
    if measure.unit() != "mm" {
        let message = format!("its errors are of {}, not in mm", measure.word()).into();
        return Err(Error::BadAccuracy { path, message });
    }
    let best = settings.iter().map(|s| s.error).fold(f64::INFINITY, f64::min);
    match settings.into_iter().find(|setting| setting.error <= target) {
        Some(setting) => {
            if !flags.quiet {
                tell(&format!(
                    "accuracy: {} for {} within {target} mm (error {:.2e} mm in the study)\n",
                    setting.name,
                    measure.word(),
                    setting.error
                ));
            }
            Ok(setting.set)
        }
        None => Err(Error::AccuracyOutOfReach { path, target, best }),
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
