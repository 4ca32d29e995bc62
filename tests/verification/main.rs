//! Closed forms and solved cases from an independent implementation, one file each.

mod prescribed_state;
mod solved_cases;
mod support;
