#![forbid(unsafe_code)]
#![warn(missing_docs)]
//! risorius finds out which muscles moved a face.

pub mod cli;
pub mod error;
pub mod fit;
pub mod forward;
pub mod markers;
pub mod material;
pub mod math;
pub mod mesh;
pub mod model;
pub mod report;
pub mod scene;
pub mod solve;
pub mod term;

pub use error::{Error, Place, Result, Warning};
