//! Fibre angles from measured directions.
//!
//! A measured axis m has no sign and no angle: it is compared with the fitted fibre n by the angle between two lines,
//! theta = acos |m . n|. The nodal angles are sought that minimise
//!
//!   sum over axes w rho(theta) + lambda sum over elements of the integral over the unit cube of |dA/dxi|^2 + |dB/dxi|^2
//!
//! The angles are trilinear, or tricubic Hermite as the body is ([`space`]).
//!
//! 1. [`embed`]: every point is found in the mesh, its axis taken into the frame (f1, f2, f3) there. Where much of the data
//!    runs along f3, about which the angle A says nothing, the local directions are renamed in a cycle first.
//! 2. [`start`]: the tensors m m^T are fitted by a linear least-squares field; its principal axes at the nodes are the start.
//! 3. [`branches`]: which of the angles A + k pi each corner of each element continues from, asked of the data inside, so that
//!    no element wraps.
//! 4. [`descent`]: Gauss-Newton steps on the true angular error, run by argmin. For a quadratic rho the gradient is exact. The
//!    two angles meet at right angles on the sphere, so their normal equations are apart, each the size of the mesh.
//! 5. [`smoothness`]: lambda by generalised cross-validation.
//! 6. [`certainty`]: standard deviations, nodes that the data do not determine, errors of data held out.

pub mod branches;
pub mod certainty;
pub mod csv;
pub mod data;
pub mod descent;
pub mod embed;
pub mod exf;
pub mod inspect;
pub mod misfit;
pub mod moments;
pub mod normal;
pub mod pattern;
pub mod roughness;
pub mod smoothness;
pub mod space;
pub mod start;
pub mod streamlines;
pub mod vtk;
pub mod xml;

mod fit;
mod fitted;
mod outcome;

pub use data::{Axes, Axis};
pub use fit::{fit, mesh, place};
pub use outcome::{ElementErrors, FibreFit, NodeAngles, Spread, measured};
