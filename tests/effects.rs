//! An effect that a scene does not name costs nothing and changes no bit.
//!
//! The base is a loaded cantilever. Each effect is added twice: so that it acts, which must change the answer, and so that
//! it is there and has nothing to do, which must not change one bit of it. So nothing but an effect's own term can change
//! an answer, and the base has no such term.

use assert_cmd::Command;
use risorius::forward::{Drive, Settings, Solver, Work};
use risorius::model::build::build;
use risorius::model::{Model, State};
use risorius::scene::Scene;
use std::fs;
use std::path::Path;

const BASE: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [20, 10, 10], elements = [2, 1, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
gauss = 4
[[support]]
clamp = { face = "xi1=0" }
[[load]]
traction = { face = "xi1=1", kpa = [0.02, 0, -0.04] }
"#;

/// An effect as a table: with nothing to do, and at work.
struct Effect {
    name: &'static str,
    /// What is added to the terms of the base; empty for an effect that has no term.
    terms: &'static [&'static str],
    idle: &'static str,
    at_work: &'static str,
}

/// A muscle without passive force, so that at rest it is nothing; at work it is activated by [`ACTIVATION`].
const MUSCLE: &str = r#"
[[muscle]]
name = "slab"
block = { origin_mm = [2, 2, 6], size_mm = [16, 6, 3], elements = [2, 1, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0, p2 = 6.6 }
"#;
const ACTIVATION: f64 = 0.01;

const EFFECTS: [Effect; 15] = [
    Effect { name: "muscle", terms: &["slab"], idle: MUSCLE, at_work: MUSCLE },
    Effect {
        name: "region",
        terms: &[],
        idle: "[[region]]\nname = \"tip\"\nelements = [1]\nmooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }",
        at_work: "[[region]]\nname = \"tip\"\nelements = [1]\nmooney-rivlin = { c1_kpa = 5, c2_kpa = 2 }",
    },
    Effect {
        name: "traction",
        terms: &["traction"],
        idle: "[[load]]\ntraction = { face = \"xi3=1\", kpa = [0, 0, 0] }",
        at_work: "[[load]]\ntraction = { face = \"xi3=1\", kpa = [0, 0, 0.01] }",
    },
    Effect {
        name: "gravity",
        terms: &["gravity"],
        idle: "[[load]]\ngravity = { density_kg_m3 = 1040, acceleration_m_s2 = [0, 0, 0] }",
        at_work: "[[load]]\ngravity = { density_kg_m3 = 1040, acceleration_m_s2 = [0, 0, 1] }",
    },
    Effect {
        name: "body force",
        terms: &["body_force"],
        idle: "[[load]]\nbody_force = { mn_mm3 = [0, 0, 0] }",
        at_work: "[[load]]\nbody_force = { mn_mm3 = [0, 0, 0.001] }",
    },
    Effect {
        name: "pressure",
        terms: &["pressure"],
        idle: "[[load]]\npressure = { face = \"xi3=1\", kpa = 0 }",
        at_work: "[[load]]\npressure = { face = \"xi3=1\", kpa = -0.01 }",
    },
    Effect {
        name: "nodal force",
        terms: &["nodal_force"],
        idle: "[[load]]\nnodal_force = { position_mm = [20, 10, 10], mn = [0, 0, 0] }",
        at_work: "[[load]]\nnodal_force = { position_mm = [20, 10, 10], mn = [0, 0, 0.1] }",
    },
    Effect {
        name: "spring foundation",
        terms: &["spring"],
        idle: "[[load]]\nspring = { face = \"xi1=0\", kpa_per_mm = 0.1 }",
        at_work: "[[load]]\nspring = { face = \"xi3=0\", kpa_per_mm = 0.001 }",
    },
    Effect {
        name: "attachment",
        terms: &["attachment"],
        idle: "[[attachment]]\nposition_mm = [0, 10, 10]\nstiffness_mn_per_mm = 20",
        at_work: "[[attachment]]\nposition_mm = [20, 10, 10]\nstiffness_mn_per_mm = 0.1",
    },
    Effect {
        name: "sliding",
        terms: &["sliding-1"],
        idle: "[[sliding]]\nface = \"xi1=0\"\nsurface = { plane = { through_mm = [0, 0, 0], normal = [1, 0, 0] } }\nlaw = { penalty = { kpa_per_mm = 5 } }",
        at_work: "[[sliding]]\nface = \"xi3=0\"\nsurface = { plane = { through_mm = [0, 0, 0], normal = [0, 0, 1] } }\nlaw = { penalty = { kpa_per_mm = 5 } }",
    },
    Effect {
        name: "contact",
        terms: &["contact-1"],
        idle: "[[contact]]\nface = \"xi3=0\"\nsurface = { plane = { through_mm = [0, 0, -99], normal = [0, 0, 1] } }\nlaw = { penalty = { kpa_per_mm = 5 } }",
        at_work: "[[contact]]\nface = \"xi3=0\"\nsurface = { plane = { through_mm = [0, 0, -1], normal = [0, 0, 1] } }\nlaw = { penalty = { kpa_per_mm = 5 } }",
    },
    Effect {
        name: "contact with other faces",
        terms: &["contact-1"],
        idle: "[[contact]]\nface = \"xi3=0\"\nsurface = { faces = { face = \"xi3=1\", depth_mm = 1 } }\nlaw = { penalty = { kpa_per_mm = 5 } }",
        at_work: "",
    },
    Effect {
        name: "contact with itself",
        terms: &["contact-1"],
        idle: "[[contact]]\nface = \"xi3=0\"\nsurface = { itself = {} }\nlaw = { penalty = { kpa_per_mm = 5 } }",
        at_work: "",
    },
    Effect {
        name: "bone",
        terms: &[],
        idle: "[[bone]]\nname = \"jaw\"\nslide = { direction = [1, 0, 0], bounds_mm = [0, 12] }",
        at_work: "",
    },
    Effect {
        name: "support",
        terms: &[],
        idle: "[[support]]\nsymmetry = { face = \"xi1=0\" }",
        at_work: "[[support]]\nsymmetry = { face = \"xi2=0\" }",
    },
];

fn scene(tables: &str) -> Scene {
    let text = format!("{BASE}{tables}\n");
    Scene::parse(&text, "effects.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{tables}\n{error}"))
}

fn model(tables: &str) -> Model {
    build(&scene(tables)).unwrap_or_else(|error| panic!("{tables}\n{error}")).model
}

fn names(model: &Model) -> Vec<String> {
    model.terms().iter().map(|term| term.name().to_owned()).collect()
}

fn solved(model: &Model, activation: f64) -> (State, Work) {
    let mut solver = Solver::new(model, Settings::default()).expect("memory");
    let drive = Drive { controls: vec![activation; model.controls().len()], load: 1.0 };
    let found = solver
        .equilibrium(&model.rest(), &drive)
        .unwrap_or_else(|failure| panic!("{:?}: {}", names(model), failure.error));
    (found.state, solver.work())
}

fn bits(state: &State) -> Vec<u64> {
    state.u.iter().flatten().chain(&state.p).map(|x| x.to_bits()).collect()
}

#[test]
fn an_idle_effect_changes_no_bit_and_no_count_of_the_others() {
    let base = model("");
    let (state, work) = solved(&base, 0.0);
    assert_eq!(names(&base), ["tissue", "traction"]);
    assert_eq!(base.points().collect::<Vec<_>>(), [2 * 64, 16], "two elements, one face");
    assert!(base.controls().is_empty() && state.multipliers.iter().all(Vec::is_empty));
    for Effect { name, terms, idle, at_work } in EFFECTS {
        let with = model(idle);
        // one term more and the same model beside it
        let others: Vec<String> = names(&with).into_iter().filter(|name| !terms.contains(&name.as_str())).collect();
        let own = if terms == ["traction"] { vec!["tissue"] } else { vec!["tissue", "traction"] };
        assert_eq!(others, own, "{name}");
        assert_eq!(with.terms().len(), base.terms().len() + terms.len(), "{name}");
        assert_eq!(with.numbering().unknowns(), base.numbering().unknowns(), "{name}");
        assert_eq!(with.symbolic().factor_nnz(), base.symbolic().factor_nnz(), "{name}");
        let (idle, its_work) = solved(&with, 0.0);
        assert!(bits(&idle) == bits(&state), "{name}: an idle effect changed the answer");
        let counts = |work: &Work| (work.iterations, work.force_evaluations, work.assemblies, work.cuts);
        assert_eq!(counts(&its_work), counts(&work), "{name}");
        assert_eq!(its_work.linear.factorisations, work.linear.factorisations, "{name}");
        // the points of the tissue, which is first
        assert_eq!(its_work.points[0], work.points[0], "{name}");
        assert_eq!(its_work.points.len(), work.points.len() + terms.len(), "{name}");
        if !at_work.is_empty() {
            let (changed, _) = solved(&model(at_work), ACTIVATION);
            assert!(bits(&changed) != bits(&state), "{name}: the effect does nothing even at work");
        }
    }
}

/// What `check` prints below a line that starts with `head`, or on it.
fn line<'t>(page: &'t str, head: &str) -> &'t str {
    page.lines().find(|line| line.starts_with(head)).unwrap_or_else(|| panic!("no `{head}` in\n{page}"))
}

#[test]
fn check_says_what_is_on_and_off_and_cost_csv_has_a_row_for_what_is_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |name: &str, tables: &str| {
        let file = format!("{name}.toml");
        fs::write(folder.path().join(&file), format!("{BASE}{tables}\n")).expect("written");
        let risorius = |arguments: &[&str]| {
            let output = Command::cargo_bin("risorius").expect("built").current_dir(&folder).args(arguments).output();
            let output = output.expect("it runs");
            assert!(output.status.success(), "{arguments:?}\n{}", String::from_utf8_lossy(&output.stderr));
            String::from_utf8(output.stdout).expect("text")
        };
        let page = risorius(&["check", &file]);
        risorius(&["run", &file, "--out", name]);
        let cost = fs::read_to_string(folder.path().join(name).join("tables/cost.csv")).expect("a table");
        let parts = cost.lines().skip(1).map(|row| row.split(',').next().unwrap_or_default().to_owned()).collect();
        (page, parts)
    };
    const SOLVER: [&str; 5] = ["assembly", "factorisation", "solve", "output", "writing"];
    let (page, parts): (String, Vec<String>) = run("base", "");
    assert_eq!(parts, [&["tissue", "traction"][..], &SOLVER].concat());
    let off = line(&page, "effects off:");
    for effect in ["region", "muscle", "gravity", "pressure", "sliding", "contact with itself", "attachment"] {
        assert!(off.contains(effect), "{off}");
    }
    assert!(!off.contains("traction") && !off.contains("clamp"), "{off}");
    assert_eq!(line(&page, "  tissue").split_whitespace().last(), Some("128"));
    assert!(page.contains(" unknowns (") && page.contains("Mflop") && page.contains("MB of factor"), "{page}");

    let [muscle, contact] =
        ["muscle", "contact"].map(|name| EFFECTS.iter().find(|e| e.name == name).expect("listed"));
    let (page, parts): (String, Vec<String>) = run("more", &format!("{}\n{}", muscle.idle, contact.idle));
    assert_eq!(parts, [&["tissue", "slab", "contact-1", "traction"][..], &SOLVER].concat());
    let off = line(&page, "effects off:");
    assert!(!off.contains("muscle") && !off.contains("rigid surface") && off.contains("gravity"), "{off}");
    assert_eq!(line(&page, "  slab").split_whitespace().last(), Some("54"));
}

/// The effects of a scene are counted from its tables, and every word that `check` knows can be on.
#[test]
fn every_effect_is_counted() {
    let counts = |tables: &str| scene(tables).effects();
    let base = counts("");
    for Effect { name, at_work, idle, .. } in EFFECTS {
        let table = if at_work.is_empty() { idle } else { at_work };
        let changed: Vec<_> = counts(table).into_iter().zip(&base).filter(|(now, before)| now != *before).collect();
        assert_eq!(changed.len(), 1, "{name}: {changed:?}");
    }
    let field = MUSCLE.replace("fibre_angles_deg", "activation = \"field\"\nfibre_angles_deg");
    let on = |tables: &str, effect: &str| counts(tables).iter().any(|(name, count)| *name == effect && *count > 0);
    assert!(on(&field, "activation field") && !on(MUSCLE, "activation field"));
}
