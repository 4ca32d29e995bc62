//! A message as a tree of named fields, whatever it was encoded in: what CDR, JSON and protobuf have in common.

use super::fields::SchemaRecord;
use super::format::{DecodeFault, Sample, stamp_ns};
use super::protobuf::Protobuf;
use super::ros2::Cdr;
use crate::error::{Fault, Unreadable};
use crate::math::tensor::{Vector, add_scaled, cross, dot};

/// Turns the payload of a message into its fields.
pub(super) trait Payload {
    /// Decodes one message; a fault says at which byte.
    fn tree(&self, payload: &[u8]) -> Result<Tree, DecodeFault>;
}

/// What decodes messages of a schema, or why nothing does.
pub(super) fn payload(schema: &SchemaRecord, encoding: &str) -> Result<Box<dyn Payload>, Unreadable> {
    match (schema.encoding.as_str(), encoding) {
        ("ros2msg", "cdr") => Ok(Box::new(Cdr::new(schema)?)),
        ("jsonschema", "json") => Ok(Box::new(Json)),
        ("protobuf", "protobuf") => Ok(Box::new(Protobuf::new(schema)?)),
        _ => Err(Unreadable::Encoding),
    }
}

/// The content of a field.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Tree {
    /// `null`, or a message that was not set.
    Nothing,
    Flag(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    Bytes(Vec<u8>),
    List(Vec<Tree>),
    Fields(Vec<(String, Tree)>),
}

/// Position and orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placed {
    pub position: Vector,
    /// x, y, z, w; of unit length.
    pub orientation: [f64; 4],
}

/// A quaternion whose length is farther from one than this is none.
const UNIT: f64 = 1e-3;

impl Placed {
    /// Where a point of its frame is.
    pub fn place(&self, point: Vector) -> Vector {
        // p + 2 w (v x p) + 2 v x (v x p)
        let [x, y, z, w] = self.orientation;
        let v = [x, y, z];
        let once = cross(v, point);
        let turned = add_scaled(add_scaled(point, 2.0 * w, once), 2.0, cross(v, once));
        add_scaled(self.position, 1.0, turned)
    }
}

impl Tree {
    /// A field by its names, from the outside in: `header.stamp`.
    pub fn get(&self, path: &str) -> Option<&Tree> {
        path.split('.').try_fold(self, |tree, name| match tree {
            Tree::Fields(fields) => fields.iter().find(|(field, _)| field == name).map(|(_, value)| value),
            _ => None,
        })
    }

    pub fn number(&self) -> Option<f64> {
        match *self {
            Tree::Number(number) => Some(number),
            Tree::Integer(number) => Some(number as f64),
            // how JSON writes what it has no number for
            Tree::Text(ref text) if text == "NaN" => Some(f64::NAN),
            _ => None,
        }
    }

    pub fn integer(&self) -> Option<i64> {
        match *self {
            Tree::Integer(number) => Some(number),
            // JSON does not tell whole numbers apart
            Tree::Number(number) if number.fract() == 0.0 && number.abs() < 2_f64.powi(53) => Some(number as i64),
            _ => None,
        }
    }

    pub fn text(&self) -> Option<&str> {
        match self {
            Tree::Text(text) => Some(text),
            _ => None,
        }
    }

    pub fn list(&self) -> Option<&[Tree]> {
        match self {
            Tree::List(list) => Some(list),
            _ => None,
        }
    }

    /// Bytes; JSON has them in base64, CDR as a list.
    pub fn bytes(&self) -> Option<Vec<u8>> {
        match self {
            Tree::Bytes(bytes) => Some(bytes.clone()),
            Tree::Text(text) => base64(text),
            Tree::List(list) => list.iter().map(|byte| u8::try_from(byte.integer()?).ok()).collect(),
            _ => None,
        }
    }

    /// A field that the schema promises.
    pub fn field(&self, path: &str) -> Result<&Tree, Fault> {
        self.get(path).ok_or(Fault::Shape)
    }

    /// A whole number that the schema promises.
    pub fn whole(&self, path: &str) -> Result<i64, Fault> {
        self.field(path)?.integer().ok_or(Fault::Shape)
    }

    /// A list that the schema promises.
    pub fn elements(&self, path: &str) -> Result<&[Tree], Fault> {
        self.field(path)?.list().ok_or(Fault::Shape)
    }

    /// x, y, z; absent where one of them is `null` or the whole of it is.
    pub fn position(&self) -> Result<Sample, Fault> {
        if *self == Tree::Nothing {
            return Ok(Sample::Absent);
        }
        let mut position = [0.0; 3];
        for (x, name) in position.iter_mut().zip(["x", "y", "z"]) {
            match self.field(name)? {
                Tree::Nothing => return Ok(Sample::Absent),
                value => *x = value.number().ok_or(Fault::Shape)?,
            }
        }
        Ok(Sample::Position(position))
    }

    /// Position and orientation under these names. Without an orientation (not set, or all zero as drivers leave it that have
    /// none) nothing is turned.
    pub fn placed(&self, position: &str, orientation: &str) -> Result<Placed, Fault> {
        let Sample::Position(position) = self.field(position)?.position()? else { return Err(Fault::Shape) };
        let mut q = [0.0; 4];
        let orientation = self.field(orientation)?;
        if *orientation != Tree::Nothing {
            for (q, name) in q.iter_mut().zip(["x", "y", "z", "w"]) {
                *q = orientation.field(name)?.number().ok_or(Fault::Shape)?;
            }
        }
        if q == [0.0; 4] {
            q = [0.0, 0.0, 0.0, 1.0];
        }
        let length = q.iter().map(|q| q * q).sum::<f64>().sqrt();
        if (length - 1.0).abs() >= UNIT || length.is_nan() {
            return Err(Fault::Quaternion { length });
        }
        Ok(Placed { position, orientation: q.map(|q| q / length) })
    }

    /// The stamp in a field, nanoseconds: seconds and nanoseconds as ROS 2, Foxglove and protobuf call them.
    pub fn stamp(&self, path: &str) -> Result<Option<i64>, Fault> {
        let Some(stamp) = self.get(path).filter(|stamp| **stamp != Tree::Nothing) else { return Ok(None) };
        for [sec, nanosec] in [["sec", "nanosec"], ["sec", "nsec"], ["seconds", "nanos"]] {
            if let (Some(sec), Some(nanosec)) = (stamp.get(sec), stamp.get(nanosec)) {
                let (sec, nanosec) = (sec.integer().ok_or(Fault::Shape)?, nanosec.integer().ok_or(Fault::Shape)?);
                return stamp_ns(sec, nanosec).map(Some);
            }
        }
        Err(Fault::Shape)
    }
}

/// Whether a quaternion and a sign of it are the same turn; used to keep neighbours on one side.
pub(super) fn aligned(a: [f64; 4], b: [f64; 4]) -> bool {
    dot([a[0], a[1], a[2]], [b[0], b[1], b[2]]) + a[3] * b[3] >= 0.0
}

/// JSON messages.
struct Json;

impl Payload for Json {
    fn tree(&self, payload: &[u8]) -> Result<Tree, DecodeFault> {
        let value: serde_json::Value = serde_json::from_slice(payload).map_err(|error| DecodeFault {
            byte: super::json::byte_offset(payload, error.line(), error.column()),
            fault: Fault::Json { message: error.to_string() },
        })?;
        Ok(value.into())
    }
}

impl From<serde_json::Value> for Tree {
    fn from(value: serde_json::Value) -> Tree {
        use serde_json::Value;
        match value {
            Value::Null => Tree::Nothing,
            Value::Bool(flag) => Tree::Flag(flag),
            Value::Number(number) => match number.as_i64() {
                Some(whole) => Tree::Integer(whole),
                None => Tree::Number(number.as_f64().unwrap_or(f64::NAN)),
            },
            Value::String(text) => Tree::Text(text),
            Value::Array(list) => Tree::List(list.into_iter().map(Tree::from).collect()),
            Value::Object(fields) => Tree::Fields(fields.into_iter().map(|(name, v)| (name, v.into())).collect()),
        }
    }
}

/// The bytes of a text in base64 (RFC 4648), with its padding.
fn base64(text: &str) -> Option<Vec<u8>> {
    let digits = text.trim_end_matches('=');
    if !text.len().is_multiple_of(4) || text.len() - digits.len() > 2 {
        return None;
    }
    let digit = |c: u8| -> Option<u32> {
        Some(u32::from(match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        }))
    };
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 3);
    for group in digits.as_bytes().chunks(4) {
        let bits = group.iter().try_fold(0, |bits, c| Some(bits << 6 | digit(*c)?))?;
        let whole = bits << (6 * (4 - group.len()));
        bytes.extend(&whole.to_be_bytes()[1..group.len()]);
        // what is left of the last digit must be nothing
        if whole & ((1 << (8 * (4 - group.len()))) - 1) != 0 {
            return None;
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of RFC 4648, section 10, and what is none of it.
    #[test]
    fn base64_of_the_standard() {
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmE=", "fooba")] {
            assert_eq!(base64(text).as_deref(), Some(bytes.as_bytes()), "{text}");
        }
        for text in ["Zg", "Zg=", "Zh==", "Z===", "Zm9*", "====", "Zm9vé"] {
            assert_eq!(base64(text), None, "{text}");
        }
    }

    #[test]
    fn a_pose_turns_and_shifts() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let quarter = Placed { position: [1.0, 2.0, 3.0], orientation: [0.0, 0.0, half, half] };
        let placed = quarter.place([10.0, 0.0, 5.0]);
        assert!(placed.iter().zip([1.0, 12.0, 8.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{placed:?}");
    }
}
