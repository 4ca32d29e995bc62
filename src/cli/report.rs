//! `risorius report RUN`: one page that needs nothing else.

use super::Ending;
use super::terminal::print;
use crate::error::Result;
use crate::report::html;
use std::path::Path;

/// Writes `report.html` into the folder of the run.
pub(super) fn report(run: &Path) -> Result<Ending> {
    let path = html::write(run)?;
    let bytes = std::fs::metadata(&path).map(|data| data.len()).unwrap_or(0);
    print(&format!("wrote {} ({:.1} kB)\n", path.display(), bytes as f64 / 1e3))?;
    Ok(Ending::Ok)
}
