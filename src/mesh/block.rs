//! The block generator: a box of equal hexahedra.

use super::Mesh;
use super::element::{Element, ends};
use super::face::{Face, Side};
use std::collections::BTreeMap;

/// A box of n1 x n2 x n3 equal elements with its sides along the axes. Nodes and elements are numbered x fastest, then
/// y, then z; derivatives are per unit xi. Its six boundary sides are named `xi1=0` to `xi3=1`.
///
/// `origin` and `size` in mm; sizes and element counts must be positive.
pub fn block(element: &'static dyn Element, origin: [f64; 3], size: [f64; 3], elements: [usize; 3]) -> Mesh {
    let [n1, n2, n3] = elements;
    let per_node = element.parameters_per_node();
    let step: [f64; 3] = std::array::from_fn(|d| size[d] / elements[d] as f64);
    let node = |[i, j, k]: [usize; 3]| i + (n1 + 1) * (j + (n2 + 1) * k);
    let nodes = (n1 + 1) * (n2 + 1) * (n3 + 1);

    let mut parameters = vec![[0.0; 3]; nodes * per_node];
    for k in 0..=n3 {
        for j in 0..=n2 {
            for i in 0..=n1 {
                let first = node([i, j, k]) * per_node;
                let at = [i, j, k];
                parameters[first] = std::array::from_fn(|d| origin[d] + size[d] * at[d] as f64 / elements[d] as f64);
                if per_node == 8 {
                    for d in 0..3 {
                        parameters[first + (1 << d)][d] = step[d];
                    }
                }
            }
        }
    }

    let mut corners = Vec::with_capacity(n1 * n2 * n3);
    let mut named_faces: BTreeMap<String, Vec<Face>> = BTreeMap::new();
    for k in 0..n3 {
        for j in 0..n2 {
            for i in 0..n1 {
                let index = corners.len();
                corners.push(std::array::from_fn(|corner| {
                    let e = ends(corner);
                    node([i + e[0], j + e[1], k + e[2]])
                }));
                for side in Side::ALL {
                    let at = [i, j, k][side.direction];
                    if at + side.end == side.end * elements[side.direction] {
                        named_faces.entry(side.to_string()).or_default().push(Face { element: index, side });
                    }
                }
            }
        }
    }
    Mesh { named_faces, ..Mesh::new(element, parameters, corners) }
}
