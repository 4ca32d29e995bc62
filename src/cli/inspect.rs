//! `risorius inspect FILE`: what is in a marker recording, in an EX file, in a file of VTK, in what was exported, or in the
//! folder of a run.

use super::Ending;
use super::terminal::print;
use crate::error::{Error, Result};
use crate::mesh::exf;
use crate::report::export::inspect::inspect as exported;
use crate::report::playback::Contents;
use crate::{fibres, markers};
use serde::Serialize;
use std::fmt::Display;
use std::path::Path;

pub(super) fn inspect(file: &Path, json: bool) -> Result<Ending> {
    if file.is_dir() {
        return show(&Contents::of(file)?, json);
    }
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("exf" | "ex" | "exnode" | "exelem") => show(&exf::inspect(file)?, json),
        Some("vtk" | "vtu" | "vtp") => show(&fibres::inspect::inspect(file)?, json),
        _ => match exported(file)? {
            Some(exhibit) => show(&exhibit, json),
            None => show(&markers::inspect(file)?, json),
        },
    }
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
