//! EX files, as CMISS, cmgui and Zinc write them (versions 1, 2 and 3): meshes, fibre angles, results.
//!
//! An EX file gives every element-local parameter as a sum of scale x nodal parameter, which is what an
//! [`ElementMap`](super::map::ElementMap) holds: scale factors, versions, permuted and reversed directions, `zero`
//! labels, sums of parameters and collapsed elements all read as such sums. A direction that is linear, quadratic or
//! cubic Lagrange is exact in cubic Hermite form, where its derivatives are differences of its values. The displacement of a
//! host has the map of its geometry, so it is of that lower order there too.
//!
//! What cannot be said in one map for all three components is refused with its file, line and construct: curvilinear
//! coordinates (a polynomial in prolate coordinates is none in x, y, z), components with maps of their own, simplices,
//! grids, hanging corners.
//!
//! Version 1 keeps nodes and elements in two files; one file that holds both, one after the other, is read here.

mod angles;
mod basis;
mod elements;
mod file;
mod geometry;
mod lines;
mod nodes;
mod write;

pub use file::ExFile;
pub use geometry::Geometry;
pub use write::{Points, write_mesh, write_points};

/// Labels of nodal parameters, indexed by the bit mask d1 + 2 d2 + 4 d3 of their derivative.
const LABELS: [&str; 8] = ["value", "d/ds1", "d/ds2", "d2/ds1ds2", "d/ds3", "d2/ds1ds3", "d2/ds2ds3", "d3/ds1ds2ds3"];

/// The bit mask of a label.
fn label(text: &str) -> Option<u8> {
    LABELS.iter().position(|known| *known == text).map(|mask| mask as u8)
}
