//! Contact that opens and closes at very few points.

use super::record::{difference, drive, solver, stable};
use risorius::forward::StepKind;
use risorius::model::build::build;
use risorius::report::contact_states;
use risorius::scene::Scene;
use std::path::Path;

/// A block whose lower face of two by two elements has nine points each to meet the tip of a small sphere; its upper face
/// hangs on springs, so that only contact and springs bear the load.
fn block_over_a_sphere(law: &str) -> Scene {
    let text = format!(
        r#"
[task]
kind = "forward"
[mesh]
block = {{ origin_mm = [0, 0, 0], size_mm = [10, 10, 5], elements = [2, 2, 1] }}
[tissue]
mooney-rivlin = {{ c1_kpa = 0.5, c2_kpa = 0.2 }}
gauss = 4
[[load]]
spring = {{ face = "xi3=1", kpa_per_mm = 0.02 }}
[[load]]
traction = {{ face = "xi3=1", kpa = [0, 0, -0.05] }}
[[contact]]
face = "xi3=0"
surface = {{ sphere = {{ centre_mm = [5.3, 4.6, -3.05], radius_mm = 3, inside = false }} }}
law = {{ {law} }}
gauss = 3
"#
    );
    Scene::parse(&text, "chatter.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn contact_at_few_points_opens_and_closes_without_chatter() {
    for (law, allowed) in [
        ("penalty = { kpa_per_mm = 20 }", 0.2),
        ("augmented = { kpa_per_mm = 20, gap_mm = 1e-4 }", 1e-4),
        ("barrier = { kpa_per_mm = 20, range_mm = 0.04 }", 0.0),
        ("smooth = { kpa_per_mm = 20, range_mm = 0.05 }", 0.2),
    ] {
        let name = law.split(' ').next().unwrap_or_default();
        let model = build(&block_over_a_sphere(law)).unwrap_or_else(|error| panic!("{error}")).model;
        let mut solver = solver(&model);
        let mut state = model.rest();
        let mut first: Option<risorius::model::State> = None;
        for round in 0..5 {
            let pressed = stable(&format!("{name}: pressed, round {round}"), &mut solver, &state, &drive(&[], 1.0));
            let contact = contact_states(&model, &pressed.state)[0];
            assert!(contact.area > 0.0 && contact.force[2] > 0.0, "{name}: {contact:?}");
            assert!(contact.penetration <= allowed, "{name}: {} mm deep", contact.penetration);
            if let Some(first) = &first {
                let drift = difference(first, &pressed.state);
                // multipliers come as close as their tolerance of 1e-4 mm
                assert!(drift < if name == "augmented" { 1e-3 } else { 1e-6 }, "{name}: drifted by {drift:.1e}");
            }
            first.get_or_insert(pressed.state.clone());
            let lifted =
                stable(&format!("{name}: lifted, round {round}"), &mut solver, &pressed.state, &drive(&[], -1.0));
            let contact = contact_states(&model, &lifted.state)[0];
            assert_eq!((contact.area, contact.max_pressure), (0.0, 0.0), "{name}: {contact:?}");
            state = lifted.state;
        }
    }
}

/// Contact that was eased on the way is that of its law in the end, and the state the one that Newton's method finds without.
#[test]
fn eased_contact_ends_as_its_law_says() {
    let model = build(&block_over_a_sphere("smooth = { kpa_per_mm = 20, range_mm = 0.05 }")).expect("a model").model;
    let mut solver = solver(&model);
    let pressed = stable("eased", &mut solver, &model.rest(), &drive(&[], 1.0));
    let kinds: Vec<StepKind> = pressed.history.iter().map(|step| step.kind).collect();
    let hardened = kinds.iter().position(|kind| *kind == StepKind::Hardened).expect("contact is hardened");
    assert!(hardened > 0 && kinds[..hardened].iter().all(|kind| *kind == StepKind::Walked), "{kinds:?}");
    assert!(kinds[hardened..].iter().all(|kind| *kind == StepKind::Hardened), "{kinds:?}");
    assert_eq!(pressed.state.easing, 0.0);
    let again = solver.equilibrium_near(&pressed.state, &pressed.state, &drive(&[], 1.0)).expect("an equilibrium");
    assert_eq!(again.state, pressed.state);
    // from nearby there is nothing to ease
    let less = stable("less", &mut solver, &pressed.state, &drive(&[], 0.98));
    let near = solver.equilibrium_near(&less.state, &less.state, &drive(&[], 1.0)).expect("an equilibrium");
    assert!(near.history.iter().all(|step| step.kind == StepKind::Walked));
    let apart = difference(&near.state, &pressed.state);
    assert!(apart < 1e-6, "{apart:.1e}");
    let eased = risorius::model::State { easing: 0.5, ..pressed.state.clone() };
    let [hard, soft] = [&pressed.state, &eased].map(|state| contact_states(&model, state)[0].force[2]);
    assert!(soft < 0.5 * hard, "{soft} of {hard}");
}

/// Where Newton's method does not find contact from a guess, it is eased there, and no path is walked.
#[test]
fn contact_is_eased_near_a_guess() {
    let model =
        build(&block_over_a_sphere("smooth = { kpa_per_mm = 2000, range_mm = 0.005 }")).expect("a model").model;
    let lifted = stable("lifted", &mut solver(&model), &model.rest(), &drive(&[], -1.0)).state;
    let near = solver(&model).equilibrium_near(&model.rest(), &lifted, &drive(&[], 1.0)).expect("an equilibrium");
    let steps: Vec<(StepKind, f64)> = near.history.iter().map(|step| (step.kind, step.place)).collect();
    assert_eq!(steps[0], (StepKind::Walked, 1.0), "{steps:?}");
    assert!(steps.len() > 1 && steps[1..].iter().all(|step| step.0 == StepKind::Hardened), "{steps:?}");
    assert_eq!(near.state.easing, 0.0);
    let walked = stable("walked", &mut solver(&model), &lifted, &drive(&[], 1.0));
    assert!(walked.history[0].place < 1.0, "the path has more steps than one");
    let apart = difference(&near.state, &walked.state);
    assert!(apart < 1e-6, "{apart:.1e}");
}
