//! Where a recording stands, before any solve: one motion of its neutral frames to the markers of the model at rest.
//!
//! The motion is rigid, or a similarity where the recording has no true size, and most markers decide it: a few that are off
//! do not turn it ([`crate::math::motion::robust`]). What keeps the two apart is named (`diagnosis`), and nothing is
//! mended that was not asked for.

mod diagnosis;
mod matching;
mod mirror;
mod neutral;
mod scale;

pub use matching::{Proposal, propose};
pub use mirror::{nearest, pairings};
pub(in crate::fit) use neutral::from_rest;
pub use neutral::{at_rest, neutral_frames};
pub use scale::{Scale, scale};

use super::head::{self, HeadMotion};
use super::head_error;
use super::placement::{Marker, units_against};
use crate::error::{Cause, Error, Misregistration, Result, Warning, neutral_named};
use crate::markers::{Poses, Recording};
use crate::math::motion::{Agreed, Allowed, Motion, Pair, least_squares, rms, robust, spread};
use crate::math::tensor::{norm, subtract};
use crate::mesh::Mesh;
use crate::scene::{AxisSpec, FitSpec, RegisterSpec, Scene};

/// A marker that is farther off than this part of the markers' spread is off.
pub(super) const OFF: f64 = 0.1;
/// A root mean square distance beyond this part of the spread needs a reason.
pub(super) const LARGE: f64 = 0.05;

/// How a recording was brought to its model.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// What was asked for.
    pub register: RegisterSpec,
    /// From the recording (in mm, or in its own unit where that is estimated) to the model.
    pub motion: Motion,
    /// How far the motion takes the centre of the markers, mm.
    pub moved_mm: f64,
    /// The neutral frames.
    pub neutral: Vec<usize>,
    /// How much larger the recording would have to be to be of the model's size; `None` where the markers do not say.
    pub scale: Option<Scale>,
    /// The markers that the neutral frames show.
    pub markers: Vec<Registered>,
    /// Root mean square distance of those that are not off, mm.
    pub rms_mm: f64,
    /// Root mean square of the offsets of markers from their places that were taken out of every frame, mm; `None` where none
    /// were asked for.
    pub offset_rms_mm: Option<f64>,
    /// How the head moved, where that was taken out.
    pub head: Option<HeadMotion>,
    /// Centre of the markers in the neutral frames on the model, mm.
    pub centre: [f64; 3],
}

/// A marker of the neutral frames on the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Registered {
    /// Its name.
    pub name: String,
    /// How far it is from its place on the model at rest, mm.
    pub distance_mm: f64,
    /// Whether that is more than the others allow: it did not count.
    pub off: bool,
}

/// What the neutral frames show of the markers that are fitted.
struct Neutral<'a> {
    scene: &'a Scene,
    fit: &'a FitSpec,
    markers: &'a [Marker],
    /// Positions of all markers on the model at rest, mm.
    model: Vec<[f64; 3]>,
    recording: &'a Recording,
    frames: &'a [usize],
    /// Markers that they show.
    shown: Vec<usize>,
    /// (recording, model) of each of them.
    pairs: Vec<Pair>,
    /// Root mean square distance of the model's markers from their centre, mm.
    size: f64,
}

impl Neutral<'_> {
    fn wrong(&self, cause: Cause, rms_mm: f64, place: crate::Place) -> Error {
        Error::Misregistered(Box::new(Misregistration { cause, frames: self.frames.to_vec(), rms_mm, place }))
    }

    fn name(&self, shown: usize) -> String {
        self.markers[self.shown[shown]].name.clone()
    }

    /// (recording, model) of the markers that a frame shows.
    fn pairs_of(&self, frame: usize) -> Vec<Pair> {
        let positions = &self.recording.frames[frame].positions_mm;
        let pair = |(m, x): (&Marker, &[f64; 3])| positions[m.column].map(|z| (z, *x));
        self.markers.iter().zip(&self.model).filter_map(pair).collect()
    }
}

/// Brings a recording to the model as `[fit]` asks: its axes, then the head of every frame to where it is in the neutral ones,
/// then the motion that registers that. `poses` are those of the head, where they come from a topic.
///
/// # Errors
/// K001, K002 and K007 to K012: what keeps the recording from lying on the model, with the edit that mends it.
pub fn register(
    scene: &Scene,
    fit: &FitSpec,
    mesh: &Mesh,
    markers: &[Marker],
    recording: &mut Recording,
    poses: Option<&Poses>,
) -> Result<(Registration, Vec<Warning>)> {
    turn_axes(recording, fit.registration.axes);
    let frames = neutral_frames(fit, markers, recording)?;
    let (head, mut warnings) = head::still(fit, recording, &frames, poses)?.unzip();
    let warnings = warnings.get_or_insert_default();
    let mut rest = at_rest(fit, recording, &frames);
    let (mut registration, odd) = registration(scene, fit, mesh, markers, (recording, &frames, &rest))?;
    warnings.extend(odd);
    registration.head = head.map(|head| head.carried(&registration.motion));
    if registration.motion != Motion::REST {
        for position in recording.frames.iter_mut().flat_map(|frame| frame.positions_mm.iter_mut().flatten()) {
            *position = registration.motion.place(*position);
        }
        rest.iter_mut().flatten().for_each(|x| *x = registration.motion.place(*x));
        if let Some(bones) = &mut recording.bones {
            bones.neutral_mm.iter_mut().flatten().for_each(|x| *x = registration.motion.place(*x));
            bones.variance_mm2 *= registration.motion.scale * registration.motion.scale;
        }
    }
    warnings.extend(neutral::not_still(fit, markers, recording, (&frames, &rest)));
    warnings.extend(head_error::open(fit, recording, &rest, markers));
    if fit.registration.offset_sd_mm.is_some() {
        registration.offset_rms_mm = Some(take_offsets(mesh, markers, recording, &rest));
    }
    Ok((registration, std::mem::take(warnings)))
}

/// Brings markers that sit beside their places on the model there, in every frame, as far as where they are `at_rest` tells how far off
/// they are. The root mean square of these offsets, mm.
fn take_offsets(mesh: &Mesh, markers: &[Marker], recording: &mut Recording, at_rest: &[Option<[f64; 3]>]) -> f64 {
    let mut lengths = Vec::with_capacity(markers.len());
    for marker in markers {
        let Some(seen) = at_rest[marker.column] else { continue };
        let offset = subtract(seen, mesh.position(marker.point)).map(|d| marker.offset_part * d);
        lengths.push(norm(offset));
        for position in recording.frames.iter_mut().filter_map(|frame| frame.positions_mm[marker.column].as_mut()) {
            *position = subtract(*position, offset);
        }
    }
    rms(&lengths)
}

/// Takes the axes of a recording as they are called.
fn turn_axes(recording: &mut Recording, axes: [AxisSpec; 3]) {
    for position in recording.frames.iter_mut().flat_map(|frame| frame.positions_mm.iter_mut().flatten()) {
        *position = axes.map(|axis| axis.sign() * position[axis.index()]);
    }
}

fn registration(
    scene: &Scene,
    fit: &FitSpec,
    mesh: &Mesh,
    markers: &[Marker],
    (recording, frames, positions): (&Recording, &[usize], &[Option<[f64; 3]>]),
) -> Result<(Registration, Option<Warning>)> {
    let spec = &fit.registration;
    let model: Vec<[f64; 3]> = markers.iter().map(|m| mesh.position(m.point)).collect();
    let shown: Vec<usize> = (0..markers.len()).filter(|k| positions[markers[*k].column].is_some()).collect();
    let pairs: Vec<Pair> =
        shown.iter().filter_map(|k| positions[markers[*k].column].map(|z| (z, model[*k]))).collect();
    let size = spread(&pairs.iter().map(|p| p.1).collect::<Vec<_>>());
    let neutral = Neutral { scene, fit, markers, model, recording, frames, shown, pairs, size };
    if let Some(units) = fit.units {
        units_against(&neutral.pairs, units, fit)?;
    }

    let allowed = if spec.register == RegisterSpec::Similarity { Allowed::SIMILARITY } else { Allowed::RIGID };
    let mut placed = match spec.register {
        RegisterSpec::None => in_place(&neutral),
        RegisterSpec::Rigid | RegisterSpec::Similarity => {
            robust(&neutral.pairs, allowed, OFF * size).ok_or_else(|| {
                let cause = Cause::TooFew { markers: neutral.pairs.len() };
                neutral.wrong(cause, 0.0, spec.register_place.clone())
            })?
        }
    };
    let agreeing: Vec<Pair> =
        neutral.pairs.iter().zip(&placed.off).filter(|(_, off)| !**off).map(|(p, _)| *p).collect();
    if spec.register == RegisterSpec::Similarity {
        // the noise is in the recording: least squares towards it, or the scale would come out too small
        let back: Vec<Pair> = agreeing.iter().map(|(z, x)| (*x, *z)).collect();
        if let Some(motion) = least_squares(&back, allowed).map(|motion| motion.inverse()) {
            placed =
                Agreed { motion, distances: motion.distances(&neutral.pairs), rms: motion.rms(&agreeing), ..placed };
        }
    }
    let warning = diagnosis::diagnose(&neutral, &placed, allowed)?;
    let markers = (0..neutral.pairs.len())
        .map(|k| Registered { name: neutral.name(k), distance_mm: placed.distances[k], off: placed.off[k] })
        .collect();
    let registration = Registration {
        register: spec.register,
        motion: placed.motion,
        moved_mm: moved(&placed.motion, &neutral.pairs),
        neutral: frames.to_vec(),
        scale: scale(&agreeing),
        markers,
        rms_mm: placed.rms,
        offset_rms_mm: None,
        head: None,
        centre: head::middle(&neutral.pairs.iter().map(|p| Some(placed.motion.place(p.0))).collect::<Vec<_>>()),
    };
    Ok((registration, warning))
}

/// The neutral frames as they stand.
fn in_place(neutral: &Neutral<'_>) -> Agreed {
    let distances = Motion::REST.distances(&neutral.pairs);
    let off: Vec<bool> = distances.iter().map(|d| *d > OFF * neutral.size).collect();
    let rest: Vec<f64> = distances.iter().zip(&off).filter(|(_, off)| !**off).map(|(d, _)| *d).collect();
    Agreed { motion: Motion::REST, rms: rms(&rest), distances, off }
}

/// How far a motion takes the centre of the recording's markers, the scale aside, mm.
fn moved(motion: &Motion, pairs: &[Pair]) -> f64 {
    if pairs.is_empty() {
        return 0.0;
    }
    let centre = crate::math::motion::centre(pairs.iter().map(|p| p.0));
    norm(subtract(motion.place(centre), centre.map(|c| motion.scale * c)))
}

impl std::fmt::Display for Registration {
    /// A paragraph of a page.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Registration { register, motion, moved_mm, neutral, scale, markers, rms_mm, offset_rms_mm, head, centre } =
            self;
        if let Some(head) = head {
            out.write_str(&head.describe(*centre))?;
        }
        match register {
            RegisterSpec::None => write!(out, "registration: none, the recording stands where it is")?,
            RegisterSpec::Rigid | RegisterSpec::Similarity => {
                let by = format!("turned by {:.2} degrees, moved by {moved_mm:.2} mm", motion.angle().to_degrees());
                write!(out, "registration: {}, {by}", register.word())?;
            }
        }
        if *register == RegisterSpec::Similarity {
            write!(out, ", scaled by {:.5}", motion.scale)?;
        }
        let off: Vec<&str> = markers.iter().filter(|m| m.off).map(|m| m.name.as_str()).collect();
        let counted = markers.len() - off.len();
        writeln!(
            out,
            "\n  {} fits the model at rest with an rms of {rms_mm:.3} mm over {counted} markers",
            neutral_named(neutral, "its ")
        )?;
        if !off.is_empty() {
            writeln!(out, "  {} did not count, being farther off: {}", off.len(), off.join(", "))?;
        }
        if let Some(offset) = offset_rms_mm {
            writeln!(
                out,
                "  of that {offset:.3} mm (rms) are taken for offsets of markers from the skin, in every frame"
            )?;
        }
        match scale {
            Some(Scale { value, interval: [lower, upper] }) => {
                writeln!(out, "  the scale that fits best is {value:.5} (95 %: {lower:.5} to {upper:.5})")
            }
            None => Ok(()),
        }
    }
}
