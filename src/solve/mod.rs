//! Roots of r(x) = 0, without knowing any mechanics: Newton's method and the path that leads to the root.

pub mod newton;
pub mod path;
