//! What is in a file of VTK that measured directions may be read from.

use super::vtk::{Array, Dataset, axes, dataset};
use crate::error::Result;
use crate::math::tensor::Vector;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// What a file of VTK holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VtkContents {
    /// The file.
    pub path: PathBuf,
    /// Its length, bytes.
    pub bytes: u64,
    /// Points.
    pub points: usize,
    /// Cells.
    pub cells: usize,
    /// Those of them that are lines.
    pub lines: usize,
    /// Its arrays.
    pub fields: Vec<VtkField>,
    /// Least and greatest coordinates, in the unit of the file.
    pub extent: Option<[Vector; 2]>,
    /// What a problem may say to use it.
    pub uses: Vec<String>,
}

/// An array of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VtkField {
    /// Its name.
    pub name: String,
    /// Whether it is on points, and not on cells.
    pub on_points: bool,
    /// Numbers per point or cell.
    pub components: usize,
    /// Its least and greatest finite number.
    pub range: Option<[f64; 2]>,
}

/// Says what is in a VTK, VTU or VTP file.
///
/// # Errors
/// Those of reading it.
pub fn inspect(path: &Path) -> Result<VtkContents> {
    let data = dataset(path)?;
    let field = |array: &Array, on_points: bool| {
        let finite = array.values.iter().copied().filter(|x| x.is_finite());
        let range = finite.fold(None, |range: Option<[f64; 2]>, x| {
            let [low, high] = range.unwrap_or([x; 2]);
            Some([low.min(x), high.max(x)])
        });
        VtkField { name: array.name.clone(), on_points, components: array.components, range }
    };
    let on_points = data.on_points.iter().map(|array| field(array, true));
    let extent = data.points.iter().fold(None, |extent: Option<[Vector; 2]>, x| {
        let [low, high] = extent.unwrap_or([*x; 2]);
        Some([std::array::from_fn(|i| low[i].min(x[i])), std::array::from_fn(|i| high[i].max(x[i]))])
    });
    Ok(VtkContents {
        path: path.into(),
        bytes: std::fs::metadata(path).map_or(0, |known| known.len()),
        points: data.points.len(),
        cells: data.cells.len(),
        lines: data.lines.iter().filter(|is_line| **is_line).count(),
        fields: on_points.chain(data.on_cells.iter().map(|array| field(array, false))).collect(),
        extent,
        uses: uses(path, &data),
    })
}

/// Every field of directions, or else the lines.
fn uses(path: &Path, data: &Dataset) -> Vec<String> {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let arrays = data.on_points.iter().chain(&data.on_cells).filter(|array| array.is_direction());
    let names: Vec<&str> = arrays.map(|array| array.name.as_str()).collect();
    let line = |name: Option<&str>| {
        let found = axes(data, name).ok()?;
        let field = match name {
            Some(name) if names.len() > 1 => format!(", field = \"{name}\""),
            _ => String::new(),
        };
        Some(format!("[[fibres.data]]: file = \"{file}\"{field} ({} axes)", found.all.len()))
    };
    if names.is_empty() {
        line(None).into_iter().collect()
    } else {
        names.iter().filter_map(|n| line(Some(n))).collect()
    }
}

impl fmt::Display for VtkContents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let VtkContents { path, bytes, points, cells, lines, .. } = self;
        writeln!(f, "{}: {bytes} bytes, {points} points, {cells} cells, {lines} of them lines", path.display())?;
        if let Some([[x, y, z], [u, v, w]]) = self.extent {
            writeln!(f, "  from ({x:.3}, {y:.3}, {z:.3}) to ({u:.3}, {v:.3}, {w:.3})")?;
        }
        writeln!(f, "fields")?;
        for VtkField { name, on_points, components, range } in &self.fields {
            let place = if *on_points { "points" } else { "cells" };
            write!(f, "  {name}: {components} components on {place}")?;
            match range {
                Some([low, high]) => writeln!(f, ", from {low:.4} to {high:.4}")?,
                None => writeln!(f)?,
            }
        }
        writeln!(f, "{}", if self.uses.is_empty() { "of no use to a problem" } else { "a problem uses it as" })?;
        self.uses.iter().try_for_each(|line| writeln!(f, "  {line}"))
    }
}
