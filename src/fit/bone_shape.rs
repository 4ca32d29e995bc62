//! Where the markers on bone sit on the head, told by all frames: one that the neutral frame has lost counts in the others all the
//! same.
//!
//! With T_f the motion that takes the shape s to frame f,
//!   s_k = mean over the frames that show marker k of T_f^-1(z_fk),   T_f = least squares of s to z_f,
//! in turn until the shape rests (generalised Procrustes analysis, Gower 1975, of what is shown). It begins with the neutral
//! frame that shows the most, and stays where the neutral frames have it.

use crate::math::motion::{Allowed, Motion, Pair, least_squares, robust};
use crate::math::tensor::{Vector, add_scaled, norm, subtract};

/// The most rounds.
const ROUNDS: usize = 100;
/// A shape that changes by less than this part of a distance that is off rests.
const RESTS: f64 = 1e-7;

/// The first of the neutral frames that show the most.
pub(super) fn fullest(frames: &[Vec<Option<Vector>>], neutral: &[usize]) -> usize {
    let shown = |frame: &&usize| frames[**frame].iter().flatten().count();
    neutral.iter().rev().max_by_key(shown).copied().unwrap_or(0)
}

/// The shape: per marker, `None` for one that no frame places. `frames` holds of every frame where each marker is; of those that the
/// first neutral frame shows, one that is farther off than the others allow, and than `least`, does not count in a frame.
pub(super) fn shape(frames: &[Vec<Option<Vector>>], neutral: &[usize], least: f64) -> Vec<Option<Vector>> {
    let mut shape = frames[fullest(frames, neutral)].clone();
    let mut counted: Vec<Vec<Option<Vector>>> = frames.to_vec();
    for frame in &mut counted {
        let known: Vec<usize> = (0..shape.len()).filter(|k| shape[*k].is_some() && frame[*k].is_some()).collect();
        let pairs: Vec<Pair> = known.iter().filter_map(|k| shape[*k].zip(frame[*k])).collect();
        if let Some(agreed) = robust(&pairs, Allowed::RIGID, least) {
            let off = known.iter().zip(&agreed.off).filter(|(_, off)| **off);
            off.for_each(|(k, _)| frame[*k] = None);
        }
    }
    let pairs = |shape: &[Option<Vector>], frame: &[Option<Vector>]| -> Vec<Pair> {
        shape.iter().zip(frame).filter_map(|(s, z)| s.zip(*z)).collect()
    };
    let fitted = |shape: &[Option<Vector>], frame: &[Option<Vector>]| -> Option<Motion> {
        least_squares(&pairs(shape, frame), Allowed::RIGID)
    };
    for _ in 0..ROUNDS {
        let back: Vec<Option<Motion>> =
            counted.iter().map(|frame| fitted(&shape, frame).map(|motion| motion.inverse())).collect();
        let mut change: f64 = 0.0;
        for k in 0..shape.len() {
            let places = counted.iter().zip(&back).filter_map(|(frame, back)| Some(back.as_ref()?.place(frame[k]?)));
            let places: Vec<Vector> = places.collect();
            if places.is_empty() {
                continue;
            }
            let mean = places.iter().fold([0.0; 3], |sum, x| add_scaled(sum, 1.0 / places.len() as f64, *x));
            change = change.max(shape[k].map_or(f64::INFINITY, |before| norm(subtract(mean, before))));
            shape[k] = Some(mean);
        }
        if change < RESTS * least {
            break;
        }
    }
    // the mean has moved a little from where the neutral frames have it
    let at_rest: Vec<Pair> = neutral.iter().flat_map(|frame| pairs(&shape, &counted[*frame])).collect();
    if let Some(motion) = least_squares(&at_rest, Allowed::RIGID) {
        shape.iter_mut().flatten().for_each(|x| *x = motion.place(*x));
    }
    shape
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::tensor::{normalised, rotation};

    const BONES: [Vector; 5] =
        [[0.0, -5.0, 0.0], [0.0, 25.0, 2.0], [-4.0, 10.0, 30.0], [-25.0, 12.0, 10.0], [-15.0, -8.0, 22.0]];

    fn moved(frame: usize) -> Vec<Option<Vector>> {
        let t = frame as f64;
        let turn = rotation(normalised([0.3, -0.8, 0.5 + 0.1 * t]), 0.05 * t);
        let motion = Motion { scale: 1.0, turn, shift: [2.0 * t, -t, 0.5 * t] };
        BONES.iter().map(|x| Some(motion.place(*x))).collect()
    }

    #[test]
    fn what_the_neutral_frame_has_lost_is_found_in_others() {
        let mut frames: Vec<Vec<Option<Vector>>> = (0..6).map(moved).collect();
        (frames[0][1], frames[0][4]) = (None, None);
        // other frames have lost others
        (frames[2][0], frames[3][2], frames[4][3], frames[5][4]) = (None, None, None, None);
        for (found, truth) in shape(&frames, &[0], 0.4).iter().zip(BONES) {
            let apart = norm(subtract(found.unwrap(), truth));
            assert!(apart < 1e-6, "{found:?} instead of {truth:?}");
        }
    }

    #[test]
    fn a_marker_that_slips_stays_where_the_neutral_frame_has_it() {
        let mut frames: Vec<Vec<Option<Vector>>> = (0..6).map(moved).collect();
        for frame in &mut frames[2..] {
            frame[4] = frame[4].map(|[x, y, z]| [x + 2.0, y, z - 1.0]);
        }
        for (found, truth) in shape(&frames, &[0], 0.4).iter().zip(BONES) {
            assert!(norm(subtract(found.unwrap(), truth)) < 1e-9, "{found:?} instead of {truth:?}");
        }
    }
}
