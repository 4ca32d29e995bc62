//! Are known fibre fields found again from axes, and is what the data do not say told?

mod tricubic;
mod zinc;

use crate::common;
use crate::common::Random;
use risorius::fibres::{Axis, FibreFit, fit};
use risorius::math::tensor::{Vector, add_scaled, cross, dot, norm, normalised};
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::exf::{ExFile, write_angles, write_mesh};
use risorius::mesh::fibre_angles::{FibreAngles, axes};
use risorius::mesh::{MaterialPoint, Mesh};
use risorius::scene::{
    AnglesSpec, BlockSpec, FibreBody, FibreDataSpec, FibreProblem, FieldSpec, FixedNodeSpec, GeometrySpec, LossSpec,
    MeshSpec, OutsideSpec, SmoothnessSpec, Units,
};
use risorius::{Place, error::Error};
use std::collections::BTreeMap;
use std::f64::consts::PI;

const DEGREE: f64 = PI / 180.0;

/// A problem of a mesh that is built by hand.
fn problem(angles: AnglesSpec) -> FibreProblem {
    let place = Place::whole("fibres.toml");
    let block = BlockSpec { origin_mm: [0.0; 3], size_mm: [1.0; 3], elements: [1; 3] };
    FibreProblem {
        name: "test".into(),
        body: FibreBody::Mesh(MeshSpec { geometry: GeometrySpec::Block(block), place: place.clone() }),
        angles,
        field: FieldSpec::Trilinear,
        data: Vec::new(),
        outside: OutsideSpec::Drop,
        smoothness: SmoothnessSpec::Gcv,
        loss: LossSpec::Quadratic,
        folds: 0,
        fixed: Vec::new(),
        place,
    }
}

fn names(mesh: &Mesh) -> Vec<i64> {
    (0..mesh.nodes as i64).collect()
}

fn fitted(problem: &FibreProblem, mesh: &Mesh, data: &[Axis]) -> FibreFit {
    fit(problem, mesh, &names(mesh), data).unwrap()
}

/// The three axes of a field of angles at a point.
fn directions(mesh: &Mesh, field: &FibreAngles, at: MaterialPoint) -> [Vector; 3] {
    axes(&mesh.jacobian(at), field.at(mesh, at.element, at.xi))
}

/// `per_element` random points in every element that `keep` keeps, with the axes of a field; sheets too. Signs are random.
fn sampled(mesh: &Mesh, field: &FibreAngles, per_element: usize, random: &mut Random) -> Vec<Axis> {
    let mut all = Vec::new();
    for element in 0..mesh.elements() {
        for _ in 0..per_element {
            let at = MaterialPoint { element, xi: random.xi() };
            let [fibre, sheet, _] = directions(mesh, field, at);
            let mut flipped = |v: Vector| if random.next() < 0.0 { v.map(|c| -c) } else { v };
            let (fibre, sheet) = (flipped(fibre), flipped(sheet));
            let group = all.len() as u32;
            all.push(Axis { position: mesh.position(at), fibre, sheet: Some(sheet), weight: 1.0, group });
        }
    }
    all
}

/// A unit vector turned by an angle of normal distribution in each direction across it.
fn disturbed(v: Vector, sd: f64, random: &mut Random) -> Vector {
    let mut normal = || (0..12).map(|_| random.between(0.0, 1.0)).sum::<f64>() - 6.0;
    let side = normalised(if v[0].abs() < 0.7 { cross(v, [1.0, 0.0, 0.0]) } else { cross(v, [0.0, 1.0, 0.0]) });
    let (a, b) = (sd * normal(), sd * normal());
    normalised(add_scaled(add_scaled(v, a.tan(), side), b.tan(), cross(v, side)))
}

/// The angle between two lines, degrees.
fn apart(a: Vector, b: Vector) -> f64 {
    norm(cross(a, b)).atan2(dot(a, b).abs()) / DEGREE
}

/// The angles between fitted and true fibres at random points, degrees, sorted.
fn errors(mesh: &Mesh, truth: &FibreAngles, fit: &FibreFit, random: &mut Random) -> Vec<f64> {
    let shift = fit.chart;
    let mut all = Vec::new();
    for element in 0..mesh.elements() {
        for _ in 0..20 {
            let xi = random.xi();
            let there = MaterialPoint { element, xi: std::array::from_fn(|d| xi[(d + shift) % 3]) };
            let found = directions(&fit.mesh, &fit.angles, there)[0];
            all.push(apart(directions(mesh, truth, MaterialPoint { element, xi })[0], found));
        }
    }
    all.sort_by(f64::total_cmp);
    all
}

fn most(errors: &[f64]) -> f64 {
    errors[errors.len() - 1]
}

fn slab() -> Mesh {
    block(&Trilinear, [4.5, 2.0, 14.2], [50.0, 16.0, 4.0], [5, 2, 1])
}

/// Angles in degrees from the position of every node.
fn field(mesh: &Mesh, angles: impl Fn(Vector) -> [f64; 3]) -> FibreAngles {
    let per_node = mesh.element.parameters_per_node();
    let at = |node: usize| angles(mesh.parameters[node * per_node]).map(|degrees| degrees * DEGREE);
    FibreAngles::at_nodes((0..mesh.nodes).map(at).collect())
}

/// The field found in data without noise is the true one within 1e-6 degrees.
fn recovers(name: &str, mesh: &Mesh, truth: &FibreAngles, angles: AnglesSpec, seed: u64) -> FibreFit {
    let mut random = Random::new(seed);
    let data = sampled(mesh, truth, 60, &mut random);
    let fit = fitted(&problem(angles), mesh, &data);
    let most = most(&errors(mesh, truth, &fit, &mut random));
    println!("{name}: {most:.1e} degrees at most, smoothness {:.0e}, {} steps", fit.smoothness, fit.steps);
    assert!(fit.converged && most < 1e-6, "{name}: {most:e} degrees");
    assert!(fit.nodes.iter().all(|node| node.determined), "{name}");
    fit
}

#[test]
fn known_fields_are_found_again() {
    let mesh = slab();
    recovers("36 degrees", &mesh, &field(&mesh, |_| [36.0, 0.0, 0.0]), AnglesSpec::AB, 1);
    recovers("36 degrees, A alone", &mesh, &field(&mesh, |_| [36.0, 0.0, 0.0]), AnglesSpec::A, 2);
    let fan = field(&mesh, |[x, y, _]| [(y - 10.0).atan2(70.0 - x) / DEGREE, 0.0, 0.0]);
    recovers("fan", &mesh, &fan, AnglesSpec::AB, 3);
    // 120 degrees through the thickness of one element, where the nearer way between the two axes would be the wrong one
    let helix = |z: f64| 120.0 * (z - 14.2) / 4.0 - 60.0;
    let helix_field = field(&mesh, |[_, _, z]| [helix(z), 0.0, 0.0]);
    let fit = recovers("helix", &mesh, &helix_field, AnglesSpec::AB, 4);
    assert!(fit.angles.own.is_empty());
    let wall = block(&TricubicHermite, [0.0; 3], [20.0, 20.0, 9.0], [2, 2, 3]);
    recovers(
        "helix in a wall",
        &wall,
        &field(&wall, |[_, _, z]| [120.0 * z / 9.0 - 60.0, 0.0, 0.0]),
        AnglesSpec::AB,
        5,
    );
    let tipped =
        field(&mesh, |[x, y, z]| [50.0 * (x / 30.0).sin() + 2.0 * y, 25.0 - 0.5 * x + 3.0 * (z - 16.0), 0.0]);
    recovers("B is not 0", &mesh, &tipped, AnglesSpec::AB, 6);
}

/// On curved elements, and with sheets: the angles themselves.
#[test]
fn nodal_angles_are_found_again() {
    let mesh = common::curved_block(&TricubicHermite, [3, 2, 2], 0.03, 7);
    let mut random = Random::new(8);
    let truth = FibreAngles::at_nodes((0..mesh.nodes).map(|_| random.triple().map(|x| 0.6 * x)).collect());
    let data = sampled(&mesh, &truth, 120, &mut random);
    let fit = fitted(&problem(AnglesSpec::ABG), &mesh, &data);
    let apart = |k: usize| {
        let pairs = fit.angles.nodes.iter().zip(&truth.nodes);
        pairs.map(|(a, b)| (a[k] - b[k]).abs()).fold(0.0, f64::max)
    };
    let apart = [apart(0), apart(1), apart(2)];
    println!("nodal angles: {:.1e}, {:.1e}, {:.1e} rad apart", apart[0], apart[1], apart[2]);
    assert!(apart.iter().all(|apart| *apart < 1e-6), "{apart:?}");
    assert!(fit.sheets.unwrap().most < 1e-6);
}

/// A square ring of 3 x 3 elements without the middle one, each with xi1 along x: the fibres go around.
fn ring() -> (Mesh, FibreAngles) {
    let whole = block(&Trilinear, [-15.0, -15.0, 0.0], [30.0, 30.0, 4.0], [3, 3, 1]);
    let corners: Vec<[usize; 8]> = (0..9).filter(|e| *e != 4).map(|e| whole.corners[e]).collect();
    let mesh = Mesh::new(&Trilinear, whole.parameters.clone(), corners);
    let angle = |node: usize| {
        let [x, y, _] = mesh.parameters[node];
        y.atan2(x) + 0.5 * PI
    };
    let nodes: Vec<[f64; 3]> = (0..mesh.nodes).map(|node| [angle(node), 0.0, 0.0]).collect();
    // every element continues from its own first corner
    let own = (0..mesh.elements()).map(|e| {
        let first = angle(mesh.corners[e][0]);
        let corner = |node: usize| [first + (angle(node) - first + PI).rem_euclid(2.0 * PI) - PI, 0.0, 0.0];
        (e, mesh.corners[e].map(corner))
    });
    let own: BTreeMap<usize, [[f64; 3]; 8]> = own.collect();
    (mesh, FibreAngles { nodes, own, tricubic: None })
}

#[test]
fn a_ring_turns_around() {
    let (mesh, truth) = ring();
    let fit = recovers("ring", &mesh, &truth, AnglesSpec::AB, 9);
    println!("{} of {} elements have angles of their own", fit.angles.own.len(), mesh.elements());
    // 360 degrees around, and axes are the same after 180: somewhere the angles cannot close
    assert!((1..=2).contains(&fit.angles.own.len()));
    assert!(fit.warnings.iter().any(|warning| warning.code == "F009"));
    // the EX file keeps it
    let text = write_mesh(&mesh, &[("coordinates", &mesh.parameters)]) + &write_angles(&mesh, "fibres", &fit.angles);
    // Zinc refuses a second definition of a template
    let mut definitions: Vec<&str> = text.lines().filter(|line| line.starts_with("Define")).collect();
    definitions.sort_unstable();
    assert!(definitions.len() == 6 && definitions.windows(2).all(|pair| pair[0] != pair[1]), "{definitions:?}");
    let file = ExFile::parse(&text, "ring.exf").unwrap();
    let geometry = file.geometry(None).unwrap();
    let read = file.angles("fibres", &geometry).unwrap();
    let mut random = Random::new(10);
    for element in 0..mesh.elements() {
        let at = MaterialPoint { element, xi: random.xi() };
        let angle = apart(directions(&mesh, &truth, at)[0], directions(&geometry.mesh, &read, at)[0]);
        assert!(angle < 1e-6, "element {element}: {angle}");
    }
}

#[test]
fn fibres_along_f3_are_looked_at_from_another_side() {
    let mesh = block(&TricubicHermite, [0.0; 3], [10.0, 12.0, 30.0], [1, 2, 3]);
    let mut random = Random::new(11);
    let axis_at = |[x, y, z]: Vector| normalised([0.3 * (z / 9.0).sin(), 0.02 * x, 1.0 + 0.01 * y]);
    let data: Vec<Axis> = (0..2000)
        .map(|group| {
            let position = [random.between(0.0, 10.0), random.between(0.0, 12.0), random.between(0.0, 30.0)];
            Axis { position, fibre: axis_at(position), sheet: None, weight: 1.0, group }
        })
        .collect();
    let found = fitted(&problem(AnglesSpec::AB), &mesh, &data);
    println!(
        "chart {}, median {:.2e}, most {:.2e} degrees",
        found.chart,
        found.spread.median / DEGREE,
        found.spread.most / DEGREE
    );
    assert!(found.chart != 0);
    // the field is not trilinear in angles; as it is smooth, it is nearly
    assert!(found.spread.most < 3.0 * DEGREE && found.nodes.iter().all(|node| node.angles[1].abs() < 1.2));
    // a fixed node keeps its axis, not its angles
    let fixed = FixedNodeSpec { node: 0, angles_deg: [0.0, -80.0, 0.0], place: Place::whole("fibres.toml") };
    let problem = FibreProblem { fixed: vec![fixed], ..problem(AnglesSpec::AB) };
    let found = fitted(&problem, &mesh, &data);
    let start = MaterialPoint { element: 0, xi: [0.0; 3] };
    let kept = directions(&found.mesh, &found.angles, start)[0];
    let given = axes(&mesh.jacobian(start), [0.0, -80.0 * DEGREE, 0.0])[0];
    assert!(apart(kept, given) < 1e-9 && found.nodes[0].fixed);
}

#[test]
fn noise_averages_out() {
    let mesh = slab();
    let truth = field(&mesh, |[x, y, _]| [(y - 10.0).atan2(70.0 - x) / DEGREE, 10.0, 0.0]);
    let mut rms = Vec::new();
    println!("axes per node   rms error, deg   times sqrt(n)");
    for per_element in [30, 120, 480] {
        let mut squares = Vec::new();
        for seed in 0..8 {
            let mut random = Random::new(100 + seed);
            let mut data = sampled(&mesh, &truth, per_element, &mut random);
            data.iter_mut().for_each(|axis| axis.fibre = disturbed(axis.fibre, 10.0 * DEGREE, &mut random));
            // without smoothness: the bare averaging
            let problem = FibreProblem { smoothness: SmoothnessSpec::Weight(1e-9), ..problem(AnglesSpec::AB) };
            let found = fitted(&problem, &mesh, &data);
            squares.extend(errors(&mesh, &truth, &found, &mut random).into_iter().map(|error| error * error));
            assert!((found.noise / DEGREE - 10.0).abs() < 1.0, "{}", found.noise / DEGREE);
        }
        let n = (per_element * mesh.elements()) as f64 / mesh.nodes as f64;
        let error = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        println!("{n:>13.1} {error:>16.3} {:>15.2}", error * n.sqrt());
        rms.push(error);
    }
    // four times the data, half the error
    for pair in rms.windows(2) {
        assert!((pair[0] / pair[1] - 2.0).abs() < 0.3, "{rms:?}");
    }
}

/// The smoothness that is chosen is near the best, the standard deviations are those of many repetitions, and the held-out error
/// that of the noise.
#[test]
fn the_smoothness_and_the_certainty_are_right() {
    let mesh = block(&Trilinear, [0.0; 3], [60.0, 20.0, 10.0], [8, 3, 2]);
    let truth = field(&mesh, |[x, y, _]| [30.0 * (x / 20.0).sin() + 0.5 * y, 0.2 * x, 0.0]);
    let noise = 10.0 * DEGREE;
    let data = |seed: u64| {
        let mut random = Random::new(seed);
        let mut data = sampled(&mesh, &truth, 12, &mut random);
        data.iter_mut().for_each(|axis| axis.fibre = disturbed(axis.fibre, noise, &mut random));
        data
    };
    let rms = |found: &FibreFit| {
        let all = errors(&mesh, &truth, found, &mut Random::new(5));
        (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt()
    };
    let base = FibreProblem { folds: 5, ..problem(AnglesSpec::AB) };
    let chosen = fitted(&base, &mesh, &data(1));
    let best = (-8..=3)
        .map(|power| {
            let smoothness = SmoothnessSpec::Weight(10_f64.powf(0.5 * f64::from(power)));
            rms(&fitted(&FibreProblem { smoothness, folds: 0, ..base.clone() }, &mesh, &data(1)))
        })
        .fold(f64::INFINITY, f64::min);
    let held_out = chosen.held_out.unwrap();
    println!(
        "smoothness {:.2e}: rms error {:.3}, best possible {best:.3} degrees; held out {:.2}, fit {:.2} degrees rms",
        chosen.smoothness,
        rms(&chosen),
        held_out.rms / DEGREE,
        chosen.spread.rms / DEGREE
    );
    assert!(rms(&chosen) < 1.15 * best);
    // two directions across the axis with 10 degrees each
    assert!((held_out.rms / DEGREE / (10.0 * 2_f64.sqrt()) - 1.0).abs() < 0.1);
    assert!(held_out.rms > chosen.spread.rms && held_out.count == chosen.spread.count);

    // without smoothness the standard deviation is that of repetitions
    let bare = FibreProblem { smoothness: SmoothnessSpec::Weight(1e-6), folds: 0, ..base };
    let runs: Vec<FibreFit> = (10..40).map(|seed| fitted(&bare, &mesh, &data(seed))).collect();
    let (mut seen, mut told) = (0.0, 0.0);
    for node in 0..mesh.nodes {
        let values: Vec<f64> = runs.iter().map(|run| run.nodes[node].angles[0] - truth.nodes[node][0]).collect();
        seen += values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        told += runs.iter().map(|run| run.nodes[node].sd[0].unwrap().powi(2)).sum::<f64>() / runs.len() as f64;
    }
    println!(
        "sd of A over all nodes: {:.3} told, {:.3} degrees seen in 30 repetitions",
        (told / mesh.nodes as f64).sqrt() / DEGREE,
        (seen / mesh.nodes as f64).sqrt() / DEGREE
    );
    assert!(((told / seen).sqrt() - 1.0).abs() < 0.15);
}

#[test]
fn outliers_are_outvoted() {
    let mesh = slab();
    let truth = field(&mesh, |[x, y, _]| [(y - 10.0).atan2(70.0 - x) / DEGREE + 20.0, 5.0, 0.0]);
    let mut random = Random::new(20);
    let mut data = sampled(&mesh, &truth, 60, &mut random);
    for axis in &mut data {
        axis.fibre = match random.between(0.0, 1.0) {
            // not random but all alike, which is worse
            part if part < 0.15 => normalised([-0.2, 1.0, 0.3]),
            part if part < 0.3 => normalised(random.triple()),
            _ => disturbed(axis.fibre, 5.0 * DEGREE, &mut random),
        };
    }
    let median = |loss: LossSpec| {
        let found = fitted(&FibreProblem { loss, ..problem(AnglesSpec::AB) }, &mesh, &data);
        let all = errors(&mesh, &truth, &found, &mut Random::new(21));
        all[all.len() / 2]
    };
    let [cauchy, huber, quadratic] =
        [LossSpec::CauchyDeg(8.0), LossSpec::HuberDeg(5.0), LossSpec::Quadratic].map(median);
    println!(
        "30 % outliers: median error {cauchy:.2} (Cauchy), {huber:.2} (Huber), {quadratic:.2} (quadratic) degrees"
    );
    assert!(cauchy < 3.0 && cauchy < huber && huber < quadratic);

    // the standard deviations are those of repetitions under robust losses too
    for loss in [LossSpec::CauchyDeg(8.0), LossSpec::HuberDeg(5.0)] {
        let (mut told, mut values) = (0.0, vec![Vec::new(); mesh.nodes]);
        for seed in 0..30 {
            let mut random = Random::new(200 + seed);
            let mut data = sampled(&mesh, &truth, 200, &mut random);
            for axis in &mut data {
                let outlier = random.next() < -0.4;
                axis.fibre = if outlier {
                    normalised(random.triple())
                } else {
                    disturbed(axis.fibre, 5.0 * DEGREE, &mut random)
                };
            }
            let smoothness = SmoothnessSpec::Weight(1e-6);
            let found = fitted(&FibreProblem { loss, smoothness, ..problem(AnglesSpec::AB) }, &mesh, &data);
            for (values, node) in values.iter_mut().zip(&found.nodes) {
                // half turns are no difference
                let off = node.angles[0] - truth.nodes[node.name as usize][0];
                values.push((off + 0.5 * PI).rem_euclid(PI) - 0.5 * PI);
                told += node.sd[0].unwrap().powi(2);
            }
        }
        let variance = |values: &Vec<f64>| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
        };
        let seen = values.iter().map(variance).sum::<f64>();
        let [told, seen] = [told / 30.0, seen].map(|sum| (sum / mesh.nodes as f64).sqrt() / DEGREE);
        println!("{loss:?}: sd of A {told:.3} told, {seen:.3} degrees seen");
        assert!((told / seen - 1.0).abs() < 0.15, "{loss:?}");
    }
}

#[test]
fn what_has_no_data_is_not_invented() {
    let mesh = block(&Trilinear, [0.0; 3], [60.0, 20.0, 10.0], [6, 2, 1]);
    // uniform: the smoothest possible continuation is even right, and still nothing that the data say
    let truth = field(&mesh, |_| [36.0, 0.0, 0.0]);
    for noise in [0.0, 10.0 * DEGREE] {
        let mut random = Random::new(30);
        let mut data = sampled(&mesh, &truth, 40, &mut random);
        data.retain(|axis| axis.position[0] < 30.0);
        data.iter_mut().for_each(|axis| axis.fibre = disturbed(axis.fibre, noise, &mut random));
        let found = fitted(&problem(AnglesSpec::AB), &mesh, &data);
        for node in &found.nodes {
            assert_eq!(node.determined, node.position[0] < 31.0, "{node:?}");
        }
        let warning = found.warnings.iter().find(|warning| warning.code == "F007").unwrap();
        println!("{}", warning.message);
        assert!(warning.message.contains("18 of 42 nodes"));
    }
}

#[test]
fn points_outside_are_counted_dropped_or_projected() {
    let mesh = slab();
    let truth = field(&mesh, |_| [36.0, 0.0, 0.0]);
    let mut data = sampled(&mesh, &truth, 20, &mut Random::new(40));
    let fibre = data[0].fibre;
    for (group, distance) in [0.5, 2.0].into_iter().enumerate() {
        let position = [20.0, 10.0, 18.2 + distance];
        data.push(Axis { position, fibre, sheet: None, weight: 1.0, group: group as u32 });
    }
    let dropped = fitted(&problem(AnglesSpec::AB), &mesh, &data);
    assert_eq!((dropped.outside.count, dropped.outside.projected, dropped.spread.count), (2, 0, 200));
    assert!((dropped.outside.distance[0] - 0.5).abs() < 1e-9 && (dropped.outside.distance[1] - 2.0).abs() < 1e-9);
    let near = FibreProblem { outside: OutsideSpec::ProjectMm(1.0), ..problem(AnglesSpec::AB) };
    let projected = fitted(&near, &mesh, &data);
    assert_eq!((projected.outside.count, projected.outside.projected, projected.spread.count), (2, 1, 201));
    let none = fit(&problem(AnglesSpec::AB), &mesh, &names(&mesh), &data[200..]).unwrap_err();
    assert!(matches!(none, Error::NoAxes { count: 2, .. }) && none.code() == "K005");
}

/// Fixed nodes stay, their neighbours follow the data.
#[test]
fn fixed_nodes_stay() {
    let mesh = slab();
    let truth = field(&mesh, |_| [36.0, 0.0, 0.0]);
    let data = sampled(&mesh, &truth, 60, &mut Random::new(50));
    let place = Place::whole("fibres.toml");
    let fixed = |node| FixedNodeSpec { node, angles_deg: [60.0, -10.0, 0.0], place: place.clone() };
    let found = fitted(&FibreProblem { fixed: vec![fixed(7)], ..problem(AnglesSpec::AB) }, &mesh, &data);
    let node = &found.nodes[7];
    assert!((node.angles[0] - 60.0 * DEGREE).abs() < 1e-12 && (node.angles[1] + 10.0 * DEGREE).abs() < 1e-12);
    assert_eq!((node.fixed, node.sd[0]), (true, Some(0.0)));
    assert!((found.nodes[5].angles[0] - 36.0 * DEGREE).abs() < 0.1 * DEGREE);
    let wrong = FibreProblem { fixed: vec![fixed(36)], ..problem(AnglesSpec::AB) };
    let error = fit(&wrong, &mesh, &names(&mesh), &data).unwrap_err();
    assert_eq!(error.code(), "C009");
    assert!(error.help().unwrap().contains("from 0 to 35"), "{:?}", error.help());
}

/// The same bits for any number of threads.
#[test]
fn threads_do_not_matter() {
    let mesh = slab();
    let mut random = Random::new(60);
    let truth = field(&mesh, |[x, ..]| [x, 10.0, 0.0]);
    let mut data = sampled(&mesh, &truth, 100, &mut random);
    data.iter_mut().for_each(|axis| axis.fibre = disturbed(axis.fibre, 0.1, &mut random));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&FibreProblem { folds: 5, ..problem(AnglesSpec::AB) }, &mesh, &data))
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one.angles.nodes, three.angles.nodes);
    assert_eq!(one.nodes, three.nodes);
    assert_eq!(one.held_out, three.held_out);
}

/// Writes a file of a temporary folder and reads it as measurements in mm.
fn read(name: &str, contents: &[u8], field: Option<&str>) -> Result<risorius::fibres::Axes, Error> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(name);
    std::fs::write(&file, contents).unwrap();
    let place = Place::whole("fibres.toml");
    let spec = FibreDataSpec { file, units: Units::Mm, field: field.map(str::to_owned), weight: 1.0, place };
    risorius::fibres::data::read(&[spec])
}

#[test]
fn tables_are_read() {
    let text = "x,y,z,vx,vy,vz,sd_deg,trace\n1,2,3,0,0,2,10,a\n\n1,2,4,0,1,0,5,b\n1,2,5,0,0,0,5,a\n";
    let axes = read("axes.csv", text.as_bytes(), None).unwrap();
    assert_eq!((axes.all.len(), axes.empty), (2, 1));
    assert_eq!((axes.all[0].position, axes.all[0].fibre), ([1.0, 2.0, 3.0], [0.0, 0.0, 2.0]));
    // half the standard deviation, four times the weight; 1 on average
    assert!((axes.all[0].weight - 0.4).abs() < 1e-12 && (axes.all[1].weight - 1.6).abs() < 1e-12);
    assert_eq!((axes.all[0].group, axes.all[1].group), (0, 1));
    let sheets = "x,y,z,vx,vy,vz,sx,sy,sz\n1,2,3,0,0,1,1,0,0\n1,2,3,0,0,1,,,\n";
    let axes = read("axes.csv", sheets.as_bytes(), None).unwrap();
    assert_eq!(axes.all.iter().map(|axis| axis.sheet).collect::<Vec<_>>(), [Some([1.0, 0.0, 0.0]), None]);
    let traces = "trace,x,y,z\n1,0,0,0\n1,1,0,0\n1,1,3,0\n2,5,5,5\n2,5,5,6\n";
    let axes = read("traces.csv", traces.as_bytes(), None).unwrap();
    assert_eq!(
        axes.all.iter().map(|axis| axis.position).collect::<Vec<_>>(),
        [[0.5, 0.0, 0.0], [1.0, 1.5, 0.0], [5.0, 5.0, 5.5]]
    );
    assert_eq!(axes.all[1].fibre, [0.0, 2.0 + 1.0, 0.0]);
    // pieces count by their length
    assert!((axes.all[1].weight / axes.all[0].weight - 3.0).abs() < 1e-12);
    assert_eq!(axes.all.iter().map(|axis| axis.group).collect::<Vec<_>>(), [0, 0, 1]);
    let wrong = read("axes.csv", b"x,y,z,vx,vy,vz\n1,2,3,0,0,1,7\n1,2,oops,0,0,1\n", None).unwrap_err();
    let told: Vec<(&str, u32)> = match &wrong {
        Error::Mistakes(all) => all.iter().map(|error| (error.code(), error.place().unwrap().line)).collect(),
        other => panic!("{other}"),
    };
    assert_eq!(told, [("C007", 2), ("C004", 3)]);
    let wrong = read("axes.csv", b"x,y,z,vx,vy,colour\n1,2,3,0,0,1\n", None).unwrap_err().to_string();
    assert!(wrong.contains("colour") && wrong.contains("`vz`"), "{wrong}");
    assert_eq!(read("axes.csv", b"x,y,z,vx,vy,vz\n", None).unwrap_err().code(), "C007");
    assert_eq!(read("axes.csv", b"x,y,z,vx,vy,vz,weight\n1,2,3,0,0,1,-1\n", None).unwrap_err().code(), "C004");
}

/// The same two vectors, at points or cells, in every way that VTK stores them; tensors; lines.
#[test]
fn files_of_vtk_are_read() {
    let expected = [([0.5, 1.0, 2.0], [1.0, 0.0, 0.5]), ([3.0, 1.0, 2.0], [0.0, -2.0, 0.25])];
    let check = |name: &str, contents: &[u8], field: Option<&str>| {
        let axes = read(name, contents, field).unwrap_or_else(|error| panic!("{name}: {error}"));
        let pairs: Vec<(Vector, Vector)> = axes.all.iter().map(|axis| (axis.position, axis.fibre)).collect();
        assert_eq!(pairs, expected, "{name}");
    };
    let points = "POINTS 2 float\n0.5 1 2 3 1 2\n";
    let legacy = |rest: &str| format!("# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET POLYDATA\n{points}{rest}");
    check(
        "a.vtk",
        legacy("POINT_DATA 2\nSCALARS other float\nLOOKUP_TABLE default\n1 2\nVECTORS v float\n1 0 0.5\n0 -2 0.25\n")
            .as_bytes(),
        None,
    );
    check(
        "b.vtk",
        legacy("POINT_DATA 2\nFIELD data 2\nv 3 2 double\n1 0 0.5 0 -2 0.25\nw 3 2 double\n1 1 1 1 1 1\n").as_bytes(),
        Some("v"),
    );
    let cells = legacy("VERTICES 2 4\n1 0 1 1\nCELL_DATA 2\nVECTORS v float\n1 0 0.5\n0 -2 0.25\n");
    check("c.vtk", cells.as_bytes(), None);
    let version_5 = legacy(
        "VERTICES 3 2\nOFFSETS vtktypeint64\n0 1 2\nCONNECTIVITY vtktypeint64\n0 1\nMETADATA\nINFORMATION 0\n\nCELL_DATA 2\nVECTORS v float\n1 0 0.5\n0 -2 0.25\n",
    );
    check("d.vtk", version_5.as_bytes(), None);
    let mut binary = b"# vtk DataFile Version 3.0\ntitle\nBINARY\nDATASET POLYDATA\nPOINTS 2 double\n".to_vec();
    let big = |numbers: &[f64]| numbers.iter().flat_map(|x| x.to_be_bytes()).collect::<Vec<u8>>();
    binary.extend(big(&[0.5, 1.0, 2.0, 3.0, 1.0, 2.0]));
    binary.extend(b"\nPOINT_DATA 2\nVECTORS v double\n");
    binary.extend(big(&[1.0, 0.0, 0.5, 0.0, -2.0, 0.25]));
    check("e.vtk", &binary, None);
    let grid = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 1 1\nORIGIN 0.5 1 2\nSPACING 2.5 1 1\nPOINT_DATA 2\nVECTORS v float\n1 0 0.5\n0 -2 0.25\n";
    check("f.vtk", grid.as_bytes(), None);

    let xml = |kind: &str, points: &str, v: &str, more: &str| {
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt32\"{more}>\n<{kind}>\n<Piece NumberOfPoints=\"2\">\n<PointData>\n{v}</PointData>\n<Points>\n{points}</Points>\n</Piece>\n</{kind}>\n</VTKFile>\n"
        )
    };
    let array = |name: &str, format: &str, text: &str| {
        format!(
            "<DataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"3\" format=\"{format}\">{text}</DataArray>\n"
        )
    };
    check(
        "g.vtp",
        xml(
            "PolyData",
            &array("Points", "ascii", "0.5 1 2 3 1 2"),
            &array("v", "ascii", "\n1 0 0.5\n0 -2 0.25\n"),
            "",
        )
        .as_bytes(),
        None,
    );
    // 48 bytes of numbers after their count, written by an encoder that is not ours (python: base64.b64encode)
    let in_base64 = "MAAAAAAAAAAAAPA/AAAAAAAAAAAAAAAAAADgPwAAAAAAAAAAAAAAAAAAAMAAAAAAAADQPw==";
    check(
        "h.vtu",
        xml("UnstructuredGrid", &array("Points", "ascii", "0.5 1 2 3 1 2"), &array("v", "binary", in_base64), "")
            .as_bytes(),
        None,
    );
    // what the program itself writes: appended, compressed
    use risorius::report::vtu::{Field, Grid};
    let grid = Grid::vertices(
        0.0,
        expected.map(|e| e.0).to_vec(),
        vec![Field::vectors("v", expected.map(|e| e.1).to_vec())],
    );
    check("i.vtu", &risorius::report::vtu::xml::file(&grid, &mut Default::default()).unwrap(), None);

    // a tensor that is longest along (1, 1, 0), and one without direction
    let tensors = "POINT_DATA 2\nTENSORS d float\n2 1 0\n1 2 0\n0 0 1\n\n1 0 0\n0 1 0\n0 0 1\n";
    let axes = read("j.vtk", legacy(tensors).as_bytes(), None).unwrap();
    assert_eq!((axes.all.len(), axes.empty), (1, 1));
    assert!(apart(axes.all[0].fibre, [1.0, 1.0, 0.0]) < 1e-9);
    let lines = legacy("LINES 1 3\n2 0 1\n");
    let axes = read("k.vtk", lines.as_bytes(), None).unwrap();
    assert_eq!((axes.all.len(), axes.all[0].fibre, axes.all[0].position), (1, [2.5, 0.0, 0.0], [1.75, 1.0, 2.0]));

    for (name, contents, says) in [
        ("l.vtk", "# vtk\n".to_string(), "does not start with"),
        ("m.vtk", legacy("POINT_DATA 2\nVECTORS v float\n1 0\n"), "ends before"),
        (
            "n.vtk",
            legacy("POINT_DATA 2\nVECTORS v float\n1 0 1 1 1 1\nVECTORS w float\n1 0 1 1 1 1\n"),
            "several fields",
        ),
        ("o.vtk", legacy(""), "no field of vectors"),
        ("p.vtu", "<html></html>".into(), "no VTKFile"),
        ("q.vtu", xml("UnstructuredGrid", "", &array("v", "binary", "MAAA"), ""), "cut short"),
        ("r.vtu", xml("UnstructuredGrid", "", "", " compressor=\"vtkLZ4DataCompressor\""), "zlib is read"),
    ] {
        let error = read(name, contents.as_bytes(), None).unwrap_err();
        assert_eq!(error.code(), "M014", "{name}: {error}");
        assert!(error.to_string().contains(says), "{name}: {error}");
    }
}

#[test]
fn points_of_ex_files_are_read() {
    use risorius::mesh::exf::{Points, write_points};
    let (at, fibre) = ([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [[0.0, 1.0, 0.5], [1.0, 0.0, 0.0]]);
    let fields =
        [Points::Vectors("coordinates", &at), Points::Vectors("fibre", &fibre), Points::Scalars("n", &[1.0, 2.0])];
    let text = "EX Version: 3\n".to_string() + &write_points("/data", &fields);
    let axes = read("points.exf", text.as_bytes(), None).unwrap();
    assert_eq!(
        axes.all.iter().map(|a| (a.position, a.fibre)).collect::<Vec<_>>(),
        [(at[0], fibre[0]), (at[1], fibre[1])]
    );
    assert!(read("points.exf", text.as_bytes(), Some("sheet")).unwrap_err().to_string().contains("but fibre"));
}

/// Few passes over the data, however many they are: `examples/million_axes.rs` has ten times as many, in 8 s (release build, idle cores).
#[test]
fn a_hundred_thousand_axes_take_few_steps() {
    let mesh = block(&TricubicHermite, [0.0; 3], [100.0, 80.0, 35.0], [10, 8, 7]);
    let truth = FibreAngles::uniform(&mesh, [20.0 * DEGREE, 5.0 * DEGREE, 0.0]);
    let mut random = Random::new(60);
    let mut data = sampled(&mesh, &truth, 180, &mut random);
    data.iter_mut().for_each(|axis| axis.fibre = disturbed(axis.fibre, 10.0 * DEGREE, &mut random));
    let found = fitted(&FibreProblem { folds: 5, ..problem(AnglesSpec::AB) }, &mesh, &data);
    let worst = most(&errors(&mesh, &truth, &found, &mut random));
    println!(
        "{} axes on {} elements: {} steps, {worst:.2} degrees off at most",
        data.len(),
        mesh.elements(),
        found.steps
    );
    assert!(found.steps <= 12 && worst < 3.0, "{} steps, {worst} degrees", found.steps);
}

/// From files to files with the program: a muscle's angles, and then the muscle with them.
#[test]
fn a_run_leaves_a_muscle_that_can_be_used() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mesh = slab();
    let truth = field(&mesh, |[x, y, _]| [(y - 10.0).atan2(90.0 - x) / DEGREE, 8.0, 0.0]);
    let mut table = "x,y,z,vx,vy,vz\n".to_string();
    for Axis { position: [x, y, z], fibre: [u, v, w], .. } in sampled(&mesh, &truth, 40, &mut Random::new(70)) {
        table += &format!("{x},{y},{z},{u},{v},{w}\n");
    }
    std::fs::write(path("axes.csv"), table).unwrap();
    let blemker = "blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }";
    let fibres = format!(
        "[task]\nkind = \"fibres\"\n[[muscle]]\nname = \"slab\"\nblock = {{ origin_mm = [4.5, 2.0, 14.2], size_mm = [50, 16, 4], \
         elements = [5, 2, 1] }}\nfibre_angles_deg = [0, 0, 0]\n{blemker}\n[fibres]\nmuscle = \"slab\"\n\
         [[fibres.data]]\nfile = \"axes.csv\"\nunits = \"mm\"\n"
    );
    std::fs::write(path("fibres.toml"), &fibres).unwrap();
    let risorius = |arguments: &[&str]| {
        let output = assert_cmd::Command::cargo_bin("risorius")
            .unwrap()
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code().unwrap(), text(&output.stdout) + &text(&output.stderr))
    };
    let (code, text) = risorius(&["check", "fibres.toml"]);
    assert!(code == 0 && text.contains("400 measured axes in 1 files"), "{text}");
    let (code, text) = risorius(&["run", "fibres.toml", "--out", "run"]);
    assert!(code == 0 && text.contains("held out"), "{text}");
    for file in [
        "status.json",
        "manifest.json",
        "summary.txt",
        "fibres.exf",
        "fibres.svg",
        "tables/fibre_angles.csv",
        "tables/fibre_errors.csv",
        "tables/fibre_elements.csv",
        "tables/fibre_smoothness.csv",
        "tables/fibre_fit.csv",
        "view/fibres.vtu",
        "view/streamlines.vtu",
        "view/measured.vtu",
    ] {
        assert!(path("run").join(file).metadata().is_ok_and(|file| file.len() > 40), "{file}");
    }
    // what was written is measured directions too, and those of the truth
    let place = Place::whole("fibres.toml");
    let spec = |field: Option<&str>, file: &str| FibreDataSpec {
        file: path("run").join(file),
        units: Units::Mm,
        field: field.map(str::to_owned),
        weight: 1.0,
        place: place.clone(),
    };
    let written = risorius::fibres::data::read(&[spec(Some("fibre"), "view/fibres.vtu")]).unwrap();
    assert_eq!(written.all.len(), 80);
    let lines = risorius::fibres::data::read(&[spec(None, "view/streamlines.vtu")]).unwrap();
    let refound = fitted(&problem(AnglesSpec::AB), &mesh, &lines.all);
    let all = errors(&mesh, &truth, &refound, &mut Random::new(71));
    println!("from its own streamlines: {:.3} degrees (median)", all[all.len() / 2]);
    assert!(all[all.len() / 2] < 0.5);

    let scene = |geometry: &str| {
        let text = format!(
            "[task]\nkind = \"forward\"\n[mesh]\nblock = {{ origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }}\n\
             [tissue]\nmooney-rivlin = {{ c1_kpa = 0.5, c2_kpa = 0.2 }}\n[[support]]\nclamp = {{ face = \"xi1=0\" }}\n\
             [[muscle]]\nname = \"slab\"\n{geometry}\n{blemker}\n"
        );
        std::fs::write(path("problem.toml"), text).unwrap();
        risorius::scene::Scene::read(&path("problem.toml"), &[]).unwrap()
    };
    let model =
        risorius::model::build::build(&scene("exf = \"run/fibres.exf\"\nangles_field = \"fibres\"")).unwrap().model;
    let (_, muscle) = model.muscles().next().unwrap();
    let locator = risorius::mesh::location::Locator::new(&mesh);
    for point in muscle.points() {
        let at = locator.locate(point.position).unwrap();
        let angle = apart(directions(&mesh, &truth, at)[0], point.fibre);
        assert!(angle < 1e-6, "{angle}");
    }

    // mistakes have their places
    std::fs::write(
        path("wrong.toml"),
        fibres.replace("muscle = \"slab\"\n[[", "muscle = \"slap\"\nfolds = 1\nangles = [\"B\"]\n[["),
    )
    .unwrap();
    let (code, text) = risorius(&["check", "wrong.toml"]);
    assert!(
        code == 3 && ["did you mean `slab`", "fibres.folds", "fibres.angles"].iter().all(|part| text.contains(part)),
        "{text}"
    );
}

/// The lock file of a run does the same again, to the last bit, and as a muscle its tricubic field can be used.
#[test]
fn a_lock_file_repeats_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mesh = slab();
    let truth = field(&mesh, |[x, y, _]| [(y - 10.0).atan2(70.0 - x) / DEGREE, 8.0, 0.0]);
    let mut random = Random::new(80);
    let mut table = "x,y,z,vx,vy,vz\n".to_string();
    for axis in sampled(&mesh, &truth, 60, &mut random) {
        let ([x, y, z], [u, v, w]) = (axis.position, disturbed(axis.fibre, 5.0 * DEGREE, &mut random));
        table += &format!("{x},{y},{z},{u},{v},{w}\n");
    }
    std::fs::write(path("axes.csv"), table).unwrap();
    let blemker = "blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }";
    let text = format!(
        "[task]\nkind = \"fibres\"\n[[muscle]]\nname = \"slab\"\nblock = {{ origin_mm = [4.5, 2.0, 14.2], size_mm = [50, 16, 4], \
         elements = [5, 2, 1] }}\nfibre_angles_deg = [0, 0, 0]\n{blemker}\n[fibres]\nmuscle = \"slab\"\nfield = \"tricubic\"\n\
         loss = {{ huber_deg = 8 }}\noutside = {{ project_mm = 1 }}\n[[fibres.data]]\nfile = \"axes.csv\"\nunits = \"mm\"\n\
         [[fibres.fixed]]\nnode = 3\nangles_deg = [10, 5, 0]\n"
    );
    std::fs::write(path("fibres.toml"), text).unwrap();
    let run = |file: &str, out: &str| {
        let mut command = assert_cmd::Command::cargo_bin("risorius").unwrap();
        command.current_dir(folder.path()).args(["run", file, "--out", out, "-q"]).assert().success();
    };
    run("fibres.toml", "once");
    // from another folder
    std::fs::create_dir(path("elsewhere")).unwrap();
    std::fs::copy(path("once/problem.lock.toml"), path("elsewhere/again.toml")).unwrap();
    run("elsewhere/again.toml", "twice");
    for file in ["problem.lock.toml", "fibres.exf", "tables/fibre_angles.csv", "tables/fibre_fit.csv", "summary.txt"]
    {
        let [once, twice] = ["once", "twice"].map(|run| std::fs::read(path(run).join(file)).unwrap());
        assert!(once == twice && !once.is_empty(), "{file}");
    }
    let lock = std::fs::read_to_string(path("once/problem.lock.toml")).unwrap();
    for line in
        ["field = \"tricubic\"", "folds = 5", "smoothness = \"gcv\"", "angles = [\"A\", \"B\"]", "weight = 1.0"]
    {
        assert!(lock.lines().any(|known| known == line), "{line}\n{lock}");
    }
    let angles = std::fs::read_to_string(path("once/tables/fibre_angles.csv")).unwrap();
    let fixed = angles.lines().nth(4).unwrap();
    assert!(fixed.starts_with("3,") && fixed.ends_with(",1,1"), "{fixed}");
    let file = ExFile::read(&path("once/fibres.exf")).unwrap();
    let geometry = file.geometry(None).unwrap();
    let kept = file.angles("fibres", &geometry).unwrap();
    assert!(kept.tricubic.is_some() && (kept.nodes[3][0] - 10.0 * DEGREE).abs() < 1e-12);
}

/// The problem that is shipped, against the fan that its data were made from.
#[test]
fn the_shipped_problem_finds_its_fan() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/fibres/problem.toml");
    let risorius::scene::Problem::Fibres(problem) = risorius::scene::Problem::read(&path, &[]).unwrap() else {
        panic!("another task");
    };
    let (mesh, names, _) = risorius::fibres::mesh(&problem.body).unwrap();
    let data = risorius::fibres::data::read(&problem.data).unwrap();
    let found = fit(&problem, &mesh, &names, &data.all).unwrap();
    // as in examples/fibre_axes.rs
    let fan = |[x, y, z]: Vector| {
        let (a, b) = ((20.0 - y).atan2(95.0 - x) + 30.0 * DEGREE * (z / 8.0 - 0.5), 6.0 * DEGREE);
        [b.cos() * a.cos(), b.cos() * a.sin(), -b.sin()]
    };
    let (mut known, mut unknown): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for node in &found.nodes {
        let error =
            apart(axes(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], node.angles)[0], fan(node.position));
        if node.determined { known.push(error) } else { unknown.push(error) }
    }
    known.sort_by(f64::total_cmp);
    unknown.sort_by(f64::total_cmp);
    println!(
        "{} nodes are determined, {:.2} degrees off (median), {:.2} at most; {} are not, {:.2} off (median)",
        known.len(),
        known[known.len() / 2],
        most(&known),
        unknown.len(),
        unknown[unknown.len() / 2]
    );
    assert!(known.len() > 80 && known[known.len() / 2] < 4.5 && most(&known) < 20.0);
    // nothing was measured beyond x = 38, y = 18
    assert!(found.nodes.iter().all(|node| node.determined || (node.position[0] > 39.0 && node.position[1] > 19.0)));
    assert!(unknown.len() >= 10);
}
