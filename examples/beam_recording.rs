//! Makes `data/beam.mcap`, the recording of the default problem: `cargo run --release --example beam_recording`.
//!
//! The markers of `problems/beam` are moved by known activations on a finer host than the one that fits them (12 x 4 x 4
//! elements instead of 6 x 2 x 2), then get Gaussian noise of 0.1 mm per coordinate and dropouts in bursts. The truth goes
//! to `data/beam_truth.csv`.

use risorius::forward::{Drive, Solver};
use risorius::markers::{Compression, Frame, WriteOptions, write_json};
use risorius::mesh::MaterialPoint;
use risorius::mesh::surface::Surface;
use risorius::scene::{Scene, Units};
use std::error::Error;
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

const FRAMES: usize = 40;
const RATE_HZ: f64 = 30.0;
const NOISE_MM: f64 = 0.1;
/// 2026-01-01 00:00:00 UTC.
const START_NS: i64 = 1_767_225_600_000_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let finer = [
        "mesh.block={origin_mm=[0,0,0], size_mm=[60,20,20], elements=[12,4,4]}".to_owned(),
        "muscle.top.gauss=6".to_owned(),
        "muscle.bottom.gauss=6".to_owned(),
    ];
    let text = std::fs::read_to_string(root.join("problems/beam/problem.toml"))?;
    let scene = Scene::parse(&text, "problems/beam/problem.toml", &root.join("problems/beam"), &finer)?;
    let model = risorius::model::build::build(&scene)?.model;
    let surface = Surface::new(model.mesh());
    let places: Vec<MaterialPoint> =
        scene.markers.iter().filter_map(|m| surface.project(m.position_mm)).map(|foot| foot.point).collect();

    let mut random = Random(20260101);
    let mut solver = Solver::new(&model, Default::default())?;
    let mut state = model.rest();
    let mut lost = vec![0_usize; places.len()];
    let mut frames = Vec::new();
    let mut truth = String::from("frame,time_s,top,bottom\n");
    for k in 0..FRAMES {
        let time_s = k as f64 / RATE_HZ;
        let controls = activations(k as f64 / (FRAMES - 1) as f64).to_vec();
        writeln!(truth, "{k},{time_s},{},{}", controls[0], controls[1])?;
        state = solver.equilibrium(&state, &Drive { controls, load: 1.0 }).map_err(risorius::Error::from)?.state;
        let x = model.current(&state);
        let mut positions_mm = Vec::new();
        for (place, lost) in places.iter().zip(&mut lost) {
            let noisy = model.mesh().interpolate(*place, &x).map(|c| c + NOISE_MM * random.normal());
            // a marker is lost for two to six frames every now and then
            if *lost == 0 && random.uniform() < 0.03 {
                *lost = 2 + (5.0 * random.uniform()) as usize;
            }
            positions_mm.push((*lost == 0).then_some(noisy));
            *lost = lost.saturating_sub(1);
        }
        frames.push(Frame { time_s, stamp_ns: START_NS + (time_s * 1e9).round() as i64, positions_mm });
        println!("frame {k}");
    }
    let labels: Vec<String> = scene.markers.iter().map(|m| m.name.clone()).collect();
    let options = WriteOptions { topic: "/markers".into(), compression: Compression::Zstd, units: Units::M };
    write_json(&root.join("data/beam.mcap"), &labels, &frames, &options)?;
    std::fs::write(root.join("data/beam_truth.csv"), truth)?;
    Ok(())
}

/// Activations (top, bottom) at t in [0, 1]: two overlapping bumps, 1.2 % and 2 % at their peaks.
fn activations(t: f64) -> [f64; 2] {
    let bump = |from: f64, to: f64| {
        if (from..=to).contains(&t) { (PI * (t - from) / (to - from)).sin().powi(2) } else { 0.0 }
    };
    [0.012 * bump(0.0, 0.7), 0.02 * bump(0.3, 1.0)]
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
