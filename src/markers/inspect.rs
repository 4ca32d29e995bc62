//! What is in a file, without converting anything.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::container::Container;
use super::files;
use super::format;
use super::health::{Clock, Health, LabelHealth, Warning};
use super::read::{ReadOptions, decode, load, read_file};
use super::recording::Recording;
use super::topic::readers;
use crate::error::{Missing, Result, Topic, Unguarded};
use crate::scene::Units;

/// The size, in millimetres, that the markers on a face or a phantom have: the diagonal of their box.
const PLAUSIBLE_MM: [f64; 2] = [20.0, 600.0];

/// Gaps that are printed; all of them are in [`Health::gaps`].
const GAPS_SHOWN: usize = 5;

/// What a file holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    /// The file.
    pub path: PathBuf,
    /// Its length, bytes.
    pub bytes: u64,
    /// Number of chunks by compression (`none`, `lz4`, `zstd`); empty for a file without chunks.
    pub chunks: BTreeMap<String, u64>,
    /// All topics, by name.
    pub topics: Vec<Topic>,
    /// What the readable topics with messages hold.
    pub markers: Vec<MarkerTopic>,
    /// Set when the file stops too early.
    pub truncated: Option<Warning>,
    /// Set when damage would go unseen.
    pub unchecked: Option<Unguarded>,
}

/// A topic with markers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarkerTopic {
    /// Its name.
    pub topic: String,
    /// What it holds, or which message cannot be decoded.
    pub contents: std::result::Result<Contents, String>,
}

/// What a topic with markers holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contents {
    /// The clock of the stamps.
    pub clock: Clock,
    /// Units that the file declares.
    pub units_declared: Vec<String>,
    /// Its quality, and the presence of every label.
    pub health: Health,
    /// Where the markers are; `None` if no sample is present.
    pub extent: Option<Extent>,
}

/// Where the markers are, in the unit of the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Extent {
    /// Least coordinates.
    pub least: [f64; 3],
    /// Greatest coordinates.
    pub greatest: [f64; 3],
    /// Diagonal of the box around the markers of one frame; the median over the frames.
    pub diagonal: f64,
    /// The units in which markers on a face would be of this size. A hint: nothing is converted.
    pub plausible_units: Vec<Units>,
}

/// Says what is in an MCAP, C3D, TRC or CSV file. Files that are cut short or without checksums are inspected with a warning.
///
/// Errors: M001 (not an MCAP), M002 (damaged), O001 (cannot be read).
pub fn inspect(path: &Path) -> Result<Inspection> {
    inspect_bytes(path, &load(path)?)
}

/// [`inspect`] for a file that is already in memory; `path` names it.
pub fn inspect_bytes(path: &Path, bytes: &[u8]) -> Result<Inspection> {
    if let Some(format) = files::kind(path) {
        let options = ReadOptions { allow_truncated: true, ..ReadOptions::default() };
        let recording = read_file(format, path, bytes, &options)?;
        let mut contents = Contents::of(recording);
        let cut = |warning: &Warning| matches!(warning, Warning::Truncated { .. });
        let truncated = contents.health.warnings.iter().position(cut).map(|k| contents.health.warnings.remove(k));
        return Ok(Inspection {
            path: path.into(),
            bytes: bytes.len() as u64,
            chunks: BTreeMap::new(),
            topics: Vec::new(),
            markers: vec![MarkerTopic { topic: format.name().into(), contents: Ok(contents) }],
            truncated,
            unchecked: None,
        });
    }
    let container =
        Container::read(path, bytes, &|channel, schema| format::decoder(schema, &channel.encoding).is_ok())?;
    let (mut topics, mut markers) = (Vec::new(), Vec::new());
    for (_, reader) in readers(&container) {
        if reader.topic.is_readable() && reader.topic.messages > 0 {
            // Millimetres have the factor 1: positions stay in the unit of the file.
            let decoded = decode(path, &container, &reader, &ReadOptions::default());
            let contents = decoded.map(Contents::of).map_err(|error| error.to_string());
            markers.push(MarkerTopic { topic: reader.topic.name.clone(), contents });
        }
        topics.push(reader.topic);
    }
    Ok(Inspection {
        path: path.into(),
        bytes: bytes.len() as u64,
        chunks: container.compression,
        topics,
        markers,
        truncated: container.truncated.map(|cut| Warning::Truncated { offset: cut.offset, bytes: cut.bytes }),
        unchecked: container.unguarded,
    })
}

impl Contents {
    fn of(recording: Recording) -> Contents {
        Contents {
            clock: recording.source.clock,
            units_declared: recording.source.units_declared.clone(),
            extent: Extent::of(&recording),
            // Nothing was asked about units, so there is nothing to disagree with.
            health: Health {
                warnings: recording
                    .health
                    .warnings
                    .into_iter()
                    .filter(|warning| !matches!(warning, Warning::UnitsDisagree { .. }))
                    .collect(),
                ..recording.health
            },
        }
    }
}

impl Extent {
    fn of(recording: &Recording) -> Option<Extent> {
        let mut diagonals = Vec::with_capacity(recording.frames.len());
        let mut whole: Option<[[f64; 3]; 2]> = None;
        for frame in &recording.frames {
            let Some([least, greatest]) = bounds(frame.positions_mm.iter().flatten().copied()) else {
                continue;
            };
            diagonals.push((0..3).map(|axis| (greatest[axis] - least[axis]).powi(2)).sum::<f64>().sqrt());
            whole = bounds(whole.into_iter().flatten().chain([least, greatest]));
        }
        let [least, greatest] = whole?;
        diagonals.sort_by(f64::total_cmp);
        let diagonal = diagonals[diagonals.len() / 2];
        let plausible = |unit: &Units| (PLAUSIBLE_MM[0]..PLAUSIBLE_MM[1]).contains(&(diagonal * unit.mm()));
        Some(Extent {
            least,
            greatest,
            diagonal,
            plausible_units: Units::ALL.into_iter().filter(plausible).collect(),
        })
    }
}

/// Least and greatest coordinates of some points.
fn bounds(points: impl Iterator<Item = [f64; 3]>) -> Option<[[f64; 3]; 2]> {
    points.fold(None, |bounds, point| {
        let [least, greatest] = bounds.unwrap_or([point; 2]);
        let least = std::array::from_fn(|axis| point[axis].min(least[axis]));
        let greatest = std::array::from_fn(|axis| point[axis].max(greatest[axis]));
        Some([least, greatest])
    })
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} bytes, ", self.path.display(), self.bytes)?;
        if self.topics.is_empty() && !self.markers.is_empty() {
            write!(f, "without checksums")?;
        } else if self.chunks.is_empty() {
            write!(f, "no chunks")?;
        }
        let mut separator = "";
        for (compression, count) in &self.chunks {
            let noun = if *count == 1 { "chunk" } else { "chunks" };
            write!(f, "{separator}{count} {noun} ({compression})")?;
            separator = ", ";
        }
        writeln!(f)?;
        if let Some(warning) = &self.truncated {
            writeln!(f, "warning: {warning}")?;
        }
        if let Some(part) = &self.unchecked {
            writeln!(f, "warning: damage would go unseen: {part}")?;
        }
        if !self.topics.is_empty() {
            writeln!(f, "topics")?;
        }
        for topic in &self.topics {
            writeln!(f, "  {topic}")?;
        }
        for MarkerTopic { topic, contents } in &self.markers {
            writeln!(f, "\nmarkers of `{topic}`")?;
            match contents {
                Ok(contents) => write!(f, "{contents}")?,
                Err(fault) => writeln!(f, "  {fault}")?,
            }
        }
        Ok(())
    }
}

impl fmt::Display for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Health { frames, duration_s, duplicate_stamps, backward_steps, gaps, labels, .. } = &self.health;
        write!(f, "  {frames} frames over {duration_s} s by {}", self.clock)?;
        if let (Some(rate), Some(jitter)) = (self.health.rate_hz, self.health.jitter_s) {
            write!(f, ", {rate:.3} Hz, jitter {:.3} ms", 1e3 * jitter)?;
        }
        writeln!(f)?;
        writeln!(
            f,
            "  {duplicate_stamps} duplicate stamps, {backward_steps} steps back in time, {} gaps",
            gaps.len()
        )?;
        for gap in gaps.iter().take(GAPS_SHOWN) {
            writeln!(f, "    gap of {:.4} s after frame {} at {:.4} s", gap.length_s, gap.after_frame, gap.time_s)?;
        }
        if gaps.len() > GAPS_SHOWN {
            writeln!(f, "    and {} more", gaps.len() - GAPS_SHOWN)?;
        }
        for warning in &self.health.warnings {
            writeln!(f, "  warning: {warning}")?;
        }
        if let Some(Extent { least, greatest, diagonal, plausible_units }) = &self.extent {
            writeln!(f, "  from ({:.5}, {:.5}, {:.5})", least[0], least[1], least[2])?;
            writeln!(
                f,
                "  to   ({:.5}, {:.5}, {:.5}) in the unit of the file",
                greatest[0], greatest[1], greatest[2]
            )?;
            let names: Vec<_> = plausible_units.iter().map(|unit| unit.name()).collect();
            let names = if names.is_empty() { "none of mm, cm, m".into() } else { names.join(" or ") };
            writeln!(
                f,
                "  diagonal of a frame {diagonal:.5}: the size of a face if the unit is {names} (not converted)"
            )?;
        }
        if !self.units_declared.is_empty() {
            writeln!(f, "  the file says that its unit is {}", self.units_declared.join(", "))?;
        }
        let width = labels.iter().map(|label| label.label.chars().count()).max().unwrap_or(0).max("label".len());
        writeln!(
            f,
            "  {:width$}  {:>7}  {:>7}  {:>7}  {:>7}  {:>7}  {:>7}",
            "label", "present", "absent", "NaN/inf", "(0,0,0)", "invalid", "twice"
        )?;
        for LabelHealth { label, present, missing } in labels {
            let Missing { absent, not_finite, zero, invalid, ambiguous } = missing;
            writeln!(
                f,
                "  {label:width$}  {present:>7}  {absent:>7}  {not_finite:>7}  {zero:>7}  {invalid:>7}  {ambiguous:>7}"
            )?;
        }
        Ok(())
    }
}
