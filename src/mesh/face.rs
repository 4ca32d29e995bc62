//! Faces of hexahedra: which side of which element, and how to walk on it.

use super::Mesh;
use super::element::{Element, ends};
use crate::math::tensor::{Matrix, Vector, cross};
use std::collections::HashMap;
use std::fmt;

/// A side of a hexahedron: xi_(direction + 1) = end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Side {
    /// 0, 1, 2 for xi1, xi2, xi3.
    pub direction: usize,
    /// 0 or 1.
    pub end: usize,
}

impl Side {
    /// All six sides.
    pub const ALL: [Side; 6] = [
        Side { direction: 0, end: 0 },
        Side { direction: 0, end: 1 },
        Side { direction: 1, end: 0 },
        Side { direction: 1, end: 1 },
        Side { direction: 2, end: 0 },
        Side { direction: 2, end: 1 },
    ];

    /// The two directions along the side, in cyclic order so that their cross product points along +xi_direction.
    pub fn tangents(self) -> [usize; 2] {
        [(self.direction + 1) % 3, (self.direction + 2) % 3]
    }

    /// The point of the cube at (s, t) on this side, s and t along [`Side::tangents`].
    pub fn lift(self, [s, t]: [f64; 2]) -> [f64; 3] {
        let mut xi = [0.0; 3];
        let [p, q] = self.tangents();
        xi[self.direction] = self.end as f64;
        xi[p] = s;
        xi[q] = t;
        xi
    }

    /// The outward area vector dA/(ds dt) from dX/dxi on this side: +- (dX/ds x dX/dt).
    pub fn area_vector(self, jacobian: &Matrix) -> Vector {
        let [p, q] = self.tangents();
        let column = |d: usize| [jacobian[0][d], jacobian[1][d], jacobian[2][d]];
        let area = cross(column(p), column(q));
        if self.end == 1 { area } else { area.map(|a| -a) }
    }

    /// The four local nodes on this side.
    pub fn nodes(self) -> [usize; 4] {
        let mut found = [0; 4];
        let on_side = (0..8).filter(|&k| ends(k)[self.direction] == self.end);
        for (slot, k) in found.iter_mut().zip(on_side) {
            *slot = k;
        }
        found
    }

    /// The local functions that are not zero on this side, ascending: those at its nodes without a derivative through it.
    pub fn functions(self, element: &dyn Element) -> Vec<usize> {
        let per_node = element.parameters_per_node();
        let on_side =
            |a: &usize| ends(a / per_node)[self.direction] == self.end && (a % per_node) >> self.direction & 1 == 0;
        (0..element.functions()).filter(on_side).collect()
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "xi{}={}", self.direction + 1, self.end)
    }
}

/// One side of one element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Face {
    /// Element index.
    pub element: usize,
    /// Side of that element.
    pub side: Side,
}

/// The faces that only one element has, in order of element and side. Faces are compared by their corner nodes; a
/// face that has collapsed to a line or a point is none.
pub fn boundary_faces(mesh: &Mesh) -> Vec<Face> {
    let corner_nodes = |element: usize, side: Side| {
        let mut nodes = side.nodes().map(|k| mesh.corners[element][k]);
        nodes.sort_unstable();
        nodes
    };
    let mut count: HashMap<[usize; 4], usize> = HashMap::new();
    for element in 0..mesh.elements() {
        for side in Side::ALL {
            *count.entry(corner_nodes(element, side)).or_default() += 1;
        }
    }
    let mut boundary = Vec::new();
    for element in 0..mesh.elements() {
        for side in Side::ALL {
            let nodes = corner_nodes(element, side);
            let distinct = 1 + nodes.windows(2).filter(|w| w[0] != w[1]).count();
            if count[&nodes] == 1 && distinct >= 3 {
                boundary.push(Face { element, side });
            }
        }
    }
    boundary
}
