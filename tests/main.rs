//! All tests in one program: each program of its own would compile the same generic code again.
//!
//! `cargo test face::` runs the tests of one file, `cargo test -- --list` names them.

mod architecture;
mod bones;
mod broken;
mod chunks;
mod cli;
mod clips;
mod common;
mod contact;
mod convergence;
mod damaged;
mod disk;
mod effects;
mod elements;
mod estimate;
mod exf;
mod exf_coordinates;
mod explain;
mod export;
mod face;
mod fibres;
mod formats;
mod hard_cases;
mod head;
mod html;
mod identifiability;
mod laws;
mod linear_algebra;
mod muscle_rule;
mod objectives;
mod outer;
mod problems;
mod reachable;
mod readme;
mod recordings;
mod registration;
mod report;
mod resume;
mod scene;
mod smoother;
mod study;
mod terms;
mod twin;
mod verification;
mod work;
