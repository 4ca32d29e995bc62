//! How good a recording is: its clock, its gaps, what is missing and why. Reported, never mended.

use std::fmt;

use serde::Serialize;

use crate::error::{Missing, Unguarded};
use crate::scene::Units;

/// An interval longer than this many median intervals is a gap.
const GAP: f64 = 1.5;

/// Which time of a message is its stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// The stamp in the message.
    Header,
    /// The time at which the message was sent.
    Publish,
    /// The time at which the message was recorded.
    Log,
    /// The time in a file that holds no messages.
    File,
}

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Clock::Header => "header stamp",
            Clock::Publish => "publish time",
            Clock::Log => "log time",
            Clock::File => "time in the file",
        })
    }
}

/// The quality of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Health {
    /// Number of frames.
    pub frames: usize,
    /// From the earliest to the latest stamp, seconds.
    pub duration_s: f64,
    /// One over the median interval, 1/s; `None` below two different stamps.
    pub rate_hz: Option<f64>,
    /// Root mean square of interval minus median interval, gaps and stamps that do not advance left out, seconds.
    pub jitter_s: Option<f64>,
    /// Frames with the stamp of the frame before.
    pub duplicate_stamps: usize,
    /// Frames with a stamp before that of the frame before.
    pub backward_steps: usize,
    /// Intervals longer than 1.5 median intervals.
    pub gaps: Vec<Gap>,
    /// Samples without a label; they are left out.
    pub unlabelled_samples: u64,
    /// One per label, in the order of the labels.
    pub labels: Vec<LabelHealth>,
    /// What a reader should know before trusting it.
    pub warnings: Vec<Warning>,
}

/// A stretch without frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// The last frame before it, from 0.
    pub after_frame: usize,
    /// Time of that frame, seconds since the first.
    pub time_s: f64,
    /// Time to the next frame, seconds.
    pub length_s: f64,
}

/// How often a marker was seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LabelHealth {
    /// The marker.
    pub label: String,
    /// Frames with a position.
    pub present: usize,
    /// Frames without one.
    pub missing: Missing,
}

impl LabelHealth {
    pub(super) fn new(label: &str) -> LabelHealth {
        LabelHealth { label: label.into(), present: 0, missing: Missing::default() }
    }
}

/// What a reader should know before trusting a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Warning {
    /// The file stops too early; this is its intact part.
    Truncated {
        /// Where the last, incomplete record starts, bytes.
        offset: u64,
        /// Length of the file, bytes.
        bytes: u64,
    },
    /// A damaged byte could go unseen.
    Unchecked {
        /// What is under no checksum.
        part: Unguarded,
    },
    /// Chunks without a checksum of their own (the data section has one).
    ChunksWithoutChecksum {
        /// How many.
        chunks: u64,
    },
    /// Not all messages of the topic have the stamp that is meant to be the clock.
    ClockFallback {
        /// Messages with a stamp in the message.
        stamped: usize,
        /// All messages.
        messages: usize,
        /// The clock that was used.
        used: Clock,
    },
    /// The file declares another unit than the one it was read with.
    UnitsDisagree {
        /// In the file.
        declared: String,
        /// Asked for.
        used: Units,
    },
    /// Positions at exactly (0, 0, 0) were kept, as asked.
    ZerosKept {
        /// How many.
        samples: u64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::Truncated { offset, bytes } => {
                write!(f, "the file is cut short ({bytes} bytes, the record at byte {offset} is incomplete)")
            }
            Warning::Unchecked { part } => write!(f, "damage would go unseen: {part}"),
            Warning::ChunksWithoutChecksum { chunks } => {
                write!(f, "{chunks} chunks have no checksum of their own")
            }
            Warning::ClockFallback { stamped, messages, used } => {
                write!(f, "{stamped} of {messages} messages have a time stamp: the {used} is used")
            }
            Warning::UnitsDisagree { declared, used } => {
                write!(f, "the file declares the unit `{declared}`, it is read as `{used}`")
            }
            Warning::ZerosKept { samples } => write!(f, "{samples} positions are exactly (0, 0, 0) and kept"),
        }
    }
}

/// What the stamps alone tell.
pub(super) struct Timing {
    pub duration_s: f64,
    pub rate_hz: Option<f64>,
    pub jitter_s: Option<f64>,
    pub duplicate_stamps: usize,
    pub backward_steps: usize,
    pub gaps: Vec<Gap>,
}

/// Seconds from `from` to `to`, both nanoseconds.
pub(super) fn seconds(from: i64, to: i64) -> f64 {
    (i128::from(to) - i128::from(from)) as f64 * 1e-9
}

impl Timing {
    /// From the stamps (ns) of all frames in the order of the file.
    pub fn of(stamps: &[i64]) -> Timing {
        let steps: Vec<f64> = stamps.windows(2).map(|pair| seconds(pair[0], pair[1])).collect();
        let mut advancing: Vec<f64> = steps.iter().copied().filter(|step| *step > 0.0).collect();
        advancing.sort_by(f64::total_cmp);
        let median = advancing.get(advancing.len() / 2).copied();
        let is_gap = |step: f64| median.is_some_and(|median| step > GAP * median);
        let jitter = |median: f64| {
            let regular = advancing.iter().filter(|step| !is_gap(**step));
            let (sum, count) = regular.fold((0.0, 0), |(sum, n), step| (sum + (step - median).powi(2), n + 1));
            (sum / f64::from(count)).sqrt()
        };
        let first = stamps.first().copied().unwrap_or(0);
        let (least, most) = (stamps.iter().min().unwrap_or(&0), stamps.iter().max().unwrap_or(&0));
        let gaps = steps.iter().enumerate().filter(|(_, step)| is_gap(**step));
        Timing {
            duration_s: seconds(*least, *most),
            rate_hz: median.map(|median| 1.0 / median),
            jitter_s: median.map(jitter),
            duplicate_stamps: steps.iter().filter(|step| **step == 0.0).count(),
            backward_steps: steps.iter().filter(|step| **step < 0.0).count(),
            gaps: gaps
                .map(|(frame, step)| Gap {
                    after_frame: frame,
                    time_s: seconds(first, stamps[frame]),
                    length_s: *step,
                })
                .collect(),
        }
    }
}
