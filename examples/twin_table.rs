//! Fits clips whose activations are known and writes what came of it: `cargo run --release --example twin_table [OUT]`.
//!
//! The clips are those of `tests/common/clips.rs`, three with other random numbers for every row. The table takes the place of the
//! one in `problems/fit_study/README.md`, or goes to the file OUT.

#[path = "../tests/common/mod.rs"]
mod common;

use common::clips::{Conditions, Head, Score, fit, positions, record, truth};
use std::error::Error;
use std::path::{Path, PathBuf};

const FRAMES: usize = 40;
const CLIPS: u64 = 3;
/// Where the head is from, noise in mm, the part of the samples that is lost, and how many frames are neutral.
const ROWS: [(Head, f64, f64, usize); 7] = [
    (Head::Bones, 0.1, 0.1, 1),
    (Head::Bones, 0.3, 0.1, 1),
    (Head::Bones, 0.3, 0.1, 10),
    (Head::Bones, 0.3, 0.4, 1),
    (Head::Estimated, 0.1, 0.1, 1),
    (Head::Estimated, 0.3, 0.1, 1),
    (Head::Estimated, 0.3, 0.4, 1),
];
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
    for (name, set, finer) in [("the mesh that is fitted", &[][..], false), ("12 x 4 x 4 elements", &FINER[..], true)]
    {
        let clean = positions(set, &truth);
        for (head, noise_mm, lost, neutral) in ROWS {
            // neutral frames are no remedy for a coarse mesh
            if finer && neutral > 1 {
                continue;
            }
            let conditions = Conditions { noise_mm, lost, head, neutral };
            let mut scores = [Score::default(); 2];
            for seed in 1..=CLIPS {
                let path = folder.path().join("clip.mcap");
                record(&path, &clean, &conditions, seed);
                let found = fit(&path, &truth, &conditions, finer);
                scores.iter_mut().zip(&found).for_each(|(score, found)| score.add(found));
            }
            for (score, fitted) in scores.iter().zip(["frame by frame", "smoothed"]) {
                let unbiased = match finer {
                    true => [format!("{:.1e}", score.rms_unbiased()), percent(score.coverage_unbiased())],
                    false => ["-".into(), "-".into()],
                };
                let row = format!(
                    "| {name} | {noise_mm} | {:.0} % | {} | {fitted} | {:.3} | {:.1e} | {} | {} | {} |\n",
                    100.0 * lost,
                    match head {
                        Head::Bones if neutral > 1 => format!("bone markers, {neutral} neutral frames"),
                        Head::Bones => "bone markers".into(),
                        Head::Estimated => "estimated".into(),
                    },
                    score.marker_rms(),
                    score.rms(),
                    unbiased[0],
                    percent(score.coverage()),
                    unbiased[1],
                );
                print!("{row}");
                table += &row;
            }
        }
    }
    match out {
        Some(out) => std::fs::write(out, table)?,
        None => {
            let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/fit_study/README.md");
            let text = std::fs::read_to_string(&page)?;
            let start = text.find("| data from |").ok_or("the page has no table to replace")?;
            let rows = text[start..].split_inclusive('\n').take_while(|line| line.starts_with('|'));
            let end = start + rows.map(str::len).sum::<usize>();
            std::fs::write(page, [&text[..start], &table, &text[end..]].concat())?;
        }
    }
    Ok(())
}

fn percent(part: f64) -> String {
    format!("{:.1} %", 100.0 * part)
}
