//! `report.html`: one page that needs nothing else, made from the folder of a run. Opens in a browser without a network, and
//! prints.

mod camera;
mod charts;
mod frame;
mod methods;
mod pictures;
mod run;
mod sides;
mod text;
mod told;
mod viewer;

use super::playback::{Playback, status};
use super::run_folder::write_atomically;
use crate::error::Result;
use std::path::{Path, PathBuf};

/// Writes the page of a run of any task into its folder.
///
/// # Errors
/// [`Error::NotARun`](crate::Error::NotARun), [`Error::DamagedRun`](crate::Error::DamagedRun),
/// [`Error::Io`](crate::Error::Io).
pub fn write(folder: &Path) -> Result<PathBuf> {
    let page = if folder.join("study.md").is_file() {
        text::study(folder, &status(folder)?)?
    } else if folder.join("fibres.exf").is_file() {
        text::fibres(folder, &status(folder)?)?
    } else {
        run::page(&Playback::read(folder)?)?
    };
    let path = folder.join("report.html");
    write_atomically(&path, page.as_bytes())?;
    Ok(path)
}
