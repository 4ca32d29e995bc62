//! Writes our own JSON markers, `risorius.Markers`: readable by every MCAP tool without a definition at hand.

use std::collections::BTreeMap;
use std::io::{Cursor, Error as IoError};
use std::path::Path;

use mcap::records::MessageHeader;
use serde::Serialize;

use super::recording::Frame;
use crate::scene::Units;
use crate::{Error, Result};

/// Name of the schema.
const SCHEMA_NAME: &str = "risorius.Markers";

/// The JSON schema of [`Message`].
const SCHEMA: &str = r#"{
  "title": "risorius.Markers",
  "description": "Positions of surface markers at one time. The unit is in the metadata of the channel; a lost marker has the position null.",
  "type": "object",
  "required": ["stamp", "markers"],
  "properties": {
    "stamp": {
      "type": "object",
      "required": ["sec", "nsec"],
      "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999}}
    },
    "markers": {
      "type": "array",
      "items": {
        "type": "object",
        "required": ["name", "position"],
        "properties": {
          "name": {"type": "string"},
          "position": {"type": ["array", "null"], "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
        }
      }
    }
  }
}
"#;

/// How the chunks of a file are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// Not at all.
    None,
    /// Fast.
    Lz4,
    /// Small.
    #[default]
    Zstd,
}

/// How to write a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct WriteOptions {
    /// The topic.
    pub topic: String,
    /// Compression of the chunks.
    pub compression: Compression,
    /// Unit of the positions in the file; it is declared in the metadata of the channel.
    pub units: Units,
}

impl Default for WriteOptions {
    /// Topic `/markers`, zstd, millimetres.
    fn default() -> Self {
        WriteOptions { topic: "/markers".into(), compression: Compression::Zstd, units: Units::Mm }
    }
}

#[derive(Serialize)]
struct Message<'a> {
    stamp: Stamp,
    markers: Vec<Marker<'a>>,
}

#[derive(Serialize)]
struct Stamp {
    sec: i64,
    nsec: i64,
}

#[derive(Serialize)]
struct Marker<'a> {
    name: &'a str,
    position: Option<[f64; 3]>,
}

/// Writes markers as `risorius.Markers`, with checksums and statistics. The same markers give the same bytes.
///
/// `names`: one per marker; `frames`: positions in that order.
///
/// A missing or not finite position becomes `null`. In millimetres every bit of a position comes back; in other units
/// it may change by one rounding. Log and publish time are the stamp, or 0 for a stamp before 1970.
///
/// A file that is there already is replaced whole or not at all.
///
/// Errors: M013 (a frame does not fit the labels), O001 (the file cannot be written).
pub fn write_json(path: &Path, names: &[String], frames: &[Frame], options: &WriteOptions) -> Result<()> {
    let labels = names.len();
    for (frame, positions) in frames.iter().map(|frame| frame.positions_mm.len()).enumerate() {
        if positions != labels {
            return Err(Error::FrameShape { frame, positions, labels });
        }
    }
    let beside = path.with_extension("mcap.part");
    let written = encode(names, frames, options).and_then(|bytes| std::fs::write(&beside, bytes));
    written.and_then(|()| std::fs::rename(&beside, path)).map_err(|source| {
        // the first error is the one to tell
        let _ = std::fs::remove_file(&beside);
        Error::Io { action: "write", path: path.into(), source }
    })
}

/// The bytes of the file.
fn encode(names: &[String], frames: &[Frame], options: &WriteOptions) -> std::result::Result<Vec<u8>, IoError> {
    let compression = match options.compression {
        Compression::None => None,
        Compression::Lz4 => Some(mcap::Compression::Lz4),
        Compression::Zstd => Some(mcap::Compression::Zstd),
    };
    // One thread: the bytes must not depend on the machine.
    let mut writer = mcap::WriteOptions::new()
        .compression(compression)
        .compression_threads(0)
        .library(concat!("risorius ", env!("CARGO_PKG_VERSION")))
        .create(Cursor::new(Vec::new()))
        .map_err(IoError::other)?;
    let schema = writer.add_schema(SCHEMA_NAME, "jsonschema", SCHEMA.as_bytes()).map_err(IoError::other)?;
    let metadata = BTreeMap::from([("unit".to_string(), options.units.name().to_string())]);
    let channel = writer.add_channel(schema, &options.topic, "json", &metadata).map_err(IoError::other)?;
    for (sequence, frame) in frames.iter().enumerate() {
        let scaled = |position: [f64; 3]| position.map(|coordinate| coordinate / options.units.mm());
        let finite = |position: &[f64; 3]| position.iter().all(|coordinate| coordinate.is_finite());
        let markers = names.iter().zip(&frame.positions_mm);
        let stamp = frame.stamp_ns;
        let message = Message {
            stamp: Stamp { sec: stamp.div_euclid(1_000_000_000), nsec: stamp.rem_euclid(1_000_000_000) },
            markers: markers
                .map(|(name, position)| Marker { name, position: position.map(scaled).filter(finite) })
                .collect(),
        };
        let time = u64::try_from(stamp).unwrap_or(0);
        let header =
            MessageHeader { channel_id: channel, sequence: sequence as u32, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &serde_json::to_vec(&message)?).map_err(IoError::other)?;
    }
    writer.finish().map_err(IoError::other)?;
    Ok(writer.into_inner().into_inner())
}
