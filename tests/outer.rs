//! What all frames share: stiffness, strength and the direction of fibres come back from several poses, with intervals that hold
//! the truth; what cannot be told from activations is said to be so.

use crate::common::twin::{MARKERS, MUSCLES, problem, record, recording, scene};
use risorius::error::Warning;
use risorius::fit::outer::{Outcome, find};
use risorius::fit::sequence::sought;
use risorius::model::build::build;
use risorius::report::summary::{outer_page, outer_warnings};
use risorius::scene::{AngleMode, LawSpec, OuterWhat};

/// A known force on the tip.
const LOAD: &str = "[[load]]\ntraction = { face = \"xi1=1\", kpa = [0, 0, -0.004] }\n";
const STIFFNESS: &str = "[fit.outer]\n[[fit.outer.unknown]]\nstiffness = \"tissue\"\n";

/// Activations of two muscles in four poses.
fn poses() -> Vec<Vec<f64>> {
    vec![vec![0.012, 0.004], vec![0.004, 0.02], vec![0.02, 0.015], vec![0.008, 0.01]]
}

/// A problem of two muscles; `rest` follows the keys of [fit], `other` comes before its tables.
fn text(load: &str, rest: &str) -> String {
    problem(&[MUSCLES[0], MUSCLES[3]], &MARKERS, rest).replace("[[support]]", &format!("{load}[[support]]"))
}

/// Looks for the outer unknowns of `asked` in a recording of `made`.
fn found(made: &str, asked: &str, truth: &[Vec<f64>], noise: f64, seed: u64) -> (Outcome, Vec<Warning>, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("clip.mcap");
    record(&path, made, truth, noise, seed);
    let (clip, scene) = (recording(&path), scene(asked));
    let fit = scene.fit.as_ref().expect("a fit");
    let outer = fit.outer.as_ref().expect("outer unknowns");
    let frames: Vec<usize> = (0..clip.frames.len()).collect();
    let mut say = |line: String| println!("{line}");
    let outcome = find(&scene, (fit, outer), (&clip, &frames), &|| false, &mut say);
    let outcome = outcome.unwrap_or_else(|error| panic!("{error}")).expect("to its end");
    let model = build(&scene).expect("a model").model;
    let names: Vec<&str> = sought(fit, &model).into_iter().map(|k| model.controls()[k].name.as_str()).collect();
    let page = outer_page(&outcome, &names);
    let warnings = outer_warnings(&outcome, &names).into_iter().map(|(_, warning)| warning).collect();
    println!("{page}{warnings:?}");
    (outcome, warnings, page)
}

fn stiffer(text: &str, factor: f64) -> String {
    let law = format!("c1_kpa = {}, c2_kpa = {}", 0.5 * factor, 0.2 * factor);
    text.replace("c1_kpa = 0.5, c2_kpa = 0.2", &law)
}

/// Without noise the stiffness is found to what the search promises, and the activations with it.
#[test]
fn without_noise_a_stiffness_is_exact() {
    let outer = STIFFNESS.replace("[fit.outer]", "[fit.outer]\ntolerance = 1e-6") + "sd = 100\n";
    let asked = text(LOAD, &format!("sd_mm = 0.1\n{outer}"));
    let (outcome, warnings, _) = found(&stiffer(&text(LOAD, ""), 1.3), &asked, &poses(), 0.0, 1);
    let stiffness = &outcome.found[0];
    assert!((stiffness.value - 1.3).abs() < 1e-4, "{stiffness:?}");
    for (estimate, truth) in outcome.estimates.iter().zip(poses()) {
        for (found, truth) in estimate.equilibrium.state.controls.iter().zip(truth) {
            assert!((found - truth).abs() < 1e-5, "{found} instead of {truth}");
        }
    }
    assert!(!stiffness.prior_dominated && warnings.iter().all(|w| !w.message.contains("not determined")));
    // its sd holds what the activations take away
    let (sd, known) = (stiffness.sd.expect("free"), stiffness.sd_with_known_controls.expect("free"));
    assert!(sd > 1.2 * known && sd < 0.2, "{sd} and {known}");
}

/// With noise of known size the standardised errors of the stiffness have unit variance, over eight recordings, and its
/// intervals hold the truth.
#[test]
fn the_interval_of_a_stiffness_holds_the_truth() {
    let (made, asked) = (stiffer(&text(LOAD, ""), 0.8), text(LOAD, &format!("sd_mm = 0.2\n{STIFFNESS}")));
    let (mut squares, mut held) = (0.0, 0);
    for seed in 0..8 {
        let (outcome, ..) = found(&made, &asked, &poses()[..3], 0.2, seed);
        let stiffness = &outcome.found[0];
        squares += ((stiffness.value / 0.8_f64).ln() / stiffness.sd.expect("free")).powi(2);
        held += usize::from((stiffness.interval[0]..=stiffness.interval[1]).contains(&0.8));
        // the controls are less sure than with a stiffness that is known, and that is told
        let frame = &outcome.confounding.frames[0];
        assert!(frame.sd[0].expect("free") > frame.sd_known[0].expect("free"));
    }
    println!("mean square {:.3}, {held} of 8 intervals hold the truth", squares / 8.0);
    // of a chi-square with 8 degrees of freedom over 8, 99.8 % lie between 0.11 and 3.27
    assert!((0.11..3.27).contains(&(squares / 8.0)) && held >= 7, "{squares} {held}");
}

/// Strength and activation of a muscle are one product: that is said, and the prior is what remains. Where the activation is
/// known the strength comes back.
#[test]
fn strength_is_confounded_with_activation() {
    let made = text("", "").replacen("sigma_max_kpa = 300", "sigma_max_kpa = 240", 1);
    let outer = "[fit.outer]\n[[fit.outer.unknown]]\nsigma_max = \"top.L\"\nsd = 0.3\n";
    let (outcome, warnings, page) = found(&made, &text("", &format!("sd_mm = 0.1\n{outer}")), &poses(), 0.1, 2);
    let strength = &outcome.found[0];
    assert!(strength.prior_dominated && strength.sd.expect("free") > 0.29, "{strength:?}");
    let (_, control, correlation) = outcome.confounding.worst(0).expect("a control");
    assert!(control == 0 && correlation < -0.95, "{control} {correlation}");
    assert_eq!(warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["F013"]);
    let message = &warnings[0].message;
    assert!(message.contains("`sigma_max.top.L` is not determined") && message.contains("`top.L`"), "{message}");
    assert!(page.contains("largest correlation"), "{page}");

    let held = "[controls]\n\"top.L\" = 0.015\n[fit]";
    let asked = text("", &format!("sd_mm = 0.1\nunknowns = [\"low.R\"]\n{outer}")).replace("[fit]", held);
    let truth: Vec<Vec<f64>> = poses().iter().map(|pose| vec![0.015, pose[1]]).collect();
    let (outcome, warnings, _) = found(&made, &asked, &truth, 0.1, 2);
    let strength = &outcome.found[0];
    assert!(warnings.is_empty(), "{warnings:?}");
    assert!(
        (strength.interval[0]..=strength.interval[1]).contains(&0.8) && strength.sd.expect("free") < 0.05,
        "{strength:?}"
    );
}

/// A slab at 36 degrees, thought to lie along the beam: its angle, and that it is the same everywhere, come back from three
/// poses together with the activations; a fourth pose that had no say is then explained to the noise.
#[test]
fn a_slab_at_36_degrees_is_found_from_poses() {
    let noise = 0.1;
    let text = |angle: f64, rest: &str| {
        let slab = format!(
            "[[muscle]]\nname = \"slab\"\nblock = {{ origin_mm = [3, 2, 1], size_mm = [34, 6, 2.5], elements = [3, 1, 1] }}\n\
             fibre_angles_deg = [{angle}, 0, 0]\n\
             blemker = {{ sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }}\n[[support]]"
        );
        problem(&MUSCLES[..1], &MARKERS, rest).replace("[[support]]", &slab)
    };
    let outer = "[fit.outer]\nframes = [0, 1, 2]\nheld_out = [3]\n[[fit.outer.unknown]]\nfibre_angle = \"slab\"\n\
                 [[fit.outer.unknown]]\nfibre_angle = \"slab\"\nmode = \"x\"\n";
    let truth = vec![vec![0.004, 0.02], vec![0.01, 0.04], vec![0.02, 0.03], vec![0.006, 0.05]];
    let (outcome, _, page) =
        found(&text(36.0, ""), &text(0.0, &format!("sd_mm = {noise}\n{outer}")), &truth, noise, 3);
    for (found, truth) in outcome.found.iter().zip([36.0, 0.0]) {
        assert!((found.interval[0]..=found.interval[1]).contains(&truth), "{found:?}");
        assert!(!found.prior_dominated, "{found:?}");
    }
    assert!(outcome.found[0].sd.expect("free") < 5.0, "{:?}", outcome.found[0]);
    let last = outcome.frames.last().expect("frames");
    assert!(last.frame == 3 && last.held_out && outcome.frames.len() == 4);
    let (before, after) = (last.before_mm.expect("fitted"), last.after_mm.expect("fitted"));
    // eighteen coordinates less two activations
    let expected = noise * (3.0_f64 * 16.0 / 18.0).sqrt();
    println!("held out: {before:.3} mm before, {after:.3} mm after, {expected:.3} mm of noise");
    assert!(after < 1.5 * expected && before > 2.0 * after, "{before} {after} {expected}");
    assert!(page.contains("1 frame held out: markers"), "{page}");
    // the scene holds what was found
    assert_eq!(outcome.scene.muscles[1].fibre_turn_deg[..2], outcome.values()[..]);
}

/// What is added to the fibre angle: the same everywhere, and along x from one side of the muscle to the other; a region that is
/// stiffened changes alone.
#[test]
fn fibres_turn_and_regions_stiffen() {
    let text = text(
        "[[region]]\nname = \"tip\"\nbox_mm = [[20, 0, 0], [40, 10, 10]]\nmooney-rivlin = { c1_kpa = 1, c2_kpa = 0.5 }\n",
        "",
    );
    let mut scene = scene(&text);
    let what = [
        OuterWhat::FibreAngle("low.R".into(), AngleMode::Constant),
        OuterWhat::FibreAngle("low.R".into(), AngleMode::Along(0)),
        OuterWhat::Stiffness(Some("tip".into())),
    ];
    for (what, value) in what.iter().zip([30.0, 8.0, 1.5]) {
        what.apply(value, &mut scene);
    }
    assert_eq!(scene.regions[0].law, LawSpec::MooneyRivlin { c1_kpa: 1.5, c2_kpa: 0.75 });
    assert_eq!(scene.tissue.law, LawSpec::MooneyRivlin { c1_kpa: 0.5, c2_kpa: 0.2 });
    let model = build(&scene).expect("a model").model;
    let (_, muscle) = model.muscles().nth(1).expect("low.R");
    for point in muscle.points() {
        // the muscle reaches from x = 3 to x = 37
        let angle = (30.0 + 8.0 * (point.position[0] - 20.0) / 17.0_f64).to_radians();
        let off = point.fibre[0] - angle.cos();
        assert!(off.abs() < 1e-12 && (point.fibre[1] - angle.sin()).abs() < 1e-12, "{:?}", point.fibre);
    }
}

/// The command: tables, the page, F013 in the status; its lock file holds what was found, and run again gives the same.
#[test]
fn a_run_finds_what_all_frames_share() {
    let folder = tempfile::tempdir().expect("a folder");
    // the recording starts at rest, as registration needs it
    let outer = STIFFNESS.replace("[fit.outer]", "[fit.outer]\nframes = [1, 2]") + "sd = 0.2\n";
    let asked = text("", &format!("sd_mm = 0.1\n{outer}"));
    let truth = [vec![vec![0.0, 0.0]], poses()[..2].to_vec()].concat();
    record(&folder.path().join("clip.mcap"), &stiffer(&text("", ""), 1.1), &truth, 0.1, 4);
    std::fs::write(folder.path().join("twin.toml"), &asked).expect("written");
    let risorius = |arguments: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("risorius").expect("built");
        let output = command.current_dir(folder.path()).args(arguments).output().expect("it runs");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{stderr}");
        (String::from_utf8(output.stdout).expect("text"), stderr)
    };
    let (page, stderr) = risorius(&["run", "twin.toml", "--out", "run"]);
    println!("{page}{stderr}");
    assert!(page.contains("what all frames share, from 2 frames") && page.contains("stiffness.tissue"), "{page}");
    assert!(stderr.contains("warn[F013]"), "{stderr}");
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("a file");
    assert!(read("run/status.json").contains("F013"));
    assert_eq!(read("run/tables/outer.csv").lines().count(), 2);
    assert_eq!(read("run/tables/outer_controls.csv").lines().count(), 5);
    assert_eq!(read("run/tables/outer_frames.csv").lines().count(), 3);
    assert!(read("run/problem.outer.toml").contains("[[fit.outer.unknown]]"));
    assert!(!read("run/problem.lock.toml").contains("fit.outer"));
    risorius(&["run", "run/problem.lock.toml", "--out", "again"]);
    for table in ["activations", "markers", "identifiability"] {
        let [first, again] = ["run", "again"].map(|run| read(&format!("{run}/tables/{table}.csv")));
        assert!(first == again, "{table}");
    }
}
