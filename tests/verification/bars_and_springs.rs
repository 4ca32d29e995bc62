//! Bars between smooth plates, of every law and of two regions side by side, and bodies held by springs alone.
//!
//! An incompressible bar stretched by lambda has nominal stress dW/dlambda of W(lambda, lambda^-1/2, lambda^-1/2). Side by
//! side every region keeps its own stress. What springs hold adds up to the loads.

use super::support::{moved, solve};
use risorius::forward::Equilibrium;
use risorius::mesh::face::Side;
use risorius::mesh::location::Locator;
use risorius::model::Model;
use risorius::model::build::build;
use risorius::scene::Scene;
use std::path::Path;

fn solved(text: &str) -> (Model, Equilibrium) {
    let scene = Scene::parse(text, "bar.toml", Path::new("bar"), &[]).unwrap_or_else(|error| panic!("{error}"));
    let model = build(&scene).unwrap_or_else(|error| panic!("{error}")).model;
    let found = solve(&model, &[], 1.0);
    (model, found)
}

/// Force on the plate that stretches a bar of 20 x 10 x 10 mm, its halves y < 5 and y > 5 of one element each across.
fn pull(law: &str, region: &str, stretch: f64) -> f64 {
    let offset = 20.0 * (stretch - 1.0);
    let (model, found) = solved(&format!(
        r#"
task = {{ kind = "forward" }}
mesh = {{ block = {{ origin_mm = [0, 0, 0], size_mm = [20, 10, 10], elements = [2, 2, 1] }} }}
[tissue]
{law}
pressure = "discontinuous-trilinear"
gauss = 4
{region}
[[support]]
symmetry = {{ face = "xi1=0" }}
[[support]]
symmetry = {{ face = "xi2=0" }}
[[support]]
symmetry = {{ face = "xi3=0" }}
[[support]]
plate = {{ face = "xi1=1", offset_mm = {offset} }}
"#
    ));
    let mesh = model.mesh();
    let on_plate = |parameter: usize| {
        mesh.parameter_derivative[parameter] == 0 && (mesh.parameters[parameter][0] - 20.0).abs() < 1e-9
    };
    let corner = moved(&model, &found, 3, [1.0; 3]);
    let across = 10.0 / stretch.sqrt();
    assert!((corner[1] - across).abs() < 1e-8 && (corner[2] - across).abs() < 1e-8, "{corner:?}");
    found.evaluation.force.iter().enumerate().filter(|(p, _)| on_plate(*p)).map(|(_, force)| force[0]).sum()
}

fn neo_hookean(mu: f64, l: f64) -> f64 {
    mu * (l - l.powi(-2))
}

/// Along the fibres, c = 2, bf = 8, bt = 2: Q = bf (l^2 - 1)^2/4 + bt (1/l - 1)^2/2
fn along_the_fibres(l: f64) -> f64 {
    let (along, across) = (l * l - 1.0, 1.0 / l - 1.0);
    let q = 2.0 * along * along + across * across;
    q.exp() * (8.0 * along * l - 2.0 * across / (l * l))
}

#[test]
fn bars_of_every_law_pull_with_their_closed_stress() {
    for l in [0.8_f64, 1.25] {
        let guccione = "guccione = { c_kpa = 2, bf = 8, bt = 2, bfs = 4, fibre = [1, 0, 0] }";
        for (law, stress) in [
            ("mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }", 2.0 * (l - l.powi(-2)) * (0.5 + 0.2 / l)),
            ("neo-hookean = { mu_kpa = 1.4 }", neo_hookean(1.4, l)),
            (guccione, along_the_fibres(l)),
        ] {
            let force = pull(law, "", l);
            assert!((force - 100.0 * stress).abs() < 1e-7 * stress.abs() * 100.0, "{law}: {force} at {l}");
        }
    }
}

#[test]
fn regions_side_by_side_pull_with_their_own_stress() {
    let expected = 50.0 * (neo_hookean(1.4, 1.3) + neo_hookean(5.0, 1.3));
    for part in ["elements = [2, 3]", "box_mm = [[0, 5, 0], [20, 10, 10]]"] {
        let region = format!("[[region]]\nname = \"stiff\"\n{part}\nneo-hookean = {{ mu_kpa = 5 }}");
        let force = pull("neo-hookean = { mu_kpa = 1.4 }", &region, 1.3);
        assert!((force - expected).abs() < 1e-7 * expected, "{part}: {force} instead of {expected}");
    }
}

const BLOCK: &str = r#"
task = { kind = "forward" }
mesh = { block = { origin_mm = [0, 0, 0], size_mm = [20, 10, 10], elements = [2, 1, 1] } }
tissue = { neo-hookean = { mu_kpa = 1.4 }, gauss = 4 }
"#;

/// A foundation of 0.5 kPa/mm under a traction of 1.5 kPa gives way by 3 mm, and the bar on it stretches as ever.
#[test]
fn a_foundation_gives_way_by_traction_over_stiffness() {
    let (model, found) = solved(&format!(
        r#"{BLOCK}
[[support]]
symmetry = {{ face = "xi2=0" }}
[[support]]
symmetry = {{ face = "xi3=0" }}
[[load]]
spring = {{ face = "xi1=0", kpa_per_mm = 0.5, normal_only = true }}
[[load]]
traction = {{ face = "xi1=1", kpa = [1.5, 0, 0] }}
"#
    ));
    let (start, end) = (moved(&model, &found, 0, [0.0, 1.0, 1.0]), moved(&model, &found, 1, [1.0; 3]));
    assert!((start[0] - 3.0).abs() < 1e-8, "{start:?}");
    let stretch = (end[0] - start[0]) / 20.0;
    assert!((neo_hookean(1.4, stretch) - 1.5).abs() < 1e-8, "stretch {stretch}");
    // 1/2 k u^2 of 100 mm2
    let energy = found.evaluation.energies[1];
    assert!((energy - 0.5 * 0.5 * 9.0 * 100.0).abs() < 1e-5, "{energy} uJ");
}

/// The forces of four attachments add up to a force on a point and to one on the whole volume.
#[test]
fn attachments_hold_what_loads_the_body() {
    const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [20.0, 10.0, 0.0], [20.0, 0.0, 10.0], [0.0, 10.0, 10.0]];
    let attachments: String = CORNERS
        .iter()
        .map(|corner| format!("[[attachment]]\nposition_mm = {corner:?}\nstiffness_mn_per_mm = 20\n"))
        .collect();
    let loads = [
        ("nodal_force = { position_mm = [13, 4, 10], mn = [4, -3, -6] }", [4.0, -3.0, -6.0]),
        ("body_force = { mn_mm3 = [0.002, 0, -0.004] }", [4.0, 0.0, -8.0]),
    ];
    for (load, total) in loads {
        let (model, found) = solved(&format!("{BLOCK}{attachments}[[load]]\n{load}\n"));
        let locator = Locator::new(model.mesh());
        let mut held = [0.0; 3];
        for corner in CORNERS {
            let at = locator.locate(corner).expect("a corner");
            let u = model.mesh().interpolate(at, &found.state.u);
            (0..3).for_each(|i| held[i] += 20.0 * u[i]);
        }
        for i in 0..3 {
            assert!((held[i] - total[i]).abs() < 1e-7, "{load}: {held:?} instead of {total:?}");
        }
    }
}

/// A closed surface under pressure has no resultant, and an incompressible body stays as it is: p alone answers.
#[test]
fn pressure_all_around_only_raises_the_pressure() {
    let faces: String =
        Side::ALL.iter().map(|side| format!("[[load]]\npressure = {{ face = \"{side}\", kpa = 2.5 }}\n")).collect();
    let tie = "[[attachment]]\nposition_mm = [0, 0, 0]\nstiffness_mn_per_mm = 1\n\
        [[attachment]]\nposition_mm = [20, 0, 0]\nstiffness_mn_per_mm = 1\n\
        [[attachment]]\nposition_mm = [0, 10, 10]\nstiffness_mn_per_mm = 1\n";
    let (model, found) = solved(&format!("{BLOCK}{tie}{faces}"));
    assert!(model.external_work(&found.state).abs() < 1e-6);
    assert!(found.state.u.iter().flatten().all(|u| u.abs() < 1e-8));
    assert!(found.state.p.iter().all(|p| (p - 2.5).abs() < 1e-8), "{:?}", found.state.p);
}
