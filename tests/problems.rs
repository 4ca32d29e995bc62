//! Every folder of `problems/` does what its `expected.toml` says: discovered, not listed.
//!
//! `expected.toml`: the `status` of the run, `arguments` that make a long one short, and values: the table, the cells that choose a row, the column, the value and an
//! absolute tolerance in the units of the column.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Deserialize)]
struct Expected {
    status: String,
    #[serde(default)]
    arguments: Vec<String>,
    #[serde(default)]
    value: Vec<Value>,
}

#[derive(Deserialize)]
struct Value {
    table: String,
    row: BTreeMap<String, toml::Value>,
    column: String,
    value: f64,
    tolerance: f64,
}

#[test]
fn every_problem_meets_its_expectation() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems");
    let mut folders: Vec<_> = std::fs::read_dir(&root)
        .expect("problems/")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    assert!(folders.len() >= 4, "problems/ lost its folders");
    for folder in folders {
        check(&folder);
    }
}

fn check(folder: &Path) {
    let name = folder.display();
    for file in ["README.md", "problem.toml", "expected.toml"] {
        assert!(folder.join(file).is_file(), "{name} has no {file}");
    }
    let text = std::fs::read_to_string(folder.join("expected.toml")).expect("expected.toml");
    let expected: Expected = toml::from_str(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
    let out = tempfile::tempdir().expect("a folder");
    let run = out.path().join("run");
    let output = assert_cmd::Command::cargo_bin("risorius")
        .expect("the program")
        .args(["run", "-q"])
        .arg(folder.join("problem.toml"))
        .arg("--out")
        .arg(&run)
        .args(&expected.arguments)
        .output()
        .expect("it runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    let status: serde_json::Value = serde_json::from_str(
        &std::fs::read_to_string(run.join("status.json")).unwrap_or_else(|e| panic!("{name}: {e}\n{errors}")),
    )
    .expect("status.json");
    assert_eq!(status["status"], expected.status.as_str(), "{name}: {errors}");
    for value in &expected.value {
        let found = cell(&run.join("tables").join(format!("{}.csv", value.table)), &value.row, &value.column);
        assert!(
            (found - value.value).abs() <= value.tolerance,
            "{name}: {} of {} is {found}, expected {} +- {}",
            value.column,
            value.table,
            value.value,
            value.tolerance
        );
    }
    println!("{name}: {} values", expected.value.len());
}

/// The cells of a line; a comma in quotes is none between cells.
fn cells(line: &str) -> Vec<&str> {
    let mut quoted = false;
    let between = |c: char| {
        quoted ^= c == '"';
        c == ',' && !quoted
    };
    line.split(between).map(|cell| cell.trim_matches('"')).collect()
}

/// The number in a column of the one row whose cells are as wanted.
fn cell(table: &Path, row: &BTreeMap<String, toml::Value>, column: &str) -> f64 {
    let text = std::fs::read_to_string(table).unwrap_or_else(|error| panic!("{}: {error}", table.display()));
    let mut lines = text.lines().map(cells);
    let header = lines.next().expect("a header");
    let index = |name: &str| {
        header.iter().position(|h| *h == name).unwrap_or_else(|| panic!("{}: no column {name}", table.display()))
    };
    let wanted = |cells: &[&str]| {
        row.iter().all(|(name, value)| {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            cells[index(name)] == text
        })
    };
    let rows: Vec<_> = lines.filter(|cells| wanted(cells)).collect();
    assert_eq!(rows.len(), 1, "{}: rows with {row:?}", table.display());
    rows[0][index(column)].parse().unwrap_or_else(|error| panic!("{}: {column}: {error}", table.display()))
}
