//! Run folder, status, manifest: nobody shares them, nothing is half written.

use super::model::model;
use super::support::{run_in, temporary};
use risorius::Error;
use risorius::forward::Work;
use risorius::report::manifest::Numerics;
use risorius::report::run_folder::write_atomically;
use risorius::report::tables::ProbeTable;
use risorius::report::{FailedFrame, Input, Manifest, Outcome, RunFolder, Status};
use risorius::term::pressure::Trilinear;
use std::collections::HashSet;
use std::fs;

#[test]
fn run_folders_are_numbered_and_shared_by_nobody() {
    let folder = temporary();
    let runs = folder.path().join("deep/runs");
    let names = || -> HashSet<String> {
        let entries = fs::read_dir(&runs).expect("runs").map(|e| e.expect("an entry").file_name());
        entries.map(|name| name.to_string_lossy().into_owned()).collect()
    };
    let first = RunFolder::create(&runs, "smile").expect("made");
    assert_eq!(first.path(), runs.join("smile-0001"));
    assert!(first.tables().is_dir() && first.view().join("linear").is_dir());
    fs::create_dir(runs.join("smile-0007")).expect("made");
    assert_eq!(RunFolder::create(&runs, "smile").expect("made").path(), runs.join("smile-0008"));
    assert_eq!(RunFolder::create(&runs, "smil").expect("made").path(), runs.join("smil-0001"));
    for (name, expected) in [("../a/b", "_._a_b-0001"), ("", "run-0001"), ("né:e", "né_e-0001")] {
        assert_eq!(RunFolder::create(&runs, name).expect("made").path(), runs.join(expected));
    }
    let before = names().len();
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| RunFolder::create(&runs, "smile").expect("made"));
        }
    });
    assert_eq!(names().len(), before + 8);
}

#[test]
fn a_folder_in_use_needs_force_and_keeps_what_is_not_ours() {
    let folder = temporary();
    let out = folder.path().join("out");
    let run = RunFolder::create_at(&out, false).expect("made");
    let Err(error) = RunFolder::create_at(&out, false) else { panic!("a folder in use was taken") };
    assert!(matches!(&error, Error::FolderNotEmpty { entries: 2, .. }), "{error}");
    assert_eq!((error.code(), error.exit_code()), ("O002", 6));
    assert!(error.help().is_some_and(|help| help.contains("--force")));

    // not a run: everything stays
    fs::write(run.tables().join("mine.csv"), "mine").expect("written");
    RunFolder::create_at(&out, true).expect("taken");
    assert!(run.tables().join("mine.csv").is_file());
    // a run: its shapes go, so that no frame of it is taken for one of the next run
    Status::finished(1, Vec::new()).write(&run).expect("written");
    fs::write(run.view().join("result_0009.vtu"), "old").expect("written");
    fs::write(out.join("notes.txt"), "mine").expect("written");
    RunFolder::create_at(&out, true).expect("taken");
    assert!(!run.view().join("result_0009.vtu").exists() && run.view().join("linear").is_dir());
    assert!(out.join("notes.txt").is_file());
}

#[test]
fn what_cannot_be_written_says_where() {
    let folder = temporary();
    // a file where a folder should be
    let file = folder.path().join("file");
    fs::write(&file, "").expect("written");
    let Err(error) = RunFolder::create(&file, "smile") else { panic!("made a folder in a file") };
    assert!(matches!(&error, Error::Io { action: "create", path, .. } if *path == file), "{error}");
    assert_eq!(error.exit_code(), 6);

    let locked = folder.path().join("locked");
    fs::create_dir(&locked).expect("made");
    let mut permissions = fs::metadata(&locked).expect("there").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&locked, permissions).expect("set");
    // root writes anyway
    if fs::write(locked.join("probe"), "").is_err() {
        let Err(error) = RunFolder::create(&locked, "smile") else { panic!("wrote into a locked folder") };
        assert!(matches!(&error, Error::Io { action: "create", .. }) && error.to_string().contains("smile-0001"));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_and_not_a_short_file() {
    let folder = temporary();
    let run = run_in(&folder);
    // every write to /dev/full fails as on a full disk
    std::os::unix::fs::symlink("/dev/full", run.tables().join("probes.csv")).expect("linked");
    let Err(error) = ProbeTable::create(&run) else { panic!("wrote to a full disk") };
    assert!(matches!(&error, Error::Io { action: "write", path, .. } if path.ends_with("tables/probes.csv")));
    std::os::unix::fs::symlink("/dev/full", run.path().join("status.json.part")).expect("linked");
    let Err(error) = Status::running(0, Vec::new()).write(&run) else { panic!("wrote to a full disk") };
    assert!(matches!(&error, Error::Io { action: "write", path, .. } if path.ends_with("status.json")));
    assert!(!run.path().join("status.json").exists() && !run.path().join("status.json.part").exists());
}

#[test]
fn files_are_replaced_whole_or_not_at_all() {
    let folder = temporary();
    let path = folder.path().join("file.txt");
    write_atomically(&path, b"first").expect("written");
    write_atomically(&path, b"second").expect("written");
    assert_eq!(fs::read(&path).expect("there"), b"second");
    // the name is taken by a folder: the rename fails, and nothing is left lying about
    let taken = folder.path().join("taken");
    fs::create_dir_all(taken.join("full")).expect("made");
    let Err(error) = write_atomically(&taken, b"third") else { panic!("a file replaced a folder") };
    assert!(matches!(error, Error::Io { action: "rename", .. }));
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2);
    // readers of a file that is rewritten all the time never see a part of it
    let texts = ["a".repeat(100_000), "b".repeat(50_000)];
    write_atomically(&path, texts[0].as_bytes()).expect("written");
    std::thread::scope(|scope| {
        let writer = scope.spawn(|| {
            (0..200).for_each(|k| write_atomically(&path, texts[k % 2].as_bytes()).expect("written"));
        });
        while !writer.is_finished() {
            let found = fs::read_to_string(&path).expect("there");
            assert!(texts.contains(&found), "{} bytes", found.len());
        }
    });
}

#[test]
fn status_says_how_a_run_ended() {
    let folder = temporary();
    let run = run_in(&folder);
    let read = || -> Status {
        serde_json::from_slice(&fs::read(run.path().join("status.json")).expect("there")).expect("JSON")
    };
    Status::running(0, Vec::new()).write(&run).expect("written");
    assert_eq!((read().status, read().exit), (Outcome::Running, None));
    let error = Error::InaccurateSolve { residual: 1e-3, required: 1e-9 };
    let failed = || vec![FailedFrame::new(7, &error)];
    Status::finished(11, failed()).write(&run).expect("written");
    let text: serde_json::Value =
        serde_json::from_slice(&fs::read(run.path().join("status.json")).expect("there")).expect("JSON");
    let frame = serde_json::json!({"frame": 7, "code": "S004", "message": error.to_string()});
    let expected = serde_json::json!({"status": "partial", "exit": 4, "frames_ok": 11, "frames_failed": [frame]});
    assert_eq!(text, expected);
    for (status, word, exit) in [
        (Status::finished(3, Vec::new()), "converged", 0),
        (Status::finished(0, failed()), "failed", 4),
        (Status::interrupted(2, Vec::new()), "interrupted", 130),
        (Status::failed(2, Vec::new(), &error), "failed", 4),
    ] {
        assert_eq!(status.exit, Some(exit));
        assert_eq!(serde_json::to_value(status.status).expect("JSON"), word);
        status.write(&run).expect("written");
        assert_eq!(read(), status);
    }
    assert_eq!(read().error.expect("what went wrong").code, "S004");
}

#[test]
fn manifest_tells_one_input_from_another_and_what_was_done() {
    let folder = temporary();
    let run = run_in(&folder);
    let path = folder.path().join("problem.toml");
    fs::write(&path, "abc").expect("written");
    let input = Input::read(&path).expect("read");
    // FIPS 180-2, B.1
    assert_eq!(input.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    assert_eq!(input.bytes, 3);
    let model = model(&Trilinear);
    let work = Work { iterations: 5, ..Work::default() };
    let command = ["risorius", "run", "a b.toml"].map(String::from).to_vec();
    assert!(Manifest::read(run.path()).expect("nothing to read").is_null());
    let begun = Manifest { numerics: Some(Numerics::of(&model)), ..Manifest::begun(command, vec![input], 2) };
    begun.write(&run).expect("written");
    let read = Manifest::read(run.path()).expect("read");
    assert!(read["numerics"]["nodes"] == 24 && read["work"].is_null() && read["wall_seconds"].is_null(), "{read}");
    begun.ended(&work, 1.5).write(&run).expect("written");
    let read = Manifest::read(run.path()).expect("read");
    assert_eq!(read["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(read["command"][2], "a b.toml");
    assert_eq!(read["numerics"]["elements"], 6);
    assert_eq!(read["numerics"]["pressures"], 24);
    assert_eq!(read["numerics"]["muscles"], 2);
    assert_eq!(read["numerics"]["unknowns"], model.numbering().unknowns());
    assert_eq!(read["work"]["newton_iterations"], 5);
    assert_eq!(read["wall_seconds"], 1.5);
    if cfg!(target_os = "linux") {
        assert!(read["peak_memory_bytes"].as_u64().is_some_and(|bytes| (1 << 20..1 << 40).contains(&bytes)));
        assert!(read["cpu_seconds"].as_f64().is_some_and(|seconds| (0.0..1e5).contains(&seconds)));
    }
}
