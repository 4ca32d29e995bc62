//! EX files, as CMISS, cmgui and Zinc write them (versions 1, 2 and 3): meshes, fibre angles, results.
//!
//! An EX file gives every element-local parameter as a sum of scale x nodal parameter, which is what an
//! [`ElementMap`](super::map::ElementMap) holds: scale factors, versions, permuted and reversed directions, `zero`
//! labels, sums of parameters and collapsed elements all read as such sums. A direction that is linear, quadratic or
//! cubic Lagrange is exact in cubic Hermite form, where its derivatives are differences of its values. The displacement of a
//! host has the map of its geometry, so it is of that lower order there too.
//!
//! [`ExFile::coordinates`] evaluates a field as the file means it: in its coordinate system, every component on a map and a
//! basis of its own, angles unwound. [`ExFile::geometry`] makes a mesh of it for the mechanics, which needs one map in x, y
//! and z: it is the same shape wherever the field is a polynomial in x, y, z, and of curvilinear coordinates it is the
//! Hermite with the same values and derivatives at the corners of every element.
//!
//! Nodes and data points with a vector are read as such by [`ExFile::vectors`].
//!
//! Refused with file, line and construct: other systems of coordinates, simplices, grids, hanging corners.
//!
//! Version 1 keeps nodes and elements in two files; one file that holds both, one after the other, is read here.

mod angles;
mod basis;
mod convert;
mod coordinates;
mod elements;
mod file;
mod geometry;
mod inspect;
mod jet;
mod lines;
mod nodes;
mod sums;
mod system;
mod theta;
mod vectors;
mod write;
mod write_angles;

pub use convert::Conversion;
pub use coordinates::Coordinates;
pub use file::ExFile;
pub use geometry::Geometry;
pub use inspect::{ExContents, ExFieldContents, inspect};
pub use write::{Points, write_elements, write_mesh, write_mesh_with, write_points};
pub use write_angles::write_angles;

/// Labels of nodal parameters, indexed by the bit mask d1 + 2 d2 + 4 d3 of their derivative.
const LABELS: [&str; 8] = ["value", "d/ds1", "d/ds2", "d2/ds1ds2", "d/ds3", "d2/ds1ds3", "d2/ds2ds3", "d3/ds1ds2ds3"];

/// The bit mask of a label.
fn label(text: &str) -> Option<u8> {
    LABELS.iter().position(|known| *known == text).map(|mask| mask as u8)
}
