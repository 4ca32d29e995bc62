//! Several bodies as one mesh: their nodes, parameters and elements one after the other, none shared.

use super::Mesh;
use super::face::Face;
use super::map::{ElementMap, Term};

/// Joins meshes of one kind of element. A face that is called `xi1=0` in the part `lip` is called `lip:xi1=0`; `xi1=0` are
/// those of all parts.
///
/// # Panics
/// Without parts, or where their elements differ.
pub fn join(parts: &[(String, Mesh)]) -> Mesh {
    let element = parts[0].1.element;
    let mut locals = Vec::new();
    let mut whole = Mesh::new(element, Vec::new(), Vec::new());
    for (name, part) in parts {
        assert!(part.element.name() == element.name(), "one kind of element");
        let (parameter, node, first) = (whole.parameters.len(), whole.nodes, whole.corners.len());
        for e in 0..part.elements() {
            for a in 0..element.functions() {
                let shift = |t: &Term| Term { global: t.global + parameter as u32, ..*t };
                locals.push(part.map.terms(e, a).iter().map(shift).collect());
            }
        }
        whole.parameters.extend(&part.parameters);
        whole.corners.extend(part.corners.iter().map(|corners| corners.map(|k| k + node)));
        whole.parameter_node.extend(part.parameter_node.iter().map(|k| k + node));
        whole.parameter_derivative.extend(&part.parameter_derivative);
        whole.nodes += part.nodes;
        for (face, own) in &part.named_faces {
            let moved = own.iter().map(|f| Face { element: f.element + first, ..*f });
            whole.named_faces.entry(face.clone()).or_default().extend(moved.clone());
            whole.named_faces.insert(format!("{name}:{face}"), moved.collect());
        }
    }
    Mesh { map: ElementMap::new(element.functions(), locals), ..whole }
}
