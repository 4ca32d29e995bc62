//! Fits clips whose activations are known and writes what came of it: `cargo run --release --example twin_table [OUT]`.
//!
//! The clips are those of `tests/common/clips.rs`, three with other random numbers for every row. The table goes to
//! `problems/twins/README.md`, or to the file OUT.

#[path = "../tests/common/mod.rs"]
mod common;

use common::clips::{Asked, Conditions, Head, Score, fit, positions, record, truth};
use std::error::Error;
use std::fmt::Write;
use std::path::PathBuf;

const FRAMES: usize = 40;
const CLIPS: u64 = 3;
/// What the model that moves the markers has better where it is not the one that is fitted.
const FINER: [&str; 3] = ["mesh.block.elements=[12, 4, 4]", "muscle.top.gauss=6", "muscle.bottom.gauss=6"];

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::args().nth(1).map(PathBuf::from);
    let truth = truth(FRAMES);
    let folder = tempfile::tempdir()?;
    let mut table = String::from(
        "| data from | noise mm | lost | head | fitted | markers rms mm | activations rms | less bias | intervals hold | less bias |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (name, set) in [("the mesh that is fitted", &[][..]), ("12 x 4 x 4 elements", &FINER[..])] {
        let clean = positions(set, &truth);
        for head in [Head::Bones, Head::Estimated] {
            for (noise_mm, lost) in [(0.1, 0.1), (0.3, 0.1), (0.3, 0.4)] {
                let conditions = Conditions { noise_mm, lost, head };
                for smoothed in [false, true] {
                    let mut score = Score::default();
                    for seed in 1..=CLIPS {
                        let path = folder.path().join("clip.mcap");
                        record(&path, &clean, &conditions, seed);
                        score.add(&fit(&path, &truth, &conditions, &Asked { smoothed, estimate: true }));
                    }
                    writeln!(
                        table,
                        "| {name} | {noise_mm} | {:.0} % | {} | {} | {:.3} | {:.1e} | {:.1e} | {:.1} % | {:.1} % |",
                        100.0 * lost,
                        if head == Head::Bones { "bone markers" } else { "estimated" },
                        if smoothed { "smoothed" } else { "frame by frame" },
                        score.marker_rms(),
                        score.rms(),
                        score.rms_unbiased(),
                        100.0 * score.coverage(),
                        100.0 * score.coverage_unbiased(),
                    )?;
                    print!("{}", &table[table[..table.len() - 1].rfind('\n').map_or(0, |at| at + 1)..]);
                }
            }
        }
    }
    match out {
        Some(out) => std::fs::write(out, table)?,
        None => println!("{table}"),
    }
    Ok(())
}
