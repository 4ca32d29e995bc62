//! An EX file as it stands: its regions with their nodes and elements.

use super::elements::{Element, ElementTemplate};
use super::lines::{Lines, number_after, starts_something};
use super::nodes::{Node, NodeTemplate};
use crate::error::{Error, Result};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Everything in an EX file that can become a mesh with fields: nodes and three-dimensional elements, and data points. Faces,
/// lines and groups are passed over.
#[derive(Debug, Clone)]
pub struct ExFile {
    pub(super) file: Arc<str>,
    pub(super) regions: Vec<Region>,
    pub(super) templates: Vec<ElementTemplate>,
}

/// The nodes and elements under one path.
#[derive(Debug, Clone, Default)]
pub(super) struct Region {
    pub path: String,
    pub nodes: BTreeMap<i64, Node>,
    pub points: BTreeMap<i64, Node>,
    pub elements: Vec<Element>,
}

/// What the lines so far mean for the next.
struct Reader<'a> {
    lines: Lines<'a>,
    version: u32,
    region: usize,
    /// Dimension of the elements that follow; 0 for nodes.
    dimension: usize,
    /// Whether nodes are data points.
    data_points: bool,
    /// The shape of the elements that follow, if it is not a cube.
    other_shape: Option<String>,
    /// The name under which the next header is kept.
    defining: Option<String>,
    node_template: Option<NodeTemplate>,
    element_template: Option<usize>,
    node_templates: HashMap<String, NodeTemplate>,
    element_templates: HashMap<String, usize>,
    file: ExFile,
}

impl ExFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::ExSyntax`] with the line that is not what the format asks for.
    pub fn read(path: &Path) -> Result<ExFile> {
        let bytes = std::fs::read(path).map_err(|source| Error::Io { action: "read", path: path.into(), source })?;
        ExFile::parse(&String::from_utf8_lossy(&bytes), &path.display().to_string())
    }

    /// Reads a text; `file` is what messages call it.
    ///
    /// # Errors
    /// [`Error::ExSyntax`] with the line that is not what the format asks for.
    pub fn parse(text: &str, file: &str) -> Result<ExFile> {
        let lines = Lines::new(file, text);
        let file = ExFile { file: lines.file.clone(), regions: vec![Region::default()], templates: Vec::new() };
        let mut reader = Reader {
            lines,
            version: 1,
            region: 0,
            dimension: 0,
            data_points: false,
            other_shape: None,
            defining: None,
            node_template: None,
            element_template: None,
            node_templates: HashMap::new(),
            element_templates: HashMap::new(),
            file,
        };
        while let Some(line) = reader.lines.take() {
            reader.line(line)?;
        }
        Ok(reader.file)
    }
}

impl Reader<'_> {
    fn line(&mut self, line: &str) -> Result<()> {
        let after = |keyword: &str| {
            let rest = line.strip_prefix(keyword)?.trim_start();
            Some(rest.strip_prefix(':').unwrap_or(rest).trim())
        };
        if let Some(rest) = after("EX Version") {
            self.version = rest
                .parse()
                .ok()
                .filter(|version| (1..=3).contains(version))
                .ok_or_else(|| self.lines.wrong("version 1, 2 or 3 of the format"))?;
        } else if let Some(path) = after("Region") {
            self.enter_region(path);
        } else if after("Group name").is_some() {
            // a group selects from what the region holds
        } else if line.starts_with("Node group") || line.starts_with("Element group") {
            self.lines.skip_until(starts_something);
        } else if let Some(name) = after("!#nodeset") {
            (self.dimension, self.data_points) = (0, !name.starts_with("nodes"));
        } else if line.starts_with("!#mesh") {
            self.dimension =
                number_after(line, "dimension").ok_or_else(|| self.lines.wrong("`dimension=` of the mesh"))?;
        } else if let Some(name) = after("Define node template").or(after("Define element template")) {
            self.defining = Some(name.to_string());
        } else if let Some(name) = after("Node template") {
            let template = self.node_templates.get(name).cloned();
            self.node_template =
                Some(template.ok_or_else(|| self.lines.wrong("the name of a node template defined before"))?);
        } else if let Some(name) = after("Element template") {
            let template = self.element_templates.get(name).copied();
            self.element_template =
                Some(template.ok_or_else(|| self.lines.wrong("the name of an element template defined before"))?);
        } else if line.starts_with("Shape") {
            self.shape(line)?;
        } else if line.starts_with("#Fields") {
            self.node_header(line)?;
        } else if line.starts_with("#Scale factor sets") {
            self.element_header(line)?;
        } else if let Some(number) = after("Node") {
            self.node(number)?;
        } else if let Some(number) = after("Element") {
            self.element(number)?;
        } else {
            return Err(self.lines.wrong("a line that opens a node, an element or their header"));
        }
        Ok(())
    }

    fn enter_region(&mut self, path: &str) {
        let known = self.file.regions.iter().position(|region| region.path == path);
        self.region = known.unwrap_or_else(|| {
            self.file.regions.push(Region { path: path.into(), ..Region::default() });
            self.file.regions.len() - 1
        });
    }

    /// `Shape. Dimension=3, line*line*line`.
    fn shape(&mut self, line: &str) -> Result<()> {
        let dimension =
            number_after(line, "Dimension").ok_or_else(|| self.lines.wrong("`Dimension=` of the shape"))?;
        self.dimension = dimension;
        let shape: String = line.split_once(',').map_or("", |(_, shape)| shape).split_whitespace().collect();
        let cube = shape.is_empty() || shape.split('*').all(|line| line == "line");
        self.other_shape = (!cube).then_some(shape);
        Ok(())
    }

    fn node_header(&mut self, line: &str) -> Result<()> {
        let fields = number_after(line, "#Fields").ok_or_else(|| self.lines.wrong("`#Fields=` and a number"))?;
        let template = NodeTemplate::read(&mut self.lines, fields, self.version)?;
        if let Some(name) = self.defining.take() {
            self.node_templates.insert(name, template.clone());
        }
        self.node_template = Some(template);
        Ok(())
    }

    fn element_header(&mut self, line: &str) -> Result<()> {
        let sets = number_after(line, "#Scale factor sets");
        let sets = sets.ok_or_else(|| self.lines.wrong("`#Scale factor sets=` and a number"))?;
        let template = ElementTemplate::read(&mut self.lines, sets, self.version, self.other_shape.clone())?;
        self.file.templates.push(template);
        let index = self.file.templates.len() - 1;
        if let Some(name) = self.defining.take() {
            self.element_templates.insert(name, index);
        }
        self.element_template = Some(index);
        Ok(())
    }

    fn node(&mut self, number: &str) -> Result<()> {
        let number = number.parse::<i64>().map_err(|_| self.lines.wrong("`Node:` and its number"))?;
        let Some(template) = &self.node_template else {
            return Err(self.lines.wrong("`#Fields=` before the first node"));
        };
        let region = &mut self.file.regions[self.region];
        let nodes = if self.data_points { &mut region.points } else { &mut region.nodes };
        template.read_node(&mut self.lines, nodes.entry(number).or_default())
    }

    /// `Element: 7`, or in version 1 `Element: 7 0 0` (faces and lines have their number in the other places).
    fn element(&mut self, numbers: &str) -> Result<()> {
        let numbers: Vec<i64> = numbers.split_whitespace().map_while(|number| number.parse().ok()).collect();
        let number = match (&numbers[..], self.version) {
            ([number, _, _], 1) | ([number], 2..) => *number,
            _ if self.version < 2 => return Err(self.lines.wrong("`Element:` and three numbers")),
            _ => return Err(self.lines.wrong("`Element:` and its number")),
        };
        let Some(index) = self.element_template else {
            return Err(self.lines.wrong("a header before the first element"));
        };
        let template = &self.file.templates[index];
        let element = template.read_element(&mut self.lines, number, index)?;
        if self.dimension == 3 && !template.fields.is_empty() {
            self.file.regions[self.region].elements.push(element);
        }
        Ok(())
    }
}
