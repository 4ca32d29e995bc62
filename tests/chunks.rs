//! A clip that is fitted in chunks side by side.
#![cfg(unix)]

use crate::common::clip_run::{FRAMES, assert_same, ended_after, prepare, risorius};
use std::path::Path;

/// Of every frame all controls and their standard deviations.
fn activations(run: &Path) -> Vec<Vec<Option<f64>>> {
    let mut table = csv::Reader::from_path(run.join("tables/activations.csv")).expect("a table");
    let row = |row: csv::StringRecord| row.iter().skip(2).map(|cell| cell.parse().ok()).collect();
    table.records().map(|record| row(record.expect("a row"))).collect()
}

fn log(run: &Path) -> String {
    std::fs::read_to_string(run.join("log.jsonl")).expect("a log")
}

/// Cold starts lead to the answers of warm ones, and those of all frames at once are one answer.
#[test]
fn chunks_find_what_the_whole_clip_finds() {
    for extra in ["", "smoothness = { sd_per_root_s = 0.1 }\nclip = \"smoother\"\n"] {
        let folder = prepare(extra);
        let whole = ["run", "twin.toml", "--out", "whole", "-q"];
        let chunks = ["run", "twin.toml", "--out", "chunks", "--set", "fit.chunks={count=3,overlap=4}"];
        risorius(folder.path(), &whole, 0);
        let stderr = risorius(folder.path(), &chunks, 0).stderr;
        let [whole, chunks] = ["whole", "chunks"].map(|run| folder.path().join(run));
        let (a, b) = (activations(&whole), activations(&chunks));
        assert_eq!((a.len(), b.len()), (FRAMES, FRAMES));
        let pairs = a.iter().flatten().zip(b.iter().flatten());
        let apart = pairs.map(|(a, b)| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs(),
            (None, None) => 0.0,
            _ => f64::INFINITY,
        });
        let apart = apart.fold(0.0, f64::max);
        println!("{extra:?}: {apart:.1e} apart");
        // a frame ends where a step is a millionth of the range; it starts elsewhere
        assert!(apart < 2e-6, "{apart}");
        let stderr = String::from_utf8_lossy(&stderr);
        for (chunk, told) in [("chunk 2 of 3: ", 1), ("chunk 3 of 3: ", 1), ("F015", 0)] {
            assert_eq!(stderr.matches(chunk).count(), told, "{stderr}");
            assert_eq!(log(&chunks).matches(chunk).count(), told);
        }
    }
}

#[test]
fn chunks_that_are_ended_go_on_to_the_same_bytes_on_any_number_of_threads() {
    let folder = prepare("chunks = { count = 3, overlap = 4 }\n");
    risorius(folder.path(), &["run", "twin.toml", "--out", "whole", "--threads", "1"], 0);
    let cut = ["run", "twin.toml", "--out", "cut", "--threads", "2", "--progress=plain"];
    assert_eq!(ended_after(folder.path(), &cut, 3, "-KILL"), None);
    let again = ["resume", "cut", "--threads", "4", "--progress=plain"];
    assert_eq!(ended_after(folder.path(), &again, 9, "-INT"), Some(130));
    risorius(folder.path(), &["resume", "cut"], 0);
    assert_same(&folder.path().join("whole"), &folder.path().join("cut"));
    // each has its own checkpoints, with those of the frames on which it settles
    let kept = |part: &str| {
        let entries = std::fs::read_dir(folder.path().join("cut/state").join(part)).expect("a folder");
        let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
        names.filter(|name| name.starts_with("frame_")).count()
    };
    let parts = ["", "chunk_1", "chunk_2"].map(kept);
    assert_eq!(parts.iter().sum::<usize>(), FRAMES + 8, "{parts:?}");
}

/// Without the frames before, a frame that is tied to them has another answer; on one frame nothing settles.
#[test]
fn two_answers_where_chunks_meet_are_told() {
    let tied =
        "smoothness = { sd_per_root_s = 0.005 }\nchunks = { count = 2, overlap = 1 }\nframes = { last = 29 }\n";
    let folder = prepare(tied);
    let stderr = risorius(folder.path(), &["run", "twin.toml", "--out", "run"], 0).stderr;
    let stderr = String::from_utf8_lossy(&stderr);
    assert!(stderr.contains("warn[F015]") && stderr.contains("let chunks overlap more"), "{stderr}");
    let status = std::fs::read_to_string(folder.path().join("run/status.json")).expect("a status");
    assert!(status.contains("F015"), "{status}");
    risorius(folder.path(), &["run", "twin.toml", "--out", "strict", "--strict"], 5);
}
