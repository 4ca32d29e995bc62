//! The one error type. Every variant has a stable code, carries the numbers a reader needs, and a remedy.
//!
//! Codes: `C` problem file, `M` recording, `K` markers against the model, `G` geometry, `S` solver, `F` fit,
//! `O` output. A code never changes its meaning; a retired code is not used again. Every code has a page in [`explain`].

pub mod explain;
mod likely;
mod place;
mod recording;
mod registration;
mod remedy;

use std::path::PathBuf;

pub use likely::Likely;
pub use place::{Place, Warning};
pub use recording::{Damage, Fault, Missing, SchemaFault, Topic, Unguarded, Unreadable};
use recording::{encapsulation_name, list_topics};
pub use registration::{Cause, Misregistration, neutral_named};

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
    /// An error of a file that the problem names, with the line that names it; its code, help and exit code are its own.
    #[error("{}", .0.0)]
    Named(Box<(Error, Place)>),
    // ---- M: recording ---------------------------------------------------------------------------------
    /// The file is something else.
    #[error("{} is not an MCAP file: {}", path.display(), start_of(*bytes, start))]
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
    /// A marker file is not what its format asks for.
    #[error("{} cannot be read: {at}: {message}", path.display())]
    MarkerFile {
        /// The file.
        path: PathBuf,
        /// Where: `line 7`, `byte 512`.
        at: Box<str>,
        /// What is wrong there.
        message: Box<str>,
    },
    /// Neither the file nor the user says in which unit its positions are.
    #[error(
        "{} does not say in which unit its positions are{}",
        path.display(),
        if declared.is_empty() { String::new() } else { format!(" (it says: {declared})") }
    )]
    NoUnits {
        /// The file.
        path: PathBuf,
        /// What it says.
        declared: Box<str>,
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
    /// The recording is larger or smaller than the model by a power of ten that a wrong unit explains.
    #[error(
        "marker units look wrong: over {labels} matched labels the recording, read as {declared}, is {ratio:.3} times the size of the model (nothing was converted)"
    )]
    UnitsLookWrong {
        /// Size of the recording over size of the model.
        ratio: f64,
        /// Labels compared.
        labels: usize,
        /// The unit in the problem file.
        declared: &'static str,
        /// The unit that would explain the ratio, if one does.
        likely: Option<&'static str>,
        /// The unit in the problem file.
        place: Box<Place>,
    },
    /// A marker of the problem is not in the recording.
    #[error("the recording has no marker `{name}`; its labels are {labels}")]
    UnknownLabel {
        /// The marker's name.
        name: Box<str>,
        /// The first labels of the recording.
        labels: Box<str>,
        /// The label that is nearest in spelling.
        nearest: Option<Box<str>>,
        /// The marker in the problem file.
        place: Box<Place>,
    },
    /// The recording does not have the first or the last frame that a fit asks for.
    #[error("the recording has {count} frames, 0 to {}: there is no frame {frame}", count.saturating_sub(1))]
    NoSuchFrame {
        /// Frame asked for, from 0.
        frame: usize,
        /// Frames of the recording.
        count: usize,
        /// The frames in the problem file.
        place: Box<Place>,
    },
    /// A marker lies far from the surface of the host.
    #[error(
        "marker `{name}` is {distance:.2} mm from the surface of the host, more than max_marker_distance_mm = {limit}"
    )]
    MarkerFarFromSurface {
        /// The marker's name.
        name: Box<str>,
        /// Distance to the surface, mm.
        distance: f64,
        /// The limit, mm.
        limit: f64,
        /// The foot on the surface, mm.
        foot: [f64; 3],
        /// The marker in the problem file.
        place: Box<Place>,
    },
    /// There are no markers to match, or fewer than three in the recording.
    #[error("there is nothing to match: a [fit] with three [[marker]] and a recording that shows three are needed")]
    NothingToMatch {
        /// The problem file, or the recording in it.
        place: Box<Place>,
    },
    /// The recording does not lie on the model.
    #[error("{0}")]
    Misregistered(Box<Misregistration>),
    // ---- G: geometry ----------------------------------------------------------------------------------
    /// The reference geometry of the host is inverted.
    #[error("the mesh is inverted: element {element} at xi ({:.3}, {:.3}, {:.3}) has det(dX/dxi) = {det:.3e} mm3", xi[0], xi[1], xi[2])]
    InvertedMesh {
        /// Element index.
        element: usize,
        /// Local coordinates of the worst quadrature point.
        xi: [f64; 3],
        /// det(dX/dxi) there, mm3.
        det: f64,
        /// The mesh in the problem file.
        place: Box<Place>,
    },
    /// Quadrature points of a muscle lie outside the host.
    #[error("muscle `{}`: {} of its {} quadrature points lie outside the host, the farthest by {:.3} mm: element {} near ({:.2}, {:.2}, {:.2}) mm", .0.muscle, .0.count, .0.of, .0.distance, .0.element, .0.position[0], .0.position[1], .0.position[2])]
    MuscleOutside(Box<MuscleOutside>),
    /// An element of a muscle's own mesh is inverted.
    #[error("muscle `{muscle}`: element {element} of its mesh is inverted: det(dX/deta) = {det:.3e} mm3")]
    InvertedMuscle {
        /// Its name.
        muscle: Box<str>,
        /// Element of the muscle.
        element: usize,
        /// det(dX/deta), mm3.
        det: f64,
        /// The muscle in the problem file.
        place: Box<Place>,
    },
    /// A probe lies outside the host.
    #[error("probe `{name}` lies outside the host, {distance:.3} mm from its nearest point ({:.3}, {:.3}, {:.3}) mm", nearest[0], nearest[1], nearest[2])]
    ProbeOutside {
        /// Its name.
        name: Box<str>,
        /// Distance to the host, mm.
        distance: f64,
        /// The nearest point, mm.
        nearest: [f64; 3],
        /// The probe in the problem file.
        place: Box<Place>,
    },
    /// Two supports prescribe different motions where they meet.
    #[error("two supports prescribe different motions at node {node}, ({:.2}, {:.2}, {:.2}) mm; the other one is at {other}", position[0], position[1], position[2])]
    SupportsDisagree {
        /// The node where they meet.
        node: usize,
        /// Its position, mm.
        position: [f64; 3],
        /// The first of the two in the problem file.
        other: Box<Place>,
        /// The second.
        place: Box<Place>,
    },
    /// A symmetry support on a face that is not normal to an axis.
    #[error(
        "face `{face}` does not lie in a plane normal to a coordinate axis, so it can be neither a symmetry plane nor a plate"
    )]
    NotNormalToAxis {
        /// The face.
        face: Box<str>,
        /// The support in the problem file.
        place: Box<Place>,
    },
    /// A force or an attachment acts on a point outside the host.
    #[error("the point of {what} lies outside the host, {distance:.3} mm from its nearest point ({:.3}, {:.3}, {:.3}) mm", nearest[0], nearest[1], nearest[2])]
    PointOutside {
        /// What acts there.
        what: &'static str,
        /// Distance to the host, mm.
        distance: f64,
        /// The nearest point, mm.
        nearest: [f64; 3],
        /// The table in the problem file.
        place: Box<Place>,
    },
    /// A region that is no set of elements of the host, or shares one with another.
    #[error("region `{region}` {problem}")]
    BadRegion {
        /// Its name.
        region: Box<str>,
        /// What is wrong with it.
        problem: Box<str>,
        /// What to do.
        help: &'static str,
        /// The region in the problem file.
        place: Box<Place>,
    },
    /// The reference shape is where a sliding or contact does not let it be.
    #[error("`{name}`: before anything moves, the face has a gap of {gap:.3e} mm to the surface in element {element}, at ({:.2}, {:.2}, {:.2}) mm", position[0], position[1], position[2])]
    StartsInContact {
        /// The sliding or contact.
        name: Box<str>,
        /// The worst gap, mm; negative behind the surface.
        gap: f64,
        /// Where on the face, mm.
        position: [f64; 3],
        /// The element of the host.
        element: usize,
        /// The contact in the problem file.
        place: Box<Place>,
    },
    /// A file of settings on a front that no study wrote.
    #[error("{} is not what a study writes: {message}", path.display())]
    BadAccuracy {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: Box<str>,
    },
    /// No setting on a front is as good as asked.
    #[error("{}: no setting has an error of {target} mm or less; the best has {best:.2e} mm", path.display())]
    AccuracyOutOfReach {
        /// The file.
        path: PathBuf,
        /// What was asked, mm.
        target: f64,
        /// The least error there, mm.
        best: f64,
    },
    /// A face is on both sides of a contact.
    #[error("`{contact}`: a face of element {element} is on both sides of the contact")]
    MeetsItself {
        /// The contact.
        contact: Box<str>,
        /// The element of the host.
        element: usize,
        /// The contact in the problem file.
        place: Box<Place>,
    },
    /// A line of an EX file is not what the format asks for.
    #[error("the EX file cannot be read: this should be {expected}")]
    ExSyntax {
        /// What the format asks for here.
        expected: String,
        /// The line.
        place: Box<Place>,
    },
    /// An EX file uses something that has no exact counterpart here.
    #[error("the EX file uses {construct}, which cannot be represented exactly")]
    ExUnsupported {
        /// What it uses, with the names in the file.
        construct: String,
        /// What would do.
        help: &'static str,
        /// The line.
        place: Box<Place>,
    },
    /// An EX file has not the field asked for, or several and none was asked for.
    #[error("{}", ex_field(wanted.as_deref(), found))]
    ExField {
        /// The field asked for.
        wanted: Option<Box<str>>,
        /// The fields that its elements have.
        found: Box<str>,
        /// The file.
        place: Box<Place>,
    },
    /// An element of an EX file uses something that the file does not have.
    #[error("the EX file lacks {what}")]
    ExMissing {
        /// What is not there.
        what: String,
        /// The line that uses it, or the file.
        place: Box<Place>,
    },
    /// The mesh of the host has no such face.
    #[error("the host has no face `{face}` on its boundary")]
    NoSuchFace {
        /// The face.
        face: Box<str>,
        /// The kinds of names that its faces have.
        named: &'static str,
        /// The support or load in the problem file.
        place: Box<Place>,
    },
    /// The host is of a kind that cannot carry the displacement.
    #[error("field `{field}` is trilinear: a host needs tricubic Hermite elements")]
    HostNotHermite {
        /// The field of the EX file.
        field: Box<str>,
        /// The mesh in the problem file.
        place: Box<Place>,
    },
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
        "no equilibrium beyond {:.2} % of the way to the asked load and controls ({reason}; step cut {cuts} times, now {step:.1e})\n  worst point: element {element}, Gauss point {point}: det F = {det_f:.4}; residual {residual:.2e} mN, required {required:.1e} mN{}",
        100.0 * reached,
        likely::below(likely)
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
        /// What the last iterate shows of the cause.
        likely: Option<Box<Likely>>,
    },
    /// Multipliers did not close a gap.
    #[error(
        "`{name}`: after {rounds} rounds of multipliers a gap of {gap:.2e} mm remains, allowed are {tolerance:.2e} mm"
    )]
    GapNotClosed {
        /// The sliding or contact.
        name: Box<str>,
        /// The largest gap that should be zero, mm.
        gap: f64,
        /// What may remain, mm.
        tolerance: f64,
        /// Rounds done.
        rounds: usize,
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
    /// Clarabel did not solve the quadratic program of a step.
    #[error("the bounded step of the fit was not solved: the quadratic program ended as {status}")]
    StepNotSolved {
        /// Clarabel's status by name.
        status: &'static str,
    },
    /// The fit of a frame did not converge.
    #[error(
        "frame {frame}: the fit did not converge in {iterations} iterations ({reason}); the last step leaves {left:.1e}, required {required:.1e}"
    )]
    FitNotConverged {
        /// Frame of the recording.
        frame: usize,
        /// Gauss-Newton iterations.
        iterations: usize,
        /// Why it ended.
        reason: &'static str,
        /// What the last step leaves as `fit.tolerance` counts it.
        left: f64,
        /// What may be left.
        required: f64,
    },
    /// What all frames share was not found.
    #[error(
        "what all frames share was not found in {iterations} iterations ({reason}); last step {step:.1e} of a range, required {required:.1e}"
    )]
    OuterNotConverged {
        /// Gauss-Newton iterations.
        iterations: usize,
        /// Why it ended.
        reason: &'static str,
        /// Largest change of an unknown in the last step, as a part of its range.
        step: f64,
        /// The change at which the search counts as converged.
        required: f64,
        /// The table in the problem file.
        place: Box<Place>,
    },
    /// A file is not what measured directions are read from.
    #[error("{}: {message}", path.display())]
    Axes {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: Box<str>,
    },
    /// No measured direction lies in the mesh.
    #[error(
        "none of the {count} measured axes lies in the mesh: the nearest is {:.3} mm from it, the farthest {:.3} mm", distance[0], distance[1]
    )]
    NoAxes {
        /// Axes outside the mesh.
        count: usize,
        /// Distance of the nearest and of the farthest, mm.
        distance: [f64; 2],
        /// The table `[fibres]`.
        place: Box<Place>,
    },
    /// A tricubic field of angles on a trilinear mesh whose local directions change from element to element.
    #[error("the local directions of elements {} and {} do not continue each other: a tricubic field needs that on a trilinear mesh", .elements[0], .elements[1])]
    UnlikeDirections {
        /// Indices of two elements that share a node.
        elements: [usize; 2],
        /// The table `[fibres]`.
        place: Box<Place>,
    },
    /// The normal equations of fibre angles cannot be solved.
    #[error("the normal equations of the fibre angles cannot be solved: {message}")]
    FibreSystem {
        /// What the solver says.
        message: Box<str>,
    },
    /// A frame has too few markers.
    #[error("frame {frame} at {time_s:.3} s has no marker at all")]
    NoMarkersInFrame {
        /// Frame of the recording.
        frame: usize,
        /// Its time, s.
        time_s: f64,
    },
    /// A run that left nothing to go on from.
    #[error("{}: there is nothing to go on from: {reason}", path.display())]
    NothingToResume {
        /// The folder of the run.
        path: PathBuf,
        /// What is missing.
        reason: Box<str>,
    },
    /// What a run is of is not as it was when it began.
    #[error("{}: the problem changed since the run began: {changes}", path.display())]
    ProblemChanged {
        /// The folder of the run.
        path: PathBuf,
        /// What changed.
        changes: Box<str>,
    },
    /// A checkpoint that cannot be used.
    #[error("the checkpoint {} cannot be used: {reason}", path.display())]
    BadCheckpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// Advice on markers was asked for where none are fitted.
    #[error("{}: this is no fit: there are no markers to add to", path.display())]
    NotAFit {
        /// The problem.
        path: PathBuf,
    },
    /// A frame shows too few markers to say where the head is.
    #[error(
        "frame {frame} at {time_s:.3} s shows {markers} markers: where the head is takes three that do not lie on a line"
    )]
    HeadNotSeen {
        /// Frame of the recording.
        frame: usize,
        /// Its time, s.
        time_s: f64,
        /// Markers that it shows.
        markers: usize,
    },
    /// The optimiser stopped for a reason of its own.
    #[error("the optimiser stopped: {message}")]
    Optimiser {
        /// What it said.
        message: String,
    },
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
    /// The file asked for exists already.
    #[error("{} exists already", path.display())]
    FileExists {
        /// The file.
        path: PathBuf,
    },
    /// The folder asked for holds something already.
    #[error("the output folder {} is not empty: it holds {entries} files or folders", path.display())]
    FolderNotEmpty {
        /// The folder.
        path: PathBuf,
        /// What is in it.
        entries: usize,
    },
    /// A folder is not that of a run which can be looked at.
    #[error("{} is not the folder of a run: it lacks {lacks}", path.display())]
    NotARun {
        /// The folder.
        path: PathBuf,
        /// What is not there.
        lacks: &'static str,
    },
    /// A run has kept no shapes.
    #[error("the run in {} has kept no shape of any frame (view/result_<frame>.exf)", path.display())]
    NoShapes {
        /// The folder.
        path: PathBuf,
    },
    /// A file in the folder of a run is not as the run wrote it.
    #[error("{} is not what a run wrote: {message}", path.display())]
    DamagedRun {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: Box<str>,
    },
    /// A run has no shape of the frame asked for.
    #[error("the run in {} has no shape of frame {frame}: it has {kept}", path.display())]
    NoSuchShape {
        /// The folder.
        path: PathBuf,
        /// The frame asked for.
        frame: usize,
        /// The frames it has.
        kept: Box<str>,
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

    /// [`Error::mistakes`] by value.
    pub fn into_mistakes(self) -> Vec<Error> {
        match self {
            Error::Mistakes(mistakes) => mistakes,
            single => vec![single],
        }
    }

    /// The stable code, for example `S003`.
    pub fn code(&self) -> &'static str {
        match self {
            Error::Mistakes(_) => "C000",
            Error::Named(named) => named.0.code(),
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
            Error::MarkerFile { .. } => "M015",
            Error::UnitsLookWrong { .. } => "K001",
            Error::UnknownLabel { .. } => "K002",
            Error::MarkerFarFromSurface { .. } => "K003",
            Error::NoSuchFrame { .. } => "K004",
            Error::Misregistered(wrong) => wrong.code(),
            Error::InvertedMesh { .. } => "G001",
            Error::MuscleOutside(_) => "G002",
            Error::InvertedMuscle { .. } => "G003",
            Error::ProbeOutside { .. } => "G004",
            Error::SupportsDisagree { .. } => "G005",
            Error::NotNormalToAxis { .. } => "G006",
            Error::PointOutside { .. } => "G020",
            Error::BadRegion { .. } => "G021",
            Error::StartsInContact { .. } => "G022",
            Error::MeetsItself { .. } => "G024",
            Error::BadAccuracy { .. } => "C022",
            Error::AccuracyOutOfReach { .. } => "C023",
            Error::ExSyntax { .. } => "G008",
            Error::ExUnsupported { .. } => "G009",
            Error::ExField { .. } => "G010",
            Error::ExMissing { .. } => "G011",
            Error::NoSuchFace { .. } => "G012",
            Error::HostNotHermite { .. } => "G013",
            Error::NotFinite => "S001",
            Error::NotConverged { .. } => "S003",
            Error::InaccurateSolve { .. } => "S004",
            Error::GapNotClosed { .. } => "S006",
            Error::Singular { .. } => "S010",
            Error::FactorTooLarge { .. } => "S011",
            Error::NotFactored => "S012",
            Error::StepNotSolved { .. } => "F001",
            Error::Axes { .. } => "M014",
            Error::NoAxes { .. } => "K005",
            Error::FibreSystem { .. } => "F010",
            Error::UnlikeDirections { .. } => "G026",
            Error::FitNotConverged { .. } => "F002",
            Error::OuterNotConverged { .. } => "F014",
            Error::NoMarkersInFrame { .. } => "F003",
            Error::Optimiser { .. } => "F004",
            Error::NotAFit { .. } => "C024",
            Error::NothingToResume { .. } => "C025",
            Error::ProblemChanged { .. } => "C026",
            Error::BadCheckpoint { .. } => "C027",
            Error::HeadNotSeen { .. } => "F020",
            Error::Io { .. } => "O001",
            Error::FolderNotEmpty { .. } => "O002",
            Error::FileExists { .. } => "O008",
            Error::NoUnits { .. } => "M016",
            Error::NothingToMatch { .. } => "K017",
            Error::NotARun { .. } => "O003",
            Error::NoShapes { .. } => "O004",
            Error::DamagedRun { .. } => "O005",
            Error::NoSuchShape { .. } => "O006",
        }
    }

    /// Whether no equilibrium was found: a step that asked for it may have been too long.
    pub fn is_not_converged(&self) -> bool {
        matches!(self, Error::NotConverged { .. } | Error::GapNotClosed { .. } | Error::Singular { .. })
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
            Error::InvertedMesh { place, .. }
            | Error::InvertedMuscle { place, .. }
            | Error::ProbeOutside { place, .. }
            | Error::SupportsDisagree { place, .. }
            | Error::NotNormalToAxis { place, .. }
            | Error::PointOutside { place, .. }
            | Error::BadRegion { place, .. }
            | Error::StartsInContact { place, .. }
            | Error::MeetsItself { place, .. }
            | Error::ExSyntax { place, .. }
            | Error::ExUnsupported { place, .. }
            | Error::ExField { place, .. }
            | Error::ExMissing { place, .. }
            | Error::NoSuchFace { place, .. }
            | Error::HostNotHermite { place, .. }
            | Error::UnitsLookWrong { place, .. }
            | Error::UnknownLabel { place, .. }
            | Error::MarkerFarFromSurface { place, .. }
            | Error::NothingToMatch { place }
            | Error::NoAxes { place, .. }
            | Error::UnlikeDirections { place, .. }
            | Error::OuterNotConverged { place, .. }
            | Error::NoSuchFrame { place, .. } => Some(place),
            Error::MuscleOutside(details) => Some(&details.place),
            Error::Misregistered(wrong) => Some(&wrong.place),
            Error::Named(named) => Some(&named.1),
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

/// Details of [`Error::MuscleOutside`].
#[derive(Debug, Clone, PartialEq)]
pub struct MuscleOutside {
    /// Its name.
    pub muscle: String,
    /// How many points lie outside.
    pub count: usize,
    /// Of how many.
    pub of: usize,
    /// Element of the muscle with the farthest point.
    pub element: usize,
    /// That point, mm.
    pub position: [f64; 3],
    /// Its distance to the host, mm.
    pub distance: f64,
    /// The muscle in the problem file.
    pub place: Place,
}

/// How a file of some length starts.
fn start_of(bytes: u64, start: &[u8]) -> String {
    if bytes == 0 { "it is empty".into() } else { format!("its {bytes} bytes start with `{}`", start.escape_ascii()) }
}

/// The message of [`Error::ExField`].
fn ex_field(wanted: Option<&str>, found: &str) -> String {
    match wanted {
        Some(wanted) => format!("no element of the EX file has a suitable field `{wanted}`"),
        None if found.is_empty() => "the EX file has no three-dimensional element with a field".into(),
        None => "the EX file has no field `coordinates`, and not just one other field of coordinates".into(),
    }
}

/// A mistake as a line of a list.
fn one_line(mistake: &Error) -> String {
    let place = mistake.place().map(|place| format!("{place}: ")).unwrap_or_default();
    format!("\n  {place}{} {mistake}", mistake.code())
}
