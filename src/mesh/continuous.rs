//! Meshes from elements that are each a polynomial of their own and only meet in value at the faces they share.
//!
//! Two tricubic Hermites agree on a face where its four nodes have the same values, derivatives along the face's edges
//! and cross derivatives in the face. So a value belongs to a node, a derivative to an edge (at one of its ends), a cross
//! derivative to a face (at one of its corners) and the triple derivative to an element. Shared in this way the body
//! stays whole in every motion; its tangents need not be continuous across faces, as they are where nodes share derivatives.

use super::Mesh;
use super::element::{Element, ends};
use super::map::{ElementMap, Term};
use crate::math::tensor::{Vector, norm, subtract};
use std::collections::{BTreeMap, HashMap};

/// Two parameters of one node that differ by less than this part of the body's size are one.
const SAME: f64 = 1e-7;

/// A place where elements share parameters: a node, and the other nodes of the edge or face.
type Place = (usize, [usize; 3]);

/// A mesh that is continuous wherever neighbouring elements agree on their common face, from the local parameters of each
/// element (mm, mm per unit xi) and the node at each of its corners. Edges and faces are known by their nodes; where
/// two of the same nodes have different shapes, each keeps its own. What is collapsed (an edge whose ends are one node and
/// whose derivatives along it are zero) stays so in every motion. No faces are named.
///
/// # Panics
/// Where nodes are not numbered from 0 without gaps.
pub fn continuous(element: &'static dyn Element, corners: Vec<[usize; 8]>, locals: &[[[f64; 64]; 3]]) -> Mesh {
    let per_node = element.parameters_per_node();
    let nodes = corners.iter().flatten().max().map_or(0, |node| node + 1);
    let tolerance = SAME * size(locals, per_node);
    let mut mesh = Mesh {
        element,
        map: ElementMap::new(element.functions(), []),
        nodes,
        parameters: Vec::new(),
        parameter_node: Vec::new(),
        parameter_derivative: Vec::new(),
        named_faces: BTreeMap::new(),
        corners,
    };
    let mut known: HashMap<Place, Vec<usize>> = HashMap::new();
    let mut terms = Vec::with_capacity(locals.len() * element.functions());
    for (corners, local) in mesh.corners.iter().zip(locals) {
        for a in 0..element.functions() {
            let (corner, derivative) = (a / per_node, a % per_node);
            let node = corners[corner];
            // derivatives as seen from the node: along its edges, away from it
            let sign =
                (0..3).filter(|d| derivative >> d & 1 == 1 && ends(corner)[*d] == 1).fold(1.0, |s, _: usize| -s);
            let value: Vector = std::array::from_fn(|i| sign * local[i][a]);
            if norm(value) <= tolerance && collapsed(corners, corner, derivative) {
                terms.push(Vec::new());
                continue;
            }
            let place = place(corners, corner, derivative);
            let mut new = Vec::new();
            let found = match place {
                Some(place) => known.entry(place).or_default(),
                None => &mut new,
            };
            let shared = found.iter().copied().find(|p| norm(subtract(mesh.parameters[*p], value)) <= tolerance);
            let global = shared.unwrap_or_else(|| {
                found.push(mesh.parameters.len());
                mesh.parameters.push(value);
                mesh.parameter_node.push(node);
                mesh.parameter_derivative.push(derivative as u8);
                mesh.parameters.len() - 1
            });
            terms.push(vec![Term { global: global as u32, scale: sign }]);
        }
    }
    mesh.map = ElementMap::new(element.functions(), terms);
    mesh
}

/// The longest side of the box around all corners of elements with these local parameters, mm.
pub(super) fn size(locals: &[[[f64; 64]; 3]], per_node: usize) -> f64 {
    let extent = |i: usize| {
        let values = locals.iter().flat_map(|local| (0..8).map(move |corner| local[i][corner * per_node]));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    (0..3).map(extent).fold(0.0, f64::max)
}

/// Whether all edges of an element along one direction of a derivative are points, as far as the derivative sees them.
fn collapsed(corners: &[usize; 8], corner: usize, derivative: usize) -> bool {
    let directions = (0..3).map(|d| 1 << d).filter(|bit| derivative & bit != 0);
    let parts = |mask: usize| (0..8).filter(move |part| part & mask == *part);
    directions
        .into_iter()
        .any(|bit| parts(derivative & !bit).all(|part| corners[corner ^ part] == corners[corner ^ part ^ bit]))
}

/// Where a parameter is shared; `None` for the triple derivative, which is not.
fn place(corners: &[usize; 8], corner: usize, derivative: usize) -> Option<Place> {
    const NONE: usize = usize::MAX;
    let bits: Vec<usize> = (0..3).map(|d| 1 << d).filter(|bit| derivative & bit != 0).collect();
    let others = match bits[..] {
        [] => [NONE; 3],
        [a] => [corners[corner ^ a], NONE, NONE],
        [a, b] => {
            let (p, q) = (corners[corner ^ a], corners[corner ^ b]);
            [p.min(q), p.max(q), corners[corner ^ a ^ b]]
        }
        _ => return None,
    };
    Some((corners[corner], others))
}
