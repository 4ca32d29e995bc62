//! What keeps a recording from lying on its model, told apart before anything is solved.

use super::Place;

/// A recording that does not lie on its model, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Misregistration {
    /// The reason.
    pub cause: Cause,
    /// The frames of the recording whose mean was compared with the model at rest.
    pub frames: Vec<usize>,
    /// Root mean square distance of its markers as they are, mm.
    pub rms_mm: f64,
    /// What to edit in the problem file.
    pub place: Place,
}

/// Why a recording does not lie on its model.
#[derive(Debug, Clone, PartialEq)]
pub enum Cause {
    /// Only a reflection brings it there.
    LeftHanded {
        /// What remains after the reflection, mm.
        remains_mm: f64,
        /// What remains if the labels of the two sides are exchanged instead, mm, where that explains it as well.
        sides_mm: Option<f64>,
        /// Pairs of labels of the two sides, in that case.
        pairs: Vec<[String; 2]>,
        /// `axes` with one of them turned round.
        axes: String,
    },
    /// The labels of the left side are on the right one.
    SidesExchanged {
        /// What remains when they are exchanged, mm.
        remains_mm: f64,
        /// Pairs of labels to exchange.
        pairs: Vec<[String; 2]>,
    },
    /// Some labels are on each other's markers.
    LabelsExchanged {
        /// What remains when they are exchanged, mm.
        remains_mm: f64,
        /// A label, and the one whose marker it is on.
        labels: Vec<[String; 2]>,
        /// How far the farthest of them is off, mm.
        off_mm: f64,
    },
    /// Another frame fits much better.
    NotNeutral {
        /// The markers that are farthest off, with their distance, mm.
        off: Vec<(String, f64)>,
        /// The frame that fits.
        better: usize,
        /// What remains there, mm.
        remains_mm: f64,
    },
    /// It stands elsewhere.
    NotInPlace {
        /// What remains after a rigid motion, mm.
        remains_mm: f64,
        /// Angle of that motion, degrees.
        turned_deg: f64,
        /// How far the centre of the markers moves, mm.
        moved_mm: f64,
    },
    /// Too few markers are seen to place it.
    TooFew {
        /// How many.
        markers: usize,
    },
    /// The frame called neutral does not exist.
    NoSuchFrame {
        /// Frames of the recording.
        count: usize,
    },
}

impl Misregistration {
    /// The stable code.
    pub(super) fn code(&self) -> &'static str {
        match self.cause {
            Cause::NoSuchFrame { .. } => "K004",
            Cause::LeftHanded { .. } => "K007",
            Cause::SidesExchanged { .. } => "K008",
            Cause::LabelsExchanged { .. } => "K009",
            Cause::NotNeutral { .. } => "K010",
            Cause::NotInPlace { .. } => "K011",
            Cause::TooFew { .. } => "K012",
        }
    }

    /// The edit that mends it.
    pub(super) fn help(&self) -> String {
        match &self.cause {
            Cause::LeftHanded { axes, sides_mm: None, .. } => format!("write axes = {axes} in [fit]"),
            Cause::LeftHanded { axes, pairs, .. } => format!(
                "find out which: for left-handed axes write axes = {axes} in [fit]; for exchanged labels exchange the names of {}",
                list(pairs, " and ")
            ),
            Cause::SidesExchanged { pairs, .. } => format!(
                "exchange the names of {}; `risorius markers match` writes the markers anew",
                list(pairs, " and ")
            ),
            Cause::LabelsExchanged { .. } => {
                "correct the names of these [[marker]]; `risorius markers match` writes them anew".into()
            }
            Cause::NotNeutral { better, .. } => format!("write neutral = {better} in [fit], or fit from there on"),
            Cause::NotInPlace { .. } => "write register = \"rigid\" in [fit]".into(),
            Cause::TooFew { .. } => {
                "name more [[marker]], or another frame: neutral = .. in [fit]; register = \"none\" needs none".into()
            }
            Cause::NoSuchFrame { count } => {
                format!("write neutral = \"first\", or a frame from 0 to {}", count.saturating_sub(1))
            }
        }
    }
}

impl std::fmt::Display for Misregistration {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Misregistration { cause, frames, rms_mm, .. } = self;
        let frame = neutral_named(frames, "");
        match cause {
            Cause::LeftHanded { remains_mm, sides_mm, .. } => {
                let also = match sides_mm {
                    None => String::new(),
                    Some(sides_mm) => format!(
                        "; or the labels of left and right are exchanged, which leaves {sides_mm:.2} mm: markers so symmetric \
                         do not tell the two apart"
                    ),
                };
                write!(
                    out,
                    "the axes of the recording look left-handed: no turn brings {} to the model (rms {rms_mm:.2} \
                     mm remains), a reflection leaves {remains_mm:.2} mm{also}",
                    neutral_named(frames, "its ")
                )
            }
            Cause::SidesExchanged { remains_mm, pairs } => write!(
                out,
                "the labels of left and right look exchanged: no turn brings {frame} of the recording to the model (rms \
                 {rms_mm:.2} mm remains), with {} pairs exchanged {remains_mm:.2} mm remain",
                pairs.len()
            ),
            Cause::LabelsExchanged { remains_mm, labels, off_mm } => write!(
                out,
                "labels look exchanged: in {frame} {}; as they are, they lie up to {off_mm:.2} mm off, exchanged an rms of \
                 {remains_mm:.2} mm remains",
                list(labels, " is where ")
                    .split(", ")
                    .map(|pair| format!("{pair} should be"))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
            Cause::NotNeutral { off, better, remains_mm } => {
                let off: Vec<String> = off.iter().map(|(name, mm)| format!("`{name}` {mm:.2} mm")).collect();
                write!(
                    out,
                    "{frame}, taken as neutral, does not look like the model at rest (rms {rms_mm:.2} mm; farthest off {}): \
                     frame {better} does (rms {remains_mm:.2} mm)",
                    off.join(", ")
                )
            }
            Cause::NotInPlace { remains_mm, turned_deg, moved_mm } => write!(
                out,
                "the recording does not stand where the model does: rms {rms_mm:.2} mm in {frame}; turned by {turned_deg:.2} \
                 degrees and moved by {moved_mm:.2} mm it fits to {remains_mm:.2} mm (nothing was moved)"
            ),
            Cause::TooFew { markers } => write!(
                out,
                "the recording cannot be placed on the model: {frame} shows {markers} of the markers, and three that do not \
                 lie on a line are needed"
            ),
            Cause::NoSuchFrame { count } => write!(
                out,
                "the recording has {count} frames, 0 to {}: there is no {frame} to be neutral",
                count.saturating_sub(1)
            ),
        }
    }
}

/// `frame 3`, or `the mean of frames 0 to 9`; `its` stands before the word.
pub fn neutral_named(frames: &[usize], its: &str) -> String {
    match frames {
        [first, .., last] => format!("the mean of {its}frames {first} to {last}"),
        _ => frames.iter().map(|frame| format!("{its}frame {frame}")).collect(),
    }
}

/// `` `a` and `b`, `c` and `d` ``
fn list(pairs: &[[String; 2]], between: &str) -> String {
    pairs.iter().map(|[a, b]| format!("`{a}`{between}`{b}`")).collect::<Vec<_>>().join(", ")
}
