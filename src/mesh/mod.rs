//! Where the body is: reference geometry, element by element, in mm.

pub mod bezier;
pub mod block;
pub mod continuous;
pub mod cycled;
pub mod element;
pub mod exf;
pub mod face;
pub mod facial;
pub mod fibre_angles;
pub mod halved;
pub mod join;
pub mod location;
pub mod map;
pub mod surface;

use crate::math::quadrature::GaussRule;
use crate::math::tensor::{Matrix, Vector, determinant};
use element::Element;
use face::Face;
use map::ElementMap;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A mesh of one kind of hexahedron; immutable once built.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// The basis of every element.
    pub element: &'static dyn Element,
    /// Global parameters X of the reference geometry: mm, or mm per unit xi for derivatives.
    pub parameters: Vec<Vector>,
    /// How elements use the global parameters.
    pub map: ElementMap,
    /// The node at each corner of each element.
    pub corners: Vec<[usize; 8]>,
    /// The number of nodes.
    pub nodes: usize,
    /// The node that each global parameter belongs to.
    pub parameter_node: Vec<usize>,
    /// Bit mask d1 + 2 d2 + 4 d3 of the derivative that each global parameter is.
    pub parameter_derivative: Vec<u8>,
    /// Boundary faces by name, for example `xi1=0` of a block.
    pub named_faces: BTreeMap<String, Vec<Face>>,
}

/// A place inside a mesh that moves with the material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaterialPoint {
    /// Element index.
    pub element: usize,
    /// Local coordinates in [0, 1]^3.
    pub xi: [f64; 3],
}

impl Mesh {
    /// A mesh whose elements use the parameters of their corner nodes as they are, without scale factors.
    ///
    /// `parameters`: per node in turn, one triple per parameter of the element's basis (mm, or mm per unit xi);
    /// `corners`: the eight nodes of each element.
    pub fn new(element: &'static dyn Element, parameters: Vec<Vector>, corners: Vec<[usize; 8]>) -> Mesh {
        let per_node = element.parameters_per_node();
        let locals = corners.iter().flat_map(|nodes| {
            nodes.iter().flat_map(move |&node| {
                (0..per_node).map(move |d| vec![map::Term { global: (node * per_node + d) as u32, scale: 1.0 }])
            })
        });
        Mesh {
            element,
            map: ElementMap::new(element.functions(), locals),
            nodes: parameters.len() / per_node,
            parameter_node: (0..parameters.len()).map(|p| p / per_node).collect(),
            parameter_derivative: (0..parameters.len()).map(|p| (p % per_node) as u8).collect(),
            parameters,
            corners,
            named_faces: BTreeMap::new(),
        }
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        self.corners.len()
    }

    /// Local parameters of the reference geometry of `element`.
    pub fn local(&self, element: usize) -> [[f64; 64]; 3] {
        self.local_of(element, &self.parameters)
    }

    /// Local parameters in `element` of a field with the global parameters `global`.
    pub fn local_of(&self, element: usize, global: &[Vector]) -> [[f64; 64]; 3] {
        let mut local = [[0.0; 64]; 3];
        self.map.gather(element, global, &mut local);
        local
    }

    /// The volume of the body with the global parameters `x`, mm3: the sum over elements of the integral of det(dx/dxi), which is
    /// of degree 8 along each direction and integrated exactly.
    pub fn volume(&self, x: &[Vector]) -> f64 {
        let rule = GaussRule::new(5);
        let along = || rule.points.iter().zip(&rule.weights);
        let mut points = Vec::with_capacity(125);
        for (z, c) in along() {
            for (y, b) in along() {
                points.extend(along().map(|(x, a)| (self.element.gradients([*x, *y, *z]), a * b * c)));
            }
        }
        let of_element = |element: usize| -> f64 {
            let local = self.local_of(element, x);
            let at = |(gradients, weight): &([[f64; 3]; 64], f64)| {
                let jacobian: Matrix = std::array::from_fn(|i| {
                    std::array::from_fn(|d| local[i].iter().zip(gradients).map(|(x, g)| x * g[d]).sum())
                });
                weight * determinant(&jacobian)
            };
            points.iter().map(at).sum()
        };
        let parts: Vec<f64> = (0..self.elements()).into_par_iter().map(of_element).collect();
        parts.iter().sum()
    }

    /// The field with global parameters `global` at a material point.
    pub fn interpolate(&self, at: MaterialPoint, global: &[Vector]) -> Vector {
        let values = self.element.values(at.xi);
        let mut sum = [0.0; 3];
        for (a, n) in values.iter().enumerate().take(self.element.functions()) {
            for t in self.map.terms(at.element, a) {
                for (s, g) in sum.iter_mut().zip(global[t.global as usize]) {
                    *s += n * t.scale * g;
                }
            }
        }
        sum
    }

    /// Adds to the forces on the global parameters what `force` at a material point does on them: the transpose of
    /// [`Mesh::interpolate`].
    pub fn add_force(&self, at: MaterialPoint, force: Vector, global: &mut [Vector]) {
        let values = self.element.values(at.xi);
        for (a, n) in values.iter().enumerate().take(self.element.functions()) {
            for t in self.map.terms(at.element, a) {
                for (g, f) in global[t.global as usize].iter_mut().zip(force) {
                    *g += n * t.scale * f;
                }
            }
        }
    }

    /// Reference position of a material point, mm.
    pub fn position(&self, at: MaterialPoint) -> Vector {
        self.interpolate(at, &self.parameters)
    }

    /// dX/dxi at a material point: `jacobian[i][d]` = dX_i/dxi_d, mm.
    pub fn jacobian(&self, at: MaterialPoint) -> Matrix {
        position_and_jacobian(self.element, &self.local(at.element), at.xi).1
    }
}

/// x(xi) and dx/dxi from the local parameters of an element.
pub fn position_and_jacobian(element: &dyn Element, local: &[[f64; 64]; 3], xi: [f64; 3]) -> (Vector, Matrix) {
    let (n, g) = (element.values(xi), element.gradients(xi));
    let mut x = [0.0; 3];
    let mut jacobian = [[0.0; 3]; 3];
    for a in 0..element.functions() {
        for i in 0..3 {
            x[i] += n[a] * local[i][a];
            for d in 0..3 {
                jacobian[i][d] += g[a][d] * local[i][a];
            }
        }
    }
    (x, jacobian)
}
