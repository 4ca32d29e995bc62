//! The fit returns what made its markers.
//!
//! `reference/beam_twin.json` holds marker tracks of an independent implementation: a beam of 60 x 20 x 20 mm, 6 x 2 x 2
//! elements, clamped at xi1 = 0, Table 2 of Wu et al. 2013, kappa 10 kPa, 4 x 4 x 4 Gauss points, trilinear pressure, with
//! slabs of 50 x 16 x 4 mm (5 x 2 x 1 elements, 3 x 3 x 3 points) at (4.5, 2, 14.2), fibre angle 0, and at (4.5, 2, 1.8),
//! 36 degrees; `truth[frame]` are the activations (top, bottom), `positions_mm[frame][marker]` the markers, without noise.

use crate::common::BEAM_FIT;
use risorius::fit::covariance::Bound;
use risorius::fit::sensitivity::{Sensitivity, sensitivities};
use risorius::fit::{Estimate, Fit};
use risorius::forward::{Drive, Settings, Solver};
use risorius::markers::{Frame, ReadOptions, Recording, WriteOptions, read, write_json};
use risorius::model::State;
use risorius::model::build::build;
use risorius::scene::{Scene, Units};
use std::fmt::Write;
use std::path::Path;

#[derive(serde::Deserialize)]
struct Twin {
    labels: Vec<String>,
    truth: Vec<[f64; 2]>,
    positions_mm: Vec<Vec<[f64; 3]>>,
}

/// Reference positions of the markers, in the order of the labels of the recording.
const MARKERS: [(&str, [f64; 3]); 12] = [
    ("B00", [20.0, 10.0, 20.0]),
    ("B01", [20.0, 10.0, 0.0]),
    ("B02", [20.0, 0.0, 10.0]),
    ("B03", [20.0, 20.0, 10.0]),
    ("B04", [40.0, 10.0, 20.0]),
    ("B05", [40.0, 10.0, 0.0]),
    ("B06", [40.0, 0.0, 10.0]),
    ("B07", [40.0, 20.0, 10.0]),
    ("B08", [60.0, 10.0, 20.0]),
    ("B09", [60.0, 10.0, 0.0]),
    ("B10", [60.0, 0.0, 10.0]),
    ("B11", [60.0, 20.0, 10.0]),
];

fn twin() -> Twin {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/beam_twin.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect("the file")).expect("its numbers")
}

fn problem(extra: &str) -> String {
    let mut text = String::from(BEAM_FIT);
    for (name, [x, y, z]) in MARKERS {
        writeln!(text, "[[marker]]\nname = \"{name}\"\nposition_mm = [{x}, {y}, {z}]").expect("text");
    }
    text + "[fit]\nmarkers = \"beam.mcap\"\nunits = \"m\"\n" + extra
}

/// Fits the chosen frames of a recording, through a file, as a user would.
fn fit(labels: &[String], frames: &[Frame], chosen: &[usize], extra: &str) -> Vec<Estimate> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("beam.mcap");
    write_json(&path, labels, frames, &WriteOptions { units: Units::M, ..WriteOptions::default() }).expect("written");
    let recording: Recording = read(&path, &ReadOptions { units: Units::M, ..ReadOptions::default() }).expect("read");
    let scene = Scene::parse(&problem(extra), "twin.toml", Path::new("."), &[]).expect("a scene");
    let built = build(&scene).expect("a model");
    let spec = scene.fit.as_ref().expect("a fit");
    let mut fit = Fit::new(&built.model, &scene, spec, &recording).expect("a fit");
    chosen.iter().map(|k| fit.frame(&recording, *k).unwrap_or_else(|error| panic!("frame {k}: {error}"))).collect()
}

fn frames(positions: &[Vec<[f64; 3]>]) -> Vec<Frame> {
    let frame = |(k, positions): (usize, &Vec<[f64; 3]>)| Frame {
        time_s: k as f64 / 30.0,
        stamp_ns: 1_000_000_000 + k as i64 * 33_333_333,
        positions_mm: positions.iter().map(|p| Some(*p)).collect(),
    };
    positions.iter().enumerate().map(frame).collect()
}

#[test]
fn truth_within_1e_6_in_every_frame() {
    let twin = twin();
    let all: Vec<usize> = (0..twin.truth.len()).collect();
    for (estimate, truth) in fit(&twin.labels, &frames(&twin.positions_mm), &all, "").iter().zip(&twin.truth) {
        for (found, truth) in estimate.equilibrium.state.controls.iter().zip(truth) {
            assert!((found - truth).abs() < 1e-6, "frame {}: {found} instead of {truth}", estimate.frame);
        }
        assert!(estimate.rms_mm < 1e-4, "frame {}: rms {} mm", estimate.frame, estimate.rms_mm);
    }
}

/// A forward solve at the fitted activations: the bits of the fit from its own state, and the same place from rest.
#[test]
fn a_replay_of_the_fitted_activations_is_what_was_reported() {
    let twin = twin();
    let mut frames = frames(&twin.positions_mm);
    // measurements that no activations explain
    for (k, position) in frames.iter_mut().flat_map(|frame| frame.positions_mm.iter_mut().flatten()).enumerate() {
        (0..3).for_each(|i| position[i] += 0.3 * ((7 * k + 3 * i) as f64).sin());
    }
    let scene = Scene::parse(&problem(""), "twin.toml", Path::new("."), &[]).expect("a scene");
    let built = build(&scene).expect("a model");
    let bits =
        |state: &State| -> Vec<u64> { state.u.iter().flatten().chain(&state.p).map(|x| x.to_bits()).collect() };
    for estimate in fit(&twin.labels, &frames, &[4, 12, 28], "register = \"none\"\n") {
        let fitted = &estimate.equilibrium.state;
        let drive = Drive { controls: fitted.controls.clone(), load: fitted.load };
        let mut solver = Solver::new(&built.model, Settings::default()).expect("memory");
        let replay = solver.equilibrium_near(fitted, fitted, &drive).expect("an equilibrium").state;
        assert_eq!(bits(&replay), bits(fitted), "frame {}", estimate.frame);
        // so the residuals are those of the table
        let from_rest = solver.equilibrium(&built.model.rest(), &drive).expect("an equilibrium").state;
        assert!(estimate.rms_mm > 0.1);
        let pairs = from_rest.u.iter().flatten().zip(fitted.u.iter().flatten());
        let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("frame {}: {apart:.1e} mm from the state that is reached from rest", estimate.frame);
        // both are balanced to the tolerance of the solver, not further
        assert!(apart < 1e-4, "frame {}: {apart} mm", estimate.frame);
    }
}

#[test]
fn finite_differences_give_the_same_answer() {
    let twin = twin();
    let chosen = [4, 12, 20, 28];
    let frames = frames(&twin.positions_mm);
    let tangent = fit(&twin.labels, &frames, &chosen, "");
    let difference = fit(&twin.labels, &frames, &chosen, "sensitivity = \"finite-difference\"\n");
    for (a, b) in tangent.iter().zip(&difference) {
        for (a, b) in a.equilibrium.state.controls.iter().zip(&b.equilibrium.state.controls) {
            assert!((a - b).abs() < 1e-5 * a.abs().max(0.01), "{a} and {b}");
        }
    }
}

/// Frames with every marker up to 0.3 mm beside its place.
fn frames_that_do_not_fit(positions: &[Vec<[f64; 3]>]) -> Vec<Frame> {
    let mut frames = frames(positions);
    for (k, frame) in frames.iter_mut().enumerate() {
        for (m, position) in frame.positions_mm.iter_mut().flatten().enumerate() {
            let off = |i: usize| 0.3 * ((7 * k + 5 * m + 3 * i) as f64).sin();
            *position = std::array::from_fn(|i| position[i] + off(i));
        }
    }
    frames
}

/// Sensitivities that are kept from step to step change the way, not the answer, though the markers do not fit.
#[test]
fn kept_sensitivities_give_the_same_answer() {
    let twin = twin();
    let chosen: Vec<usize> = (10..16).collect();
    let frames = frames_that_do_not_fit(&twin.positions_mm);
    let fresh = fit(&twin.labels, &frames, &chosen, "reuse = \"fresh\"\n");
    for reuse in ["frozen", "broyden", "adjoint"] {
        let kept = fit(&twin.labels, &frames, &chosen, &format!("reuse = \"{reuse}\"\n"));
        for (a, b) in fresh.iter().zip(&kept) {
            assert!(a.rms_mm > 0.1, "the markers are off");
            for (a, b) in a.equilibrium.state.controls.iter().zip(&b.equilibrium.state.controls) {
                assert!((a - b).abs() < 2e-6, "{reuse}: {a} and {b}");
            }
            let [sd_a, sd_b] = [&a.sd, &b.sd].map(|sd| sd.iter().flatten().copied().collect::<Vec<f64>>());
            assert_eq!(sd_a.len(), sd_b.len());
            assert!(sd_a.iter().zip(&sd_b).all(|(a, b)| (a - b).abs() < 1e-3 * a), "{reuse}: {sd_a:?} and {sd_b:?}");
        }
        let steps = |all: &[Estimate]| all.iter().map(|e| e.iterations.len()).sum::<usize>();
        println!("{reuse}: {} steps, fresh {}", steps(&kept), steps(&fresh));
    }
}

/// A tolerance in standard deviations: the answer is so near to the optimum, in fewer steps, also where the markers themselves
/// say how far they scatter.
#[test]
fn a_tolerance_in_standard_deviations_is_kept() {
    let twin = twin();
    let chosen: Vec<usize> = (10..16).collect();
    let frames = frames_that_do_not_fit(&twin.positions_mm);
    for known in ["", "sd_mm = 0.2\n"] {
        let tight = fit(&twin.labels, &frames, &chosen, known);
        let loose = fit(&twin.labels, &frames, &chosen, &format!("{known}tolerance = {{ sds = 0.1 }}\n"));
        for (a, b) in tight.iter().zip(&loose) {
            let moved = a.equilibrium.state.controls.iter().zip(&b.equilibrium.state.controls).zip(&a.sd);
            for sds in moved.filter_map(|((a, b), sd)| Some((a - b).abs() / (*sd)?)) {
                assert!(sds < 0.1, "{sds}");
            }
        }
        let steps = |all: &[Estimate]| all.iter().map(|e| e.iterations.len()).sum::<usize>();
        println!("{} steps, {} to 1e-6", steps(&loose), steps(&tight));
        assert!(steps(&loose) < steps(&tight));
    }
}

/// dx/dq by the implicit function theorem and by central differences of whole equilibria, in the interior and at rest,
/// where the difference is one-sided. The step is small because the passive force of a slack fibre has a kink at stretch 1.
#[test]
fn sensitivities_agree() {
    let scene = Scene::parse(&problem(""), "twin.toml", Path::new("."), &[]).expect("a scene");
    let built = build(&scene).expect("a model");
    let settings = Settings { tolerance: 1e-10, ..Settings::default() };
    for controls in [[0.03, 0.07], [0.002, 0.0]] {
        let mut solver = Solver::new(&built.model, settings).expect("memory");
        let drive = Drive { controls: controls.to_vec(), load: 1.0 };
        let at = solver.equilibrium(&built.model.rest(), &drive).expect("an equilibrium");
        let tangent = sensitivities(Sensitivity::Tangent, &mut solver, &at, &[0, 1]).expect("a tangent");
        let how = Sensitivity::FiniteDifference { step: 1e-4 };
        let difference = sensitivities(how, &mut solver, &at, &[0, 1]).expect("differences");
        for (control, (a, b)) in tangent.iter().zip(&difference).enumerate() {
            let scale = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-6 * scale, "control {control} at {controls:?}: {:.1e}", worst / scale);
        }
    }
}

/// Markers that are lost drop out of the sum: their places are not guessed, and the truth is still found.
#[test]
fn missing_markers_drop_out() {
    let twin = twin();
    let mut frames = frames(&twin.positions_mm);
    for (k, frame) in frames.iter_mut().enumerate() {
        for (m, position) in frame.positions_mm.iter_mut().enumerate() {
            if (m + k) % 3 != 0 {
                *position = None;
            }
        }
    }
    for (estimate, k) in fit(&twin.labels, &frames, &[10, 17, 24], "").iter().zip([10, 17, 24]) {
        assert_eq!(estimate.measured_mm.iter().flatten().count(), 4);
        for (found, truth) in estimate.equilibrium.state.controls.iter().zip(twin.truth[k]) {
            assert!((found - truth).abs() < 1e-6, "frame {k}: {found} instead of {truth}");
        }
    }
}

/// With Gaussian noise of known size the standardised errors of the activations have unit variance: the covariance from
/// J^T J is right. Sixty noisy copies of one frame, two activations each: the mean square lies within 1 +- 0.45 (3.5 standard
/// deviations of a chi-square with 120 degrees of freedom).
#[test]
fn deviations_match_the_scatter_of_noisy_fits() {
    let twin = twin();
    let (frame, copies, noise) = (18, 60, 0.1);
    let mut seed = 2026_u64;
    let mut uniform = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    let noisy: Vec<Vec<[f64; 3]>> = (0..copies)
        .map(|_| {
            let jitter = |x: f64| {
                let normal = (-2.0 * uniform().ln()).sqrt() * (2.0 * std::f64::consts::PI * uniform()).cos();
                x + noise * normal
            };
            let mut jitter = jitter;
            twin.positions_mm[frame].iter().map(|p| p.map(&mut jitter)).collect()
        })
        .collect();
    let all: Vec<usize> = (0..copies).collect();
    let estimates = fit(&twin.labels, &frames(&noisy), &all, &format!("sd_mm = {noise}\n"));
    let mut squares = 0.0;
    for estimate in &estimates {
        for (control, truth) in twin.truth[frame].iter().enumerate() {
            assert_eq!(estimate.bounds[control], Bound::Free);
            let sd = estimate.sd[control].expect("determined");
            squares += ((estimate.equilibrium.state.controls[control] - truth) / sd).powi(2);
        }
    }
    let mean = squares / (2 * copies) as f64;
    assert!((mean - 1.0).abs() < 0.45, "mean square of standardised errors: {mean}");
}

/// A control on its bound has no standard deviation, and says on which bound it lies.
#[test]
fn bounds_hold_and_are_told() {
    let twin = twin();
    // moved against what the muscles can do: the beam bends down where only the top muscle is left to explain it
    let mut positions = vec![twin.positions_mm[0].clone()];
    for p in &mut positions[0] {
        p[2] -= 0.002 * p[0] * p[0];
    }
    let estimate = &fit(&twin.labels, &frames(&positions), &[0], "unknowns = [\"top\"]\n")[0];
    assert_eq!(estimate.equilibrium.state.controls, vec![0.0, 0.0]);
    assert_eq!(estimate.bounds[0], Bound::Lower);
    assert_eq!(estimate.sd, vec![None, None]);
}
