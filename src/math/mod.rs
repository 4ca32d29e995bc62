//! Mathematics that knows nothing of mechanics.
//!
//! The linear systems of a mixed displacement-pressure body are symmetric, indefinite and blocked: the unknowns come in
//! small contiguous *groups* (one a mesh node, or one an element), and every element couples all of its groups.
//!
//! - [`sparse`]: the fixed pattern of such a matrix, its values, its product with vectors.
//! - [`ordering`]: in which order the groups are eliminated, so that little work is needed.
//! - [`factor`]: A = L B L^T, solves with refinement, the signs of the eigenvalues.

pub mod factor;
pub mod ordering;
mod refine;
pub mod sparse;
