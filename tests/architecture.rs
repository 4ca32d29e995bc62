//! Imports point one way: a module may use only modules above it in the list of `ORDER`.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// The modules of the crate, lowest first.
const ORDER: [&str; 17] = [
    "error", "math", "mesh", "material", "term", "solve", "scene", "model", "forward", "markers", "fibres", "fit",
    "study", "report", "cli", "guide", "main",
];

/// A reference that should not be there.
#[derive(Debug, PartialEq)]
struct Violation {
    file: PathBuf,
    line: usize,
    what: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "\n  {}:{}: {}", self.file.display(), self.line, self.what)
    }
}

/// What the crate root re-exports: name -> module.
type Exports = BTreeMap<String, String>;

fn rank(module: &str) -> Option<usize> {
    ORDER.iter().position(|m| *m == module)
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The text with comments blanked, line for line.
fn without_comments(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("").to_owned() + "\n").collect()
}

/// The names right after a `::` that ends at byte `at`: one, or those at the top of a brace group.
fn names_at(text: &str, at: usize) -> Vec<(usize, String)> {
    let word = |from: usize| -> String { text[from..].chars().take_while(|c| is_word(*c)).collect() };
    if !text[at..].starts_with('{') {
        return vec![(at, word(at))];
    }
    let (mut names, mut depth, mut expected) = (Vec::new(), 0, false);
    for (offset, c) in text[at..].char_indices() {
        match c {
            '{' => (depth, expected) = (depth + 1, true),
            '}' => depth -= 1,
            ',' => expected = true,
            c if is_word(c) && expected => {
                if depth == 1 {
                    names.push((at + offset, word(at + offset)));
                }
                expected = false;
            }
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    names
}

/// Every name that a source file takes from the crate root, with its byte: after `crate::`, or after enough `super::`.
/// `depth` is the number of modules that the file is deep in.
fn root_names(text: &str, depth: usize) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for start in ["crate::", "super::"] {
        for (at, _) in text.match_indices(start) {
            if text[..at].ends_with(|c: char| is_word(c) || c == ':') {
                continue;
            }
            let mut end = at + start.len();
            let mut climbed = 1;
            while start == "super::" && text[end..].starts_with(start) {
                end += start.len();
                climbed += 1;
            }
            let of_root = |(_, name): &(usize, String)| start == "crate::" || rank(name).is_some();
            if start == "crate::" || climbed >= depth {
                found.extend(names_at(text, end).into_iter().filter(of_root));
            }
        }
    }
    found
}

/// The modules that a path relative to `src` is in: `term/load/mod.rs` is in `term`, `load`.
fn modules_of(path: &Path) -> Vec<String> {
    let mut modules: Vec<String> =
        path.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if modules.last().is_some_and(|last| last == "mod") {
        modules.pop();
    }
    modules
}

/// Everything wrong in one file; `path` is relative to `src`.
fn violations(path: &Path, text: &str, exports: &Exports) -> Vec<Violation> {
    let text = without_comments(text);
    let modules = modules_of(path);
    let own = &modules[0];
    let violation = |at: usize, what: String| Violation {
        file: Path::new("src").join(path),
        line: 1 + text[..at].matches('\n').count(),
        what,
    };
    let Some(own_rank) = rank(own) else {
        return vec![violation(0, format!("`{own}` has no place in the order of modules"))];
    };
    let mut found = Vec::new();
    for (at, name) in root_names(&text, modules.len()) {
        let module = exports.get(&name).unwrap_or(&name);
        match rank(module) {
            None => found.push(violation(at, format!("`{name}` is neither a module nor re-exported"))),
            Some(other) if other > own_rank => {
                found.push(violation(at, format!("`{own}` uses `{module}`, which stands below it")));
            }
            Some(_) => {}
        }
    }
    for (at, _) in text.match_indices("unsafe") {
        if !text[at..].starts_with("unsafe_code") {
            found.push(violation(at, "unsafe code".into()));
        }
    }
    found
}

/// `pub use module::{A, B};` and `pub use module::A;` of the crate root.
fn exports(root: &str) -> Exports {
    let text = without_comments(root);
    let mut all = Exports::new();
    for (at, start) in text.match_indices("pub use ") {
        let at = at + start.len();
        let module: String = text[at..].chars().take_while(|c| is_word(*c)).collect();
        let mut rest = at + module.len() + 2;
        // the last path segment before the names
        while let Some(segment) = text[rest..].split("::").next()
            && text[rest + segment.len()..].starts_with("::")
            && segment.chars().all(is_word)
        {
            rest += segment.len() + 2;
        }
        all.extend(names_at(&text, rest).into_iter().map(|(_, name)| (name, module.clone())));
    }
    all
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
}

#[test]
fn imports_point_to_modules_above() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let root = fs::read_to_string(src.join("lib.rs")).expect("src/lib.rs");
    let exports = exports(&root);
    let mut files = Vec::new();
    sources(&src, &mut files);
    assert!(files.len() > 20, "only {} source files were found", files.len());
    let found: Vec<Violation> = files
        .iter()
        .filter(|file| !file.ends_with("src/lib.rs"))
        .flat_map(|file| {
            let text = fs::read_to_string(file).expect("a source file");
            violations(file.strip_prefix(&src).expect("inside src"), &text, &exports)
        })
        .collect();
    assert!(found.is_empty(), "{}", found.iter().map(Violation::to_string).collect::<String>());
}

#[test]
fn the_library_forbids_unsafe_code() {
    let root = include_str!("../src/lib.rs");
    assert!(root.lines().any(|line| line.trim() == "#![forbid(unsafe_code)]"));
}

/// The scanner finds what it should, and only that.
#[test]
fn a_bad_import_is_found() {
    let exports = exports("pub mod error;\npub use error::{Error, Result};\npub use fit::history::Estimate;\n");
    assert_eq!(exports["Estimate"], "fit");
    let check = |path: &str, text: &str| -> Vec<(usize, String)> {
        violations(Path::new(path), text, &exports).into_iter().map(|v| (v.line, v.what)).collect()
    };
    let bad = "use std::fmt;\nuse crate::{\n    Error,\n    math::{tensor, lanes},\n    forward::Solver,\n};\n";
    assert_eq!(check("mesh/face.rs", bad), [(5, "`mesh` uses `forward`, which stands below it".into())]);
    assert_eq!(check("forward/mod.rs", bad), []);
    assert_eq!(check("fit/mod.rs", bad), []);
    // through the re-export, through a path inside a function, by climbing, and not at all
    assert_eq!(check("mesh/mod.rs", "fn f() -> crate::Estimate;")[0].1, "`mesh` uses `fit`, which stands below it");
    assert_eq!(check("math/a/b.rs", "\nlet x = crate::mesh::new();")[0].0, 2);
    assert_eq!(check("math/a.rs", "use super::super::term::X;")[0].1, "`math` uses `term`, which stands below it");
    assert_eq!(check("math/a/b.rs", "use super::super::term::X;"), []);
    assert_eq!(check("math/a.rs", "// crate::term\nuse mycrate::term;\npub(crate) fn term() {}"), []);
    assert_eq!(check("math/a.rs", "use crate::nowhere::X;")[0].1, "`nowhere` is neither a module nor re-exported");
    assert_eq!(check("drawer.rs", "")[0].1, "`drawer` has no place in the order of modules");
    assert_eq!(check("math/a.rs", "unsafe { go() }")[0].1, "unsafe code");
}
