//! The parts of the objective of a fit: derivatives, what each does to the answer, the keys that ask for them.

use crate::common::Random;
use crate::common::twin::{MARKERS, MUSCLES, problem, record, recording, scene};
use nalgebra::DMatrix;
use risorius::fit::objective::{Instant, Objectives, Past, Sum};
use risorius::fit::sequence::sought;
use risorius::fit::{Estimate, Fit};
use risorius::markers::Recording;
use risorius::model::build::build;
use risorius::scene::{MarkerLossSpec, Scene};
use std::path::Path;

const ALL: &str = "sd_mm = 0.2\neffort = { sd = 0.1, exponent = 3, by = \"volume\" }\nsparsity = { scale = 0.02 }\n\
                   similarity = { sd = 0.03 }\nsmoothness = { sd_per_root_s = 0.2, sd_per_root_s3 = 9 }\n";

fn fitted(text: &str, recording: &Recording) -> Vec<Estimate> {
    let scene = scene(text);
    let built = build(&scene).unwrap_or_else(|error| panic!("{error}"));
    let spec = scene.fit.as_ref().expect("a fit");
    let mut fit = Fit::new(&built.model, &scene, spec, recording).unwrap_or_else(|error| panic!("{error}"));
    let frame = |k: usize| fit.frame(recording, k).unwrap_or_else(|error| panic!("{error}"));
    (0..recording.frames.len()).map(frame).collect()
}

fn clip(truth: &[Vec<f64>], noise: f64) -> Recording {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("clip.mcap");
    record(&path, &problem(&MUSCLES, &MARKERS, ""), truth, noise, 5);
    recording(&path)
}

fn activations(estimate: &Estimate) -> &[f64] {
    &estimate.equilibrium.state.controls
}

/// Values, gradients and second derivatives of all parts together agree with differences; so do those of the losses.
#[test]
fn derivatives_are_those_of_the_values() {
    let scene = scene(&problem(&MUSCLES, &MARKERS, ALL));
    let built = build(&scene).expect("a model");
    let spec = scene.fit.as_ref().expect("a fit");
    let objectives = Objectives::new(&scene, spec, &built.model, &sought(spec, &built.model)).expect("no table");
    let covariance = DMatrix::from_fn(4, 4, |a, b| if a == b { 2e-3 } else { 3e-4 });
    let past = |time_s: f64, a: f64| Past { time_s, a: vec![a, 0.02, 0.03, 0.01], covariance: covariance.clone() };
    let before = [past(0.2, 0.05), past(0.1, 0.01)];
    let at = |a: &[f64]| -> Sum { objectives.rest(&Instant { time_s: 0.25, a, before: &before }) };
    let a = [0.04, 0.011, 0.2, 0.07];
    let (sum, h) = (at(&a), 1e-5);
    assert_eq!(objectives.values(&Instant { time_s: 0.25, a: &a, before: &before }).len(), 4);
    for k in 0..4 {
        let moved = |by: f64| {
            let mut moved = a;
            moved[k] += by;
            at(&moved)
        };
        let (up, down) = (moved(h), moved(-h));
        let slope = (up.value - down.value) / (2.0 * h);
        assert!(
            (slope - sum.gradient[k]).abs() < 1e-6 * sum.gradient[k].abs().max(1.0),
            "{slope} {}",
            sum.gradient[k]
        );
        for l in 0..4 {
            let curvature = (up.gradient[l] - down.gradient[l]) / (2.0 * h);
            let exact = sum.hessian[(k, l)];
            assert!(
                (curvature - exact).abs() < 1e-5 * sum.hessian[(k, k)].abs().max(1.0),
                "{k} {l}: {curvature} {exact}"
            );
        }
    }

    let mut random = Random::new(3);
    let j = DMatrix::from_fn(12, 2, |_, _| random.next());
    let r0: Vec<f64> = (0..12).map(|_| 3.0 * random.next()).collect();
    let residuals =
        |q: [f64; 2]| -> Vec<f64> { (0..12).map(|i| r0[i] + j[(i, 0)] * q[0] + j[(i, 1)] * q[1]).collect() };
    for spec in [MarkerLossSpec::Quadratic, MarkerLossSpec::HuberSds(1.5), MarkerLossSpec::CauchySds(4.0)] {
        let loss = risorius::fit::objective::loss::Loss::from(spec);
        let (g, hessian) = loss.model(&residuals([0.0; 2]), &j);
        let h = 1e-4;
        let slope = (loss.cost(&residuals([h, 0.0])) - loss.cost(&residuals([-h, 0.0]))) / (2.0 * h);
        assert!((slope - g[0]).abs() < 1e-6, "{spec:?}: {slope} {}", g[0]);
        let (up, down) = (loss.model(&residuals([h, 0.0]), &j).0, loss.model(&residuals([-h, 0.0]), &j).0);
        for k in 0..2 {
            let curvature = (up[k] - down[k]) / (2.0 * h);
            let off = (curvature - hessian[(0, k)]).abs();
            // Cauchy's is made positive where it is not
            assert!(
                off < 1e-4 || spec == MarkerLossSpec::CauchySds(4.0),
                "{spec:?} {k}: {curvature} {}",
                hessian[(0, k)]
            );
        }
        assert!(hessian.clone().symmetric_eigenvalues().min() > -1e-12);
    }
}

/// A marker that jumps by 6 mm pulls the answer by squares; Huber and Cauchy set it aside.
#[test]
fn robust_losses_set_an_outlier_aside() {
    let truth = vec![vec![0.02, 0.01, 0.005, 0.01]; 2];
    let mut recording = clip(&truth, 0.05);
    recording.frames[1].positions_mm[0].as_mut().expect("shown")[2] += 6.0;
    let error = |estimate: &Estimate| -> f64 {
        let pairs = activations(estimate).iter().zip(&truth[1]);
        pairs.map(|(found, truth)| (found - truth).abs()).fold(0.0, f64::max)
    };
    let mut errors = Vec::new();
    for loss in ["\"quadratic\"", "{ huber_sds = 2 }", "{ cauchy_sds = 3 }"] {
        let fitted = fitted(&problem(&MUSCLES, &MARKERS, &format!("sd_mm = 0.1\nloss = {loss}\n")), &recording);
        println!("{loss}: {:?} {:?}, {} steps", activations(&fitted[1]), fitted[1].costs, fitted[1].iterations.len());
        println!("  {:?}", fitted[1].weights);
        errors.push(error(&fitted[1]));
        let aside: Vec<usize> = (0..6).filter(|k| fitted[1].weights[*k] < 0.5).collect();
        assert_eq!(aside, if loss.contains("quadratic") { vec![] } else { vec![0] }, "{:?}", fitted[1].weights);
    }
    println!("largest error of an activation: squares, Huber, Cauchy {errors:?}");
    assert!(errors[1] < 0.4 * errors[0] && errors[2] < 0.4 * errors[0], "{errors:?}");
}

/// With two markers near the root the split between muscles is open. What else is asked for decides it.
#[test]
fn effort_sparsity_likeness_and_priors_decide_what_markers_leave_open() {
    let truth = vec![vec![0.02, 0.02, 0.0, 0.0]];
    let recording = clip(&truth, 0.0);
    // one marker on the middle line
    let one = [MARKERS[2]];
    let fit = |extra: &str| fitted(&problem(&MUSCLES, &one, &format!("sd_mm = 0.1\n{extra}")), &recording).remove(0);

    let strong = activations(&fit("effort = { sd = 0.05 }\n")).iter().sum::<f64>();
    let weak = activations(&fit("effort = { sd = 0.5 }\n")).iter().sum::<f64>();
    assert!(strong < weak, "{strong} {weak}");

    let sparse = fit("sparsity = { scale = 0.001 }\n");
    println!("sparse {:?} {:?}", activations(&sparse), sparse.costs);
    assert!(activations(&sparse).iter().filter(|a| **a == 0.0).count() >= 2, "{:?}", activations(&sparse));
    assert_eq!(sparse.costs[1].0, "sparsity");

    let alike = fit("similarity = { sd = 1e-4 }\neffort = { sd = 0.5 }\n");
    let [l, r, ..] = activations(&alike) else { panic!("four") };
    println!("alike {:?}", activations(&alike));
    assert!((l - r).abs() < 1e-3 && (l - 0.02).abs() < 5e-3, "{l} {r}");

    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("emg.csv");
    std::fs::write(&table, "time_s,low.L,top.R\n-0.5,0,100\n1,1,100\n").expect("written");
    let prior = format!("[[fit.prior]]\ncsv = {table:?}\nsd = 1e-6\ngain = 1.5e-4\ndelay_s = 0.25\n");
    let told = fit(&prior);
    println!("expected {:?}", activations(&told));
    // low.L at 0 s: 1.5e-4 x what the table has at -0.25 s, 1/6
    assert!((activations(&told)[2] - 2.5e-5).abs() < 1e-6 && (activations(&told)[1] - 0.015).abs() < 1e-5);
    assert!(told.sd[1].expect("free") < 1.1e-6, "{:?}", told.sd);
}

/// Smoothness makes the noise of a clip smaller where it changes no faster than is expected.
#[test]
fn smoothness_quiets_a_clip() {
    let truth: Vec<Vec<f64>> = (0..14)
        .map(|k| {
            let rise = 0.5 - 0.5 * (k as f64 / 13.0 * std::f64::consts::PI).cos();
            vec![0.01 + 0.006 * rise, 0.02, 0.015 - 0.004 * rise, 0.01]
        })
        .collect();
    let recording = clip(&truth, 0.3);
    let rms = |extra: &str| {
        let fitted = fitted(&problem(&MUSCLES, &MARKERS, &format!("sd_mm = 0.3\n{extra}")), &recording);
        let mut sum = 0.0;
        for (estimate, truth) in fitted.iter().zip(&truth).skip(4) {
            sum += activations(estimate).iter().zip(truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        }
        (sum / 40.0).sqrt()
    };
    let (alone, first, second) =
        (rms(""), rms("smoothness = { sd_per_root_s = 0.008 }\n"), rms("smoothness = { sd_per_root_s3 = 0.3 }\n"));
    println!("rms of activations: alone {alone:.2e}, first {first:.2e}, second {second:.2e}");
    assert!(first < 0.8 * alone && second < alone, "{alone} {first} {second}");
}

/// The keys survive the lock file, and a run states what it minimised.
#[test]
fn keys_are_locked_and_stated() {
    let text = problem(&MUSCLES, &MARKERS, &format!("{ALL}loss = {{ huber_sds = 2.5 }}\n"));
    let first = scene(&text);
    let again =
        Scene::parse(&first.lock(), "lock.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(first.fit.as_ref().map(|f| &f.objectives), again.fit.as_ref().map(|f| &f.objectives));
    assert_eq!(first.lock(), again.lock());

    let folder = tempfile::tempdir().expect("a folder");
    record(&folder.path().join("clip.mcap"), &text, &[vec![0.0; 4], vec![0.02; 4]], 0.2, 3);
    std::fs::write(folder.path().join("twin.toml"), &text).expect("written");
    let mut command = assert_cmd::Command::cargo_bin("risorius").expect("built");
    let output =
        command.current_dir(folder.path()).args(["run", "twin.toml", "--out", "run"]).output().expect("it runs");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let page = String::from_utf8(output.stdout).expect("text");
    for words in
        ["minimised: markers by squares up to 2.5 sd", "by volume", "sum of activations / 0.02", "of 2 pairs"]
    {
        assert!(page.contains(words), "{words}:\n{page}");
    }
    let table = std::fs::read_to_string(folder.path().join("run/tables/objectives.csv")).expect("a table");
    let names: Vec<&str> = table.lines().skip(1).filter_map(|line| line.split(',').nth(2)).collect();
    let parts = ["markers", "effort", "sparsity", "similarity", "smoothness"];
    assert_eq!(names, [parts, parts].concat());
}
