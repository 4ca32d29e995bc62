//! Common Data Representation (XCDR1) of a message whose types are known.
//!
//! Four bytes of encapsulation, then the fields in a row. A number of n bytes starts at a multiple of n, counted
//! from the end of the encapsulation. A text is a 32-bit length that counts its closing zero, then the bytes;
//! a sequence is a 32-bit length, then the elements. Source: OMG DDS-XTypes 1.3, section 7.4.1.

use super::schema::{Count, Field, Kind, Types};
use crate::error::Fault;
use crate::markers::format::DecodeFault;

/// Bytes in front of the message that say how it is encoded.
const ENCAPSULATION: usize = 4;

/// Bytes that may follow the message: writers pad to their own word.
const PADDING: usize = 7;

/// The content of a field.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Bool(bool),
    Integer(i64),
    Unsigned(u64),
    Float(f64),
    Text(String),
    List(Vec<Value>),
    /// The fields of a message in the order of its declaration.
    Message(Vec<Value>),
}

/// Decodes one message; a fault says at which byte of the payload.
pub(super) fn decode(types: &Types, payload: &[u8]) -> Result<Value, DecodeFault> {
    let Some((head, body)) = payload.split_first_chunk::<ENCAPSULATION>() else {
        return Err(DecodeFault { byte: 0, fault: Fault::Short { needed: ENCAPSULATION, left: payload.len() } });
    };
    let little_endian = match head[..2] {
        [0, 0] => false,
        [0, 1] => true,
        _ => return Err(DecodeFault { byte: 0, fault: Fault::Encapsulation { id: [head[0], head[1]] } }),
    };
    let mut cursor = Cursor { types, body, at: 0, little_endian };
    let value = cursor.message(types.root()).map_err(|fault| cursor.here(fault))?;
    let left = body.len() - cursor.at;
    if left > PADDING {
        return Err(cursor.here(Fault::Left { bytes: left }));
    }
    Ok(value)
}

struct Cursor<'a> {
    types: &'a Types,
    body: &'a [u8],
    /// Never beyond the end of `body`.
    at: usize,
    little_endian: bool,
}

impl<'a> Cursor<'a> {
    fn here(&self, fault: Fault) -> DecodeFault {
        DecodeFault { byte: ENCAPSULATION + self.at, fault }
    }

    fn left(&self) -> usize {
        self.body.len() - self.at
    }

    fn take(&mut self, bytes: usize) -> Result<&'a [u8], Fault> {
        let taken = self.body.get(self.at..).and_then(|rest| rest.get(..bytes));
        let taken = taken.ok_or(Fault::Short { needed: bytes, left: self.left() })?;
        self.at += bytes;
        Ok(taken)
    }

    /// An unsigned number of `size` bytes (1, 2, 4 or 8) at its alignment.
    fn number(&mut self, size: usize) -> Result<u64, Fault> {
        self.take(self.at.next_multiple_of(size) - self.at)?;
        let bytes = self.take(size)?;
        let shift = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        Ok(match self.little_endian {
            true => bytes.iter().rev().fold(0, shift),
            false => bytes.iter().fold(0, shift),
        })
    }

    fn message(&mut self, index: usize) -> Result<Value, Fault> {
        let types = self.types;
        let fields = types.fields(index);
        if fields.is_empty() {
            // A message without fields is one byte on the wire.
            self.take(1)?;
        }
        fields.iter().map(|field| self.field(field)).collect::<Result<_, _>>().map(Value::Message)
    }

    fn field(&mut self, field: &Field) -> Result<Value, Fault> {
        let count = match field.count {
            Count::One => return self.one(&field.kind),
            Count::Fixed(count) => count,
            Count::Sequence(bound) => {
                let count = self.number(4)? as usize;
                if let Some(bound) = bound.filter(|bound| count > *bound) {
                    return Err(Fault::Bound { count, bound });
                }
                count
            }
        };
        // Every element takes at least a byte, so a mad count is seen before anything is reserved for it.
        if count > self.left() {
            return Err(Fault::Short { needed: count, left: self.left() });
        }
        (0..count).map(|_| self.one(&field.kind)).collect::<Result<_, _>>().map(Value::List)
    }

    fn one(&mut self, kind: &Kind) -> Result<Value, Fault> {
        Ok(match *kind {
            Kind::Bool => match self.number(1)? {
                0 => Value::Bool(false),
                1 => Value::Bool(true),
                _ => return Err(Fault::Bool),
            },
            Kind::Unsigned(size) => Value::Unsigned(self.number(size)?),
            Kind::Integer(size) => {
                let unused = 64 - 8 * size as u32;
                Value::Integer(((self.number(size)? << unused) as i64) >> unused)
            }
            Kind::Float(4) => Value::Float(f64::from(f32::from_bits(self.number(4)? as u32))),
            Kind::Float(_) => Value::Float(f64::from_bits(self.number(8)?)),
            Kind::Text(bound) => Value::Text(self.text(bound)?),
            Kind::Message(index) => self.message(index)?,
        })
    }

    fn text(&mut self, bound: Option<usize>) -> Result<String, Fault> {
        let bytes = self.number(4)? as usize;
        let bytes = self.take(bytes)?;
        // Some writers give the empty text no closing zero.
        let text = match bytes.split_last() {
            None => &[],
            Some((0, text)) => text,
            Some(_) => return Err(Fault::Text),
        };
        if let Some(bound) = bound.filter(|bound| text.len() > *bound) {
            return Err(Fault::Bound { count: text.len(), bound });
        }
        std::str::from_utf8(text).map(str::to_string).map_err(|_| Fault::Text)
    }
}
