//! The one error type. Every variant has a stable code, carries the numbers a reader needs, and a remedy.
//!
//! Codes: `C` problem file, `M` recording, `K` markers against the model, `G` geometry, `S` solver, `F` fit,
//! `O` output. A code never changes its meaning; a retired code is not used again.

use std::path::PathBuf;

use crate::markers::{Damage, Fault, Missing, Topic, Unguarded, Unreadable, list_topics};

/// The result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, with its numbers, place and units.
///
/// `Display` gives the message (what, where, how much); [`Error::code`] the stable code, [`Error::help`] the
/// edit or command that mends it, [`Error::exit_code`] what the process returns.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    // ---- C: problem file ------------------------------------------------------------------------------
    // ---- M: recording ---------------------------------------------------------------------------------
    /// The file is something else.
    #[error("{} is not an MCAP file: its {bytes} bytes start with `{}`", path.display(), start.escape_ascii())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        bytes: u64,
        /// Its first bytes, at most eight.
        start: Vec<u8>,
    },
    /// The bytes are not those that were written.
    #[error("{} is damaged: {record} at byte {offset}: {damage}", path.display())]
    DamagedRecording {
        /// The file.
        path: PathBuf,
        /// Start of the record, bytes.
        offset: u64,
        /// Kind of the record.
        record: &'static str,
        /// What is wrong.
        damage: Damage,
    },
    /// The file stops too early.
    #[error(
        "{} is cut short: {bytes} bytes, the record at byte {offset} is incomplete; \
         intact are {messages} messages, of them {frames} frames of markers over {seconds:.3} s",
        path.display()
    )]
    TruncatedRecording {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        bytes: u64,
        /// Start of the incomplete record, bytes.
        offset: u64,
        /// Intact messages of all topics.
        messages: u64,
        /// Intact frames of the markers; 0 if they cannot be told.
        frames: usize,
        /// Time they span, seconds.
        seconds: f64,
    },
    /// The writer computed no checksums, so damage would go unseen.
    #[error("damage in {} would go unseen: {part}", path.display())]
    UncheckedRecording {
        /// The file.
        path: PathBuf,
        /// What is under no checksum.
        part: Unguarded,
    },
    /// No topic carries markers.
    #[error("no topic of {} has markers; it holds {}", path.display(), list_topics(topics))]
    NoMarkerTopic {
        /// The file.
        path: PathBuf,
        /// All its topics.
        topics: Vec<Topic>,
    },
    /// More than one topic carries markers.
    #[error("several topics of {} have markers; it holds {}", path.display(), list_topics(topics))]
    SeveralMarkerTopics {
        /// The file.
        path: PathBuf,
        /// All its topics.
        topics: Vec<Topic>,
    },
    /// The topic asked for is not there.
    #[error("{} has no topic `{topic}`; it holds {}", path.display(), list_topics(topics))]
    TopicNotFound {
        /// The file.
        path: PathBuf,
        /// The topic asked for.
        topic: String,
        /// The topic with the most similar name.
        nearest: Option<String>,
        /// All its topics.
        topics: Vec<Topic>,
    },
    /// The topic asked for is not one of markers, or its schema cannot be used.
    #[error("topic `{topic}` of {} cannot be read: {reason}; it holds {}", path.display(), list_topics(topics))]
    TopicNotReadable {
        /// The file.
        path: PathBuf,
        /// The topic asked for.
        topic: String,
        /// Why.
        reason: Unreadable,
        /// All topics of the file.
        topics: Vec<Topic>,
    },
    /// The topic has no messages.
    #[error("topic `{topic}` of {} has 0 messages", path.display())]
    EmptyTopic {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
    },
    /// Every sample of every marker is missing.
    #[error(
        "topic `{topic}` of {} has no position at all in {frames} frames of {labels} markers; missing: {missing}",
        path.display()
    )]
    NoSamples {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Number of frames.
        frames: usize,
        /// Number of markers.
        labels: usize,
        /// Missing samples by kind.
        missing: Missing,
    },
    /// A message does not hold what its schema promises.
    #[error(
        "message {sequence} of `{topic}` in {} (log time {log_time_ns} ns) cannot be decoded: byte {byte}: {fault}",
        path.display()
    )]
    Undecodable {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Sequence number of the message.
        sequence: u32,
        /// When it was recorded, nanoseconds.
        log_time_ns: u64,
        /// Place in its payload, bytes.
        byte: usize,
        /// What is wrong.
        fault: Fault,
    },
    /// The message is encoded in another way than plain CDR.
    #[error(
        "message {sequence} of `{topic}` in {} is encoded as {} (0x{:02x}{:02x}), not as plain CDR",
        path.display(), encapsulation_name(*id), id[0], id[1]
    )]
    UnsupportedEncapsulation {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Sequence number of the message.
        sequence: u32,
        /// First two bytes of its payload.
        id: [u8; 2],
    },
    /// A frame that is to be written has not one position per label.
    #[error("frame {frame} has {positions} positions for {labels} labels")]
    FrameShape {
        /// The frame, from 0.
        frame: usize,
        /// Number of its positions.
        positions: usize,
        /// Number of labels.
        labels: usize,
    },
    // ---- K: markers against the model -----------------------------------------------------------------
    // ---- G: geometry ----------------------------------------------------------------------------------
    // ---- S: solver ------------------------------------------------------------------------------------
    /// The factorisation met a pivot that is not a finite number.
    #[error("the tangent matrix cannot be factorised: it holds a value that is not finite")]
    NotFinite,
    // ---- F: fit ---------------------------------------------------------------------------------------
    // ---- O: output ------------------------------------------------------------------------------------
    /// A file could not be read or written.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The verb: `read`, `write`, `create`, `rename`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
}

impl Error {
    /// The stable code, for example `S003`.
    pub fn code(&self) -> &'static str {
        match self {
            Error::NotMcap { .. } => "M001",
            Error::DamagedRecording { .. } => "M002",
            Error::TruncatedRecording { .. } => "M003",
            Error::UncheckedRecording { .. } => "M004",
            Error::NoMarkerTopic { .. } => "M005",
            Error::SeveralMarkerTopics { .. } => "M006",
            Error::TopicNotFound { .. } => "M007",
            Error::TopicNotReadable { .. } => "M008",
            Error::EmptyTopic { .. } => "M009",
            Error::NoSamples { .. } => "M010",
            Error::Undecodable { .. } => "M011",
            Error::UnsupportedEncapsulation { .. } => "M012",
            Error::FrameShape { .. } => "M013",
            Error::NotFinite => "S001",
            Error::Io { .. } => "O001",
        }
    }

    /// The edit or command that mends it, where one is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Error::NotMcap { .. } => {
                Some("give an MCAP file, as `ros2 bag record -s mcap` or Foxglove write it".into())
            }
            Error::DamagedRecording { .. } => Some(
                "copy the file again from where it was recorded, or save its good chunks with `mcap recover`".into(),
            ),
            Error::TruncatedRecording { .. } => {
                Some("copy the file again, or set `allow_truncated` to use the intact part".into())
            }
            Error::UncheckedRecording { .. } => {
                Some("rewrite it with checksums (`mcap recover IN -o OUT`), or set `allow_unchecked`".into())
            }
            Error::NoMarkerTopic { .. } => Some(
                "record `mocap4r2_msgs/msg/Markers` (CDR), or JSON with a JSON schema that has `markers[]`".into(),
            ),
            Error::SeveralMarkerTopics { topics, .. } => topics
                .iter()
                .find(|topic| topic.is_readable())
                .map(|topic| format!("name one of them: topic = \"{}\"", topic.name)),
            Error::TopicNotFound { nearest, .. } => {
                nearest.as_ref().map(|topic| format!("did you mean topic = \"{topic}\"?"))
            }
            Error::TopicNotReadable { topics, .. } => topics
                .iter()
                .find(|topic| topic.is_readable())
                .map(|topic| format!("this one can be read: topic = \"{}\"", topic.name)),
            Error::EmptyTopic { .. } => Some("record again: was the driver running?".into()),
            Error::NoSamples { missing, .. } => (missing.zero > 0)
                .then(|| "all markers lie at (0, 0, 0): if they really do, set `zero_is_missing = false`".into()),
            Error::Undecodable { .. } => Some(
                "the recorder stored another schema than the driver used: record again with matching messages".into(),
            ),
            Error::UnsupportedEncapsulation { .. } => {
                Some("record with a ROS 2 middleware that writes plain CDR, as rosbag2 does by default".into())
            }
            Error::FrameShape { .. } => Some("give every frame one position, or `None`, per label".into()),
            Error::NotFinite => None,
            Error::Io { .. } => Some("check that the path exists and that you may use it".into()),
        }
    }

    /// The exit code of the process: 3 invalid input, 4 not converged, 6 input or output failed.
    pub fn exit_code(&self) -> u8 {
        match self.code().as_bytes()[0] {
            b'S' | b'F' => 4,
            b'O' => 6,
            _ => 3,
        }
    }
}

/// The name of a CDR encapsulation, by its numbers in RTPS 2.5 and (from 0x10) in DDS-XTypes 1.2.
fn encapsulation_name(id: [u8; 2]) -> &'static str {
    match id {
        [0, 0 | 1] => "CDR",
        [0, 2 | 3] => "PL_CDR",
        [0, 6 | 7 | 0x10 | 0x11] => "XCDR2 (CDR2)",
        [0, 8 | 9 | 0x14 | 0x15] => "XCDR2 (D_CDR2)",
        [0, 10 | 11 | 0x12 | 0x13] => "XCDR2 (PL_CDR2)",
        _ => "something unknown",
    }
}
