//! How the elements of a file use nodal parameters: every element parameter as a sum of scale x nodal parameter.

use super::LABELS;
use super::basis::Basis;
use super::elements::{Component, Element, Source};
use super::file::{ExFile, Region};
use super::nodes::{FieldLine, NodeField};
use super::system::System;
use crate::error::{Error, Place, Result};
use std::collections::BTreeMap;

/// A nodal parameter: node, version, bit mask of the derivative.
pub(super) type Key = (i64, u32, u8);

/// An element parameter: nodal parameters and their scales.
pub(super) type Sum = Vec<(Key, f64)>;

/// A field in one element.
pub(super) struct FieldInElement<'f> {
    pub element: &'f Element,
    pub line: &'f FieldLine,
    pub components: &'f [Component],
}

impl ExFile {
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

    /// The coordinate system of a field in an element.
    pub(super) fn system(&self, element: &FieldInElement, field: &str) -> Result<System> {
        if let Some(shape) = &self.templates[element.element.template].other_shape {
            let construct = format!("an element of shape `{shape}`");
            return Err(unsupported(construct, "only cubes (line*line*line) are read", &element.element.place));
        }
        if element.components.len() != 3 {
            let construct = format!("{} components of field `{field}` in an element", element.components.len());
            return Err(unsupported(construct, "give coordinates three components", &element.element.place));
        }
        System::of(element.line).map_err(|system| {
            unsupported(
                format!("the {system} of field `{field}`"),
                "rectangular cartesian, cylindrical polar, spherical polar and prolate spheroidal coordinates (with \
                 `focus=`) are read",
                &element.components[0].place,
            )
        })
    }

    /// The basis of one component.
    pub(super) fn basis(&self, element: &FieldInElement, index: usize) -> Result<Basis> {
        let component = &element.components[index];
        component.basis.clone().map_err(|construct| {
            unsupported(
                construct,
                "bases that are products of l.Lagrange, q.Lagrange, c.Lagrange and c.Hermite are read, node based",
                &component.place,
            )
        })
    }

    /// The parameters of the functions of one component, in the basis of the file.
    pub(super) fn sums(
        &self,
        region: &Region,
        element: &FieldInElement,
        field: &str,
        index: usize,
    ) -> Result<Vec<Sum>> {
        let component = &element.components[index];
        self.basis(element, index)?;
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
        Ok(functions)
    }

    /// The same in the tricubic Hermite basis.
    pub(super) fn hermite_sums(
        &self,
        region: &Region,
        element: &FieldInElement,
        field: &str,
        index: usize,
    ) -> Result<Vec<Sum>> {
        let (basis, functions) = (self.basis(element, index)?, self.sums(region, element, field, index)?);
        if basis.is_tricubic_hermite() {
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

pub(super) fn unsupported(construct: String, help: &'static str, place: &Place) -> Error {
    Error::ExUnsupported { construct, help, place: Box::new(place.clone()) }
}

pub(super) fn missing(what: String, place: &Place) -> Error {
    Error::ExMissing { what, place: Box::new(place.clone()) }
}
