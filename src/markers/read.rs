//! Reading one topic of a file into a [`Recording`].

use std::collections::BTreeMap;
use std::path::Path;

use super::container::{Container, Message};
use super::files::{self, FileFormat};
use super::format::{self, DecodeFault, Observation};
use super::health::{Clock, Health, Timing, Warning, seconds};
use super::recording::{Collector, Frame, Recording, Source};
use super::topic::{Reader, readers};
use crate::error::{Error, Fault, Missing, Result, Topic};
use crate::scene::Units;

/// How to read a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    /// The topic; `None`: the only one with markers.
    pub topic: Option<String>,
    /// The unit of the positions in the file. Never guessed, and never taken from the file.
    pub units: Units,
    /// Whether a marker at exactly (0, 0, 0) is a lost one, as many drivers publish them.
    pub zero_is_missing: bool,
    /// Whether the intact part of a file that is cut short will do.
    pub allow_truncated: bool,
    /// Whether a file will do in which damage would go unseen, because its writer computed no checksums.
    pub allow_unchecked: bool,
}

impl Default for ReadOptions {
    /// The only topic with markers, millimetres, zero is missing, whole and checked files.
    fn default() -> Self {
        ReadOptions {
            topic: None,
            units: Units::Mm,
            zero_is_missing: true,
            allow_truncated: false,
            allow_unchecked: false,
        }
    }
}

/// Reads the markers of one topic of an MCAP file, or of a C3D, TRC or CSV file.
///
/// Errors: M001 to M012, M015 and O001, each with its numbers; see [`crate::Error`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<Recording> {
    read_bytes(path, &load(path)?, options)
}

/// [`read`] for a file that is already in memory; `path` names it in messages, and tells C3D, TRC and CSV by its end.
pub fn read_bytes(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Recording> {
    if let Some(format) = files::kind(path) {
        let recording = read_file(format, path, bytes, options)?;
        return with_samples(recording);
    }
    let container = Container::read(path, bytes, &|channel, schema| {
        let named = options.topic.as_ref().is_none_or(|topic| *topic == channel.topic);
        named && format::decoder(schema, &channel.encoding).is_ok()
    })?;
    admit(path, &container, options)?;
    let reader = choose(path, readers(&container), options)?;
    with_samples(decode(path, &container, &reader, options)?)
}

/// A recording that shows something.
fn with_samples(recording: Recording) -> Result<Recording> {
    if recording.health.labels.iter().any(|label| label.present > 0) {
        return Ok(recording);
    }
    let missing = recording.health.labels.iter().map(|label| label.missing);
    Err(Error::NoSamples {
        path: recording.source.path,
        topic: recording.source.topic,
        frames: recording.frames.len(),
        labels: recording.labels.len(),
        missing: missing.fold(Missing::default(), Missing::plus),
    })
}

/// An error for a file that is cut short or unchecked, unless that was allowed.
pub(super) fn admit(path: &Path, container: &Container, options: &ReadOptions) -> Result<()> {
    if !options.allow_truncated {
        whole(path, container, options)?;
    }
    match container.unguarded.filter(|_| !options.allow_unchecked) {
        Some(part) => Err(Error::UncheckedRecording { path: path.into(), part }),
        None => Ok(()),
    }
}

/// The bytes of a file.
pub(super) fn load(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|source| Error::Io { action: "read", path: path.into(), source })
}

/// An error for a file that is cut short, saying what is intact.
fn whole(path: &Path, container: &Container, options: &ReadOptions) -> Result<()> {
    let Some(cut) = container.truncated else {
        return Ok(());
    };
    let reader = choose(path, readers(container), options);
    let intact = reader.and_then(|reader| decode(path, container, &reader, options)).ok();
    Err(Error::TruncatedRecording {
        path: path.into(),
        bytes: cut.bytes,
        offset: cut.offset,
        messages: container.message_count(),
        frames: intact.as_ref().map_or(0, |recording| recording.frames.len()),
        seconds: intact.as_ref().map_or(0.0, |recording| recording.health.duration_s),
    })
}

/// The topic that was asked for, or the only one with markers.
fn choose(path: &Path, mut readers: BTreeMap<String, Reader>, options: &ReadOptions) -> Result<Reader> {
    let all: Vec<Topic> = readers.values().map(|reader| reader.topic.clone()).collect();
    let name = match &options.topic {
        Some(name) => name.clone(),
        None => {
            let mut readable = all.iter().filter(|topic| topic.is_readable());
            match (readable.next(), readable.next()) {
                (Some(only), None) => only.name.clone(),
                (None, _) => return Err(Error::NoMarkerTopic { path: path.into(), topics: all }),
                (Some(_), Some(_)) => return Err(Error::SeveralMarkerTopics { path: path.into(), topics: all }),
            }
        }
    };
    let Some(reader) = readers.remove(&name) else {
        let nearest = nearest_topic(&all, &name);
        return Err(Error::TopicNotFound { path: path.into(), topic: name, nearest, topics: all });
    };
    if let Some(reason) = reader.fault {
        return Err(Error::TopicNotReadable { path: path.into(), topic: name, reason, topics: all });
    }
    if reader.topic.messages == 0 {
        return Err(Error::EmptyTopic { path: path.into(), topic: name });
    }
    Ok(reader)
}

/// The topic with the most similar name, if one is similar.
pub(super) fn nearest_topic(topics: &[Topic], name: &str) -> Option<String> {
    let closeness = |topic: &&Topic| strsim::jaro_winkler(&topic.name, name);
    let nearest = topics.iter().max_by(|a, b| closeness(a).total_cmp(&closeness(b)));
    nearest.filter(|topic| closeness(topic) > 0.7).map(|topic| topic.name.clone())
}

/// A message that does not hold what its schema promises.
pub(super) fn undecodable(path: &Path, topic: &str, message: &Message, found: DecodeFault) -> Error {
    let (path, topic, sequence) = (path.into(), topic.to_owned(), message.sequence);
    match found.fault {
        Fault::Encapsulation { id } => Error::UnsupportedEncapsulation { path, topic, sequence, id },
        fault => {
            let log_time_ns = message.log_time;
            Error::Undecodable { path, topic, sequence, log_time_ns, byte: found.byte, fault }
        }
    }
}

/// Decodes all messages of a topic.
pub(super) fn decode(
    path: &Path,
    container: &Container,
    reader: &Reader,
    options: &ReadOptions,
) -> Result<Recording> {
    let mut collector = Collector::default();
    collector.units = reader.units.clone();
    let mut messages = Vec::new();
    for message in &container.messages {
        let Some(decoder) = reader.decoders.get(&message.channel) else {
            continue;
        };
        let observation = decoder
            .decode(&message.payload)
            .map_err(|found| undecodable(path, &reader.topic.name, message, found))?;
        messages.push((message, observation.stamp_ns));
        collector.add(observation);
    }
    let (clock, stamps) = clock(&messages);
    let stamped = messages.iter().filter(|(_, stamp)| stamp.is_some()).count();
    let mut warnings = Vec::new();
    warnings.extend(container.truncated.map(|cut| Warning::Truncated { offset: cut.offset, bytes: cut.bytes }));
    warnings.extend(container.unguarded.map(|part| Warning::Unchecked { part }));
    if container.chunks_without_crc > 0 {
        warnings.push(Warning::ChunksWithoutChecksum { chunks: container.chunks_without_crc });
    }
    if clock != Clock::Header {
        warnings.push(Warning::ClockFallback { stamped, messages: messages.len(), used: clock });
    }
    let source = Source {
        path: path.into(),
        topic: reader.topic.name.clone(),
        schema: reader.topic.schema.clone(),
        schema_encoding: reader.topic.schema_encoding.clone(),
        message_encoding: reader.topic.message_encoding.clone(),
        format: reader.topic.markers.clone().unwrap_or_default(),
        compression: container.compression.clone(),
        units_declared: collector.units.clone(),
        units: options.units,
        clock,
    };
    Ok(recording(source, collector, stamps, warnings, options))
}

/// Reads a file that holds markers and nothing else.
pub(super) fn read_file(
    format: &dyn FileFormat,
    path: &Path,
    bytes: &[u8],
    options: &ReadOptions,
) -> Result<Recording> {
    if let Some(topic) = &options.topic {
        let (path, topic) = (path.into(), topic.clone());
        return Err(Error::TopicNotFound { path, topic, nearest: None, topics: Vec::new() });
    }
    let tracks = files::read(format, path, bytes, options.allow_truncated)?;
    let mut collector = Collector::default();
    collector.units = tracks.units;
    for samples in tracks.frames {
        collector.add(Observation { stamp_ns: None, unit: None, samples });
    }
    let source = Source {
        path: path.into(),
        topic: String::new(),
        schema: String::new(),
        schema_encoding: String::new(),
        message_encoding: String::new(),
        format: format.name().into(),
        compression: BTreeMap::new(),
        units_declared: collector.units.clone(),
        units: options.units,
        clock: Clock::File,
    };
    let length = bytes.len() as u64;
    let warnings = tracks.truncated.then_some(Warning::Truncated { offset: length, bytes: length });
    Ok(recording(source, collector, tracks.stamps_ns, warnings.into_iter().collect(), options))
}

/// A recording of what was collected, with its health.
fn recording(
    source: Source,
    collector: Collector,
    stamps: Vec<i64>,
    mut warnings: Vec<Warning>,
    options: &ReadOptions,
) -> Recording {
    let unlabelled_samples = collector.unlabelled;
    let ((labels, positions, label_health), zeros_kept) =
        collector.finish(options.units.mm(), options.zero_is_missing);
    let disagrees = |declared: &&String| Units::from_name(declared) != Some(options.units);
    warnings.extend(
        source
            .units_declared
            .iter()
            .filter(disagrees)
            .map(|declared| Warning::UnitsDisagree { declared: declared.clone(), used: options.units }),
    );
    if zeros_kept > 0 {
        warnings.push(Warning::ZerosKept { samples: zeros_kept });
    }

    let timing = Timing::of(&stamps);
    let first = stamps.first().copied().unwrap_or(0);
    let frame = |(stamp_ns, positions_mm)| Frame { time_s: seconds(first, stamp_ns), stamp_ns, positions_mm };
    let frames: Vec<Frame> = stamps.into_iter().zip(positions).map(frame).collect();
    let health = Health {
        frames: frames.len(),
        duration_s: timing.duration_s,
        rate_hz: timing.rate_hz,
        jitter_s: timing.jitter_s,
        duplicate_stamps: timing.duplicate_stamps,
        backward_steps: timing.backward_steps,
        gaps: timing.gaps,
        unlabelled_samples,
        labels: label_health,
        warnings,
    };
    Recording { source, labels, frames, health, bones: None }
}

/// One clock for the whole recording: the stamp in the message if every message has one, else publish time, else log
/// time. A clock that is zero throughout was never set. Stamps in nanoseconds.
fn clock(messages: &[(&Message, Option<i64>)]) -> (Clock, Vec<i64>) {
    let is_set = |stamps: &[i64]| stamps.iter().any(|stamp| *stamp != 0);
    // A container time beyond the year 2262 does not fit; it stops at the end of the range.
    let time = |time: u64| i64::try_from(time).unwrap_or(i64::MAX);
    let stamped: Option<Vec<i64>> = messages.iter().map(|(_, stamp)| *stamp).collect();
    if let Some(stamps) = stamped.filter(|stamps| is_set(stamps)) {
        return (Clock::Header, stamps);
    }
    let published: Vec<i64> = messages.iter().map(|(message, _)| time(message.publish_time)).collect();
    if is_set(&published) {
        return (Clock::Publish, published);
    }
    (Clock::Log, messages.iter().map(|(message, _)| time(message.log_time)).collect())
}
