//! The page at the end of a run.

use super::model::{MUSCLES, model};
use super::support::{FRAME, solved, some_markers};
use risorius::fit::covariance::Bound;
use risorius::fit::identifiability::ClipKnowledge;
use risorius::mesh::MaterialPoint;
use risorius::report::summary::{FitSummary, FittedFrame, ForwardSummary, MarkerErrors, MeshErrors, Outliers};
use risorius::report::{Frame, Probe, muscle_states, probe_states};
use risorius::term::pressure::Trilinear;

#[test]
fn forward_summary_shows_the_last_frame() {
    let model = model(&Trilinear);
    let (found, work) = solved(&model);
    let probes = [Probe { name: "tip".into(), at: MaterialPoint { element: 5, xi: [1.0; 3] } }];
    let probes = probe_states(&probes, &model, &found.state);
    let muscles = muscle_states(&model, &found.state, &found.evaluation);
    let summary = ForwardSummary {
        name: "bend",
        frames_ok: 2,
        frames_failed: 1,
        frame: FRAME,
        probes: &probes,
        muscles: &muscles,
        bones: &[],
        tissue_energy: found.evaluation.energies[0],
        external_work: model.external_work(&found.state),
        reactions: &[(12.5, -3.25)],
        det_f: found.evaluation.det_f,
        volume_change: -2.5e-4,
        mesh_errors: &MeshErrors::default(),
        iterations: work.iterations,
        seconds: 1.234,
        folder: "runs/bend-0001",
    };
    let text = summary.to_string();
    println!("{text}");
    for part in [
        "bend: 2 frames in equilibrium, 1 frame NOT CONVERGED",
        "the volume changes by -0.025 %",
        "rotation 0: torque 12.5000 mN mm, axial force -3.2500 mN",
        &format!("{:.4}", probes[0].displacement[2]),
        &format!("{:.4}", muscles[1].mean_stretch),
        "runs/bend-0001/view/result.pvd",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
}

#[test]
fn fit_summary_marks_bounds_and_the_worst_markers() {
    let mut errors = MarkerErrors::default();
    errors.add(FRAME, &some_markers());
    errors.add(Frame { index: 4, time_s: 0.4 }, &some_markers()[..1]);
    assert_eq!((errors.all.count, errors.all.max_mm), (3, 0.5));
    assert!((errors.all.rms_mm().expect("measured") - 0.5).abs() < 1e-15);
    let fitted = |index: usize, values: [f64; 2]| FittedFrame {
        frame: Frame { index, time_s: 0.1 * index as f64 },
        values: values.into(),
        deviations: vec![Some(0.0123), None],
        bounds: vec![Bound::Free, Bound::Lower],
    };
    let frames = [fitted(3, [0.5, 0.0]), fitted(4, [0.75, 0.0]), fitted(5, [0.25, 0.0])];
    let mut summary = FitSummary {
        name: "smile",
        recording: "registration: rigid\n",
        controls: &MUSCLES,
        bones: false,
        frames: &frames[..1],
        frames_failed: 0,
        errors: &errors,
        mesh_errors: &MeshErrors::default(),
        objective: "markers by squares",
        outliers: &Outliers::default(),
        told: &ClipKnowledge::default(),
        markers: &[],
        iterations: 1,
        seconds: 2.0,
        folder: "runs/smile-0001",
    };
    let one = summary.to_string();
    println!("{one}");
    for part in [
        "0.5000  0.0123",
        "0.0000       -  at its lower bound",
        "rms 0.500 mm, max 0.500 mm",
        "brow, left",
        "\nregistration: rigid\n",
    ] {
        assert!(one.contains(part), "{part} is not in\n{one}");
    }
    assert!(!one.contains("lost"));
    summary.frames = &frames;
    let clip = summary.to_string();
    println!("{clip}");
    let line = clip.lines().find(|line| line.contains(MUSCLES[0])).expect("a row");
    let cells: Vec<&str> = line.split_whitespace().skip(2).collect();
    assert_eq!(cells, ["0.2500", "0.7500", "0.0123", "4", "0", "0"]);
    let line = clip.lines().find(|line| line.contains(MUSCLES[1])).expect("a row");
    let cells: Vec<&str> = line.split_whitespace().skip(3).collect();
    assert_eq!(cells, ["0.0000", "0.0000", "-", "3", "3", "0"]);
}
