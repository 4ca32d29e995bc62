//! A grid of points and cells with fields on them.

use super::xml::Before;
use crate::error::Result;
use crate::math::tensor::Vector;
use crate::report::run_folder::{failed, write_atomically};
use std::path::Path;

/// Points, cells of one kind, and fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Its time, s.
    pub time_s: f64,
    /// Points, mm.
    pub points: Vec<Vector>,
    /// The kind of all cells.
    pub kind: CellKind,
    /// The points of each cell in turn, in the order that VTK gives to this kind.
    pub connectivity: Vec<i64>,
    /// Fields on points.
    pub on_points: Vec<Field>,
    /// Fields on cells.
    pub on_cells: Vec<Field>,
}

/// A kind of cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// A single point.
    Vertex,
    /// A straight line between two points.
    Line,
    /// A hexahedron with straight edges.
    Hexahedron,
    /// A Bezier hexahedron of order 3, without weights.
    BezierHexahedron,
}

impl CellKind {
    /// Its number in VTK.
    pub fn number(self) -> u8 {
        match self {
            CellKind::Vertex => 1,
            CellKind::Line => 3,
            CellKind::Hexahedron => 12,
            CellKind::BezierHexahedron => 79,
        }
    }

    /// Points of a cell.
    pub fn points(self) -> usize {
        match self {
            CellKind::Vertex => 1,
            CellKind::Line => 2,
            CellKind::Hexahedron => 8,
            CellKind::BezierHexahedron => 64,
        }
    }
}

/// A field on points or cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its name, with the unit where it has one.
    pub name: &'static str,
    /// Its values.
    pub values: Values,
}

/// One value per point or cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers.
    Scalars(Vec<f64>),
    /// Vectors.
    Vectors(Vec<Vector>),
    /// Indices.
    Integers(Vec<i64>),
}

impl Grid {
    /// Points, each a cell of its own.
    pub fn vertices(time_s: f64, points: Vec<Vector>, on_points: Vec<Field>) -> Grid {
        let connectivity = (0..points.len() as i64).collect();
        Grid { time_s, points, kind: CellKind::Vertex, connectivity, on_points, on_cells: Vec::new() }
    }

    /// The number of cells.
    pub fn cells(&self) -> usize {
        self.connectivity.len() / self.kind.points()
    }

    /// Writes the grid as a VTU file, atomically.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io).
    pub fn write(&self, path: &Path) -> Result<()> {
        self.write_after(path, &mut Before::default())
    }

    /// Writes the grid as the next file of a series.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io).
    pub fn write_after(&self, path: &Path, before: &mut Before) -> Result<()> {
        let bytes = super::xml::file(self, before).map_err(failed("write", path))?;
        write_atomically(path, &bytes)
    }
}

impl Field {
    /// A scalar field.
    pub fn scalars(name: &'static str, values: Vec<f64>) -> Field {
        Field { name, values: Values::Scalars(values) }
    }

    /// A vector field.
    pub fn vectors(name: &'static str, values: Vec<Vector>) -> Field {
        Field { name, values: Values::Vectors(values) }
    }

    /// A field of indices.
    pub fn integers(name: &'static str, values: Vec<i64>) -> Field {
        Field { name, values: Values::Integers(values) }
    }
}
