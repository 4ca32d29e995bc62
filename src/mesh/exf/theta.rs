//! Angles that an element must unwind before it interpolates them: `decreasing in xi1` and its like.
//!
//! The angle at a node stands in a file once, between 0 and 2 pi, but around an axis it goes on. Where a component of an
//! element says how it runs along xi1, multiples of 2 pi are added to the values at its nodes, as cmgui and Zinc do.

use std::f64::consts::{PI, TAU};

/// How an angle runs along xi1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unwind {
    Increasing,
    Decreasing,
    NonIncreasing,
    NonDecreasing,
    /// By less than half a turn from node to node.
    Closest,
}

impl Unwind {
    /// From its words in a file.
    pub fn parse(text: &str) -> Option<Unwind> {
        Some(match text {
            "increasing in xi1" => Unwind::Increasing,
            "decreasing in xi1" => Unwind::Decreasing,
            "non-increasing in xi1" => Unwind::NonIncreasing,
            "non-decreasing in xi1" => Unwind::NonDecreasing,
            "closest in xi1" => Unwind::Closest,
            _ => return None,
        })
    }

    /// What is added to an angle that follows `last` along xi1.
    fn turn(self, last: f64, angle: f64) -> f64 {
        match self {
            Unwind::Increasing if angle <= last => TAU,
            Unwind::NonDecreasing if angle < last => TAU,
            Unwind::Decreasing if angle >= last => -TAU,
            Unwind::NonIncreasing if angle > last => -TAU,
            Unwind::Closest => nearest(last, angle),
            _ => 0.0,
        }
    }

    /// Unwinds the angles at the nodes of an element, `count` of them along each direction, xi1 fastest.
    ///
    /// A side xi3 = 0, xi3 = 1, xi2 = 0 or xi2 = 1 (the first of these) whose angles are all 0 lies on the axis, where an
    /// angle means nothing; it takes those of the next layer.
    pub fn apply(self, angles: &mut [f64], count: [usize; 3]) {
        let (row, layer) = (count[0], count[0] * count[1]);
        'sides: for (along, step) in [(2, layer), (1, row)] {
            for end in [0, count[along] - 1] {
                let at = |k: &usize| k / step % count[along] == end;
                let side: Vec<usize> = (0..angles.len()).filter(at).collect();
                if side.iter().all(|k| angles[*k] == 0.0) {
                    side.iter().for_each(|&k| angles[k] = angles[if end == 0 { k + step } else { k - step }]);
                    break 'sides;
                }
            }
        }
        // the first angle of a row stays close to that of the row before, and takes its row along
        for start in (0..angles.len()).step_by(row) {
            let mut turned = 0.0;
            if start > 0 {
                let before = if start % layer == 0 { start - layer } else { start - row };
                turned = nearest(angles[before], angles[start]);
                angles[start] += turned;
            }
            for k in start + 1..start + row {
                angles[k] += turned;
                angles[k] += self.turn(angles[k - 1], angles[k]);
            }
        }
    }
}

/// The multiple of a turn that brings an angle to within half a turn of `last`, if one turn does.
fn nearest(last: f64, angle: f64) -> f64 {
    if angle > last + PI {
        -TAU
    } else if angle < last - PI {
        TAU
    } else {
        0.0
    }
}
