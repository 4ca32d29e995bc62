//! JSON markers with a JSON schema: our own `risorius.Markers`, and messages with `x`, `y`, `z` beside the name.
//!
//! ```text
//! {"stamp": {"sec": 1, "nsec": 5}, "markers": [{"name": "M01", "position": [1.0, 2.0, 3.0]}]}
//! {"timestamp": {"sec": 1, "nsec": 5}, "unit": "mm", "markers": [{"name": "M01", "x": 1.0, "y": 2.0, "z": 3.0, "valid": true}]}
//! ```
//!
//! The properties in the schema tell which of the two it is. `null` or nothing at all is a missing position.

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::fields::SchemaRecord;
use super::format::{DecodeFault, Decoder, Format, Observation, Sample, stamp_ns};
use crate::error::{Fault, Unreadable};

/// Messages that are JSON objects with an array `markers`.
pub(super) struct Json;

impl Format for Json {
    fn name(&self) -> &'static str {
        "json markers"
    }

    fn decoder(&self, schema: &SchemaRecord, encoding: &str) -> Result<Box<dyn Decoder>, Unreadable> {
        if schema.encoding != "jsonschema" || encoding != "json" {
            return Err(Unreadable::Encoding);
        }
        let schema: serde_json::Value = serde_json::from_slice(&schema.text)
            .map_err(|error| Unreadable::NotJson { line: error.line(), column: error.column() })?;
        let marker = &schema["properties"]["markers"]["items"]["properties"];
        let has = |name: &str| marker.get(name).is_some();
        if has("name") && has("position") {
            Ok(Box::new(Positions))
        } else if ["name", "x", "y", "z"].into_iter().all(has) {
            Ok(Box::new(Coordinates))
        } else {
            Err(Unreadable::Layout { expected: "`markers[]` with `name` and `position`, or `name`, `x`, `y`, `z`" })
        }
    }
}

/// Markers with `position: [x, y, z]`.
struct Positions;

/// Markers with `x`, `y`, `z` and perhaps `valid`.
struct Coordinates;

#[derive(Deserialize)]
struct Message<Marker> {
    #[serde(alias = "timestamp")]
    stamp: Option<Stamp>,
    unit: Option<String>,
    markers: Vec<Marker>,
}

#[derive(Deserialize)]
struct Stamp {
    sec: i64,
    #[serde(alias = "nanosec")]
    nsec: i64,
}

#[derive(Deserialize)]
struct PositionMarker {
    name: String,
    position: Option<[Option<f64>; 3]>,
}

#[derive(Deserialize)]
struct CoordinateMarker {
    name: String,
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
    valid: Option<bool>,
}

impl From<PositionMarker> for (String, Sample) {
    fn from(marker: PositionMarker) -> Self {
        let sample = match marker.position {
            Some([Some(x), Some(y), Some(z)]) => Sample::Position([x, y, z]),
            _ => Sample::Absent,
        };
        (marker.name, sample)
    }
}

impl From<CoordinateMarker> for (String, Sample) {
    fn from(marker: CoordinateMarker) -> Self {
        let sample = match (marker.x, marker.y, marker.z) {
            _ if marker.valid == Some(false) => Sample::Invalid,
            (Some(x), Some(y), Some(z)) => Sample::Position([x, y, z]),
            _ => Sample::Absent,
        };
        (marker.name, sample)
    }
}

impl Decoder for Positions {
    fn decode(&self, payload: &[u8]) -> Result<Observation, DecodeFault> {
        decode::<PositionMarker>(payload)
    }
}

impl Decoder for Coordinates {
    fn decode(&self, payload: &[u8]) -> Result<Observation, DecodeFault> {
        decode::<CoordinateMarker>(payload)
    }
}

fn decode<Marker>(payload: &[u8]) -> Result<Observation, DecodeFault>
where
    Marker: DeserializeOwned + Into<(String, Sample)>,
{
    let message: Message<Marker> = serde_json::from_slice(payload).map_err(|error| DecodeFault {
        byte: byte_offset(payload, error.line(), error.column()),
        fault: Fault::Json { message: error.to_string() },
    })?;
    let stamp_ns = message.stamp.map(|stamp| stamp_ns(stamp.sec, stamp.nsec)).transpose();
    Ok(Observation {
        stamp_ns: stamp_ns.map_err(|fault| DecodeFault { byte: 0, fault })?,
        unit: message.unit,
        samples: message.markers.into_iter().map(Into::into).collect(),
    })
}

/// Offset of a line (from 1) and a column (from 1; 0 at the start of a line).
pub(super) fn byte_offset(text: &[u8], line: usize, column: usize) -> usize {
    let lines = text.split_inclusive(|byte| *byte == b'\n').take(line.saturating_sub(1));
    lines.map(<[u8]>::len).sum::<usize>() + column.saturating_sub(1)
}
