//! `risorius export RUN --to glb,mcap`: a finished run for other programs.

use super::terminal::print;
use super::{Ending, Flags};
use crate::error::Result;
use crate::report::export::{Format, export as write};
use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::path::Path;

impl ValueEnum for Format {
    fn value_variants<'a>() -> &'a [Format] {
        const ALL: [Format; Format::ALL.len()] = {
            let mut all = [Format::Glb; Format::ALL.len()];
            let mut k = 0;
            while k < all.len() {
                all[k] = Format::ALL[k].0;
                k += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (_, word, about) = Format::ALL.iter().find(|(format, ..)| format == self)?;
        Some(PossibleValue::new(*word).help(*about))
    }
}

/// Writes into `--out`, or else into the folder `export` of the run.
pub(super) fn export(run: &Path, formats: &[Format], frame: Option<usize>, flags: &Flags) -> Result<Ending> {
    let folder = flags.out.clone().unwrap_or_else(|| run.join("export"));
    let done = write(run, formats, frame, &folder)?;
    flags.warn(&done.warnings);
    let mut page = String::new();
    for file in &done.files {
        let bytes = std::fs::metadata(file).map(|data| data.len()).unwrap_or(0);
        page += &format!("wrote {} ({:.1} kB)\n", file.display(), bytes as f64 / 1e3);
    }
    print(&page)?;
    Ok(if flags.strict && !done.warnings.is_empty() { Ending::Warned } else { Ending::Ok })
}
