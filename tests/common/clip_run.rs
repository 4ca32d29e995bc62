//! A clip of 60 frames with its problem in a folder, the command that fits it, and the tables that it leaves.
#![cfg(unix)]

use super::twin::{MARKERS, MUSCLES, problem, record};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

pub const FRAMES: usize = 60;

/// A clip with a table of its own.
pub fn prepare(extra: &str) -> tempfile::TempDir {
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

pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("risorius"));
    command.current_dir(folder).args(arguments);
    command
}

pub fn risorius(folder: &Path, arguments: &[&str], exit: i32) -> Output {
    let output = command(folder, arguments).output().expect("it runs");
    assert_eq!(output.status.code(), Some(exit), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Runs until `frames` frames are done, then sends a signal; the exit code, `None` after a kill.
pub fn ended_after(folder: &Path, arguments: &[&str], frames: usize, signal: &str) -> Option<i32> {
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
pub fn tables(run: &Path) -> BTreeMap<String, String> {
    let entries = std::fs::read_dir(run.join("tables")).expect("tables").map(|entry| entry.expect("an entry").path());
    let all = entries.map(|path| {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        (name, std::fs::read_to_string(&path).expect("text"))
    });
    all.filter(|(name, _)| name != "cost.csv").collect()
}

pub fn assert_same(whole: &Path, resumed: &Path) {
    let (whole, resumed) = (tables(whole), tables(resumed));
    assert!(whole.len() >= 10, "{:?}", whole.keys());
    assert_eq!(whole.keys().collect::<Vec<_>>(), resumed.keys().collect::<Vec<_>>());
    for (name, table) in &whole {
        assert!(resumed[name] == *table, "{name} differs");
    }
    assert_eq!(whole["activations.csv"].lines().count(), FRAMES + 1);
}
