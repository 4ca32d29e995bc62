//! What can be wrong with a recording of markers: plain data carried by the errors `M001` to `M013`.

use std::fmt;

use serde::Serialize;

/// A fault of the container, found before any marker is decoded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Damage {
    /// The bytes are not those that were written.
    #[error("checksum of the {part} is {computed:08x}, stored is {stored:08x}")]
    Checksum {
        /// `chunk`, `data section` or `summary section`.
        part: &'static str,
        /// CRC-32 in the file.
        stored: u32,
        /// CRC-32 of the bytes in the file.
        computed: u32,
    },
    /// A record is longer than the file.
    #[error("the record says it is {length} bytes long, {available} are left")]
    Overrun {
        /// Declared length, bytes.
        length: u64,
        /// Bytes left.
        available: u64,
    },
    /// A chunk asks for more memory than is allowed.
    #[error("the chunk says it is {length} bytes long once decompressed, the limit is {limit}")]
    TooLong {
        /// Declared length, bytes.
        length: u64,
        /// Accepted length, bytes.
        limit: u64,
    },
    /// Two lengths disagree.
    #[error("declared length {declared} bytes, found {found}")]
    Length {
        /// Declared length, bytes.
        declared: u64,
        /// Real length, bytes.
        found: u64,
    },
    /// The fields do not fit into the record.
    #[error("its fields do not fit into its length")]
    Malformed,
    /// The kind of the record is unknown, or not allowed at this place.
    #[error("a record of kind 0x{opcode:02x} cannot stand here")]
    Opcode {
        /// Kind of the record.
        opcode: u8,
    },
    /// The order of records is wrong, or the end of the data section is missing.
    #[error("the record cannot stand here: data section, its end, summary and footer are out of order")]
    Misplaced,
    /// The footer points somewhere else.
    #[error("the summary starts at byte {found}, the footer says {declared}")]
    SummaryStart {
        /// Offset in the footer, bytes.
        declared: u64,
        /// Real offset, bytes.
        found: u64,
    },
    /// The closing eight bytes are wrong.
    #[error("the file does not end with the eight bytes of an MCAP file")]
    EndMagic,
    /// The summary counts more or fewer.
    #[error("the summary counts {declared} {what}, the file holds {found}")]
    Count {
        /// `messages` or `chunks`.
        what: &'static str,
        /// Number in the summary.
        declared: u64,
        /// Number in the file.
        found: u64,
    },
    /// Two copies of a definition differ.
    #[error("two definitions of {what} {id} differ")]
    Conflict {
        /// `schema` or `channel`.
        what: &'static str,
        /// Its number in the file.
        id: u16,
    },
    /// A definition is missing.
    #[error("{what} {id} is used and not defined")]
    Undefined {
        /// `schema` or `channel`.
        what: &'static str,
        /// Its number in the file.
        id: u16,
    },
    /// The chunk is compressed by something else.
    #[error("compression `{name}` is none of none, lz4, zstd")]
    Compression {
        /// Name in the file.
        name: String,
    },
    /// The chunk cannot be decompressed.
    #[error("the chunk cannot be decompressed: {reason}")]
    Decompression {
        /// What the decompressor said.
        reason: String,
    },
}

/// A part of a file in which a flipped bit would go unseen, because its writer computed no checksum.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unguarded {
    /// Messages under neither the CRC of a chunk nor of the data section.
    #[error("{unchecked} of {all} messages are under no checksum")]
    Messages {
        /// Messages under no checksum.
        unchecked: u64,
        /// All messages.
        all: u64,
    },
    /// Schemas or channels under no checksum and without a copy to compare.
    #[error("schemas or channels are under no checksum")]
    Definitions,
    /// Nothing says how many chunks or messages there should be.
    #[error("nothing says how many messages there should be")]
    Completeness,
}

/// One topic of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Name of its schema; empty if it has none.
    pub schema: String,
    /// Encoding of the schema, for example `ros2msg`.
    pub schema_encoding: String,
    /// Encoding of its messages, for example `cdr`.
    pub message_encoding: String,
    /// Number of messages.
    pub messages: u64,
    /// Log time of the first and the last message, nanoseconds.
    pub log_time_ns: Option<[u64; 2]>,
    /// The marker format that reads it, or why none does.
    pub markers: std::result::Result<String, String>,
}

impl Topic {
    /// Whether its markers can be read.
    pub fn is_readable(&self) -> bool {
        self.markers.is_ok()
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Topic { name, schema, schema_encoding, message_encoding, messages, .. } = self;
        write!(f, "`{name}`: {schema} ({message_encoding}, {schema_encoding}), {messages} messages, ")?;
        match &self.markers {
            Ok(format) => write!(f, "readable as {format}"),
            Err(reason) => write!(f, "not readable: {reason}"),
        }
    }
}

/// Topics one per line, for messages.
pub(super) fn list_topics(topics: &[Topic]) -> String {
    match topics {
        [] => "no topics at all".into(),
        topics => topics.iter().map(|topic| format!("\n  {topic}")).collect(),
    }
}

/// Why no format reads a topic.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unreadable {
    /// No format has this pair of schema encoding and message encoding.
    #[error("no marker format has this encoding")]
    Encoding,
    /// The channel has no schema.
    #[error("it has no schema")]
    NoSchema,
    /// The schema describes something else.
    #[error("its schema has not {expected}")]
    Layout {
        /// The fields looked for.
        expected: &'static str,
    },
    /// The schema cannot be read.
    #[error("{0}")]
    Schema(#[from] SchemaFault),
    /// The descriptors of protobuf messages cannot be used.
    #[error("its protobuf descriptors cannot be used: {message}")]
    Descriptors {
        /// What is wrong.
        message: String,
    },
    /// The schema is not JSON.
    #[error("its schema is not JSON (line {line}, column {column})")]
    NotJson {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
    },
}

/// Why a schema text cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SchemaFault {
    /// The text is not UTF-8.
    #[error("the schema is not text")]
    NotText,
    /// A line is not a field, a constant, a comment or a separator.
    #[error("schema line {line} is not a field: `{text}`")]
    Line {
        /// Line, from 1.
        line: usize,
        /// The line.
        text: String,
    },
    /// A type is used and not defined.
    #[error("the schema uses `{name}` and does not define it")]
    Undefined {
        /// Name of the type.
        name: String,
    },
    /// A type is defined twice.
    #[error("the schema defines `{name}` twice")]
    Twice {
        /// Name of the type.
        name: String,
    },
    /// Types contain each other, or are nested too deeply.
    #[error("`{name}` contains itself or is nested more than {limit} deep")]
    Nesting {
        /// Name of the type.
        name: String,
        /// Deepest nesting accepted.
        limit: usize,
    },
}

/// What is wrong with a message.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// The message ends too early.
    #[error("{needed} more bytes expected, {left} left")]
    Short {
        /// Bytes (or elements of at least a byte) that should follow.
        needed: usize,
        /// Bytes that follow.
        left: usize,
    },
    /// The message is longer than its schema says.
    #[error("{bytes} bytes are left over")]
    Left {
        /// Bytes behind the last field.
        bytes: usize,
    },
    /// More elements than the schema allows.
    #[error("{count} elements, the schema allows {bound}")]
    Bound {
        /// Elements in the message.
        count: usize,
        /// Largest number allowed.
        bound: usize,
    },
    /// A truth value that is neither 0 nor 1.
    #[error("a truth value is neither 0 nor 1")]
    Bool,
    /// A text without its closing zero, or not UTF-8.
    #[error("a text is not closed or not UTF-8")]
    Text,
    /// An encoding other than plain CDR; has its own error.
    #[error("encapsulation {:02x}{:02x}", id[0], id[1])]
    Encapsulation {
        /// The first two bytes.
        id: [u8; 2],
    },
    /// A time stamp that is none.
    #[error("the time stamp {sec} s + {nanosec} ns is out of range")]
    Stamp {
        /// Seconds.
        sec: i64,
        /// Nanoseconds, below 1e9 in a good stamp.
        nanosec: i64,
    },
    /// A field is not of the expected kind.
    #[error("the fields are not those of the schema")]
    Shape,
    /// An orientation that is none.
    #[error("an orientation has the length {length}, not 1")]
    Quaternion {
        /// Length of the quaternion.
        length: f64,
    },
    /// Parts of a message stand in different coordinate frames.
    #[error("its parts stand in different coordinate frames, `{a}` and `{b}`")]
    Frames {
        /// One of them.
        a: String,
        /// Another.
        b: String,
    },
    /// The message is not protobuf.
    #[error("{message}")]
    Protobuf {
        /// What the reader said.
        message: String,
    },
    /// The message is not the JSON that its schema promises.
    #[error("{message}")]
    Json {
        /// What the JSON reader said.
        message: String,
    },
}

/// Missing samples by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Missing {
    /// Not in the message, or without a position there.
    pub absent: usize,
    /// NaN or infinite.
    pub not_finite: usize,
    /// Exactly (0, 0, 0).
    pub zero: usize,
    /// Marked as not valid by the message.
    pub invalid: usize,
    /// The label stands more than once in the message.
    pub ambiguous: usize,
}

impl Missing {
    /// Of all kinds together.
    pub fn total(&self) -> usize {
        self.absent + self.not_finite + self.zero + self.invalid + self.ambiguous
    }

    /// Sum of two counts.
    pub(crate) fn plus(self, other: Missing) -> Missing {
        Missing {
            absent: self.absent + other.absent,
            not_finite: self.not_finite + other.not_finite,
            zero: self.zero + other.zero,
            invalid: self.invalid + other.invalid,
            ambiguous: self.ambiguous + other.ambiguous,
        }
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Missing { absent, not_finite, zero, invalid, ambiguous } = *self;
        let kinds = [
            (absent, "absent"),
            (not_finite, "not finite"),
            (zero, "at (0, 0, 0)"),
            (invalid, "marked invalid"),
            (ambiguous, "with their label twice"),
        ];
        let found = kinds.iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}"));
        let found: Vec<_> = found.collect();
        f.write_str(if found.is_empty() { "none" } else { "" })?;
        f.write_str(&found.join(", "))
    }
}

/// The name of a CDR encapsulation, by its numbers in RTPS 2.5 and (from 0x10) in DDS-XTypes 1.2.
pub(super) fn encapsulation_name(id: [u8; 2]) -> &'static str {
    match id {
        [0, 0 | 1] => "CDR",
        [0, 2 | 3] => "PL_CDR",
        [0, 6 | 7 | 0x10 | 0x11] => "XCDR2 (CDR2)",
        [0, 8 | 9 | 0x14 | 0x15] => "XCDR2 (D_CDR2)",
        [0, 10 | 11 | 0x12 | 0x13] => "XCDR2 (PL_CDR2)",
        _ => "something unknown",
    }
}
