//! Why a recording does not lie on its model: each classic mistake leaves its own trace.
//!
//! | mistake | trace |
//! |---|---|
//! | left-handed axes | a reflection fits, no turn does |
//! | left and right labels exchanged | a turn fits once every marker is called like its counterpart |
//! | some labels exchanged | those markers alone are off, and each lies where another of them should |
//! | the neutral frame is not neutral | another frame fits |
//! | the recording stands elsewhere | a turn and a shift fit, and none was asked for |
//!
//! (Wrong units are told by the size alone, before: [`crate::fit::placement`].)

use super::{LARGE, Neutral, OFF, mirror};
use crate::error::{Cause, Result, Warning, neutral_named};
use crate::math::motion::{Agreed, Allowed, Motion, Pair, least_squares, robust};
use crate::math::tensor::{norm, subtract};
use crate::scene::{AxisSpec, RegisterSpec};

/// Part of what remained that may remain where a mistake explains it.
const EXPLAINS: f64 = 0.35;
/// Part of the spread below which a frame counts as neutral whatever the others are.
pub(super) const NEUTRAL: f64 = 0.02;
/// Markers that a message names.
const NAMED: usize = 5;

/// The mistake, if there is one; what is merely odd as a warning. `placed` are the neutral frames under the motion that was
/// asked for, and `allowed` what that may be.
pub(super) fn diagnose(neutral: &Neutral<'_>, placed: &Agreed, allowed: Allowed) -> Result<Option<Warning>> {
    let (pairs, size) = (&neutral.pairs, neutral.size);
    let all_mm = placed.motion.rms(pairs);
    let fits = all_mm <= LARGE * size && placed.off.iter().all(|off| !off);
    let asked = neutral.fit.registration.register != RegisterSpec::None;
    if !fits && pairs.len() > 3 {
        reflected(neutral, allowed)?;
        exchanged(neutral, placed)?;
        if !asked {
            elsewhere(neutral, all_mm)?;
        }
    }
    if asked {
        not_neutral(neutral, placed, allowed)?;
    }
    let odd = !fits && (asked || !another_frame_stands_well(neutral));
    Ok(odd.then(|| unexplained(neutral, placed, all_mm)))
}

/// Left-handed axes, or the labels of two sides exchanged; nearly symmetric markers leave both open.
fn reflected(neutral: &Neutral<'_>, allowed: Allowed) -> Result<()> {
    let (pairs, size) = (&neutral.pairs, neutral.size);
    let rms = |pairs: &[Pair], allowed| least_squares(pairs, allowed).map_or(f64::INFINITY, |m| m.rms(pairs));
    let turned = rms(pairs, allowed);
    if turned <= LARGE * size {
        return Ok(());
    }
    let mirrored = rms(pairs, allowed.mirrored());
    let model: Vec<[f64; 3]> = pairs.iter().map(|p| p.1).collect();
    let exchanged = mirror::pairings(&model).into_iter().map(|pairing| {
        let pairs: Vec<Pair> = pairs.iter().zip(&pairing).map(|((z, _), k)| (*z, model[*k])).collect();
        (rms(&pairs, allowed), pairing)
    });
    let (sides, pairing) = exchanged.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, Vec::new()));
    if mirrored.min(sides) > EXPLAINS * turned {
        return Ok(());
    }
    let names = || -> Vec<[String; 2]> {
        let crossing = pairing.iter().enumerate().filter(|(k, other)| k < *other);
        crossing.map(|(k, other)| [neutral.name(k), neutral.name(*other)]).collect()
    };
    let spec = &neutral.fit.registration;
    if sides < 0.5 * mirrored {
        let cause = Cause::SidesExchanged { remains_mm: sides, pairs: names() };
        let first = pairing.iter().enumerate().find(|(k, other)| k != *other).map_or(0, |(k, _)| k);
        return Err(neutral.wrong(cause, turned, place_of(neutral, first)));
    }
    let both = mirrored >= 0.5 * sides;
    let cause = Cause::LeftHanded {
        remains_mm: mirrored,
        sides_mm: both.then_some(sides),
        pairs: if both { names() } else { Vec::new() },
        axes: turned_round(spec.axes),
    };
    Err(neutral.wrong(cause, turned, neutral.fit.markers_place.clone()))
}

/// `["-x", "y", "z"]`: the first axis turned round.
fn turned_round(axes: [AxisSpec; 3]) -> String {
    let words = [axes[0].reversed(), axes[1], axes[2]].map(|axis| format!("\"{}\"", axis.word()));
    format!("[{}]", words.join(", "))
}

/// Markers that are off, each near to where another of them should be.
fn exchanged(neutral: &Neutral<'_>, placed: &Agreed) -> Result<()> {
    let (pairs, size) = (&neutral.pairs, neutral.size);
    let off: Vec<usize> = (0..pairs.len()).filter(|k| placed.off[*k]).collect();
    let here = |k: usize| placed.motion.place(pairs[k].0);
    let should: Vec<[f64; 3]> = off.iter().map(|k| pairs[*k].1).collect();
    let on_another = |k: &usize| {
        let other = off[mirror::nearest(&should, here(*k))];
        let near = norm(subtract(here(*k), pairs[other].1)) < OFF * size;
        (other != *k && near).then_some((*k, other))
    };
    let moved: Vec<(usize, usize)> = off.iter().filter_map(on_another).collect();
    let mut targets: Vec<usize> = moved.iter().map(|(_, other)| *other).collect();
    let mut sources: Vec<usize> = moved.iter().map(|(k, _)| *k).collect();
    targets.sort_unstable();
    sources.sort_unstable();
    // each label of the group on another one of the group
    if moved.is_empty() || targets != sources {
        return Ok(());
    }
    let mut corrected = pairs.clone();
    for (k, other) in &moved {
        corrected[*k].1 = pairs[*other].1;
    }
    let off_mm = moved.iter().map(|(k, _)| placed.distances[*k]).fold(0.0, f64::max);
    let labels = moved.iter().map(|(k, other)| [neutral.name(*k), neutral.name(*other)]).collect();
    let cause = Cause::LabelsExchanged { remains_mm: placed.motion.rms(&corrected), labels, off_mm };
    Err(neutral.wrong(cause, placed.motion.rms(pairs), place_of(neutral, moved[0].0)))
}

/// A recording that a rigid motion brings to the model, though none was asked for.
fn elsewhere(neutral: &Neutral<'_>, as_is_mm: f64) -> Result<()> {
    let Some(agreed) = robust(&neutral.pairs, Allowed::RIGID, OFF * neutral.size) else { return Ok(()) };
    let explains = agreed.rms <= (EXPLAINS * as_is_mm).min(2.0 * LARGE * neutral.size);
    if !explains || as_is_mm <= 2.0 * LARGE * neutral.size || another_frame_stands_well(neutral) {
        return Ok(());
    }
    let cause = Cause::NotInPlace {
        remains_mm: agreed.rms,
        turned_deg: agreed.motion.angle().to_degrees(),
        moved_mm: super::moved(&agreed.motion, &neutral.pairs),
    };
    Err(neutral.wrong(cause, as_is_mm, neutral.fit.registration.register_place.clone()))
}

/// Whether some frame lies on the model at rest as it stands: then it is this frame that is not at rest.
fn another_frame_stands_well(neutral: &Neutral<'_>) -> bool {
    best_frame(neutral, |pairs| Some(Motion::REST.rms(pairs))).is_some_and(|(_, rms)| rms <= LARGE * neutral.size)
}

/// A neutral frame that moves against the model while another one does not.
fn not_neutral(neutral: &Neutral<'_>, placed: &Agreed, allowed: Allowed) -> Result<()> {
    let own = least_squares(&neutral.pairs, allowed).map_or(f64::INFINITY, |m| m.rms(&neutral.pairs));
    if own <= NEUTRAL * neutral.size {
        return Ok(());
    }
    let fitted = |pairs: &[Pair]| least_squares(pairs, allowed).map(|motion| motion.rms(pairs));
    match best_frame(neutral, fitted) {
        Some((better, remains_mm)) if remains_mm <= 0.5 * own => {
            let cause = Cause::NotNeutral { off: farthest(neutral, placed), better, remains_mm };
            Err(neutral.wrong(cause, own, neutral.fit.registration.neutral_place.clone()))
        }
        _ => Ok(()),
    }
}

/// The frame with the least root mean square distance, among those that show nearly as many markers.
fn best_frame(neutral: &Neutral<'_>, rms: impl Fn(&[Pair]) -> Option<f64>) -> Option<(usize, f64)> {
    let enough = 4 * neutral.pairs.len() / 5;
    let frames = (0..neutral.recording.frames.len()).filter_map(|frame| {
        let pairs = neutral.pairs_of(frame);
        let rms = (pairs.len() >= enough.max(3)).then(|| rms(&pairs)).flatten()?;
        Some((frame, rms))
    });
    frames.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The markers that are farthest off, the worst first.
fn farthest(neutral: &Neutral<'_>, placed: &Agreed) -> Vec<(String, f64)> {
    let mut order: Vec<usize> = (0..neutral.pairs.len()).collect();
    order.sort_by(|a, b| placed.distances[*b].total_cmp(&placed.distances[*a]));
    order.truncate(NAMED);
    let worst = order.first().map_or(0.0, |k| placed.distances[*k]);
    order.retain(|k| placed.distances[*k] > 0.2 * worst);
    order.into_iter().map(|k| (neutral.name(k), placed.distances[k])).collect()
}

fn unexplained(neutral: &Neutral<'_>, placed: &Agreed, all_mm: f64) -> Warning {
    let worst: Vec<String> =
        farthest(neutral, placed).into_iter().map(|(name, mm)| format!("`{name}` {mm:.2} mm")).collect();
    Warning {
        code: "K013",
        message: format!(
            "{} of the recording does not lie on the model at rest: rms {all_mm:.2} mm, farthest off {}; no exchange of \
             labels or axes explains it",
            neutral_named(neutral.frames, ""),
            worst.join(", ")
        ),
        place: Some(neutral.fit.markers_place.clone()),
        help: Some(
            "the markers sit elsewhere than position_mm says, or the face is another one: what the model cannot reach stays in \
             the residuals"
                .into(),
        ),
    }
}

/// The `[[marker]]` of a marker that the neutral frame shows.
fn place_of(neutral: &Neutral<'_>, shown: usize) -> crate::Place {
    let name = &neutral.markers[neutral.shown[shown]].name;
    let spec = neutral.scene.markers.iter().find(|spec| spec.name == *name);
    spec.map_or_else(|| neutral.fit.markers_place.clone(), |spec| spec.place.clone())
}
