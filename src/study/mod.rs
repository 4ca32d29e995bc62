//! What accuracy costs in time: one problem solved in many ways, each with its error and its cost.
//!
//! ```text
//! Study (the file) -> variants -> prepare, solve, time -> errors against the reference -> orders, front, advice
//! ```
//!
//! A variant that fails is listed with its code. Seconds come with counts of work, because a machine is noisy and counts
//! are not.

pub mod estimate;
pub mod front;
pub mod norms;
pub mod order;
pub mod solution;
pub mod sweep;
pub mod timing;
pub mod variants;

pub use estimate::Estimated;
pub use norms::Errors;
pub use solution::{Prepared, Solution};
pub use sweep::{Outcome, Solved, Sweep, VariantResult};
pub use timing::Timing;
pub use variants::{Variant, variants};
