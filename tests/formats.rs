//! Messages and files of other programs: are their markers read as they were written, and damaged ones never wrongly?

use crate::recordings::files::{Processor, Tracks};
use crate::recordings::others::{Entities, Shown};
use crate::recordings::writer::{Topic, container, file};
use crate::recordings::{files, others};
use assert_cmd::Command;
use risorius::markers::{
    Clock, Fault, Missing, ReadOptions, Recording, Units, Warning, inspect_bytes, read, read_bytes,
};
use risorius::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

const START: i64 = 1_700_000_000_000_000_000;

fn load(name: &str, bytes: &[u8]) -> Result<Recording> {
    read_bytes(Path::new(name), bytes, &ReadOptions::default())
}

fn lenient(name: &str, bytes: &[u8]) -> Result<Recording> {
    read_bytes(Path::new(name), bytes, &ReadOptions { allow_truncated: true, ..ReadOptions::default() })
}

fn stamp(frame: usize) -> i64 {
    START + frame as i64 * 10_000_000
}

fn position(frame: usize, marker: usize) -> [f64; 3] {
    let (time, place) = (frame as f64 * 0.01, marker as f64);
    [10.0 * place + (7.0 * time).sin(), 40.0 - place / 3.0, 80.0 + (3.0 * time + place).cos()]
}

const MARKERS: usize = 4;

fn positions(frame: usize) -> Vec<[f64; 3]> {
    (0..MARKERS).map(|marker| position(frame, marker)).collect()
}

fn frames(count: usize) -> Vec<(i64, Vec<[f64; 3]>)> {
    (0..count).map(|frame| (stamp(frame), positions(frame))).collect()
}

fn named(count: usize) -> Vec<Entities> {
    let label = |(marker, p): (usize, &[f64; 3])| (format!("M{marker}"), *p);
    frames(count).iter().map(|(stamp, p)| (*stamp, p.iter().enumerate().map(label).collect())).collect()
}

fn spheres(count: usize) -> Vec<(i64, Vec<Shown>)> {
    let sphere = |(id, p): (usize, &[f64; 3])| Shown::sphere("face", id as i32, *p);
    frames(count).iter().map(|(stamp, p)| (*stamp, p.iter().enumerate().map(sphere).collect())).collect()
}

/// Labels `<before>0` to `<before>3` behind `first`, on the tracks of [`position`].
#[track_caller]
fn check(recording: &Recording, label: impl Fn(usize) -> String, frames: usize, tolerance: f64) {
    assert_eq!(recording.labels, (0..MARKERS).map(label).collect::<Vec<_>>());
    assert_eq!(recording.frames.len(), frames);
    for (k, frame) in recording.frames.iter().enumerate() {
        assert!((frame.time_s - 0.01 * k as f64).abs() < 1e-9);
        for (marker, found) in frame.positions_mm.iter().enumerate() {
            let (found, truth) = (found.unwrap(), position(k, marker));
            assert!((0..3).all(|i| (found[i] - truth[i]).abs() <= tolerance), "{found:?} instead of {truth:?}");
        }
    }
}

/// Name of the format, messages, and what each marker is called.
type Messages = (&'static str, Topic, fn(usize) -> String);

fn message_topics(count: usize) -> Vec<Messages> {
    let nowhere = ([0.0; 3], [0.0, 0.0, 0.0, 1.0]);
    vec![
        ("pose array", others::pose_array(&frames(count)), |k| k.to_string()),
        ("marker array", others::marker_array(&spheres(count)), |k| format!("face/{k}")),
        ("point cloud", others::cloud_json(&frames(count), nowhere.0, nowhere.1), |k| (100 + k).to_string()),
        ("point cloud", others::cloud_protobuf(&frames(count)), |k| (100 + k).to_string()),
        ("scene update", others::scene_json(&named(count)), |k| format!("M{k}")),
        ("scene update", others::scene_protobuf(&named(count)), |k| format!("M{k}")),
    ]
}

#[test]
fn messages_of_other_programs_give_the_same_tracks() {
    for (format, topic, label) in message_topics(20) {
        for kind in ["zstd", "lz4", "none"] {
            let recording = load("test.mcap", &file(container(kind), std::slice::from_ref(&topic))).unwrap();
            check(&recording, label, 20, 0.0);
            assert_eq!((recording.source.format.as_str(), recording.source.clock), (format, Clock::Header));
            assert_eq!(recording.frames[3].stamp_ns, stamp(3));
            assert_eq!(recording.health.warnings, []);
        }
    }
}

/// A cloud and a list of points stand in a frame of their own, which is turned by 90 degrees about z and shifted.
#[test]
fn points_are_placed_by_the_pose_of_their_message() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let (shift, turn) = ([5.0, -3.0, 100.0], [0.0, 0.0, half, half]);
    let own: Vec<_> = frames(3)
        .into_iter()
        .map(|(stamp, points)| {
            (stamp, points.iter().map(|[x, y, z]| [y - shift[1], -(x - shift[0]), z - shift[2]]).collect::<Vec<_>>())
        })
        .collect();
    let cloud = load("test.mcap", &file(container("zstd"), &[others::cloud_json(&own, shift, turn)])).unwrap();
    check(&cloud, |k| (100 + k).to_string(), 3, 1e-12);
    let list = |(stamp, points): &(i64, Vec<[f64; 3]>)| {
        let sphere = Shown::sphere("face", 7, shift);
        (*stamp, vec![Shown { kind: 7, orientation: turn, points: points.clone(), ..sphere }])
    };
    let lists: Vec<_> = own.iter().map(list).collect();
    let array = load("test.mcap", &file(container("zstd"), &[others::marker_array(&lists)])).unwrap();
    check(&array, |k| format!("face/7/{k}"), 3, 1e-12);
    // a lost point of the cloud is not moved away from the origin
    let mut lost = own.clone();
    lost[1].1[2] = [0.0; 3];
    let cloud = load("test.mcap", &file(container("zstd"), &[others::cloud_json(&lost, shift, turn)])).unwrap();
    assert_eq!(cloud.frames[1].positions_mm[2], None);
    assert_eq!(cloud.health.labels[2].missing, Missing { zero: 1, ..Missing::default() });
    // a quaternion that is none
    let odd = others::cloud_json(&own, shift, [0.0, 0.0, 0.5, 0.5]);
    let error = load("test.mcap", &file(container("zstd"), &[odd])).unwrap_err();
    assert!(matches!(error, Error::Undecodable { fault: Fault::Quaternion { .. }, .. }), "{error}");
}

#[test]
fn what_a_message_takes_away_or_lacks_is_lost_in_its_frame() {
    let mut arrays = spheres(3);
    arrays[1].1[2].action = 2;
    arrays[2].1.remove(0);
    let array = load("test.mcap", &file(container("zstd"), &[others::marker_array(&arrays)])).unwrap();
    assert_eq!((array.frames[1].positions_mm[2], array.frames[2].positions_mm[0]), (None, None));
    assert_eq!(array.health.labels.iter().map(|l| l.missing.absent).collect::<Vec<_>>(), [1, 0, 1, 0]);
    arrays[1].1[1].frame = "camera";
    let error = load("test.mcap", &file(container("zstd"), &[others::marker_array(&arrays)])).unwrap_err();
    assert!(matches!(error, Error::Undecodable { fault: Fault::Frames { .. }, .. }), "{error}");
    assert!(error.to_string().contains("`lab` and `camera`"), "{error}");

    let mut entities = named(2);
    entities[1].1[3].1 = [f64::NAN; 3];
    for topic in [others::scene_json(&entities), others::scene_protobuf(&entities)] {
        let scene = load("test.mcap", &file(container("zstd"), &[topic])).unwrap();
        assert_eq!(scene.frames[1].positions_mm[3], None);
        assert_eq!(scene.health.labels[3].missing, Missing { absent: 1, ..Missing::default() });
    }
}

#[test]
fn messages_that_do_not_hold_what_their_schema_says_are_refused() {
    for (format, good, _) in message_topics(1) {
        let payload = good.messages[0].payload.clone();
        let mut refused = 0;
        for cut in 0..payload.len() {
            let mut topic = good.clone();
            topic.messages[0].payload.truncate(cut);
            match load("test.mcap", &file(container("none"), &[topic])) {
                // protobuf may end after any field: what is there is right
                Ok(part) => {
                    assert_eq!(good.encoding, "protobuf", "{format}: {cut} bytes");
                    for p in part.frames[0].positions_mm.iter().flatten() {
                        assert!(
                            (0..MARKERS).any(|marker| position(0, marker) == *p),
                            "{format}: {p:?} of {cut} bytes"
                        );
                    }
                }
                Err(error) => {
                    assert!(["M010", "M011"].contains(&error.code()), "{format}: {error}");
                    refused += 1;
                }
            }
        }
        assert!(refused * 10 > payload.len() * 5, "{format}: only {refused} of {} were refused", payload.len());
    }
    for (schema, words) in [(b"nonsense".to_vec(), "descriptors"), (Vec::new(), "no `foxglove.PointCloud`")] {
        let mut topic = others::cloud_protobuf(&frames(1));
        topic.schema.2 = schema;
        let error = load("test.mcap", &file(container("none"), &[topic])).unwrap_err();
        assert!(error.code() == "M005" && error.to_string().contains(words), "{error}");
    }
}

/// Single flipped bits of whole files with these messages: the same recording or an error, never another position.
#[test]
fn a_flipped_bit_never_gives_a_wrong_value() {
    for (format, topic, _) in message_topics(12) {
        let mut bytes = file(container("zstd").calculate_data_section_crc(false), &[topic]);
        let good = load("test.mcap", &bytes).unwrap();
        let mut errors = 0;
        let step = bytes.len() * 8 / 200;
        for flip in 0..200 {
            let bit = flip * step + (flip * 7919) % step;
            bytes[bit / 8] ^= 1 << (bit % 8);
            match catch_unwind(AssertUnwindSafe(|| load("test.mcap", &bytes))).expect("no panic") {
                Ok(recording) => assert!(recording == good, "{format}: wrong values with bit {bit} flipped"),
                Err(error) => {
                    assert!(error.code().starts_with('M'), "{format}: {error}");
                    errors += 1;
                }
            }
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        assert!(errors > 120, "{format}: only {errors} of 200 flips were seen");
    }
}

fn tracks(count: usize) -> Tracks {
    let frame = |frame| positions(frame).into_iter().map(Some).collect();
    Tracks {
        labels: (0..MARKERS).map(|k| format!("M{k}")).collect(),
        rate: 100.0,
        frames: (0..count).map(frame).collect(),
    }
}

/// The name, the bytes, and how far off a position may be, of every kind of file.
fn kinds(tracks: &Tracks) -> Vec<(&'static str, Vec<u8>, f64)> {
    let mut kinds = vec![
        ("test.trc", files::trc(tracks).into_bytes(), 0.0),
        ("wide.csv", files::wide(tracks, "_mm").into_bytes(), 0.0),
        ("bare.CSV", files::wide(tracks, "").into_bytes(), 0.0),
        ("long.csv", files::long(tracks).into_bytes(), 0.0),
    ];
    for processor in [Processor::Intel, Processor::Dec, Processor::Mips] {
        kinds.push(("floats.c3d", files::c3d(tracks, processor, None), 1e-5));
        kinds.push(("words.c3d", files::c3d(tracks, processor, Some(0.01)), 0.0051));
    }
    kinds
}

#[test]
fn files_give_the_same_tracks() {
    let mut tracks = tracks(20);
    for (name, bytes, tolerance) in kinds(&tracks) {
        let recording = load(name, &bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        check(&recording, |k| format!("M{k}"), 20, tolerance);
        assert_eq!(recording.source.clock, Clock::File);
        assert!((recording.health.rate_hz.unwrap() - 100.0).abs() < 1e-6);
        assert_eq!(recording.health.warnings, [], "{name}");
        let says = if name == "bare.CSV" { vec![] } else { vec!["mm"] };
        assert_eq!(recording.source.units_declared, says, "{name}");
        let metres = read_bytes(Path::new(name), &bytes, &ReadOptions { units: Units::M, ..ReadOptions::default() });
        let warnings = metres.unwrap().health.warnings;
        assert_eq!(warnings.is_empty(), name == "bare.CSV", "{warnings:?}");
        let page = inspect_bytes(Path::new(name), &bytes).unwrap().to_string();
        assert!(page.contains("without checksums") && page.contains("20 frames") && page.contains("M3"), "{page}");
        let asked = ReadOptions { topic: Some("/markers".into()), ..ReadOptions::default() };
        assert_eq!(read_bytes(Path::new(name), &bytes, &asked).unwrap_err().code(), "M007");
    }
    tracks.frames[3][2] = None;
    for (name, bytes, _) in kinds(&tracks) {
        let recording = load(name, &bytes).unwrap();
        assert_eq!(recording.frames[3].positions_mm[2], None, "{name}");
        assert_eq!(recording.health.labels[2].missing.total(), 1, "{name}");
        assert_eq!(recording.frames.iter().flat_map(|f| &f.positions_mm).flatten().count(), 79, "{name}");
    }
}

/// A file that is cut short anywhere is an error, and its intact part, where that is allowed, has no wrong position. Only a
/// CSV that ends after a whole row is a shorter CSV: nothing in it says how long it was.
#[test]
fn files_that_are_cut_short_are_told() {
    let tracks = tracks(5);
    for (name, bytes, tolerance) in kinds(&tracks) {
        for length in 0..bytes.len() {
            let short = &bytes[..length];
            match load(name, short) {
                Ok(recording) => {
                    // a TRC that lost nothing but the end of its last line is refused like the others
                    let rows = short.ends_with(b"\n") && name.to_lowercase().ends_with("csv");
                    assert!(rows, "{name} of {length} bytes is read");
                    part(&recording, tolerance);
                }
                Err(error) => assert!(["M010", "M015"].contains(&error.code()), "{name}: {error}"),
            }
            if let Ok(recording) = lenient(name, short) {
                part(&recording, tolerance);
                let told = recording.health.warnings.iter().any(|w| matches!(w, Warning::Truncated { .. }));
                assert!(told || short.ends_with(b"\n"), "{name} of {length} bytes");
            }
        }
    }
}

/// Every position is one that was written.
#[track_caller]
fn part(recording: &Recording, tolerance: f64) {
    for (k, frame) in recording.frames.iter().enumerate() {
        for (label, found) in recording.labels.iter().zip(&frame.positions_mm) {
            let Some(found) = found else { continue };
            let truth = position(k, label[1..].parse().unwrap());
            assert!((0..3).all(|i| (found[i] - truth[i]).abs() <= tolerance), "{label} in frame {k}: {found:?}");
        }
    }
}

/// Without checksums a changed byte may pass as another number, but nothing panics, and what the file says twice must agree.
#[test]
fn damaged_files_do_not_panic_and_contradictions_are_told() {
    let tracks = tracks(4);
    for (name, good, _) in kinds(&tracks) {
        for (place, bit) in (0..good.len()).flat_map(|place| [(place, 1), (place, 6)]) {
            let mut bytes = good.clone();
            bytes[place] ^= 1 << bit;
            let read = catch_unwind(AssertUnwindSafe(|| load(name, &bytes)));
            match read.unwrap_or_else(|_| panic!("{name}: panic with byte {place} changed")) {
                Ok(_) => {}
                Err(error) => assert!(["M010", "M015"].contains(&error.code()), "{name}: {error}"),
            }
        }
    }
    let trc = files::trc(&tracks);
    let wide = files::wide(&tracks, "_mm");
    let long = files::long(&tracks);
    let cases = [
        ("a.trc", trc.replace("\t4\t4\tmm", "\t5\t4\tmm"), "line 10: the file has 4 frames, NumFrames says 5"),
        ("a.trc", trc.replace("\tM2\t", "\t\t"), "line 4: there are 3 labels, NumMarkers says 4"),
        ("a.trc", trc.replace("Y2\t", ""), "line 5: the axes are not"),
        ("a.trc", trc.replace("\n3\t", "\n5\t"), "line 9: frame 5 at 0.02 s does not follow"),
        ("a.trc", trc.replace("\t40.0\t", "\t40,0\t"), "is no number: `40,0`"),
        ("a.trc", trc.replace("\t40.0\t", "\t\t"), "`M0` has some coordinates and lacks others"),
        ("a.trc", trc.replace("\t40.0\t", "\t"), "the row has 13 cells, not 14"),
        ("a.trc", trc.replace("PathFileType", "PathFile"), "line 1: a TRC file starts with"),
        ("a.csv", wide.replace("M1_y_mm", "M1_y"), ""),
        ("a.csv", wide.replace("M1_y_mm", "M1_w"), "line 1: column `M1_w` is neither"),
        ("a.csv", wide.replace("M1_y_mm", "M1_x_mm"), "column `M1_x_mm` stands there twice"),
        ("a.csv", wide.replace("time_s", "seconds"), "there is no column `time_s`"),
        ("a.csv", wide.replace(",40.0,", ","), "line 2: the row has 12 cells, the header 13"),
        ("a.csv", wide.replace(",40.0,", ",,"), "`M0` has some coordinates"),
        ("a.csv", long.replace("z_mm,", "w_mm,"), "there are not all of the columns"),
        ("a.csv", long.replace("\"M2\"", "\"M2"), "a quote is not closed"),
        ("a.csv", String::new(), "the file is empty"),
    ];
    for (name, text, words) in cases {
        match load(name, text.as_bytes()) {
            Ok(_) => assert!(words.is_empty(), "{name}: `{words}` is not told"),
            Err(error) => {
                let told = error.to_string();
                assert!(error.code() == "M015" && !words.is_empty() && told.contains(words), "`{words}`: {told}");
                assert!(error.help().is_some());
            }
        }
    }
    let c3d = files::c3d(&tracks, Processor::Intel, None);
    let changed = |place: usize, value: u8| {
        let mut bytes = c3d.clone();
        bytes[place] = value;
        load("a.c3d", &bytes).unwrap_err().to_string()
    };
    assert!(changed(1, 0).contains("not the header of a C3D file"));
    assert!(changed(2, 3).contains("parameter POINT:USED 4"), "{}", changed(2, 3));
    assert!(changed(8, 3).contains("parameter POINT:FRAMES 4"), "{}", changed(8, 3));
    assert!(changed(16, 1).contains("inside the parameters"));
    assert!(changed(512 + 3, 80).contains("processor 80"));
    // the whole of a frame too much
    let error = load("a.c3d", &[&c3d[..], &[0; 2000]].concat()).unwrap_err();
    assert!(error.to_string().contains("2000 bytes are left behind 4 frames of 72 bytes"), "{error}");
}

/// `risorius <arguments>` in a folder: exit code, standard output, standard error.
fn risorius(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("risorius").unwrap().current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn files_are_converted_to_mcap() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = tracks(10);
    for (k, (name, bytes, tolerance)) in kinds(&tracks).into_iter().enumerate() {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let out = format!("{k}.mcap");
        let (mut exit, mut stdout, stderr) = risorius(folder.path(), &["markers", "convert", name, &out]);
        if name == "bare.CSV" {
            assert!(exit == 3 && stderr.contains("M016") && stderr.contains("--units"), "{stderr}");
            (exit, stdout, _) = risorius(folder.path(), &["markers", "convert", name, &out, "--units", "mm"]);
        }
        assert!(exit == 0 && stdout.contains("10 frames of 4 markers"), "{name}: {stdout}{stderr}");
        let recording = read(&folder.path().join(&out), &ReadOptions::default()).unwrap();
        check(&recording, |k| format!("M{k}"), 10, tolerance);
        assert_eq!(recording.source.units_declared, ["mm"]);
    }
    let again = ["markers", "convert", "test.trc", "0.mcap"];
    let (exit, _, stderr) = risorius(folder.path(), &again);
    assert!(exit == 6 && stderr.contains("O008"), "{stderr}");
    assert_eq!(risorius(folder.path(), &[&again[..], &["--force"]].concat()).0, 0);
    let (exit, _, stderr) = risorius(folder.path(), &["markers", "convert", "test.trc", "m.mcap", "--units", "m"]);
    assert!(exit == 0 && stderr.contains("M020") && stderr.contains("`mm`"), "{stderr}");
    let metres = read(&folder.path().join("m.mcap"), &ReadOptions::default()).unwrap();
    assert_eq!(metres.frames[0].positions_mm[0], Some(position(0, 0).map(|x| 1000.0 * x)));
}

/// Labels of another system are matched to the markers of a problem wherever the recording stands, with more labels in the
/// recording than the problem wants; the proposal put into the problem passes the check.
#[test]
fn labels_are_matched_by_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let block = "[task]\nkind = \"fit\"\n[mesh]\nblock = { origin_mm = [0, 0, 0], size_mm = [40, 30, 10], elements = [2, 1, 1] }\n\
        [tissue]\nmooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }\n[[muscle]]\nname = \"slab\"\n\
        block = { origin_mm = [4, 2, 6], size_mm = [30, 6, 3], elements = [4, 2, 1] }\nfibre_angles_deg = [0, 0, 0]\n\
        blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }\n\
        [[support]]\nclamp = { face = \"xi1=0\" }\n[fit]\nmarkers = \"lab.csv\"\nunits = \"mm\"\nregister = \"rigid\"\n";
    let markers = [
        ("brow.L", [5.0, 0.0, 7.0]),
        ("brow.R", [6.0, 30.0, 8.0]),
        ("nose", [20.0, 14.0, 10.0]),
        ("lip.L", [30.0, 8.0, 10.0]),
        ("lip.R", [31.0, 22.0, 10.0]),
        ("chin", [40.0, 16.0, 4.0]),
        ("ear.R", [12.0, 30.0, 2.0]),
    ];
    let mut shown: Vec<(String, [f64; 3])> = markers
        .iter()
        .enumerate()
        // turned by a third of a turn about the diagonal, and shifted
        .map(|(k, (_, [x, y, z]))| (format!("u{}", (5 * k + 3) % 7), [y + 500.0, z - 80.0, x + 0.1 * k as f64]))
        .collect();
    shown.push(("wand".into(), [900.0, 300.0, 60.0]));
    shown.sort_by(|a, b| a.0.cmp(&b.0));
    let (labels, positions): (Vec<_>, Vec<_>) = shown.into_iter().unzip();
    let frames = vec![positions.into_iter().map(Some).collect(); 2];
    let tracks = Tracks { labels, rate: 50.0, frames };
    std::fs::write(folder.path().join("lab.csv"), files::wide(&tracks, "_mm")).unwrap();
    let tables: String =
        markers.iter().map(|(name, p)| format!("[[marker]]\nname = \"{name}\"\nposition_mm = {p:?}\n")).collect();
    std::fs::write(folder.path().join("problem.toml"), format!("{block}{tables}")).unwrap();
    assert_eq!(risorius(folder.path(), &["check", "problem.toml"]).0, 3);
    let (exit, stdout, stderr) = risorius(folder.path(), &["markers", "match", "problem.toml"]);
    assert_eq!(exit, 0, "{stderr}");
    for (k, (name, _)) in markers.iter().enumerate() {
        let expected = format!("name = \"{name}\"\nlabel = \"u{}\"    # ", (5 * k + 3) % 7);
        assert!(stdout.contains(&expected), "{expected} is not in\n{stdout}{stderr}");
    }
    assert!(stderr.contains("7 of 7 markers matched") && stderr.contains("7 labels differ"), "{stderr}");
    std::fs::write(folder.path().join("problem.toml"), format!("{block}{stdout}")).unwrap();
    let (exit, page, stderr) = risorius(folder.path(), &["check", "problem.toml"]);
    assert!(exit == 0 && page.contains("registration: rigid, turned by 120."), "{page}{stderr}");
}
