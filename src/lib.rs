#![forbid(unsafe_code)]
#![warn(missing_docs)]
//! risorius finds out which muscles moved a face.

pub mod cli;
pub mod error;
pub mod scene;

pub use error::{Error, Place, Result, Warning};
