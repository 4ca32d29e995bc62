//! The frames in which the face is at rest, and where its markers are then.
//!
//! The noise of the neutral frames is the same error in every frame of a clip: in the motion that registers it, in where the head
//! belongs, in the offsets of markers. Smoothing does not take it away; the mean of n frames has 1 / sqrt(n) of it.

use super::diagnosis::NEUTRAL;
use crate::error::{Cause, Error, Misregistration, Result, Warning};
use crate::fit::bone_shape::{fullest, shape};
use crate::fit::head::SLIPPED;
use crate::fit::placement::Marker;
use crate::markers::Recording;
use crate::math::motion::{Allowed, Motion, Pair, least_squares, rms, spread};
use crate::math::tensor::{Vector, add_scaled};
use crate::scene::{FitSpec, HeadSpec};

/// A face whose markers scatter by more than so many standard deviations of their noise is not still.
const STILL: f64 = 3.0;

/// The frames that the problem calls neutral, or the first of those that show the most markers.
///
/// # Errors
/// K004 where one of them does not exist.
pub fn neutral_frames(fit: &FitSpec, markers: &[Marker], recording: &Recording) -> Result<Vec<usize>> {
    let count = recording.frames.len();
    let Some(frames) = fit.registration.neutral else {
        let shown =
            |k: &usize| markers.iter().filter(|m| recording.frames[*k].positions_mm[m.column].is_some()).count();
        return Ok(vec![(0..count).rev().max_by_key(shown).unwrap_or(0)]);
    };
    frames.within(count).map_err(|frame| {
        let (cause, place) = (Cause::NoSuchFrame { count }, fit.registration.neutral_place.clone());
        Error::Misregistered(Box::new(Misregistration { cause, frames: vec![frame], rms_mm: 0.0, place }))
    })
}

/// Where every label of a recording is at rest: its mean over the neutral `frames` that show it, `None` where none does. A head
/// that is to be estimated has not been taken out: there the frames are brought together first.
pub fn at_rest(fit: &FitSpec, recording: &Recording, frames: &[usize]) -> Vec<Option<Vector>> {
    let shown = |frame: &usize| Some(recording.frames.get(*frame)?.positions_mm.clone());
    let shown: Vec<Vec<Option<Vector>>> = frames.iter().filter_map(shown).collect();
    if fit.registration.head == HeadSpec::Estimate && shown.len() > 1 {
        let all: Vec<usize> = (0..shown.len()).collect();
        let known: Vec<Vector> = shown[fullest(&shown, &all)].iter().flatten().copied().collect();
        return shape(&shown, &all, SLIPPED * spread(&known));
    }
    let mean = |label: usize| {
        let places: Vec<Vector> = shown.iter().filter_map(|positions| positions[label]).collect();
        let sum = places.iter().copied().reduce(|sum, x| add_scaled(sum, 1.0, x))?;
        Some(sum.map(|x| x / places.len() as f64))
    };
    (0..recording.labels.len()).map(mean).collect()
}

/// How far the markers of a frame are from where they are at `rest`, mm, those of both; a head that is to be estimated has been
/// brought back. The recording is on the model.
pub(in crate::fit) fn from_rest(
    fit: &FitSpec,
    markers: &[Marker],
    (recording, frame): (&Recording, usize),
    rest: &[Option<Vector>],
) -> Vec<f64> {
    let positions = &recording.frames[frame].positions_mm;
    let pairs: Vec<Pair> = markers.iter().filter_map(|m| positions[m.column].zip(rest[m.column])).collect();
    let motion = match fit.registration.head {
        HeadSpec::Estimate => least_squares(&pairs, Allowed::RIGID).unwrap_or(Motion::REST),
        _ => Motion::REST,
    };
    motion.distances(&pairs)
}

/// K019: the face moves over the neutral `frames`, whose mean is `rest`. The recording is on the model.
pub(super) fn not_still(
    fit: &FitSpec,
    markers: &[Marker],
    recording: &Recording,
    (frames, rest): (&[usize], &[Option<Vector>]),
) -> Option<Warning> {
    let [first, .., last] = *frames else { return None };
    let distances = |frame: usize| from_rest(fit, markers, (recording, frame), rest);
    let all: Vec<(usize, Vec<f64>)> = frames.iter().map(|frame| (*frame, distances(*frame))).collect();
    // of a coordinate; the mean has taken one frame's worth of it
    let freedom = (3 * (frames.len() - 1)) as f64 / frames.len() as f64;
    let scatter = rms(&all.iter().flat_map(|(_, distances)| distances).copied().collect::<Vec<_>>()) / freedom.sqrt();
    let noise: Option<Vec<f64>> = markers.iter().map(|m| m.sd).collect();
    let allowed = match noise {
        Some(noise) => STILL * rms(&noise),
        None => NEUTRAL * spread(&markers.iter().filter_map(|m| rest[m.column]).collect::<Vec<_>>()),
    };
    if scatter <= allowed {
        return None;
    }
    let (worst, off) =
        all.iter().map(|(frame, distances)| (*frame, rms(distances))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Warning {
        code: "K019",
        message: format!(
            "the face is not still over frames {first} to {last}, which are called neutral: its coordinates scatter by {scatter:.2} mm \
             about their mean (rms), more than {allowed:.2} mm; frame {worst} is farthest off, with an rms of {off:.2} mm"
        ),
        place: Some(fit.registration.neutral_place.clone()),
        help: Some("name frames in which the face rests: neutral = { first = .., last = .. } in [fit]".into()),
    })
}
