//! Fibre angles of an EX file: a field of the coordinate system `fibre`, in radians, trilinear in every element or of a basis
//! that a tricubic Hermite holds.

use super::file::ExFile;
use super::geometry::Geometry;
use super::sums::{missing, unsupported};
use crate::error::{Error, Place, Result};
use crate::math::tensor::{Matrix, dot};
use crate::mesh::element::MAX_FUNCTIONS;
use crate::mesh::fibre_angles::{FibreAngles, axes};
use std::collections::BTreeMap;

impl ExFile {
    /// The angles of the field `field` at the nodes of a mesh from this file. The components are the fibre angle, the
    /// imbrication angle and the sheet angle, in this order; those that are not there are 0. A node may have several
    /// versions that are the same axes: then elements keep their own. Where some component of some element is not trilinear, the
    /// whole field is read as tricubic Hermite, which is the same field.
    ///
    /// # Errors
    /// [`Error::ExField`] where there is no such field, [`Error::ExUnsupported`] where it is not one axis per node or
    /// of another basis, [`Error::ExMissing`] where an element of the mesh or a node lacks it.
    pub fn angles(&self, field: &str, geometry: &Geometry) -> Result<FibreAngles> {
        let region = &self.regions[geometry.region];
        let elements = self.field_in_elements(region, field);
        let by_identifier: BTreeMap<i64, _> =
            elements.iter().map(|element| (element.element.identifier, element)).collect();
        if elements.is_empty() {
            let names = self
                .templates
                .iter()
                .flat_map(|template| &template.fields)
                .filter(|(line, _)| line.system == "fibre");
            let mut names: Vec<&str> = names.map(|(line, _)| line.name.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            let place = Box::new(Place::whole(&self.file));
            return Err(Error::ExField { wanted: Some(field.into()), found: names.join(", ").into(), place });
        }
        let mut nodes: Vec<Option<[f64; 3]>> = vec![None; geometry.mesh.nodes];
        let mut own = BTreeMap::new();
        let components = || elements.iter().flat_map(|element| element.components);
        let is_tricubic =
            components().any(|component| matches!(&component.basis, Ok(basis) if !basis.is_trilinear()));
        let mut tricubic = Vec::new();
        for (index, (identifier, corners)) in geometry.elements.iter().zip(&geometry.mesh.corners).enumerate() {
            let Some(element) = by_identifier.get(identifier) else {
                return Err(missing(format!("field `{field}` in element {identifier}"), &Place::whole(&self.file)));
            };
            let place = &element.components[0].place;
            if element.line.system != "fibre" || element.components.len() > 3 {
                let construct = format!("field `{field}` as fibre angles");
                let help = "name a field of the coordinate system `fibre` with at most 3 components, in radians";
                return Err(unsupported(construct, help, place));
            }
            let mut functions = [[0.0; 3]; MAX_FUNCTIONS];
            for index in 0..element.components.len() {
                let sums = match is_tricubic {
                    true => self.hermite_sums(region, element, field, index)?,
                    false => self.sums(region, element, field, index)?,
                };
                for (function, sum) in functions.iter_mut().zip(sums) {
                    for (key, scale) in sum {
                        function[index] += scale * self.value(region, field, index, key)?;
                    }
                }
            }
            let per_node = if is_tricubic { 8 } else { 1 };
            let angles = std::array::from_fn(|corner| functions[per_node * corner]);
            if is_tricubic {
                tricubic.push(functions);
            }
            for (node, here) in corners.iter().zip(&angles) {
                let known = *nodes[*node].get_or_insert(*here);
                if known == *here {
                    continue;
                }
                if !same_axes(known, *here) {
                    let construct =
                        format!("different values of field `{field}` at one corner, node {}", geometry.nodes[*node]);
                    return Err(unsupported(
                        construct,
                        "give fibre angles one version at every node, or versions that are the same axes",
                        &element.element.place,
                    ));
                }
                own.insert(index, angles);
            }
        }
        let nodes = nodes.into_iter().map(Option::unwrap_or_default).collect();
        Ok(FibreAngles { nodes, own, tricubic: is_tricubic.then_some(tricubic) })
    }
}

/// Whether two triples of angles are the same three axes, without a sign.
fn same_axes(one: [f64; 3], other: [f64; 3]) -> bool {
    const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let pairs = axes(&IDENTITY, one).into_iter().zip(axes(&IDENTITY, other));
    pairs.into_iter().all(|(a, b)| dot(a, b).abs() > 1.0 - 1e-9)
}
