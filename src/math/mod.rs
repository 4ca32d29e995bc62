//! Nothing of mechanics: small tensors, vector lanes, quadrature, sparse matrices and their factorisation.
//!
//! The linear systems of a mixed displacement-pressure body are symmetric, indefinite and blocked: the unknowns come in
//! small contiguous *groups* (one a mesh node, or one an element), and every element couples all of its groups.

pub mod assignment;
pub mod block_tridiagonal;
pub mod factor;
pub mod lanes;
pub mod motion;
pub mod normal;
pub mod ordering;
pub mod quadrature;
mod refine;
pub mod sparse;
pub mod tensor;
