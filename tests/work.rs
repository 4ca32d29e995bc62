//! The work that fixed problems take, in counts: a slowdown fails here without a clock. The bounds leave a little room for
//! rounding on other machines; a change that needs more must say why.

use risorius::fit::Fit;
use risorius::forward::{Drive, Settings, Solver};
use risorius::markers::{ReadOptions, read};
use risorius::model::build::build;
use risorius::scene::Scene;
use std::path::Path;

const SLAB_BEAM: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
kappa_kpa = 10.0
gauss = 4
[[muscle]]
name = "slab"
block = { origin_mm = [4.5, 2.0, 14.2], size_mm = [50, 16, 4], elements = [5, 2, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = "xi1=0" }
"#;

#[test]
fn slab_beam_from_rest() {
    let scene = Scene::parse(SLAB_BEAM, "slab.toml", Path::new("."), &[]).expect("a scene");
    let model = build(&scene).expect("a model").model;
    for (activation, iterations) in [(0.01, 20), (0.1, 30), (1.0, 45)] {
        let mut solver = Solver::new(&model, Settings::default()).expect("memory");
        let drive = Drive { controls: vec![activation], load: 1.0 };
        solver.equilibrium(&model.rest(), &drive).expect("an equilibrium");
        let work = solver.work();
        println!("a {activation}: {} iterations, {} force evaluations", work.iterations, work.force_evaluations);
        assert!(work.iterations <= iterations, "a {activation}: {} Newton iterations", work.iterations);
        assert_eq!(work.linear.factorisations, work.iterations, "one factorisation an iteration");
        assert_eq!(work.assemblies, work.iterations, "one assembly an iteration");
    }
}

#[test]
fn default_fit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = Scene::read(&root.join("problems/beam/problem.toml"), &[]).expect("a scene");
    let spec = scene.fit.as_ref().expect("a fit");
    let model = build(&scene).expect("a model").model;
    let options = ReadOptions { units: spec.units.unwrap_or_default(), ..ReadOptions::default() };
    let recording = read(&spec.markers, &options).expect("the recording");
    let mut fit = Fit::new(&model, &scene, spec, &recording).expect("a fit");
    let mut factorisations = Vec::new();
    for k in 0..recording.frames.len() {
        let before = fit.work().linear.factorisations;
        fit.frame(&recording, k).unwrap_or_else(|error| panic!("frame {k}: {error}"));
        factorisations.push(fit.work().linear.factorisations - before);
    }
    factorisations.sort_unstable();
    let median = factorisations[factorisations.len() / 2];
    let total: usize = factorisations.iter().sum();
    println!("factorisations: median {median} a frame, {total} in all");
    assert!(median <= 3 && total <= 150, "median {median}, total {total}");
}
