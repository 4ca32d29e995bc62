//! The motion of the head, taken out of a recording before it is fitted.
//!
//! With h_f the motion that takes the head from where it is in the neutral frames (in their mean, if they are several) to frame f, every position z of frame f becomes h_f^-1(z):
//! where it would be if the head had stayed. h_f comes from markers that sit on bone (one robust rigid fit per frame), or from
//! a topic of poses P: h_f = P_f P_neutral^-1. The noise of the mean of n frames is 1 / sqrt(n) of that of one.

use super::bone_shape::{fullest, shape};
use super::placement::unknown_label;
use crate::error::{Cause, Error, Misregistration, Result, Warning};
use crate::markers::{BoneNoise, Poses, Recording};
use crate::math::motion::{Allowed, Motion, Pair, centre, rms, robust, spread};
use crate::math::tensor::{norm, subtract};
use crate::scene::{AxisSpec, FitSpec, HeadSpec};

/// A bone marker farther off than this part of their spread, and than the others allow, has slipped.
pub(super) const SLIPPED: f64 = 0.02;
/// One that is off in more than this part of the frames is named.
const OFTEN: f64 = 0.05;

/// How the head moved.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadMotion {
    /// Where that is known from.
    pub source: HeadSpec,
    /// One per frame of the recording.
    pub frames: Vec<HeadFrame>,
    /// Bone markers that were off in some frames, with how many and how far, mm.
    pub slipped: Vec<Slip>,
}

/// The head in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadFrame {
    /// From the neutral frames to this one, in the coordinates of the model once the recording is registered. `None` where it is
    /// not known: the positions of such a frame count as lost.
    pub motion: Option<Motion>,
    /// Root mean square distance of the bone markers from where a rigid head would carry them, mm; those that are off are left
    /// out. `None` with a topic of poses.
    pub rms_mm: Option<f64>,
    /// Bone markers that count.
    pub markers: usize,
}

/// A bone marker that moves against the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Slip {
    /// Its label.
    pub label: String,
    /// Frames in which it is off.
    pub frames: usize,
    /// Frames that show it.
    pub shown: usize,
    /// The first frame in which it is off.
    pub first: usize,
    /// How far it gets, mm.
    pub most_mm: f64,
}

/// Takes the motion of the head out of a recording whose axes are those of the model; `neutral` are the frames that say
/// where it belongs. `None` where nothing was asked for.
///
/// # Errors
/// K002: a bone marker that the recording does not have; K012: no neutral frame shows where the head is.
pub fn still(
    fit: &FitSpec,
    recording: &mut Recording,
    neutral: &[usize],
    poses: Option<&Poses>,
) -> Result<Option<(HeadMotion, Vec<Warning>)>> {
    let spec = &fit.registration;
    let (frames, slipped) = match &spec.head {
        HeadSpec::None | HeadSpec::Estimate => return Ok(None),
        HeadSpec::BoneMarkers(labels) => {
            let (frames, slipped, noise) = from_markers(fit, labels, recording, neutral)?;
            recording.bones = noise;
            (frames, slipped)
        }
        HeadSpec::PoseTopic(_) => (from_poses(fit, recording, neutral, poses)?, Vec::new()),
    };
    for (shown, head) in recording.frames.iter_mut().zip(&frames) {
        match head.motion.map(|motion| motion.inverse()) {
            Some(back) => shown.positions_mm.iter_mut().flatten().for_each(|z| *z = back.place(*z)),
            None => shown.positions_mm.fill(None),
        }
    }
    let warnings = warnings(fit, recording, &frames, &slipped);
    Ok(Some((HeadMotion { source: spec.head.clone(), frames, slipped }, warnings)))
}

fn unknown(fit: &FitSpec, neutral: &[usize], markers: usize) -> Error {
    Error::Misregistered(Box::new(Misregistration {
        cause: Cause::TooFew { markers },
        frames: neutral.to_vec(),
        rms_mm: 0.0,
        place: fit.registration.head_place.clone(),
    }))
}

fn from_markers(
    fit: &FitSpec,
    labels: &[String],
    recording: &Recording,
    neutral: &[usize],
) -> Result<(Vec<HeadFrame>, Vec<Slip>, Option<BoneNoise>)> {
    let column = |label: &String| {
        let found = recording.labels.iter().position(|known| known == label);
        found.ok_or_else(|| unknown_label(label, &recording.labels, &fit.registration.head_place))
    };
    let (columns, mistakes): (Vec<_>, Vec<_>) = labels.iter().map(column).partition(Result::is_ok);
    if !mistakes.is_empty() {
        return Err(Error::all(mistakes.into_iter().filter_map(Result::err).collect()));
    }
    let columns: Vec<usize> = columns.into_iter().flatten().collect();
    let bones: Vec<Vec<Option<[f64; 3]>>> =
        recording.frames.iter().map(|frame| columns.iter().map(|c| frame.positions_mm[*c]).collect()).collect();
    let known: Vec<[f64; 3]> = bones[fullest(&bones, neutral)].iter().flatten().copied().collect();
    if known.len() < 3 {
        return Err(unknown(fit, neutral, known.len()));
    }
    let least = SLIPPED * spread(&known);
    let rest = shape(&bones, neutral, least);
    let mut slips: Vec<Slip> = labels
        .iter()
        .map(|label| Slip { label: label.clone(), frames: 0, shown: 0, first: 0, most_mm: 0.0 })
        .collect();
    let mut frames = Vec::with_capacity(recording.frames.len());
    // those that count in each frame, and what is left of them
    let (mut counted, mut square, mut freedom) = (Vec::with_capacity(recording.frames.len()), 0.0, 0);
    for (index, frame) in bones.iter().enumerate() {
        let shown: Vec<usize> = (0..columns.len()).filter(|k| rest[*k].is_some() && frame[*k].is_some()).collect();
        let pair = |k: &usize| rest[*k].zip(frame[*k]);
        let pairs: Vec<Pair> = shown.iter().filter_map(pair).collect();
        let Some(agreed) = robust(&pairs, Allowed::RIGID, least) else {
            frames.push(HeadFrame { motion: None, rms_mm: None, markers: pairs.len() });
            counted.push(Vec::new());
            continue;
        };
        for ((k, off), distance) in shown.iter().zip(&agreed.off).zip(&agreed.distances) {
            let slip = &mut slips[*k];
            slip.shown += 1;
            if *off {
                slip.first = if slip.frames == 0 { index } else { slip.first };
                slip.frames += 1;
                slip.most_mm = slip.most_mm.max(*distance);
            }
        }
        let markers = agreed.off.iter().filter(|off| !**off).count();
        counted.push(shown.iter().zip(&agreed.off).filter(|(_, off)| !**off).map(|(k, _)| *k).collect());
        square += agreed.rms * agreed.rms * markers as f64;
        freedom += (3 * markers).saturating_sub(6);
        frames.push(HeadFrame { motion: Some(agreed.motion), rms_mm: Some(agreed.rms), markers });
    }
    let neutral_seen: Vec<usize> = neutral.iter().copied().filter(|frame| frames[*frame].motion.is_some()).collect();
    let at_rest: Vec<Motion> = neutral_seen.iter().filter_map(|frame| frames[*frame].motion).collect();
    let Some(back) = Motion::mean(&at_rest, middle(&rest)).map(|motion| motion.inverse()) else {
        return Err(unknown(fit, neutral, known.len()));
    };
    for frame in &mut frames {
        frame.motion = frame.motion.map(|motion| back.then(&motion));
    }
    slips.retain(|slip| slip.frames > 0);
    // the shape was found from the same places, but for where it is
    let freedom = freedom.saturating_sub((3 * rest.iter().flatten().count()).saturating_sub(6));
    let noise = (freedom > 0).then(|| BoneNoise {
        variance_mm2: square / freedom as f64,
        neutral_mm: rest,
        neutral: neutral_seen,
        shown: counted,
    });
    Ok((frames, slips, noise))
}

fn from_poses(
    fit: &FitSpec,
    recording: &Recording,
    neutral: &[usize],
    poses: Option<&Poses>,
) -> Result<Vec<HeadFrame>> {
    let axes = axes(fit.registration.axes);
    let at = |stamp_ns: i64| Some(axes.inverse().then(&poses?.at(stamp_ns)?).then(&axes));
    let at_rest: Vec<Motion> = neutral.iter().filter_map(|frame| at(recording.frames[*frame].stamp_ns)).collect();
    let back = Motion::mean(&at_rest, [0.0; 3]).ok_or_else(|| unknown(fit, neutral, 0))?.inverse();
    let frame = |stamp_ns| HeadFrame { motion: at(stamp_ns).map(|now| back.then(&now)), rms_mm: None, markers: 0 };
    Ok(recording.frames.iter().map(|shown| frame(shown.stamp_ns)).collect())
}

/// The axes of a recording as a motion, which may reflect.
fn axes(axes: [AxisSpec; 3]) -> Motion {
    let entry = |i: usize, j: usize| if axes[i].index() == j { axes[i].sign() } else { 0.0 };
    Motion { turn: std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))), ..Motion::REST }
}

fn warnings(fit: &FitSpec, recording: &Recording, frames: &[HeadFrame], slipped: &[Slip]) -> Vec<Warning> {
    let place = Some(fit.registration.head_place.clone());
    let mut warnings = Vec::new();
    for Slip { label, frames, shown, first, most_mm } in slipped {
        if *frames as f64 > OFTEN * *shown as f64 {
            warnings.push(Warning {
                code: "K014",
                message: format!(
                    "bone marker `{label}` moves against the others: it is off in {frames} of {shown} frames, first in frame \
                     {first}, by up to {most_mm:.2} mm, and does not count there"
                ),
                place: place.clone(),
                help: Some("it slips, or sits on skin: remove it from bone_markers".into()),
            });
        }
    }
    let lost: Vec<usize> = (0..frames.len()).filter(|k| frames[*k].motion.is_none()).collect();
    if let Some(first) = lost.first() {
        warnings.push(Warning {
            code: "K015",
            message: format!(
                "where the head is cannot be told in {} of {} frames, first in frame {first} at {:.3} s: their markers count as lost",
                lost.len(),
                frames.len(),
                recording.frames[*first].time_s
            ),
            place,
            help: Some(match fit.registration.head {
                HeadSpec::PoseTopic(_) => "leave them out by `frames`, or record poses all the time".into(),
                _ => "three bone markers must be seen: name more of them, or leave the frames out by `frames`".into(),
            }),
        });
    }
    warnings
}

impl HeadMotion {
    /// The same in the coordinates of the model, which `registration` takes the recording to.
    pub(super) fn carried(mut self, registration: &Motion) -> HeadMotion {
        let back = registration.inverse();
        for frame in &mut self.frames {
            frame.motion = frame.motion.map(|motion| back.then(&motion).then(registration));
            frame.rms_mm = frame.rms_mm.map(|rms| rms * registration.scale);
        }
        for slip in &mut self.slipped {
            slip.most_mm *= registration.scale;
        }
        self
    }

    /// Angle (degrees) and shift (mm, of the point `of` that stays with the head) of a frame.
    pub fn size(&self, frame: usize, of: [f64; 3]) -> Option<[f64; 2]> {
        let motion = self.frames.get(frame)?.motion?;
        Some([motion.angle().to_degrees(), norm(subtract(motion.place(of), of))])
    }

    /// A paragraph of a page; `of` is the point whose shift is told.
    pub fn describe(&self, of: [f64; 3]) -> String {
        let source = match &self.source {
            HeadSpec::None | HeadSpec::Estimate => return String::new(),
            HeadSpec::BoneMarkers(labels) => format!("from {} bone markers", labels.len()),
            HeadSpec::PoseTopic(topic) => format!("from the poses of `{topic}`"),
        };
        let most = |which: usize| {
            let sizes = (0..self.frames.len()).filter_map(|k| Some((k, self.size(k, of)?[which])));
            sizes.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
        };
        let ((turn_frame, turn), (shift_frame, shift)) = (most(0), most(1));
        let mut text = format!(
            "head: taken out {source}; it turns by up to {turn:.2} degrees (frame {turn_frame}) and moves by up to {shift:.2} mm \
             (frame {shift_frame})\n"
        );
        let known: Vec<(usize, f64)> =
            self.frames.iter().enumerate().filter_map(|(k, f)| Some((k, f.rms_mm?))).collect();
        if let Some((worst, most)) = known.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
            let mean = rms(&known.iter().map(|(_, rms)| *rms).collect::<Vec<_>>());
            text += &format!("  bone markers agree to an rms of {mean:.3} mm, {most:.3} mm in frame {worst}\n");
        }
        for Slip { label, frames, shown, most_mm, .. } in &self.slipped {
            text += &format!(
                "  `{label}` is off in {frames} of {shown} frames, by up to {most_mm:.2} mm, and does not count there\n"
            );
        }
        text
    }
}

/// The centre of the places that markers have.
pub fn middle(positions: &[Option<[f64; 3]>]) -> [f64; 3] {
    let shown: Vec<[f64; 3]> = positions.iter().flatten().copied().collect();
    if shown.is_empty() { [0.0; 3] } else { centre(shown.into_iter()) }
}
