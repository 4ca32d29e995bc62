//! What a marker format is, and the list of them. To add one: a file with its `Format`, and a line in [`FORMATS`].

use super::fields::SchemaRecord;
use super::json::Json;
use super::named::{MARKER_ARRAY, POINT_CLOUD, POSE_ARRAY, SCENE_UPDATE};
use super::ros2::Ros2;
use crate::error::{Fault, Unreadable};

/// Every format, asked in this order.
const FORMATS: [&dyn Format; 6] = [&Ros2, &Json, &MARKER_ARRAY, &POSE_ARRAY, &POINT_CLOUD, &SCENE_UPDATE];

/// A way in which messages carry markers. The schema in the file decides whether it is this one.
pub(super) trait Format: Sync {
    /// The name in messages and reports.
    fn name(&self) -> &'static str;

    /// A decoder for messages of this schema and encoding, or why there is none.
    fn decoder(&self, schema: &SchemaRecord, encoding: &str) -> Result<Box<dyn Decoder>, Unreadable>;
}

/// Turns the payload of a message into marker samples.
pub(super) trait Decoder {
    /// Decodes one message; a fault says at which byte.
    fn decode(&self, payload: &[u8]) -> Result<Observation, DecodeFault>;
}

/// The markers of one message.
#[derive(Debug)]
pub(super) struct Observation {
    /// Time in the message itself, nanoseconds.
    pub stamp_ns: Option<i64>,
    /// The unit the message says it is in.
    pub unit: Option<String>,
    /// Label (empty: unlabelled) and what was seen.
    pub samples: Vec<(String, Sample)>,
}

/// One marker at one time, in the unit of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sample {
    Position([f64; 3]),
    /// The message names the marker and gives no position.
    Absent,
    /// The message says that the position does not count.
    Invalid,
}

/// A message that does not hold what its schema promises.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DecodeFault {
    /// Place in the payload, bytes.
    pub byte: usize,
    pub fault: Fault,
}

/// Nanoseconds of a stamp in two parts.
pub(super) fn stamp_ns(sec: i64, nanosec: i64) -> Result<i64, Fault> {
    let whole = || sec.checked_mul(1_000_000_000)?.checked_add(nanosec);
    let stamp = if (0..1_000_000_000).contains(&nanosec) { whole() } else { None };
    stamp.ok_or(Fault::Stamp { sec, nanosec })
}

/// Name and decoder of the format that reads messages of this schema and encoding.
pub(super) fn decoder(
    schema: Option<&SchemaRecord>,
    encoding: &str,
) -> Result<(&'static str, Box<dyn Decoder>), Unreadable> {
    let schema = schema.ok_or(Unreadable::NoSchema)?;
    let mut reason = Unreadable::Encoding;
    for format in FORMATS {
        match format.decoder(schema, encoding) {
            Ok(decoder) => return Ok((format.name(), decoder)),
            Err(Unreadable::Encoding) => {}
            Err(other) => reason = other,
        }
    }
    Err(reason)
}
