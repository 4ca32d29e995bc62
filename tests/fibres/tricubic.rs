//! Tricubic fields of angles: found again, C1, better than trilinear ones on the same mesh, kept by EX files.

use super::{DEGREE, apart, directions, disturbed, errors, fitted, most, problem, ring, sampled};
use crate::common::{self, Random};
use risorius::Place;
use risorius::fibres::space::Space;
use risorius::fibres::{Axis, FibreFit};
use risorius::math::tensor::{Vector, normalised};
use risorius::mesh::block::block;
use risorius::mesh::element::{Element, TricubicHermite, Trilinear};
use risorius::mesh::exf::{ExFile, write_angles, write_mesh};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::{MaterialPoint, Mesh};
use risorius::scene::{AnglesSpec, FibreProblem, FieldSpec};

fn tricubic(angles: AnglesSpec) -> FibreProblem {
    FibreProblem { field: FieldSpec::Tricubic, ..problem(angles) }
}

/// A trilinear block whose layers along x are of unequal thickness.
fn graded() -> Mesh {
    let mut mesh = block(&Trilinear, [0.0; 3], [30.0, 12.0, 5.0], [3, 2, 1]);
    for x in &mut mesh.parameters {
        x[0] += 0.02 * x[0] * x[0];
    }
    mesh
}

/// A field with random values and derivatives at every node, in the space in which such fields are sought.
fn random_field(mesh: &Mesh, random: &mut Random) -> FibreAngles {
    let space = Space::new(FieldSpec::Tricubic, mesh, &Place::whole("fibres.toml")).unwrap();
    let angles = (0..space.parameters).map(|_| [0.5 * random.next(), 0.4 * random.next()]).collect();
    let local = |e: usize| {
        let local = space.local(e, &angles);
        std::array::from_fn(|a| [local[a][0], local[a][1], 0.0])
    };
    let locals: Vec<[[f64; 3]; 64]> = (0..mesh.elements()).map(local).collect();
    let nodes = space.values.iter().map(|value| [angles[*value][0], angles[*value][1], 0.0]).collect();
    FibreAngles { tricubic: Some(locals), ..FibreAngles::at_nodes(nodes) }
}

fn curved() -> Mesh {
    common::curved_block(&TricubicHermite, [2, 2, 1], 0.03, 7)
}

#[test]
fn tricubic_fields_are_found_again() {
    for (name, mesh) in [
        ("block", block(&Trilinear, [0.0; 3], [30.0, 16.0, 4.0], [3, 2, 1])),
        ("unequal elements", graded()),
        ("curved tricubic block", curved()),
    ] {
        let mut random = Random::new(3);
        let truth = random_field(&mesh, &mut random);
        let data = sampled(&mesh, &truth, 400, &mut random);
        let fit = fitted(&tricubic(AnglesSpec::AB), &mesh, &data);
        let most = most(&errors(&mesh, &truth, &fit, &mut random));
        println!("{name}: {most:.1e} degrees at most, smoothness {:.0e}, {} steps", fit.smoothness, fit.steps);
        assert!(fit.converged && most < 1e-6, "{name}: {most:e} degrees");
        assert!(fit.nodes.iter().all(|node| node.determined), "{name}");
    }
}

/// dA/dX across the faces between elements, from both sides.
#[test]
fn tricubic_fields_have_no_kinks() {
    for mesh in [graded(), curved()] {
        let mut random = Random::new(4);
        let field = random_field(&mesh, &mut random);
        let locals = field.tricubic.as_ref().unwrap();
        let slope = |at: MaterialPoint| -> Vector {
            let j = mesh.jacobian(at);
            let inverse = nalgebra::Matrix3::from_fn(|i, d| j[i][d]).try_inverse().unwrap();
            let by_xi: Vector = std::array::from_fn(|d| {
                let gradients = TricubicHermite.gradients(at.xi);
                (0..64).map(|a| gradients[a][d] * locals[at.element][a][0]).sum()
            });
            std::array::from_fn(|i| (0..3).map(|d| by_xi[d] * inverse[(d, i)]).sum())
        };
        // elements 0 and 1 meet at xi1 = 1
        for _ in 0..10 {
            let [_, y, z] = random.xi();
            let one = slope(MaterialPoint { element: 0, xi: [1.0, y, z] });
            let other = slope(MaterialPoint { element: 1, xi: [0.0, y, z] });
            for i in 0..3 {
                assert!((one[i] - other[i]).abs() < 1e-10, "{one:?} {other:?}");
            }
        }
    }
}

/// Fibres that go around the axis of z, as in a sphincter.
fn around([x, y, _]: Vector) -> Vector {
    normalised([-y, x, 0.0])
}

fn axes_around(mesh: &Mesh, per_element: usize) -> Vec<Axis> {
    let mut random = Random::new(12);
    let everywhere = (0..mesh.elements() * per_element).map(|k| {
        let position = mesh.position(MaterialPoint { element: k % mesh.elements(), xi: random.xi() });
        Axis { position, fibre: around(position), sheet: None, weight: 1.0, group: k as u32 }
    });
    everywhere.collect()
}

/// The greatest and the middle error at random points, degrees.
fn errors_around(fit: &FibreFit) -> [f64; 2] {
    let mut random = Random::new(13);
    let mut all: Vec<f64> = (0..50 * fit.mesh.elements())
        .map(|k| {
            let at = MaterialPoint { element: k % fit.mesh.elements(), xi: random.xi() };
            apart(directions(&fit.mesh, &fit.angles, at)[0], around(fit.mesh.position(at)))
        })
        .collect();
    all.sort_by(f64::total_cmp);
    [most(&all), all[all.len() / 2]]
}

#[test]
fn a_sphincter_is_followed_more_closely() {
    // a quarter of it
    let mesh = block(&Trilinear, [4.0, 0.0, 0.0], [24.0, 24.0, 6.0], [3, 3, 1]);
    let data = axes_around(&mesh, 200);
    let [trilinear, smooth] = [problem(AnglesSpec::A), tricubic(AnglesSpec::A)].map(|problem| {
        let fit = fitted(&FibreProblem { folds: 5, ..problem }, &mesh, &data);
        (errors_around(&fit), fit.held_out.unwrap().rms / DEGREE)
    });
    println!(
        "a quarter of a sphincter, 3 x 3 elements: greatest and median error {:.3?} trilinear, {:.3?} tricubic, degrees; held out \
         {:.3} and {:.3} rms",
        trilinear.0, smooth.0, trilinear.1, smooth.1
    );
    assert!(smooth.0[0] < 0.3 * trilinear.0[0] && smooth.0[1] < 0.1 * trilinear.0[1]);
    assert!(smooth.1 < 0.2 * trilinear.1);
}

/// All around, where half turns are left over: the EX file keeps the field.
#[test]
fn a_whole_sphincter_closes_and_is_kept() {
    let (mesh, _) = ring();
    let fit = fitted(&tricubic(AnglesSpec::AB), &mesh, &axes_around(&mesh, 300));
    let found = errors_around(&fit);
    println!(
        "a ring of 8 elements: greatest and median error {found:.3?} degrees, {} with half turns",
        fit.angles.own.len()
    );
    assert!(found[1] < 0.5 && !fit.angles.own.is_empty());
    let text = write_mesh(&mesh, &[("coordinates", &mesh.parameters)]) + &write_angles(&mesh, "fibres", &fit.angles);
    let mut definitions: Vec<&str> = text.lines().filter(|line| line.starts_with("Define")).collect();
    definitions.sort_unstable();
    assert!(definitions.windows(2).all(|pair| pair[0] != pair[1]), "{definitions:?}");
    let file = ExFile::parse(&text, "ring.exf").unwrap();
    let geometry = file.geometry(None).unwrap();
    let read = file.angles("fibres", &geometry).unwrap();
    assert_eq!(read.tricubic, fit.angles.tricubic);
    assert_eq!(read.nodes.len(), fit.angles.nodes.len());
}

/// Angles that are added trilinearly, as a study of fibre angles does.
#[test]
fn degrees_are_added_between_nodes_too() {
    let mesh = graded();
    let mut random = Random::new(5);
    let before = random_field(&mesh, &mut random);
    let more: Vec<f64> = (0..mesh.nodes).map(|_| random.next()).collect();
    let linear = FibreAngles::at_nodes(more.iter().map(|more| [*more, 0.0, 0.0]).collect());
    let mut after = before.clone();
    after.add(&mesh, &more);
    for element in 0..mesh.elements() {
        let xi = random.xi();
        let [a, b, g] = after.at(&mesh, element, xi);
        let [was, b_was, g_was] = before.at(&mesh, element, xi);
        assert!((a - was - linear.at(&mesh, element, xi)[0]).abs() < 1e-12 && (b, g) == (b_was, g_was));
        assert_eq!(after.at_corners(&mesh, element)[3][0], after.tricubic.as_ref().unwrap()[element][24][0]);
    }
}

#[test]
fn nodes_without_data_are_told_in_tricubic_fields_too() {
    let mesh = block(&Trilinear, [0.0; 3], [60.0, 20.0, 10.0], [6, 2, 1]);
    let truth = FibreAngles::uniform(&mesh, [36.0 * DEGREE, 0.0, 0.0]);
    let mut data = sampled(&mesh, &truth, 100, &mut Random::new(30));
    data.retain(|axis| axis.position[0] < 30.0);
    let found = fitted(&tricubic(AnglesSpec::AB), &mesh, &data);
    for node in &found.nodes {
        assert_eq!(node.determined, node.position[0] < 31.0, "{node:?}");
    }
}

#[test]
fn local_directions_must_continue_each_other() {
    let mesh = block(&Trilinear, [0.0; 3], [20.0, 10.0, 10.0], [2, 1, 1]);
    let mut corners = mesh.corners.clone();
    // the second element turned about its third direction
    corners[1] = [1, 3, 0, 2, 5, 7, 4, 6].map(|k| mesh.corners[1][k]);
    let turned = Mesh::new(&Trilinear, mesh.parameters.clone(), corners);
    let data = axes_around(&turned, 20);
    let names: Vec<i64> = (0..turned.nodes as i64).collect();
    let error = risorius::fibres::fit(&tricubic(AnglesSpec::A), &turned, &names, &data).unwrap_err();
    assert_eq!(error.code(), "G026");
    assert!(error.to_string().contains("elements 0 and 1"), "{error}");
    assert!(risorius::fibres::fit(&problem(AnglesSpec::A), &turned, &names, &data).is_ok());
}

/// Derivatives that few data determine do not hold the search up: steps are long where they turn an angle, not where a number is large.
#[test]
fn a_tricubic_search_takes_few_steps() {
    let mesh = block(&Trilinear, [0.0; 3], [50.0, 40.0, 15.0], [5, 4, 3]);
    let nodes = (0..mesh.nodes).map(|node| [0.1 * (node % 6) as f64 + 0.3 * (node / 30) as f64, 0.05, 0.0]);
    let truth = FibreAngles::at_nodes(nodes.collect());
    let mut random = Random::new(40);
    let mut data = sampled(&mesh, &truth, 60, &mut random);
    data.iter_mut().for_each(|axis| axis.fibre = disturbed(axis.fibre, 12.0 * DEGREE, &mut random));
    let fit = fitted(&tricubic(AnglesSpec::AB), &mesh, &data);
    println!("960 numbers per angle, 60 noisy axes in each of 60 elements: {} steps", fit.steps);
    assert!(fit.converged && fit.steps <= 25, "{} steps", fit.steps);
}

/// A muscle with a tricubic field contracts: the same answer where the field is also trilinear, another where it bends.
#[test]
fn a_muscle_with_a_tricubic_field_contracts() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut mesh = block(&Trilinear, [0.0; 3], [24.0, 6.0, 2.0], [2, 1, 1]);
    mesh.parameters.iter_mut().for_each(|x| (0..3).for_each(|i| x[i] += [3.0, 2.0, 6.0][i]));
    let space = Space::new(FieldSpec::Tricubic, &mesh, &Place::whole("fibres.toml")).unwrap();
    let nodes: Vec<[f64; 2]> = (0..mesh.nodes).map(|node| [0.1 * node as f64, 0.05]).collect();
    let mut straight = space.lifted(&nodes);
    // d1, d2 and d3 of what the numbers of the nodes make, 3 x 2 x 2
    for value in &space.values {
        [(1, 0.1), (2, 0.3), (4, 0.6)].iter().for_each(|(d, slope)| straight[value + d][0] = *slope);
    }
    let mut bent = straight.clone();
    // dA/dxi1 at the nodes in the middle
    space.values.iter().zip(&mesh.parameters).filter(|(_, x)| x[0] == 15.0).for_each(|(value, _)| {
        bent[value + 1][0] += 0.8;
    });
    let tricubic = |angles: &Vec<[f64; 2]>| {
        let local = |e: usize| {
            let local = space.local(e, angles);
            std::array::from_fn(|a| [local[a][0], local[a][1], 0.0])
        };
        let locals = (0..mesh.elements()).map(local).collect();
        FibreAngles { tricubic: Some(locals), ..trilinear(&nodes) }
    };
    fn trilinear(nodes: &[[f64; 2]]) -> FibreAngles {
        FibreAngles::at_nodes(nodes.iter().map(|[a, b]| [*a, *b, 0.0]).collect())
    }
    let tip = |name: &str, angles: &FibreAngles| -> Vec<f64> {
        let text = write_mesh(&mesh, &[("coordinates", &mesh.parameters)]) + &write_angles(&mesh, "fibres", angles);
        std::fs::write(path("muscle.exf"), text).unwrap();
        let problem = "[task]\nkind = \"forward\"\n[mesh]\n\
            block = { origin_mm = [0, 0, 0], size_mm = [30, 10, 10], elements = [3, 1, 1] }\n\
            [tissue]\nmooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }\n[[muscle]]\nname = \"slab\"\nexf = \"muscle.exf\"\n\
            angles_field = \"fibres\"\n\
            blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }\n\
            [[support]]\nclamp = { face = \"xi1=0\" }\n[controls]\nslab = 0.02\n\
            [[probe]]\nname = \"tip\"\nposition_mm = [30, 10, 10]\n";
        std::fs::write(path("problem.toml"), problem).unwrap();
        let mut command = assert_cmd::Command::cargo_bin("risorius").unwrap();
        command.current_dir(folder.path()).args(["run", "problem.toml", "-q", "--out", name]).assert().success();
        let table = std::fs::read_to_string(path(name).join("tables/probes.csv")).unwrap();
        table.lines().last().unwrap().split(',').filter_map(|cell| cell.parse().ok()).collect()
    };
    let [plain, lifted, curved] =
        [tip("trilinear", &trilinear(&nodes)), tip("tricubic", &tricubic(&straight)), tip("bent", &tricubic(&bent))];
    println!("tip: {plain:.4?} trilinear, {lifted:.4?} the same field as tricubic, {curved:.4?} bent");
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(plain.len() > 5 && apart(&plain, &lifted) < 1e-9, "{plain:?} {lifted:?}");
    assert!(apart(&plain, &curved) > 0.01, "{plain:?} {curved:?}");
}
