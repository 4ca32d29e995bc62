//! FAMILY of pressure spaces: the functions psi_c of p = sum psi_c p_c in each element.
//!
//! Both there are have the trilinear functions of the corners c, which have the places e_c = 0 or 1 along each direction:
//!
//! ```text
//! psi_c(xi) = product over d of (e_cd xi_d + (1 - e_cd) (1 - xi_d))
//! ```
//!
//! To add one: a file here, and its line in [`PRESSURE_SPACES`].

pub mod discontinuous_trilinear;
pub mod trilinear;

pub use discontinuous_trilinear::DiscontinuousTrilinear;
pub use trilinear::Trilinear;

use super::MAX_PRESSURES;
use crate::mesh::Mesh;

/// Every pressure space there is.
pub const PRESSURE_SPACES: [&dyn PressureSpace; 2] = [&Trilinear, &DiscontinuousTrilinear];

/// How the pressure is interpolated.
pub trait PressureSpace: Send + Sync + std::fmt::Debug {
    /// The name used in problem files and results.
    fn name(&self) -> &'static str;

    /// psi_c(xi); unused entries are zero.
    fn values(&self, xi: [f64; 3]) -> [f64; MAX_PRESSURES];

    /// The number of global pressure parameters.
    fn count(&self, mesh: &Mesh) -> usize;

    /// The global parameters of an element, one per function.
    fn parameters(&self, mesh: &Mesh, element: usize) -> Vec<usize>;

    /// Where global parameter `index` lives: unknowns of one place are kept together in the linear system.
    fn place(&self, index: usize) -> PressurePlace;
}

/// The part of the mesh that a pressure parameter belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PressurePlace {
    /// At a node of the mesh.
    Node(usize),
    /// Inside one element.
    Element(usize),
}
