//! Everything that the README and the guide tell a newcomer to type is typed here, in their order, in a folder like a fresh checkout.

use crate::recordings::files::{Processor, Tracks, c3d};
use risorius::markers::{ReadOptions, read};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// What is added to commands that begin like this, so that they take a second.
const CHEAPER: [(&str, &str); 3] = [
    (
        "risorius run problems/bending_study/",
        "--set study.repetitions=1 --set 'study.vary.host.values=[[2,1,1],[4,1,1]]' --set 'study.vary[1].values=[\"trilinear\"]' \
         --set 'study.vary[2].values=[1]' --set 'study.vary[3].values=[4]' --set study.estimate=false \
         --set 'study.reference.set={\"mesh.block.elements\"=[8,2,2]}'",
    ),
    ("risorius run problem.toml --accuracy", ""),
    ("risorius run problem.toml", "--force"),
];
/// The same for commands without a problem file.
const DEFAULT_RUN: &str = "--set 'fit.frames={first=0,last=0}'";
/// What stands for a file or folder of the reader.
const WORDS: [(&str, &str); 6] = [
    ("RUN", "mine"),
    ("DIR", "another"),
    ("FILE", "take.c3d"),
    ("IN", "take.c3d"),
    ("OUT.mcap", "out.mcap"),
    ("CODE", "S003"),
];
/// What is told and needs no trial here: this test, and what `.ci/run` does.
const BY_OTHERS: [&str; 5] =
    ["cargo test", "cargo run --release --", "cargo doc --open", "cargo install --path .", "risorius completions"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README, then the pages of the guide, with their paths.
fn pages() -> Vec<(PathBuf, String)> {
    let mut paths: Vec<PathBuf> = fs::read_dir(root().join("src/guide"))
        .expect("the guide")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    paths.retain(|path| path.extension().is_some_and(|end| end == "md"));
    paths.sort();
    paths.insert(0, root().join("README.md"));
    let text =
        |path: &PathBuf| fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    paths.iter().map(|path| (path.clone(), text(path))).collect()
}

/// The code of a page: whole lines of indented blocks and blocks of text, and what stands between backticks.
fn code(page: &str) -> Vec<String> {
    let (mut found, mut fence) = (Vec::new(), None);
    for line in page.lines() {
        match (line.strip_prefix("```"), &fence) {
            (Some(kind), None) => fence = Some(kind.to_owned()),
            (Some(_), Some(_)) => fence = None,
            (None, Some(kind)) if kind == "text" => found.push(line.trim().to_owned()),
            (None, Some(_)) => {}
            (None, None) if line.starts_with("    ") => found.push(line.trim().to_owned()),
            (None, None) => {
                // a bar in a table is escaped
                found.extend(line.replace("\\|", "|").split('`').skip(1).step_by(2).map(str::to_owned));
            }
        }
    }
    found
}

/// Commands to type, each once.
fn commands() -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for (_, page) in pages() {
        for code in code(&page) {
            let first = code.split_whitespace().next().unwrap_or_default();
            if ["cargo", "risorius", "cp", "python"].contains(&first) && !all.contains(&code) {
                all.push(code);
            }
        }
    }
    all
}

/// A folder with the problems, a recording and a problem file of one's own: two frames of the beam as a C3D file.
fn checkout() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let copied = Command::new("cp").arg("-r").arg(root().join("problems")).arg(folder.path()).status().expect("cp");
    assert!(copied.success());
    let recording = read(
        &root().join("data/beam.mcap"),
        &ReadOptions { units: risorius::scene::Units::M, ..ReadOptions::default() },
    );
    let recording = recording.expect("the recording of the beam");
    let frames = recording.frames.iter().step_by(20).map(|frame| frame.positions_mm.clone()).collect();
    let tracks = Tracks { labels: recording.labels.clone(), rate: 1.5, frames };
    fs::write(folder.path().join("take.c3d"), c3d(&tracks, Processor::Intel, None)).expect("written");
    let beam = fs::read_to_string(root().join("problems/beam/problem.toml")).expect("the beam");
    let own = beam.replace("\"../../data/beam.mcap\"", "\"take.mcap\"").replace("units = \"m\"", "units = \"mm\"");
    assert!(own.contains("take.mcap") && own.contains("units = \"mm\""), "{own}");
    fs::write(folder.path().join("problem.toml"), own).expect("written");
    folder
}

/// The line for a shell.
fn typed(command: &str) -> String {
    let command =
        command.strip_prefix("cargo run --release -- ").map_or(command.to_owned(), |rest| format!("risorius {rest}"));
    if ["cargo run --release", "risorius", "risorius run"].contains(&&*command) {
        return format!("risorius {DEFAULT_RUN}");
    }
    // a command that is spoken of
    if command.split_whitespace().count() == 2 && command.starts_with("risorius ") && command != "risorius explain" {
        return format!("{command} --help");
    }
    let added = CHEAPER.iter().find(|(start, _)| command.starts_with(start)).map_or("", |(_, added)| added);
    // the settings that a study leaves belong to the problem that it is about
    let command = command
        .replace("risorius run problem.toml --accuracy", "risorius run problems/bending/problem.toml --accuracy");
    let word = |word: &str| {
        let (start, rest) =
            word.split_once('/').map_or((word, String::new()), |(start, rest)| (start, format!("/{rest}")));
        WORDS.iter().find(|(name, _)| *name == start).map_or(word.to_owned(), |(_, stands)| format!("{stands}{rest}"))
    };
    let words: Vec<String> = command.split_whitespace().map(word).collect();
    format!("{} {added}", words.join(" ")).trim_end().to_owned()
}

fn shell(folder: &Path, line: &str) -> Output {
    let program = assert_cmd::cargo::cargo_bin("risorius");
    let path = std::env::var("PATH").expect("a PATH");
    let path = format!("{}:{path}", program.parent().expect("a folder").display());
    Command::new("sh").current_dir(folder).env("PATH", path).args(["-c", line]).output().expect("it runs")
}

#[cfg(unix)]
#[test]
fn every_command_works() {
    let folder = checkout();
    let (mut done, mut others) = (BTreeSet::new(), 0);
    for command in commands() {
        // one of another file is there
        for (before, place) in [("--example ", "examples"), ("cargo test ", "tests")] {
            if let Some(name) = command.split(before).nth(1).and_then(|rest| rest.split([' ', ':']).next()) {
                let there = [format!("{place}/{name}.rs"), format!("{place}/{name}/main.rs")];
                assert!(there.iter().any(|path| root().join(path).is_file()), "`{command}`: no {name} in {place}");
                others += 1;
            }
        }
        let script = command.strip_prefix("python ").and_then(|rest| rest.split_whitespace().next());
        if let Some(script) = script {
            assert!(root().join(script).is_file(), "`{command}`: no {script}");
            others += 1;
            continue;
        }
        if command.contains("--example ") || command.starts_with("cargo test ") || BY_OTHERS.contains(&&*command) {
            continue;
        }
        let line = typed(&command);
        if !done.insert(line.clone()) {
            continue;
        }
        let start = std::time::Instant::now();
        let output = shell(folder.path(), &line);
        println!("{:5.2} s  {command}", start.elapsed().as_secs_f64());
        assert!(
            output.status.success(),
            "`{command}`, typed as `{line}`: {}\n{}",
            output.status,
            String::from_utf8_lossy(&output.stderr)
        );
    }
    assert!(done.len() > 25 && others > 3, "{} {others}", done.len());
    // what is said to be there
    for file in [
        "runs/face-0001/report.html",
        "mine/report.html",
        "bent/export/result.glb",
        "bent/export/activations.sto",
        "study/study.md",
        "fan/fibres.exf",
    ] {
        assert!(folder.path().join(file).is_file(), "no {file}");
    }
}

/// A flag that the pages name is one of some command.
#[test]
fn every_flag_is_there() {
    let help = |arguments: &[&str]| -> String {
        let output = assert_cmd::Command::cargo_bin("risorius")
            .expect("the program")
            .args(arguments)
            .output()
            .expect("it runs");
        assert!(output.status.success(), "{arguments:?}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let mut all = help(&["--help"]);
    let commands: Vec<String> = all
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
        .collect();
    assert!(commands.len() > 10, "{commands:?}");
    commands.iter().filter(|name| *name != "help").for_each(|name| all += &help(&[name, "--help"]));
    ["convert", "match"].iter().for_each(|name| all += &help(&["markers", name, "--help"]));
    let known: BTreeSet<&str> = all.split(|c: char| !c.is_alphanumeric() && c != '-').collect();
    let mut checked = 0;
    for (path, page) in pages() {
        for code in code(&page) {
            let of_ours = code.starts_with('-') || code.starts_with("risorius");
            let flags = code.split_whitespace().filter(|word| word.starts_with("--") && word.len() > 2);
            for flag in flags.filter(|_| of_ours && !code.contains("---")) {
                assert!(known.contains(flag), "{}: no command has {flag} (`{code}`)", path.display());
                checked += 1;
            }
        }
    }
    assert!(checked > 20, "{checked}");
}

/// A file or folder of the project that the pages name is there, and every picture and page they link.
#[test]
fn every_place_is_there() {
    let mut checked = 0;
    for (path, page) in pages() {
        let folder = path.parent().expect("a folder");
        let linked: Vec<&str> = page.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
        for link in linked.iter().filter(|link| !link.starts_with("http") && link.contains('.')) {
            assert!(folder.join(link).is_file(), "{}: no {link}", path.display());
            checked += 1;
        }
        for code in code(&page) {
            let ours = ["src/", "tests/", "problems/", "data/", "examples/", ".ci/"]
                .iter()
                .any(|start| code.starts_with(start));
            if ours && !code.contains([' ', '<', '*']) {
                assert!(root().join(&code).exists(), "{}: no {code}", path.display());
                checked += 1;
            }
        }
    }
    assert!(checked > 60, "{checked}");
}

/// The table of modules is the list of them.
#[test]
fn every_module_is_in_the_readme() {
    let readme = &pages()[0].1;
    let table = readme.split("| module, lowest first |").nth(1).expect("the table of modules");
    let told: BTreeSet<String> = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .filter_map(|line| line.split('`').nth(1).map(str::to_owned))
        .collect();
    let entries = fs::read_dir(root().join("src")).expect("src").map(|entry| entry.expect("an entry").file_name());
    let there: BTreeSet<String> =
        entries.map(|name| name.to_string_lossy().into_owned()).filter(|name| !name.ends_with(".rs")).collect();
    assert_eq!(told, there);
}

/// What is said of a new member of a family: every file is there and names the member that is the example; its own file has
/// about so many lines.
#[test]
fn adding_names_files_that_hold_the_example() {
    let text = fs::read_to_string(root().join("src/guide/adding.md")).expect("the page");
    let mut tables = 0;
    for section in text.split("\n## ").filter(|section| section.contains("| file | lines | hold |")) {
        let before = section.split("| file |").next().expect("words");
        let member = before.split('`').nth(1).expect("the example");
        let names = [member.replace('-', "_"), member.replace('-', ""), member.trim_start_matches('.').to_owned()];
        let rows = section.lines().filter(|line| line.starts_with("| `"));
        for row in rows {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            let (file, lines) = (cells[1].trim_matches('`'), cells[2].parse::<f64>().expect("a number"));
            let path = root().join(file);
            let found = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{file}: {error}"));
            let lower = found.to_lowercase();
            assert!(names.iter().any(|name| lower.contains(name)), "{file} does not name {member}");
            let stem = path.file_stem().expect("a name").to_string_lossy().into_owned();
            if names.contains(&stem) {
                let there = found.lines().count() as f64;
                assert!((there - lines).abs() <= 0.25 * there, "{file} has {there} lines, not {lines}");
            }
        }
        tables += 1;
    }
    assert_eq!(tables, 5);
}

/// The short problem of the README can be checked.
#[cfg(unix)]
#[test]
fn the_problem_of_the_readme_is_one() {
    let readme = &pages()[0].1;
    let text = readme.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a problem");
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("short.toml"), text).expect("written");
    let output = shell(folder.path(), "risorius check --strict short.toml");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
