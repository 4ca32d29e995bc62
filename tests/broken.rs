//! Is every mistake told with its code, its place, its numbers and its remedy?
//!
//! Every folder of `data/broken` but `recordings` holds a problem with a mistake, `<code>-<what>`, and `expected.txt`:
//! a line `error <code> at <file>:<line>:<column>` for each message, in order, and lines `says <words>`.

use assert_cmd::Command;
use risorius::Error;
use risorius::material::MooneyRivlin;
use risorius::material::fibre::Blemker;
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::location::Locator;
use risorius::model::supports::normal_axis;
use risorius::term::muscle::{Muscle, NotEmbedded};
use risorius::term::pressure;
use risorius::term::tissue::Tissue;
use std::path::{Path, PathBuf};

fn broken() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/broken")
}

/// Exit code, standard output and standard error of `risorius <arguments>` in a folder.
fn risorius(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("risorius").unwrap().current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// `error <code> at <file>:<line>:<column>` of every message, the file without its folder.
fn messages(stderr: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for line in stderr.lines() {
        if let Some(code) = line.strip_prefix("error[").and_then(|rest| rest.split(']').next()) {
            found.push(format!("error {code}"));
        } else if let (Some(place), Some(last)) = (line.trim_start().strip_prefix("--> "), found.last_mut()) {
            let place = place.rsplit(['/', '\\']).next().unwrap_or(place);
            last.push_str(&format!(" at {place}"));
        }
    }
    found
}

/// What is not as `expected.txt` has it.
fn differences(folder: &Path, name: &str) -> Vec<String> {
    let (exit, _, stderr) = risorius(folder, &["check", &format!("{name}/problem.toml"), "--color", "never"]);
    let expected = std::fs::read_to_string(folder.join(name).join("expected.txt")).unwrap();
    let errors: Vec<&str> = expected.lines().filter(|line| line.starts_with("error ")).collect();
    let words: Vec<&str> = expected.lines().filter_map(|line| line.strip_prefix("says ")).collect();
    let mut wrong = Vec::new();
    if exit != 3 {
        wrong.push(format!("{name}: exit {exit}, not 3"));
    }
    if messages(&stderr) != errors {
        wrong.push(format!("{name}: {:?}, expected {errors:?}", messages(&stderr)));
    }
    let code = &name[..4];
    if errors.is_empty() || (code != "C000" && errors.iter().any(|line| !line.contains(code))) || words.is_empty() {
        wrong.push(format!("{name}: expected.txt does not say what the name of the folder says"));
    }
    for missing in words.iter().filter(|words| !stderr.contains(**words)) {
        wrong.push(format!("{name}: `{missing}` is not said:\n{stderr}"));
    }
    wrong
}

#[test]
fn every_broken_problem_says_what_is_wrong_where_and_what_to_do() {
    let mut names: Vec<String> =
        std::fs::read_dir(broken()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|name| name != "recordings");
    names.sort();
    let wrong: Vec<String> = names.iter().flat_map(|name| differences(&broken(), name)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(names.len() >= 45, "only {} folders were found", names.len());
}

/// The problem that the broken fits are made from.
fn good_fit() -> String {
    let text = std::fs::read_to_string(broken().join("K001-metres-read-as-mm/problem.toml")).unwrap();
    text.replace("units = \"mm\"", "units = \"m\"")
        .replace("../recordings", &broken().join("recordings").display().to_string())
}

#[test]
fn a_folder_whose_problem_is_not_broken_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let name = "K001-metres-read-as-mm";
    std::fs::create_dir(folder.path().join(name)).unwrap();
    std::fs::copy(broken().join(name).join("expected.txt"), folder.path().join(name).join("expected.txt")).unwrap();
    std::fs::write(folder.path().join(name).join("problem.toml"), good_fit()).unwrap();
    let wrong = differences(folder.path(), name);
    assert!(wrong.iter().any(|line| line.contains("exit 0, not 3")), "{wrong:?}");
}

#[test]
fn lost_samples_are_counted_and_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("fit.toml"), good_fit().replace("good.mcap", "brow_nan.mcap")).unwrap();
    let (exit, stdout, stderr) = risorius(folder.path(), &["check", "fit.toml"]);
    assert_eq!(exit, 0, "{stderr}");
    assert!(stdout.contains("3 of 12 samples are missing: 3 not finite"), "{stdout}");
    let (exit, _, stderr) = risorius(folder.path(), &["run", "fit.toml", "--out", "run"]);
    assert_eq!(exit, 0, "{stderr}");
    let markers = std::fs::read_to_string(folder.path().join("run/tables/markers.csv")).unwrap();
    assert!(
        !markers.contains("NaN") && markers.lines().any(|line| line.contains("brow") && line.contains(",,")),
        "{markers}"
    );
}

#[test]
fn the_intact_part_of_a_recording_is_used_when_asked_for_and_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    for (file, key) in [("cut_short.mcap", "allow_truncated"), ("without_checksums.mcap", "allow_unchecked")] {
        let text =
            good_fit().replace("good.mcap", file).replace("units = \"m\"", &format!("units = \"m\"\n{key} = true"));
        std::fs::write(folder.path().join("fit.toml"), text).unwrap();
        let (exit, stdout, stderr) = risorius(folder.path(), &["check", "fit.toml"]);
        assert_eq!(exit, 0, "{stderr}");
        assert!(stderr.contains("warn[M020]") && stderr.contains("help:"), "{stderr}");
        assert!(stdout.contains("3 of 3 frames used"), "{stdout}");
    }
}

#[test]
fn mistakes_of_geometry_and_of_markers_are_told_together() {
    let folder = tempfile::tempdir().unwrap();
    let text = good_fit().replace("origin_mm = [4, 2, 6]", "origin_mm = [4, 2, 8]").replace("\"brow\"", "\"nose\"");
    let text = text.replace("units = \"m\"", "units = \"m\"\nframes = { last = 3 }");
    std::fs::write(folder.path().join("fit.toml"), text).unwrap();
    let (exit, _, stderr) = risorius(folder.path(), &["check", "fit.toml"]);
    assert_eq!(exit, 3);
    let codes: Vec<String> = messages(&stderr).iter().map(|message| message[6..10].to_owned()).collect();
    assert_eq!(codes, ["G002", "K004", "K002"], "{stderr}");
    assert!(stderr.contains("3 mistakes, nothing was run"), "{stderr}");
}

#[test]
fn what_cannot_be_read_is_an_error_of_input_and_output() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("problem.toml")).unwrap();
    for file in ["problem.toml", "missing.toml"] {
        let (exit, _, stderr) = risorius(folder.path(), &["check", file]);
        assert_eq!(exit, 6, "{stderr}");
        assert!(stderr.contains("error[O001]") && stderr.contains(file) && stderr.contains("help:"), "{stderr}");
    }
}

// What no problem file of today can ask for: a mesh that is turned inside out.

/// A block whose nodes are mirrored in x.
fn inside_out(mut mesh: Mesh) -> Mesh {
    for parameter in &mut mesh.parameters {
        parameter[0] = -parameter[0];
    }
    mesh
}

const LAW: MooneyRivlin = MooneyRivlin { c1: 0.5, c2: 0.2 };

#[test]
fn an_inverted_host_is_refused_with_its_element_and_determinant() {
    let good = || block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [2, 1, 1]);
    assert!(Tissue::new(&good(), LAW, 0.0, &pressure::Trilinear, 3).is_ok());
    let Err(inverted) = Tissue::new(&inside_out(good()), LAW, 0.0, &pressure::Trilinear, 3) else {
        panic!("an inverted mesh was accepted")
    };
    assert_eq!(inverted.element, 0);
    // dX/dxi = diag(-20, 10, 10) mm
    assert!((inverted.det + 2000.0).abs() < 1e-9, "{}", inverted.det);
    // one element alone: the far end is pushed through its neighbour
    let mut folded = good();
    for parameter in folded.parameters.iter_mut().filter(|p| p[0] == 40.0) {
        parameter[0] = 5.0;
    }
    let Err(inverted) = Tissue::new(&folded, LAW, 0.0, &pressure::Trilinear, 3) else {
        panic!("a folded mesh was accepted")
    };
    assert_eq!(inverted.element, 1);
    assert!(inverted.det < 0.0);
}

#[test]
fn an_inverted_muscle_is_refused_with_its_element_and_determinant() {
    let host = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [2, 1, 1]);
    let mut mesh = block(&Trilinear, [4.0, 2.0, 6.0], [30.0, 6.0, 3.0], [4, 2, 1]);
    let end = mesh.parameters.iter().map(|p| p[0]).fold(0.0, f64::max);
    for parameter in mesh.parameters.iter_mut().filter(|p| p[0] == end) {
        parameter[0] = 20.0;
    }
    let angles = FibreAngles::uniform(&mesh, [0.0; 3]);
    let law = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };
    let locator = Locator::new(&host);
    match Muscle::new("slab", &locator, &mesh, &angles, 3, law, 0) {
        // from x = 26.5 to x = 20: dX/deta = diag(-6.5, 3, 3) mm
        Err(NotEmbedded::Inverted { element: 3, det }) => assert!((det + 58.5).abs() < 1e-9, "{det}"),
        Err(other) => panic!("{other:?}"),
        Ok(_) => panic!("an inverted muscle was accepted"),
    }
}

#[test]
fn a_symmetry_plane_must_be_normal_to_an_axis() {
    let mut mesh = block(&TricubicHermite, [0.0; 3], [40.0, 10.0, 10.0], [2, 1, 1]);
    let faces = mesh.named_faces["xi2=0"].clone();
    assert_eq!(normal_axis(&mesh, &faces), Some(1));
    // sheared: y grows with x
    for parameter in &mut mesh.parameters {
        parameter[1] += 0.1 * parameter[0];
    }
    assert_eq!(normal_axis(&mesh, &faces), None);
}

#[test]
fn an_error_of_a_named_file_keeps_its_code_help_and_exit_code() {
    let text = std::fs::read_to_string(broken().join("M006-several-topics/problem.toml")).unwrap();
    let scene = risorius::scene::Scene::parse(&text, "problem.toml", &broken().join("x"), &[]).unwrap();
    let place = scene.fit.unwrap().markers_place;
    let inner = || Error::EmptyTopic { path: "a.mcap".into(), topic: "/markers".into() };
    let named = Error::Named(Box::new((inner(), place.clone())));
    assert_eq!(
        (named.code(), named.help(), named.exit_code()),
        (inner().code(), inner().help(), inner().exit_code())
    );
    assert_eq!(named.to_string(), inner().to_string());
    assert_eq!(named.place(), Some(&place));
    assert_eq!(place.line, 15);
}
