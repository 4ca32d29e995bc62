//! The one type all marker recordings become.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

use serde::Serialize;

use super::format::{Observation, Sample};
use super::health::{Clock, Health, LabelHealth};
use crate::error::Missing;
use crate::scene::Units;

/// Tracks of surface markers: who was where, when, and what is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Where it comes from.
    pub source: Source,
    /// Names of the markers, in the order in which they first appear in the file.
    pub labels: Vec<String>,
    /// The frames in the order of the file. Nothing is resampled, sorted or filled.
    pub frames: Vec<Frame>,
    /// What is known about its quality.
    pub health: Health,
    /// How noisy the bone markers were with which a motion of the head was taken out, if it was.
    pub bones: Option<BoneNoise>,
}

/// Markers on bone.
#[derive(Debug, Clone, PartialEq)]
pub struct BoneNoise {
    /// Variance of a coordinate, mm2, as their distances from a rigid head estimate it.
    pub variance_mm2: f64,
    /// Where each of them is when the head is as in the neutral frames, mm; `None` for one that no frame places.
    pub neutral_mm: Vec<Option<[f64; 3]>>,
    /// The neutral frames that show where the head is.
    pub neutral: Vec<usize>,
    /// Of every frame those that counted.
    pub shown: Vec<Vec<usize>>,
}

/// All markers at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Seconds since the first frame.
    pub time_s: f64,
    /// Absolute time as in the file, nanoseconds.
    pub stamp_ns: i64,
    /// Positions in millimetres, one per label; `None` where the sample is missing.
    pub positions_mm: Vec<Option<[f64; 3]>>,
}

/// Where a recording comes from and how it was read.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// The topic in it.
    pub topic: String,
    /// Name of the schema, for example `mocap4r2_msgs/msg/Markers`.
    pub schema: String,
    /// Encoding of the schema, for example `ros2msg`.
    pub schema_encoding: String,
    /// Encoding of the messages, for example `cdr`.
    pub message_encoding: String,
    /// The marker format that read it.
    pub format: String,
    /// Number of chunks by compression (`none`, `lz4`, `zstd`); empty for a file without chunks.
    pub compression: BTreeMap<String, u64>,
    /// Units that the file declares in its messages or in the metadata of the topic (`unit`, `units`).
    pub units_declared: Vec<String>,
    /// The unit it was read with.
    pub units: Units,
    /// The clock of the stamps.
    pub clock: Clock,
}

/// Collects observations into frames.
#[derive(Default)]
pub(super) struct Collector {
    labels: Vec<String>,
    places: HashMap<String, usize>,
    frames: Vec<Vec<Option<Sample>>>,
    /// Label and frame of samples whose label stands more than once in their message.
    ambiguous: Vec<(usize, usize)>,
    pub unlabelled: u64,
    pub units: Vec<String>,
}

/// Labels, positions (mm) per frame, and the health of every label.
pub(super) type Tracks = (Vec<String>, Vec<Vec<Option<[f64; 3]>>>, Vec<LabelHealth>);

impl Collector {
    pub fn add(&mut self, observation: Observation) {
        if let Some(unit) = observation.unit.filter(|unit| !self.units.contains(unit)) {
            self.units.push(unit);
        }
        let frame = self.frames.len();
        let mut samples = vec![None; self.labels.len()];
        for (label, sample) in observation.samples {
            if label.is_empty() {
                self.unlabelled += 1;
                continue;
            }
            let place = *self.places.entry(label).or_insert_with_key(|label| {
                self.labels.push(label.clone());
                self.labels.len() - 1
            });
            samples.resize(self.labels.len().max(samples.len()), None);
            if samples[place].replace(sample).is_some() {
                self.ambiguous.push((place, frame));
            }
        }
        self.frames.push(samples);
    }

    /// Positions times `scale` (mm per unit of the file); the other kinds become missing and are counted.
    pub fn finish(mut self, scale: f64, zero_is_missing: bool) -> (Tracks, u64) {
        self.ambiguous.dedup();
        let ambiguous: std::collections::HashSet<_> = self.ambiguous.into_iter().collect();
        let mut zeros_kept = 0;
        let mut health: Vec<_> = self.labels.iter().map(|label| LabelHealth::new(label)).collect();
        let mut positions = Vec::with_capacity(self.frames.len());
        for (frame, mut samples) in self.frames.into_iter().enumerate() {
            samples.resize(self.labels.len(), None);
            let position = |(place, sample): (usize, Option<Sample>)| {
                let LabelHealth { present, missing, .. } = &mut health[place];
                let missing: &mut Missing = missing;
                let scaled = match sample {
                    _ if ambiguous.contains(&(place, frame)) => {
                        missing.ambiguous += 1;
                        return None;
                    }
                    None | Some(Sample::Absent) => {
                        missing.absent += 1;
                        return None;
                    }
                    Some(Sample::Invalid) => {
                        missing.invalid += 1;
                        return None;
                    }
                    Some(Sample::Position(position)) => position.map(|coordinate| coordinate * scale),
                };
                if !scaled.iter().all(|coordinate| coordinate.is_finite()) {
                    missing.not_finite += 1;
                    return None;
                }
                if scaled == [0.0; 3] {
                    if zero_is_missing {
                        missing.zero += 1;
                        return None;
                    }
                    zeros_kept += 1;
                }
                *present += 1;
                Some(scaled)
            };
            positions.push(samples.into_iter().enumerate().map(position).collect());
        }
        ((self.labels, positions, health), zeros_kept)
    }
}
