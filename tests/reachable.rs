//! Is every code that has a page given by something that a test does? Here are those that no other test comes upon, and the count.

use crate::common;
use crate::common::Random;
use crate::common::twin::{MARKERS, MUSCLES, normal, problem, record};
use assert_cmd::Command;
use risorius::error::explain::pages;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Codes that no small problem brings about, and why.
const NOT_HERE: [(&str, &str); 5] = [
    ("F001", "Clarabel fails on a program of a few bounded unknowns"),
    ("F004", "argmin ends for a reason of its own"),
    ("F010", "a positive smoothness makes the equations of fibre angles positive definite"),
    ("O009", "a table is damaged between the end of a run and its page"),
    ("S011", "a factor larger than the memory of the machine"),
];
/// Codes of the library, which tests take as variants of the error: `tests/recordings.rs` and `tests/linear_algebra.rs`.
const OF_THE_LIBRARY: [(&str, &str); 4] = [
    ("M013", "Error::FrameShape"),
    ("S001", "Error::NotFinite"),
    ("S010", "Error::Singular"),
    ("S012", "Error::NotFactored"),
];

/// Every text below a folder.
fn texts(folder: &Path, found: &mut String) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            texts(&path, found);
        } else if path.extension().is_some_and(|end| end == "rs" || end == "txt") && !path.ends_with("explain.rs") {
            *found += &fs::read_to_string(&path).expect("text");
        }
    }
}

#[test]
fn every_code_is_reached_by_a_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = String::new();
    texts(&root.join("tests"), &mut all);
    texts(&root.join("data/broken"), &mut all);
    let lists = format!("{NOT_HERE:?}{OF_THE_LIBRARY:?}");
    let named = |code: &str| all.matches(code).count() - lists.matches(code).count();
    let unreached: BTreeSet<&str> = pages().map(|page| page.code).filter(|code| named(code) == 0).collect();
    let known: BTreeSet<&str> = NOT_HERE.iter().chain(&OF_THE_LIBRARY).map(|(code, _)| *code).collect();
    assert_eq!(unreached, known, "codes without a test; codes that have one need no excuse");
    for (code, variant) in OF_THE_LIBRARY {
        assert!(all.matches(variant).count() > 1, "{code}: no test meets {variant}");
    }
}

/// Exit code and standard error of `risorius <arguments>` in a folder.
fn risorius(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let output = Command::cargo_bin("risorius").expect("built").current_dir(folder).args(arguments).output();
    let output = output.expect("it runs");
    (output.status.code().expect("an end"), String::from_utf8(output.stderr).expect("text"))
}

/// A forward problem, in the place of the fit of a twin.
fn forward(text: &str) -> String {
    let end = text.find("[[marker]]").expect("markers");
    text[..end].replace("kind = \"fit\"", "kind = \"forward\"")
}

#[test]
fn a_problem_without_markers_is_not_advised_on_and_not_matched() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("beam.toml"), forward(&problem(&MUSCLES[..1], &MARKERS, ""))).expect("written");
    let (exit, stderr) = risorius(folder.path(), &["advise", "beam.toml"]);
    assert!(exit == 3 && stderr.contains("error[C024]"), "{stderr}");
    let (exit, stderr) = risorius(folder.path(), &["markers", "match", "beam.toml"]);
    assert!(exit == 3 && stderr.contains("error[K017]"), "{stderr}");
}

/// Four markers on the corners of a rectangle lie on themselves in more than one way.
#[test]
fn labels_that_could_be_matched_otherwise_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let even = [("A", [20.0, 5.0, 10.0]), ("B", [20.0, 5.0, 0.0]), ("C", [40.0, 5.0, 10.0]), ("D", [40.0, 5.0, 0.0])];
    let text = problem(&MUSCLES[..1], &even, "");
    record(&folder.path().join("clip.mcap"), &text, &[vec![0.0]], 0.0, 1);
    fs::write(folder.path().join("twin.toml"), text).expect("written");
    let (exit, stderr) = risorius(folder.path(), &["markers", "match", "twin.toml"]);
    assert!(exit == 0 && stderr.contains("warn[K016]"), "{stderr}");
}

/// A multiplier on a penalty that is far softer than the body.
#[test]
fn a_gap_that_multipliers_do_not_close_is_not_accepted() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = forward(&problem(&[("top", [3.0, 3.5, 6.5])], &MARKERS, ""))
        + "[[sliding]]\nface = \"xi3=0\"\nsurface = { reference = true }\n\
           law = { augmented = { kpa_per_mm = 1e-4, gap_mm = 1e-6 } }\n[controls]\ntop = 0.005\n";
    fs::write(folder.path().join("soft.toml"), text).expect("written");
    let (exit, stderr) = risorius(folder.path(), &["run", "soft.toml", "--out", "run"]);
    assert!(exit == 4 && stderr.contains("error[S006]"), "{stderr}");
}

/// A column that is pressed beyond Euler's load, pi^2 E I / (4 l^2) = 5 mN, stands straight in a fit, which lets no body snap.
#[test]
fn a_fit_that_ends_on_a_saddle_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let middle = [("middle", [3.0, 3.5, 3.75])];
    let text = problem(&middle, &MARKERS, "sd_mm = 0.5\n");
    record(&folder.path().join("clip.mcap"), &text, &[vec![0.0]], 0.0, 1);
    let pressed =
        text.replace("[[support]]", "[[load]]\ntraction = { face = \"xi1=1\", kpa = [-0.1, 0, 0] }\n[[support]]");
    fs::write(folder.path().join("column.toml"), pressed).expect("written");
    let (exit, stderr) = risorius(folder.path(), &["run", "column.toml", "--out", "run"]);
    assert!(exit == 0 && stderr.contains("warn[S005]") && stderr.contains("negative modes"), "{stderr}");
}

/// A frame in which no marker is seen, in a clip that is smoothed.
#[test]
fn a_bridged_frame_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let extra = "sd_mm = 0.3\nsmoothness = { sd_per_root_s = 0.03 }\nclip = \"smoother\"\nmax_iterations = 6\n";
    let text = problem(&MUSCLES[..2], &MARKERS, extra);
    let truth: Vec<Vec<f64>> = (0..5).map(|k| vec![0.004 * f64::from(k), 0.002 * f64::from(k)]).collect();
    let clip = folder.path().join("clip.mcap");
    record(&clip, &text, &truth, 0.1, 4);
    let mut seen = common::twin::recording(&clip);
    seen.frames[3].positions_mm.fill(None);
    let units = risorius::markers::WriteOptions { units: risorius::scene::Units::M, ..Default::default() };
    risorius::markers::write_json(&clip, &seen.labels, &seen.frames, &units).expect("written");
    fs::write(folder.path().join("twin.toml"), text).expect("written");
    let (exit, stderr) = risorius(folder.path(), &["run", "twin.toml", "--out", "run"]);
    assert!(exit == 4 && stderr.contains("warn[F012]: frame 3 failed and is bridged"), "{stderr}");
}

/// One step is not enough for a muscle whose fibres run 25 degrees off.
#[test]
fn what_all_frames_share_is_not_taken_from_an_unfinished_search() {
    let folder = tempfile::tempdir().expect("a folder");
    let outer = "sd_mm = 0.1\n[fit.outer]\nframes = [1, 2]\nmax_iterations = 1\n\
                 [[fit.outer.unknown]]\nfibre_angle = \"top.L\"\nmode = \"constant\"\n";
    let turned = problem(&MUSCLES[..1], &MARKERS, "").replace("[0, 0, 0]\nblemker", "[25, 0, 0]\nblemker");
    record(&folder.path().join("clip.mcap"), &turned, &[vec![0.0], vec![0.01], vec![0.02]], 0.0, 1);
    fs::write(folder.path().join("twin.toml"), problem(&MUSCLES[..1], &MARKERS, outer)).expect("written");
    let (exit, stderr) = risorius(folder.path(), &["run", "twin.toml", "--out", "run"]);
    assert!(exit == 4 && stderr.contains("error[F014]"), "{stderr}");
}

/// Directions without any order: a robust loss finds no rest, fibres run through poles, and one axis lies beside the mesh.
#[test]
fn directions_without_order_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[task]\nkind = \"fibres\"\n[[muscle]]\nname = \"slab\"\n\
                block = { origin_mm = [0, 0, 0], size_mm = [20, 10, 4], elements = [3, 2, 1] }\nfibre_angles_deg = [0, 0, 0]\n\
                blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }\n\
                [fibres]\nmuscle = \"slab\"\nsmoothness = 1e-6\nloss = { cauchy_deg = 0.2 }\n\
                [[fibres.data]]\nfile = \"axes.csv\"\nunits = \"mm\"\n";
    fs::write(folder.path().join("fibres.toml"), text).expect("written");
    let mut told = String::new();
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let mut table = "x,y,z,vx,vy,vz\n25,5,2,1,0,0\n".to_owned();
        for k in 0..200 {
            let (x, y, z) =
                (0.5 + f64::from(k % 10) * 2.0, 0.5 + f64::from(k / 10 % 5) * 2.0, 0.5 + f64::from(k / 50));
            let [u, v, w] = [0; 3].map(|_| normal(&mut random));
            table += &format!("{x},{y},{z},{u},{v},{w}\n");
        }
        fs::write(folder.path().join("axes.csv"), table).expect("written");
        let (exit, stderr) = risorius(folder.path(), &["run", "fibres.toml", "--out", "run", "--force"]);
        assert!(exit == 0 && stderr.contains("warn[K006]: 1 measured axes"), "{stderr}");
        told += &stderr;
    }
    assert!(told.contains("warn[F006]") && told.contains("warn[F008]"), "{told}");
}
