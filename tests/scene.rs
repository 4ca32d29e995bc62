//! Does a problem file mean what it says, and is every mistake in it told with its place and remedy?

use proptest::prelude::*;
use risorius::cli::diagnostics::{render_error, render_warning};
use risorius::scene::{
    ActivationSpec, BlockSpec, ChunksSpec, ControlRange, ControlValue, Curves, FaceName, FaceSpec, FibresSpec,
    FramesSpec, GeometrySpec, LawSpec, LoadKind, PartSpec, RegisterSpec, Scene, SupportKind, SurfaceSpec, Task,
    TieSpec, Units,
};
use risorius::{Error, Result};
use std::path::Path;

/// Every table and nearly every key there is.
const WHOLE: &str = r#"
[task]
kind = "fit"

[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }

[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
pressure = "trilinear"
kappa_kpa = 10.0
gauss = 5

[[muscle]]
name = "slab"
block = { origin_mm = [4.5, 2.0, 14.2], size_mm = [50, 16, 4], elements = [5, 2, 1] }
fibre_angles_deg = [36, 0, 0]
gauss = 3
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }

[[muscle]]
name = "risorius.L"
block = { origin_mm = [4.5, 2.0, 4], size_mm = [50, 16, 4], elements = [1, 1, 1] }
fibre_angles_nodes_deg = [[1,0,0], [2,0,0], [3,0,0], [4,0,0], [5,0,0], [6,0,0], [7,0,0], [8,0,0.5]]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }

[[support]]
clamp = { face = "xi1=0" }
[[support]]
symmetry = { face = "xi2=0" }
[[support]]
rotate = { face = "xi1=1", axis = [1, 0, 0], through_mm = [0, 5, 5], angle_deg = 90 }

[[load]]
traction = { face = "xi1=1", kpa = [0, 0, -0.04] }
[[load]]
gravity = { density_kg_m3 = 1040, acceleration_m_s2 = [0, 0, -9.81] }

[controls]
risorius.L = 0.05

[[probe]]
name = "tip"
position_mm = [60, 20, 20]

[fit]
markers = "smile.mcap"
units = "m"
topic = "/markers"
sensitivity = "finite-difference"
unknowns = ["slab"]
frames = { last = 9 }
register = "rigid"
neutral = 3
axes = ["-x", "z", "y"]

[[marker]]
name = "M01"
label = "marker 1"
position_mm = [30, 10, 20]

[solver]
tolerance = 1e-8
step_min = 1e-3
"#;

fn parse(text: &str, overrides: &[&str]) -> Result<Scene> {
    let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
    Scene::parse(text, "smile/problem.toml", Path::new("smile"), &overrides)
}

/// Everything in a scene but places, exact to the last bit.
fn content(scene: &Scene) -> String {
    serde_json::to_string(scene).unwrap()
}

/// The block of the host.
fn block(scene: &Scene) -> &BlockSpec {
    let GeometrySpec::Block(block) = &scene.mesh.geometry else { panic!("the host is a block") };
    block
}

#[test]
fn a_whole_file_means_what_it_says() {
    let scene = parse(WHOLE, &[]).unwrap();
    assert_eq!((scene.name.as_str(), scene.task), ("smile", Task::Fit));
    let block = block(&scene);
    assert_eq!((block.size_mm, block.elements), ([60.0, 20.0, 20.0], [6, 2, 2]));
    assert_eq!(scene.tissue.law, LawSpec::MooneyRivlin { c1_kpa: 0.5, c2_kpa: 0.2 });
    assert_eq!((scene.tissue.kappa_kpa, scene.tissue.gauss), (10.0, 5));
    assert_eq!(scene.muscles[0].fibres, FibresSpec::Uniform([36.0, 0.0, 0.0]));
    assert!(matches!(&scene.muscles[1].fibres, FibresSpec::Nodes(nodes) if nodes[7] == [8.0, 0.0, 0.5]));
    assert_eq!(scene.muscles[1].place.line, 21);
    let face = FaceSpec(vec![FaceName::Side { direction: 0, end: 1 }]);
    assert!(matches!(&scene.supports[2].kind, SupportKind::Rotate { face: f, angle_deg: 90.0, .. } if *f == face));
    assert!(matches!(scene.loads[0].kind, LoadKind::Traction { kpa: [0.0, 0.0, -0.04], .. }));
    assert_eq!(scene.controls[0].name, "risorius.L");
    assert_eq!(scene.controls[0].value, ControlValue::Constant(0.05));
    assert_eq!((scene.controls[0].place.column, scene.controls[0].place.length), (1, 10));
    let fit = scene.fit.as_ref().unwrap();
    assert_eq!(
        (fit.units, fit.unknowns.as_slice(), fit.frames.last),
        (Some(Units::M), &["slab".to_string()][..], Some(9))
    );
    assert_eq!(
        (fit.registration.register, fit.registration.neutral),
        (RegisterSpec::Rigid, Some(FramesSpec::one(3)))
    );
    assert_eq!(fit.registration.axes.map(|axis| axis.word()), ["-x", "z", "y"]);
    assert_eq!((scene.markers[0].name.as_str(), scene.markers[0].label.as_str()), ("M01", "marker 1"));
    assert!(fit.markers.is_absolute() && fit.markers.ends_with("smile/smile.mcap"));
    assert_eq!((scene.solver.step_min, scene.solver.step_max), (1e-3, 1.0));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn numerics_have_defaults() {
    let start = WHOLE.find("[task]").unwrap();
    let end = WHOLE.find("pressure").unwrap();
    let scene = parse(&WHOLE[start..end].replace("\"fit\"", "\"forward\""), &[]).unwrap();
    assert_eq!((scene.tissue.kappa_kpa, scene.tissue.gauss), (10.0, 5));
    assert_eq!((scene.solver.tolerance, scene.solver.max_iterations), (1e-8, 30));
    assert!(scene.muscles.is_empty() && scene.fit.is_none() && scene.output.view);
    // Nothing holds this body.
    assert_eq!(scene.warnings.iter().map(|warning| warning.code).collect::<Vec<_>>(), ["C016"]);
    assert!(render_warning(&scene.warnings[0], false).starts_with("warn[C016]: nothing holds the body"));
}

fn line_of(text: &str, offset: usize) -> usize {
    text[..offset].matches('\n').count() + 1
}

/// The line of the whole file that holds `words`.
fn line_with(words: &str) -> u32 {
    line_of(WHOLE, WHOLE.find(words).unwrap()) as u32
}

/// Replaces `from` by `to` in the whole file and expects one mistake, at the text `at`.
fn expect(from: &str, to: &str, code: &str, at: &str, told: &str) {
    assert!(WHOLE.contains(from), "{from}");
    let text = WHOLE.replacen(from, to, 1);
    let error = parse(&text, &[]).expect_err(to);
    let rendered = render_error(&error, false);
    assert_eq!(error.mistakes().len(), 1, "{rendered}");
    assert_eq!((error.code(), error.exit_code()), (code, 3), "{rendered}");
    let place = error.place().expect("a place");
    let edited = WHOLE.find(from).unwrap();
    let offset = text[..edited].rfind('\n').unwrap() + 1;
    // The nearest one after the edit, or else the last one before it (the header of the table).
    let after = text[offset..].find(at).map(|found| offset + found);
    let offset = after.or(text.rfind(at)).unwrap_or_else(|| panic!("{at} is not in the file"));
    let line = line_of(&text, offset);
    let column = text[..offset].chars().rev().take_while(|c| *c != '\n').count() + 1;
    assert_eq!((place.line as usize, place.column as usize), (line, column), "{rendered}");
    assert!(rendered.contains(&format!("smile/problem.toml:{line}:{column}")), "{rendered}");
    assert!(rendered.contains(told), "`{told}` is not told:\n{rendered}");
}

#[test]
fn each_kind_of_mistake_is_told_with_its_place_and_remedy() {
    // C001 syntax
    expect("kind = \"fit\"", "kind = fit", "C001", "fit", "write text in quotes");
    expect("gauss = 5", "gauss = 5\ngauss = 4", "C001", "gauss = 4", "keep one of the two");
    expect("kind = \"fit\"", "kind = \"fit", "C001", "\n\n[mesh]", "the quote that ends the text is missing");
    // C002 unknown key
    expect("c1_kpa", "c1", "C002", "c1", "did you mean `c1_kpa`? (the unit is part of the key: a number in kPa)");
    expect("c1_kpa", "c1_pa", "C002", "c1_pa", "did you mean `c1_kpa`?");
    expect("[solver]", "[solvers]", "C002", "solvers", "did you mean `solver`?");
    expect("clamp = { face", "clampp = { face", "C002", "clampp", "did you mean `clamp`?");
    expect("kappa_kpa = 10.0", "color = 1", "C002", "color", "it can hold: mooney-rivlin");
    expect("gauss = 5", "gaus = 4\ngauss = 5", "C002", "gaus", "`gauss`? it is there already");
    // C003 missing key
    expect("c1_kpa = 0.5, ", "", "C003", "{ c2_kpa", "c1_kpa = 0.5");
    expect("units = \"m\"\n", "", "C003", "[fit]", "units = \"m\"");
    expect(
        "fibre_angles_deg = [36, 0, 0]",
        "",
        "C003",
        "[[muscle]]\nname = \"slab\"",
        "fibre_angles_deg = [36, 0, 0]",
    );
    // C004 wrong type
    expect("kappa_kpa = 10.0", "kappa_kpa = \"10\"", "C004", "\"10\"", "write the number without quotes");
    expect("topic = \"/markers\"", "topic = 7", "C004", "7", "write it in quotes");
    expect("[[probe]]", "[probe]", "C004", "[probe]", "[[probe]]");
    expect("gauss = 5", "gauss = true", "C004", "true", "a whole number");
    expect("gauss = 3", "cut = 1", "C004", "1\nblemker", "true or false");
    // C005 out of range
    expect("gauss = 3", "taper_mm = 0", "C005", "0\nblemker", "= 0 mm is not allowed: it must be greater than 0");
    expect("kappa_kpa = 10.0", "kappa_kpa = -1", "C005", "-1", "= -1 kPa is not allowed: it must be 0 or more");
    expect("kappa_kpa = 10.0", "kappa_kpa = nan", "C005", "nan", "a finite number");
    expect("kappa_kpa = 10.0", "kappa_kpa = 1e999", "C005", "1e999", "a finite number");
    expect("gauss = 5", "gauss = 9", "C005", "9", "a whole number from 3 to 8");
    expect("gauss = 5", "gauss = 5.5", "C005", "5.5", "a whole number from 3 to 8");
    expect("size_mm = [60, 20, 20]", "size_mm = [60, 0, 20]", "C005", "0, 20], el", "greater than 0");
    expect(
        "c1_kpa = 0.5, c2_kpa = 0.2",
        "c1_kpa = 0, c2_kpa = 0",
        "C005",
        "0, c2",
        "greater than 0 where c2_kpa is 0",
    );
    expect("lambda_star = 1.4", "lambda_star = 0.9", "C005", "0.9", "greater than lambda_ofl = 1.0");
    expect("axis = [1, 0, 0]", "axis = [0, 0, 0]", "C005", "[0, 0, 0]", "a direction, not all 0");
    expect("risorius.L = 0.05", "risorius.L = 1.05", "C005", "1.05", "from 0 to 1");
    expect(
        "step_min = 1e-3",
        "step_max = 1e-5",
        "C005",
        "1e-5",
        "step_min` = 0.0001 is not allowed: it must be at most step_max",
    );
    expect("last = 9", "first = 10, last = 9", "C005", "9", "at least first = 10");
    expect("name = \"tip\"", "name = \"\"", "C005", "\"\"", "a name");
    expect("units = \"m\"", "units = \"estimate\"", "C005", "\"estimate\"", "register is not \"similarity\"");
    expect("\"-x\", \"z\"", "\"-y\", \"z\"", "C005", "[\"-y\"", "each of x, y, z once");
    let bones = "neutral = 3\nhead = { bone_markers = [\"a\", \"b\", \"a\"] }";
    expect("neutral = 3", bones, "C007", "[\"a\", \"b\"", "at least 3, which do not lie on a line");
    expect(
        "neutral = 3",
        "neutral = 3\nhead = { estimate = false }",
        "C005",
        "false",
        "without the table the head does not move",
    );
    expect("neutral = 3", "neutral = 3\nhead = {}", "C011", "{}", "add the one you mean");
    expect("neutral = 3", "neutral = -3", "C005", "-3", "a whole number from 0");
    expect("neutral = 3", "neutral = { first = 4, last = 3 }", "C005", "3 }", "at least first = 4");
    expect("neutral = 3", "neutral = \"last\"", "C006", "\"last\"", "it can be \"first\"");
    // C006 unknown choice
    expect(
        "kind = \"fit\"",
        "kind = \"fitt\"",
        "C006",
        "\"fitt\"",
        "did you mean \"fit\"? it can be \"forward\", \"fit\"",
    );
    expect("face = \"xi2=0\"", "face = \"top\"", "C006", "\"top\"", "it can be \"xi1=0\", \"xi1=1\"");
    // C007 wrong length
    expect("position_mm = [30, 10, 20]", "position_mm = [30, 10]", "C007", "[30, 10]", "has 2 entries, but needs 3");
    expect(", [8,0,0.5]]", "]", "C007", "[[1,0,0]", "angles for 7 nodes, but needs 8");
    expect("unknowns = [\"slab\"]", "unknowns = []", "C007", "[]", "at least one muscle");
    // C008 duplicate name
    let second = "[[probe]]\nname = \"tip\"\nposition_mm = [0, 0, 0]\n[fit]";
    expect(
        "[fit]",
        second,
        "C008",
        "\"tip\"",
        &format!("a second probe is called `tip`: the first is in line {}", line_with("\"tip\"")),
    );
    expect("unknowns = [\"slab\"]", "unknowns = [\"slab\",\"slab\"]", "C008", "\"slab\"]", "a second unknown");
    // C009 unknown name
    expect("unknowns = [\"slab\"]", "unknowns = [\"slap\"]", "C009", "\"slap\"", "did you mean `slab`?");
    expect("risorius.L = 0.05", "masseter = 0.05", "C009", "masseter", "muscles: slab, risorius.L");
    expect("risorius.L = 0.05", "risorius.l = 0.05", "C009", "risorius.l", "did you mean `risorius.L`?");
    // C010 not in this version
    expect("\"trilinear\"", "\"constant\"", "C010", "\"constant\"", "one pressure per element");
    // C011 not exactly one
    let both = "clamp = { face = \"xi1=0\" }\nsymmetry = { face = \"xi1=0\" }";
    expect(
        "[[support]]\nclamp = { face = \"xi1=0\" }",
        &format!("[[support]]\n{both}"),
        "C011",
        "[[support]]",
        "`clamp`, `symmetry`",
    );
    expect(
        "\ngravity = { density_kg_m3 = 1040, acceleration_m_s2 = [0, 0, -9.81] }",
        "",
        "C011",
        "[[load]]",
        "holds none",
    );
}

#[test]
fn no_mistake_hides_another() {
    let text = WHOLE
        .replace("gauss = 5", "gauss = 50")
        .replace("lambda_star = 1.4", "lambda_star = \"x\"")
        .replace("xi2=0", "xi2=3")
        .replace("[solver]", "[solver]\nstep = 1");
    let error = parse(&text, &["solver.tolerance=0", "nonsense"]).unwrap_err();
    let told: Vec<_> = error.mistakes().iter().map(|m| (m.code(), m.place().unwrap().line)).collect();
    let expected = [
        ("C005", 12),
        ("C004", 19),
        ("C004", 25),
        ("C006", 30),
        ("C002", line_with("[solver]") + 1),
        ("C005", 1),
        ("C013", 2),
    ];
    assert_eq!(told, expected);
    let rendered = render_error(&error, false);
    assert!(rendered.ends_with("error: 7 mistakes, nothing was run\n"), "{rendered}");
    assert!(!rendered.contains('\u{1b}') && render_error(&error, true).contains('\u{1b}'));
}

#[test]
fn an_empty_file_is_told_what_to_hold() {
    let error = parse("", &[]).unwrap_err();
    assert_eq!(error.to_string(), "the problem file lacks `task`, `mesh`, `tissue`");
    assert!(error.help().unwrap().contains("[tissue]\nmooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }"));
}

#[test]
fn tables_the_task_does_not_use_are_warned_of() {
    let scene = parse(WHOLE, &["task.kind=forward"]).unwrap();
    let told: Vec<_> = scene.warnings.iter().map(|w| (w.code, w.place.as_ref().unwrap().line)).collect();
    assert_eq!(told, [("C015", line_with("[fit]")), ("C015", line_with("[[marker]]"))]);
    let scene = parse(WHOLE, &["controls.slab=0.1"]).unwrap();
    assert!(scene.warnings[0].message.contains("the value of the control `slab` is not used by the task \"fit\""));
}

#[test]
fn a_fit_under_a_pressure_is_warned_that_its_sensitivities_are_approximate() {
    let text = WHOLE.replace(
        "traction = { face = \"xi1=1\", kpa = [0, 0, -0.04] }",
        "pressure = { face = \"xi1=1\", kpa = 0.04 }",
    );
    let codes =
        |overrides: &[&str]| -> Vec<_> { parse(&text, overrides).unwrap().warnings.iter().map(|w| w.code).collect() };
    assert_eq!(codes(&["fit.sensitivity=tangent"]), ["C020"]);
    assert!(codes(&[]).is_empty());
}

#[test]
fn a_field_of_activations_has_a_value_for_every_node() {
    let field = WHOLE.replace("name = \"risorius.L\"", "name = \"risorius.L\"\nactivation = \"field\"");
    let scene = parse(&field, &[]).unwrap();
    assert_eq!(scene.muscles[1].activation, ActivationSpec::Field);
    assert_eq!(scene.controls[0].value.constants(8), Some(vec![0.05; 8]));
    let list = "controls.risorius.L=[0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]";
    let scene = parse(&field, &[list]).unwrap();
    assert_eq!(scene.controls[0].value, ControlValue::Nodes(vec![0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]));
    let again = parse(&scene.lock(), &[]).unwrap();
    assert_eq!((content(&scene), scene.lock()), (content(&again), again.lock()));
    for (text, set, code, told) in [
        (field.as_str(), "controls.risorius.L=[0.1, 0.2]", "C007", "activations for 2 nodes, but needs 8"),
        (&field, "controls.risorius.L=[0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 1.7]", "C005", "from 0 to 1"),
        (WHOLE, list, "C004", "a number"),
        (WHOLE, "muscle.slab.activation=nodes", "C006", "it can be \"uniform\", \"field\""),
    ] {
        let error = parse(text, &[set]).expect_err(set);
        let rendered = render_error(&error, false);
        assert_eq!((error.mistakes().len(), error.code()), (1, code), "{rendered}");
        assert!(rendered.contains(told), "{told} is not told:\n{rendered}");
    }
}

#[test]
fn overrides_are_merged_before_anything_is_checked() {
    let set = |overrides: &[&str]| parse(WHOLE, overrides).unwrap();
    assert_eq!(set(&["solver.step_max=0.02"]).solver.step_max, 0.02);
    assert_eq!(set(&["tissue.kappa_kpa=0"]).tissue.kappa_kpa, 0.0);
    assert_eq!(set(&["muscle.slab.gauss=4"]).muscles[0].gauss, 4);
    assert_eq!(set(&["muscle[1].gauss=4"]).muscles[1].gauss, 4);
    assert_eq!(set(&["muscle.risorius.L.gauss=5"]).muscles[1].gauss, 5);
    assert_eq!(set(&["muscle.\"risorius.L\".gauss=6"]).muscles[1].gauss, 6);
    let muscle = &set(&["muscle.slab.cut=true", "muscle.slab.taper_mm=2.5"]).muscles[0];
    assert_eq!((muscle.cut, muscle.taper_mm), (true, Some(2.5)));
    assert_eq!(set(&["controls.risorius.L=0.5"]).controls[0].value, ControlValue::Constant(0.5));
    assert_eq!(set(&["controls.\"risorius.L\" = 0.5"]).controls.len(), 1);
    assert_eq!(set(&["controls.slab=0.1"]).controls[1].name, "slab");
    assert_eq!(block(&set(&["mesh.block.elements[0]=12"])).elements, [12, 2, 2]);
    assert_eq!(block(&set(&["mesh.block.elements=[3,1,1]"])).elements, [3, 1, 1]);
    assert_eq!(set(&["fit.units=mm"]).fit.unwrap().units, Some(Units::Mm));
    assert_eq!(set(&["output.every=2", "output.every=3"]).output.every, 3);
    assert!(set(&["output.estimate=true"]).output.estimate && !set(&[]).output.estimate);
    // A value of the command line may mend the file.
    assert_eq!(parse(&WHOLE.replace("gauss = 5", "gauss = 0"), &["tissue.gauss=4"]).unwrap().tissue.gauss, 4);
}

#[test]
fn mistakes_in_overrides_point_at_the_command_line() {
    for (argument, code, column, help) in [
        ("solver.step_mx=2", "C002", 14, "did you mean `step_max`?"),
        ("tissue.kappa_kpa=-1", "C005", 24, ""),
        ("muscle.slap.gauss=3", "C013", 14, "did you mean `slab`?"),
        ("muscle[7].gauss=3", "C013", 13, "counted from 0"),
        ("muscle[x].gauss=3", "C013", 13, "muscle[0]"),
        ("tissue.gauss.x=3", "C013", 20, "--set tissue.gauss=..."),
        ("tissue..gauss=3", "C013", 14, "--set solver.step_max=0.02"),
        ("nonsense", "C013", 7, "--set solver.step_max=0.02"),
        ("tissue.gauss=[1", "C013", 20, "write a number"),
        ("", "C013", 7, "--set"),
    ] {
        let error = parse(WHOLE, &["output.every=1", argument]).unwrap_err();
        let rendered = render_error(&error, false);
        let place = error.place().unwrap_or_else(|| panic!("{rendered}"));
        assert_eq!(
            (error.code(), &*place.file, place.line, place.column),
            (code, "command line", 2, column),
            "{rendered}"
        );
        assert!(error.help().unwrap_or_default().contains(help), "{rendered}");
    }
}

#[test]
fn a_lock_file_is_the_same_problem_from_any_folder() {
    let scene = parse(WHOLE, &["fit.sd_mm=0.3", "controls.slab={ csv = \"curves.csv\" }"]).unwrap();
    let lock = scene.lock();
    let again = Scene::parse(&lock, "problem.lock.toml", Path::new("/another/folder"), &[]).unwrap();
    assert_eq!(content(&scene), content(&again));
    assert_eq!(lock, again.lock());
    let defaults = ["zero_is_missing = true", "max_iterations = 30", "every = 1", "element = \"trilinear\""];
    for default in defaults.into_iter().chain(["chunks = { count = 1, overlap = 5 }"]) {
        assert!(lock.contains(default), "{default} is not in\n{lock}");
    }
    for (asked, count, overlap) in [("3", 3, 5), ("{ count = 2, overlap = 9 }", 2, 9)] {
        let scene = parse(WHOLE, &[&format!("fit.chunks={asked}")]).unwrap();
        let again = Scene::parse(&scene.lock(), "problem.lock.toml", Path::new("/another/folder"), &[]).unwrap();
        for scene in [scene, again] {
            assert_eq!(scene.fit.expect("a fit").chunks, ChunksSpec { count, overlap });
        }
    }
    for head in ["{ bone_markers = [\"brow.L\", \"b\", \"c\"] }", "{ pose_topic = \"/head\" }", "{ estimate = true }"]
    {
        let scene = parse(WHOLE, &[&format!("fit.head={head}")]).unwrap();
        let lock = scene.lock();
        let again = Scene::parse(&lock, "problem.lock.toml", Path::new("/another/folder"), &[]).unwrap();
        assert_eq!((content(&scene), &lock), (content(&again), &again.lock()));
        assert!(lock.contains("[fit.head]"), "{lock}");
    }
    for (neutral, written) in [
        ("{ last = 9 }", "neutral = { first = 0, last = 9, step = 1 }"),
        ("{ first = 4, step = 2 }", "neutral = { first = 4, step = 2 }"),
        ("{ first = 4, last = 4 }", "neutral = 4"),
        ("\"first\"", "neutral = \"first\""),
    ] {
        let scene = parse(WHOLE, &[&format!("fit.neutral={neutral}")]).unwrap();
        let lock = scene.lock();
        assert!(lock.contains(written), "{written} is not in\n{lock}");
        assert_eq!(content(&scene), content(&Scene::parse(&lock, "problem.lock.toml", Path::new("/"), &[]).unwrap()));
    }
}

/// The laws, the regions and the loads that `WHOLE` does not have.
const OTHERS: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [10, 1, 1], elements = [10, 1, 1] }
[tissue]
guccione = { c_kpa = 2, bf = 8, bt = 2, bfs = 4, fibre = [1, 0, 0.5] }
[[region]]
name = "stiff"
elements = [0, 3]
guccione = { c_kpa = 20, bf = 8, bt = 2, bfs = 4, fibre = [0, 1, 0] }
[[region]]
name = "soft"
box_mm = [[5, 0, 0], [10, 1, 1]]
guccione = { c_kpa = 0.2, bf = 8, bt = 2, bfs = 4, fibre = [0, 1, 0] }
[[support]]
plate = { face = "xi1=1", offset_mm = 0.5 }
[[load]]
pressure = { face = "xi3=0", kpa = 0.004 }
[[load]]
nodal_force = { position_mm = [10, 0.5, 1], mn = [0, 0, -0.1] }
[[load]]
body_force = { mn_mm3 = [0, 0, -0.001] }
[[load]]
spring = { face = "xi1=0", kpa_per_mm = 0.5 }
[[load]]
spring = { face = "xi1=1", kpa_per_mm = 0.5, normal_only = true }
[[attachment]]
position_mm = [0, 0.5, 0.5]
stiffness_mn_per_mm = 20
"#;

#[test]
fn laws_regions_loads_and_attachments_are_read_and_locked() {
    let scene = parse(OTHERS, &[]).unwrap();
    let guccione = |c_kpa, fibre| LawSpec::Guccione { c_kpa, bf: 8.0, bt: 2.0, bfs: 4.0, fibre };
    assert_eq!(scene.tissue.law, guccione(2.0, [1.0, 0.0, 0.5]));
    assert_eq!(scene.regions[0].part, PartSpec::Elements(vec![0, 3]));
    assert_eq!(scene.regions[1].part, PartSpec::Box([[5.0, 0.0, 0.0], [10.0, 1.0, 1.0]]));
    assert_eq!(scene.regions[1].law, guccione(0.2, [0.0, 1.0, 0.0]));
    assert!(matches!(scene.supports[0].kind, SupportKind::Plate { offset_mm: 0.5, .. }));
    assert!(matches!(scene.loads[0].kind, LoadKind::Pressure { kpa: 0.004, .. }));
    assert!(matches!(scene.loads[1].kind, LoadKind::NodalForce { mn: [0.0, 0.0, -0.1], .. }));
    assert!(matches!(scene.loads[2].kind, LoadKind::BodyForce { mn_mm3: [0.0, 0.0, -0.001] }));
    assert!(matches!(scene.loads[3].kind, LoadKind::Spring { kpa_per_mm: 0.5, normal_only: false, .. }));
    assert!(matches!(scene.loads[4].kind, LoadKind::Spring { normal_only: true, .. }));
    assert_eq!(scene.attachments[0].tie, TieSpec::Spring { stiffness_mn_per_mm: 20.0 });
    // springs hold the body
    let without_plate = OTHERS.replace("[[support]]\nplate = { face = \"xi1=1\", offset_mm = 0.5 }\n", "");
    assert!(parse(&without_plate, &[]).unwrap().warnings.is_empty());
    let again = parse(&scene.lock(), &[]).unwrap();
    assert_eq!((content(&scene), scene.lock()), (content(&again), again.lock()));
    // the law of a whole file in one line
    let tissue = |law: &str| {
        parse(WHOLE, &[]).and(parse(&WHOLE.replace("mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }", law), &[]))
    };
    assert_eq!(tissue("neo-hookean = { mu_kpa = 1.4 }").unwrap().tissue.law, LawSpec::NeoHookean { mu_kpa: 1.4 });
    for (from, to, code, told) in [
        ("guccione = { c_kpa = 20", "neo-hookean = { mu_kpa = 20", "C002", "it can hold: name"),
        ("fibre = [1, 0, 0.5]", "fibre = [0, 0, 0]", "C005", "a direction, not all 0"),
        ("elements = [0, 3]", "elements = []", "C007", "at least one element"),
        ("elements = [0, 3]", "elements = [-1]", "C005", "a whole number from 0"),
        ("elements = [0, 3]", "", "C011", "`elements`, `box_mm`"),
        ("[[5, 0, 0], [10, 1, 1]]", "[[5, 0, 0]]", "C007", "the lower and the upper one"),
        ("\"soft\"", "\"stiff\"", "C008", "a second region"),
        ("bfs = 4, fibre = [1", "bfs = 0, fibre = [1", "C005", "greater than 0"),
        ("stiffness_mn_per_mm = 20", "stiffness_mn_per_mm = -20", "C005", "-20 mN/mm is not allowed"),
        ("mn = [0, 0, -0.1]", "mn = [0, 0]", "C007", "needs 3"),
    ] {
        assert!(OTHERS.contains(from), "{from}");
        let error = parse(&OTHERS.replacen(from, to, 1), &[]).expect_err(to);
        let rendered = render_error(&error, false);
        assert!(error.mistakes().iter().any(|m| m.code() == code) && rendered.contains(told), "{to}: {rendered}");
    }
}

/// What only the geometry can tell: points outside, elements that are not there or claimed twice.
#[test]
fn regions_and_points_must_lie_in_the_host() {
    for (from, to, code, told) in [
        ("elements = [0, 3]", "elements = [0, 10]", "G021", "names element 10, but the host has 10"),
        ("elements = [0, 3]", "elements = [0, 6]", "G021", "and region `stiff` both hold element 6"),
        ("[[5, 0, 0], [10, 1, 1]]", "[[10, 0, 0], [5, 1, 1]]", "G021", "holds the centre of no element"),
        (
            "position_mm = [10, 0.5, 1]",
            "position_mm = [10, 0.5, 2]",
            "G020",
            "the force lies outside the host, 1.000 mm",
        ),
        (
            "position_mm = [0, 0.5, 0.5]",
            "position_mm = [-2, 0.5, 0.5]",
            "G020",
            "position_mm = [0.000, 0.500, 0.500]",
        ),
    ] {
        let scene = parse(&OTHERS.replacen(from, to, 1), &[]).unwrap();
        let error = risorius::model::build::build(&scene).err().expect(to);
        let rendered = render_error(&error, false);
        assert_eq!((error.mistakes().len(), error.mistakes()[0].code()), (1, code), "{rendered}");
        assert!(rendered.contains(told), "{told} is not told:\n{rendered}");
    }
}

/// A message gives the nearest material point to three places; a point that is typed so is on the surface.
#[test]
fn a_point_that_is_rounded_to_the_outside_is_on_the_surface() {
    let at = |y: &str| {
        let text = OTHERS.replacen("position_mm = [10, 0.5, 1]", &format!("position_mm = [10, 0.5, {y}]"), 1);
        risorius::model::build::build(&parse(&text, &[]).unwrap())
    };
    assert!(at("1.0005").is_ok());
    assert_eq!(at("1.002").err().expect("it is outside").mistakes()[0].code(), "G020");
}

const CONTACTS: &str = r#"
[[sliding]]
face = "xi3=0"
surface = { reference = "xi3=1" }
law = { augmented = { kpa_per_mm = 50, gap_mm = 1e-3 } }
[[sliding]]
name = "pole"
face = "xi2=0"
surface = { cylinder = { through_mm = [0, 1, 2], axis = [0, 0, 2], radius_mm = 9, inside = true } }
law = { penalty = { kpa_per_mm = 5 } }
initial = "relax"
[[contact]]
face = "xi3=1"
surface = { plane = { through_mm = [0, 0, 21], normal = [0, 0, -1] } }
law = { barrier = { kpa_per_mm = 10, range_mm = 0.5 } }
gauss = 7
[[contact]]
face = "xi1=1"
surface = { sphere = { centre_mm = [90, 10, 10], radius_mm = 29.5 } }
law = { penalty = { kpa_per_mm = 5 } }
[[contact]]
face = "xi1=1"
surface = { capsule = { from_mm = [90, 0, 10], to_mm = [90, 20, 10], radius_mm = 29.5 } }
law = { penalty = { kpa_per_mm = 5 } }
[[contact]]
name = "lips"
face = ["upper:xi3=0", "xi1=1"]
surface = { faces = { face = "lower:xi3=1", depth_mm = 0.5 } }
law = { penalty = { kpa_per_mm = 5 } }
[[contact]]
name = "fold"
face = "boundary"
surface = { itself = {} }
law = { barrier = { kpa_per_mm = 5, range_mm = 0.1 } }
"#;

/// Several blocks are one host: faces of each by its name, of all without.
#[test]
fn blocks_are_read_locked_and_built() {
    let blocks = "blocks = [{ name = \"lower\", origin_mm = [0, 0, 0], size_mm = [60, 20, 9], elements = [6, 2, 1] }, \
                  { name = \"upper\", origin_mm = [0, 0, 10], size_mm = [60, 20, 10], elements = [3, 2, 1] }]";
    let line = WHOLE.lines().find(|line| line.starts_with("block = ")).expect("the host");
    let text = WHOLE.replacen(line, blocks, 1).replace("\"xi1=0\"", "\"upper:xi1=0\"");
    let scene = parse(&text, &[]).unwrap();
    let GeometrySpec::Blocks(all) = &scene.mesh.geometry else { panic!("{:?}", scene.mesh.geometry) };
    assert_eq!((all[1].name.as_str(), all[1].block.elements), ("upper", [3, 2, 1]));
    let again = parse(&scene.lock(), &[]).unwrap();
    assert_eq!(content(&scene), content(&again));
    let mesh = risorius::model::build::host(&scene.mesh).unwrap();
    assert_eq!((mesh.elements(), mesh.nodes), (18, 42 + 24));
    let count = |name: &str| mesh.named_faces[name].len();
    assert_eq!((count("upper:xi1=0"), count("lower:xi1=0"), count("xi1=0")), (2, 2, 4));
    assert_eq!(risorius::mesh::face::boundary_faces(&mesh).len(), 2 * (12 + 6 + 2) + 2 * (6 + 3 + 2));
}

#[test]
fn contacts_are_read_and_locked() {
    let text = WHOLE.to_owned() + CONTACTS;
    let scene = parse(&text, &[]).unwrap();
    let names = |list: &[risorius::scene::ContactSpec]| list.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&scene.slidings), ["sliding-1", "pole"]);
    assert_eq!(names(&scene.contacts), ["contact-1", "contact-2", "contact-3", "lips", "fold"]);
    let other = FaceSpec(vec![FaceName::OfBlock { block: "lower".into(), direction: 2, end: 1 }]);
    assert!(matches!(&scene.contacts[3].surface, SurfaceSpec::Faces { face, depth_mm: Some(0.5) } if *face == other));
    assert!(matches!(&scene.contacts[4].surface, SurfaceSpec::Itself { depth_mm: None }));
    assert_eq!((scene.contacts[0].gauss, scene.contacts[1].gauss), (7, 5));
    let again = parse(&scene.lock(), &[]).unwrap();
    assert_eq!(content(&scene), content(&again));
    assert_eq!(scene.lock(), again.lock());

    let mistakes = [
        ("reference = \"xi3=1\"", "reference = false", "C005"),
        ("normal = [0, 0, -1]", "normal = [0, 0, 0]", "C005"),
        ("to_mm = [90, 20, 10]", "to_mm = [90, 0, 10]", "C005"),
        ("radius_mm = 9,", "radius_mm = 0,", "C005"),
        ("gauss = 7", "initial = \"relax\"", "C005"),
        ("gauss = 7", "initial = \"absorb\"", "C006"),
        (
            "law = { penalty = { kpa_per_mm = 5 } }\ninitial",
            "law = { barrier = { kpa_per_mm = 5 } }\ninitial",
            "C002",
        ),
        ("name = \"pole\"", "name = \"sliding-1\"\n[[sliding]]\nname = \"sliding-1\"", "C008"),
    ];
    for (good, bad, code) in mistakes {
        assert!(text.contains(good), "{good}");
        let error = parse(&text.replacen(good, bad, 1), &[]).unwrap_err();
        let codes: Vec<&str> = match &error {
            risorius::Error::Mistakes(all) => all.iter().map(|e| e.code()).collect(),
            one => vec![one.code()],
        };
        assert!(codes.contains(&code), "{bad}: {codes:?} {error}");
    }
}

const BONES: &str = r#"
[[bone]]
name = "jaw"
hinge = { axis = [0, 2, 0], through_mm = [70, 0, -5], bounds_deg = [0, 35] }
slide = { direction = [1, 0, 0], bounds_mm = [-2, 12] }
[[bone]]
name = "larynx"
slide = { direction = [0, 0, 1], bounds_mm = [-10, 10] }
[[support]]
clamp = { face = "xi3=0", bone = "jaw" }
[[contact]]
face = "xi3=1"
surface = { plane = { through_mm = [0, 0, 21], normal = [0, 0, -1] } }
bone = "jaw"
law = { penalty = { kpa_per_mm = 5 } }
[[attachment]]
position_mm = [30, 10, 10]
stiffness_mn_per_mm = 5
bone = "larynx"
[[attachment]]
position_mm = [30, 10, 12]
rigid = true
"#;

#[test]
fn bones_are_read_and_locked() {
    let text = WHOLE.to_owned() + BONES;
    let set = ["controls.jaw.hinge=10", "controls.larynx.slide={ csv = \"curves.csv\" }"];
    let scene = parse(&text, &set).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let names: Vec<String> = scene.control_ranges().into_iter().map(|range| range.name).collect();
    assert_eq!(names, ["slab", "risorius.L", "jaw.hinge", "jaw.slide", "larynx.slide"]);
    assert_eq!(scene.bones[0].hinge.unwrap().bounds_deg, [0.0, 35.0]);
    assert!(scene.bones[1].hinge.is_none());
    assert!(matches!(&scene.supports[3].kind, SupportKind::Clamp { bone: Some(bone), .. } if bone == "jaw"));
    assert_eq!(scene.contacts[0].bone.as_deref(), Some("jaw"));
    assert_eq!(scene.attachments[0].bone.as_deref(), Some("larynx"));
    assert_eq!((scene.attachments[1].tie, &scene.attachments[1].bone), (TieSpec::Rigid, &None));
    assert_eq!(scene.controls[1].value, ControlValue::Constant(10.0));
    // muscles are sought unless bones are named
    assert_eq!(scene.fit.as_ref().unwrap().unknowns, ["slab"]);
    let jaw = parse(&text, &["fit.unknowns=[\"jaw.hinge\", \"slab\"]"]).unwrap();
    assert_eq!(jaw.fit.unwrap().unknowns, ["jaw.hinge", "slab"]);
    let again = parse(&scene.lock(), &[]).unwrap();
    assert_eq!((content(&scene), scene.lock()), (content(&again), again.lock()));
    let idle = parse(&text.replace("bone = \"larynx\"\n", ""), &[]).unwrap();
    assert_eq!(idle.warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["C021"]);

    let curves = "time_s,jaw.hinge,slab\n0,0,0\n1,35,1\n";
    assert!(Curves::parse(curves, "c.csv", &scene.control_ranges()).is_ok());
    let error = Curves::parse(&curves.replace("35", "36"), "c.csv", &scene.control_ranges()).unwrap_err();
    assert!(error.to_string().contains("from 0.0 to 35.0 deg, the bounds of its bone"), "{error}");

    for (good, bad, code, told) in [
        ("axis = [0, 2, 0]", "axis = [0, 0, 0]", "C005", "a direction, not all 0"),
        ("bounds_deg = [0, 35]", "bounds_deg = [5, 35]", "C005", "with 0 between them"),
        ("bounds_deg = [0, 35]", "bounds_deg = [0, 0]", "C005", "a greater upper bound"),
        ("bounds_deg = [0, 35]", "bounds_deg = [35]", "C007", "has 1 entries"),
        ("bounds_deg", "bounds_mm", "C002", "did you mean `bounds_deg`?"),
        ("slide = { direction = [0, 0, 1], bounds_mm = [-10, 10] }", "", "C003", "lacks `hinge`"),
        ("name = \"larynx\"", "name = \"jaw\"", "C008", "a second bone is called `jaw`"),
        ("bone = \"jaw\" }", "bone = \"jar\" }", "C009", "no bone is called `jar`"),
        ("bone = \"jaw\"\nlaw", "bone = \"jar\"\nlaw", "C009", "did you mean `jaw`?"),
        ("bone = \"larynx\"\n[[att", "bone = \"hyoid\"\n[[att", "C009", "bones: jaw, larynx"),
        ("plane = { through_mm = [0, 0, 21], normal = [0, 0, -1] }", "itself = {}", "C005", "clamp them to the bone"),
        ("rigid = true", "rigid = true\nstiffness_mn_per_mm = 5", "C011", "`stiffness_mn_per_mm`, `rigid`"),
        ("rigid = true", "", "C011", "holds none"),
        ("rigid = true", "rigid = false", "C005", "true, or stiffness_mn_per_mm"),
        ("\"risorius.L\"\nblock", "\"jaw.slide\"\nblock", "C008", "a second control is called `jaw.slide`"),
        ("risorius.L = 0.05", "jaw.hinge = 36", "C005", "= 36.0 deg is not allowed: it must be from 0.0 to 35.0 deg"),
        ("risorius.L = 0.05", "jaw.hinge = [1, 2]", "C004", "a number"),
        ("risorius.L = 0.05", "larynx.hinge = 1", "C009", "no control is called `larynx.hinge`"),
        ("unknowns = [\"slab\"]", "unknowns = [\"jaw.hing\"]", "C009", "did you mean `jaw.hinge`?"),
    ] {
        assert!(text.contains(good), "{good}");
        let error = parse(&text.replacen(good, bad, 1), &[]).expect_err(bad);
        let rendered = render_error(&error, false);
        assert!(error.mistakes().iter().any(|m| m.code() == code) && rendered.contains(told), "{bad}: {rendered}");
    }
    // a fit without muscles must say which bone it seeks
    let text = text.replace("[controls]\nrisorius.L = 0.05\n", "").replace("unknowns = [\"slab\"]\n", "");
    let start = text.find("[[muscle]]").unwrap();
    let end = text.find("[[support]]").unwrap();
    let alone = text[..start].to_owned() + &text[end..];
    let error = parse(&alone, &[]).unwrap_err();
    assert_eq!((error.code(), error.mistakes().len()), ("C003", 1), "{error}");
    assert!(error.help().unwrap().contains("unknowns = [\"jaw.hinge\"]"));
    assert!(parse(&alone, &["fit.unknowns=[\"jaw.hinge\"]"]).is_ok());
}

#[test]
fn files_must_exist_and_curves_are_checked_with_the_problem() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("problem.toml");
    std::fs::write(&path, WHOLE).unwrap();
    let error = Scene::read(&path, &[]).unwrap_err();
    assert_eq!((error.code(), error.place().unwrap().line), ("C012", line_with("smile.mcap")));
    assert!(error.to_string().contains("smile.mcap"));

    std::fs::write(folder.path().join("smile.mcap"), "").unwrap();
    std::fs::write(folder.path().join("curves.csv"), "time_s,risorius.L\n0,0\n1,2\n").unwrap();
    let csv = ["controls.risorius.L={csv=\"curves.csv\"}".to_string(), "controls.slab={csv=\"curves.csv\"}".into()];
    let error = Scene::read(&path, &csv).unwrap_err();
    assert_eq!((error.code(), error.place().unwrap().line, error.place().unwrap().column), ("C005", 3, 3));

    std::fs::write(folder.path().join("curves.csv"), "time_s,risorius.L\n0,0\n1,1\n").unwrap();
    let error = Scene::read(&path, &csv).unwrap_err();
    assert_eq!(error.to_string(), "no column is called `slab`");
    assert!(
        matches!(&Scene::read(&path, &csv[..1]).unwrap().controls[0].value, ControlValue::Csv(csv) if csv.is_file())
    );

    std::fs::write(&path, b"[task]\nkind = \"\xff\"\n").unwrap();
    let error = Scene::read(&path, &[]).unwrap_err();
    assert_eq!((error.code(), error.place().unwrap().line), ("C001", 2));
    let error = Scene::read(&folder.path().join("absent.toml"), &[]).unwrap_err();
    assert_eq!((error.code(), error.exit_code()), ("O001", 6));
    assert!(render_error(&error, false).starts_with("error[O001]: cannot read"));
}

#[test]
fn curves_are_linear_between_rows_and_constant_outside() {
    let muscles = ["slab", "risorius.L"].map(ControlRange::activation);
    let curves = Curves::parse("time_s, risorius.L,slab\n0,0,1\n\n2, 0.5,0\n", "c.csv", &muscles).unwrap();
    assert_eq!(curves.at("risorius.L", 1.0), Some(0.25));
    assert_eq!((curves.at("slab", -1.0), curves.at("slab", 9.0), curves.at("x", 0.0)), (Some(1.0), Some(0.0), None));
    // what a fit leaves drives a forward run
    let left = "frame,time_s,slab,slab_sd\n0,0,0.5,1e-4\n1,1,0.25,\n";
    let curves = Curves::parse(left, "activations.csv", &muscles).unwrap();
    assert_eq!((curves.names.len(), curves.at("slab", 1.0)), (1, Some(0.25)));
    for (text, code, line, column) in [
        ("frame,time_s,slab_sd,slap_sd\n0,0,1,1\n", "C009", 1, 22),
        ("frame,time_s,slab\n0,0\n", "C007", 2, 1),
        ("time_s,slab\n0,x\n", "C004", 2, 3),
        ("time_s,slab\n0,\n", "C004", 2, 3),
        ("time_s,slab\n0,nan\n", "C005", 2, 3),
        ("time_s,slab\n0, 1.5\n", "C005", 2, 4),
        ("time_s,slap\n0,1\n", "C009", 1, 8),
        ("time_s,slab,slab\n0,1,1\n", "C008", 1, 13),
        ("time_s,slab\n1,0\n1,0\n", "C014", 3, 1),
        ("time_s,slab\n1,0,0\n", "C007", 2, 1),
        ("t,slab\n1,0\n", "C003", 1, 1),
        ("time_s,slab\n", "C007", 0, 0),
        ("", "C003", 0, 0),
    ] {
        let error = Curves::parse(text, "c.csv", &muscles).expect_err(text);
        let place = error.place().unwrap_or_else(|| panic!("{error}"));
        assert_eq!((error.code(), place.line, place.column), (code, line, column), "{text}");
    }
}

#[test]
fn a_terminal_cannot_be_controlled_through_a_file() {
    let error = parse(&WHOLE.replace("[controls]", "[controls]\n\"\\u001b[31m\" = 1"), &[]).unwrap_err();
    assert_eq!(error.code(), "C009");
    assert!(!render_error(&error, false).contains('\u{1b}'));
}

/// Reads, and if that fails renders every message: neither may panic.
fn survives(text: &str, overrides: &[&str]) {
    if let Err(error) = parse(text, overrides) {
        assert!(!error.mistakes().is_empty(), "a failure without a mistake:\n{text}");
        render_error(&error, true);
        assert!(error.mistakes().iter().all(|mistake| !matches!(mistake, Error::Mistakes(_))));
    }
}

#[test]
fn a_file_cut_anywhere_never_panics() {
    for (end, _) in WHOLE.char_indices() {
        survives(&WHOLE[..end], &[]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn garbage_never_panics(at in 0..WHOLE.len(), length in 0..20usize, junk in "[\\PC\\n\\r\"\\[\\]{}=.,#]{0,12}", set in "\\PC{0,20}") {
        let end = (at + length).min(WHOLE.len());
        survives(&format!("{}{junk}{}", &WHOLE[..at], &WHOLE[end..]), &[&set]);
        survives(&junk, &[&format!("tissue.gauss{set}"), &junk]);
        let _ = Curves::parse(&format!("time_s,slab\n{junk}\n{set}"), "c.csv", &[ControlRange::activation("slab")]);
    }

    #[test]
    fn any_value_survives_the_lock(
        origin in [any::<f64>(), any::<f64>(), any::<f64>()],
        c1 in 0.0..1e300f64,
        kappa in prop_oneof![Just(0.0), Just(-0.0), f64::MIN_POSITIVE..1e9],
        angle in prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
        activation in 0.0..=1.0f64,
        elements in 1..1000usize,
        name in "\\PC{1,8}",
        topic in "[\\PC\\t\\n]{1,8}",
    ) {
        prop_assume!(origin.iter().all(|x| x.is_finite()));
        let mut scene = parse(WHOLE, &[]).unwrap();
        if let GeometrySpec::Block(block) = &mut scene.mesh.geometry {
            block.origin_mm = origin;
            block.elements[1] = elements;
        }
        scene.tissue.law = LawSpec::MooneyRivlin { c1_kpa: c1, c2_kpa: 1e-3 };
        scene.tissue.kappa_kpa = kappa;
        scene.muscles[0].fibres = FibresSpec::Uniform([angle, 0.0, -0.0]);
        scene.muscles[0].cut = angle > 0.0;
        scene.muscles[0].taper_mm = (c1 > 0.0).then_some(c1);
        scene.muscles[0].fibre_turn_deg = [angle, 0.0, activation, -0.0];
        scene.controls[0].value = ControlValue::Constant(activation);
        scene.probes[0].name = name;
        scene.fit.as_mut().unwrap().topic = Some(topic);
        let again = parse(&scene.lock(), &[]).unwrap();
        prop_assert_eq!(content(&scene), content(&again));
        prop_assert_eq!(scene.lock(), again.lock());
    }
}

#[test]
fn outer_unknowns_are_read_and_written_back() {
    let outer = "[fit.outer]\nframes = [7, 2]\nheld_out = [4]\n[[fit.outer.unknown]]\nstiffness = \"tissue\"\nsd = 0.2\n\
                 [[fit.outer.unknown]]\nsigma_max = \"slab\"\nbounds = [0.5, 3]\n[[fit.outer.unknown]]\nfibre_angle = \"slab\"\n\
                 mode = \"y\"\nsd_deg = 20\nbounds_deg = [-30, 40]\n[[marker]]";
    let text = WHOLE.replacen("[[marker]]", outer, 1).replacen("units = \"m\"", "units = \"m\"\nsd_mm = 0.3", 1);
    let scene = parse(&text, &["muscle.slab.fibre_turn_deg=[1, 0, -2.5, 0]"]).unwrap();
    assert_eq!(scene.muscles[0].fibre_turn_deg, [1.0, 0.0, -2.5, 0.0]);
    let read = scene.fit.as_ref().unwrap().outer.as_ref().unwrap();
    assert_eq!((read.frames.as_deref(), &read.held_out[..]), (Some(&[2, 7][..]), &[4][..]));
    let labels: Vec<String> = read.unknowns.iter().map(|unknown| unknown.what.label()).collect();
    assert_eq!(labels, ["stiffness.tissue", "sigma_max.slab", "fibre_angle.slab.y"]);
    let known: Vec<_> = read.unknowns.iter().map(|unknown| (unknown.sd, unknown.bounds)).collect();
    assert_eq!(known, [(Some(0.2), [0.1, 10.0]), (None, [0.5, 3.0]), (Some(20.0), [-30.0, 40.0])]);
    let again = parse(&scene.lock(), &[]).unwrap();
    assert_eq!(content(&scene), content(&again));
    assert_eq!(scene.lock(), again.lock());
}

/// The problem file that the guide shows is one that can be read.
#[test]
fn the_problem_file_of_the_guide_is_read() {
    let guide = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/src/guide/problem_file.md")).unwrap();
    let text = guide.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a block of TOML");
    for text in [text.to_owned(), text.replace("kind = \"forward\"", "kind = \"fit\"")] {
        let scene = parse(&text, &[]).unwrap_or_else(|error| panic!("{}", render_error(&error, false)));
        assert_eq!((scene.contacts.len(), scene.slidings.len(), scene.regions.len()), (1, 1, 1));
        let built = risorius::model::build::build(&scene);
        assert!(built.is_ok(), "{}", render_error(&built.err().unwrap(), false));
    }
}
