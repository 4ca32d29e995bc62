//! Clips as they come from a laboratory (noise, bursts of dropouts, zeros, outliers, a head that moves) against the truth: a small
//! part of the table of `examples/twin_table.rs`, which is in `problems/fit_study/README.md`.

use crate::common::clips::{Conditions, Head, Score, fit, positions, record, truth};

const FRAMES: usize = 24;

/// Frame by frame and smoothed, over so many clips.
fn scores(set: &[&str], conditions: &Conditions, clips: u64, estimate: bool) -> [Score; 2] {
    let truth = truth(FRAMES);
    let clean = positions(set, &truth);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("clip.mcap");
    let mut scores = [Score::default(); 2];
    for seed in 1..=clips {
        record(&path, &clean, conditions, seed);
        let found = fit(&path, &truth, conditions, estimate);
        scores.iter_mut().zip(&found).for_each(|(score, found)| score.add(found));
    }
    for (score, how) in scores.iter().zip(["alone", "smoothed"]) {
        println!(
            "{how}: {} frames, markers {:.3} mm, activations {:.1e} ({:.1e} less bias), {:.1} % ({:.1} %) of the intervals hold the truth",
            score.frames(),
            score.marker_rms(),
            score.rms(),
            score.rms_unbiased(),
            100.0 * score.coverage(),
            100.0 * score.coverage_unbiased()
        );
    }
    scores
}

/// The head is estimated from the skin, two fifths of the samples are lost, two are gross outliers, and every coordinate is off by
/// 0.3 mm: of the intervals about 95 % hold the truth, and smoothing halves the error.
#[test]
fn intervals_hold_the_truth_and_smoothing_halves_the_error() {
    let conditions = Conditions { noise_mm: 0.3, lost: 0.4, head: Head::Estimated, neutral: 1 };
    let [alone, smoothed] = scores(&[], &conditions, 2, false);
    assert_eq!((alone.frames(), smoothed.frames()), (2 * FRAMES, 2 * FRAMES));
    assert!((0.90..=0.99).contains(&alone.coverage()), "{}", alone.coverage());
    assert!((0.88..=1.0).contains(&smoothed.coverage()), "{}", smoothed.coverage());
    assert!(smoothed.rms() < 0.5 * alone.rms(), "{} of {}", smoothed.rms(), alone.rms());
}

/// Bone markers as noisy as the others: the intervals hold their noise too.
#[test]
fn intervals_hold_the_noise_of_bone_markers() {
    let conditions = Conditions { noise_mm: 0.3, lost: 0.1, head: Head::Bones, neutral: 1 };
    let [alone, smoothed] = scores(&[], &conditions, 1, false);
    for score in [alone, smoothed] {
        assert!((0.88..=1.0).contains(&score.coverage()), "{}", score.coverage());
    }
}

/// The noise of a single neutral frame turns the head of all frames alike, and smoothing leaves it; ten leave a third of it. Both
/// together halve the error of single frames with a single neutral frame; smoothing alone does not.
#[test]
fn several_neutral_frames_take_away_what_smoothing_leaves() {
    let one = Conditions { noise_mm: 0.3, lost: 0.1, head: Head::Bones, neutral: 1 };
    let [alone_of_one, smoothed_of_one] = scores(&[], &one, 3, false);
    let [alone, smoothed] = scores(&[], &Conditions { neutral: 10, ..one }, 3, false);
    assert_eq!((alone.frames(), smoothed.frames()), (3 * FRAMES, 3 * FRAMES));
    assert!(alone.rms() < 0.75 * alone_of_one.rms(), "{} of {}", alone.rms(), alone_of_one.rms());
    assert!(smoothed.rms() < 0.6 * smoothed_of_one.rms(), "{} of {}", smoothed.rms(), smoothed_of_one.rms());
    assert!(smoothed.rms() < 0.75 * alone.rms(), "{} of {}", smoothed.rms(), alone.rms());
    assert!(smoothed.rms() < 0.5 * alone_of_one.rms(), "{} of {}", smoothed.rms(), alone_of_one.rms());
    for score in [alone, smoothed] {
        assert!((0.88..=1.0).contains(&score.coverage()), "{}", score.coverage());
    }
}

/// Data from a finer mesh: the intervals say nothing of that, and miss the truth; less the estimated bias the activations are
/// better, and more of the intervals hold it.
#[test]
fn the_estimate_explains_what_a_coarse_mesh_does() {
    let finer = ["mesh.block.elements=[8, 2, 2]", "muscle.top.gauss=6", "muscle.bottom.gauss=6"];
    let conditions = Conditions { noise_mm: 0.05, lost: 0.1, head: Head::Bones, neutral: 1 };
    let [alone, _] = scores(&finer, &conditions, 1, true);
    assert!(alone.coverage() < 0.9, "{}", alone.coverage());
    assert!(alone.rms_unbiased() < 0.5 * alone.rms(), "{} of {}", alone.rms_unbiased(), alone.rms());
    assert!(alone.coverage_unbiased() > 0.9, "{}", alone.coverage_unbiased());
}
