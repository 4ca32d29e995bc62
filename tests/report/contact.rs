//! Contact in tables and shapes: a cube of 20 mm pressed on a plane by 0.9 kPa through a penalty of 20 kPa/mm, from a
//! problem file.

use super::support::{FRAME, run_in, temporary};
use risorius::forward::{Drive, Settings, Solver};
use risorius::model::build::build;
use risorius::report::tables::ContactTable;
use risorius::report::vtu::{Values, contact};
use risorius::report::{contact_points, contact_states};
use risorius::scene::Scene;
use std::path::Path;

const PROBLEM: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [20, 20, 20], elements = [2, 2, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
[[support]]
symmetry = { face = "xi1=0" }
[[support]]
symmetry = { face = "xi2=0" }
[[contact]]
face = "xi3=0"
surface = { plane = { through_mm = [0, 0, 0], normal = [0, 0, 1] } }
law = { penalty = { kpa_per_mm = 20 } }
[[load]]
traction = { face = "xi3=1", kpa = [0, 0, -0.9] }
"#;

fn scene(text: &str) -> Scene {
    Scene::parse(text, "problem.toml", Path::new("."), &[]).expect("a problem")
}

#[test]
fn tables_and_shapes_show_the_pressure() {
    let built = build(&scene(PROBLEM)).expect("a model");
    let model = &built.model;
    let mut solver = Solver::new(model, Settings::default()).expect("memory");
    let drive = Drive { controls: Vec::new(), load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|f| panic!("{}", f.error));
    let folder = temporary();
    let run = run_in(&folder);
    let states = contact_states(model, &found.state);
    ContactTable::create(&run).and_then(|mut table| table.add(FRAME, &states)).expect("written");
    let text = std::fs::read_to_string(run.tables().join("contact.csv")).expect("a table");
    let rows: Vec<&str> = text.lines().collect();
    let columns = "frame,time_s,name,area_mm2,pressure_mean_kpa,pressure_max_kpa,penetration_mm,force_mn,force_x_mn,\
                   force_y_mn,force_z_mn";
    assert_eq!((rows.len(), rows[0]), (2, columns));
    let cells: Vec<&str> = rows[1].split(',').collect();
    assert_eq!(cells[2], "contact-1");
    let expected = [400.0, 0.9, 0.9, 0.9 / 20.0, 360.0, 0.0, 0.0, 360.0];
    for (cell, expected) in cells[3..].iter().zip(expected) {
        let number: f64 = cell.parse().expect("a number");
        assert!((number - expected).abs() < 1e-5 * (1.0 + expected), "{number} instead of {expected}");
    }

    let grid = contact::points(&contact_points(model, &found.state), 0.0);
    assert_eq!(grid.points.len(), 4 * 25);
    let field = |name: &str| match &grid.on_points.iter().find(|f| f.name == name).expect("a field").values {
        Values::Scalars(values) => values.clone(),
        other => panic!("{name}: {other:?}"),
    };
    assert!(field("contact_pressure_kpa").iter().all(|p| (p - 0.9).abs() < 1e-5));
    assert!(field("gap_mm").iter().all(|g| (g + 0.045).abs() < 1e-5));
    assert!((field("area_mm2").iter().sum::<f64>() - 400.0).abs() < 1e-9);
    assert!(grid.points.iter().all(|x| (x[2] + 0.045).abs() < 1e-5), "the points move with the body");
}

/// A face that starts behind the surface is refused with its worst point, and relaxed with a warning where that is asked.
#[test]
fn an_initial_penetration_is_never_silent() {
    let behind = PROBLEM.replace("through_mm = [0, 0, 0]", "through_mm = [0, 0, 0.5]");
    let error = build(&scene(&behind)).err().expect("it starts behind the plane");
    assert_eq!(error.code(), "G022");
    assert!(error.to_string().contains("-5.000e-1 mm"), "{error}");
    assert_eq!(error.place().map(|place| &*place.text), Some("[[contact]]"));

    let relaxed = behind.replace("law = { penalty", "initial = \"relax\"\nlaw = { penalty");
    let built = build(&scene(&relaxed)).expect("a model");
    assert_eq!(built.warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["G023"]);
    let model = &built.model;
    // at rest nothing is pressed; at full load the face is where the load wants it
    let rest = contact_states(model, &model.rest())[0];
    assert!(rest.max_pressure == 0.0 && (rest.penetration - 0.5).abs() < 1e-12, "{rest:?}");
    let mut solver = Solver::new(model, Settings::default()).expect("memory");
    let drive = Drive { controls: Vec::new(), load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|f| panic!("{}", f.error));
    let end = contact_states(model, &found.state)[0];
    assert!((end.penetration - 0.045).abs() < 1e-5 && (end.mean_pressure - 0.9).abs() < 1e-5, "{end:?}");
}
