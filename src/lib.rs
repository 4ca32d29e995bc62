#![forbid(unsafe_code)]
#![warn(missing_docs)]
//! risorius finds out which muscles moved a face.

pub mod error;
pub mod markers;

pub use error::{Error, Result};
