//! `risorius inspect FILE`: what is in a marker recording, or in the folder of a run.

use super::Ending;
use super::terminal::print;
use crate::error::{Error, Result};
use crate::markers;
use crate::report::playback::Contents;
use serde::Serialize;
use std::fmt::Display;
use std::path::Path;

pub(super) fn inspect(file: &Path, json: bool) -> Result<Ending> {
    if file.is_dir() { show(&Contents::of(file)?, json) } else { show(&markers::inspect(file)?, json) }
}

fn show(found: &(impl Serialize + Display), json: bool) -> Result<Ending> {
    if json {
        let text = serde_json::to_string_pretty(found).map_err(|error| Error::Io {
            action: "write",
            path: "standard output".into(),
            source: error.into(),
        })?;
        print(&(text + "\n"))?;
    } else {
        print(&found.to_string())?;
    }
    Ok(Ending::Ok)
}
