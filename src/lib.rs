#![forbid(unsafe_code)]
#![warn(missing_docs)]
//! risorius finds out which muscles moved a face.

pub mod error;
pub mod math;

pub use error::{Error, Result};
