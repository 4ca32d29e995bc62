//! Makes the recordings in `data/`: `cargo run --release --example recordings [beam|bundle]`, all without a name.
//!
//! The markers of a problem are moved by known activations on a host that is finer than the one that fits them (for
//! `bundle`, whose study compares sensitivities, the same), then get Gaussian noise and dropouts in bursts. The truth
//! goes to `data/<name>_truth.csv`.

use risorius::forward::{Drive, Solver};
use risorius::markers::{Compression, Frame, WriteOptions, write_json};
use risorius::mesh::MaterialPoint;
use risorius::mesh::surface::Surface;
use risorius::scene::{Scene, Units};
use std::error::Error;
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

const RATE_HZ: f64 = 30.0;
/// 2026-01-01 00:00:00 UTC.
const START_NS: i64 = 1_767_225_600_000_000_000;

/// A recording and how it is made.
struct Recording {
    /// Of the problem and of the files.
    name: &'static str,
    /// What is better in the model that moves the markers.
    finer: &'static [&'static str],
    frames: usize,
    noise_mm: f64,
    /// The chance that a marker is lost in a frame, for two to six frames.
    dropout: f64,
    seed: u64,
    /// Activations in the order of the muscles at t in [0, 1].
    activations: fn(f64) -> Vec<f64>,
}

const RECORDINGS: [Recording; 2] = [
    Recording {
        name: "beam",
        finer: &[
            "mesh.block={origin_mm=[0,0,0], size_mm=[60,20,20], elements=[12,4,4]}",
            "muscle.top.gauss=6",
            "muscle.bottom.gauss=6",
        ],
        frames: 40,
        noise_mm: 0.1,
        dropout: 0.03,
        seed: 20260101,
        // two overlapping bumps, 1.2 % and 2 % at their peaks
        activations: |t| vec![0.012 * bump(t, 0.0, 0.7), 0.02 * bump(t, 0.3, 1.0)],
    },
    Recording {
        name: "bundle",
        finer: &[],
        frames: 4,
        noise_mm: 0.05,
        dropout: 0.0,
        seed: 20260102,
        // all at work, each at a level of its own
        activations: |t| (0..8).map(|k| 0.002 * (1.0 + (k * 3 % 8) as f64) * (0.4 + 0.6 * t)).collect(),
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    let asked = std::env::args().nth(1);
    for recording in RECORDINGS.iter().filter(|recording| asked.as_deref().is_none_or(|name| name == recording.name))
    {
        make(recording)?;
    }
    Ok(())
}

fn make(recording: &Recording) -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("problems").join(recording.name);
    let text = std::fs::read_to_string(folder.join("problem.toml"))?;
    let finer: Vec<String> = recording.finer.iter().map(|&key| key.to_owned()).collect();
    let scene = Scene::parse(&text, "problem.toml", &folder, &finer)?;
    let model = risorius::model::build::build(&scene)?.model;
    let surface = Surface::new(model.mesh());
    let places: Vec<MaterialPoint> =
        scene.markers.iter().filter_map(|m| surface.project(m.position_mm)).map(|foot| foot.point).collect();

    let mut random = Random(recording.seed);
    let mut solver = Solver::new(&model, Default::default())?;
    let mut state = model.rest();
    let mut lost = vec![0_usize; places.len()];
    let mut frames = Vec::new();
    let muscles: Vec<&str> = scene.muscles.iter().map(|muscle| muscle.name.as_str()).collect();
    let mut truth = format!("frame,time_s,{}\n", muscles.join(","));
    for k in 0..recording.frames {
        let time_s = k as f64 / RATE_HZ;
        let controls = (recording.activations)(k as f64 / (recording.frames - 1) as f64);
        writeln!(truth, "{k},{time_s},{}", controls.iter().map(f64::to_string).collect::<Vec<_>>().join(","))?;
        state = solver.equilibrium(&state, &Drive { controls, load: 1.0 }).map_err(risorius::Error::from)?.state;
        let x = model.current(&state);
        let mut positions_mm = Vec::new();
        for (place, lost) in places.iter().zip(&mut lost) {
            let noisy = model.mesh().interpolate(*place, &x).map(|c| c + recording.noise_mm * random.normal());
            if *lost == 0 && random.uniform() < recording.dropout {
                *lost = 2 + (5.0 * random.uniform()) as usize;
            }
            positions_mm.push((*lost == 0).then_some(noisy));
            *lost = lost.saturating_sub(1);
        }
        frames.push(Frame { time_s, stamp_ns: START_NS + (time_s * 1e9).round() as i64, positions_mm });
        println!("{} frame {k}", recording.name);
    }
    let labels: Vec<String> = scene.markers.iter().map(|m| m.name.clone()).collect();
    let options = WriteOptions { topic: "/markers".into(), compression: Compression::Zstd, units: Units::M };
    write_json(&root.join(format!("data/{}.mcap", recording.name)), &labels, &frames, &options)?;
    std::fs::write(root.join(format!("data/{}_truth.csv", recording.name)), truth)?;
    Ok(())
}

/// From 0 to 1 and back between two times.
fn bump(t: f64, from: f64, to: f64) -> f64 {
    if (from..=to).contains(&t) { (PI * (t - from) / (to - from)).sin().powi(2) } else { 0.0 }
}

/// A small deterministic generator (PCG, O'Neill 2014), so that the recording is the same on every machine.
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        f64::from(x.rotate_right((self.0 >> 59) as u32)) / 4294967296.0
    }

    /// Standard normal, by Box and Muller.
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * PI * self.uniform()).cos()
    }
}
