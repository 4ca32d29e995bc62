//! What the markers tell: intervals, combinations and pairs, residuals that no control explains, advice on markers.

use crate::common::twin::{MARKERS, MUSCLES, problem, record, recording, scene};
use nalgebra::DMatrix;
use risorius::fit::advise::{Criterion, View, advise, candidates};
use risorius::fit::covariance::Bound;
use risorius::fit::identifiability::{ClipKnowledge, Evidence, Told};
use risorius::fit::placement::Marker;
use risorius::fit::{Estimate, Fit};
use risorius::markers::Recording;
use risorius::mesh::MaterialPoint;
use risorius::model::build::build;
use std::path::Path;

type Place<'a> = (&'a str, [f64; 3]);

/// The fit of every frame, with what it tells.
fn told(text: &str, recording: &Recording) -> Vec<(Estimate, Evidence, Told)> {
    let scene = scene(text);
    let built = build(&scene).unwrap_or_else(|error| panic!("{error}"));
    let spec = scene.fit.as_ref().expect("a fit");
    let mut fit = Fit::new(&built.model, &scene, spec, recording).unwrap_or_else(|error| panic!("{error}"));
    let frame = |k: usize| {
        let estimate = fit.frame(recording, k).unwrap_or_else(|error| panic!("{error}"));
        let evidence = Evidence::of(&estimate, fit.controls(), fit.unknowns()).expect("enough markers");
        let measured: Vec<bool> = estimate.measured_mm.iter().map(Option::is_some).collect();
        let told = evidence.told(fit.markers(), &measured).expect("solved");
        (estimate, evidence, told)
    };
    (0..recording.frames.len()).map(frame).collect()
}

fn clip(
    muscles: &[Place<'_>],
    markers: &[Place<'_>],
    extra: &str,
    truth: &[Vec<f64>],
    noise: f64,
) -> (String, Recording) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("clip.mcap");
    let text = problem(muscles, markers, extra);
    record(&path, &text, truth, noise, 11);
    (text, recording(&path))
}

/// Forty noisy copies of a frame whose second muscle is at rest: of the intervals of the first 95 % hold the truth, and the
/// second one's start at the bound and hold it; the coverage is that of a binomial within three deviations.
#[test]
fn intervals_cover_the_truth_also_on_a_bound() {
    let truth = vec![vec![0.03, 0.0]; 40];
    let (text, recording) = clip(&[MUSCLES[0], MUSCLES[2]], &MARKERS, "sd_mm = 0.3\n", &truth, 0.3);
    let (mut covered, mut lower) = ([0, 0], 0);
    for (_, _, told) in told(&text, &recording) {
        for (k, known) in told.controls.iter().enumerate() {
            covered[k] += usize::from((known.interval[0]..=known.interval[1]).contains(&truth[0][k]));
            assert!(!known.prior_dominated && known.interval[1] > known.interval[0], "{known:?}");
            if known.bound == Bound::Lower {
                lower += 1;
                assert_eq!((known.value, known.sd, known.interval[0]), (0.0, None, 0.0));
                let wants = known.wants.expect("it is pushed");
                assert!(wants <= 0.0 && wants > -0.1, "{known:?}");
            }
        }
    }
    println!("covered {covered:?} of 40; {lower} on the lower bound");
    assert!((34..=40).contains(&covered[0]) && covered[1] >= 34, "{covered:?}");
    assert!((10..=30).contains(&lower), "half of them would go below 0: {lower}");
}

/// Two muscles in one place: what is determined is their sum, the split is only the prior.
#[test]
fn muscles_in_one_place_are_told_together() {
    let same = [("one", MUSCLES[0].1), ("two", MUSCLES[0].1), MUSCLES[2]];
    let (text, recording) = clip(&same, &MARKERS, "sd_mm = 0.1\n", &[vec![0.02, 0.01, 0.01]], 0.0);
    let (_, evidence, told) = &told(&text, &recording)[0];
    let pair = &told.pairs[0];
    println!("{pair:?}");
    assert_eq!(pair.controls, [0, 1]);
    assert!(pair.correlation < -0.99 && (pair.weight - 1.0).abs() < 0.01 && pair.prior_dominated);
    assert_eq!(pair.words(&["one", "two"]), "their sum");
    assert!((pair.together - 0.03).abs() < 1e-4 && pair.together_sd < 0.01, "{pair:?}");
    let weakest = told.combinations.last().expect("three");
    assert!(!weakest.is_determined());
    assert_eq!(
        weakest.words(&["one", "two", "low"]).replace("two - 0.71 one", "one - 0.71 two"),
        "0.71 one - 0.71 two"
    );
    assert!(told.combinations[..2].iter().all(|c| c.is_determined()));
    let dominated: Vec<bool> = told.controls.iter().map(|known| known.prior_dominated).collect();
    assert_eq!(dominated, [true, true, false]);

    let mut clip = ClipKnowledge::default();
    clip.add(0, evidence, told, &[]);
    assert_eq!((clip.pairs().len(), clip.combinations().len()), (1, 3));
}

/// A marker that has slipped by 3 mm to the side, where no muscle moves it: it is named, with the offset.
#[test]
fn a_marker_that_no_control_explains_is_named() {
    let truth = vec![vec![0.02, 0.01]; 3];
    let (text, mut recording) = clip(&[MUSCLES[0], MUSCLES[2]], &MARKERS, "sd_mm = 0.1\n", &truth, 0.1);
    for frame in &mut recording.frames {
        frame.positions_mm[2].as_mut().expect("shown")[1] += 3.0;
    }
    let mut clip = ClipKnowledge::default();
    for (k, (estimate, evidence, told)) in told(&text, &recording).iter().enumerate() {
        clip.add(k, evidence, told, &[]);
        // without other objectives the answer of the fit is the best there is
        for left in &told.unexplained {
            let (model, measured) =
                (estimate.positions_mm[left.marker], estimate.measured_mm[left.marker].expect("shown"));
            let off = (0..3).map(|i| (left.left_mm[i] - (model[i] - measured[i])).abs()).fold(0.0, f64::max);
            assert!(off < 1e-3, "{left:?}");
        }
    }
    let worst = clip.left_over()[0];
    println!("{worst:?}");
    assert_eq!(worst.marker, 2);
    assert!(worst.rms_mm > 10.0 * worst.expected_mm && (-3.2..-1.5).contains(&worst.mean_mm[1]), "{worst:?}");
}

/// With two markers near the root little is known. The marker that is advised, added with the data it would have, makes
/// the interval of the control that it names as small as was promised.
#[test]
fn an_advised_marker_shrinks_the_interval_that_it_names() {
    let few = [MARKERS[0], MARKERS[1]];
    let truth = vec![vec![0.02, 0.02, 0.01, 0.02]];
    let (text, recorded) = clip(&MUSCLES, &few, "sd_mm = 0.1\n", &truth, 0.0);
    let scene = scene(&text);
    let built = build(&scene).expect("a model");
    let mesh = built.model.mesh();
    let points = candidates(mesh);
    let positions: Vec<_> = points.iter().map(|p| mesh.position(*p)).collect();
    let mut fit = Fit::new(&built.model, &scene, scene.fit.as_ref().expect("a fit"), &recorded).expect("a fit");
    // the same frame with controls that are known
    let estimate = fit.at(&recorded, 0, truth[0].clone()).expect("an equilibrium");
    assert!(estimate.rms_mm < 1e-5, "{}", estimate.rms_mm);
    let evidence = Evidence::of(&estimate, fit.controls(), fit.unknowns()).expect("enough markers");
    let rates = fit.rates_at(&points, &estimate.equilibrium.state).expect("at this state");
    let taken: Vec<_> = few.iter().map(|(_, place)| *place).collect();
    for criterion in [Criterion::D, Criterion::A] {
        let advice = advise(vec![View::new(&evidence, &rates, 0.1)], &positions, &taken, (criterion, 2, 5.0));
        assert_eq!(advice.len(), 2);
        let place = positions[advice[0].candidate];
        let (control, before, after) = advice[0].effects[0];
        println!("{criterion:?}: {place:?} brings {control} from {before:.5} to {after:.5}");
        assert!(after < 0.7 * before);
        let more = [few[0], few[1], ("added", place)];
        let (text, recorded) = clip(&MUSCLES, &more, "sd_mm = 0.1\n", &truth, 0.0);
        let (with, ..) = &told(&text, &recorded)[0];
        let sd = with.sd[control].expect("it is free");
        assert!((sd / after - 1.0).abs() < 0.05, "{sd} instead of {after}");
    }
}

/// All controls on bounds: intervals to one side, no pairs, nothing to advise on, and no crash.
#[test]
fn a_frame_with_all_controls_on_bounds_is_told_of() {
    let evidence = Evidence {
        unknowns: vec![0, 1],
        ranges: vec![[0.0, 1.0], [-2.0, 2.0]],
        values: vec![0.0, 2.0],
        bounds: vec![Bound::Lower, Bound::Upper],
        j: DMatrix::from_row_slice(3, 2, &[10.0, 0.0, 0.0, 20.0, 0.0, 0.0]),
        residuals: vec![1.0, -4.0, 0.0],
        information: DMatrix::from_row_slice(2, 2, &[100.0, 0.0, 0.0, 400.0]),
        prior: DMatrix::zeros(2, 2),
        gradient: vec![10.0, -80.0],
        sigma: 1.0,
        bridged: false,
    };
    let fitted = Marker {
        name: "M".into(),
        point: MaterialPoint { element: 0, xi: [0.0; 3] },
        distance: 0.0,
        offset_part: 0.0,
        sd: Some(0.5),
        column: 0,
    };
    let told = evidence.told(&[fitted], &[true]).expect("solved");
    let [low, high] = &told.controls[..] else { panic!("two") };
    // exp(-10 u - 50 u^2) and, per quarter of its range, exp(-80 u - 200 u^2): normal tails beyond 1 and 4 deviations
    assert!((low.interval[1] - 0.1412).abs() < 2e-4 && low.wants == Some(-0.1), "{low:?}");
    assert!((high.interval[0] - (2.0 - 4.0 * 0.03298)).abs() < 2e-4 && high.interval[1] == 2.0, "{high:?}");
    assert!((high.wants.expect("pushed") - 2.8).abs() < 1e-12);
    assert!(told.pairs.is_empty() && !low.prior_dominated);
    // no control may go where it would remove the residual
    assert!((told.unexplained[0].left_mm[1] + 2.0).abs() < 1e-6, "{:?}", told.unexplained);
    let rates = [DMatrix::from_element(3, 2, 5.0)];
    let none = advise(vec![View::new(&evidence, &rates, 0.1)], &[[0.0; 3]], &[], (Criterion::D, 1, 1.0));
    assert!(none.is_empty());
}

/// The commands: tables of a run, the bias beside the interval, advice from the problem and from the folder.
#[test]
fn a_run_leaves_its_tables_and_is_advised() {
    let folder = tempfile::tempdir().expect("a folder");
    let same = [("one", MUSCLES[0].1), ("two", MUSCLES[0].1), MUSCLES[2]];
    let text = problem(&same, &MARKERS[..4], "sd_mm = 0.1\n");
    record(&folder.path().join("clip.mcap"), &text, &vec![vec![0.02, 0.01, 0.01]; 2], 0.05, 3);
    std::fs::write(folder.path().join("twin.toml"), &text).expect("written");
    let risorius = |arguments: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("risorius").expect("built");
        let output = command.current_dir(folder.path()).args(arguments).output().expect("it runs");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{stderr}");
        (String::from_utf8(output.stdout).expect("text"), stderr)
    };
    let (page, stderr) = risorius(&["run", "twin.toml", "--estimate", "--out", "run"]);
    println!("{page}{stderr}");
    assert!(page.contains("what the markers tell") && page.contains("no marker determines"), "{page}");
    assert!(stderr.contains("warn[F005]") && stderr.contains("no further marker tells them apart"), "{stderr}");
    assert!(
        stderr.contains("one / two in 2 of 2 frames") && stderr.contains("their sum is determined (0.030 +/- "),
        "{stderr}"
    );
    let table = |name: &str| {
        std::fs::read_to_string(Path::new(folder.path()).join("run/tables").join(name)).expect("a table")
    };
    let rows = |name: &str| -> Vec<Vec<String>> {
        table(name).lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let known = rows("identifiability.csv");
    assert_eq!(known.len(), 6);
    assert!(known.iter().any(|row| row[2] == "low.L" && !row[11].is_empty()), "{known:?}");
    assert_eq!(rows("combinations.csv").len(), 9);
    assert!(rows("combinations.csv")[6..].iter().all(|row| row[0].is_empty()));
    assert_eq!((rows("pairs.csv").len(), rows("unexplained.csv").len()), (2, 8));

    let (page, _) = risorius(&["advise", "run", "--markers", "2", "--criterion", "a"]);
    assert!(page.contains("1. (") && page.contains("[[marker]]"), "{page}");
    assert!(table("advice.csv").lines().count() > 2);
    let json = |path: &str| -> serde_json::Value {
        serde_json::from_str(&risorius(&["advise", path, "--json", "-q"]).0).expect("json")
    };
    let (of_run, of_problem) = (json("run"), json("twin.toml"));
    assert_eq!(of_run["markers"][0]["position_mm"], of_problem["markers"][0]["position_mm"]);
    assert_eq!(of_run["markers"].as_array().map(Vec::len), Some(3));
}
