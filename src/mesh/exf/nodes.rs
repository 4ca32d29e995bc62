//! Nodes of an EX file: their header, which names fields, components and labels, and their values.

use super::label;
use super::lines::{Lines, number_after, starts_something};
use crate::error::Result;
use std::collections::BTreeMap;

/// The line that opens a field in a header: `1) coordinates, coordinate, rectangular cartesian, real, #Components=3`.
#[derive(Debug, Clone)]
pub(super) struct FieldLine {
    pub name: String,
    /// Whether it is of the type `coordinate`.
    pub is_coordinate: bool,
    /// The coordinate system.
    pub system: String,
    /// The distance of the focus of a spheroidal system, `focus=`.
    pub focus: Option<f64>,
    /// Whether its values are numbers that stand at nodes.
    pub numeric: bool,
    /// Whether its values stand in the header.
    pub in_header: bool,
    pub components: usize,
}

/// One parameter of one component at a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Parameter {
    /// Bit mask of the derivative.
    pub label: u8,
    /// Version, from 1.
    pub version: u32,
    pub value: f64,
}

/// The parameters of a field at a node: per component, in the order of the file.
pub(super) type NodeField = Vec<Vec<Parameter>>;

/// A node: its fields by name.
pub(super) type Node = BTreeMap<String, NodeField>;

/// Bit mask of the derivative and version of each parameter of a component, in the order of the file.
type Labels = Vec<(u8, u32)>;

/// What the nodes that follow hold.
#[derive(Debug, Clone, Default)]
pub(super) struct NodeTemplate {
    /// Each field with the labels and versions of each component.
    fields: Vec<(FieldLine, Vec<Labels>)>,
}

impl FieldLine {
    pub fn read(lines: &mut Lines) -> Result<FieldLine> {
        const EXPECTED: &str =
            "a field, as in `1) coordinates, coordinate, rectangular cartesian, real, #Components=3`";
        let line = lines.take().ok_or_else(|| lines.wrong_next(EXPECTED))?;
        let read = || {
            let (number, rest) = line.split_once(')')?;
            number.trim().parse::<usize>().ok()?;
            let mut parts = rest.split(',').map(str::trim);
            let (name, kind) = (parts.next()?, parts.next()?);
            let parts: Vec<&str> = parts.collect();
            let in_header = parts.iter().any(|part| *part == "constant" || part.starts_with("indexed"));
            let other = |part: &&str| matches!(*part, "string" | "element_xi" | "url");
            let system = parts.iter().find(|part| {
                ["rectangular cartesian", "cylindrical polar", "spherical polar", "prolate spheroidal"]
                    .iter()
                    .chain(&["oblate spheroidal", "fibre"])
                    .any(|system| part.starts_with(system))
            });
            Some(FieldLine {
                name: name.into(),
                is_coordinate: kind == "coordinate",
                system: system.map_or("none", |part| part.split("focus").next().unwrap_or(part).trim()).into(),
                focus: focus(&parts)?,
                numeric: !in_header && !parts.iter().any(other),
                in_header,
                components: number_after(rest, "#Components").filter(|count| (1..=1000).contains(count))?,
            })
        };
        read().ok_or_else(|| lines.wrong(EXPECTED))
    }
}

/// The number of `focus=35.2`, which stands in a part of its own or in that of the system; `None` where it is no number.
fn focus(parts: &[&str]) -> Option<Option<f64>> {
    let Some((_, number)) = parts.iter().find_map(|part| part.split_once("focus")) else { return Some(None) };
    let number = number.trim_start().strip_prefix('=')?.trim().parse::<f64>().ok()?;
    (number.is_finite() && number > 0.0).then_some(Some(number))
}

impl NodeTemplate {
    /// Reads a header after its line `#Fields=`.
    pub fn read(lines: &mut Lines, fields: usize, version: u32) -> Result<NodeTemplate> {
        let mut template = NodeTemplate::default();
        for _ in 0..fields {
            let field = FieldLine::read(lines)?;
            let mut components = Vec::new();
            for _ in 0..field.components {
                let line = lines.take().ok_or_else(|| lines.wrong_next("a component of a field"))?;
                if !field.in_header {
                    let labels = if version < 2 { labels_of_version_1(line) } else { labels(line) };
                    components.push(labels.ok_or_else(|| lines.wrong(component_form(version)))?);
                }
            }
            template.fields.push((field, components));
        }
        if template.fields.iter().any(|(field, _)| field.in_header) && lines.take_after("Values").is_some() {
            lines.skip_until(starts_something);
        }
        Ok(template)
    }

    /// Reads the values of a node, after its line `Node:`, and adds its fields to `node`. Fields after one that holds
    /// no numbers are passed over.
    pub fn read_node(&self, lines: &mut Lines, node: &mut Node) -> Result<()> {
        let numeric = self.fields.iter().take_while(|(field, _)| field.numeric || field.in_header);
        let numeric: Vec<_> = numeric.filter(|(field, _)| field.numeric).collect();
        let count = numeric.iter().flat_map(|(_, components)| components).map(Vec::len).sum();
        let values: Vec<f64> = lines.values("", count, "numbers")?;
        if values.iter().any(|value| !value.is_finite()) {
            return Err(lines.wrong("finite numbers at the node"));
        }
        let mut values = values.into_iter();
        for (field, components) in numeric {
            let component = |labels: &Labels| {
                let labels = labels.iter().zip(values.by_ref());
                labels.map(|(&(label, version), value)| Parameter { label, version, value }).collect()
            };
            node.insert(field.name.clone(), components.iter().map(component).collect());
        }
        if self.fields.iter().any(|(field, _)| !field.numeric && !field.in_header) {
            lines.skip_until(starts_something);
        }
        Ok(())
    }
}

fn component_form(version: u32) -> &'static str {
    if version < 2 {
        "a component, as in `x. Value index=1, #Derivatives=1 (d/ds1), #Versions=2`"
    } else {
        "a component, as in `x. #Values=3 (value,d/ds1(2))`"
    }
}

/// `x. #Values=4 (value,d/ds1(2),d/ds2)`: the versions of a label follow each other.
fn labels(line: &str) -> Option<Labels> {
    let count = number_after(line, "#Values")?;
    let list = &line[line.find('(')? + 1..line.rfind(')')?.max(line.find('(')? + 1)];
    let mut labels = Vec::new();
    for entry in list.split(',').map(str::trim).filter(|entry| !entry.is_empty()) {
        let (name, versions) = match entry.split_once('(') {
            Some((name, versions)) => (name, versions.trim_end_matches(')').trim().parse::<u32>().ok()?),
            None => (entry, 1),
        };
        let label = label(name.trim())?;
        labels.extend((1..=versions.min(10_000)).map(|version| (label, version)));
    }
    (labels.len() == count).then_some(labels)
}

/// `x. Value index=1, #Derivatives=1 (d/ds1), #Versions=2`: the labels of a version follow each other.
fn labels_of_version_1(line: &str) -> Option<Labels> {
    number_after(line, "Value index")?;
    let derivatives = number_after(line, "#Derivatives")?;
    let mut names = vec![0];
    if derivatives > 0 {
        let (_, rest) = line.split_once('(')?;
        let (list, _) = rest.split_once(')')?;
        for name in list.split(',') {
            names.push(label(name.trim())?);
        }
    }
    let versions = if line.contains("#Versions") { number_after(line, "#Versions")? } else { 1 };
    let versions = u32::try_from(versions).ok().filter(|versions| (1..=10_000).contains(versions))?;
    let all = (1..=versions).flat_map(|version| names.iter().map(move |name| (*name, version)));
    (names.len() == derivatives + 1).then(|| all.collect())
}
