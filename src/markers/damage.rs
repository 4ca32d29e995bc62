//! What can be wrong with the bytes of an MCAP file.

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

impl From<mcap::McapError> for Damage {
    fn from(error: mcap::McapError) -> Self {
        match error {
            mcap::McapError::BadChunkCrc { saved, calculated } => {
                Damage::Checksum { part: "chunk", stored: saved, computed: calculated }
            }
            mcap::McapError::UnsupportedCompression(name) => Damage::Compression { name },
            other => Damage::Decompression { reason: other.to_string() },
        }
    }
}

/// A part of a file in which a flipped bit would go unseen, because its writer computed no checksum.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, serde::Serialize)]
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
