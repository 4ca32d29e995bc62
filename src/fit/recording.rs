//! The recording that a fit names, and which of its frames it asks for.

use super::outer;
use crate::error::{Error, Result};
use crate::markers::{self, Poses, ReadOptions, Recording, read_poses, read_poses_bytes};
use crate::scene::{FitSpec, HeadSpec, Units};

/// How a fit wants its recording read.
pub fn options(fit: &FitSpec) -> ReadOptions {
    ReadOptions {
        topic: fit.topic.clone(),
        // where the unit is to be estimated, positions stay in that of the file
        units: fit.units.unwrap_or(Units::Mm),
        zero_is_missing: fit.zero_is_missing,
        allow_truncated: fit.allow_truncated,
        allow_unchecked: fit.allow_unchecked,
    }
}

/// Reads the recording that a fit names.
///
/// # Errors
/// Whatever is wrong with the file, with the place that names it.
pub fn read(fit: &FitSpec) -> Result<Recording> {
    markers::read(&fit.markers, &options(fit))
        .map_err(|error| Error::Named(Box::new((error, fit.markers_place.clone()))))
}

/// The poses of the head, where a fit takes its motion from a topic; on the clock of the recording.
///
/// # Errors
/// Whatever is wrong with the topic, with the place that names it.
pub fn poses(fit: &FitSpec, recording: &Recording, embedded: Option<&[u8]>) -> Result<Option<Poses>> {
    let HeadSpec::PoseTopic(topic) = &fit.registration.head else { return Ok(None) };
    let (path, clock, options) = (&recording.source.path, recording.source.clock, options(fit));
    let poses = match embedded {
        Some(bytes) => read_poses_bytes(path, bytes, topic, clock, &options),
        None => read_poses(path, topic, clock, &options),
    };
    let place = fit.registration.head_place.clone();
    poses.map(Some).map_err(|error| Error::Named(Box::new((error, place))))
}

/// The frames of a recording that a fit asks for.
///
/// # Errors
/// Where the recording does not have the first or the last of them, or one that `[fit.outer]` names.
pub fn chosen_frames(fit: &FitSpec, recording: &Recording) -> Result<Vec<usize>> {
    let count = recording.frames.len();
    let beyond = |frame| Error::NoSuchFrame { frame, count, place: Box::new(fit.frames_place.clone()) };
    let chosen = fit.frames.within(count).map_err(beyond)?;
    fit.outer.as_ref().map_or(Ok(()), |outer| outer::exist(outer, recording))?;
    Ok(chosen)
}
