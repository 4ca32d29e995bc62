//! What a user types and sees. Prints, never computes.

pub mod diagnostics;
