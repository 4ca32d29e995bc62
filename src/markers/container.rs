//! The MCAP container, read with distrust: every byte that decides a value is guarded by a checksum.
//!
//! The top level is walked here over the raw bytes, so that every complaint has an offset; the bodies of records
//! are cut here too (`mcap::parse_record` panics on a short attachment). The crate decompresses the chunks and
//! checks their CRC before it hands out the first record.
//!
//! What guards what (<https://mcap.dev/spec>):
//!
//! | bytes | guard |
//! |---|---|
//! | records inside a chunk | CRC of the chunk, or of the data section |
//! | records outside chunks | CRC of the data section |
//! | schemas and channels outside chunks | their copy in the summary, or the CRC of the data section |
//! | that no chunk is lost | number of messages or chunks in the summary, or the CRC of the data section |
//!
//! A CRC of 0 means "not computed". Where no guard is left the container says so: [`Container::unguarded`].

use std::collections::BTreeMap;
use std::path::Path;

use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::fields::{self, ChannelRecord, Fields, SchemaRecord};
use crate::error::{Damage, Error, Result, Unguarded};

/// Longest decompressed chunk that is accepted (bytes): one flipped bit can ask for a petabyte.
const CHUNK_LIMIT: usize = 256 << 20;

/// Opcode and length in front of every record (bytes).
const RECORD_HEADER: usize = 9;

/// One message of a topic that was asked for.
pub(super) struct Message {
    pub channel: u16,
    pub sequence: u32,
    /// Nanoseconds.
    pub log_time: u64,
    /// Nanoseconds.
    pub publish_time: u64,
    pub payload: Vec<u8>,
}

/// How many messages a channel has and when (log time, ns).
#[derive(Clone, Copy)]
pub(super) struct Traffic {
    pub messages: u64,
    pub first: u64,
    pub last: u64,
}

/// Where an incomplete file stops.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    /// Start of the record that is not complete, bytes.
    pub offset: u64,
    /// Length of the file, bytes.
    pub bytes: u64,
}

/// What an MCAP file holds.
#[derive(Default)]
pub(super) struct Container {
    pub schemas: BTreeMap<u16, SchemaRecord>,
    pub channels: BTreeMap<u16, ChannelRecord>,
    pub traffic: BTreeMap<u16, Traffic>,
    /// Messages of the channels that were asked for, in the order of the file.
    pub messages: Vec<Message>,
    /// Number of chunks by compression; empty for a file without chunks.
    pub compression: BTreeMap<String, u64>,
    pub chunks_without_crc: u64,
    pub truncated: Option<Cut>,
    /// Set when a flipped bit could go unseen.
    pub unguarded: Option<Unguarded>,
}

impl Container {
    /// Reads `bytes`; `path` is for messages only. Payloads are kept for the channels that `wanted` accepts.
    pub fn read(
        path: &Path,
        bytes: &[u8],
        wanted: &dyn Fn(&ChannelRecord, Option<&SchemaRecord>) -> bool,
    ) -> Result<Container> {
        if !bytes.starts_with(mcap::MAGIC) {
            let start = bytes.iter().take(mcap::MAGIC.len()).copied().collect();
            return Err(Error::NotMcap { path: path.into(), bytes: bytes.len() as u64, start });
        }
        let walk = Walk { wanted, found: Container::default(), keep: BTreeMap::new(), guarded: Guarded::default() };
        walk.file(bytes).map_err(|(offset, record, damage)| Error::DamagedRecording {
            path: path.into(),
            offset: offset as u64,
            record: fields::record_name(record),
            damage,
        })
    }

    /// Sum of all messages, of every channel.
    pub fn message_count(&self) -> u64 {
        self.traffic.values().map(|traffic| traffic.messages).sum()
    }
}

/// Offset and opcode of the record with the damage.
type Damaged<T> = std::result::Result<T, (usize, u8, Damage)>;

/// Where a record stands.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    TopLevel,
    Chunk { checked: bool },
    Summary,
}

/// What has been seen to be safe without the CRC of the data section.
#[derive(Default)]
struct Guarded {
    schemas: BTreeMap<u16, bool>,
    channels: BTreeMap<u16, bool>,
    chunks: u64,
    chunk_indexes: u64,
    declared_messages: Option<u64>,
    unchecked_messages: u64,
}

struct Walk<'a> {
    wanted: &'a dyn Fn(&ChannelRecord, Option<&SchemaRecord>) -> bool,
    found: Container,
    /// Answers of `wanted`, one per channel.
    keep: BTreeMap<u16, bool>,
    guarded: Guarded,
}

impl Walk<'_> {
    fn file(mut self, bytes: &[u8]) -> Damaged<Container> {
        let mut at = mcap::MAGIC.len();
        let closed = bytes[at..].ends_with(mcap::MAGIC);
        // Start of the summary section and whether the data section had a CRC, once its end is seen.
        let mut data_end: Option<(usize, bool)> = None;
        loop {
            let rest = &bytes[at..];
            let Some((opcode, body)) = split_record(at, rest, closed)? else {
                return Ok(self.cut(at, bytes.len(), data_end.is_some_and(|(_, crc)| crc)));
            };
            let damaged = |damage| (at, opcode, damage);
            let next = at + RECORD_HEADER + body.len();
            match (opcode, data_end) {
                (fields::DATA_END, None) => {
                    let stored = Fields::new(body).u32().map_err(damaged)?;
                    check_crc("data section", stored, &[&bytes[..at]]).map_err(damaged)?;
                    data_end = Some((next, stored != 0));
                }
                (fields::FOOTER, Some((summary, data_crc))) => {
                    let mut footer = Fields::new(body);
                    let (start, _) = (footer.u64().map_err(damaged)?, footer.u64().map_err(damaged)?);
                    let stored = footer.u32().map_err(damaged)?;
                    footer.end().map_err(damaged)?;
                    // An empty summary is announced by a start of 0.
                    if start != summary as u64 && !(start == 0 && summary == at) {
                        return Err(damaged(Damage::SummaryStart { declared: start, found: summary as u64 }));
                    }
                    check_crc("summary section", stored, &[&bytes[summary..next - 4]]).map_err(damaged)?;
                    return match &bytes[next..] {
                        end if end == mcap::MAGIC => self.complete(at, data_crc),
                        end if mcap::MAGIC.starts_with(end) => Ok(self.cut(next, bytes.len(), data_crc)),
                        _ => Err(damaged(Damage::EndMagic)),
                    };
                }
                (fields::DATA_END | fields::FOOTER, _) => return Err(damaged(Damage::Misplaced)),
                (fields::CHUNK, None) => self.chunk(&bytes[at..next], body).map_err(damaged)?,
                (fields::CHUNK | fields::MESSAGE | fields::MESSAGE_INDEX | fields::ATTACHMENT, Some(_)) => {
                    return Err(damaged(Damage::Misplaced));
                }
                (_, None) => self.record(opcode, body, Place::TopLevel).map_err(damaged)?,
                (_, Some(_)) => self.record(opcode, body, Place::Summary).map_err(damaged)?,
            }
            at = next;
        }
    }

    fn chunk(&mut self, record: &[u8], body: &[u8]) -> std::result::Result<(), Damage> {
        let mut header = Fields::new(body);
        let (_start_time, _end_time) = (header.u64()?, header.u64()?);
        let (uncompressed, crc) = (header.u64()?, header.u32()?);
        let compression = header.text()?.to_string();
        let length = header.u64()?;
        let records = header.rest();
        if length != records.len() as u64 {
            return Err(Damage::Length { declared: length, found: records.len() as u64 });
        }
        if uncompressed > CHUNK_LIMIT as u64 {
            return Err(Damage::TooLong { length: uncompressed, limit: CHUNK_LIMIT as u64 });
        }
        self.guarded.chunks += 1;
        let place = Place::Chunk { checked: crc != 0 };
        if crc == 0 && uncompressed > 0 {
            self.found.chunks_without_crc += 1;
        }
        if compression.is_empty() {
            if uncompressed != length {
                return Err(Damage::Length { declared: uncompressed, found: length });
            }
            check_crc("chunk", crc, &[records])?;
            let mut at = 0;
            while at < records.len() {
                let Ok(Some((opcode, inner))) = split_record(at, &records[at..], true) else {
                    return Err(Damage::Malformed);
                };
                self.record(opcode, inner, place)?;
                at += RECORD_HEADER + inner.len();
            }
        } else {
            self.compressed(record, place)?;
        }
        *self.found.compression.entry(compression_name(&compression).into()).or_default() += 1;
        Ok(())
    }

    /// Records of one compressed chunk; `record` is the whole chunk record with its opcode and length.
    fn compressed(&mut self, record: &[u8], place: Place) -> std::result::Result<(), Damage> {
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(CHUNK_LIMIT);
        let mut reader = LinearReader::new_with_options(options);
        let mut rest = record;
        while let Some(event) = reader.next_event() {
            match event.map_err(Damage::from)? {
                LinearReadEvent::ReadRequest(asked) => {
                    let (now, later) = rest.split_at(asked.min(rest.len()));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    rest = later;
                }
                LinearReadEvent::Record { opcode, data } => self.record(opcode, data, place)?,
            }
        }
        Ok(())
    }

    /// Any record but chunks and the two ends.
    fn record(&mut self, opcode: u8, body: &[u8], place: Place) -> std::result::Result<(), Damage> {
        let safe = matches!(place, Place::Summary | Place::Chunk { checked: true });
        match (opcode, place) {
            (fields::SCHEMA, _) => {
                let (id, schema) = SchemaRecord::read(body)?;
                *self.guarded.schemas.entry(id).or_default() |= safe;
                let known = self.found.schemas.entry(id).or_insert_with(|| schema.clone());
                if *known != schema {
                    return Err(Damage::Conflict { what: "schema", id });
                }
            }
            (fields::CHANNEL, _) => {
                let (id, channel) = ChannelRecord::read(body)?;
                *self.guarded.channels.entry(id).or_default() |= safe;
                let known = self.found.channels.entry(id).or_insert_with(|| channel.clone());
                if *known != channel {
                    return Err(Damage::Conflict { what: "channel", id });
                }
            }
            (fields::MESSAGE, _) => {
                self.guarded.unchecked_messages += u64::from(!safe);
                self.message(body)?;
            }
            (fields::CHUNK_INDEX, Place::Summary) => self.guarded.chunk_indexes += 1,
            (fields::STATISTICS, Place::Summary) => {
                self.guarded.declared_messages = Some(Fields::new(body).u64()?);
            }
            (fields::HEADER | fields::MESSAGE_INDEX | fields::ATTACHMENT | fields::METADATA, Place::TopLevel)
            | (fields::ATTACHMENT_INDEX | fields::METADATA_INDEX | fields::SUMMARY_OFFSET, Place::Summary) => {}
            // 0x80 and above are private records of other programs.
            (0x80.., _) => {}
            _ => return Err(Damage::Opcode { opcode }),
        }
        Ok(())
    }

    fn message(&mut self, body: &[u8]) -> std::result::Result<(), Damage> {
        let mut header = Fields::new(body);
        let (channel, sequence) = (header.u16()?, header.u32()?);
        let (log_time, publish_time) = (header.u64()?, header.u64()?);
        let Some(declared) = self.found.channels.get(&channel) else {
            return Err(Damage::Undefined { what: "channel", id: channel });
        };
        let schema = self.found.schemas.get(&declared.schema);
        if schema.is_none() && declared.schema != 0 {
            return Err(Damage::Undefined { what: "schema", id: declared.schema });
        }
        let traffic = self.found.traffic.entry(channel);
        let traffic = traffic.or_insert(Traffic { messages: 0, first: log_time, last: log_time });
        traffic.messages += 1;
        traffic.first = traffic.first.min(log_time);
        traffic.last = traffic.last.max(log_time);
        if *self.keep.entry(channel).or_insert_with(|| (self.wanted)(declared, schema)) {
            let payload = header.rest().to_vec();
            self.found.messages.push(Message { channel, sequence, log_time, publish_time, payload });
        }
        Ok(())
    }

    /// A whole file: compares with the counts of the summary and says what is not guarded.
    fn complete(mut self, footer: usize, data_crc: bool) -> Damaged<Container> {
        let found = self.found.message_count();
        let miscount = |what, declared, found| (footer, fields::FOOTER, Damage::Count { what, declared, found });
        if let Some(declared) = self.guarded.declared_messages.filter(|declared| *declared != found) {
            return Err(miscount("messages", declared, found));
        }
        let (indexes, chunks) = (self.guarded.chunk_indexes, self.guarded.chunks);
        if indexes != 0 && indexes != chunks {
            return Err(miscount("chunks", indexes, chunks));
        }
        if !data_crc {
            let counted = self.guarded.declared_messages.is_some() || indexes != 0;
            self.found.unguarded = self.unguarded().or((!counted).then_some(Unguarded::Completeness));
        }
        Ok(self.found)
    }

    /// A file that stops inside the record at `offset`.
    fn cut(mut self, offset: usize, bytes: usize, data_crc: bool) -> Container {
        self.found.truncated = Some(Cut { offset: offset as u64, bytes: bytes as u64 });
        self.found.unguarded = if data_crc { None } else { self.unguarded() };
        self.found
    }

    /// What a flipped bit could change unseen when the data section has no CRC.
    fn unguarded(&self) -> Option<Unguarded> {
        if self.guarded.unchecked_messages > 0 {
            let all = self.found.message_count();
            return Some(Unguarded::Messages { unchecked: self.guarded.unchecked_messages, all });
        }
        let safe = |of: &BTreeMap<u16, bool>, id: &u16| of.get(id).is_some_and(|safe| *safe);
        let defined = self.found.traffic.keys().all(|id| {
            let schema = self.found.channels.get(id).map_or(0, |channel| channel.schema);
            safe(&self.guarded.channels, id) && (schema == 0 || safe(&self.guarded.schemas, &schema))
        });
        (!defined).then_some(Unguarded::Definitions)
    }
}

/// The name of a compression; MCAP says nothing where it means `none`.
fn compression_name(name: &str) -> &str {
    if name.is_empty() { "none" } else { name }
}

/// Opcode and body of the record at the front of `rest`; `None` when the file ends inside it. A record that runs
/// over the end of a file with its closing magic (`closed`) is damage.
fn split_record(at: usize, rest: &[u8], closed: bool) -> Damaged<Option<(u8, &[u8])>> {
    let opcode = rest.first().copied().unwrap_or(0);
    let length = Fields::new(rest.get(1..).unwrap_or(&[])).u64().ok();
    let body = length.and_then(|length| {
        let end = usize::try_from(length).ok()?.checked_add(RECORD_HEADER)?;
        rest.get(RECORD_HEADER..end)
    });
    match (body, length) {
        (Some(body), _) => Ok(Some((opcode, body))),
        (None, _) if !closed => Ok(None),
        (None, Some(length)) => {
            Err((at, opcode, Damage::Overrun { length, available: (rest.len() - RECORD_HEADER) as u64 }))
        }
        (None, None) => Err((at, opcode, Damage::Malformed)),
    }
}

/// CRC-32 (IEEE) of the parts in a row against the stored one; 0 means "not computed".
fn check_crc(part: &'static str, stored: u32, parts: &[&[u8]]) -> std::result::Result<(), Damage> {
    if stored == 0 {
        return Ok(());
    }
    let mut crc = flate2::Crc::new();
    parts.iter().for_each(|bytes| crc.update(bytes));
    if crc.sum() == stored { Ok(()) } else { Err(Damage::Checksum { part, stored, computed: crc.sum() }) }
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
