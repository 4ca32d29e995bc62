//! Distances between the model's markers and their measurements, gathered over the frames of a fit.

use crate::report::frame::{Frame, MarkerPair};
use std::collections::BTreeMap;

/// Distances of some markers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ErrorsOf {
    /// How many markers were measured.
    pub count: usize,
    /// Sum of the squared distances, mm2.
    squares: f64,
    /// The largest distance, mm.
    pub max_mm: f64,
    /// The frame of the largest distance.
    pub max_frame: usize,
}

impl ErrorsOf {
    /// Root mean square distance, mm; `None` if nothing was measured.
    pub fn rms_mm(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares / self.count as f64).sqrt())
    }

    fn add(&mut self, frame: usize, distance: f64) {
        if self.count == 0 || distance > self.max_mm {
            (self.max_mm, self.max_frame) = (distance, frame);
        }
        self.count += 1;
        self.squares += distance * distance;
    }
}

/// Distances by frame, by marker, and in all.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MarkerErrors {
    /// Of each frame, in the order they were added.
    pub frames: Vec<(Frame, ErrorsOf)>,
    /// Of everything.
    pub all: ErrorsOf,
    by_marker: BTreeMap<String, ErrorsOf>,
}

impl MarkerErrors {
    /// Adds the markers of a frame; those that were lost count for nothing.
    pub fn add(&mut self, frame: Frame, markers: &[MarkerPair<'_>]) {
        let mut of_frame = ErrorsOf::default();
        for marker in markers {
            let Some(distance) = marker.distance() else { continue };
            of_frame.add(frame.index, distance);
            self.all.add(frame.index, distance);
            self.by_marker.entry(marker.name.to_owned()).or_default().add(frame.index, distance);
        }
        self.frames.push((frame, of_frame));
    }

    /// The `number` markers with the largest root mean square distance, the worst first.
    pub fn worst(&self, number: usize) -> Vec<(&str, ErrorsOf)> {
        let mut markers: Vec<_> = self.by_marker.iter().map(|(name, errors)| (name.as_str(), *errors)).collect();
        markers.sort_by(|a, b| b.1.rms_mm().unwrap_or(0.0).total_cmp(&a.1.rms_mm().unwrap_or(0.0)));
        markers.truncate(number);
        markers
    }
}
