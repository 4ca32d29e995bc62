//! Has every code a page, every page a code, and does what it shows still happen?

use assert_cmd::Command;
use risorius::error::explain::{families, page, pages};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All files below a folder that end in `.rs`.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, found),
            false if path.extension().is_some_and(|extension| extension == "rs") => found.push(path),
            false => {}
        }
    }
}

/// Every text literal of a source that is a code: a letter of a family and three digits.
fn codes(source: &str) -> BTreeSet<String> {
    let code = source
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.split('"').skip(1).step_by(2));
    let is_code = |text: &&str| {
        text.len() == 4
            && text.starts_with(['C', 'M', 'K', 'G', 'S', 'F', 'O'])
            && text[1..].bytes().all(|b| b.is_ascii_digit())
    };
    code.filter(is_code).map(str::to_owned).collect()
}

#[test]
fn every_code_has_a_page_and_every_page_a_code() {
    let mut files = Vec::new();
    sources(&root().join("src"), &mut files);
    let used: BTreeSet<String> = files.iter().flat_map(|file| codes(&fs::read_to_string(file).unwrap())).collect();
    let explained: Vec<String> = pages().map(|page| page.code.to_owned()).collect();
    let unique: BTreeSet<String> = explained.iter().cloned().collect();
    assert!(used.contains("S003") && used.contains("C015"), "errors and warnings are found: {used:?}");
    let without: Vec<_> = used.difference(&unique).collect();
    assert!(without.is_empty(), "no page in src/error/explain: {without:?}");
    let nowhere: Vec<_> = unique.difference(&used).collect();
    assert!(nowhere.is_empty(), "a page for a code that nothing gives: {nowhere:?}");
    let mut sorted = explained.clone();
    sorted.sort_by_key(|code| ("CMKGSFO".find(&code[..1]), code.clone()));
    assert_eq!(explained, sorted, "pages stand in the order of their codes, each once");
}

#[test]
fn every_page_has_a_message_a_title_and_a_remedy() {
    for page in pages() {
        let code = page.code;
        let example = page.text.lines().next().unwrap();
        let marks = [format!("    error[{code}]: "), format!("    warn[{code}]: "), "    error: ".into()];
        assert!(marks.iter().any(|mark| example.starts_with(mark)), "{code} starts with a message: {example}");
        assert!(page.text.lines().any(|line| line.starts_with("- ")), "{code} has no remedy");
        assert!((5..60).contains(&page.title.len()), "{code}: {}", page.title);
    }
    assert!(
        families().iter().all(|family| family.pages.iter().all(|page| family.title.starts_with(&page.code[..1])))
    );
}

/// Paths change from place to place: a word with a slash keeps its last part.
fn without_folders(message: &str) -> String {
    let last = |word: &str| match word.starts_with('`') {
        true => word.to_owned(),
        false => word.rsplit('/').next().unwrap_or(word).to_owned(),
    };
    message.split_whitespace().map(last).collect::<Vec<_>>().join(" ")
}

#[test]
fn the_messages_on_pages_are_those_of_the_broken_problems() {
    let folder = root().join("data/broken");
    let mut said: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for entry in fs::read_dir(&folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name == "recordings" {
            continue;
        }
        let problem = format!("{name}/problem.toml");
        let output = Command::cargo_bin("risorius")
            .unwrap()
            .current_dir(&folder)
            .args(["check", &problem, "--color", "never"])
            .output();
        let stderr = String::from_utf8(output.unwrap().stderr).unwrap();
        let first = stderr.lines().find(|line| line.starts_with("error")).unwrap_or_default();
        said.entry(name[..4].to_owned()).or_default().push(without_folders(first));
    }
    said.remove("C000");
    assert!(said.len() >= 35, "only {} codes have a broken problem", said.len());
    for (code, messages) in said {
        let example = without_folders(page(&code).unwrap().text.lines().next().unwrap());
        assert!(
            messages.contains(&example),
            "the page of {code} shows\n{example}\nbut said is\n{}",
            messages.join("\n")
        );
    }
}

fn risorius(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("risorius").unwrap().args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn explain_prints_a_page_lists_all_and_knows_slips() {
    let (exit, stdout, _) = risorius(&["explain", "s003"]);
    assert!(
        exit == 0 && stdout.starts_with("S003: No equilibrium") && stdout.contains("solver.step_min"),
        "{stdout}"
    );
    assert!(stdout.lines().all(|line| line.starts_with("    ") || line.chars().count() <= 100), "{stdout}");
    let (exit, stdout, _) = risorius(&["explain"]);
    assert_eq!(exit, 0);
    for page in pages() {
        assert!(stdout.contains(&format!("  {}  {}\n", page.code, page.title)), "{}", page.code);
    }
    let (exit, _, stderr) = risorius(&["explain", "S03"]);
    assert!(exit == 2 && stderr.contains("did you mean S003?"), "{stderr}");
    let (exit, _, stderr) = risorius(&["explain", "nonsense"]);
    assert!(exit == 2 && stderr.contains("`risorius explain` lists all"), "{stderr}");
}

#[test]
fn a_message_leads_to_its_page() {
    let problem = root().join("data/broken/C009-no-such-bone/problem.toml").display().to_string();
    let (exit, _, stderr) = risorius(&["check", &problem]);
    assert!(exit == 3 && stderr.ends_with("\nmore: risorius explain C009\n"), "{stderr}");
}

#[test]
fn completions_know_the_commands() {
    for (shell, word) in [("bash", "_risorius"), ("zsh", "#compdef risorius"), ("fish", "complete -c risorius")] {
        let (exit, stdout, _) = risorius(&["completions", shell]);
        assert!(exit == 0 && stdout.contains(word) && stdout.contains("accuracy"), "{shell}: {stdout}");
    }
    let (exit, _, stderr) = risorius(&["completions", "cmd"]);
    assert!(exit == 2 && stderr.contains("powershell"), "{stderr}");
}
