//! Makes the recordings in `data/`: `cargo run --release --example recordings [beam|bundle|face]`, all without a name.
//!
//! The markers of a problem are moved by known activations on a host that is finer than the one that fits them (for
//! `bundle`, whose study compares sensitivities, the same), and with the head, which six markers on bone show; then they get
//! Gaussian noise and dropouts in bursts. The truth goes to `data/<name>_truth.csv`.

use nalgebra::{Rotation3, Vector3};
use risorius::forward::{Drive, Solver};
use risorius::markers::{Compression, Frame, WriteOptions, write_json};
use risorius::math::tensor::Vector;
use risorius::mesh::MaterialPoint;
use risorius::mesh::surface::Surface;
use risorius::scene::{HeadSpec, Scene, Units};
use std::error::Error;
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

/// 2026-01-01 00:00:00 UTC.
const START_NS: i64 = 1_767_225_600_000_000_000;

/// A recording and how it is made.
struct Recording {
    /// Of the problem and of the files.
    name: &'static str,
    /// What is better in the model that moves the markers.
    finer: &'static [&'static str],
    frames: usize,
    rate_hz: f64,
    noise_mm: f64,
    /// The chance that a marker is lost in a frame, for two to six frames.
    dropout: f64,
    seed: u64,
    /// The activation of a muscle at t in [0, 1]: its number, its name, t.
    activation: fn(usize, &str, f64) -> f64,
    /// How far the head has turned (rotation vector, rad) and moved (mm) at t.
    head: fn(f64) -> [Vector; 2],
}

/// Where the markers on bone are at rest, mm: on a band all around the head.
const BONE: [Vector; 6] = [
    [-58.0, 112.0, 72.0],
    [55.0, 116.0, 74.0],
    [-80.0, 108.0, -20.0],
    [82.0, 104.0, -24.0],
    [-52.0, 100.0, -96.0],
    [50.0, 103.0, -94.0],
];

const RECORDINGS: [Recording; 3] = [
    Recording {
        name: "beam",
        finer: &[
            "mesh.block={origin_mm=[0,0,0], size_mm=[60,20,20], elements=[12,4,4]}",
            "muscle.top.gauss=6",
            "muscle.bottom.gauss=6",
        ],
        frames: 40,
        rate_hz: 30.0,
        noise_mm: 0.1,
        dropout: 0.03,
        seed: 20260101,
        // two overlapping bumps, 1.2 % and 2 % at their peaks
        activation: |k, _, t| [0.012 * bump(t, 0.0, 0.7), 0.02 * bump(t, 0.3, 1.0)][k],
        head: |_| [[0.0; 3]; 2],
    },
    Recording {
        name: "bundle",
        finer: &[],
        frames: 4,
        rate_hz: 30.0,
        noise_mm: 0.05,
        dropout: 0.0,
        seed: 20260102,
        // all at work, each at a level of its own
        activation: |k, _, t| 0.002 * (1.0 + (k * 3 % 8) as f64) * (0.4 + 0.6 * t),
        head: |_| [[0.0; 3]; 2],
    },
    Recording {
        name: "face",
        finer: &["mesh.face={layers=2}"],
        frames: 12,
        rate_hz: 10.0,
        noise_mm: 0.1,
        dropout: 0.03,
        seed: 20260103,
        // a smile, the left side more than the right, while the brows go up and down
        activation: |_, name, t| {
            let peak = match name.split_once('.') {
                Some(("zygomaticus_major", "L")) => 0.06,
                Some(("zygomaticus_major", _)) => 0.04,
                Some(("zygomaticus_minor", "L")) => 0.04,
                Some(("zygomaticus_minor", _)) => 0.03,
                Some(("risorius", "L")) => 0.04,
                Some(("risorius", _)) => 0.03,
                Some(("levator_labii_superioris", _)) => 0.03,
                Some(("orbicularis_oculi_orbital", _)) => 0.01,
                Some(("frontalis", _)) => return 0.02 * bump(t, 0.0, 0.6),
                _ => 0.0,
            };
            peak * bump(t, 0.0, 1.4)
        },
        head: |t| [[0.05 * t, -0.2 * t, 0.03 * t], [9.0 * t, -4.0 * t, 12.0 * t]],
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
    let mut frames = Vec::new();
    let muscles: Vec<&str> = scene.muscles.iter().map(|muscle| muscle.name.as_str()).collect();
    let bones = match scene.fit.as_ref().map(|fit| &fit.registration.head) {
        Some(HeadSpec::BoneMarkers(labels)) => labels.clone(),
        _ => Vec::new(),
    };
    let mut lost = vec![0_usize; places.len() + bones.len()];
    let mut truth = format!("frame,time_s,{}\n", muscles.join(","));
    for k in 0..recording.frames {
        let time_s = k as f64 / recording.rate_hz;
        let t = k as f64 / (recording.frames - 1) as f64;
        let controls: Vec<f64> =
            muscles.iter().enumerate().map(|(k, name)| (recording.activation)(k, name, t)).collect();
        let [turn, shift] = (recording.head)(t);
        let turn = Rotation3::new(turn.into());
        writeln!(truth, "{k},{time_s},{}", controls.iter().map(f64::to_string).collect::<Vec<_>>().join(","))?;
        state = solver.equilibrium(&state, &Drive { controls, load: 1.0 }).map_err(risorius::Error::from)?.state;
        let x = model.current(&state);
        let skin = places.iter().map(|place| model.mesh().interpolate(*place, &x));
        let mut positions_mm = Vec::new();
        for (place, lost) in skin.chain(BONE.into_iter().take(bones.len())).zip(&mut lost) {
            let moved = turn * Vector3::from(place) + Vector3::from(shift);
            let noisy = <[f64; 3]>::from(moved).map(|c| c + recording.noise_mm * random.normal());
            if *lost == 0 && random.uniform() < recording.dropout {
                *lost = 2 + (5.0 * random.uniform()) as usize;
            }
            positions_mm.push((*lost == 0).then_some(noisy));
            *lost = lost.saturating_sub(1);
        }
        frames.push(Frame { time_s, stamp_ns: START_NS + (time_s * 1e9).round() as i64, positions_mm });
        println!("{} frame {k}", recording.name);
    }
    let labels: Vec<String> = scene.markers.iter().map(|m| m.name.clone()).chain(bones).collect();
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
