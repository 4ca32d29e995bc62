//! A fit that is ended from outside goes on where it was, to the same tables with the same bytes.
#![cfg(unix)]

use crate::common::twin::{MARKERS, MUSCLES, problem, record};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

const FRAMES: usize = 60;

/// A clip with a table of its own.
fn prepare(extra: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let text = problem(&MUSCLES[..3], &MARKERS, &format!("sd_mm = 0.2\n{extra}"));
    // from rest: the first frame must stand where the model does
    let wave = |k: usize, by: f64| (k as f64 / 4.0).min(1.0) * (0.5 - 0.5 * (by + k as f64 / 6.0).cos());
    let truth: Vec<Vec<f64>> =
        (0..FRAMES).map(|k| vec![0.02 * wave(k, 0.0), 0.02 * wave(k, 1.0), 0.01 * wave(k, 2.0)]).collect();
    record(&folder.path().join("clip.mcap"), &text, &truth, 0.1, 9);
    std::fs::write(folder.path().join("twin.toml"), text).expect("written");
    folder
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("risorius"));
    command.current_dir(folder).args(arguments);
    command
}

fn risorius(folder: &Path, arguments: &[&str], exit: i32) -> Output {
    let output = command(folder, arguments).output().expect("it runs");
    assert_eq!(output.status.code(), Some(exit), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Runs until `frames` frames are done, then sends a signal; the exit code, `None` after a kill.
fn ended_after(folder: &Path, arguments: &[&str], frames: usize, signal: &str) -> Option<i32> {
    let mut child = command(folder, arguments).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("it runs");
    let stderr = BufReader::new(child.stderr.take().expect("piped"));
    let mut lines = stderr.lines();
    let seen = format!("{frames}/{FRAMES} ");
    assert!(lines.by_ref().any(|line| line.expect("text").starts_with(&seen)), "it ended by itself");
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("sent");
    assert!(sent.success());
    lines.for_each(drop);
    child.wait().expect("it ends").code()
}

/// All tables but the one of seconds.
fn tables(run: &Path) -> BTreeMap<String, String> {
    let entries = std::fs::read_dir(run.join("tables")).expect("tables").map(|entry| entry.expect("an entry").path());
    let all = entries.map(|path| {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        (name, std::fs::read_to_string(&path).expect("text"))
    });
    all.filter(|(name, _)| name != "cost.csv").collect()
}

fn frames_kept(run: &Path) -> usize {
    let entries =
        std::fs::read_dir(run.join("state")).expect("state").map(|entry| entry.expect("an entry").file_name());
    entries.filter(|name| name.to_string_lossy().starts_with("frame_")).count()
}

fn assert_same(whole: &Path, resumed: &Path) {
    let (whole, resumed) = (tables(whole), tables(resumed));
    assert!(whole.len() >= 10, "{:?}", whole.keys());
    assert_eq!(whole.keys().collect::<Vec<_>>(), resumed.keys().collect::<Vec<_>>());
    for (name, table) in &whole {
        assert!(resumed[name] == *table, "{name} differs");
    }
    assert_eq!(whole["activations.csv"].lines().count(), FRAMES + 1);
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
