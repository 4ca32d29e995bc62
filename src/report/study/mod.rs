//! What a study leaves behind: `study.md`, `tables/study.csv`, `tables/effects.csv`, `tables/orders.csv`, pictures as SVG,
//! and `accuracy.toml`, the settings on the front, which `risorius run --accuracy` uses.

mod accuracy;
mod page;
mod pictures;
mod tables;

pub use accuracy::{Choice, read_choices};
pub use page::page;

use crate::error::Result;
use crate::report::run_folder::RunFolder;
use crate::scene::Study;
use crate::study::Outcome;

/// Writes everything; returns the page.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write(run: &RunFolder, study: &Study, outcome: &Outcome) -> Result<String> {
    let page = page(study, outcome);
    run.write("study.md", &page)?;
    run.write("tables/study.csv", tables::variants(study, outcome))?;
    run.write("tables/effects.csv", tables::effects(outcome))?;
    run.write("tables/orders.csv", tables::orders(study, outcome))?;
    run.write("accuracy.toml", accuracy::write(study, outcome))?;
    for (name, picture) in pictures::all(study, outcome) {
        run.write(name, picture)?;
    }
    Ok(page)
}
