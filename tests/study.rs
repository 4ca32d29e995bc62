//! Studies as a user runs them: every variant with its error or its code, times and counts of work, orders, pictures, and
//! settings that `--accuracy` uses.

use assert_cmd::Command;
use std::path::Path;

const PROBLEM: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [40, 10, 10], elements = [4, 1, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
[[support]]
clamp = { face = "xi1=0" }
[[load]]
traction = { face = "xi1=1", kpa = [0, 0, -0.01] }
[[contact]]
name = "table"
face = "xi3=0"
surface = { plane = { through_mm = [0, 0, -1], normal = [0, 0, 1] } }
law = { penalty = { kpa_per_mm = 5 } }
[[probe]]
name = "tip"
position_mm = [40, 5, 5]
"#;

const STUDY: &str = r#"
[task]
kind = "study"
[study]
problem = "problem.toml"
measure = "probes"
target = 0.1
set = { "tissue.gauss" = 4 }
repetitions = 2
reference = { set = { "mesh.block.elements" = [8, 1, 1] } }
[[study.vary]]
name = "host"
key = "mesh.block.elements"
values = [[1, 1, 1], [2, 1, 1], [4, 1, 1]]
[[study.variant]]
name = "no table"
without = ["contact.table"]
[[study.variant]]
name = "one iteration"
set = { "solver.max_iterations" = 1, "solver.step_min" = 0.5 }
[[study.variant]]
name = "one thread"
set = { threads = 1 }
"#;

fn risorius(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("risorius").unwrap().current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("problem.toml"), PROBLEM).unwrap();
    std::fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    folder
}

/// The rows of a table by the names of its columns; cells in quotes may hold commas.
fn table(path: &Path) -> Vec<std::collections::BTreeMap<String, String>> {
    let cells = |line: &str| {
        let (mut all, mut quoted) = (vec![String::new()], false);
        for c in line.chars() {
            match c {
                '"' => quoted = !quoted,
                ',' if !quoted => all.push(String::new()),
                c => all.last_mut().unwrap().push(c),
            }
        }
        all
    };
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(cells);
    let header = lines.next().unwrap();
    lines.map(|row| header.iter().cloned().zip(row).collect()).collect()
}

#[test]
fn a_study_lists_every_variant_and_its_settings_serve_a_run() {
    let folder = folder();
    let path = folder.path();
    let (exit, page, errors) = risorius(path, &["run", "study.toml", "--out", "out", "-q"]);
    assert_eq!(exit, 0, "{errors}");
    let rows = table(&path.join("out/tables/study.csv"));
    let number = |row: usize, column: &str| rows[row][column].parse::<f64>().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["variant"].as_str()).collect();
    assert_eq!(
        names,
        ["host = [1, 1, 1]", "host = [2, 1, 1]", "host = [4, 1, 1]", "no table", "one iteration", "one thread"]
    );
    // a finer host is nearer to the reference; without the table the beam hangs elsewhere
    assert!(number(0, "error_displacement_mm") > number(2, "error_displacement_mm"));
    assert!(number(3, "error_probes_mm") > 3.0 * number(2, "error_probes_mm"), "the table is in the reference");
    assert_eq!((rows[4]["status"].as_str(), rows[4]["code"].as_str()), ("failed", "S003"));
    // the same answer with one thread, bit for bit, and the same work
    for column in ["error_probes_mm", "newton_iterations", "points", "factor_flops"] {
        assert_eq!(rows[5][column], rows[2][column], "{column}");
    }
    for row in [0, 1, 2, 3, 5] {
        let [median, min, max] = ["seconds_median", "seconds_min", "seconds_max"].map(|c| number(row, c));
        assert!(0.0 < min && min <= median && median <= max);
        assert!(number(row, "memory_mb") > 0.0 && number(row, "factorisations") > 0.0);
    }
    // an effect that is taken away has no row and no point
    let effects = table(&path.join("out/tables/effects.csv"));
    let parts = |variant: &str| -> Vec<String> {
        effects.iter().filter(|row| row["variant"] == variant).map(|row| row["part"].clone()).collect()
    };
    assert!(
        parts("host = [4, 1, 1]").contains(&"table".to_owned()) && !parts("no table").contains(&"table".to_owned())
    );
    let orders = table(&path.join("out/tables/orders.csv"));
    assert!(orders.iter().any(|row| row["measure"] == "displacement" && row["theory"] == "4.0"), "{orders:?}");
    for picture in ["error_time.svg", "order.svg", "cost.svg"] {
        let text = std::fs::read_to_string(path.join("out").join(picture)).unwrap();
        assert!(text.starts_with("<svg") && text.contains("</svg>"), "{picture}");
    }
    assert!(page.contains("| failed | one iteration | S003") && page.contains("## Advice"), "{page}");

    // the front serves `run --accuracy`; what takes a table away or one thread is not on offer
    std::fs::copy(path.join("out/accuracy.toml"), path.join("accuracy.toml")).unwrap();
    let offered = std::fs::read_to_string(path.join("accuracy.toml")).unwrap();
    assert!(!offered.contains("no table") && !offered.contains("one thread"), "{offered}");
    let best = (0..3).map(|k| number(k, "error_probes_mm")).fold(f64::INFINITY, f64::min);
    let (exit, _, errors) =
        risorius(path, &["run", "problem.toml", "--accuracy", &format!("{best}mm"), "--out", "best"]);
    assert_eq!(exit, 0, "{errors}");
    let row = (0..3).find(|k| number(*k, "error_probes_mm") == best).unwrap();
    assert!(errors.contains(&format!("accuracy: {} for probes", names[row])), "{errors}");
    let lock = std::fs::read_to_string(path.join("best/problem.lock.toml")).unwrap();
    assert!(lock.contains(&format!("elements = {}", names[row].trim_start_matches("host = "))), "{lock}");
    assert!(lock.contains("gauss = 4"), "what is set in all variants belongs to the answer");
    let (exit, _, errors) = risorius(path, &["run", "problem.toml", "--accuracy", "1e-9mm"]);
    assert_eq!(exit, 3);
    assert!(errors.contains("error[C023]") && errors.contains("add finer variants"), "{errors}");
    std::fs::write(path.join("accuracy.toml"), "measure = 3").unwrap();
    let (exit, _, errors) = risorius(path, &["run", "problem.toml", "--accuracy", "1"]);
    assert_eq!(exit, 3);
    assert!(errors.contains("error[C022]") && errors.contains("run a study"), "{errors}");
}

#[test]
fn mistakes_of_a_study_are_told() {
    let folder = folder();
    let path = folder.path();
    let (exit, page, errors) = risorius(path, &["check", "study.toml"]);
    assert_eq!((exit, errors.as_str()), (0, ""));
    assert!(page.contains("6 variants") && page.contains("host = [4, 1, 1]: 4 elements"), "{page}");
    for (good, bad, code, words) in [
        ("measure = \"probes\"", "measure = \"probe\"", "C006", "did you mean \"probes\""),
        ("problem = \"problem.toml\"", "problem = \"none.toml\"", "C012", "none.toml"),
        ("values = [[1, 1, 1], [2, 1, 1], [4, 1, 1]]", "values = []", "C007", "at least one value"),
        ("values = [[1, 1, 1], [2, 1, 1], [4, 1, 1]]", "", "C003", "values"),
        ("name = \"host\"", "labels = [\"coarse\"]", "C007", "3, one for each value"),
        (
            "name = \"host\"\nkey = \"mesh.block.elements\"\nvalues = [[1, 1, 1], [2, 1, 1], [4, 1, 1]]",
            "without = \"contact.table\"\nlabels = [\"table\"]",
            "C007",
            "for the effect on and off",
        ),
        ("key = \"mesh.block.elements\"", "without = \"contact.table\"", "C011", "key with values"),
        ("key = \"mesh.block.elements\"", "key = \"mesh.block.element\"", "C002", "did you mean `elements`"),
        (
            "without = [\"contact.table\"]\n[[study.variant]]",
            "without = [\"contact.tabel\"]\n[[study.variant]]",
            "C013",
            "contact.tabel",
        ),
        (
            "reference = { set = { \"mesh.block.elements\" = [8, 1, 1] } }",
            "reference = { values = { \"tip.u\" = 1 } }",
            "C005",
            "<probe>.ux_mm",
        ),
        ("reference = { set = { \"mesh.block.elements\" = [8, 1, 1] } }", "", "C003", "reference"),
        ("repetitions = 2", "repetition = 2", "C002", "did you mean `repetitions`"),
    ] {
        assert!(STUDY.contains(good), "{good}");
        std::fs::write(path.join("study.toml"), STUDY.replacen(good, bad, 1)).unwrap();
        let (exit, _, errors) = risorius(path, &["check", "study.toml", "--color", "never"]);
        assert_eq!(exit, 3, "{bad}: {errors}");
        assert!(errors.contains(&format!("error[{code}]")) && errors.contains(words), "{bad}: {errors}");
    }
}
