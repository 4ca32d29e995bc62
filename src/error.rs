//! The one error type. Every variant has a stable code, carries the numbers a reader needs, and a remedy.
//!
//! Codes: `C` problem file, `M` recording, `K` markers against the model, `G` geometry, `S` solver, `F` fit,
//! `O` output. A code never changes its meaning; a retired code is not used again.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use crate::markers::{Damage, Fault, Missing, Topic, Unguarded, Unreadable, list_topics};

/// The result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, with its numbers, place and units. Below 128 bytes, since every `Result` carries it.
///
/// `Display` gives the message (what, where, how much); [`Error::code`] the stable code, [`Error::help`] the
/// edit or command that mends it, [`Error::exit_code`] what the process returns.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    // ---- C: problem file ------------------------------------------------------------------------------
    /// Every mistake of a file at once, in the order of its lines.
    #[error("{} mistakes:{}", .0.len(), .0.iter().map(one_line).collect::<String>())]
    Mistakes(Vec<Error>),
    /// The text cannot be read as TOML (or as UTF-8) at all.
    #[error("the file is not valid TOML: {message}")]
    Syntax {
        /// What the parser met and what it expected.
        message: String,
        /// Where it met it.
        place: Place,
    },
    /// A key that means nothing in its table.
    #[error("unknown key `{key}` in {table}")]
    UnknownKey {
        /// The key as written.
        key: Box<str>,
        /// The table that holds it.
        table: String,
        /// The nearest known key, or all of them.
        help: String,
        /// The key.
        place: Place,
    },
    /// A table lacks keys that have no default.
    #[error("{table} lacks {keys}")]
    MissingKey {
        /// The table that should hold them.
        table: String,
        /// The missing keys, each in backticks.
        keys: Box<str>,
        /// What to add.
        help: String,
        /// The header of the table.
        place: Place,
    },
    /// A value of the wrong kind, for example text where a number belongs.
    #[error("`{key}` must be {expected}, but this is {found}")]
    WrongType {
        /// The key, as a path from the root of the file.
        key: String,
        /// What belongs there.
        expected: String,
        /// What stands there.
        found: Box<str>,
        /// The value.
        place: Place,
    },
    /// A number outside what it may be.
    #[error("`{key}` = {value} is not allowed: it must be {allowed}")]
    OutOfRange {
        /// The key, as a path from the root of the file.
        key: String,
        /// The value as written.
        value: Box<str>,
        /// The allowed range, in words.
        allowed: String,
        /// The value.
        place: Place,
    },
    /// A word that is not among the words a key may hold.
    #[error("`{key}` cannot be \"{value}\"")]
    UnknownChoice {
        /// The key, as a path from the root of the file.
        key: String,
        /// The word as written.
        value: Box<str>,
        /// The nearest allowed word, and all of them.
        help: String,
        /// The word.
        place: Place,
    },
    /// A list with too few or too many entries.
    #[error("`{key}` has {found}, but needs {expected}")]
    WrongLength {
        /// The key, as a path from the root of the file.
        key: String,
        /// How many there are, with what is counted.
        found: Box<str>,
        /// How many are needed, and why.
        expected: String,
        /// The list.
        place: Place,
    },
    /// Two things of a kind share a name.
    #[error("a second {kind} is called `{name}`: the first is in line {first_line}")]
    DuplicateName {
        /// What carries the name: `muscle`, `probe`, `marker`, `column`.
        kind: &'static str,
        /// The shared name.
        name: String,
        /// The line (from 1) that used it first.
        first_line: u32,
        /// The second use.
        place: Place,
    },
    /// A name that refers to nothing.
    #[error("no {kind} is called `{name}`")]
    UnknownName {
        /// What should carry the name: `muscle`, `column`.
        kind: &'static str,
        /// The name as written.
        name: String,
        /// The nearest name, or all of them.
        help: String,
        /// The name.
        place: Place,
    },
    /// Something that is planned, and that this version cannot do.
    #[error("`{key}` ({what}) is not in this version of risorius")]
    NotInThisVersion {
        /// The key or word.
        key: String,
        /// What it will do.
        what: &'static str,
        /// What can be used today.
        instead: String,
        /// The key or word.
        place: Place,
    },
    /// A table that must hold exactly one of several keys holds none or more than one.
    #[error("{table} must hold exactly one of {choices}, but holds {found}")]
    NotExactlyOne {
        /// The table.
        table: String,
        /// The keys to choose from.
        choices: String,
        /// The chosen ones, or `none`.
        found: Box<str>,
        /// The header of the table.
        place: Place,
    },
    /// A file that the problem names does not exist.
    #[error("`{key}` names a file that does not exist: {}", path.display())]
    MissingFile {
        /// The key, as a path from the root of the file.
        key: String,
        /// The full path that was tried.
        path: PathBuf,
        /// The path as written.
        place: Place,
    },
    /// A `--set key=value` that cannot be applied to the problem.
    #[error("{message}")]
    BadOverride {
        /// What stands in the way.
        message: String,
        /// A form that would do.
        help: String,
        /// The part of the argument that is at fault.
        place: Place,
    },
    /// Times of a table of curves do not increase.
    #[error("time {time_s} s follows {previous_s} s: times must increase from row to row")]
    TimeOrder {
        /// The time of this row, s.
        time_s: f64,
        /// The time of the row before, s.
        previous_s: f64,
        /// The time of this row.
        place: Place,
    },
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
    /// The factorisation met a pivot that is exactly zero, or whose inverse overflows.
    #[error("the tangent matrix is singular: no pivot is left for unknown {unknown}")]
    Singular {
        /// Number of the unknown, counted from 0 after the supports have been removed.
        unknown: usize,
    },
    /// The factor of the tangent matrix does not fit into memory.
    #[error("no memory for the factor of the tangent matrix: {unknowns} unknowns, {entries} entries of 8 bytes")]
    FactorTooLarge {
        /// Number of unknowns.
        unknowns: usize,
        /// Entries of the triangular factor.
        entries: usize,
    },
    /// A solve was asked of a factor that was never filled, or whose last factorisation failed.
    #[error("the tangent matrix has not been factorised")]
    NotFactored,
    /// Newton's method found no equilibrium on the way to the asked load and controls.
    #[error(
        "no equilibrium beyond {:.4} of the way to the asked load and controls ({reason}; step cut {cuts} times, now {step:.1e})\n  worst point: element {element}, Gauss point {point}: det F = {det_f:.4}; residual {residual:.2e} mN, required {required:.1e} mN",
        reached
    )]
    NotConverged {
        /// Part of the way, 0 to 1, at which the last equilibrium was found.
        reached: f64,
        /// How often the step was cut.
        cuts: usize,
        /// The length of the step that failed.
        step: f64,
        /// Why Newton's method stopped.
        reason: &'static str,
        /// Host element of the smallest det F in the last iterate.
        element: usize,
        /// Its Gauss point, first direction fastest.
        point: usize,
        /// det F there.
        det_f: f64,
        /// Norm of the residual in the last iterate, mN.
        residual: f64,
        /// The norm required, mN.
        required: f64,
    },
    /// A refined solution of a linear system is not accurate enough.
    #[error(
        "a linear system was solved to a relative residual of {residual:.1e}, required {required:.1e}: the tangent is close to singular"
    )]
    InaccurateSolve {
        /// Relative residual reached.
        residual: f64,
        /// Relative residual required.
        required: f64,
    },
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
    /// The folder asked for holds something already.
    #[error("the output folder {} is not empty: it holds {entries} files or folders", path.display())]
    FolderNotEmpty {
        /// The folder.
        path: PathBuf,
        /// What is in it.
        entries: usize,
    },
}

impl Error {
    /// One error for a list of mistakes: the mistake itself if there is one, otherwise [`Error::Mistakes`].
    pub fn all(mut mistakes: Vec<Error>) -> Error {
        if mistakes.len() == 1 { mistakes.remove(0) } else { Error::Mistakes(mistakes) }
    }

    /// The single mistakes: those of [`Error::Mistakes`], or this error alone.
    pub fn mistakes(&self) -> &[Error] {
        match self {
            Error::Mistakes(mistakes) => mistakes,
            _ => std::slice::from_ref(self),
        }
    }

    /// The stable code, for example `S003`.
    pub fn code(&self) -> &'static str {
        match self {
            Error::Mistakes(_) => "C000",
            Error::Syntax { .. } => "C001",
            Error::UnknownKey { .. } => "C002",
            Error::MissingKey { .. } => "C003",
            Error::WrongType { .. } => "C004",
            Error::OutOfRange { .. } => "C005",
            Error::UnknownChoice { .. } => "C006",
            Error::WrongLength { .. } => "C007",
            Error::DuplicateName { .. } => "C008",
            Error::UnknownName { .. } => "C009",
            Error::NotInThisVersion { .. } => "C010",
            Error::NotExactlyOne { .. } => "C011",
            Error::MissingFile { .. } => "C012",
            Error::BadOverride { .. } => "C013",
            Error::TimeOrder { .. } => "C014",
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
            Error::NotConverged { .. } => "S003",
            Error::InaccurateSolve { .. } => "S004",
            Error::Singular { .. } => "S010",
            Error::FactorTooLarge { .. } => "S011",
            Error::NotFactored => "S012",
            Error::Io { .. } => "O001",
            Error::FolderNotEmpty { .. } => "O002",
        }
    }

    /// The edit or command that mends it, where one is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Error::Mistakes(_) | Error::OutOfRange { .. } | Error::WrongLength { .. } => None,
            Error::Syntax { message, .. } => syntax_help(message),
            Error::UnknownKey { help, .. }
            | Error::MissingKey { help, .. }
            | Error::UnknownChoice { help, .. }
            | Error::UnknownName { help, .. }
            | Error::BadOverride { help, .. } => Some(help.clone()),
            Error::WrongType { expected, found, key, .. } => wrong_type_help(key, expected, found),
            Error::DuplicateName { kind, .. } => Some(format!("give every {kind} its own name")),
            Error::NotInThisVersion { instead, .. } => Some(instead.clone()),
            Error::NotExactlyOne { found, .. } if &**found == "none" => Some("add the one you mean".into()),
            Error::NotExactlyOne { .. } => Some("keep one; write a table of its own for every other".into()),
            Error::MissingFile { .. } => Some("a relative path starts at the folder of the problem file".into()),
            Error::TimeOrder { .. } => Some("sort the rows by time, and keep one row per time".into()),
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
            Error::InaccurateSolve { .. } => {
                Some("the body is at a limit point or held too little: check the supports and the path".into())
            }
            Error::NotConverged { .. } => Some(
                "the last equilibrium is kept; try shorter steps (--set solver.step_max=0.05), a volumetric term \
                 (--set tissue.kappa_kpa=10), a finer mesh where det F is small, or a smaller load"
                    .into(),
            ),
            Error::Singular { .. } => {
                Some("hold the body: check that the supports prevent every rigid motion".into())
            }
            Error::FactorTooLarge { .. } => Some("use a coarser mesh or a machine with more memory".into()),
            Error::NotFactored => None,
            Error::Io { .. } => Some("check that the path exists and that you may use it".into()),
            Error::FolderNotEmpty { .. } => {
                Some("choose another --out, or add --force to replace the run that is in it".into())
            }
        }
    }

    /// The place in a text that caused it, where there is one.
    pub fn place(&self) -> Option<&Place> {
        match self {
            Error::Syntax { place, .. }
            | Error::UnknownKey { place, .. }
            | Error::MissingKey { place, .. }
            | Error::WrongType { place, .. }
            | Error::OutOfRange { place, .. }
            | Error::UnknownChoice { place, .. }
            | Error::WrongLength { place, .. }
            | Error::DuplicateName { place, .. }
            | Error::UnknownName { place, .. }
            | Error::NotInThisVersion { place, .. }
            | Error::NotExactlyOne { place, .. }
            | Error::MissingFile { place, .. }
            | Error::BadOverride { place, .. }
            | Error::TimeOrder { place, .. } => Some(place),
            _ => None,
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

/// A mistake as a line of a list.
fn one_line(mistake: &Error) -> String {
    let place = mistake.place().map(|place| format!("{place}: ")).unwrap_or_default();
    format!("\n  {place}{} {mistake}", mistake.code())
}

/// The remedy for the classic slips of TOML.
fn syntax_help(message: &str) -> Option<String> {
    const REMEDIES: [(&str, &str); 8] = [
        ("duplicate key", "keep one of the two; a table that may come several times is written [[name]]"),
        ("must be quoted", "write text in quotes: \"...\""),
        ("invalid boolean", "write text in quotes: \"...\""),
        ("string, expected `\"`", "the quote that ends the text is missing"),
        ("unclosed table", "close the header with ]"),
        ("unquoted key", "put a key with other characters in quotes: \"...\" = "),
        ("missing comma", "look for a comma, bracket or brace that is missing just before"),
        ("array", "look for a comma or bracket that is missing here or in a line before"),
    ];
    REMEDIES.iter().find(|(words, _)| message.contains(words)).map(|(_, remedy)| remedy.to_string())
}

/// The remedy for the classic confusions between kinds of value.
fn wrong_type_help(key: &str, expected: &str, found: &str) -> Option<String> {
    let quoted = found.strip_prefix("text \"").and_then(|text| text.strip_suffix('"'));
    let quoted_number = quoted.is_some_and(|text| text.trim().parse::<f64>().is_ok());
    if expected.ends_with("number") && quoted_number {
        Some("write the number without quotes".into())
    } else if expected.starts_with("text") && !found.starts_with("text") {
        Some("write it in quotes".into())
    } else if expected == "a list of tables" && found == "a table" {
        Some(format!("write its header in double brackets: [[{key}]]"))
    } else if expected == "a table" && found == "a list of tables" {
        Some(format!("there is only one of it: write its header in single brackets, [{key}]"))
    } else {
        None
    }
}

/// A place in a text that was read: what a message points at.
///
/// Everything built from a problem file keeps the place it came from, so that a mistake found much later (a muscle
/// outside its host) can still show the line to edit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it, or `command line`.
    pub file: Arc<str>,
    /// The whole line, without its end.
    pub text: Arc<str>,
    /// The line, counted from 1; 0 means the file as a whole.
    pub line: u32,
    /// The column of the first character, counted from 1 in characters.
    pub column: u32,
    /// The number of characters meant, at least 1.
    pub length: u32,
}

impl Place {
    /// A file as a whole: something is missing from it.
    pub fn whole(file: &str) -> Place {
        Place { file: file.into(), text: "".into(), line: 0, column: 0, length: 1 }
    }

    /// The bytes `span` of the line `text`, which is number `line` (from 1) of `file`. A span that leaves the line,
    /// or that cuts a character, is narrowed to the line.
    pub fn on_line(file: &Arc<str>, line: usize, text: &str, span: Range<usize>) -> Place {
        let start = text.floor_char_boundary(span.start);
        let end = text.floor_char_boundary(span.end).max(start);
        let count = |part: &str| u32::try_from(part.chars().count()).unwrap_or(u32::MAX);
        Place {
            file: Arc::clone(file),
            line: u32::try_from(line).unwrap_or(u32::MAX),
            column: count(&text[..start]).saturating_add(1),
            length: count(&text[start..end]).max(1),
            text: text.into(),
        }
    }

    /// From the start of this place to the end of `other`, if that is on the same line; otherwise `other`.
    pub fn until(&self, other: &Place) -> Place {
        if (&self.file, self.line) != (&other.file, other.line) || other.column < self.column {
            return other.clone();
        }
        Place { length: other.column - self.column + other.length, ..self.clone() }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            0 => write!(out, "{}", self.file),
            line => write!(out, "{}:{line}:{}", self.file, self.column),
        }
    }
}

/// Something that does not stop a run, and that its reader must know. Under `--strict` it ends the run.
///
/// Codes share the letters and the numbers of [`Error::code`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// The stable code.
    pub code: &'static str,
    /// What was noticed, with its number and unit.
    pub message: String,
    /// Where, if it comes from a text.
    pub place: Option<Place>,
    /// What to do about it, where something is to be done.
    pub help: Option<String>,
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
