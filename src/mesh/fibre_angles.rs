//! Fibre directions from Euler angles that are given at nodes and interpolated trilinearly (Wu et al. 2013, section 3.3), or as a
//! tricubic Hermite.

use super::element::{Element, MAX_FUNCTIONS, TricubicHermite, Trilinear};
use super::{Mesh, position_and_jacobian};
use crate::math::tensor::{Matrix, Vector, cross, normalised};
use std::collections::BTreeMap;

/// Euler angles (A, B, G) in radians at the nodes of a mesh: fibre angle, imbrication, sheet.
#[derive(Debug, Clone)]
pub struct FibreAngles {
    /// One triple per node.
    pub nodes: Vec<[f64; 3]>,
    /// Elements whose corners have other angles than their nodes: the same axes, with other half turns. A field that
    /// turns around on its way about a hole has them along a cut; most fields have none.
    pub own: BTreeMap<usize, [[f64; 3]; 8]>,
    /// Of a tricubic Hermite field what its functions have in every element: value, d1, d2, d12, d3, d13, d23, d123 at each corner,
    /// radians per unit xi. The values are those at the corners.
    pub tricubic: Option<Vec<[[f64; 3]; MAX_FUNCTIONS]>>,
}

impl FibreAngles {
    /// Angles at nodes, one for all elements that meet there.
    pub fn at_nodes(nodes: Vec<[f64; 3]>) -> FibreAngles {
        FibreAngles { nodes, own: BTreeMap::new(), tricubic: None }
    }

    /// The same angles everywhere.
    pub fn uniform(mesh: &Mesh, angles: [f64; 3]) -> FibreAngles {
        FibreAngles::at_nodes(vec![angles; mesh.nodes])
    }

    /// The angles at the corners of an element.
    pub fn at_corners(&self, mesh: &Mesh, element: usize) -> [[f64; 3]; 8] {
        self.own.get(&element).copied().unwrap_or_else(|| mesh.corners[element].map(|node| self.nodes[node]))
    }

    /// The angles at a point of an element.
    pub fn at(&self, mesh: &Mesh, element: usize, xi: [f64; 3]) -> [f64; 3] {
        let sum = |values: &[f64], parameters: &[[f64; 3]]| {
            let mut angles = [0.0; 3];
            for (value, parameter) in values.iter().zip(parameters) {
                for (sum, angle) in angles.iter_mut().zip(parameter) {
                    *sum += value * angle;
                }
            }
            angles
        };
        match &self.tricubic {
            Some(locals) => sum(&TricubicHermite.values(xi), &locals[element]),
            None => sum(&Trilinear.values(xi), &self.at_corners(mesh, element)),
        }
    }

    /// Adds to A at every node what is given there, and between them trilinearly.
    pub fn add(&mut self, mesh: &Mesh, nodes: &[f64]) {
        self.nodes.iter_mut().zip(nodes).for_each(|(angles, more)| angles[0] += more);
        for (element, own) in &mut self.own {
            own.iter_mut().zip(mesh.corners[*element]).for_each(|(angles, node)| angles[0] += nodes[node]);
        }
        for (local, corners) in self.tricubic.iter_mut().flatten().zip(&mesh.corners) {
            for (a, angles) in local.iter_mut().enumerate() {
                let (corner, derivative) = (a / 8, a % 8);
                // a derivative along an edge is the difference of its ends, a mixed one the difference of those
                let parts = (0..8).filter(|part| part & derivative == *part);
                angles[0] += parts
                    .map(|part| {
                        let sign = if (derivative & !part).count_ones() % 2 == 0 { 1.0 } else { -1.0 };
                        sign * nodes[corners[(corner & !derivative) | part]]
                    })
                    .sum::<f64>();
            }
        }
    }

    /// The unit fibre direction at a point of an element with local reference parameters `local`.
    pub fn direction(&self, mesh: &Mesh, element: usize, local: &[[f64; 64]; 3], xi: [f64; 3]) -> Vector {
        let (_, jacobian) = position_and_jacobian(mesh.element, local, xi);
        axes(&jacobian, self.at(mesh, element, xi))[0]
    }
}

/// The material axes (fibre, sheet, normal) from dX/dxi and the angles (A, B, G).
///
/// f1 = dX/dxi1 normalised, f3 = (dX/dxi1 x dX/dxi2) normalised, f2 = f3 x f1;
/// a = cos A f1 + sin A f2, b = -sin A f1 + cos A f2;
/// a' = cos B a - sin B f3, c = cos B f3 + sin B a;  b' = cos G b + sin G c, c' = cos G c - sin G b.
/// Positive B tips the fibre a' towards -f3.
pub fn axes(jacobian: &Matrix, [angle, imbrication, sheet]: [f64; 3]) -> [Vector; 3] {
    let column = |d: usize| [jacobian[0][d], jacobian[1][d], jacobian[2][d]];
    let f1 = normalised(column(0));
    let f3 = normalised(cross(column(0), column(1)));
    let f2 = cross(f3, f1);
    let combine = |s: f64, u: Vector, t: f64, v: Vector| std::array::from_fn(|i| s * u[i] + t * v[i]);
    let a = combine(angle.cos(), f1, angle.sin(), f2);
    let b = combine(-angle.sin(), f1, angle.cos(), f2);
    let fibre = combine(imbrication.cos(), a, -imbrication.sin(), f3);
    let c = combine(imbrication.cos(), f3, imbrication.sin(), a);
    [fibre, combine(sheet.cos(), b, sheet.sin(), c), combine(sheet.cos(), c, -sheet.sin(), b)]
}
