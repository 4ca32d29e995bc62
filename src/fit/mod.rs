//! From markers back to controls: which activations put the markers where the recording saw them.
//!
//!   minimise over q:  1/2 sum over present markers |m_k(q) - z_k|^2 / sd_k^2 + what else is asked for,   lower <= q <= upper
//!
//! m_k(q) is the place of marker k at the equilibrium of the forward model; nothing of this is known to the forward.
//! [`objective`] has the rest.
//! Each frame is a Gauss-Newton iteration ([`gauss_newton`]) run by argmin, each step a box-constrained quadratic program
//! solved by Clarabel ([`bounded_step`]), on sensitivities by the implicit function theorem or by finite differences
//! ([`sensitivity`]). Before the first, the recording is brought to the model ([`registration`]). Frames follow each other
//! warm ([`sequence`]), in [`chunks`] side by side, and may then be smoothed all at once ([`smoother`]); [`covariance`] and
//! [`identifiability`] say how far an answer can be believed, [`advise`] which further markers would tell more. [`outer`] finds
//! what all frames share.

pub mod advise;
pub mod bias;
mod bone_shape;
pub mod bounded_step;
pub mod chunks;
pub mod covariance;
pub mod estimate;
pub mod frame;
pub mod free_head;
pub mod gauss_newton;
pub mod head;
mod head_error;
pub mod identifiability;
pub mod objective;
mod observed;
pub mod outer;
pub mod placement;
pub mod recording;
pub mod registration;
pub mod sensitivity;
pub mod sequence;
pub mod smoother;

pub use estimate::Estimate;
pub use sequence::Fit;
