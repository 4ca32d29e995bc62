//! A head that turns by 15 degrees and moves by 20 mm while the muscles act: the activations are found as if it had stayed.
//!
//! The twin is that of `tests/twin.rs` (reference/beam_twin.json, an independent implementation).

use crate::common;
use crate::common::BEAM_FIT;
use crate::recordings::others;
use crate::recordings::writer::{Message, Ros2Marker, Topic, container, file, ros2_message};
use risorius::fit::registration::{Registration, register};
use risorius::fit::{Estimate, Fit, placement, recording};
use risorius::markers::{Clock, ReadOptions, read_poses_bytes};
use risorius::math::motion::Motion;
use risorius::math::tensor::{norm, normalised, rotation, subtract};
use risorius::model::build::build;
use risorius::scene::Scene;
use risorius::{Error, Warning};
use std::fmt::Write;
use std::path::Path;

#[derive(serde::Deserialize)]
struct Twin {
    labels: Vec<String>,
    truth: Vec<[f64; 2]>,
    positions_mm: Vec<Vec<[f64; 3]>>,
}

fn twin() -> Twin {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/beam_twin.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Reference positions of the markers.
const MARKERS: [[f64; 3]; 12] = [
    [20.0, 10.0, 20.0],
    [20.0, 10.0, 0.0],
    [20.0, 0.0, 10.0],
    [20.0, 20.0, 10.0],
    [40.0, 10.0, 20.0],
    [40.0, 10.0, 0.0],
    [40.0, 0.0, 10.0],
    [40.0, 20.0, 10.0],
    [60.0, 10.0, 20.0],
    [60.0, 10.0, 0.0],
    [60.0, 0.0, 10.0],
    [60.0, 20.0, 10.0],
];

/// Markers on what the beam is clamped to.
const BONE: [[f64; 3]; 5] =
    [[0.0, -5.0, 0.0], [0.0, 25.0, 2.0], [-4.0, 10.0, 30.0], [-25.0, 12.0, 10.0], [-15.0, -8.0, 22.0]];

const PERIOD: i64 = 33_333_333;

fn stamp(frame: usize) -> i64 {
    1_700_000_000_000_000_000 + frame as i64 * PERIOD
}

/// Where the head is in a frame: at rest in frame 0, turned by 15 degrees and moved by 20 mm in frame 15.
fn head(frame: usize) -> Motion {
    let part = (frame as f64 * std::f64::consts::PI / 30.0).sin();
    let turn = rotation(normalised([0.3, -0.8, 0.5]), part * 15_f64.to_radians());
    Motion { scale: 1.0, turn, shift: normalised([1.0, 2.0, -1.5]).map(|x| 20.0 * part * x) }
}

fn problem(fit: &str) -> String {
    let mut text = String::from(BEAM_FIT);
    for (k, [x, y, z]) in MARKERS.iter().enumerate() {
        writeln!(text, "[[marker]]\nname = \"B{k:02}\"\nposition_mm = [{x}, {y}, {z}]").unwrap();
    }
    format!("{text}[fit]\nmarkers = \"beam.mcap\"\nunits = \"mm\"\n{fit}\n")
}

/// Markers on skin and bone in a laboratory where everything stands `placed`; `slip` moves bone marker H4.
fn markers(placed: &Motion, slip: impl Fn(usize) -> [f64; 3], lost: impl Fn(usize, &str) -> bool) -> Topic {
    let twin = twin();
    let message = |frame: usize| {
        let at = |x: [f64; 3]| head(frame).then(placed).place(x);
        let skin = twin.labels.iter().zip(&twin.positions_mm[frame]).map(|(label, x)| (label.clone(), at(*x)));
        let bone = BONE.iter().enumerate().map(|(k, x)| {
            let by = if k == 4 { slip(frame) } else { [0.0; 3] };
            (format!("H{k}"), at(std::array::from_fn(|i| x[i] + by[i])))
        });
        let shown = skin.chain(bone).map(|(label, x)| {
            let x = if lost(frame, &label) { [f64::NAN; 3] } else { x };
            Ros2Marker::named(&label, x)
        });
        let payload = ros2_message(false, false, stamp(frame), &shown.collect::<Vec<_>>());
        Message { log_time: stamp(frame) as u64, publish_time: stamp(frame) as u64, payload }
    };
    Topic::ros2(false, (0..twin.truth.len()).map(message).collect())
}

/// Quaternion (x, y, z, w) of a turn.
fn quaternion(motion: &Motion) -> [f64; 4] {
    let vector = motion.rotation_vector();
    let angle = norm(vector);
    let [x, y, z] = if angle > 0.0 { vector.map(|v| v * (0.5 * angle).sin() / angle) } else { [0.0; 3] };
    [x, y, z, (0.5 * angle).cos()]
}

type Fitted = (Registration, Vec<Warning>, Vec<Estimate>);

/// Reads, registers and fits the chosen frames, through a file.
fn fitted(topics: &[Topic], fit: &str, chosen: &[usize]) -> Result<Fitted, Error> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("beam.mcap"), file(container("zstd"), topics)).unwrap();
    let scene = Scene::parse(&problem(fit), "head.toml", folder.path(), &[]).unwrap();
    let built = build(&scene).unwrap();
    let spec = scene.fit.as_ref().unwrap();
    let mut clip = recording::read(spec)?;
    let poses = recording::poses(spec, &clip, None)?;
    let placed = placement::place(&scene, spec, built.model.mesh(), &clip)?;
    let (registration, warnings) = register(&scene, spec, built.model.mesh(), &placed, &mut clip, poses.as_ref())?;
    let mut fit = Fit::new(&built.model, &scene, spec, &clip)?;
    let estimates = chosen.iter().map(|k| fit.frame(&clip, *k)).collect::<Result<_, _>>()?;
    Ok((registration, warnings, estimates))
}

#[track_caller]
fn assert_truth(estimates: &[Estimate], tolerance: f64) {
    let twin = twin();
    for estimate in estimates {
        for (found, truth) in estimate.equilibrium.state.controls.iter().zip(twin.truth[estimate.frame]) {
            assert!((found - truth).abs() < tolerance, "frame {}: {found}, not {truth}", estimate.frame);
        }
    }
}

const BONES: &str = "[fit.head]\nbone_markers = [\"H0\", \"H1\", \"H2\", \"H3\", \"H4\"]";
const CHOSEN: [usize; 3] = [8, 15, 22];

fn elsewhere() -> Motion {
    Motion { scale: 1.0, turn: rotation(normalised([1.0, 0.4, 0.2]), 1.1), shift: [400.0, -90.0, 1500.0] }
}

#[test]
fn bone_markers_take_the_head_out() {
    let topic = || markers(&Motion::REST, |_| [0.0; 3], |_, _| false);
    let (registration, warnings, estimates) = fitted(&[topic()], BONES, &CHOSEN).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_truth(&estimates, 1e-6);
    let head = registration.head.as_ref().unwrap();
    let [turn, _] = head.size(15, [0.0; 3]).unwrap();
    let shift = norm(head.frames[15].motion.unwrap().shift);
    assert!((turn - 15.0).abs() < 1e-6 && (shift - 20.0).abs() < 1e-6, "{turn} degrees, {shift} mm");
    assert!(head.frames.iter().all(|f| f.rms_mm.unwrap() < 1e-6 && f.markers == 5));
    assert!(registration.to_string().contains("turns by up to 15.00 degrees (frame 15)"), "{registration}");
    // the same wherever the laboratory has its origin
    let topic = markers(&elsewhere(), |_| [0.0; 3], |_, _| false);
    let fit = format!("register = \"rigid\"\n{BONES}");
    let (registration, warnings, estimates) = fitted(&[topic], &fit, &CHOSEN).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_truth(&estimates, 1e-6);
    let [turn, _] = registration.head.unwrap().size(15, [0.0; 3]).unwrap();
    assert!((turn - 15.0).abs() < 1e-6, "{turn} degrees");
}

#[test]
fn a_slipping_bone_marker_is_named_and_does_no_harm() {
    let slip = |frame: usize| if frame >= 5 { [1.5, -2.0, 1.5] } else { [0.0; 3] };
    let topic = markers(&Motion::REST, slip, |_, _| false);
    let (registration, warnings, estimates) = fitted(&[topic], BONES, &CHOSEN[..2]).unwrap();
    assert_eq!(warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["K014"]);
    let frames = twin().truth.len();
    let told =
        format!("`H4` moves against the others: it is off in {} of {frames} frames, first in frame 5", frames - 5);
    assert!(
        warnings[0].message.contains(&told) && warnings[0].message.contains("2.92 mm"),
        "{}",
        warnings[0].message
    );
    assert_truth(&estimates, 1e-6);
    assert_eq!(registration.head.unwrap().frames[15].markers, 4);
}

#[test]
fn frames_that_do_not_show_the_head_are_lost_and_counted() {
    let hidden = |frame: usize, label: &str| frame == 8 && ["H0", "H1", "H2"].contains(&label);
    let topic = || markers(&Motion::REST, |_| [0.0; 3], hidden);
    let (_, warnings, estimates) = fitted(&[topic()], BONES, &CHOSEN[1..2]).unwrap();
    assert_eq!(warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["K015"]);
    assert!(warnings[0].message.contains("in 1 of ") && warnings[0].message.contains("first in frame 8"));
    assert_truth(&estimates, 1e-6);
    assert_eq!(fitted(&[topic()], BONES, &[8]).unwrap_err().code(), "F003");
    // and the neutral frame must show it
    let error = fitted(&[topic()], &format!("neutral = 8\n{BONES}"), &[]).unwrap_err();
    assert_eq!((error.code(), error.place().is_some()), ("K012", true));
    let error = fitted(&[topic()], &BONES.replace("H3", "H9"), &[]).unwrap_err();
    assert_eq!(error.code(), "K002");
    assert!(error.to_string().contains("no marker `H9`"), "{error}");
}

#[test]
fn frames_whose_bone_markers_leave_the_head_open_are_told() {
    // a tenth of a millimetre of one of them; in frame 8 three are left, close together
    let noise = |frame: usize| [2.1, 4.7, 3.3].map(|rate| 0.2 * (rate * frame as f64).sin());
    let hidden = |frame: usize, label: &str| frame == 8 && ["H0", "H2"].contains(&label);
    let topic = markers(&Motion::REST, noise, hidden);
    let (_, warnings, _) = fitted(&[topic], BONES, &[1]).unwrap();
    assert_eq!(warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["K018"]);
    let message = &warnings[0].message;
    let frames = twin().truth.len();
    for told in [format!("in 1 of {frames} frames: in frame 8"), "`H1`, `H3`, `H4`, leave `B".to_owned()] {
        assert!(message.contains(&told), "{message}");
    }
    // five of them standard deviations of a bone marker (H C H^T of the three places)
    let after = |mark: &str| -> f64 {
        message.split(mark).nth(1).unwrap().split_whitespace().next().unwrap().parse().unwrap()
    };
    let (open, noise) = (after("open by "), after("a bone marker has "));
    assert!((open / noise - 4.96).abs() < 0.6 && noise > 0.02, "{message}");
}

#[test]
fn a_topic_of_poses_takes_the_head_out() {
    let own = Motion { scale: 1.0, turn: rotation(normalised([0.0, 1.0, 3.0]), 2.0), shift: [-30.0, 5.0, 70.0] };
    let pose = |frame: usize| {
        let pose = own.then(&head(frame)).then(&elsewhere());
        (stamp(frame), pose.shift, quaternion(&pose))
    };
    let frames = twin().truth.len();
    let all: Vec<_> = (0..frames).map(pose).collect();
    let topics = |poses: &[(i64, [f64; 3], [f64; 4])]| {
        [markers(&elsewhere(), |_| [0.0; 3], |_, _| false), others::poses("/head", poses)]
    };
    let fit = "register = \"rigid\"\n[fit.head]\npose_topic = \"/head\"";
    let (registration, warnings, estimates) = fitted(&topics(&all), fit, &CHOSEN).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_truth(&estimates, 1e-6);
    assert!(registration.to_string().contains("from the poses of `/head`; it turns by up to 15.00 degrees"));
    // axes that are called otherwise turn the poses with the markers
    let cycled = |[x, y, z]: [f64; 3]| [y, z, x];
    let turn = Motion { turn: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], ..Motion::REST };
    let placed = elsewhere().then(&turn);
    let called: Vec<_> = (0..frames)
        .map(|frame| {
            let pose = own.then(&head(frame)).then(&placed);
            (stamp(frame), cycled(elsewhere().place(head(frame).place(own.shift))), quaternion(&pose))
        })
        .collect();
    let called = [markers(&placed, |_| [0.0; 3], |_, _| false), others::poses("/head", &called)];
    let (_, _, estimates) = fitted(&called, &format!("axes = [\"z\", \"x\", \"y\"]\n{fit}"), &CHOSEN[1..2]).unwrap();
    assert_truth(&estimates, 1e-6);
    // a gap of three frames is not bridged
    let gap: Vec<_> = all.iter().enumerate().filter(|(k, _)| !(10..13).contains(k)).map(|(_, p)| *p).collect();
    let (_, warnings, _) = fitted(&topics(&gap), fit, &[]).unwrap();
    assert_eq!(warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["K015"]);
    assert!(warnings[0].message.contains("in 3 of "), "{}", warnings[0].message);
    for (topic, code) in [("/haed", "M007"), ("/markers", "M008")] {
        let error = fitted(&topics(&all), &fit.replace("/head", topic), &[]).unwrap_err();
        assert_eq!(error.code(), code, "{error}");
    }
}

/// Between two poses the head turns at constant speed and moves straight.
#[test]
fn poses_are_interpolated_between_neighbours_only() {
    let axis = normalised([1.0, 2.0, -2.0]);
    let at =
        |part: f64| Motion { scale: 1.0, turn: rotation(axis, 0.4 * part), shift: [10.0 * part, 0.0, -4.0 * part] };
    let poses: Vec<_> = (0..6)
        .map(|k| {
            let pose = at(k as f64);
            // the same turn by the other quaternion
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            (1000 * k, pose.shift, quaternion(&pose).map(|q| sign * q))
        })
        .collect();
    let bytes = file(container("none"), &[others::poses("/head", &poses)]);
    let read = |bytes: &[u8]| {
        read_poses_bytes(Path::new("test.mcap"), bytes, "/head", Clock::Header, &ReadOptions::default())
    };
    let found = read(&bytes).unwrap();
    assert_eq!(found.count(), 6);
    for time in [0, 250, 1000, 3999, 5000] {
        let (pose, truth) = (found.at(time).unwrap(), at(time as f64 / 1000.0));
        assert!(pose.then(&truth.inverse()).angle() < 1e-9, "{time}");
        assert!(norm(subtract(pose.shift, truth.shift)) < 1e-9, "{time}");
    }
    assert_eq!((found.at(-1), found.at(5001)), (None, None));
    let odd = file(container("none"), &[others::poses("/head", &[(0, [0.0; 3], [0.0, 0.0, 0.0, 1.1])])]);
    let error = read(&odd).unwrap_err();
    assert!(error.code() == "M011" && error.to_string().contains("length 1.1"), "{error}");
}

/// Runs the fit of frame 15 of a recording that stands elsewhere: its folder, and its page.
fn run_of_frame_15(fit: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let topic = markers(&elsewhere(), |_| [0.0; 3], |_, _| false);
    std::fs::write(folder.path().join("beam.mcap"), file(container("zstd"), &[topic])).unwrap();
    let fit = format!("register = \"rigid\"\nframes = {{ first = 15, last = 15 }}\n{fit}");
    std::fs::write(folder.path().join("head.toml"), problem(&fit)).unwrap();
    let mut command = assert_cmd::Command::cargo_bin("risorius").unwrap();
    let output = command.current_dir(&folder).args(["run", "head.toml", "--out", "run"]).output().unwrap();
    let page = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    (folder, page)
}

/// A run says how the head moved, on its page and in a table of its own.
#[test]
fn a_run_tells_how_the_head_moved() {
    let (folder, page) = run_of_frame_15(BONES);
    for words in
        ["head: taken out from 5 bone markers; it turns by up to 15.00 degrees (frame 15)", "registration: rigid"]
    {
        assert!(page.contains(words), "{words} is not in\n{page}");
    }
    let table = |name: &str| std::fs::read_to_string(folder.path().join("run/tables").join(name)).unwrap();
    let head = table("head.csv");
    assert_eq!(head.lines().count(), 1 + twin().truth.len());
    let row: Vec<f64> = head.lines().nth(16).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    let expected = normalised([0.3, -0.8, 0.5]).map(|x| 15.0 * x);
    // to the noise of the rigid fit of markers that are written to all digits
    assert!((0..3).all(|i| (row[2 + i] - expected[i]).abs() < 1e-5), "{row:?}");
    assert_eq!((row[0], row[9]), (15.0, 5.0));
    let registration = table("registration.csv");
    assert_eq!(registration.lines().next(), Some("name,skin_distance_mm,neutral_distance_mm,counted"));
    assert_eq!(registration.lines().count(), 13);
}

const FREE: &str = "[fit.head]\nestimate = true";

/// Without bone markers the skin markers alone tell the head from the muscles: 15 degrees and 20 mm come back with the
/// activations.
#[test]
fn a_head_is_estimated_together_with_the_activations() {
    let topic = markers(&Motion::REST, |_| [0.0; 3], |_, label| label.starts_with('H'));
    let (_, warnings, estimates) = fitted(&[topic], FREE, &CHOSEN).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_truth(&estimates, 1e-5);
    for estimate in &estimates {
        let (found, truth) = (estimate.head.as_ref().unwrap().motion, head(estimate.frame));
        assert!(found.then(&truth.inverse()).angle() < 1e-5, "{found:?} instead of {truth:?}");
        assert!(norm(subtract(found.shift, truth.shift)) < 1e-3, "{found:?} instead of {truth:?}");
        assert!(estimate.rms_mm < 1e-4, "frame {}: rms {} mm", estimate.frame, estimate.rms_mm);
    }
    // two markers do not say where the head is
    let topic = markers(&Motion::REST, |_| [0.0; 3], |frame, label| frame == 8 && !["B01", "B07"].contains(&label));
    let error = fitted(&[topic], FREE, &[8]).unwrap_err();
    assert!(error.code() == "F020" && error.to_string().contains("shows 2 markers"), "{error}");
}

/// With noise of known size the standardised errors of activations and head have unit variance: their deviations hold what one
/// takes from the other. Forty noisy copies of a frame, two activations, three angles and three shifts.
#[test]
fn deviations_hold_the_confounding_of_head_and_activations() {
    let (frame, copies, noise) = (15, 40, 0.1);
    let twin = twin();
    let mut random = common::Random::new(5);
    // uniform in +-1 has the standard deviation 1 / sqrt 3
    let mut jitter = |x: f64| x + noise * 3.0_f64.sqrt() * random.next();
    let mut messages = Vec::new();
    for copy in 0..=copies {
        // copy 0 is the neutral frame
        let motion = if copy == 0 { Motion::REST } else { head(frame) };
        let at = |x: [f64; 3]| motion.place(x);
        let positions = &twin.positions_mm[if copy == 0 { 0 } else { frame }];
        let shown: Vec<Ros2Marker> = twin
            .labels
            .iter()
            .zip(positions)
            .map(|(label, x)| Ros2Marker::named(label, at(*x).map(&mut jitter)))
            .collect();
        let payload = ros2_message(false, false, stamp(copy), &shown);
        messages.push(Message { log_time: stamp(copy) as u64, publish_time: stamp(copy) as u64, payload });
    }
    let all: Vec<usize> = (1..=copies).collect();
    let fit = format!("sd_mm = {noise}\n{FREE}");
    let (registration, _, estimates) = fitted(&[Topic::ros2(false, messages)], &fit, &all).unwrap();
    let (mut of_controls, mut of_turns, mut inflation) = (0.0, 0.0, 0.0_f64);
    for estimate in &estimates {
        let free = estimate.head.as_ref().unwrap();
        for (control, truth) in twin.truth[frame].iter().enumerate() {
            let sd = estimate.sd[control].expect("determined");
            of_controls += ((estimate.equilibrium.state.controls[control] - truth) / sd).powi(2);
            inflation = inflation.max(free.inflation[control].unwrap());
        }
        // the error of the head in the axes of the model, seen from the model
        let error = head(frame).then(&free.motion.inverse()).rotation_vector();
        let sd = free.sd.unwrap();
        of_turns += (0..3).map(|i| (error[i].to_degrees() / sd[i]).powi(2)).sum::<f64>();
    }
    let (of_controls, of_turns) = (of_controls / (2 * copies) as f64, of_turns / (3 * copies) as f64);
    println!(
        "mean squares {of_controls:.3} (activations), {of_turns:.3} (turns); inflation {inflation:.2}; {registration}"
    );
    // 3.5 standard deviations of a mean of 80 and of 120 squares
    assert!((of_controls - 1.0).abs() < 0.55, "activations: {of_controls}");
    assert!((of_turns - 1.0).abs() < 0.45, "turns: {of_turns}");
    assert!(inflation > 1.05, "a head that is not known costs something: {inflation}");
}

#[test]
fn a_run_tells_how_sure_an_estimated_head_is() {
    let (folder, page) = run_of_frame_15(&format!("sd_mm = 0.2\n{FREE}"));
    for words in
        ["head: estimated with the controls; it turns by up to 15.0", "times that with a known head", "  top: its sd"]
    {
        assert!(page.contains(words), "{words} is not in\n{page}");
    }
    let table = std::fs::read_to_string(folder.path().join("run/tables/head.csv")).unwrap();
    assert!(
        table.lines().next().unwrap().ends_with("correlation_top,inflation_top,correlation_bottom,inflation_bottom")
    );
    let row: Vec<f64> = table.lines().nth(1).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!(row.len() == 18 && row[8..14].iter().all(|sd| *sd > 0.0 && *sd < 5.0), "{row:?}");
    assert!((norm([row[2], row[3], row[4]]) - 15.0).abs() < 0.01, "{row:?}");
}
