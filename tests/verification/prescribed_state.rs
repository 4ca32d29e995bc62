//! Energy, residual, tangent and every muscle point at a prescribed state on a curved host, which is not an equilibrium.
//!
//! Host: 3 x 2 x 1 tricubic Hermite elements, X(s, t, r) = (40/3 s + 2 sin t, 5 t + s^2/2, 10 r + sin s) at integer
//! (s, t, r) with its first derivatives; cross derivatives zero. `prescribed_state.json` holds the two muscles, the
//! state u, p, the direction v and the results of an independent implementation: residual = dPi/d(u, p), k_v = K v,
//! dr_da, energies, and at every muscle point position X, weight W, fibre n0, host element and xi, stretch lam.
//! Its second Euler angle tips the fibre towards +f3: the opposite sign of our imbrication.

use super::support::{Discretisation, FIBRE, TISSUE, assert_close, parameters, reference};
use risorius::material::PAIRS;
use risorius::mesh::Mesh;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::location::Locator;
use risorius::model::supports::Supports;
use risorius::model::{Control, Ingredients, Model, State, Workspace};
use risorius::term::muscle::Muscle;
use risorius::term::tissue::Tissue;
use risorius::term::{Term, Want};
use serde::Deserialize;

#[derive(Deserialize)]
struct Reference {
    activations: Vec<f64>,
    u: Vec<[[f64; 3]; 8]>,
    p: Vec<f64>,
    v: Split,
    energy_muscles: Vec<f64>,
    dr_da: Vec<Vec<[[f64; 3]; 8]>>,
    muscles: Vec<MuscleReference>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Split {
    u: Vec<[[f64; 3]; 8]>,
    p: Vec<f64>,
}

#[derive(Deserialize)]
struct Case {
    gauss: usize,
    kappa: f64,
    energy_host: f64,
    residual: Split,
    k_v: Split,
    det_f: [f64; 2],
}

#[derive(Deserialize)]
struct MuscleReference {
    nodes: serde_json::Value,
    conn: Vec<[usize; 8]>,
    angles_rad: Vec<[f64; 3]>,
    gauss: usize,
    points: Points,
}

#[derive(Deserialize)]
#[allow(non_snake_case)] // the symbols of the reference file
struct Points {
    X: Vec<[f64; 3]>,
    W: Vec<f64>,
    n0: Vec<[f64; 3]>,
    elem: Vec<usize>,
    xi: Vec<[f64; 3]>,
    lam: Vec<f64>,
}

fn host() -> Mesh {
    let mut nodes = Vec::new();
    for r in 0..2 {
        for t in 0..3 {
            for s in 0..4 {
                let (s, t, r) = (s as f64, t as f64, r as f64);
                let mut node = [[0.0; 3]; 8];
                node[0] = [40.0 / 3.0 * s + 2.0 * t.sin(), 5.0 * t + 0.5 * s * s, 10.0 * r + s.sin()];
                node[1] = [40.0 / 3.0, s, s.cos()];
                node[2] = [2.0 * t.cos(), 5.0, 0.0];
                node[4] = [0.0, 0.0, 10.0];
                nodes.push(node);
            }
        }
    }
    let corner = |i: usize, j: usize, k: usize| i + 4 * (j + 3 * k);
    let corners = (0..6)
        .map(|e| {
            let (i, j) = (e % 3, e / 3);
            std::array::from_fn(|c| corner(i + (c & 1), j + (c >> 1 & 1), c >> 2))
        })
        .collect();
    Mesh::new(&TricubicHermite, parameters(&nodes), corners)
}

fn muscle_mesh(m: &MuscleReference) -> Mesh {
    match serde_json::from_value::<Vec<[f64; 3]>>(m.nodes.clone()) {
        Ok(nodes) => Mesh::new(&Trilinear, nodes, m.conn.clone()),
        Err(_) => {
            let nodes: Vec<[[f64; 3]; 8]> = serde_json::from_value(m.nodes.clone()).expect("Hermite nodes");
            Mesh::new(&TricubicHermite, parameters(&nodes), m.conn.clone())
        }
    }
}

fn embedded(reference: &Reference, host: &Mesh) -> Vec<Muscle> {
    let locator = Locator::new(host);
    reference
        .muscles
        .iter()
        .enumerate()
        .map(|(k, m)| {
            let angles = FibreAngles::at_nodes(m.angles_rad.iter().map(|[a, b, c]| [*a, -b, *c]).collect());
            Muscle::new(&format!("m{k}"), &locator, &muscle_mesh(m), &angles, m.gauss, FIBRE, k).expect("inside")
        })
        .collect()
}

#[test]
fn every_muscle_point_agrees() {
    let reference: Reference = reference("prescribed_state");
    let host = host();
    let state = parameters(&reference.u);
    let current: Vec<[f64; 3]> =
        host.parameters.iter().zip(&state).map(|(x, u)| std::array::from_fn(|i| x[i] + u[i])).collect();
    for (muscle, theirs) in embedded(&reference, &host).iter().zip(&reference.muscles) {
        let mut points: Vec<_> = muscle.points().iter().collect();
        points.sort_by_key(|p| p.index);
        let theirs = &theirs.points;
        assert_close("X", points.iter().flat_map(|p| p.position), theirs.X.iter().flatten().copied(), 1e-10);
        assert_close("W", points.iter().map(|p| p.weight), theirs.W.iter().copied(), 1e-10);
        assert_close("n0", points.iter().flat_map(|p| p.fibre), theirs.n0.iter().flatten().copied(), 1e-10);
        assert!(points.iter().map(|p| p.host.element).eq(theirs.elem.iter().copied()), "host elements");
        assert_close("xi", points.iter().flat_map(|p| p.host.xi), theirs.xi.iter().flatten().copied(), 1e-10);
        let stretch = |p: &risorius::term::muscle::Point| {
            let v = p.deformed_fibre(&host.local_of(p.host.element, &current));
            v.iter().map(|c| c * c).sum::<f64>().sqrt()
        };
        assert_close("stretch", points.iter().map(|p| stretch(p)), theirs.lam.iter().copied(), 1e-10);
    }
}

#[test]
fn energy_residual_tangent_and_activation_force_agree() {
    let reference: Reference = reference("prescribed_state");
    for case in &reference.cases {
        let how = Discretisation::trilinear(case.kappa, case.gauss);
        let mesh = host();
        let tissue = Tissue::new(&mesh, TISSUE, how.kappa, how.space, how.gauss).expect("sound geometry");
        let volume = tissue.volume();
        let mut terms: Vec<Box<dyn Term>> = vec![Box::new(tissue)];
        let control = |name: &str| Control { name: name.into(), lower: 0.0, upper: 1.0, onset: 1.4 / 300.0 };
        for muscle in embedded(&reference, &mesh) {
            terms.push(Box::new(muscle));
        }
        let supports = Supports::new(&mesh, Vec::new()).expect("no supports");
        let model = Model::new(Ingredients {
            mesh,
            space: how.space,
            terms,
            supports,
            controls: vec![control("m0"), control("m1")],
            shear_modulus: 1.4,
            volume,
        })
        .expect("a model");
        let state = State {
            u: parameters(&reference.u),
            p: reference.p.clone(),
            controls: reference.activations.clone(),
            load: 1.0,
            ..model.rest()
        };
        let mut workspace = Workspace::default();
        let found = model.evaluate(&state, Want::Stiffness, None, &mut workspace);
        assert_close("tissue energy", [found.energies[0]], [case.energy_host], 1e-10);
        assert_close("muscle energies", found.energies[1..].to_vec(), reference.energy_muscles.clone(), 1e-10);
        assert_close("det F", [found.det_f.min, found.det_f.max], case.det_f, 1e-10);

        let unknowns = |split: &Split| {
            let mut x = vec![0.0; model.numbering().unknowns()];
            for (parameter, value) in parameters(&split.u).iter().enumerate() {
                for (i, value) in value.iter().enumerate() {
                    x[model.numbering().displacement_unknown(parameter, i).expect("all free")] = *value;
                }
            }
            for (index, value) in split.p.iter().enumerate() {
                x[model.numbering().pressure_unknown(index)] = *value;
            }
            x
        };
        let only_p = |x: &[f64]| -> Vec<f64> {
            (0..model.numbering().pressures()).map(|k| x[model.numbering().pressure_unknown(k)]).collect()
        };
        let residual = unknowns(&case.residual);
        assert_close("residual", found.residual.iter().copied(), residual.iter().copied(), 1e-10);
        assert_close("volume residual", only_p(&found.residual), only_p(&residual), 1e-10);

        let mut tangent = model.tangent();
        model.assemble(&workspace, &mut tangent);
        let v = unknowns(&reference.v);
        let mut product = vec![0.0; v.len()];
        tangent.matrix.multiply(&v, &mut product);
        let k_v = unknowns(&case.k_v);
        assert_close("K v", product.iter().copied(), k_v.iter().copied(), 1e-10);
        assert_close("K v, pressures", only_p(&product), only_p(&k_v), 1e-10);

        for (control, theirs) in reference.dr_da.iter().enumerate() {
            let theirs = unknowns(&Split { u: theirs.clone(), p: vec![0.0; reference.p.len()] });
            assert_close("dr/da", model.control_force(&state, control), theirs, 1e-10);
        }
        assert_eq!(PAIRS.len(), 6);
    }
}
