//! A small beam with muscles and a recording of its markers, made by its own forward model.
#![allow(dead_code)] // every test file is a crate of its own and uses a part

use super::Random;
use risorius::forward::{Drive, Settings, Solver};
use risorius::markers::{Frame, ReadOptions, Recording, WriteOptions, read, write_json};
use risorius::mesh::surface::Surface;
use risorius::model::build::build;
use risorius::scene::{Scene, Units};
use std::fmt::Write;
use std::path::Path;

/// Muscles of the beam: above and below the middle, on both sides of it.
pub const MUSCLES: [(&str, [f64; 3]); 4] =
    [("top.L", [3.0, 6.0, 6.5]), ("top.R", [3.0, 1.0, 6.5]), ("low.L", [3.0, 6.0, 1.0]), ("low.R", [3.0, 1.0, 1.0])];

/// Markers of the beam.
pub const MARKERS: [(&str, [f64; 3]); 6] = [
    ("M0", [20.0, 5.0, 10.0]),
    ("M1", [20.0, 0.0, 5.0]),
    ("M2", [40.0, 5.0, 10.0]),
    ("M3", [40.0, 10.0, 5.0]),
    ("M4", [40.0, 0.0, 0.0]),
    ("M5", [30.0, 5.0, 0.0]),
];

/// A problem of 2 x 1 x 1 elements with these muscles and markers; `extra` follows the keys of [fit].
pub fn problem(muscles: &[(&str, [f64; 3])], markers: &[(&str, [f64; 3])], extra: &str) -> String {
    let mut text = String::from(
        "[task]\nkind = \"fit\"\n[mesh]\n\
         block = { origin_mm = [0, 0, 0], size_mm = [40, 10, 10], elements = [2, 1, 1] }\n\
         [tissue]\nmooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }\ngauss = 4\n[output]\nview = false\n",
    );
    for (name, [x, y, z]) in muscles {
        writeln!(
            text,
            "[[muscle]]\nname = \"{name}\"\nblock = {{ origin_mm = [{x}, {y}, {z}], size_mm = [34, 3, 2.5], elements = [3, 1, 1] }}\n\
             fibre_angles_deg = [0, 0, 0]\n\
             blemker = {{ sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }}"
        )
        .expect("text");
    }
    text += "[[support]]\nclamp = { face = \"xi1=0\" }\n";
    for (name, [x, y, z]) in markers {
        writeln!(text, "[[marker]]\nname = \"{name}\"\nposition_mm = [{x}, {y}, {z}]").expect("text");
    }
    text + "[fit]\nmarkers = \"clip.mcap\"\nunits = \"m\"\n" + extra
}

pub fn scene(text: &str) -> Scene {
    Scene::parse(text, "twin.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Writes the recording of the markers of a problem into `path` for the controls of each frame, at 30 Hz, with normal noise of
/// the standard deviation `noise` mm.
pub fn record(path: &Path, text: &str, truth: &[Vec<f64>], noise: f64, seed: u64) {
    let scene = scene(text);
    let built = build(&scene).unwrap_or_else(|error| panic!("{error}"));
    let model = &built.model;
    let surface = Surface::new(model.mesh());
    let points: Vec<_> =
        scene.markers.iter().map(|m| surface.project(m.position_mm).expect("a foot").point).collect();
    let labels: Vec<String> = scene.markers.iter().map(|m| m.name.clone()).collect();
    let mut solver = Solver::new(model, Settings::default()).expect("memory");
    let mut random = Random::new(seed);
    let mut state = model.rest();
    let mut frames = Vec::new();
    for (k, controls) in truth.iter().enumerate() {
        let found = solver.equilibrium(&state, &Drive { controls: controls.clone(), load: 1.0 });
        state = found.unwrap_or_else(|failure| panic!("{}", failure.error)).state;
        let x = model.current(&state);
        let noisy = |p: [f64; 3], random: &mut Random| p.map(|p| p + noise * normal(random));
        frames.push(Frame {
            time_s: k as f64 / 30.0,
            stamp_ns: 1_000_000_000 + k as i64 * 33_333_333,
            positions_mm: points.iter().map(|p| Some(noisy(model.mesh().interpolate(*p, &x), &mut random))).collect(),
        });
    }
    write_json(path, &labels, &frames, &WriteOptions { units: Units::M, ..WriteOptions::default() })
        .expect("written");
}

pub fn recording(path: &Path) -> Recording {
    read(path, &ReadOptions { units: Units::M, ..ReadOptions::default() }).expect("read")
}

/// A standard normal number (Box and Muller 1958).
pub fn normal(random: &mut Random) -> f64 {
    let (u, v) = (random.between(1e-300, 1.0), random.between(0.0, 1.0));
    (-2.0 * u.ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}
