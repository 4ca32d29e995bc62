//! Fibre angles of an EX file: a field of the coordinate system `fibre`, in radians, trilinear in every element.

use super::file::ExFile;
use super::geometry::Geometry;
use super::sums::{missing, unsupported};
use crate::error::{Error, Place, Result};
use crate::math::tensor::{Matrix, dot};
use crate::mesh::fibre_angles::{FibreAngles, axes};
use std::collections::BTreeMap;

impl ExFile {
    /// The angles of the field `field` at the nodes of a mesh from this file. The components are the fibre angle, the
    /// imbrication angle and the sheet angle, in this order; those that are not there are 0. A node may have several
    /// versions that are the same axes: then elements keep their own.
    ///
    /// # Errors
    /// [`Error::ExField`] where there is no such field, [`Error::ExUnsupported`] where it is not one angle per node in
    /// trilinear elements, [`Error::ExMissing`] where an element of the mesh or a node lacks it.
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
            let mut angles = [[0.0; 3]; 8];
            for (index, component) in element.components.iter().enumerate() {
                if matches!(&component.basis, Ok(basis) if !basis.is_trilinear()) {
                    let construct =
                        format!("component `{}` of field `{field}` with a basis of higher order", component.name);
                    return Err(unsupported(
                        construct,
                        "give fibre angles the basis l.Lagrange*l.Lagrange*l.Lagrange",
                        &component.place,
                    ));
                }
                let sums = self.sums(region, element, field, index)?;
                for (corner, sum) in angles.iter_mut().zip(sums) {
                    for (key, scale) in sum {
                        corner[index] += scale * self.value(region, field, index, key)?;
                    }
                }
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
        Ok(FibreAngles { nodes: nodes.into_iter().map(Option::unwrap_or_default).collect(), own })
    }
}

/// Whether two triples of angles are the same three axes, without a sign.
fn same_axes(one: [f64; 3], other: [f64; 3]) -> bool {
    const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let pairs = axes(&IDENTITY, one).into_iter().zip(axes(&IDENTITY, other));
    pairs.into_iter().all(|(a, b)| dot(a, b).abs() > 1.0 - 1e-9)
}
