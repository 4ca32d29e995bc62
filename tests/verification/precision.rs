//! A factor in single precision: the same equilibria and sensitivities, as solutions are refined in double precision.

use super::support::assert_close;
use risorius::fit::sensitivity::{Sensitivity, sensitivities};
use risorius::forward::{Drive, Settings, Solver};
use risorius::math::factor::Precision;
use risorius::model::build::build;
use risorius::scene::Scene;
use std::path::Path;

#[test]
fn a_factor_in_single_precision_changes_no_answer() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/slab/problem.toml");
    let scene = Scene::read(&path, &["muscle.slab.fibre_angles_deg=[36, 0, 0]".into()]).expect("a scene");
    let model = build(&scene).expect("a model").model;
    let to = Drive { controls: vec![0.1], load: 1.0 };
    let [double, single] = [Precision::Double, Precision::Single].map(|precision| {
        let settings = Settings { tolerance: 1e-11, precision, ..Settings::default() };
        let mut solver = Solver::new(&model, settings).expect("memory");
        let found = solver.equilibrium(&model.rest(), &to).unwrap_or_else(|failure| panic!("{}", failure.error));
        let by = sensitivities(Sensitivity::Tangent, &mut solver, &found, &[0]).expect("sensitivities");
        (found.state, by, solver.work())
    });
    let flat = |u: &[[f64; 3]]| u.concat();
    assert_close("displacement", flat(&double.0.u), flat(&single.0.u), 1e-9);
    assert_close("sensitivities", double.1[0].clone(), single.1[0].clone(), 1e-9);
    assert!(single.2.linear.sweeps > double.2.linear.sweeps, "it was refined");
    assert!(single.2.iterations <= double.2.iterations + 2, "{} and {}", single.2.iterations, double.2.iterations);
}
