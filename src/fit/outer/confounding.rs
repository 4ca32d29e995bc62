//! What outer unknowns have to do with the controls of the frames.
//!
//! With C the covariance of the outer unknowns and T = A^-1 B, the controls of a frame have the covariance A^-1 + T C T^T and
//! the covariance - T C with the outer unknowns.

use super::profile::{Joint, JointFrame};
use nalgebra::DMatrix;

/// The frames that were used.
#[derive(Debug, Clone, PartialEq)]
pub struct Confounding {
    /// One per frame.
    pub frames: Vec<FrameConfounding>,
}

/// A frame. Controls are those that are sought; `None` for one on a bound.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameConfounding {
    /// Index of the frame in the recording.
    pub frame: usize,
    /// Standard deviation of every control if the outer unknowns were known.
    pub sd_known: Vec<Option<f64>>,
    /// The same with what is known of them.
    pub sd: Vec<Option<f64>>,
    /// Correlation of the error of every control with that of each outer unknown; 0 for one on a bound.
    pub correlation: Vec<Vec<Option<f64>>>,
}

impl Confounding {
    /// `free` are the outer unknowns that `covariance` is of.
    pub(super) fn new(joint: &Joint, free: &[usize], covariance: &DMatrix<f64>, frames: &[usize]) -> Confounding {
        let of = |(frame, index): (&JointFrame, &usize)| {
            let t = &frame.inverse * frame.across.select_columns(free);
            let cross = -&t * covariance;
            let whole = &frame.inverse - &cross * t.transpose();
            let controls = frame.controls;
            let (mut sd_known, mut sd) = (vec![None; controls], vec![None; controls]);
            let mut correlation = vec![vec![None; frame.alone.ncols()]; controls];
            for (at, control) in frame.free.iter().enumerate() {
                let own = whole[(at, at)].max(0.0).sqrt();
                (sd_known[*control], sd[*control]) = (Some(frame.inverse[(at, at)].max(0.0).sqrt()), Some(own));
                correlation[*control] = vec![Some(0.0); frame.alone.ncols()];
                for (a, k) in free.iter().enumerate() {
                    let size = own * covariance[(a, a)].max(0.0).sqrt();
                    correlation[*control][*k] = Some(if size > 0.0 { cross[(at, a)] / size } else { 0.0 });
                }
            }
            FrameConfounding { frame: *index, sd_known, sd, correlation }
        };
        Confounding { frames: joint.frames.iter().zip(frames).map(of).collect() }
    }

    /// Of an outer unknown the largest correlation in size: with which control (as an index of those that are sought), in which
    /// frame.
    pub fn worst(&self, unknown: usize) -> Option<(usize, usize, f64)> {
        let all = self.frames.iter().flat_map(|frame| {
            let of = move |(control, own): (usize, &Vec<Option<f64>>)| Some((frame.frame, control, own[unknown]?));
            frame.correlation.iter().enumerate().filter_map(of)
        });
        all.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))
    }

    /// By how much a control is less sure in the frame where that matters most, with the outer unknowns found instead of known.
    pub fn inflation(&self, control: usize) -> Option<f64> {
        let of = |frame: &FrameConfounding| Some(frame.sd[control]? / frame.sd_known[control]?);
        self.frames.iter().filter_map(of).max_by(f64::total_cmp)
    }
}
