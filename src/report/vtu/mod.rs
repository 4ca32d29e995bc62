//! VTU: unstructured grids as ParaView reads them, one kind of shape per file.

pub mod bezier;
pub mod contact;
pub mod grid;
pub mod linear;
pub mod markers;
pub mod muscles;
pub mod residuals;
mod sample;
pub mod xml;

pub use grid::{CellKind, Field, Grid, Values};
