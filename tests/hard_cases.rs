//! The cases that break solvers: each must converge, or say why not, and never lie.
//!
//! `cargo test --test hard_cases -- --nocapture | grep '^|'` prints how each of them ended and what it took.

#[path = "hard_cases/contact.rs"]
mod contact;
#[path = "hard_cases/invariance.rs"]
mod invariance;
#[path = "hard_cases/muscles.rs"]
mod muscles;
#[path = "hard_cases/paths.rs"]
mod paths;
#[path = "hard_cases/record.rs"]
mod record;
#[path = "hard_cases/shapes.rs"]
mod shapes;
#[path = "hard_cases/snap.rs"]
mod snap;
#[path = "verification/support.rs"]
#[allow(dead_code)] // a part of what the verification cases share
mod support;
