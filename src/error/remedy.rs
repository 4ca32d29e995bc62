//! The remedy of every error: the edit or the command that mends it.

use super::{Error, Likely};
use std::io::ErrorKind;

impl Error {
    /// The edit or command that mends it, where one is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Error::Named(named) => named.0.help(),
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
                Some(
                    "give an MCAP file, as `ros2 bag record -s mcap` or Foxglove write it, or a file that ends in .c3d, .trc or .csv"
                        .into(),
                )
            }
            Error::DamagedRecording { .. } => Some(
                "copy the file again from where it was recorded, or save its good chunks with `mcap recover`".into(),
            ),
            Error::TruncatedRecording { .. } => {
                Some("copy the file again, or add allow_truncated = true to [fit] to use the intact part".into())
            }
            Error::UncheckedRecording { .. } => Some(
                "rewrite it with checksums (`mcap recover IN -o OUT`), or add allow_unchecked = true to [fit]".into(),
            ),
            Error::NoMarkerTopic { .. } => Some(
                "record `mocap4r2_msgs/msg/Markers`, a MarkerArray, a PoseArray, a foxglove PointCloud or SceneUpdate, or JSON whose schema has \
                 `markers[]`"
                    .into(),
            ),
            Error::SeveralMarkerTopics { topics, .. } => topics
                .iter()
                .find(|topic| topic.is_readable())
                .map(|topic| format!("name one of them in [fit]: topic = \"{}\"", topic.name)),
            Error::TopicNotFound { nearest, .. } => {
                nearest.as_ref().map(|topic| format!("did you mean topic = \"{topic}\"?"))
            }
            Error::TopicNotReadable { topics, .. } => topics
                .iter()
                .find(|topic| topic.is_readable())
                .map(|topic| format!("this one can be read: topic = \"{}\"", topic.name)),
            Error::EmptyTopic { .. } => Some("record again: was the driver running?".into()),
            Error::NoSamples { missing, .. } if missing.zero > 0 => {
                Some("if markers really lie at (0, 0, 0), add zero_is_missing = false to [fit]".into())
            }
            Error::NoSamples { .. } => Some("record again: did the cameras see the markers?".into()),
            Error::Undecodable { .. } => Some(
                "the recorder stored another schema than the driver used: record again with matching messages".into(),
            ),
            Error::UnsupportedEncapsulation { .. } => {
                Some("record with a ROS 2 middleware that writes plain CDR, as rosbag2 does by default".into())
            }
            Error::NoUnits { .. } => Some("add --units mm, cm or m".into()),
            Error::NothingToMatch { .. } => {
                Some("give each marker of the model a [[marker]] with any name, and its position_mm".into())
            }
            Error::FileExists { .. } => Some("choose another name, or add --force to replace it".into()),
            Error::MarkerFile { .. } => Some(
                "write the file again from the program that made it; of one that is cut short, allow_truncated = true in [fit] \
                 takes the intact part"
                    .into(),
            ),
            Error::FrameShape { .. } => Some("give every frame one position, or `None`, per label".into()),
            Error::UnitsLookWrong { likely: Some(likely), .. } => Some(format!("the data fit units = \"{likely}\"")),
            Error::UnitsLookWrong { likely: None, .. } => Some(
                "none of mm, cm, m explains it: do the labels belong to these markers? data without a true size want units = \
                 \"estimate\" and register = \"similarity\""
                    .into(),
            ),
            Error::Misregistered(wrong) => Some(wrong.help()),
            Error::UnknownLabel { nearest: Some(nearest), .. } => Some(format!("did you mean `{nearest}`?")),
            Error::UnknownLabel { .. } => Some("rename the marker, or remove it from the problem".into()),
            Error::MarkerFarFromSurface { foot, .. } => Some(format!(
                "its nearest point on the surface is position_mm = [{:.3}, {:.3}, {:.3}]; or raise fit.max_marker_distance_mm",
                foot[0], foot[1], foot[2]
            )),
            Error::NoSuchFrame { count, .. } => Some(format!(
                "the whole recording is frames = {{ first = 0, last = {} }}; without `last` it goes on to its end",
                count.saturating_sub(1)
            )),
            Error::InvertedMesh { .. } => Some("check sizes and the order of nodes: sizes must be positive".into()),
            Error::MuscleOutside(_) => Some("move or shrink the muscle until it lies inside the host".into()),
            Error::InvertedMuscle { .. } => Some("check the muscle's size and the order of its nodes".into()),
            Error::ProbeOutside { nearest, .. } | Error::PointOutside { nearest, .. } => Some(format!(
                "the nearest material point is position_mm = [{:.3}, {:.3}, {:.3}]",
                nearest[0], nearest[1], nearest[2]
            )),
            Error::SupportsDisagree { .. } => Some("keep one of the two, or choose faces that do not meet".into()),
            Error::NotNormalToAxis { .. } => {
                Some("turn the geometry so that the plane is normal to x, y or z".into())
            }
            Error::BadRegion { help, .. } => Some((*help).into()),
            Error::StartsInContact { .. } => Some(
                "move the surface, or write initial = \"relax\" to take the gap away along the load path (a barrier must \
                 start in front of its surface)"
                    .into(),
            ),
            Error::BadAccuracy { .. } => Some(
                "--accuracy chooses among the settings in accuracy.toml beside the problem file: run a study of the problem and \
                 copy the accuracy.toml that it writes there"
                    .into(),
            ),
            Error::AccuracyOutOfReach { .. } => {
                Some("ask for less, or add finer variants to the study that wrote the file".into())
            }
            Error::MeetsItself { .. } => Some(
                "name different faces in `face` and in `surface`; a set of faces that may touch itself is written \
                 surface = { itself = {} }"
                    .into(),
            ),
            Error::ExSyntax { .. } => Some(
                "EX files of versions 1, 2 and 3 are read; of version 1, put the nodes and the elements into one file".into(),
            ),
            Error::ExUnsupported { help, .. } => Some((*help).into()),
            Error::ExField { found, .. } if found.is_empty() => {
                Some("the file needs three-dimensional elements with a field of coordinates".into())
            }
            Error::ExField { found, .. } => Some(format!("name one of its fields: {found}")),
            Error::ExMissing { .. } => Some("write the file again with all nodes and fields that its elements use".into()),
            Error::NoSuchFace { named, .. } => Some((*named).into()),
            Error::HostNotHermite { .. } => {
                Some("write the field with the basis c.Hermite in at least one direction".into())
            }
            Error::StepNotSolved { .. } => {
                Some("scale the problem: give realistic sd_mm, and remove unknowns that no marker sees".into())
            }
            Error::FitNotConverged { .. } => Some(
                "raise fit.max_iterations, or look at the residuals: do the labels and positions belong together?"
                    .into(),
            ),
            Error::OuterNotConverged { .. } => Some(
                "give `sd` to what the frames cannot tell, or raise fit.outer.max_iterations; risorius explain F013 says what is \
                 confounded with what"
                    .into(),
            ),
            Error::HeadNotSeen { .. } | Error::NoMarkersInFrame { .. } => Some("leave the frame out: frames = { first = .., last = .. }".into()),
            Error::Axes { .. } => Some(
                "a table x,y,z,vx,vy,vz as CSV, a field of vectors or tensors in a VTK, VTU or VTP file, lines in one, or a \
                 field of vectors at the nodes of an EX file is read; write field = \"..\" to choose one of several"
                    .into(),
            ),
            Error::UnlikeDirections { .. } => Some(
                "write field = \"trilinear\" in [fibres], or give the elements local directions that continue each other".into(),
            ),
            Error::NoAxes { .. } => Some(
                "check the units of [[fibres.data]] and the place of the mesh; outside = { project_mm = .. } uses axes near it"
                    .into(),
            ),
            Error::NothingToResume { .. } => Some("only fits leave checkpoints; begin anew with: risorius run".into()),
            Error::ProblemChanged { .. } => Some(
                "frames of two problems do not belong together: put back what changed, or begin anew with: risorius run".into(),
            ),
            Error::BadCheckpoint { .. } => Some("begin anew with: risorius run".into()),
            Error::NotAFit { .. } => {
                Some("give it a problem with kind = \"fit\" in [task], or the folder that such a problem's run left".into())
            }
            Error::Optimiser { .. } | Error::NotFinite | Error::FibreSystem { .. } => None,
            Error::InaccurateSolve { .. } => {
                Some("the body is at a limit point or held too little: check the supports and the path".into())
            }
            Error::GapNotClosed { .. } => Some(
                "raise kpa_per_mm of its law, or gap_mm: the elements may be too large to follow the surface more closely"
                    .into(),
            ),
            Error::NotConverged { likely: Some(likely), .. } => Some(match **likely {
                Likely::OffSurface { .. } => {
                    "hold the face so that it stays on its surface, or slide it on a plane, sphere or cylinder, which have \
                     no edge"
                        .into()
                }
                Likely::DescendingLimb { .. } => {
                    "the last equilibrium is kept; lower the activation, stretch the muscle less, or raise lambda_ofl if its \
                     fibres are longer at rest"
                        .into()
                }
            }),
            Error::NotConverged { .. } => Some(
                "the last equilibrium is kept; let the steps become shorter (--set solver.step_min=1e-6), or try a volumetric \
                 term (tissue.kappa_kpa), a finer mesh where det F is small, a smaller load or activation"
                    .into(),
            ),
            Error::Singular { .. } => {
                Some("hold the body: check that the supports prevent every rigid motion".into())
            }
            Error::FactorTooLarge { .. } => Some("use a coarser mesh or a machine with more memory".into()),
            Error::NotFactored => None,
            Error::Io { action, source, .. } => Some(io_help(action, source.kind()).into()),
            Error::FolderNotEmpty { .. } => {
                Some("choose another --out, or add --force to replace the run that is in it".into())
            }
            Error::NotARun { .. } => Some("name the folder that a run printed, for example runs/beam-0001".into()),
            Error::NoShapes { .. } => Some("run again with view = true in [output]".into()),
            Error::DamagedRun { .. } => Some("run again: `risorius run` on its problem.lock.toml".into()),
            Error::NoSuchShape { .. } => Some("choose one of these, or run again with every = 1 in [output]".into()),
        }
    }
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
    } else if expected.ends_with("number") && found == "empty" {
        Some("write a number in every cell; a muscle at rest is 0".into())
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

/// What to do about what the operating system refused.
fn io_help(action: &str, kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            "make room, or choose a place that has some with --out; what was complete before is complete still"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem if action != "read" => {
            "choose a folder that you may write to, with --out or by changing to it"
        }
        ErrorKind::NotADirectory => "a part of this path is a file: choose another path",
        _ => "check that the path exists and that you may use it",
    }
}
