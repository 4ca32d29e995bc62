//! From an EX file to a mesh: every element parameter as a sum of scale x global parameter.

use super::LABELS;
use super::elements::{Component, Element, Source};
use super::file::{ExFile, Region};
use super::nodes::{FieldLine, NodeField};
use crate::error::{Error, Place, Result};
use crate::mesh::Mesh;
use crate::mesh::element::{TricubicHermite, Trilinear};
use crate::mesh::face::{Face, boundary_faces};
use crate::mesh::map::{ElementMap, Term};
use std::collections::BTreeMap;

/// A mesh read from an EX file, with the identifiers that the file uses.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// The mesh. Where every element is trilinear, so is the mesh; otherwise it is tricubic Hermite. Its boundary faces
    /// are named `boundary` (all of them), `xi1=0` to `xi3=1` (all that are that side of their element) and, one by one,
    /// by element and side, for example `7:xi1=0`.
    pub mesh: Mesh,
    /// The identifier of each element.
    pub elements: Vec<i64>,
    /// The identifier of each node. A node whose value has several versions is several nodes of the mesh.
    pub nodes: Vec<i64>,
    /// The name of the field of coordinates.
    pub field: String,
    /// Index of its region in the file.
    pub(super) region: usize,
}

/// A nodal parameter: node, version, bit mask of the derivative.
type Key = (i64, u32, u8);

/// An element parameter: nodal parameters and their scales.
type Sum = Vec<(Key, f64)>;

/// A field in one element.
pub(super) struct FieldInElement<'f> {
    pub element: &'f Element,
    pub line: &'f FieldLine,
    pub components: &'f [Component],
}

impl ExFile {
    /// The mesh of the field `field`; without a name, of `coordinates`, or of the only field of coordinates.
    ///
    /// # Errors
    /// [`Error::ExField`] where there is no such field or no telling which, [`Error::ExUnsupported`] for what cannot be
    /// represented, [`Error::ExMissing`] for nodes and parameters that elements use and that are not there.
    pub fn geometry(&self, field: Option<&str>) -> Result<Geometry> {
        let (region, field) = self.choose(field)?;
        let elements = self.field_in_elements(&self.regions[region], &field);
        let nodes = &self.regions[region];
        let trilinear = elements.iter().all(|element| {
            element.components.iter().all(|component| matches!(&component.basis, Ok(basis) if basis.is_trilinear()))
        });
        let basis: &'static dyn crate::mesh::element::Element = if trilinear { &Trilinear } else { &TricubicHermite };

        let mut locals: Vec<Sum> = Vec::with_capacity(elements.len() * basis.functions());
        let mut corner_keys: Vec<[(i64, u32); 8]> = Vec::with_capacity(elements.len());
        for element in &elements {
            let sums = self.parameters(nodes, element, &field, trilinear)?;
            let mut corners = [(0, 0); 8];
            for (corner, key) in corners.iter_mut().enumerate() {
                *key = match sums[corner * basis.parameters_per_node()][..] {
                    [((node, version, 0), 1.0)] => (node, version),
                    _ => {
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
                };
            }
            corner_keys.push(corners);
            locals.extend(sums);
        }

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
        let index_of: BTreeMap<Key, u32> =
            globals.keys().enumerate().map(|(index, key)| (*key, index as u32)).collect();
        let terms = locals
            .iter()
            .map(|sum| sum.iter().map(|(key, scale)| Term { global: index_of[key], scale: *scale }).collect());
        let mut mesh = Mesh {
            element: basis,
            map: ElementMap::new(basis.functions(), terms),
            corners: corner_keys.iter().map(|corners| corners.map(|key| node_index[&key])).collect(),
            nodes: node_index.len(),
            parameter_node: globals.values().copied().collect(),
            parameter_derivative: globals.keys().map(|(_, _, label)| *label).collect(),
            parameters: Vec::with_capacity(globals.len()),
            named_faces: BTreeMap::new(),
        };
        for key in globals.keys() {
            let mut parameter = [0.0; 3];
            for (component, value) in parameter.iter_mut().enumerate() {
                *value = self.value(nodes, &field, component, *key)?;
            }
            mesh.parameters.push(parameter);
        }
        let identifiers: Vec<i64> = elements.iter().map(|element| element.element.identifier).collect();
        mesh.named_faces = named_faces(&mesh, &identifiers);
        let nodes = node_index.keys().map(|(node, _)| *node).collect();
        Ok(Geometry { mesh, elements: identifiers, nodes, field, region })
    }

    /// The field of coordinates to read, and its region.
    fn choose(&self, field: Option<&str>) -> Result<(usize, String)> {
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

    /// The elements that define a field, in the order of the file; a later definition replaces an earlier one.
    pub(super) fn field_in_elements<'f>(&'f self, region: &'f Region, field: &str) -> Vec<FieldInElement<'f>> {
        let mut position: BTreeMap<i64, usize> = BTreeMap::new();
        let mut all: Vec<FieldInElement> = Vec::new();
        for element in &region.elements {
            let fields = &self.templates[element.template].fields;
            let Some((line, components)) = fields.iter().find(|(line, _)| line.name == field) else { continue };
            let place = *position.entry(element.identifier).or_insert(all.len());
            let this = FieldInElement { element, line, components };
            match all.get_mut(place) {
                Some(earlier) => *earlier = this,
                None => all.push(this),
            }
        }
        all
    }

    /// The parameters of an element, one map for its three components.
    fn parameters(
        &self,
        region: &Region,
        element: &FieldInElement,
        field: &str,
        trilinear: bool,
    ) -> Result<Vec<Sum>> {
        if let Some(shape) = &self.templates[element.element.template].other_shape {
            let construct = format!("an element of shape `{shape}`");
            return Err(unsupported(construct, "only cubes (line*line*line) are read", &element.element.place));
        }
        let system = &element.line.system;
        if system != "rectangular cartesian" {
            return Err(unsupported(
                format!("the {system} coordinates of field `{field}`"),
                "convert the field to rectangular cartesian coordinates first: inside elements the conversion is no \
                 polynomial, so it is a fit and not a reading",
                &element.components[0].place,
            ));
        }
        let [x, y, z] = element.components else { return Ok(Vec::new()) };
        let first = self.sums(region, element, field, 0, trilinear)?;
        for (index, component) in [(1, y), (2, z)] {
            if self.sums(region, element, field, index, trilinear)? != first {
                return Err(unsupported(
                    format!(
                        "components `{}` and `{}` of field `{field}` that use different parameters in element {}",
                        x.name, component.name, element.element.identifier
                    ),
                    "give all components the same basis, labels and scale factors",
                    &component.place,
                ));
            }
        }
        Ok(first)
    }

    /// The element parameters of one component in the mesh's basis.
    pub(super) fn sums(
        &self,
        region: &Region,
        element: &FieldInElement,
        field: &str,
        index: usize,
        trilinear: bool,
    ) -> Result<Vec<Sum>> {
        let component = &element.components[index];
        let basis = component.basis.clone().map_err(|construct| unsupported(
            construct,
            "bases that are products of l.Lagrange, q.Lagrange, c.Lagrange and c.Hermite are read, node based and unmodified",
            &component.place,
        ))?;
        let mut functions: Vec<Sum> = Vec::with_capacity(component.functions.len());
        for terms in &component.functions {
            let mut sum = Sum::new();
            for term in terms {
                let node = element.element.nodes[term.node];
                let (label, version) = match term.source {
                    Source::Label(label, version) => (label, version),
                    Source::Index(place) => {
                        let parameters = self.node(region, field, node, &element.element.place)?.get(index);
                        let parameter = parameters.and_then(|parameters| parameters.get(place - 1));
                        parameter.map(|parameter| (parameter.label, parameter.version)).ok_or_else(|| {
                            missing(
                                format!("value {place} of component `{}` at node {node}", component.name),
                                &element.element.place,
                            )
                        })?
                    }
                };
                let scale = term.scales.iter().map(|scale| element.element.scale_factors[*scale]).product();
                add(&mut sum, (node, version, label), scale);
            }
            functions.push(sum);
        }
        if trilinear || basis.is_tricubic_hermite() {
            return Ok(functions);
        }
        let composed = basis.hermite_weights().into_iter().map(|weights| {
            let mut sum = Sum::new();
            for (function, weight) in weights {
                for (key, scale) in &functions[function] {
                    add(&mut sum, *key, weight * scale);
                }
            }
            sum
        });
        Ok(composed.collect())
    }

    fn node<'f>(&'f self, region: &'f Region, field: &str, node: i64, place: &Place) -> Result<&'f NodeField> {
        let fields = region.nodes.get(&node).ok_or_else(|| missing(format!("node {node}"), place))?;
        fields.get(field).ok_or_else(|| missing(format!("field `{field}` at node {node}"), place))
    }

    /// The value of a nodal parameter.
    pub(super) fn value(&self, region: &Region, field: &str, component: usize, key: Key) -> Result<f64> {
        let (node, version, label) = key;
        let whole = Place::whole(&self.file);
        let parameters = self.node(region, field, node, &whole)?.get(component);
        let mut parameters = parameters.into_iter().flatten();
        let found = parameters.find(|parameter| (parameter.version, parameter.label) == (version, label));
        found.map(|parameter| parameter.value).ok_or_else(|| {
            let label = LABELS[usize::from(label)];
            missing(
                format!(
                    "{label} (version {version}) of component {} of field `{field}` at node {node}",
                    component + 1
                ),
                &whole,
            )
        })
    }
}

/// Adds scale x key to a sum; equal keys are added up and a scale of 0 is left out.
fn add(sum: &mut Sum, key: Key, scale: f64) {
    match sum.iter().position(|(known, _)| *known == key) {
        Some(place) => sum[place].1 += scale,
        None => sum.push((key, scale)),
    }
    sum.retain(|(_, scale)| *scale != 0.0);
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

pub(super) fn unsupported(construct: String, help: &'static str, place: &Place) -> Error {
    Error::ExUnsupported { construct, help, place: Box::new(place.clone()) }
}

pub(super) fn missing(what: String, place: &Place) -> Error {
    Error::ExMissing { what, place: Box::new(place.clone()) }
}
