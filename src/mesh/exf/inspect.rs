//! What is in an EX file, and what a problem can use it for.

use super::file::{ExFile, Region};
use crate::error::{Error, Result};
use crate::math::tensor::Vector;
use crate::mesh::{MaterialPoint, Mesh};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// Points of an element along each direction from which its extent is told, ends included.
const PLACES: usize = 5;

/// What an EX file holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExContents {
    /// The file.
    pub path: PathBuf,
    /// Its length, bytes.
    pub bytes: u64,
    /// Nodes.
    pub nodes: usize,
    /// Data points.
    pub data_points: usize,
    /// Three-dimensional elements.
    pub elements: usize,
    /// Its fields by name.
    pub fields: BTreeMap<String, ExFieldContents>,
    /// Least and greatest coordinates of the elements, or else of nodes and points with `coordinates`.
    pub extent: Option<[Vector; 2]>,
    /// What a problem may say to use it.
    pub uses: Vec<String>,
    /// What cannot be used, and why.
    pub refused: Vec<String>,
}

/// A field of a file.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ExFieldContents {
    /// Its coordinate system where elements have it: `fibre` of angles.
    pub system: Option<String>,
    /// The bases of its components in elements; `?` for one that is not read.
    pub bases: BTreeSet<String>,
    /// Elements that have it.
    pub elements: usize,
    /// Nodes and data points that have it.
    pub nodes: usize,
    /// Its components.
    pub components: usize,
}

/// Says what is in an EX file.
///
/// # Errors
/// Those of [`ExFile::read`].
pub fn inspect(path: &Path) -> Result<ExContents> {
    let file = ExFile::read(path)?;
    let bytes = std::fs::metadata(path).map_or(0, |known| known.len());
    let count = |of: fn(&Region) -> usize| file.regions.iter().map(of).sum();
    let mut contents = ExContents {
        path: path.into(),
        bytes,
        nodes: count(|region| region.nodes.len()),
        data_points: count(|region| region.points.len()),
        elements: count(|region| region.elements.iter().map(|e| e.identifier).collect::<BTreeSet<_>>().len()),
        fields: fields(&file),
        extent: None,
        uses: Vec::new(),
        refused: Vec::new(),
    };
    contents.find_uses(&file);
    Ok(contents)
}

fn fields(file: &ExFile) -> BTreeMap<String, ExFieldContents> {
    let mut fields: BTreeMap<String, ExFieldContents> = BTreeMap::new();
    for region in &file.regions {
        for (name, values) in region.nodes.values().chain(region.points.values()).flatten() {
            let field = fields.entry(name.clone()).or_default();
            field.nodes += 1;
            field.components = field.components.max(values.len());
        }
        for element in &region.elements {
            for (line, components) in &file.templates[element.template].fields {
                let field = fields.entry(line.name.clone()).or_default();
                field.system.get_or_insert_with(|| line.system.clone());
                field.elements += 1;
                field.components = field.components.max(components.len());
                let basis = |c: &super::elements::Component| c.basis.as_ref().map_or("?".into(), ToString::to_string);
                field.bases.extend(components.iter().map(basis));
            }
        }
    }
    fields
}

impl ExContents {
    fn find_uses(&mut self, file: &ExFile) {
        let exf = self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let in_elements: Vec<(String, ExFieldContents)> =
            self.fields.iter().filter(|(_, f)| f.elements > 0).map(|(n, f)| (n.clone(), f.clone())).collect();
        let (angles, others): (Vec<_>, Vec<_>) =
            in_elements.into_iter().partition(|(_, field)| field.system.as_deref() == Some("fibre"));
        let mut first = None;
        for (name, _) in others.into_iter().filter(|(_, field)| field.components == 3) {
            match file.geometry(Some(&name)) {
                Ok(geometry) => {
                    self.widen(&geometry.mesh);
                    let is_host = geometry.mesh.element.parameters_per_node() == 8;
                    let whose = if is_host { "[mesh] or [[muscle]]" } else { "[[muscle]]" };
                    self.uses.push(format!("{whose}: exf = \"{exf}\", field = \"{name}\""));
                    first.get_or_insert(geometry);
                }
                Err(error) => self.refuse(&name, &error),
            }
        }
        for (name, _) in angles {
            let Some(geometry) = &first else { continue };
            match file.angles(&name, geometry) {
                Ok(found) => {
                    let kind = if found.tricubic.is_some() { "tricubic Hermite" } else { "trilinear" };
                    let own = match found.own.len() {
                        0 => String::new(),
                        own => format!(", half turns of their own in {own} elements"),
                    };
                    self.uses.push(format!("[[muscle]]: angles_field = \"{name}\" ({kind}{own})"));
                }
                Err(error) => self.refuse(&name, &error),
            }
        }
        for name in file.vector_fields() {
            let places = file.vectors(&name);
            self.uses.push(format!("[[fibres.data]]: file = \"{exf}\", field = \"{name}\" ({} axes)", places.len()));
            if first.is_none() {
                places.iter().for_each(|(place, _)| self.hold(*place));
            }
        }
    }

    fn refuse(&mut self, name: &str, error: &Error) {
        self.refused.push(format!("field `{name}`: {error}"));
    }

    fn widen(&mut self, mesh: &Mesh) {
        for element in 0..mesh.elements() {
            for k in 0..PLACES.pow(3) {
                let place = |k: usize| (k % PLACES) as f64 / (PLACES - 1) as f64;
                let xi = [place(k), place(k / PLACES), place(k / PLACES / PLACES)];
                self.hold(mesh.position(MaterialPoint { element, xi }));
            }
        }
    }

    fn hold(&mut self, place: Vector) {
        let [least, greatest] = self.extent.get_or_insert([place; 2]);
        for i in 0..3 {
            (least[i], greatest[i]) = (least[i].min(place[i]), greatest[i].max(place[i]));
        }
    }
}

impl fmt::Display for ExContents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ExContents { path, bytes, nodes, data_points, elements, .. } = self;
        writeln!(
            f,
            "{}: {bytes} bytes, {nodes} nodes, {data_points} data points, {elements} elements",
            path.display()
        )?;
        if let Some([[x, y, z], [u, v, w]]) = self.extent {
            writeln!(f, "  from ({x:.3}, {y:.3}, {z:.3}) to ({u:.3}, {v:.3}, {w:.3})")?;
        }
        writeln!(f, "fields")?;
        for (name, field) in &self.fields {
            write!(f, "  {name}: {} components; at {} nodes", field.components, field.nodes)?;
            if field.elements > 0 {
                let bases: Vec<&str> = field.bases.iter().map(String::as_str).collect();
                let system = field.system.as_deref().unwrap_or("none");
                write!(f, "; in {} elements, {system}, {}", field.elements, bases.join(" and "))?;
            }
            writeln!(f)?;
        }
        writeln!(f, "{}", if self.uses.is_empty() { "of no use to a problem" } else { "a problem uses it as" })?;
        self.uses.iter().try_for_each(|line| writeln!(f, "  {line}"))?;
        self.refused.iter().try_for_each(|line| writeln!(f, "not used: {line}"))
    }
}
