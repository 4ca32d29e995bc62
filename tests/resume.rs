//! A fit that is ended from outside goes on where it was, to the same tables with the same bytes.
#![cfg(unix)]

use crate::common::clip_run::{FRAMES, assert_same, ended_after, prepare, risorius};
use std::path::Path;
use std::process::Command;

fn frames_kept(run: &Path) -> usize {
    let entries =
        std::fs::read_dir(run.join("state")).expect("state").map(|entry| entry.expect("an entry").file_name());
    entries.filter(|name| name.to_string_lossy().starts_with("frame_")).count()
}

#[test]
fn killed_and_interrupted_fits_go_on_to_the_same_bytes() {
    let kept = "reuse = \"broyden\"\nsmoothness = { sd_per_root_s = 0.1, sd_per_root_s3 = 20 }\n";
    let exact = "reuse = \"adjoint\"\ntolerance = { sds = 0.01 }\n";
    for (extra, flag) in [("", "--force"), (kept, "--estimate"), (exact, "--force")] {
        let folder = prepare(extra);
        let whole = ["run", "twin.toml", "--out", "whole", flag];
        let cut = ["run", "twin.toml", "--out", "cut", flag, "--progress=plain"];
        risorius(folder.path(), &whole, 0);

        assert_eq!(ended_after(folder.path(), &cut, 3, "-KILL"), None);
        let kept = frames_kept(&folder.path().join("cut"));
        // every frame that was told of, and none that was not finished
        assert!((3..FRAMES).contains(&kept), "{kept} frames");
        assert_tells_its_model(folder.path(), "cut");
        // interrupted on the way, then to the end
        assert_eq!(ended_after(folder.path(), &["resume", "cut", "--progress=plain"], kept + 4, "-INT"), Some(130));
        let later = frames_kept(&folder.path().join("cut"));
        assert!((kept + 4..FRAMES).contains(&later), "{later} frames");
        risorius(folder.path(), &["resume", "cut"], 0);
        assert_same(&folder.path().join("whole"), &folder.path().join("cut"));
        let status = |run: &str| -> serde_json::Value {
            let text = std::fs::read_to_string(folder.path().join(run).join("status.json")).expect("a status");
            serde_json::from_str(&text).expect("json")
        };
        assert_eq!(status("whole"), status("cut"));
        let again = risorius(folder.path(), &["resume", "cut"], 0);
        assert!(String::from_utf8_lossy(&again.stderr).contains("nothing to do"));
    }
}

/// What is known of a run from its beginning is told, whatever ended it.
fn assert_tells_its_model(folder: &Path, run: &str) {
    let inspected = risorius(folder, &["inspect", run, "--json"], 0).stdout;
    let inspected: serde_json::Value = serde_json::from_slice(&inspected).expect("json");
    let size = |key: &str| inspected["numerics"][key].as_u64().unwrap_or_else(|| panic!("{key}: {inspected}"));
    let whole = std::fs::read(folder.join("whole/manifest.json")).expect("a manifest");
    let whole: serde_json::Value = serde_json::from_slice(&whole).expect("json");
    for key in ["elements", "nodes", "muscles", "unknowns"] {
        assert_eq!(whole["numerics"][key], size(key), "{key}");
    }
    let words = format!("{} tricubic Hermite elements ({} nodes, ", size("elements"), size("nodes"));
    risorius(folder, &["report", run], 0);
    let page = std::fs::read_to_string(folder.join(run).join("report.html")).expect("a page");
    assert!(page.contains(&words), "the page does not say `{words}`");
}

/// A limit on the size of files stands for a full disk: the run ends with an error of output, and goes on when there is room.
#[test]
fn a_full_disk_loses_no_finished_frame() {
    let folder = prepare("");
    risorius(folder.path(), &["run", "twin.toml", "--out", "whole"], 0);
    let largest = |sub: &str| {
        let entries = std::fs::read_dir(folder.path().join("whole").join(sub)).expect("a folder");
        entries.map(|entry| entry.expect("an entry").metadata().expect("its size").len()).max().expect("files")
    };
    let (table, state) = (largest("tables"), largest("state"));
    println!("largest table {table} bytes, largest checkpoint {state} bytes");
    assert!(table > 2 * state, "the limit must let checkpoints pass");
    let blocks = (table / 2).max(state + 2048) / 512;
    let binary = assert_cmd::cargo::cargo_bin("risorius");
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec {} run twin.toml --out cut", binary.display());
    let output = Command::new("sh").current_dir(folder.path()).args(["-c", &script]).output().expect("it runs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(6), "{stderr}");
    assert!(stderr.contains("error[O001]"), "{stderr}");
    let kept = frames_kept(&folder.path().join("cut"));
    assert!((2..FRAMES).contains(&kept), "{kept} frames");
    risorius(folder.path(), &["resume", "cut"], 0);
    assert_same(&folder.path().join("whole"), &folder.path().join("cut"));
}

#[test]
fn what_is_not_as_it_was_is_refused() {
    let folder = prepare("frames = { last = 2 }\n");
    let refused = |run: &str, code: &str, words: &str| {
        let stderr = String::from_utf8_lossy(&risorius(folder.path(), &["resume", run], 3).stderr).into_owned();
        assert!(stderr.contains(&format!("error[{code}]")) && stderr.contains(words), "{stderr}");
    };
    refused("nowhere", "C025", "nothing to go on from");
    risorius(folder.path(), &["run", "twin.toml", "--out", "run"], 0);
    let run = folder.path().join("run");
    // as if it had been killed
    std::fs::write(run.join("status.json"), "{}").expect("written");

    let file = run.join("state/frame_000001.bin");
    let whole = std::fs::read(&file).expect("a checkpoint");
    let mut damaged = whole.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 4;
    std::fs::write(&file, &damaged).expect("written");
    refused("run", "C027", "checksum");
    std::fs::write(&file, &whole[..middle]).expect("written");
    refused("run", "C027", "frame_000001.bin");
    std::fs::write(&file, &whole).expect("written");

    for (file, name) in
        [("twin.toml", "twin.toml"), ("clip.mcap", "clip.mcap"), ("run/problem.lock.toml", "problem.lock.toml")]
    {
        let path = folder.path().join(file);
        let before = std::fs::read(&path).expect("there");
        std::fs::write(&path, [before.as_slice(), b"\n# changed"].concat()).expect("written");
        refused("run", "C026", name);
        std::fs::write(&path, before).expect("written");
    }
    let output = risorius(folder.path(), &["resume", "run", "--set", "fit.tolerance=0.1"], 3);
    assert!(String::from_utf8_lossy(&output.stderr).contains("what the flags set"));
    risorius(folder.path(), &["resume", "run"], 0);
}
