//! The space in which angles are sought: trilinear, or tricubic Hermite.

use crate::error::{Error, Place, Result};
use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::element::{Element, MAX_FUNCTIONS, TricubicHermite, Trilinear, ends};
use crate::mesh::map::{ElementMap, Term};
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::FieldSpec;
use std::collections::HashMap;
use std::f64::consts::PI;

/// Angles A and B, radians, or their derivatives per unit xi: one pair per parameter of a [`Space`].
pub type Angles = Vec<[f64; 2]>;

/// A and B, or their derivatives, of each function of an element.
pub type Local = [[f64; 2]; MAX_FUNCTIONS];

/// Lengths of edges that differ by less than this part are the same.
const SAME: f64 = 1e-9;

/// How angles follow from parameters, and what the corners of an element make of those of its nodes: k half turns take (A, B)
/// to (A + k pi, (-1)^k B), which is the same axis.
#[derive(Debug, Clone)]
pub struct Space {
    /// The basis.
    pub field: FieldSpec,
    /// Which parameters the functions of every element use.
    pub map: ElementMap,
    /// The nodes at the corners.
    pub nodes: Vec<[usize; 8]>,
    /// Half turns at the corners.
    pub turns: Vec<[i32; 8]>,
    /// The parameter that is the value at each node.
    pub values: Vec<usize>,
    /// The number of parameters.
    pub parameters: usize,
    /// The most by which a unit of each parameter changes an angle: (4/27)^r of a derivative by r directions, 4/27 being the
    /// maximum of Hermite's xi (1 - xi)^2.
    pub reach: Vec<f64>,
}

impl Space {
    /// Without half turns.
    ///
    /// A tricubic field on a tricubic mesh has the map of the geometry: it is as smooth as the body. On a trilinear mesh nodes
    /// share their derivatives, which count in every element by the length of its edge against the mean of those that leave the
    /// node in this direction: so it is C1 where elements of unequal length follow each other, too.
    ///
    /// # Errors
    /// [`Error::UnlikeDirections`] for a tricubic field on a trilinear mesh whose local directions change from element to element.
    pub fn new(field: FieldSpec, mesh: &Mesh, place: &Place) -> Result<Space> {
        let of_derivative = |derivative: u8| (4.0_f64 / 27.0).powi(derivative.count_ones() as i32);
        let (map, values, reach) = match field {
            FieldSpec::Trilinear => {
                let term = |node: &usize| vec![Term { global: *node as u32, scale: 1.0 }];
                let map = ElementMap::new(8, mesh.corners.iter().flatten().map(term));
                (map, (0..mesh.nodes).collect(), vec![1.0; mesh.nodes])
            }
            FieldSpec::Tricubic if mesh.element.parameters_per_node() == 8 => {
                let mut values = vec![0; mesh.nodes];
                for (p, node) in
                    mesh.parameter_node.iter().enumerate().filter(|(p, _)| mesh.parameter_derivative[*p] == 0)
                {
                    values[*node] = p;
                }
                let reach = mesh.parameter_derivative.iter().map(|derivative| of_derivative(*derivative));
                (mesh.map.clone(), values, reach.collect())
            }
            FieldSpec::Tricubic => {
                let reach = (0..mesh.nodes).flat_map(|_| (0..8).map(of_derivative));
                (on_edges(mesh, place)?, (0..mesh.nodes).map(|node| 8 * node).collect(), reach.collect())
            }
        };
        let turns = vec![[0; 8]; mesh.elements()];
        Ok(Space { field, map, nodes: mesh.corners.clone(), turns, values, parameters: reach.len(), reach })
    }

    /// The same with half turns at corners.
    pub fn turned(&self, turns: Vec<[i32; 8]>) -> Space {
        Space { turns, ..self.clone() }
    }

    /// The basis in every element.
    pub fn basis(&self) -> &'static dyn Element {
        match self.field {
            FieldSpec::Trilinear => &Trilinear,
            FieldSpec::Tricubic => &TricubicHermite,
        }
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        self.nodes.len()
    }

    /// The number of functions of an element.
    pub fn functions(&self) -> usize {
        self.map.functions()
    }

    /// The corner that a function belongs to.
    pub fn corner(&self, function: usize) -> usize {
        8 * function / self.functions()
    }

    /// What function `a` of an element takes its parameters of angle `k` by: half turns change the sign of B.
    pub fn sign(&self, element: usize, a: usize, k: usize) -> f64 {
        if k == 1 && self.turns[element][self.corner(a)] % 2 != 0 { -1.0 } else { 1.0 }
    }

    /// A and B of the functions of an element.
    pub fn local(&self, element: usize, angles: &Angles) -> Local {
        let mut local = [[0.0; 2]; MAX_FUNCTIONS];
        let per_node = self.functions() / 8;
        for (a, local) in local.iter_mut().enumerate().take(self.functions()) {
            for term in self.map.terms(element, a) {
                let [x, y] = angles[term.global as usize];
                local[0] += term.scale * x;
                local[1] += term.scale * y;
            }
            if a % per_node == 0 {
                local[0] += PI * f64::from(self.turns[element][a / per_node]);
            }
            local[1] *= self.sign(element, a, 1);
        }
        local
    }

    /// A and B at a point of an element with these functions.
    pub fn at(&self, local: &Local, xi: [f64; 3]) -> [f64; 2] {
        let psi = self.basis().values(xi);
        std::array::from_fn(|k| (0..self.functions()).map(|a| psi[a] * local[a][k]).sum())
    }

    /// The parameters whose values at the nodes are these; derivatives are 0.
    pub fn lifted(&self, nodes: &[[f64; 2]]) -> Angles {
        let mut angles = vec![[0.0; 2]; self.parameters];
        self.values.iter().zip(nodes).for_each(|(value, node)| angles[*value] = *node);
        angles
    }
}

/// The map of eight parameters per node (value, d1, d2, d12, ...) on a trilinear mesh.
fn on_edges(mesh: &Mesh, place: &Place) -> Result<ElementMap> {
    // at which direction and end each edge leaves a node, and the other way round
    let mut directions: HashMap<(usize, usize), ((usize, usize), usize)> = HashMap::new();
    let mut others: HashMap<(usize, usize, usize), (usize, usize)> = HashMap::new();
    let mut lengths: HashMap<(usize, usize), (f64, f64)> = HashMap::new();
    let places: Vec<[Vector; 8]> = (0..mesh.elements())
        .map(|element| {
            let at = |corner: usize| MaterialPoint { element, xi: ends(corner).map(|end| end as f64) };
            std::array::from_fn(|corner| mesh.position(at(corner)))
        })
        .collect();
    let length = |element: usize, corner: usize, d: usize| {
        norm(subtract(places[element][corner], places[element][corner ^ 1 << d]))
    };
    for (element, corners) in mesh.corners.iter().enumerate() {
        for corner in 0..8 {
            for d in 0..3 {
                let (p, q) = (corners[corner], corners[corner ^ 1 << d]);
                if p == q {
                    continue;
                }
                let way = (d, ends(corner)[d]);
                let (known, first) = *directions.entry((p, q)).or_insert((way, element));
                let (other, before) = *others.entry((p, d, way.1)).or_insert((q, element));
                if known != way || other != q {
                    let other = if known == way { before } else { first };
                    return Err(Error::UnlikeDirections {
                        elements: [other, element],
                        place: Box::new(place.clone()),
                    });
                }
                let sum = lengths.entry((p, d)).or_insert((0.0, 0.0));
                *sum = (sum.0 + length(element, corner, d), sum.1 + 1.0);
            }
        }
    }
    let scale = |element: usize, corner: usize, d: usize| {
        let sums = lengths.get(&(mesh.corners[element][corner], d));
        let part = sums.map_or(0.0, |(sum, count)| length(element, corner, d) * count / sum);
        if (part - 1.0).abs() < SAME { 1.0 } else { part }
    };
    let function = |element: usize, a: usize| {
        let (corner, derivative) = (a / 8, a % 8);
        let scale: f64 = (0..3).filter(|d| derivative >> d & 1 == 1).map(|d| scale(element, corner, d)).product();
        let global = (8 * mesh.corners[element][corner] + derivative) as u32;
        // a collapsed edge has no derivative
        if scale == 0.0 { Vec::new() } else { vec![Term { global, scale }] }
    };
    Ok(ElementMap::new(64, (0..64 * mesh.elements()).map(|k| function(k / 64, k % 64))))
}
