//! The folder of a run in which a file is not what it was: a clear error or what is left of it, never a panic.

use crate::common::twin::{MARKERS, MUSCLES, problem, record};
use risorius::error::Result;
use risorius::report::export::{Format, export};
use risorius::report::html;
use risorius::report::playback::Contents;
use risorius::report::state::{Checkpoints, Guard};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// A fit of three frames with shapes.
fn run(folder: &Path) -> PathBuf {
    let text = problem(&MUSCLES[..2], &MARKERS, "sd_mm = 0.2\n").replace("view = false", "view = true");
    let truth: Vec<Vec<f64>> = (0..3).map(|k| vec![0.004 * k as f64, 0.006 * k as f64]).collect();
    record(&folder.join("clip.mcap"), &text, &truth, 0.1, 5);
    fs::write(folder.join("twin.toml"), text).expect("written");
    let mut command = assert_cmd::Command::cargo_bin("risorius").expect("the program");
    command.current_dir(folder).args(["run", "-q", "twin.toml", "--out", "run"]).assert().success();
    folder.join("run")
}

/// Everything that reads the folder of a run; what each said.
fn all_readers(run: &Path, out: &Path) -> Vec<(&'static str, Result<()>)> {
    let formats = Format::ALL.map(|(format, ..)| format);
    let export = || export(run, &formats, None, out).map(drop);
    let resume = || {
        Guard::read(run)?.changes(run);
        Checkpoints::open(run)?.left(0).map(drop)
    };
    vec![
        ("inspect", Contents::of(run).map(|contents| drop(contents.to_string()))),
        ("export", export()),
        ("report", html::write(run).map(drop)),
        ("resume", resume()),
    ]
}

type Change = fn(&[u8]) -> Option<Vec<u8>>;

/// What can happen to a file.
const CHANGES: [(&str, Change); 8] = [
    ("gone", |_| None),
    ("empty", |_| Some(Vec::new())),
    ("cut in half", |bytes| Some(bytes[..bytes.len() / 2].to_vec())),
    ("without its last line", |bytes| {
        let end =
            bytes[..bytes.len().saturating_sub(1)].iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        Some(bytes[..end].to_vec())
    }),
    ("twice", |bytes| Some([bytes, bytes].concat())),
    ("something else", |bytes| Some(bytes.iter().map(|byte| byte ^ 0xa5).collect())),
    ("other digits", |bytes| Some(bytes.iter().map(|byte| if *byte == b'0' { b'9' } else { *byte }).collect())),
    ("no numbers", |bytes| Some(String::from_utf8_lossy(bytes).replace("0.", "nan").into_bytes())),
];

#[test]
fn nothing_panics_on_a_damaged_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, out) = (run(folder.path()), folder.path().join("out"));
    let said = all_readers(&run, &out);
    assert!(said.iter().all(|(_, said)| said.is_ok()), "{said:?}");
    let mut files: Vec<PathBuf> = Vec::new();
    for sub in ["", "tables", "view", "state"] {
        let entries = fs::read_dir(run.join(sub)).expect("a folder").map(|entry| entry.expect("an entry").path());
        // what nobody reads back cannot do harm
        let read =
            |path: &PathBuf| path.is_file() && !path.extension().is_some_and(|end| end == "vtu" || end == "pvd");
        files.extend(entries.filter(read));
    }
    assert!(files.len() > 20, "{files:?}");
    let (mut tried, mut refused) = (0, 0);
    for path in &files {
        let whole = fs::read(path).expect("there");
        for (change, changed) in CHANGES {
            match changed(&whole) {
                Some(bytes) => fs::write(path, bytes).expect("written"),
                None => fs::remove_file(path).expect("removed"),
            }
            let name = path.strip_prefix(&run).expect("inside").display();
            let said = catch_unwind(AssertUnwindSafe(|| all_readers(&run, &out)));
            let Ok(said) = said else { panic!("{name}, {change}: a panic") };
            for (reader, said) in &said {
                tried += 1;
                let Err(error) = said else { continue };
                refused += 1;
                assert!(matches!(error.exit_code(), 3 | 6), "{name}, {change}, {reader}: {error}");
                for error in error.mistakes() {
                    let message = error.to_string();
                    let placed = error.place().is_some() || message.contains("/run");
                    assert!(placed, "{name}, {change}, {reader}: no place: {message}");
                    let mended = error.place().is_some() || error.help().is_some();
                    assert!(mended, "{name}, {change}, {reader}: no remedy: {message}");
                }
            }
            // what was found must not be shown in part as if it were all
            let playback = said.iter().find(|(reader, _)| *reader == "export").map(|(_, said)| said.is_err());
            let file = name.to_string();
            if ["tables/activations.csv", "tables/markers.csv", "status.json", "problem.lock.toml"].contains(&&*file)
                && !["other digits", "no numbers", "twice"].contains(&change)
                && !(file == "problem.lock.toml" && change == "without its last line")
            {
                assert_eq!(playback, Some(true), "{name}, {change}: it was taken for a whole run");
            }
        }
        fs::write(path, whole).expect("mended");
    }
    println!("{tried} readings of {} files, {refused} refused", files.len());
    assert!(refused > 60, "{refused} of {tried}");
}

/// The same through the command line: code, file and remedy.
#[test]
fn a_damaged_table_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = run(folder.path());
    let table = run.join("tables/markers.csv");
    let text = fs::read_to_string(&table).expect("there");
    fs::write(&table, text.replacen("M0,", "M0,none", 1)).expect("written");
    for arguments in [&["export", "run", "--to", "glb"][..], &["report", "run"]] {
        let mut command = assert_cmd::Command::cargo_bin("risorius").expect("the program");
        let output = command.current_dir(&folder).args(arguments).output().expect("it runs");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(6), "{stderr}");
        for words in [
            "error[O005]: run/tables/markers.csv",
            "row 2: `none",
            "in column `x_mm` is no number",
            "problem.lock.toml",
        ] {
            assert!(stderr.contains(words), "`{words}` is not in\n{stderr}");
        }
    }
}
