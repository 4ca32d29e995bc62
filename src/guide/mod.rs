//! The guide: pages that are read here and where the source is. The README is their door.

#[doc = include_str!("accuracy.md")]
pub mod accuracy {}
#[doc = include_str!("adding.md")]
pub mod adding {}
#[doc = include_str!("checked.md")]
pub mod checked {}
#[doc = include_str!("face.md")]
pub mod face {}
#[doc = include_str!("fibres.md")]
pub mod fibres {}
#[doc = include_str!("problem_file.md")]
pub mod problem_file {}
#[doc = include_str!("recordings.md")]
pub mod recordings {}
#[doc = include_str!("results.md")]
pub mod results {}
