//! Nothing of mechanics: small tensors, vector lanes, quadrature, sparse matrices and their factorisation.

pub mod lanes;
pub mod quadrature;
pub mod tensor;
