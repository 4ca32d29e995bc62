//! What all frames together tell: gathered frame by frame.

use super::{Combination, Evidence, Known, Pair, Told, combinations};
use crate::fit::covariance::Bound;
use nalgebra::DMatrix;

/// What is gathered of a control over the frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Weak {
    /// Index of the control in the model.
    pub control: usize,
    /// The frame in which it is greatest, and what was known of it there.
    pub peak: (usize, Known),
    /// Its bias there by the mesh, if it was estimated.
    pub bias_at_peak: Option<f64>,
    /// Frames in which the markers tell less of it than was known before.
    pub prior_dominated: usize,
    /// Frames on a bound.
    pub on_bound: usize,
    /// The frame on a bound in which it would go farthest beyond, and where to.
    pub wants: Option<(usize, f64)>,
}

/// A marker over the frames.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Left {
    count: usize,
    sum_mm: [f64; 3],
    square_mm2: f64,
    expected_mm2: f64,
}

/// What remains of a marker over the clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOver {
    /// Index of the marker.
    pub marker: usize,
    /// Root mean square of what no admissible control removes, mm.
    pub rms_mm: f64,
    /// What noise alone would leave, mm.
    pub expected_mm: f64,
    /// The mean over the frames, mm: an offset of the marker, or of the model there.
    pub mean_mm: [f64; 3],
}

/// The frames so far.
#[derive(Debug, Clone, Default)]
pub struct ClipKnowledge {
    frames: usize,
    unknowns: Vec<usize>,
    information: Option<DMatrix<f64>>,
    controls: Vec<Weak>,
    /// Every pair with the number of its frames and the one where its members are least told apart.
    pairs: Vec<(usize, usize, Pair)>,
    markers: Vec<Left>,
}

impl ClipKnowledge {
    /// Adds a frame; `biases` one per control that was sought, or none.
    pub fn add(&mut self, frame: usize, evidence: &Evidence, told: &Told, biases: &[Option<f64>]) {
        self.frames += 1;
        self.unknowns.clone_from(&evidence.unknowns);
        let own = evidence.j.tr_mul(&evidence.j);
        self.information = Some(self.information.take().map_or_else(|| own.clone(), |sum| sum + &own));
        for (k, known) in told.controls.iter().enumerate() {
            let bias = biases.get(k).copied().flatten();
            if self.controls.len() <= k {
                self.controls.push(Weak {
                    control: known.control,
                    peak: (frame, known.clone()),
                    bias_at_peak: bias,
                    prior_dominated: 0,
                    on_bound: 0,
                    wants: None,
                });
            }
            let weak = &mut self.controls[k];
            if known.value > weak.peak.1.value {
                (weak.peak, weak.bias_at_peak) = ((frame, known.clone()), bias);
            }
            weak.prior_dominated += usize::from(known.prior_dominated);
            weak.on_bound += usize::from(known.bound != Bound::Free);
            if let Some(wants) = known.wants {
                let beyond = |at: f64| (at - known.value).abs();
                if weak.wants.is_none_or(|(_, farthest)| beyond(wants) > beyond(farthest)) {
                    weak.wants = Some((frame, wants));
                }
            }
        }
        for pair in &told.pairs {
            match self.pairs.iter_mut().find(|(_, _, known)| known.controls == pair.controls) {
                Some((count, worst, known)) => {
                    *count += 1;
                    if pair.correlation.abs() > known.correlation.abs() {
                        (*worst, *known) = (frame, pair.clone());
                    }
                }
                None => self.pairs.push((1, frame, pair.clone())),
            }
        }
        for left in &told.unexplained {
            let none = Left { count: 0, sum_mm: [0.0; 3], square_mm2: 0.0, expected_mm2: 0.0 };
            self.markers.resize(self.markers.len().max(left.marker + 1), none);
            let sum = &mut self.markers[left.marker];
            sum.count += 1;
            sum.sum_mm.iter_mut().zip(left.left_mm).for_each(|(s, l)| *s += l);
            sum.square_mm2 += left.distance_mm().powi(2);
            sum.expected_mm2 += left.expected_mm.powi(2);
        }
    }

    /// Frames that were added.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Of every control that was sought.
    pub fn controls(&self) -> &[Weak] {
        &self.controls
    }

    /// Pairs with the number of their frames and the frame in which they are most alike; those of the most frames first.
    pub fn pairs(&self) -> Vec<&(usize, usize, Pair)> {
        let mut all: Vec<_> = self.pairs.iter().collect();
        all.sort_by_key(|pair| std::cmp::Reverse(pair.0));
        all
    }

    /// Combinations that do not change over the clip, seen by all its frames together; the best seen first.
    pub fn combinations(&self) -> Vec<Combination> {
        self.information.as_ref().map_or_else(Vec::new, |sum| combinations(&self.unknowns, sum))
    }

    /// What no admissible control removes, marker by marker; the largest in relation to noise first.
    pub fn left_over(&self) -> Vec<LeftOver> {
        let of = |(marker, left): (usize, &Left)| {
            let mean = |sum: f64| sum / left.count as f64;
            (left.count > 0).then(|| LeftOver {
                marker,
                rms_mm: mean(left.square_mm2).sqrt(),
                expected_mm: mean(left.expected_mm2).sqrt(),
                mean_mm: left.sum_mm.map(mean),
            })
        };
        let mut all: Vec<LeftOver> = self.markers.iter().enumerate().filter_map(of).collect();
        let ratio = |l: &LeftOver| l.rms_mm / l.expected_mm.max(f64::MIN_POSITIVE);
        all.sort_by(|a, b| ratio(b).total_cmp(&ratio(a)));
        all
    }
}
