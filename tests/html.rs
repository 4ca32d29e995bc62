//! Does the page of a run show what was found, and need nothing from outside?

use assert_cmd::Command;
use std::fs;
use std::path::Path;

/// Exit code, standard output and standard error of `risorius <arguments>` in a folder.
fn risorius(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("risorius").unwrap().current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Nothing in a page may name a place that a browser would ask.
fn stands_alone(page: &str) {
    for word in
        ["src=\"http", "href=\"http", "@import", "url(", "fetch(", "XMLHttpRequest", "<link rel=\"stylesheet", "<img"]
    {
        assert!(!page.contains(word), "`{word}` is in the page");
    }
    assert!(page.contains("Content-Security-Policy\" content=\"default-src 'none'"));
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    for tag in ["section", "figure", "svg", "table", "tr", "td", "p", "div", "script", "ul", "li", "pre"] {
        let open = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert_eq!(open, page.matches(&format!("</{tag}>")).count(), "<{tag}>");
    }
    assert!(page.matches("Research use only, not a diagnosis").count() >= 2);
    assert!(!page.contains("NaN") && !page.contains("inf "), "a number is missing");
}

/// The fit of a beam that is shipped.
const BEAM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/problems/beam/problem.toml");

#[test]
fn a_fit_leaves_its_page() {
    let folder = tempfile::tempdir().unwrap();
    // a pair of sides, and a name that would break a page which does not escape it
    let lock = ["run", BEAM, "--set", "fit.frames={first=0,last=20,step=10}", "--out", "first"];
    let (exit, _, stderr) = risorius(folder.path(), &lock);
    assert!(exit == 0 && stderr.contains("all on one page: first/report.html"), "{stderr}");
    let text = fs::read_to_string(folder.path().join("first/problem.lock.toml")).unwrap();
    let text = text
        .replace("\"top\"", "\"lifter.L\"")
        .replace("\"bottom\"", "\"lifter.R\"")
        .replace("name = \"beam\"", "name = \"<b>&\"");
    fs::write(folder.path().join("sides.toml"), text).unwrap();
    let (exit, _, stderr) = risorius(folder.path(), &["run", "sides.toml", "--out", "run", "-q"]);
    assert!(exit == 0 && stderr.is_empty(), "{stderr}");
    let page = fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    stands_alone(&page);
    for words in [
        "<h1>&lt;b&gt;&amp;</h1>",
        "Muscle activations found from surface markers; 3 frames",
        "id=\"viewer-data\"",
        "Left against right",
        "B11 (rms ",
        "grey: lost",
        "determined by the markers",
        "Gauss-Newton steps of the fit",
        "24 tricubic Hermite elements",
        "Wu, Hung, Hunter, Mithraratne 2013",
        "SHA-256",
        "c1_kpa = 0.5",
    ] {
        assert!(page.contains(words), "`{words}` is not in the page");
    }
    // the strongest activation of the left side is that of the table
    let table = fs::read_to_string(folder.path().join("run/tables/activations.csv")).unwrap();
    let strongest =
        table.lines().skip(1).map(|row| row.split(',').nth(2).unwrap().parse::<f64>().unwrap()).fold(0.0, f64::max);
    assert!(page.contains(&format!("<td>lifter.L</td><td>{strongest:.4}</td>")), "{strongest}");
    // the viewer has the three frames, the one that moved most first
    let data = page.split("id=\"viewer-data\">").nth(1).unwrap().split("</script>").next().unwrap();
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    assert_eq!(data["frames"], serde_json::json!([0, 10, 20]));
    assert_eq!((data["bodies"].as_array().unwrap().len(), data["markers"][2].as_array().unwrap().len()), (3, 12));

    // made again from the folder it is the same
    fs::remove_file(folder.path().join("run/report.html")).unwrap();
    let (exit, stdout, _) = risorius(folder.path(), &["report", "run"]);
    assert!(exit == 0 && stdout.starts_with("wrote run/report.html ("), "{stdout}");
    assert!(fs::read_to_string(folder.path().join("run/report.html")).unwrap() == page);
    let (exit, _, stderr) = risorius(folder.path(), &["report", "."]);
    assert!(exit == 6 && stderr.contains("error[O003]"), "{stderr}");
}

/// What the tables about the markers say is on the page.
#[test]
fn what_the_markers_can_and_cannot_tell_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let (exit, ..) =
        risorius(folder.path(), &["run", BEAM, "--set", "fit.frames={first=10,last=10}", "--out", "run"]);
    assert_eq!(exit, 0);
    let tables = folder.path().join("run/tables");
    let page = || {
        assert_eq!(risorius(folder.path(), &["report", "run"]).0, 0);
        let page = fs::read_to_string(folder.path().join("run/report.html")).unwrap();
        stands_alone(&page);
        page
    };
    // as it was written: the words of the summary
    let summary = fs::read_to_string(folder.path().join("run/summary.txt")).unwrap();
    let least = summary.lines().find(|line| line.contains("seen least over the clip: ")).unwrap();
    let least = least.split(": ").nth(1).unwrap().split(", to").next().unwrap();
    let well = page();
    for words in [
        "determined by the markers",
        &format!("every combination of controls; least {least}, to "),
        "twice what noise leaves",
    ] {
        assert!(well.contains(words), "`{words}` is not in the page");
    }
    assert!(!well.contains("told apart") && !well.contains("says more than"));

    // rows as other problems have them, under the headers of this run
    let replace = |name: &str, rows: &str| {
        let path = tables.join(name);
        let header = fs::read_to_string(&path).map_or_else(
            |_| "number,x_mm,y_mm,z_mm,gain,control,sd_before,sd_after".to_owned(),
            |text| text.lines().next().unwrap().to_owned(),
        );
        for row in rows.lines() {
            assert_eq!(row.split(',').count(), header.split(',').count(), "{name}: {header}");
        }
        fs::write(path, format!("{header}\n{rows}")).unwrap();
    };
    replace(
        "identifiability.csv",
        "10,0.3,top,0.01,0.2,0.0,0.7,free,,0.3,1,0.004,0\n10,0.3,bottom,0.0,,0.0,0.0004,lower,-0.02,0.3,0,,0\n",
    );
    replace("pairs.csv", "10,0.3,top,bottom,-0.97,0.5,0.012,0.001,0.2,0.1,1\n");
    replace(
        "combinations.csv",
        "10,0.3,0,9,0.1,1,1.00 top\n,,0,90,0.01,1,0.70 top + 0.70 bottom\n,,1,0.1,10,0,0.70 top - 0.70 bottom\n",
    );
    replace("unexplained.csv", "10,0.3,B01,0,0,1.2,1.2,0.1\n10,0.3,B02,0,0,0.1,0.1,0.1\n");
    replace("advice.csv", "1,10,20,5,0.5,top,0.2,0.05\n1,10,20,5,0.5,bottom,0.1,0.09\n");
    let badly = page();
    for words in [
        "<td>0.0000 to 0.7000</td><td>the markers say little; the mesh shifts it by 0.004</td>",
        "<td>0.0000 to 4.0e-4</td><td>on its lower bound; without it at -0.0200</td>",
        "<td>top, bottom</td><td>1</td><td>-0.97</td><td>top + 0.50 bottom = 0.0120 +/- 0.0020 in frame 10</td>",
        "says more than the markers",
        "no marker determines these",
        "<td>0.70 top - 0.70 bottom</td>",
        "<td>B01</td><td>1.2</td><td>0.1</td>",
        "<td>1</td><td>10.0, 20.0, 5.0</td><td>top</td><td>0.2000 to 0.0500</td>",
    ] {
        assert!(badly.contains(words), "`{words}` is not in the page");
    }
    assert!(!badly.contains("<td>B02</td><td>0.1</td>") && !badly.contains("every combination"));
}

#[test]
fn frames_that_failed_stand_first() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "run",
        BEAM,
        "--set",
        "fit.frames={first=0,last=10,step=10}",
        "--set",
        "fit.max_iterations=3",
        "--out",
        "run",
    ];
    let (exit, _, stderr) = risorius(folder.path(), &arguments);
    let status = fs::read_to_string(folder.path().join("run/status.json")).unwrap();
    assert!(exit == 4 && status.contains("\"partial\""), "the test needs one frame of each kind: {status} {stderr}");
    let page = fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    stands_alone(&page);
    let (first, glance) =
        (page.find("NOT CONVERGED: 1 of 2 frames").unwrap(), page.find("At a glance</h2>").unwrap());
    assert!(first < glance && page.contains("F002"));
}

#[test]
fn a_run_without_shapes_and_markers_has_a_page_too() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let slab = root.join("problems/slab/problem.toml").display().to_string();
    let coarse =
        ["--set", "controls.slab=0.01", "--set", "output.view=false", "--set", "mesh.block.elements=[3,1,1]"];
    let (exit, _, stderr) = risorius(folder.path(), &[&["run", &slab, "--out", "run"][..], &coarse].concat());
    assert_eq!(exit, 0, "{stderr}");
    let page = fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    stands_alone(&page);
    assert!(page.contains("Shapes for given activations; one frame, at") && !page.contains("viewer-data"));
    assert!(!page.contains("Left against right</h2>") && !page.contains("cannot tell</h2>"));
}

#[test]
fn fibres_and_studies_have_the_same_frame() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let fibres = root.join("problems/fibres/problem.toml").display().to_string();
    let (exit, _, stderr) = risorius(folder.path(), &["run", &fibres, "--out", "fibres"]);
    assert!(exit == 0 && stderr.contains("all on one page: fibres/report.html"), "{stderr}");
    let page = fs::read_to_string(folder.path().join("fibres/report.html")).unwrap();
    stands_alone(&page);
    assert!(page.contains("angular errors, degrees") && page.contains("<svg"));

    let slab = root.join("problems/slab/problem.toml").display().to_string();
    let study = format!(
        "[task]\nkind = \"study\"\n[study]\nproblem = \"{slab}\"\nset = {{ \"controls.slab\" = 0.01 }}\nmeasure = \"displacement\"\n\
         repetitions = 1\nreference = {{ set = {{ \"mesh.block.elements\" = [4, 1, 1] }} }}\n\
         [[study.vary]]\nkey = \"mesh.block.elements\"\nvalues = [[2, 1, 1], [3, 1, 1]]\n"
    );
    fs::write(folder.path().join("study.toml"), study).unwrap();
    let (exit, _, stderr) = risorius(folder.path(), &["run", "study.toml", "--out", "study"]);
    assert_eq!(exit, 0, "{stderr}");
    let page = fs::read_to_string(folder.path().join("study/report.html")).unwrap();
    stands_alone(&page);
    assert!(page.contains("<h2>Advice</h2>") && page.contains("<td>front</td>") && page.matches("<svg").count() >= 2);
    // a run in its place is not taken for a study
    let slab = ["run", &slab, "--set", "controls.slab=0.01", "--out", "study", "--force"];
    assert_eq!(risorius(folder.path(), &slab).0, 0);
    let page = fs::read_to_string(folder.path().join("study/report.html")).unwrap();
    assert!(page.contains("Shapes for given activations") && !folder.path().join("study/study.md").exists());
}
