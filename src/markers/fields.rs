//! The fields of MCAP records: little-endian numbers, length-prefixed texts and maps.

use std::collections::BTreeMap;

use crate::error::Damage;

pub(super) const HEADER: u8 = 0x01;
pub(super) const FOOTER: u8 = 0x02;
pub(super) const SCHEMA: u8 = 0x03;
pub(super) const CHANNEL: u8 = 0x04;
pub(super) const MESSAGE: u8 = 0x05;
pub(super) const CHUNK: u8 = 0x06;
pub(super) const MESSAGE_INDEX: u8 = 0x07;
pub(super) const CHUNK_INDEX: u8 = 0x08;
pub(super) const ATTACHMENT: u8 = 0x09;
pub(super) const ATTACHMENT_INDEX: u8 = 0x0a;
pub(super) const STATISTICS: u8 = 0x0b;
pub(super) const METADATA: u8 = 0x0c;
pub(super) const METADATA_INDEX: u8 = 0x0d;
pub(super) const SUMMARY_OFFSET: u8 = 0x0e;
pub(super) const DATA_END: u8 = 0x0f;

/// The name of a kind of record, for messages.
pub(super) fn record_name(opcode: u8) -> &'static str {
    const NAMES: [&str; 15] = [
        "header",
        "footer",
        "schema",
        "channel",
        "message",
        "chunk",
        "message index",
        "chunk index",
        "attachment",
        "attachment index",
        "statistics",
        "metadata",
        "metadata index",
        "summary offset",
        "end of data",
    ];
    let index = usize::from(opcode).wrapping_sub(1);
    NAMES.get(index).copied().unwrap_or("record of unknown kind")
}

/// What a message looks like, as its writer described it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SchemaRecord {
    pub name: String,
    /// `ros2msg`, `jsonschema`, ...
    pub encoding: String,
    pub text: Vec<u8>,
}

impl SchemaRecord {
    pub fn read(body: &[u8]) -> Result<(u16, SchemaRecord), Damage> {
        let mut fields = Fields::new(body);
        let id = fields.u16()?;
        let (name, encoding) = (fields.text()?.to_string(), fields.text()?.to_string());
        let text = fields.bytes()?.to_vec();
        Ok((id, SchemaRecord { name, encoding, text }))
    }
}

/// A topic and how its messages are written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChannelRecord {
    /// Number of the schema; 0 is "none".
    pub schema: u16,
    pub topic: String,
    /// `cdr`, `json`, ...
    pub encoding: String,
    pub metadata: BTreeMap<String, String>,
}

impl ChannelRecord {
    pub fn read(body: &[u8]) -> Result<(u16, ChannelRecord), Damage> {
        let mut fields = Fields::new(body);
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (topic, encoding) = (fields.text()?.to_string(), fields.text()?.to_string());
        let mut pairs = Fields::new(fields.bytes()?);
        let mut metadata = BTreeMap::new();
        while !pairs.rest().is_empty() {
            let (key, value) = (pairs.text()?.to_string(), pairs.text()?.to_string());
            metadata.insert(key, value);
        }
        Ok((id, ChannelRecord { schema, topic, encoding, metadata }))
    }
}

/// A cursor over the body of one record.
pub(super) struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub fn new(rest: &'a [u8]) -> Self {
        Fields { rest }
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Damage> {
        let (now, later) = self.rest.split_first_chunk::<N>().ok_or(Damage::Malformed)?;
        self.rest = later;
        Ok(*now)
    }

    pub fn u16(&mut self) -> Result<u16, Damage> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, Damage> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, Damage> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes behind a 32-bit length.
    pub fn bytes(&mut self) -> Result<&'a [u8], Damage> {
        let length = self.u32()? as usize;
        let (now, later) = self.rest.split_at_checked(length).ok_or(Damage::Malformed)?;
        self.rest = later;
        Ok(now)
    }

    pub fn text(&mut self) -> Result<&'a str, Damage> {
        std::str::from_utf8(self.bytes()?).map_err(|_| Damage::Malformed)
    }

    /// Everything that has not been read.
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Nothing may be left.
    pub fn end(&self) -> Result<(), Damage> {
        if self.rest.is_empty() { Ok(()) } else { Err(Damage::Malformed) }
    }
}
