//! Are recordings read as they were written, and damaged ones never wrongly?

pub mod files;
pub mod others;
pub mod writer;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use risorius::markers::{
    Clock, Compression, Fault, Gap, Missing, ReadOptions, Recording, Units, Unreadable, Warning, WriteOptions,
    inspect_bytes, read, read_bytes, write_json,
};
use risorius::{Error, Result};
use writer::{
    CONTAINERS, COORDINATES_SCHEMA, Message, POSITIONS_SCHEMA, Ros2Marker, Topic, container, file, ros2_message,
    ros2_schema, with_definitions_outside_chunks, without_chunk_crcs,
};

const START: i64 = 1_700_000_000_000_000_000;
const PERIOD: i64 = 10_000_000;

fn load(bytes: &[u8], options: &ReadOptions) -> Result<Recording> {
    read_bytes(Path::new("test.mcap"), bytes, options)
}

fn stamp(frame: usize) -> i64 {
    START + frame as i64 * PERIOD
}

/// A smooth track with all digits in use.
fn position(frame: usize, marker: usize) -> [f64; 3] {
    let (time, place) = (frame as f64 * 0.01, marker as f64);
    [10.0 * place + (7.0 * time).sin(), 40.0 - place / 3.0, 80.0 + (3.0 * time + place).cos()]
}

fn label(marker: usize) -> String {
    format!("M{marker:02}")
}

fn message(stamp: i64, payload: impl Into<Vec<u8>>) -> Message {
    Message { log_time: stamp as u64 + 5, publish_time: stamp as u64 + 3, payload: payload.into() }
}

/// CDR messages of `frames` frames with four markers.
fn ros2_messages(frames: usize, header: bool, big_endian: bool) -> Vec<Message> {
    let markers =
        |frame| (0..4).map(|marker| Ros2Marker::named(&label(marker), position(frame, marker))).collect::<Vec<_>>();
    let payload = |frame| ros2_message(header, big_endian, stamp(frame), &markers(frame));
    (0..frames).map(|frame| message(stamp(frame), payload(frame))).collect()
}

fn stamp_json(stamp: i64) -> String {
    format!(r#"{{"sec": {}, "nsec": {}}}"#, stamp / 1_000_000_000, stamp % 1_000_000_000)
}

/// JSON messages with `x`, `y`, `z`.
fn json_messages(frames: usize) -> Vec<Message> {
    let marker = |frame, marker| {
        let [x, y, z] = position(frame, marker);
        format!(r#"{{"name": "{}", "x": {x}, "y": {y}, "z": {z}, "valid": true}}"#, label(marker))
    };
    let payload = |frame| {
        let markers: Vec<String> = (0..4).map(|number| marker(frame, number)).collect();
        format!(r#"{{"timestamp": {}, "unit": "mm", "markers": [{}]}}"#, stamp_json(stamp(frame)), markers.join(", "))
    };
    (0..frames).map(|frame| message(stamp(frame), payload(frame))).collect()
}

fn check_tracks(recording: &Recording, frames: usize, context: &str) {
    assert_eq!(recording.labels, (0..4).map(label).collect::<Vec<_>>(), "{context}");
    assert_eq!(recording.frames.len(), frames, "{context}");
    for (number, frame) in recording.frames.iter().enumerate() {
        assert_eq!(frame.stamp_ns, stamp(number), "{context}");
        assert!((frame.time_s - number as f64 * 0.01).abs() < 1e-12, "{context}");
        for marker in 0..4 {
            assert_eq!(frame.positions_mm[marker], Some(position(number, marker)), "{context}");
        }
    }
}

#[test]
fn every_container_and_layout_gives_the_same_tracks() {
    for kind in CONTAINERS {
        for header in [false, true] {
            for big_endian in [false, true] {
                let bytes = file(container(kind), &[Topic::ros2(header, ros2_messages(40, header, big_endian))]);
                let recording = load(&bytes, &ReadOptions::default()).unwrap();
                check_tracks(&recording, 40, &format!("{kind} header {header} big endian {big_endian}"));
                assert_eq!(recording.source.clock, Clock::Header);
                assert_eq!(recording.source.schema, "mocap4r2_msgs/msg/Markers");
                assert_eq!(recording.health.warnings, []);
                let kinds: Vec<_> = recording.source.compression.keys().map(String::as_str).collect();
                assert_eq!(kinds, if kind == "unchunked" { vec![] } else { vec![kind] });
            }
        }
        let bytes = file(container(kind), &[Topic::json(COORDINATES_SCHEMA, json_messages(40))]);
        let recording = load(&bytes, &ReadOptions::default()).unwrap();
        check_tracks(&recording, 40, &format!("{kind} json"));
        assert_eq!(recording.source.units_declared, ["mm"]);
    }
}

#[test]
fn what_is_written_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = file(container("zstd"), &[Topic::ros2(false, ros2_messages(40, false, false))]);
    let mut original = load(&bytes, &ReadOptions::default()).unwrap();
    original.frames[3].positions_mm[2] = None;
    for (name, compression) in [("none", Compression::None), ("lz4", Compression::Lz4), ("zstd", Compression::Zstd)] {
        let path = folder.path().join(name);
        let options = WriteOptions { topic: "/face".into(), compression, units: Units::Mm };
        write_json(&path, &original.labels, &original.frames, &options).unwrap();
        let again = read(&path, &ReadOptions::default()).unwrap();
        assert_eq!((&again.labels, &again.frames), (&original.labels, &original.frames));
        assert_eq!(again.source.topic, "/face");
        assert_eq!(again.source.schema, "risorius.Markers");
        assert_eq!(again.source.units_declared, ["mm"]);
        assert_eq!(again.health.warnings, []);
        assert_eq!(again.health.labels[2].missing, Missing { absent: 1, ..Missing::default() });
        let first = std::fs::read(&path).unwrap();
        write_json(&path, &original.labels, &original.frames, &options).unwrap();
        assert_eq!(first, std::fs::read(&path).unwrap(), "the same recording gives the same bytes");
    }

    let path = folder.path().join("metres");
    write_json(
        &path,
        &original.labels,
        &original.frames,
        &WriteOptions { units: Units::M, ..WriteOptions::default() },
    )
    .unwrap();
    let metres = read(&path, &ReadOptions { units: Units::M, ..ReadOptions::default() }).unwrap();
    for (frame, expected) in metres.frames.iter().zip(&original.frames) {
        for (position, expected) in frame.positions_mm.iter().flatten().zip(expected.positions_mm.iter().flatten()) {
            assert!((0..3).all(|axis| (position[axis] - expected[axis]).abs() < 1e-13));
        }
    }
    let accused = read(&path, &ReadOptions::default()).unwrap();
    assert_eq!(accused.health.warnings, [Warning::UnitsDisagree { declared: "m".into(), used: Units::Mm }]);
    assert_eq!(accused.frames[0].positions_mm[0], Some(position(0, 0).map(|mm| mm / 1000.0)), "not converted");

    for (name, unit) in [("Metres", Some(Units::M)), ("millimeter", Some(Units::Mm)), ("inch", None)] {
        assert_eq!(Units::from_name(name), unit);
    }

    original.frames[5].positions_mm.pop();
    let error = write_json(&path, &original.labels, &original.frames, &WriteOptions::default()).unwrap_err();
    assert!(matches!(error, Error::FrameShape { frame: 5, positions: 3, labels: 4 }), "{error}");
    original.frames[5].positions_mm.push(None);
    let nowhere = folder.path().join("no/such/folder.mcap");
    assert_eq!(
        write_json(&nowhere, &original.labels, &original.frames, &WriteOptions::default()).unwrap_err().code(),
        "O001"
    );
}

#[test]
fn missing_samples_are_counted_by_kind() {
    let frame = |markers: &[(&str, [f64; 3])]| {
        markers.iter().map(|(name, position)| Ros2Marker::named(name, *position)).collect::<Vec<_>>()
    };
    let here = [1.0, 2.0, 3.0];
    let frames = [
        frame(&[("a", here), ("b", [f64::NAN, 0.0, 0.0]), ("", here)]),
        frame(&[("a", [0.0, -0.0, 0.0]), ("b", [1.0, f64::INFINITY, 0.0]), ("c", here)]),
        frame(&[("a", here), ("b", here), ("b", [4.0, 5.0, 6.0]), ("c", here)]),
    ];
    let messages = frames.iter().enumerate();
    let messages =
        messages.map(|(n, frame)| message(stamp(n), ros2_message(false, false, stamp(n), frame))).collect();
    let bytes = file(container("zstd"), &[Topic::ros2(false, messages)]);
    let recording = load(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(recording.labels, ["a", "b", "c"]);
    let none = Missing::default();
    let health = &recording.health;
    assert_eq!((health.labels[0].present, health.labels[0].missing), (2, Missing { zero: 1, ..none }));
    assert_eq!(
        (health.labels[1].present, health.labels[1].missing),
        (0, Missing { not_finite: 2, ambiguous: 1, ..none })
    );
    assert_eq!((health.labels[2].present, health.labels[2].missing), (2, Missing { absent: 1, ..none }));
    assert_eq!(health.unlabelled_samples, 1);
    assert_eq!(recording.frames[0].positions_mm, [Some(here), None, None]);
    assert_eq!(recording.frames[2].positions_mm, [Some(here), None, Some(here)]);

    let kept = load(&bytes, &ReadOptions { zero_is_missing: false, ..ReadOptions::default() }).unwrap();
    assert_eq!(kept.frames[1].positions_mm[0], Some([0.0; 3]));
    assert_eq!(kept.health.warnings, [Warning::ZerosKept { samples: 1 }]);

    let text = r#"{"timestamp": {"sec": 1, "nsec": 0}, "markers": [{"name": "a", "x": null, "y": 1, "z": 1},
        {"name": "b"}, {"name": "c", "x": 1, "y": 2, "z": 3, "valid": false}, {"name": "d", "x": 1, "y": 2, "z": 3}]}"#;
    let bytes = file(container("none"), &[Topic::json(COORDINATES_SCHEMA, vec![message(stamp(0), text)])]);
    let labels = load(&bytes, &ReadOptions::default()).unwrap().health.labels;
    let kinds: Vec<_> = labels.iter().map(|label| (label.missing.absent, label.missing.invalid)).collect();
    assert_eq!(kinds, [(1, 0), (1, 0), (0, 1), (0, 0)]);

    let text = r#"{"stamp": {"sec": 1, "nanosec": 0}, "markers": [{"name": "a", "position": null}, {"name": "b"},
        {"name": "c", "position": [1, null, 3]}, {"name": "d", "position": [1, 2, 3]}]}"#;
    let bytes = file(container("none"), &[Topic::json(POSITIONS_SCHEMA, vec![message(stamp(0), text)])]);
    let labels = load(&bytes, &ReadOptions::default()).unwrap().health.labels;
    assert_eq!(labels.iter().map(|label| label.present).collect::<Vec<_>>(), [0, 0, 0, 1]);
}

#[test]
fn markers_are_known_by_name_or_by_index() {
    let marker = |id_type, index, name: &str| Ros2Marker { id_type, index, name: name.into(), translation: [1.0; 3] };
    let markers = [marker(0, 4, "nose"), marker(1, 12, "ignored"), marker(2, 7, "chin"), marker(2, 9, "")];
    let payload = ros2_message(true, true, stamp(0), &markers);
    let bytes = file(container("lz4"), &[Topic::ros2(true, vec![message(stamp(0), payload)])]);
    assert_eq!(load(&bytes, &ReadOptions::default()).unwrap().labels, ["nose", "12", "chin", "9"]);
}

#[test]
fn the_clock_falls_back_and_says_so() {
    let with = |stamps: &[(i64, u64, u64)]| {
        let messages = stamps.iter().map(|(header, publish_time, log_time)| Message {
            log_time: *log_time,
            publish_time: *publish_time,
            payload: ros2_message(false, false, *header, &[Ros2Marker::named("a", [1.0; 3])]),
        });
        let bytes = file(container("zstd"), &[Topic::ros2(false, messages.collect())]);
        load(&bytes, &ReadOptions::default()).unwrap()
    };
    let stamps = |recording: &Recording| recording.frames.iter().map(|frame| frame.stamp_ns).collect::<Vec<_>>();
    let header = with(&[(-5, 20, 200), (0, 21, 201)]);
    assert_eq!((header.source.clock, stamps(&header)), (Clock::Header, vec![-5, 0]));
    let publish = with(&[(0, 20, 200), (0, 21, 201)]);
    assert_eq!((publish.source.clock, stamps(&publish)), (Clock::Publish, vec![20, 21]));
    assert_eq!(publish.health.warnings, [Warning::ClockFallback { stamped: 2, messages: 2, used: Clock::Publish }]);
    let log = with(&[(0, 0, 200), (0, 0, 201)]);
    assert_eq!((log.source.clock, stamps(&log)), (Clock::Log, vec![200, 201]));

    let bare = r#"{"markers": [{"name": "a", "position": [1, 2, 3]}]}"#;
    let stamped = r#"{"stamp": {"sec": 1, "nsec": 0}, "markers": []}"#;
    let messages = vec![message(100, bare), message(200, stamped)];
    let bytes = file(container("zstd"), &[Topic::json(POSITIONS_SCHEMA, messages)]);
    let mixed = load(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(mixed.health.warnings, [Warning::ClockFallback { stamped: 1, messages: 2, used: Clock::Publish }]);
}

#[test]
fn jitter_duplicates_gaps_and_steps_back_are_reported_and_nothing_is_resampled() {
    let ms = 1_000_000;
    let times = [0, 10, 20, 20, 30, 75, 85, 83, 93, 104].map(|time| START + time * ms);
    let marker = [Ros2Marker::named("a", [1.0; 3])];
    let messages = times.iter().map(|time| message(*time, ros2_message(false, false, *time, &marker))).collect();
    let bytes = file(container("zstd"), &[Topic::ros2(false, messages)]);
    let recording = load(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(recording.frames.iter().map(|frame| frame.stamp_ns).collect::<Vec<_>>(), times);
    let health = recording.health;
    assert_eq!((health.frames, health.duplicate_stamps, health.backward_steps), (10, 1, 1));
    assert!((health.duration_s - 0.104).abs() < 1e-12 && (health.rate_hz.unwrap() - 100.0).abs() < 1e-9);
    // Six regular intervals, one of them 1 ms too long.
    assert!((health.jitter_s.unwrap() - 1e-3 / 6.0_f64.sqrt()).abs() < 1e-9, "{:?}", health.jitter_s);
    let [Gap { after_frame: 4, time_s, length_s }] = health.gaps[..] else { panic!("{:?}", health.gaps) };
    assert!((time_s - 0.030).abs() < 1e-12 && (length_s - 0.045).abs() < 1e-12);
}

#[test]
fn the_topic_is_found_or_named() {
    let markers = || Topic::ros2(false, ros2_messages(3, false, false));
    let image = || Topic {
        name: "/camera",
        schema: ("sensor_msgs/msg/Image", "ros2msg", "uint8[] data\n".into()),
        encoding: "cdr",
        unit: None,
        messages: vec![message(stamp(0), [0; 9])],
    };
    let protobuf = || Topic { schema: ("foxglove.PointCloud", "protobuf", "x".into()), ..image().named("/cloud") };
    let asked = |topics: &[Topic], topic: Option<&str>| {
        let options = ReadOptions { topic: topic.map(Into::into), ..ReadOptions::default() };
        load(&file(container("zstd"), topics), &options)
    };
    check_tracks(&asked(&[image(), markers(), protobuf()], None).unwrap(), 3, "one of three");

    let error = asked(&[image(), protobuf()], None).unwrap_err();
    assert_eq!(error.code(), "M005");
    let text = error.to_string();
    assert!(text.contains("`/camera`: sensor_msgs/msg/Image (cdr, ros2msg), 1 messages, not readable"), "{text}");
    assert!(text.contains("`/cloud`: foxglove.PointCloud (cdr, protobuf)"), "{text}");

    let two = [markers(), markers().named("/other")];
    let error = asked(&two, None).unwrap_err();
    assert_eq!(error.code(), "M006");
    assert_eq!(error.help().unwrap(), "name one of them in [fit]: topic = \"/markers\"");
    assert_eq!(asked(&two, Some("/other")).unwrap().source.topic, "/other");

    let error = asked(&two, Some("/markrs")).unwrap_err();
    assert!(matches!(&error, Error::TopicNotFound { nearest: Some(near), .. } if near == "/markers"), "{error}");
    assert_eq!((error.code(), error.help().unwrap().as_str()), ("M007", "did you mean topic = \"/markers\"?"));
    assert!(matches!(asked(&two, Some("zzz")).unwrap_err(), Error::TopicNotFound { nearest: None, .. }));

    let error = asked(&[image(), markers()], Some("/camera")).unwrap_err();
    assert!(matches!(&error, Error::TopicNotReadable { reason: Unreadable::Layout { .. }, .. }), "{error}");
    assert_eq!(error.help().unwrap(), "this one can be read: topic = \"/markers\"");
    let error = asked(&[protobuf()], Some("/cloud")).unwrap_err();
    assert!(matches!(&error, Error::TopicNotReadable { reason: Unreadable::Encoding, .. }), "{error}");
    let bare = Topic { schema: ("", "", Vec::new()), ..image() };
    let error = asked(&[bare], Some("/camera")).unwrap_err();
    assert!(matches!(&error, Error::TopicNotReadable { reason: Unreadable::NoSchema, .. }), "{error}");
    let error = asked(&[Topic::json("{,", vec![])], Some("/markers")).unwrap_err();
    assert!(matches!(&error, Error::TopicNotReadable { reason: Unreadable::NotJson { .. }, .. }), "{error}");

    let schemas = [
        ("Strange", "line 1 is not a field"),
        ("Other thing", "uses `mocap4r2_msgs/Other`"),
        ("mocap4r2_msgs/Markers[] markers", "contains itself"),
        ("uint8[0] nothing", "line 1 is not a field"),
        ("uint8 a\n===\nMSG: a/B\nuint8 x\n===\nMSG: a/B\nint8 x", "defines `a/B` twice"),
    ];
    for (text, expected) in schemas {
        let broken = Topic { schema: ("mocap4r2_msgs/msg/Markers", "ros2msg", text.into()), ..markers() };
        let error = asked(&[broken], Some("/markers")).unwrap_err();
        assert!(matches!(&error, Error::TopicNotReadable { reason: Unreadable::Schema(_), .. }), "{error}");
        assert!(error.to_string().contains(expected) && error.code() == "M008", "{error}");
    }
    let error = asked(&[Topic::ros2(false, vec![])], None).unwrap_err();
    assert!(matches!(&error, Error::EmptyTopic { topic, .. } if topic == "/markers"), "{error}");
    assert_eq!(error.code(), "M009");
}

#[test]
fn bad_messages_are_errors_with_their_place() {
    let one = |topic: fn(&'static str, Vec<Message>) -> Topic, schema, payload: &[u8]| {
        let mut messages = vec![message(stamp(0), payload)];
        messages.push(message(stamp(1), payload));
        load(&file(container("zstd"), &[topic(schema, messages)]), &ReadOptions::default())
    };
    let ros2 = |payload: &[u8]| one(|_, messages| Topic::ros2(false, messages), "", payload).unwrap_err();
    let json = |payload: &str| one(Topic::json, POSITIONS_SCHEMA, payload.as_bytes()).unwrap_err();

    let good = ros2_message(false, false, stamp(0), &[Ros2Marker::named("a", [0.0; 3])]);
    let error = ros2(&good);
    assert!(
        matches!(error, Error::NoSamples { frames: 2, labels: 1, missing: Missing { zero: 2, .. }, .. }),
        "{error}"
    );
    assert_eq!(error.code(), "M010");
    assert!(error.help().unwrap().contains("zero_is_missing"));

    for cut in 0..good.len() {
        let error = ros2(&good[..cut]);
        assert!(matches!(error, Error::Undecodable { fault: Fault::Short { .. }, .. }), "{cut}: {error}");
        assert_eq!(error.code(), "M011");
    }
    let log_time = stamp(0) as u64 + 5;
    let error = ros2(&good[..6]);
    assert!(matches!(error, Error::Undecodable { sequence: 0, log_time_ns, byte: 4, .. } if log_time_ns == log_time));
    let error = ros2(&[&good[..], &[0; 8]].concat());
    assert!(matches!(error, Error::Undecodable { fault: Fault::Left { bytes: 8 }, .. }), "{error}");
    let mut text = good.clone();
    text[19] = b'!';
    let error = ros2(&text);
    assert!(matches!(error, Error::Undecodable { fault: Fault::Text, .. }), "{error}");
    let mut nanoseconds = good.clone();
    nanoseconds[11] = 0xff;
    let error = ros2(&nanoseconds);
    assert!(matches!(error, Error::Undecodable { fault: Fault::Stamp { .. }, .. }), "{error}");
    for (id, name) in [(3, "PL_CDR"), (7, "CDR2"), (9, "D_CDR2"), (11, "PL_CDR2")] {
        let error = ros2(&[&[0, id, 0, 0], &good[4..]].concat());
        assert!(matches!(error, Error::UnsupportedEncapsulation { sequence: 0, .. }), "{error}");
        assert!(error.code() == "M012" && error.to_string().contains(name), "{error}");
    }

    let error = json("{\n \"markers\": [1]}");
    assert!(matches!(error, Error::Undecodable { byte: 15, fault: Fault::Json { .. }, .. }), "{error:?}");
    for text in [
        "",
        "[]",
        "{}",
        r#"{"markers": [{"position": [1, 2, 3]}]}"#,
        r#"{"markers": [{"name": "a", "position": [1, 2]}]}"#,
    ] {
        assert!(matches!(json(text), Error::Undecodable { fault: Fault::Json { .. }, .. }), "{text}");
    }
    let error = json(r#"{"markers": []}"#);
    assert!(matches!(error, Error::NoSamples { frames: 2, labels: 0, .. }), "{error}");

    let bounded =
        ros2_schema(false).replace("Marker[]", "Marker[<=1]").replace("string frame_id", "string<=3 frame_id");
    let two = [Ros2Marker::named("a", [1.0; 3]), Ros2Marker::named("b", [1.0; 3])];
    let read = |markers: &[Ros2Marker]| {
        let payload = ros2_message(false, false, stamp(0), markers);
        let topic = Topic::ros2(false, vec![message(stamp(0), payload)]);
        let topic = Topic { schema: ("mocap4r2_msgs/msg/Markers", "ros2msg", bounded.clone().into_bytes()), ..topic };
        load(&file(container("none"), &[topic]), &ReadOptions::default())
    };
    assert_eq!(read(&two[..1]).unwrap().labels, ["a"]);
    let error = read(&two).unwrap_err();
    assert!(matches!(error, Error::Undecodable { fault: Fault::Bound { count: 2, bound: 1 }, .. }), "{error}");
}

#[test]
fn other_files_are_refused() {
    for bytes in [&b""[..], b"\x89MCAP", b"time,x,y,z\n0,1,2,3\n"] {
        let error = load(bytes, &ReadOptions::default()).unwrap_err();
        assert!(matches!(error, Error::NotMcap { .. }) && error.code() == "M001", "{error}");
    }
    let error = read(Path::new("no/such.mcap"), &ReadOptions::default()).unwrap_err();
    assert_eq!(error.code(), "O001");
}

/// Where a file has no checksum of its data section, as most writers leave it.
fn without_data_crc(kind: &str) -> mcap::WriteOptions {
    container(kind).calculate_data_section_crc(false)
}

#[test]
fn files_without_checksums_need_consent() {
    let topics = [Topic::ros2(false, ros2_messages(20, false, false))];
    let unchecked = ReadOptions { allow_unchecked: true, ..ReadOptions::default() };
    let cases = [
        ("messages", without_data_crc("unchunked"), 20),
        ("messages", without_data_crc("zstd").calculate_chunk_crcs(false), 20),
        ("many", without_data_crc("lz4").emit_statistics(false).emit_chunk_indexes(false), 20),
    ];
    for (part, options, frames) in cases {
        let bytes = file(options, &topics);
        let error = load(&bytes, &ReadOptions::default()).unwrap_err();
        assert!(matches!(error, Error::UncheckedRecording { .. }) && error.code() == "M004", "{error}");
        assert!(error.to_string().contains(part), "{error}");
        let recording = load(&bytes, &unchecked).unwrap();
        check_tracks(&recording, frames, part);
        assert!(recording.health.warnings.iter().any(|warning| matches!(warning, Warning::Unchecked { .. })));
    }
    let bytes = without_chunk_crcs(file(container("zstd"), &topics));
    let recording = load(&bytes, &ReadOptions::default()).unwrap();
    assert!(matches!(recording.health.warnings[..], [Warning::ChunksWithoutChecksum { .. }]));
}

/// Flips single bits; each must give the same recording or an error of the recording. Returns the number of errors.
fn flip_bits(context: &str, bytes: &[u8], bits: impl Iterator<Item = usize>) -> usize {
    let options = [
        ReadOptions::default(),
        // Consent to a short file must not let a damaged one through.
        ReadOptions { allow_truncated: true, ..ReadOptions::default() },
    ];
    let good = load(bytes, &options[0]).unwrap();
    let mut bytes = bytes.to_vec();
    let mut errors = 0;
    for bit in bits {
        bytes[bit / 8] ^= 1 << (bit % 8);
        let options = &options[bit % 2];
        let read = catch_unwind(AssertUnwindSafe(|| load(&bytes, options)));
        match read.unwrap_or_else(|_| panic!("{context}: panic with bit {bit} flipped")) {
            Ok(recording) => assert!(recording == good, "{context}: wrong values with bit {bit} flipped"),
            Err(error) => {
                assert!(error.code().starts_with('M'), "{context}: bit {bit}: {error}");
                errors += 1;
            }
        }
        if bit % 5 == 0 {
            let inspect = || inspect_bytes(Path::new("test.mcap"), &bytes).is_ok();
            assert!(catch_unwind(inspect).is_ok(), "{context}: inspect panics with bit {bit} flipped");
        }
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    errors
}

#[test]
fn a_flipped_bit_never_gives_a_wrong_value() {
    let topics = [
        ("cdr", Topic::ros2(false, ros2_messages(60, false, false))),
        ("json", Topic::json(COORDINATES_SCHEMA, json_messages(60))),
    ];
    for (encoding, topic) in topics {
        let topics = [topic];
        let cases = [
            ("zstd, no data crc", without_data_crc("zstd"), 1000),
            ("zstd", container("zstd"), 300),
            ("zstd, no chunk crc", container("zstd"), 300),
            ("lz4, no data crc", without_data_crc("lz4"), 300),
            ("none, no data crc", without_data_crc("none"), 300),
            ("unchunked", container("unchunked"), 300),
        ];
        for (kind, options, count) in cases {
            let bytes = match file(options, &topics) {
                bytes if kind.ends_with("no chunk crc") => without_chunk_crcs(bytes),
                bytes => bytes,
            };
            let step = bytes.len() * 8 / count;
            // An offset within the step that visits every bit of a byte.
            let bits = (0..count).map(|flip| flip * step + (flip * 7919) % step);
            let errors = flip_bits(&format!("{encoding}, {kind}"), &bytes, bits);
            assert!(errors * 10 > count * 6, "{encoding}, {kind}: only {errors} of {count} flips were seen");
        }
    }
}

#[test]
fn every_bit_of_small_files() {
    let topics = [Topic::ros2(false, ros2_messages(2, false, false))];
    let cases = [
        ("zstd", without_data_crc("zstd")),
        ("zstd, no statistics", without_data_crc("zstd").emit_statistics(false).chunk_size(Some(1))),
        ("zstd, no summary crc", without_data_crc("zstd").calculate_summary_section_crc(false)),
        ("lz4, no chunk indexes", without_data_crc("lz4").emit_chunk_indexes(false).chunk_size(Some(1))),
        ("none", without_data_crc("none").chunk_size(Some(1))),
        ("unchunked", container("unchunked")),
    ];
    for (kind, options) in cases {
        let bytes = file(options, &topics);
        let errors = flip_bits(kind, &bytes, 0..bytes.len() * 8);
        assert!(errors > bytes.len() * 2, "{kind}: {errors} errors for {} bytes", bytes.len());
    }
}

#[test]
fn definitions_outside_chunks_are_guarded_by_their_copy() {
    let topics = [Topic::ros2(false, ros2_messages(3, false, false))];
    let options = without_data_crc("zstd").calculate_summary_section_crc(false);
    let (bytes, place) = with_definitions_outside_chunks(&file(options, &topics));
    check_tracks(&load(&bytes, &ReadOptions::default()).unwrap(), 3, "copies");
    let errors = flip_bits("definitions", &bytes, place.start * 8..place.end * 8);
    assert!(errors > place.len() * 7, "{errors} errors for {} bytes", place.len());
}

#[test]
fn a_short_file_gives_its_intact_part_on_request_only() {
    for kind in ["zstd", "none", "unchunked"] {
        let bytes = file(container(kind), &[Topic::ros2(false, ros2_messages(60, false, false))]);
        let whole = load(&bytes, &ReadOptions::default()).unwrap();
        let lenient = ReadOptions { allow_truncated: true, allow_unchecked: true, ..ReadOptions::default() };
        let mut most = 0;
        for place in 0..50 {
            let length = 8 + (bytes.len() - 9) * place / 49;
            let short = &bytes[..length];
            let error = load(short, &ReadOptions::default()).unwrap_err();
            let Error::TruncatedRecording { bytes: told, messages, frames, seconds, .. } = error else {
                panic!("{kind}, {length} bytes: {error}");
            };
            assert_eq!((told, messages), (length as u64, frames as u64));
            assert!((seconds - 0.01 * frames.saturating_sub(1) as f64).abs() < 1e-9);
            assert_eq!(error.code(), "M003");
            assert!(inspect_bytes(Path::new("test.mcap"), short).unwrap().truncated.is_some());
            match load(short, &lenient) {
                Ok(part) => {
                    assert_eq!(part.frames.len(), frames);
                    assert_eq!(part.frames[..], whole.frames[..frames], "{kind}, {length} bytes");
                    assert!(part.health.warnings.iter().any(|w| matches!(w, Warning::Truncated { .. })));
                }
                Err(error) => {
                    assert_eq!(frames, 0, "{kind}, {length} bytes: {error}");
                    assert!(matches!(error, Error::NoMarkerTopic { .. } | Error::EmptyTopic { .. }), "{error}");
                }
            }
            assert!(frames >= most, "more bytes, fewer frames");
            most = frames;
        }
        assert_eq!(most, 60, "{kind}: only the summary is cut");
        // A message under no checksum is not intact until somebody says so.
        let strict = ReadOptions { allow_unchecked: false, ..lenient };
        let half = load(&bytes[..bytes.len() / 2], &strict);
        assert_eq!(half.is_err_and(|error| error.code() == "M004"), kind == "unchunked");
    }
}

/// A small generator: the same numbers everywhere (xorshift, Marsaglia 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % bound as u64) as usize
    }
}

#[test]
fn random_schemas_and_messages_do_not_panic() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let good_schema = ros2_schema(true);
    let good_payload =
        ros2_message(true, false, stamp(0), &["nose", "chin", "lip"].map(|name| Ros2Marker::named(name, [1.0; 3])));
    let words = [
        "[]",
        "[3]",
        "[<=2]",
        "[99999999999]",
        "string<=2",
        "/",
        "=",
        "\n",
        " ",
        "#",
        "Header",
        "MSG:",
        "é",
        "\"",
        "int64",
    ];
    let (mut read, mut refused) = (0, 0);
    for _ in 0..4000 {
        let mut schema = good_schema.clone();
        for _ in 0..random.below(3) {
            let at = (0..=random.below(schema.len())).rev().find(|at| schema.is_char_boundary(*at)).unwrap();
            match random.below(2) {
                0 => schema.insert_str(at, words[random.below(words.len())]),
                _ => drop(schema.remove(at)),
            }
        }
        let mut payload = good_payload.clone();
        for _ in 0..random.below(4) {
            let at = 4 + random.below(payload.len() - 4);
            payload[at] = random.below(256) as u8;
        }
        if random.below(8) == 0 {
            payload.truncate(random.below(payload.len()));
        }
        let mut topic = Topic::ros2(true, vec![message(stamp(0), payload)]);
        topic.schema.2 = schema.into_bytes();
        let bytes = file(container("none"), &[topic]);
        match load(&bytes, &ReadOptions::default()) {
            Ok(recording) => {
                let mut positions = recording.frames.iter().flat_map(|frame| frame.positions_mm.iter().flatten());
                assert!(positions.all(|position| position.iter().all(|coordinate| coordinate.is_finite())));
                read += 1;
            }
            Err(error) => {
                assert!(error.code().starts_with('M'), "{error}");
                refused += 1;
            }
        }
    }
    assert!(read > 500 && refused > 500, "{read} read, {refused} refused");
}

#[test]
fn a_file_is_inspected_in_its_own_unit() {
    let mut metres = ros2_messages(5, false, false);
    for (frame, message) in metres.iter_mut().enumerate() {
        let markers: Vec<_> =
            (0..4).map(|m| Ros2Marker::named(&label(m), position(frame, m).map(|mm| mm / 1000.0))).collect();
        message.payload = ros2_message(false, false, stamp(frame), &markers);
    }
    let broken = Topic::ros2(false, vec![message(stamp(0), [0, 1, 0, 0, 9])]).named("/broken");
    let topics =
        [Topic::ros2(false, metres), Topic::json(COORDINATES_SCHEMA, json_messages(5)).named("/json"), broken];
    let inspection = inspect_bytes(Path::new("test.mcap"), &file(container("lz4"), &topics)).unwrap();
    assert_eq!(inspection.topics.iter().map(|topic| topic.messages).collect::<Vec<_>>(), [1, 5, 5]);
    assert!(inspection.markers[0].contents.as_ref().is_err_and(|fault| fault.contains("cannot be decoded")));
    let json = inspection.markers[1].contents.as_ref().unwrap();
    assert_eq!(json.extent.as_ref().unwrap().plausible_units, [Units::Mm, Units::Cm]);
    assert_eq!(json.units_declared, ["mm"]);
    let metres = inspection.markers[2].contents.as_ref().unwrap();
    let extent = metres.extent.as_ref().unwrap();
    assert_eq!(extent.plausible_units, [Units::M]);
    assert!((extent.greatest[0] - 0.03).abs() < 0.001, "not converted");
    assert_eq!(metres.health.labels[3].present, 5);
    let text = inspection.to_string();
    for part in ["`/markers`", "M03", "5 frames", "header stamp", "if the unit is m (not converted)"] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    let value = serde_json::to_value(&inspection).unwrap();
    assert_eq!(value["markers"][2]["contents"]["Ok"]["health"]["labels"][0]["label"], "M00");
    assert_eq!(value["chunks"]["lz4"], inspection.chunks["lz4"]);
}
