//! The cases that break solvers: each must converge, or say why not, and never lie.
//!
//! `cargo test hard_cases:: -- --nocapture | grep '^|'` prints how each of them ended and what it took.

mod contact;
mod invariance;
mod muscles;
mod paths;
mod record;
mod shapes;
mod snap;
