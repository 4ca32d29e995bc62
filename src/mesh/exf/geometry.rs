//! From an EX file to a mesh.

use super::convert::{Conversion, convert};
use super::file::{ExFile, Region};
use super::sums::{FieldInElement, Key, Sum, unsupported};
use super::system::System;
use crate::error::{Error, Place, Result};
use crate::mesh::Mesh;
use crate::mesh::element::{Element, TricubicHermite, Trilinear};
use crate::mesh::face::{Face, boundary_faces};
use crate::mesh::map::{ElementMap, Term};
use std::collections::BTreeMap;

/// A mesh read from an EX file, with the identifiers that the file uses.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// The mesh. Where every element is trilinear in x, y and z, so is the mesh; otherwise it is tricubic Hermite. Its
    /// boundary faces are named `boundary` (all of them), `xi1=0` to `xi3=1` (all that are that side of their element) and,
    /// one by one, by element and side, for example `7:xi1=0`.
    pub mesh: Mesh,
    /// The identifier of each element.
    pub elements: Vec<i64>,
    /// The identifier of each node. A node whose position has several versions is several nodes of the mesh.
    pub nodes: Vec<i64>,
    /// The name of the field of coordinates.
    pub field: String,
    /// What the mesh lacks of the field in the file; `None` where they are the same.
    pub conversion: Option<Conversion>,
    /// Index of its region in the file.
    pub(super) region: usize,
}

/// What the elements of a field have in common.
struct Elements<'f> {
    all: Vec<FieldInElement<'f>>,
    /// Whether its coordinates are rectangular cartesian.
    cartesian: bool,
    basis: &'static dyn Element,
    /// The parameters of all elements in turn, if the three components have the same.
    locals: Option<Vec<Sum>>,
    /// The identifier of the node at each corner.
    corners: Vec<[i64; 8]>,
}

/// A mesh whose elements use nodal parameters as the file says.
pub(super) struct NodalMesh {
    pub mesh: Mesh,
    /// The identifier of each node.
    pub nodes: Vec<i64>,
    /// Which nodal parameter each global parameter is.
    pub keys: Vec<Key>,
}

impl ExFile {
    /// The mesh of the field `field`; without a name, of `coordinates`, or of the only field of coordinates.
    ///
    /// Where the three components share one map in x, y and z, the mesh has that map. Where they do not, its elements share
    /// what keeps them [`continuous`](crate::mesh::continuous::continuous), which is still the same shape. Curvilinear
    /// coordinates are no polynomials in x, y and z: the mesh takes over their values and derivatives at the
    /// corners of every element, and `conversion` says what is left between; [`ExFile::coordinates`] is the field itself.
    ///
    /// # Errors
    /// [`Error::ExField`] where there is no such field or no telling which, [`Error::ExUnsupported`] for what cannot be
    /// represented, [`Error::ExMissing`] for nodes and parameters that elements use and that are not there.
    pub fn geometry(&self, field: Option<&str>) -> Result<Geometry> {
        let (region, field) = self.choose(field)?;
        let elements = self.elements(&self.regions[region], &field)?;
        let identifiers: Vec<i64> = elements.all.iter().map(|element| element.element.identifier).collect();
        let nodal = match &elements.locals {
            Some(locals) => Some(self.nodal_mesh(&self.regions[region], &field, elements.basis, locals)?),
            None => None,
        };
        let (mut mesh, nodes, conversion) = match nodal {
            Some(nodal) if elements.cartesian => (nodal.mesh, nodal.nodes, None),
            nodal => convert(&self.coordinates(Some(&field))?, nodal, elements.basis, &elements.corners),
        };
        mesh.named_faces = named_faces(&mesh, &identifiers);
        Ok(Geometry { mesh, elements: identifiers, nodes, field, conversion, region })
    }

    /// The elements that define a field, checked for what can be read.
    fn elements<'f>(&'f self, region: &'f Region, field: &str) -> Result<Elements<'f>> {
        let all = self.field_in_elements(region, field);
        let mut cartesian = true;
        for element in &all {
            cartesian &= self.system(element, field)? == System::RectangularCartesian;
        }
        let components = || all.iter().flat_map(|element| element.components);
        let trilinear =
            cartesian && components().all(|component| matches!(&component.basis, Ok(basis) if basis.is_trilinear()));
        let basis: &'static dyn Element = if trilinear { &Trilinear } else { &TricubicHermite };
        let mut one_map = components().all(|component| component.unwind.is_none());
        let (mut locals, mut corners) = (Vec::new(), Vec::with_capacity(all.len()));
        for element in &all {
            let sums = |index| match trilinear {
                true => self.sums(region, element, field, index),
                false => self.hermite_sums(region, element, field, index),
            };
            let [x, y, z] = [sums(0)?, sums(1)?, sums(2)?];
            let nodes = corner_nodes(&x, basis);
            for others in [corner_nodes(&y, basis), corner_nodes(&z, basis)] {
                if let Some(corner) = (0..8).find(|k| nodes[*k].is_none() || others[*k] != nodes[*k]) {
                    return Err(unsupported(
                        format!(
                            "corner {} of element {}, whose position is not the value of a node",
                            corner + 1,
                            element.element.identifier
                        ),
                        "give every corner of every element a node of its own; a corner that hangs on an edge is not read",
                        &element.element.place,
                    ));
                }
            }
            corners.push(nodes.map(Option::unwrap_or_default));
            one_map &= x == y && x == z;
            if one_map {
                locals.extend(x);
            }
        }
        Ok(Elements { all, cartesian, basis, locals: one_map.then_some(locals), corners })
    }

    /// The mesh with the parameters `locals` of its elements, which are nodal parameters of all three components alike.
    fn nodal_mesh(
        &self,
        region: &Region,
        field: &str,
        basis: &'static dyn Element,
        locals: &[Sum],
    ) -> Result<NodalMesh> {
        let corners = locals.chunks_exact(basis.functions()).map(|sums| {
            let value = |corner: usize| sums[corner * basis.parameters_per_node()][0].0;
            std::array::from_fn(|corner| (value(corner).0, value(corner).1))
        });
        let corner_keys: Vec<[(i64, u32); 8]> = corners.collect();
        let mut node_index: BTreeMap<(i64, u32), usize> = corner_keys.iter().flatten().map(|key| (*key, 0)).collect();
        node_index.values_mut().enumerate().for_each(|(index, node)| *node = index);
        // a parameter belongs to the corner of its node and version, or else to the first corner that uses it
        let mut globals: BTreeMap<Key, usize> = BTreeMap::new();
        for (index, sum) in locals.iter().enumerate() {
            for ((node, version, label), _) in sum {
                let own = node_index.get(&(*node, *version)).or_else(|| node_index.get(&(*node, 1)));
                let corner =
                    corner_keys[index / basis.functions()][index % basis.functions() / basis.parameters_per_node()];
                globals.entry((*node, *version, *label)).or_insert(*own.unwrap_or(&node_index[&corner]));
            }
        }
        let keys: Vec<Key> = globals.keys().copied().collect();
        let index_of: BTreeMap<Key, u32> = keys.iter().enumerate().map(|(index, key)| (*key, index as u32)).collect();
        let terms = locals
            .iter()
            .map(|sum| sum.iter().map(|(key, scale)| Term { global: index_of[key], scale: *scale }).collect());
        let mut mesh = Mesh {
            element: basis,
            map: ElementMap::new(basis.functions(), terms),
            corners: corner_keys.iter().map(|corners| corners.map(|key| node_index[&key])).collect(),
            nodes: node_index.len(),
            parameter_node: globals.values().copied().collect(),
            parameter_derivative: keys.iter().map(|(_, _, label)| *label).collect(),
            parameters: Vec::with_capacity(keys.len()),
            named_faces: BTreeMap::new(),
        };
        for key in &keys {
            let mut parameter = [0.0; 3];
            for (component, value) in parameter.iter_mut().enumerate() {
                *value = self.value(region, field, component, *key)?;
            }
            mesh.parameters.push(parameter);
        }
        Ok(NodalMesh { mesh, nodes: node_index.keys().map(|(node, _)| *node).collect(), keys })
    }

    /// The field of coordinates to read, and its region.
    pub(super) fn choose(&self, field: Option<&str>) -> Result<(usize, String)> {
        let mut found: BTreeMap<&str, usize> = BTreeMap::new();
        let mut regions = Vec::new();
        for (index, region) in self.regions.iter().enumerate() {
            for element in &region.elements {
                for (line, _) in &self.templates[element.template].fields {
                    let named = field.is_none_or(|field| line.name == field);
                    if (line.is_coordinate || field.is_some()) && line.components == 3 && named {
                        found.insert(&line.name, index);
                        regions.push(index);
                    }
                }
            }
        }
        regions.dedup();
        let all = || {
            let templates = self.templates.iter().flat_map(|template| &template.fields);
            let mut names: Vec<String> = templates.map(|(line, _)| line.name.clone()).collect();
            names.sort();
            names.dedup();
            names
        };
        let error = |wanted: Option<&str>| Error::ExField {
            wanted: wanted.map(Into::into),
            found: all().join(", ").into(),
            place: Box::new(Place::whole(&self.file)),
        };
        if regions.len() > 1 {
            let paths: Vec<String> = regions.iter().map(|index| format!("`{}`", self.regions[*index].path)).collect();
            let construct = format!("elements in several regions ({})", paths.join(", "));
            return Err(unsupported(construct, "keep one region with elements per file", &Place::whole(&self.file)));
        }
        let name = match (field, found.len()) {
            (Some(_), _) | (None, 1) => found.keys().next().copied(),
            (None, _) => found.contains_key("coordinates").then_some("coordinates"),
        };
        name.map(|name| (found[name], name.to_string())).ok_or_else(|| error(field))
    }
}

/// The node whose value each corner of an element is, as far as it is one.
fn corner_nodes(sums: &[Sum], basis: &dyn Element) -> [Option<i64>; 8] {
    std::array::from_fn(|corner| match sums[corner * basis.parameters_per_node()][..] {
        [((node, _, 0), 1.0)] => Some(node),
        _ => None,
    })
}

fn named_faces(mesh: &Mesh, identifiers: &[i64]) -> BTreeMap<String, Vec<Face>> {
    let mut named: BTreeMap<String, Vec<Face>> = BTreeMap::new();
    for face in boundary_faces(mesh) {
        let own = format!("{}:{}", identifiers[face.element], face.side);
        for name in ["boundary".to_string(), face.side.to_string(), own] {
            named.entry(name).or_default().push(face);
        }
    }
    named
}
