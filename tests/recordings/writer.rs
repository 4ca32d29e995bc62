//! Writes recordings as other programs do: containers of every kind, ROS 2 markers in both layouts.
#![allow(dead_code)] // each test uses a part

use std::collections::BTreeMap;
use std::io::Cursor;

/// The schema text of `mocap4r2_msgs/msg/Markers`; `header` puts a header into each marker.
pub fn ros2_schema(header: bool) -> String {
    let line = "=".repeat(80);
    let header = if header { "std_msgs/Header header\n" } else { "" };
    format!(
        "std_msgs/Header header\nuint32 frame_number\nmocap4r2_msgs/Marker[] markers # all of them\n{line}\n\
         MSG: mocap4r2_msgs/Marker\nint8 USE_NAME=0\nint8 USE_INDEX=1\nint8 USE_BOTH = 2\n\n{header}int8 id_type\n\
         int32 marker_index\nstring marker_name\ngeometry_msgs/Point translation\n{line}\n\
         MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n{line}\n\
         MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{line}\n\
         MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
}

/// The JSON schema with `x`, `y`, `z` beside the name.
pub const COORDINATES_SCHEMA: &str = r#"{"title": "Foreign", "type": "object", "properties": {"timestamp": {"type": "object"},
    "unit": {"type": "string"}, "markers": {"type": "array", "items": {"type": "object", "properties":
    {"name": {"type": "string"}, "x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"}}}}}}"#;

/// The JSON schema with `position`.
pub const POSITIONS_SCHEMA: &str = r#"{"type": "object", "properties": {"stamp": {}, "markers": {"items": {"properties":
    {"name": {}, "position": {}}}}}}"#;

/// One marker of a ROS 2 message.
#[derive(Clone)]
pub struct Ros2Marker {
    pub id_type: i8,
    pub index: i32,
    pub name: String,
    pub translation: [f64; 3],
}

impl Ros2Marker {
    pub fn named(name: &str, translation: [f64; 3]) -> Self {
        Ros2Marker { id_type: 0, index: 0, name: name.into(), translation }
    }
}

/// CDR of `mocap4r2_msgs/msg/Markers`.
pub fn ros2_message(header: bool, big_endian: bool, stamp_ns: i64, markers: &[Ros2Marker]) -> Vec<u8> {
    let mut cdr = Cdr { body: Vec::new(), big_endian };
    cdr.header(stamp_ns);
    cdr.u32(7);
    cdr.u32(markers.len() as u32);
    for marker in markers {
        if header {
            cdr.header(stamp_ns);
        }
        cdr.body.push(marker.id_type as u8);
        cdr.u32(marker.index as u32);
        cdr.text(&marker.name);
        marker.translation.iter().for_each(|coordinate| cdr.f64(*coordinate));
    }
    let encapsulation = [0, u8::from(!big_endian), 0, 0];
    [&encapsulation[..], &cdr.body].concat()
}

/// Fields in CDR, one after the other.
pub struct Cdr {
    body: Vec<u8>,
    big_endian: bool,
}

impl Cdr {
    pub fn new() -> Cdr {
        Cdr { body: Vec::new(), big_endian: false }
    }

    /// The message with its encapsulation.
    pub fn message(self) -> Vec<u8> {
        [&[0, u8::from(!self.big_endian), 0, 0], &self.body[..]].concat()
    }

    pub fn header(&mut self, stamp_ns: i64) {
        self.stamp(stamp_ns);
        self.text("lab");
    }

    pub fn stamp(&mut self, stamp_ns: i64) {
        self.u32(stamp_ns.div_euclid(1_000_000_000) as u32);
        self.u32(stamp_ns.rem_euclid(1_000_000_000) as u32);
    }

    pub fn byte(&mut self, value: u8) {
        self.body.push(value);
    }

    fn align(&mut self, size: usize) {
        self.body.resize(self.body.len().next_multiple_of(size), 0);
    }

    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.body.extend(if self.big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
    }

    pub fn f64(&mut self, value: f64) {
        self.align(8);
        self.body.extend(if self.big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
    }

    pub fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.body.extend(text.as_bytes());
        self.body.push(0);
    }
}

/// A topic and its messages.
#[derive(Clone)]
pub struct Topic {
    pub name: &'static str,
    pub schema: (&'static str, &'static str, Vec<u8>),
    pub encoding: &'static str,
    pub unit: Option<&'static str>,
    pub messages: Vec<Message>,
}

/// Times in nanoseconds.
#[derive(Clone)]
pub struct Message {
    pub log_time: u64,
    pub publish_time: u64,
    pub payload: Vec<u8>,
}

impl Topic {
    pub fn ros2(header: bool, messages: Vec<Message>) -> Topic {
        let schema = ("mocap4r2_msgs/msg/Markers", "ros2msg", ros2_schema(header).into());
        Topic { name: "/markers", schema, encoding: "cdr", unit: None, messages }
    }

    pub fn json(schema: &str, messages: Vec<Message>) -> Topic {
        let schema = ("Markers", "jsonschema", schema.into());
        Topic { name: "/markers", schema, encoding: "json", unit: None, messages }
    }

    pub fn named(self, name: &'static str) -> Topic {
        Topic { name, ..self }
    }
}

/// The container kinds that must be read.
pub const CONTAINERS: [&str; 4] = ["none", "lz4", "zstd", "unchunked"];

/// Writer options of a container, small chunks.
pub fn container(kind: &str) -> mcap::WriteOptions {
    let options = mcap::WriteOptions::new().chunk_size(Some(2048)).compression_threads(0);
    match kind {
        "none" => options.compression(None),
        "lz4" => options.compression(Some(mcap::Compression::Lz4)),
        "zstd" => options.compression(Some(mcap::Compression::Zstd)),
        "unchunked" => options.compression(None).use_chunks(false),
        other => unreachable!("{other}"),
    }
}

/// A whole MCAP file.
pub fn file(options: mcap::WriteOptions, topics: &[Topic]) -> Vec<u8> {
    let mut writer = options.library("test").create(Cursor::new(Vec::new())).unwrap();
    for topic in topics {
        let (name, encoding, text) = &topic.schema;
        let schema = match *encoding {
            "" => 0,
            encoding => writer.add_schema(name, encoding, text).unwrap(),
        };
        let metadata: BTreeMap<_, _> = topic.unit.iter().map(|unit| ("unit".into(), unit.to_string())).collect();
        let channel_id = writer.add_channel(schema, topic.name, topic.encoding, &metadata).unwrap();
        for (sequence, message) in topic.messages.iter().enumerate() {
            let Message { log_time, publish_time, payload } = message;
            let (log_time, publish_time) = (*log_time, *publish_time);
            let header =
                mcap::records::MessageHeader { channel_id, sequence: sequence as u32, log_time, publish_time };
            writer.write_to_known_channel(&header, payload).unwrap();
        }
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// The file with the CRC of every chunk set to "not computed" and the CRC of the data section made good again.
/// (`mcap` 0.26 itself then leaves the chunks out of the CRC of the data section.)
pub fn without_chunk_crcs(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut at = mcap::MAGIC.len();
    loop {
        let body = at + 9;
        let length = u64::from_le_bytes(bytes[at + 1..body].try_into().unwrap()) as usize;
        match bytes[at] {
            mcap::records::op::CHUNK => bytes[body + 24..body + 28].fill(0),
            mcap::records::op::DATA_END => {
                let mut crc = flate2::Crc::new();
                crc.update(&bytes[..at]);
                bytes[body..body + 4].copy_from_slice(&crc.sum().to_le_bytes());
                return bytes;
            }
            _ => {}
        }
        at = body + length;
    }
}

/// The file, written without CRCs of its sections, with copies of the schema and channel records of its summary put
/// in front of its first chunk, as some writers do. Returns where they are, bytes.
pub fn with_definitions_outside_chunks(bytes: &[u8]) -> (Vec<u8>, std::ops::Range<usize>) {
    let record = |at: usize| u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize + 9;
    let start = mcap::MAGIC.len() + record(mcap::MAGIC.len());
    let footer = bytes.len() - mcap::MAGIC.len() - 20;
    let summary = u64::from_le_bytes(bytes[footer..footer + 8].try_into().unwrap());
    let (mut copies, mut at) = (Vec::new(), summary as usize);
    while at < footer - 9 {
        if [mcap::records::op::SCHEMA, mcap::records::op::CHANNEL].contains(&bytes[at]) {
            copies.extend(&bytes[at..at + record(at)]);
        }
        at += record(at);
    }
    let mut result = [&bytes[..start], &copies, &bytes[start..]].concat();
    let footer = footer + copies.len();
    result[footer..footer + 8].copy_from_slice(&(summary + copies.len() as u64).to_le_bytes());
    (result, start..start + copies.len())
}
