//! Makes the recordings in `data/broken/recordings`: `cargo run --example broken_recordings`.
//!
//! Four markers of a block of 40 x 10 x 10 mm at rest, in metres, three frames at 10 Hz, as a ROS 2 driver records them
//! (`mocap4r2_msgs/msg/Markers`, CDR), and each thing that can be wrong with such a file.

#[path = "../tests/recordings/writer.rs"]
mod writer;

use std::path::Path;
use writer::{Message, Ros2Marker, Topic, container, file, ros2_message};

/// Labels and positions, m.
const MARKERS: [(&str, [f64; 3]); 4] = [
    ("lip.L", [0.020, 0.005, 0.010]),
    ("lip.R", [0.020, 0.005, 0.000]),
    ("brow", [0.040, 0.005, 0.010]),
    ("chin", [0.040, 0.005, 0.000]),
];
const FRAMES: u64 = 3;
/// 2026-01-01 00:00:00 UTC.
const START_NS: u64 = 1_767_225_600_000_000_000;
const STEP_NS: u64 = 100_000_000;

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/broken/recordings");
    let whole = |topics: &[Topic]| file(container("zstd"), topics);
    let good = whole(&[markers(|_, position| position)]);
    let mut flipped = good.clone();
    flipped[good.len() / 3] ^= 0b0001_0000;
    let lost = |position: fn([f64; 3]) -> [f64; 3]| whole(&[markers(|_, p| position(p))]);
    let no_checksums = container("none").calculate_chunk_crcs(false).calculate_data_section_crc(false);
    let text = ("std_msgs/msg/String", "ros2msg", b"string data\n".to_vec());
    let hello = Message { log_time: START_NS, publish_time: START_NS, payload: b"\0\x01\0\0\x03\0\0\0hi\0".to_vec() };
    let chatter =
        Topic { name: "/chatter", schema: text, encoding: "cdr", unit: None, messages: vec![hello.clone()] };
    let mut foreign = markers(|_, position| position);
    foreign.messages[1].payload = hello.payload;

    let files = [
        ("good.mcap", good.clone()),
        ("one_bit_flipped.mcap", flipped),
        ("cut_short.mcap", good[..2 * good.len() / 3].to_vec()),
        ("without_checksums.mcap", file(no_checksums, &[markers(|_, position| position)])),
        ("no_markers.mcap", whole(&[chatter])),
        ("several_topics.mcap", {
            let second = markers(|_, position| position).named("/markers_filtered");
            whole(&[markers(|_, position| position), second])
        }),
        ("empty_topic.mcap", whole(&[Topic { messages: Vec::new(), ..markers(|_, position| position) }])),
        ("all_nan.mcap", lost(|_| [f64::NAN; 3])),
        ("all_at_the_origin.mcap", lost(|_| [0.0; 3])),
        ("brow_nan.mcap", {
            whole(&[markers(|label, position| if label == "brow" { [f64::NAN; 3] } else { position })])
        }),
        ("another_schema.mcap", whole(&[foreign])),
    ];
    let placed = |at: fn(u64, &str, [f64; 3]) -> [f64; 3]| whole(&[eight(|_, label| label, at)]);
    let called = |label: fn(&str) -> &str| whole(&[eight(|_, l| label(l), |_, _, position| position)]);
    let registered = [
        ("eight.mcap", placed(|_, _, position| position)),
        ("left_handed.mcap", placed(|_, _, [x, y, z]| [x, -y, z])),
        ("turned.mcap", placed(|_, _, [x, y, z]| [0.03 - y, x, z + 0.01])),
        (
            "moving_at_first.mcap",
            placed(
                |frame, label, [x, y, z]| {
                    if frame == 0 && label.starts_with("lip") { [x + 0.002, y, z + 0.002] } else { [x, y, z] }
                },
            ),
        ),
        (
            "sides_exchanged.mcap",
            called(|label| match label {
                "brow.L" => "brow.R",
                "brow.R" => "brow.L",
                "cheek.L" => "cheek.R",
                "cheek.R" => "cheek.L",
                "lip.L" => "lip.R",
                "lip.R" => "lip.L",
                middle => middle,
            }),
        ),
        (
            "two_labels_exchanged.mcap",
            called(|label| match label {
                "nose" => "lip.L",
                "lip.L" => "nose",
                other => other,
            }),
        ),
    ];
    for (name, bytes) in files.into_iter().chain(registered) {
        std::fs::write(folder.join(name), bytes)?;
    }
    Ok(())
}

/// Labels and positions of the recordings that do not lie on their model, m: nearly symmetric about y = 5 mm.
const EIGHT: [(&str, [f64; 3]); 8] = [
    ("brow.L", [0.010, 0.000, 0.008]),
    ("brow.R", [0.010, 0.010, 0.0086]),
    ("cheek.L", [0.020, 0.0015, 0.010]),
    ("cheek.R", [0.020, 0.0081, 0.010]),
    ("lip.L", [0.030, 0.000, 0.005]),
    ("lip.R", [0.030, 0.010, 0.0058]),
    ("nose", [0.022, 0.005, 0.010]),
    ("chin", [0.040, 0.0052, 0.002]),
];

/// The topic of the eight markers, called and placed as given.
fn eight(
    called: impl for<'l> Fn(u64, &'l str) -> &'l str,
    placed: impl Fn(u64, &str, [f64; 3]) -> [f64; 3],
) -> Topic {
    let message = |frame: u64| {
        let time = START_NS + frame * STEP_NS;
        let markers = EIGHT.map(|(label, at)| Ros2Marker::named(called(frame, label), placed(frame, label, at)));
        let payload = ros2_message(false, false, time as i64, &markers);
        Message { log_time: time, publish_time: time, payload }
    };
    Topic::ros2(false, (0..FRAMES).map(message).collect())
}

/// The topic of the markers; `position` may move them.
fn markers(position: impl Fn(&str, [f64; 3]) -> [f64; 3]) -> Topic {
    let message = |frame: u64| {
        let time = START_NS + frame * STEP_NS;
        let markers = MARKERS.map(|(label, at)| Ros2Marker::named(label, position(label, at)));
        let payload = ros2_message(false, false, time as i64, &markers);
        Message { log_time: time, publish_time: time, payload }
    };
    Topic::ros2(false, (0..FRAMES).map(message).collect())
}
