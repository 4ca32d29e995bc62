//! Torsion of a solid circular cylinder of incompressible Mooney-Rivlin tissue at constant length (Rivlin 1948; Ogden,
//! Non-linear Elastic Deformations, 1984, section 5.2.4).
//!
//! Plane sections turn by psi per length and stay plane, radii keep their length. With radius R at unit stretch
//!   moment       M = pi (c1 + c2) psi R^4
//!   axial force  N = - pi psi^2 R^4 (c1/2 + c2)      (the ends must be pressed together)
//!
//! The cylinder is a wheel of Hermite elements (r, theta, z). Towards the axis they collapse: the axis has one value and
//! the two slopes G = (dx/dX, dx/dY), and the local parameters of an element between the angles theta are sums,
//!   d/dr = cos(theta) Gx + sin(theta) Gy,   d2/(dr dtheta) = - sin(theta) Gx + cos(theta) Gy,   d/dtheta = 0,
//! so that every field is C1 on the axis too.

use super::support::{Discretisation, TISSUE, model, solve};
use risorius::math::tensor::Vector;
use risorius::mesh::Mesh;
use risorius::mesh::element::{TricubicHermite, ends};
use risorius::mesh::face::{Face, Side};
use risorius::mesh::map::{ElementMap, Term};
use risorius::model::supports::Support;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const RADIUS: f64 = 5.0;
const LENGTH: f64 = 10.0;
const TURN: f64 = FRAC_PI_2;

/// Elements along r, theta, z.
fn cylinder([radial, around, along]: [usize; 3]) -> Mesh {
    let (dr, dt, dz) = (RADIUS / radial as f64, TAU / around as f64, LENGTH / along as f64);
    // per level: the axis with value, Gx, Gy and their slopes along z, then the rings with eight parameters a node
    const AXIS: [u8; 6] = [0, 1, 2, 4, 5, 6];
    let per_level = AXIS.len() + 8 * radial * around;
    let ring_node =
        |ring: usize, j: usize, level: usize| level * (1 + radial * around) + 1 + (ring - 1) * around + j % around;
    let (mut parameters, mut parameter_node, mut parameter_derivative) = (Vec::new(), Vec::new(), Vec::new());
    for level in 0..=along {
        let z = dz * level as f64;
        let axis: [Vector; 6] = [[0.0, 0.0, z], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, dz], [0.0; 3], [0.0; 3]];
        parameters.extend(axis);
        parameter_node.extend([level * (1 + radial * around); 6]);
        parameter_derivative.extend(AXIS);
        for ring in 1..=radial {
            for j in 0..around {
                let (r, (sine, cosine)) = (dr * ring as f64, (dt * j as f64).sin_cos());
                let mut node = [[0.0; 3]; 8];
                node[0] = [r * cosine, r * sine, z];
                node[1] = [dr * cosine, dr * sine, 0.0];
                node[2] = [-r * dt * sine, r * dt * cosine, 0.0];
                node[3] = [-dr * dt * sine, dr * dt * cosine, 0.0];
                node[4] = [0.0, 0.0, dz];
                parameters.extend(node);
                parameter_node.extend([ring_node(ring, j, level); 8]);
                parameter_derivative.extend(0..8);
            }
        }
    }

    let (mut locals, mut corners) = (Vec::new(), Vec::new());
    let mut named_faces: BTreeMap<String, Vec<Face>> = BTreeMap::new();
    for k in 0..along {
        for j in 0..around {
            for i in 0..radial {
                for a in 0..64 {
                    let ([e1, e2, e3], mask) = (ends(a / 8), a % 8);
                    let (ring, level) = (i + e1, k + e3);
                    let first = level * per_level;
                    let term = |index: usize, scale: f64| Term { global: (first + index) as u32, scale };
                    locals.push(if ring > 0 {
                        vec![term(AXIS.len() + 8 * ((ring - 1) * around + (j + e2) % around) + mask, 1.0)]
                    } else {
                        let (sine, cosine) = (dt * (j + e2) as f64).sin_cos();
                        let along_z = 3 * (mask >> 2);
                        match mask & 3 {
                            0 => vec![term(along_z, 1.0)],
                            1 => vec![term(along_z + 1, dr * cosine), term(along_z + 2, dr * sine)],
                            2 => vec![],
                            _ => vec![term(along_z + 1, -dr * dt * sine), term(along_z + 2, dr * dt * cosine)],
                        }
                    });
                }
                let element = corners.len();
                corners.push(std::array::from_fn(|c| {
                    let [e1, e2, e3] = ends(c);
                    let axis = (k + e3) * (1 + radial * around);
                    if i + e1 == 0 { axis } else { ring_node(i + e1, j + e2, k + e3) }
                }));
                for (end, is_boundary) in [(0, k == 0), (1, k + 1 == along)] {
                    if is_boundary {
                        let side = Side { direction: 2, end };
                        named_faces.entry(side.to_string()).or_default().push(Face { element, side });
                    }
                }
            }
        }
    }
    Mesh {
        element: &TricubicHermite,
        map: ElementMap::new(64, locals),
        nodes: (along + 1) * (1 + radial * around),
        parameters,
        corners,
        parameter_node,
        parameter_derivative,
        named_faces,
    }
}

/// Relative errors of moment and axial force.
fn errors(elements: [usize; 3]) -> [f64; 2] {
    let mesh = cylinder(elements);
    let clamp = Support::Clamp { faces: mesh.named_faces["xi3=0"].clone() };
    let faces = mesh.named_faces["xi3=1"].clone();
    let turn = Support::Rotate { faces, axis: [0.0, 0.0, 1.0], through: [0.0; 3], angle: TURN };
    let model = model(mesh, Discretisation::trilinear(10.0, 4), Vec::new(), Vec::new(), vec![clamp, turn]);
    let found = solve(&model, &[], 1.0);
    assert_eq!(found.negative_modes, Some(0));
    let x = model.current(&found.state);
    let (moment, axial) = model.supports().rotation_reactions(model.mesh(), &found.evaluation.force, &x)[0];
    let (psi, r4) = (TURN / LENGTH, RADIUS.powi(4));
    let expected = [PI * (TISSUE.c1 + TISSUE.c2) * psi * r4, -PI * psi * psi * r4 * (0.5 * TISSUE.c1 + TISSUE.c2)];
    [moment / expected[0] - 1.0, axial / expected[1] - 1.0]
}

/// Of fourth order in the element size: the order of the circles that Hermite elements make.
#[test]
fn moment_and_axial_force_converge_to_the_closed_form() {
    let levels = [[1, 4, 1], [2, 8, 2], [3, 12, 3]].map(|elements| (elements[0] as f64, errors(elements)));
    for (index, what) in ["moment", "axial force"].into_iter().enumerate() {
        for pair in levels.windows(2) {
            let [(coarse, before), (fine, after)] = [(pair[0].0, pair[0].1[index]), (pair[1].0, pair[1].1[index])];
            let order = (before / after).ln() / (fine / coarse).ln();
            assert!((3.7..4.4).contains(&order), "{what}: errors {before:.2e}, {after:.2e}, order {order:.2}");
        }
        let last = levels[2].1[index];
        assert!(last.abs() < 5e-4, "{what}: {last:.2e}");
    }
}
