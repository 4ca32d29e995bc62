//! A clip in chunks that are fitted side by side.
//!
//! A chunk knows nothing of the frames before it: its first frame starts from rest. So it begins where the face is nearest to
//! rest, and some frames early: on them it settles, by smoothness too, and at the last of them it is compared with what the chunk
//! before has found there from another start.

use super::Estimate;
use super::placement::Marker;
use super::registration::{at_rest, from_rest, neutral_frames};
use crate::error::Result;
use crate::markers::Recording;
use crate::math::motion::rms;
use crate::scene::{ChunksSpec, FitSpec};
use std::ops::Range;

/// Part of a chunk by which its ends may move to where the face is nearer to rest.
const LEEWAY: f64 = 0.25;

/// Frames in a row, as places in the list of the frames of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chunk {
    /// Where it begins.
    pub start: usize,
    /// The first frame that is its own; on those before it settles.
    pub first: usize,
    /// Behind its last.
    pub end: usize,
}

impl Chunk {
    /// All its frames, those of the chunk before too.
    pub fn all(&self) -> Range<usize> {
        self.start..self.end
    }

    /// Whether a frame belongs to the chunk before.
    pub fn settles(&self, at: usize) -> bool {
        at < self.first
    }

    /// The frame that is compared with the one of the chunk before.
    pub fn seam(&self) -> Option<usize> {
        self.first.checked_sub(1).filter(|at| *at >= self.start)
    }
}

/// The chunks that a fit asks for, of its `frames`; fewer where there are too few frames for them. The recording is on the model.
///
/// # Errors
/// As [`neutral_frames`].
pub fn chunks(fit: &FitSpec, markers: &[Marker], recording: &Recording, frames: &[usize]) -> Result<Vec<Chunk>> {
    let rest = at_rest(fit, recording, &neutral_frames(fit, markers, recording)?);
    let away: Vec<f64> = frames
        .iter()
        .map(|frame| match from_rest(fit, markers, (recording, *frame), &rest) {
            // nothing is seen of it
            none if none.is_empty() => f64::INFINITY,
            distances => rms(&distances),
        })
        .collect();
    Ok(cut(fit.chunks, &away))
}

/// Cuts frames that are so far away from rest.
fn cut(ChunksSpec { count, overlap }: ChunksSpec, away: &[f64]) -> Vec<Chunk> {
    let frames = away.len();
    // a chunk is at least twice as long as what is done twice for it
    let count = count.min(frames / (2 * overlap)).max(1);
    let length = frames as f64 / count as f64;
    let leeway = (LEEWAY * length) as usize;
    let nearest = |k: usize| {
        let even = (k as f64 * length) as usize - overlap;
        let from = even.saturating_sub(leeway);
        let places = from..(even + leeway + 1).min(frames - overlap);
        places.min_by(|a, b| away[*a].total_cmp(&away[*b])).unwrap_or(even)
    };
    let starts: Vec<usize> = (1..count).map(nearest).collect();
    let firsts = std::iter::once(0).chain(starts.iter().map(|start| start + overlap));
    let ends = starts.iter().map(|start| start + overlap).chain(std::iter::once(frames));
    let starts = std::iter::once(0).chain(starts.iter().copied());
    starts.zip(firsts).zip(ends).map(|((start, first), end)| Chunk { start, first, end }).collect()
}

/// How far two fits of one frame are apart that started elsewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Apart {
    /// The control that is farthest apart, of all of the model.
    pub control: usize,
    /// Its values.
    pub values: [f64; 2],
    /// Their distance in standard deviations.
    pub sds: f64,
}

/// The control of which two estimates of a frame are farthest apart; `None` where none is certain enough to be compared.
pub fn apart(before: &Estimate, after: &Estimate) -> Option<Apart> {
    let of = |k: usize| {
        // on a bound it has none in one of them
        let sd = before.sd[k].or(after.sd[k])?;
        let values = [before, after].map(|estimate| estimate.equilibrium.state.controls[k]);
        Some(Apart { control: k, values, sds: (values[1] - values[0]).abs() / sd })
    };
    (0..before.sd.len()).filter_map(of).max_by(|a, b| a.sds.total_cmp(&b.sds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_begin_near_rest_and_each_frame_is_one_s_own() {
        // at rest in every 30th frame
        let away: Vec<f64> = (0..100).map(|k| (std::f64::consts::PI * k as f64 / 30.0).sin().abs()).collect();
        let chunks = cut(ChunksSpec { count: 3, overlap: 4 }, &away);
        let chunk = |start, first, end| Chunk { start, first, end };
        assert_eq!(chunks, [chunk(0, 0, 34), chunk(30, 34, 64), chunk(60, 64, 100)]);
        assert_eq!(chunks[1].seam(), Some(33));
        assert_eq!(chunks[0].seam(), None);
        assert!(chunks[1].settles(33) && !chunks[1].settles(34));
    }

    #[test]
    fn any_clip_is_cut_into_chunks_that_hold_every_frame_once() {
        for frames in 1..60 {
            // farther and farther, then nearer again: ends move as far as they may
            for away in [|k: usize| k as f64, |k: usize| -(k as f64), |_: usize| f64::INFINITY] {
                let away: Vec<f64> = (0..frames).map(away).collect();
                for (count, overlap) in [(1, 5), (2, 1), (3, 2), (7, 1), (1000, 3), (4, 50)] {
                    let chunks = cut(ChunksSpec { count, overlap }, &away);
                    assert!((1..=count).contains(&chunks.len()));
                    let own: Vec<usize> = chunks.iter().flat_map(|chunk| chunk.first..chunk.end).collect();
                    assert_eq!(own, (0..frames).collect::<Vec<_>>(), "{frames} {count} {overlap}: {chunks:?}");
                    for pair in chunks.windows(2) {
                        assert_eq!(pair[1].first - pair[1].start, overlap);
                        // the frames that are compared are the chunk's before, not those on which that one settles
                        assert!(pair[1].start >= pair[0].first, "{frames} {count} {overlap}: {chunks:?}");
                    }
                    assert!(chunks.iter().all(|chunk| chunk.end > chunk.first), "{chunks:?}");
                }
            }
        }
    }
}
