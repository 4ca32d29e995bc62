//! A clip as a whole: what smoothing gains, whether its intervals hold the truth, frames that fail.

use crate::common::twin::{MARKERS, MUSCLES, problem, record, recording, scene};
use risorius::fit::covariance::Bound;
use risorius::fit::identifiability::Evidence;
use risorius::fit::{Estimate, Fit};
use risorius::markers::Recording;
use risorius::model::build::build;

const NOISE: f64 = 0.3;

/// Activations that rise and fall, each at its own pace.
fn truth(frames: usize) -> Vec<Vec<f64>> {
    let wave = |k: usize, pace: f64, by: f64| 0.5 - 0.5 * (by + pace * k as f64 / 30.0).cos();
    let at = |k: usize| {
        vec![
            0.008 + 0.02 * wave(k, 3.0, 0.0),
            0.010 + 0.02 * wave(k, 2.0, 1.0),
            0.012 + 0.01 * wave(k, 4.0, 2.0),
            0.008 + 0.01 * wave(k, 3.0, 3.0),
        ]
    };
    (0..frames).map(at).collect()
}

fn clip(truth: &[Vec<f64>], seed: u64) -> Recording {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("clip.mcap");
    record(&path, &problem(&MUSCLES, &MARKERS, ""), truth, NOISE, seed);
    recording(&path)
}

fn activations(estimate: &Estimate) -> &[f64] {
    &estimate.equilibrium.state.controls
}

fn rms<'a>(estimates: impl Iterator<Item = &'a Estimate>, truth: &[Vec<f64>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for estimate in estimates {
        for (found, truth) in activations(estimate).iter().zip(&truth[estimate.frame]) {
            (sum, count) = (sum + (found - truth).powi(2), count + 1);
        }
    }
    (sum / count as f64).sqrt()
}

/// Fits every frame, those that do not converge being `None`; with `then` a pass over all of them.
fn fit_clip<R>(extra: &str, recording: &Recording, then: impl FnOnce(&mut Fit<'_>, &[Option<Estimate>]) -> R) -> R {
    let scene = scene(&problem(&MUSCLES, &MARKERS, &format!("sd_mm = {NOISE}\n{extra}")));
    let built = build(&scene).unwrap_or_else(|error| panic!("{error}"));
    let spec = scene.fit.as_ref().expect("a fit");
    let mut fit = Fit::new(&built.model, &scene, spec, recording).unwrap_or_else(|error| panic!("{error}"));
    let fitted: Vec<_> = (0..recording.frames.len()).map(|k| fit.frame(recording, k).ok()).collect();
    then(&mut fit, &fitted)
}

/// With 0.3 mm of noise on every coordinate the activations of smoothed clips are at most half as far off as frame by frame, and
/// between 90 and 99 % of their 95 % intervals hold the truth: over three clips, since within one the errors of neighbouring
/// frames and of muscles that work against each other go together. First and second differences.
#[test]
fn smoothing_halves_the_error_and_its_intervals_hold_the_truth() {
    let truth = truth(40);
    let frames: Vec<usize> = (0..truth.len()).collect();
    let mean = |all: &[f64]| (all.iter().map(|rms| rms * rms).sum::<f64>() / all.len() as f64).sqrt();
    let clips: Vec<Recording> = (1..4).map(|seed| clip(&truth, seed)).collect();
    let alone = clips.iter().map(|clip| fit_clip("", clip, |_, fitted| rms(fitted.iter().flatten(), &truth)));
    let alone = mean(&alone.collect::<Vec<_>>());
    for smoothness in ["sd_per_root_s = 0.015", "sd_per_root_s3 = 0.15"] {
        let extra = format!("smoothness = {{ {smoothness} }}\nclip = \"smoother\"\n");
        let (mut smooth, mut causal, mut covered, mut all) = (Vec::new(), Vec::new(), 0, 0);
        for recording in &clips {
            fit_clip(&extra, recording, |fit, fitted| {
                causal.push(rms(fitted.iter().flatten(), &truth));
                let smoothed =
                    fit.smooth(recording, &frames, fitted, &|| false).expect("it converges").expect("to its end");
                assert!(smoothed.sweeps.len() <= 8, "{} sweeps", smoothed.sweeps.len());
                let estimates: Vec<Estimate> =
                    smoothed.frames.into_iter().map(|frame| frame.expect("a frame")).collect();
                smooth.push(rms(estimates.iter(), &truth));
                for estimate in &estimates {
                    let evidence = Evidence::of(estimate, fit.controls(), fit.unknowns()).expect("deviations");
                    let told = evidence.told(fit.markers(), &[true; 6]).expect("solved");
                    for (known, truth) in told.controls.iter().zip(&truth[estimate.frame]) {
                        all += 1;
                        covered += usize::from((known.interval[0]..=known.interval[1]).contains(truth));
                        if known.bound == Bound::Free {
                            // what the table of intervals has is what the fit says
                            let (a, b) =
                                (known.sd.expect("determined"), estimate.sd[known.control].expect("determined"));
                            assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
                            // it is where the objective is flat
                            let slope = evidence.gradient[known.control] * a;
                            assert!(slope.abs() < 1e-2, "{slope}");
                        }
                    }
                }
            });
        }
        let (smooth, causal, part) = (mean(&smooth), mean(&causal), covered as f64 / all as f64);
        println!(
            "{smoothness}: rms of activations alone {alone:.2e}, causal {causal:.2e}, smoothed {smooth:.2e}; {covered} of {all} \
             intervals hold the truth ({:.1} %)",
            100.0 * part
        );
        assert!(smooth <= 0.5 * alone && causal < alone, "{smooth} and {causal} of {alone}");
        assert!((0.90..=0.99).contains(&part), "{covered} of {all}");
    }
}

/// A frame without markers is bridged and marked; its intervals are wider.
#[test]
fn frames_that_fail_are_bridged() {
    let truth = truth(9);
    let mut recording = clip(&truth, 4);
    recording.frames[4].positions_mm.fill(None);
    let frames: Vec<usize> = (0..truth.len()).collect();
    fit_clip("smoothness = { sd_per_root_s = 0.03 }\nclip = \"smoother\"\n", &recording, |fit, fitted| {
        assert!(fitted[4].is_none() && fitted.iter().flatten().count() == 8);
        let smoothed = fit.smooth(&recording, &frames, fitted, &|| false).expect("it converges").expect("to its end");
        let estimates: Vec<Estimate> = smoothed.frames.into_iter().map(|frame| frame.expect("a frame")).collect();
        let bridged: Vec<usize> = estimates.iter().filter(|e| e.bridged).map(|e| e.frame).collect();
        assert_eq!(bridged, [4]);
        for k in 0..4 {
            let [before, own, after] = [3, 4, 5].map(|t: usize| activations(&estimates[t])[k]);
            assert!(own >= before.min(after) - 1e-9 && own <= before.max(after) + 1e-9, "{before} {own} {after}");
            if let [Some(before), Some(own), Some(after)] = [3, 4, 5].map(|t: usize| estimates[t].sd[k]) {
                assert!(own > before.max(after), "{before} {own} {after}");
            }
        }
        // it ends where it is told to
        assert!(fit.smooth(&recording, &frames, fitted, &|| true).expect("no error").is_none());
    });
}

/// The command smooths, and a fit that was ended goes on to the same bytes.
#[test]
fn a_smoothed_run_is_resumed() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = problem(
        &MUSCLES,
        &MARKERS,
        "sd_mm = 0.3\nsmoothness = { sd_per_root_s = 0.03 }\nclip = \"smoother\"\nmax_iterations = 6\n",
    );
    let truth: Vec<Vec<f64>> = std::iter::once(vec![0.0; 4]).chain(truth(5)).collect();
    record(&folder.path().join("clip.mcap"), &text, &truth, 0.1, 4);
    std::fs::write(folder.path().join("twin.toml"), &text).expect("written");
    let risorius = |arguments: &[&str], exit: i32| {
        let mut command = assert_cmd::Command::cargo_bin("risorius").expect("built");
        let output = command.current_dir(folder.path()).args(arguments).output().expect("it runs");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(exit), "{stderr}");
        stderr
    };
    let stderr = risorius(&["run", "twin.toml", "--out", "run"], 0);
    assert!(stderr.contains("smoothed over 6 frames"), "{stderr}");
    let table = |name: &str| std::fs::read(folder.path().join("run/tables").join(name)).expect("a table");
    let before = [table("activations.csv"), table("identifiability.csv"), table("markers.csv")];
    assert_eq!(before[0].iter().filter(|byte| **byte == b'\n').count(), 7);
    // as if it had been killed before it was smoothed
    std::fs::write(folder.path().join("run/status.json"), "{}").expect("written");
    risorius(&["resume", "run"], 0);
    assert!(before == [table("activations.csv"), table("identifiability.csv"), table("markers.csv")]);
}
