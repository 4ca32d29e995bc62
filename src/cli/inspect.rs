//! `risorius inspect FILE`: what is in a marker recording.

use super::Ending;
use super::terminal::print;
use crate::error::{Error, Result};
use crate::markers;
use std::path::Path;

pub(super) fn inspect(file: &Path, json: bool) -> Result<Ending> {
    let inspection = markers::inspect(file)?;
    if json {
        let text = serde_json::to_string_pretty(&inspection).map_err(|error| Error::Io {
            action: "write",
            path: "standard output".into(),
            source: error.into(),
        })?;
        print(&(text + "\n"))?;
    } else {
        print(&inspection.to_string())?;
    }
    Ok(Ending::Ok)
}
