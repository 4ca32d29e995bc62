//! What is left where a disk is full or read-only: an exit code, a message, and all that was finished before, whole and readable.
//!
//! Disks are small tmpfs in a mount namespace of their own (`unshare -rm`), which needs no rights; where that is not possible the
//! tests say so and are skipped.
#![cfg(target_os = "linux")]

use risorius::report::playback::{Playback, Sheet};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// The fit of a beam that is shipped.
const BEAM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/problems/beam/problem.toml");

/// Eleven frames of it.
const FRAMES: &str = "fit.frames={first=0,last=30,step=3}";

fn program() -> String {
    assert_cmd::cargo::cargo_bin("risorius").display().to_string()
}

/// `risorius <arguments>` in a folder, which must end with an exit code.
fn risorius(folder: &Path, arguments: &[&str], exit: i32) -> String {
    let output = Command::new(program()).current_dir(folder).args(arguments).output().expect("it runs");
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(exit), "{arguments:?}\n{stderr}");
    stderr
}

/// Runs a script in `folder`, in which `disk` is a disk of so many kilobytes and `$RISORIUS` the program; afterwards `disk` is a
/// folder with all that was on it. `None` where nothing can be mounted.
fn on_a_disk(folder: &Path, kilobytes: usize, script: &str) -> Option<Output> {
    let possible = Command::new("unshare").args(["-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]).output();
    if !possible.is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: no tmpfs can be mounted here (unshare -rm), so nobody has seen what a full disk does");
        return None;
    }
    for name in ["disk", "kept"] {
        let _ = fs::remove_dir_all(folder.join(name));
        fs::create_dir(folder.join(name)).expect("made");
    }
    let script = format!(
        "mount -t tmpfs -o size={kilobytes}k tmpfs disk || exit 99\n{script}\ncode=$?\ncp -a disk/. kept || exit 98\nexit $code"
    );
    let unshare = ["-rm", "sh", "-c", &script];
    let output = Command::new("unshare")
        .current_dir(folder)
        .env("RISORIUS", program())
        .args(unshare)
        .output()
        .expect("it runs");
    fs::remove_dir(folder.join("disk")).expect("empty again");
    fs::rename(folder.join("kept"), folder.join("disk")).expect("renamed");
    Some(output)
}

/// The message of a command that must have ended with exit code 6, O001, and these words.
#[track_caller]
fn refused(output: &Output, words: &[&str]) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(6), "{stderr}");
    for word in ["error[O001]: cannot ", "help: ", "risorius explain O001"].iter().chain(words) {
        assert!(stderr.contains(word), "`{word}` is not in\n{stderr}");
    }
    stderr
}

const NO_ROOM: [&str; 2] = ["No space left on device", "make room"];

fn status(run: &Path) -> Value {
    serde_json::from_slice(&fs::read(run.join("status.json")).expect("a status")).expect("JSON")
}

/// All files below a folder with their bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        match path.is_dir() {
            true => all.extend(files(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes))),
            false => drop(all.insert(name, fs::read(&path).expect("read"))),
        }
    }
    all
}

/// Tables but for that of seconds.
fn tables(run: &Path) -> BTreeMap<String, Vec<u8>> {
    files(&run.join("tables")).into_iter().filter(|(name, _)| name != "cost.csv").collect()
}

/// Every table ends with a whole row, every frame in `activations.csv` has its rows in these too, every shape it lists is a file,
/// and nothing is half written; gives back the frames.
fn assert_whole(run: &Path, also: &[&str]) -> BTreeSet<String> {
    let frames = |name: &str| -> BTreeSet<String> {
        let sheet = Sheet::find(&run.join("tables"), name).expect("whole rows");
        let Some(sheet) = sheet.filter(|sheet| !sheet.is_empty()) else { return BTreeSet::new() };
        let column = sheet.column("frame").expect("frames");
        (0..sheet.len()).map(|row| sheet.text(row, column).to_owned()).collect()
    };
    let done = frames("activations");
    for name in also {
        let lacking: Vec<_> = done.difference(&frames(name)).cloned().collect();
        assert!(lacking.is_empty(), "{name} lacks frames {lacking:?}");
    }
    for (name, bytes) in files(run) {
        assert!(!name.ends_with(".part"), "{name} is half written");
        if name.ends_with(".csv") {
            assert!(bytes.is_empty() || bytes.ends_with(b"\n"), "{name} ends within a row");
        }
    }
    for frame in &done {
        let name = format!("view/result_{:0>4}", frame);
        for end in ["exf", "vtu"] {
            assert!(run.join(format!("{name}.{end}")).is_file(), "no {name}.{end}");
        }
    }
    done
}

#[test]
fn a_fit_on_a_full_disk_keeps_its_finished_frames_and_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    risorius(folder, &["run", BEAM, "-q", "--set", FRAMES, "--out", "whole"], 0);
    let mut finished = Vec::new();
    for kilobytes in [60, 300, 701, 1502, 2503] {
        let script = format!("\"$RISORIUS\" run '{BEAM}' -q --set '{FRAMES}' --out disk/run");
        let Some(output) = on_a_disk(folder, kilobytes, &script) else { return };
        let stderr = refused(&output, &NO_ROOM);
        assert!(stderr.contains("go on with: risorius resume disk/run"), "{stderr}");
        let run = folder.join("disk/run");
        let status = status(&run);
        assert_eq!((&status["status"], &status["exit"]), (&"failed".into(), &6.into()), "{kilobytes} kB");
        assert_eq!(status["error"]["code"], "O001");
        assert!(status["error"]["message"].as_str().expect("text").contains("No space left"));
        let done = assert_whole(
            &run,
            &["markers", "muscles", "energies", "convergence", "fit", "identifiability", "objectives", "unexplained"],
        );
        let counted = status["frames_ok"].as_u64().expect("a number") as usize;
        // the disk may fill up between the last row of a frame and the count of frames
        assert!((counted..=counted + 1).contains(&done.len()), "{counted} counted, {done:?}");
        assert_eq!(
            stderr.contains(&format!("ended early: {counted} frames are finished and kept in disk/run")),
            counted > 0
        );
        finished.push(done.len());

        // it can be looked at as it is
        let playback = Playback::read(&run).expect("readable");
        assert_eq!((playback.frames.len(), playback.shapes.len()), (done.len(), done.len()));
        risorius(folder, &["report", "disk/run"], 0);
        let page = fs::read_to_string(run.join("report.html")).expect("a page");
        assert!(page.contains("To be known first") && page.contains("No space left on device"));
        if !done.is_empty() {
            risorius(folder, &["export", "disk/run", "--to", "glb,mcap,sto,exf,obj,ply", "--out", "e"], 0);
        }
        // and goes on where there is room
        risorius(folder, &["resume", "-q", "disk/run"], 0);
        assert!(tables(&run) == tables(&folder.join("whole")), "{kilobytes} kB: other tables");
    }
    assert!(
        finished[0] == 0 && finished[4] > 2 && finished[4] < 11,
        "the disks must fill up on the way: {finished:?}"
    );
}

#[test]
fn a_forward_run_on_a_full_disk_keeps_its_finished_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let slab = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/slab/problem.toml");
    let curves: String = (0..8).map(|k| format!("{},{}\n", 0.1 * k as f64, 1e-4 * k as f64)).collect();
    fs::write(folder.join("curves.csv"), format!("time_s,slab\n{curves}")).expect("written");
    let csv = folder.join("curves.csv").display().to_string();
    let set = format!("--set 'controls.slab={{csv=\"{csv}\"}}' --set 'mesh.block.elements=[3,1,1]'");
    let script = format!("\"$RISORIUS\" run -q '{}' {set} --out disk/run", slab.display());
    let Some(output) = on_a_disk(folder, 400, &script) else { return };
    let stderr = refused(&output, &NO_ROOM);
    assert!(!stderr.contains("resume"), "{stderr}");
    let run = folder.join("disk/run");
    let done = assert_whole(&run, &["muscles", "energies", "convergence"]);
    assert!((1..8).contains(&done.len()), "{done:?}");
    assert_eq!(status(&run)["status"], "failed");
    assert!(
        (done.len() - 1..=done.len()).contains(&(status(&run)["frames_ok"].as_u64().expect("a number") as usize))
    );
    risorius(folder, &["report", "disk/run"], 0);
    risorius(folder, &["inspect", "disk/run"], 0);
}

/// Three frames of the built-in fit, and their recording.
fn finished(folder: &Path) {
    risorius(folder, &["run", BEAM, "-q", "--set", "fit.frames={first=0,last=20,step=10}", "--out", "run"], 0);
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/beam.mcap");
    fs::copy(recording, folder.join("take.mcap")).expect("copied");
}

#[test]
fn what_does_not_fit_on_a_disk_leaves_what_was_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    finished(folder);
    const FILL: &str = "dd if=/dev/zero of=disk/fill bs=1k 2>/dev/null; rm -f disk/free";

    // files that fitted are whole, the others are not there
    risorius(folder, &["export", "run", "--to", "sto,glb,mcap", "--out", "all"], 0);
    let all = files(&folder.join("all"));
    let kilobytes = (all["activations.sto"].len() + all["result.glb"].len()) / 1024 + 16;
    let script = "\"$RISORIUS\" export run --to sto,glb,mcap --out disk/e";
    let Some(output) = on_a_disk(folder, kilobytes, script) else { return };
    refused(&output, &["disk/e/result.mcap", NO_ROOM[0], NO_ROOM[1]]);
    let some = files(&folder.join("disk/e"));
    assert_eq!(some.keys().collect::<Vec<_>>(), ["activations.sto", "result.glb"]);
    assert!(some.iter().all(|(name, bytes)| all[name] == *bytes));

    let page = fs::read(folder.join("run/report.html")).expect("a page");
    let output = on_a_disk(folder, 20_000, &format!("cp -a run disk/; {FILL}; \"$RISORIUS\" report disk/run"));
    refused(&output.expect("mounted"), &["cannot write disk/run/report.html", NO_ROOM[0]]);
    assert!(fs::read(folder.join("disk/run/report.html")).expect("still there") == page);

    let output = on_a_disk(
        folder,
        200,
        &format!("cp take.mcap disk/; {FILL}; \"$RISORIUS\" markers convert --force take.mcap disk/take.mcap"),
    );
    refused(&output.expect("mounted"), &["cannot write disk/take.mcap", NO_ROOM[0]]);
    assert!(
        fs::read(folder.join("disk/take.mcap")).expect("still there")
            == fs::read(folder.join("take.mcap")).expect("there")
    );

    // the problem fits, the face does not: neither is left, so that it can be tried again
    let free = "dd if=/dev/zero of=disk/free bs=1k count=12 2>/dev/null";
    let output = on_a_disk(folder, 200, &format!("{free}; {FILL}; \"$RISORIUS\" new disk/mine"));
    refused(&output.expect("mounted"), &["cannot write disk/mine/face.toml", NO_ROOM[0]]);
    assert!(files(&folder.join("disk/mine")).is_empty());
}

#[test]
fn a_read_only_disk_is_named_and_nothing_is_lost() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    finished(folder);
    let before = files(&folder.join("run"));
    for (command, place) in [
        ("run -q --out disk/new", "cannot create disk/new"),
        ("run -q --out disk/run --force", "cannot remove disk/run/tables"),
        ("resume disk/again", "cannot "),
        ("report disk/run", "cannot write disk/run/report.html"),
        ("export disk/run --to sto", "cannot create disk/run/export"),
        ("advise disk/run --markers 1", "cannot write disk/run/tables/advice.csv"),
        ("markers convert --force take.mcap disk/take.mcap", "cannot write disk/take.mcap"),
        ("new disk/mine", "cannot make disk/mine"),
    ] {
        let script = format!(
            "cp -a run disk/; cp -a run disk/again; sed -i s/converged/running/ disk/again/status.json; cp take.mcap disk\n\
             mount -o remount,ro disk && \"$RISORIUS\" {command}"
        );
        let Some(output) = on_a_disk(folder, 40_000, &script) else { return };
        refused(&output, &[place, "Read-only file system", "choose a folder that you may write to"]);
        assert!(files(&folder.join("disk/run")) == before, "{command}");
    }
    let output = on_a_disk(
        folder,
        100,
        "mount -o remount,ro disk && cd disk && \"$RISORIUS\" run -q; code=$?; cd ..; (exit $code)",
    );
    refused(&output.expect("mounted"), &["cannot create runs", "Read-only file system"]);
}

/// Results are on the disk before they are printed.
#[test]
fn an_output_that_takes_nothing_is_an_error_and_the_run_is_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("there");
    let arguments = ["run", BEAM, "-q", "--set", "fit.frames={first=0,last=1}", "--out", "run"];
    let output = Command::new(program()).current_dir(&folder).args(arguments).stdout(full).output().expect("it runs");
    refused(&output, &["cannot write to standard output", NO_ROOM[0]]);
    let run = folder.path().join("run");
    assert_eq!((&status(&run)["frames_ok"], &status(&run)["exit"]), (&2.into(), &6.into()));
    assert_eq!(assert_whole(&run, &["markers", "identifiability"]).len(), 2);
    assert!(run.join("summary.txt").is_file() && run.join("tables/cost.csv").is_file());
}
