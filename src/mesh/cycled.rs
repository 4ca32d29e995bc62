//! The same body with its local directions renamed: xi2, xi3, xi1 in the place of xi1, xi2, xi3, and so on.
//!
//! Fibre angles are relative to the local directions and lose their meaning where the fibre runs along f3. Renamed in a
//! cycle the directions stay right-handed, and what ran along the third runs along another.

use super::Mesh;
use super::map::ElementMap;
use std::collections::BTreeMap;

/// The mesh whose direction d is the direction (d + shift) mod 3 of `mesh`. Nodes, elements and global parameters keep
/// their numbers; no faces are named.
pub fn cycled(mesh: &Mesh, shift: usize) -> Mesh {
    let per_node = mesh.element.parameters_per_node();
    let functions = mesh.element.functions();
    let terms = (0..mesh.elements()).flat_map(|element| {
        (0..functions).map(move |a| {
            let (corner, derivative) = (a / per_node, a % per_node);
            mesh.map.terms(element, old(corner, shift) * per_node + old(derivative, shift)).to_vec()
        })
    });
    Mesh {
        element: mesh.element,
        parameters: mesh.parameters.clone(),
        map: ElementMap::new(functions, terms),
        corners: mesh.corners.iter().map(|corners| std::array::from_fn(|k| corners[old(k, shift)])).collect(),
        nodes: mesh.nodes,
        parameter_node: mesh.parameter_node.clone(),
        parameter_derivative: mesh
            .parameter_derivative
            .iter()
            .map(|mask| old(usize::from(*mask), 3 - shift % 3) as u8)
            .collect(),
        named_faces: BTreeMap::new(),
    }
}

/// The old bits of a mask of directions: bit d of `mask` is bit (d + shift) mod 3 of the answer.
fn old(mask: usize, shift: usize) -> usize {
    (0..3).map(|d| (mask >> d & 1) << ((d + shift) % 3)).sum()
}
