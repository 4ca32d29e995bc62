//! A muscle whose activation is a field: sensitivities by all nodal activations, and a twin whose field is found again.

use super::support::assert_close;
use risorius::fit::Fit;
use risorius::fit::sensitivity::{Sensitivity, sensitivities};
use risorius::forward::{Drive, Equilibrium, Settings, Solver};
use risorius::markers::{Compression, Frame, ReadOptions, WriteOptions, read, write_json};
use risorius::mesh::surface::Surface;
use risorius::model::Model;
use risorius::model::build::build;
use risorius::scene::{Scene, Units};
use std::path::Path;

/// A short beam with one muscle of 2 x 1 x 1 elements, and markers on five sides.
fn problem() -> String {
    let mut text = String::from(
        r#"
[task]
kind = "fit"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [30, 10, 10], elements = [3, 1, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
[[muscle]]
name = "slab"
block = { origin_mm = [3, 1, 4], size_mm = [24, 8, 5], elements = [2, 1, 1] }
activation = "field"
fibre_angles_deg = [20, 0, 0]
gauss = 4
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = "xi1=0" }
[controls]
slab = [0.002, 0.004, 0.006, 0.008, 0.006, 0.004, 0.003, 0.005, 0.007, 0.009, 0.007, 0.005]
[fit]
markers = "twin.mcap"
units = "mm"
unknowns = ["slab"]
sd_mm = 0.01
"#,
    );
    let mut add = |position: [f64; 3]| {
        let number = text.matches("[[marker]]").count();
        text.push_str(&format!("[[marker]]\nname = \"M{number}\"\nposition_mm = {position:?}\n"));
    };
    for x in [4.0, 9.0, 14.0, 19.0, 24.0, 29.0] {
        for across in [2.0, 8.0] {
            [[x, across, 0.0], [x, across, 10.0], [x, 0.0, across], [x, 10.0, across]].into_iter().for_each(&mut add);
        }
    }
    text
}

fn truth(model: &Model, scene: &Scene) -> Drive {
    let own = model.muscle_controls("slab");
    Drive { controls: scene.controls[0].value.constants(own.len()).expect("constant"), load: 1.0 }
}

fn solved<'m>(model: &'m Model, to: &Drive) -> (Solver<'m>, Equilibrium) {
    let mut solver = Solver::new(model, Settings { tolerance: 1e-10, ..Settings::default() }).expect("memory");
    let found = solver.equilibrium(&model.rest(), to).unwrap_or_else(|failure| panic!("{}", failure.error));
    (solver, found)
}

#[test]
fn sensitivities_by_nodal_activations_agree_with_differences() {
    let scene = Scene::parse(&problem(), "twin/problem.toml", Path::new("twin"), &[]).expect("a scene");
    let model = build(&scene).expect("a model").model;
    let names: Vec<&str> = model.controls().iter().map(|control| control.name.as_str()).collect();
    assert_eq!((names.len(), names[0], names[11]), (12, "slab[0]", "slab[11]"));
    let (mut solver, found) = solved(&model, &truth(&model, &scene));
    let all: Vec<usize> = (0..12).collect();
    let mut by = |how| sensitivities(how, &mut solver, &found, &all).expect("sensitivities");
    let (tangent, differences) = (by(Sensitivity::Tangent), by(Sensitivity::FiniteDifference { step: 1e-3 }));
    for ((name, ours), theirs) in names.iter().zip(tangent).zip(differences) {
        assert_close(name, ours, theirs, 1e-5);
    }
}

#[test]
fn the_field_of_a_twin_is_found_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("problem.toml");
    std::fs::write(&path, problem()).expect("written");
    let recording = folder.path().join("twin.mcap");
    std::fs::write(&recording, "").expect("written");
    let scene = Scene::read(&path, &[]).expect("a scene");
    let model = build(&scene).expect("a model").model;
    let to = truth(&model, &scene);
    let (_, found) = solved(&model, &to);
    let (surface, x) = (Surface::new(model.mesh()), model.current(&found.state));
    let place = |position| model.mesh().interpolate(surface.project(position).expect("a surface").point, &x);
    let positions_mm = scene.markers.iter().map(|marker| Some(place(marker.position_mm))).collect();
    let labels: Vec<String> = scene.markers.iter().map(|marker| marker.name.clone()).collect();
    let options = WriteOptions { topic: "/markers".into(), compression: Compression::None, units: Units::Mm };
    write_json(&recording, &labels, &[Frame { time_s: 0.0, stamp_ns: 1, positions_mm }], &options).expect("written");
    let recording = read(&recording, &ReadOptions::default()).expect("a recording");

    let spec = scene.fit.as_ref().expect("a fit");
    let mut fit = Fit::new(&model, &scene, spec, &recording).expect("a fit");
    assert_eq!(fit.unknowns(), (0..12).collect::<Vec<usize>>());
    let estimate = fit.frame(&recording, 0).expect("an estimate");
    assert!(estimate.rms_mm < 1e-5, "markers off by {} mm", estimate.rms_mm);
    for ((ours, exact), name) in estimate.equilibrium.state.controls.iter().zip(&to.controls).zip(0..) {
        assert!((ours - exact).abs() < 1e-5, "slab[{name}]: {ours} instead of {exact}");
    }
    assert!(estimate.sd.iter().all(Option::is_some));
}
