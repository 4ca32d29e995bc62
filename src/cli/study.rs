//! Task `study`: one problem solved in many ways, its errors and its times.

use super::progress::Meter;
use super::run::{Tally, begin, finish};
use super::terminal::print;
use super::{Ending, Flags};
use crate::error::{Error, Result};
use crate::forward::Work;
use crate::report;
use crate::scene::{ReferenceSpec, Study};
use crate::study::{Prepared, Sweep, variants};
use std::path::Path;
use std::sync::Arc;

/// Solves, times and compares all variants; leaves tables, pictures and a page, which is printed.
pub(super) fn run(study: &Study, path: &Path, flags: &Flags) -> Result<Ending> {
    if flags.dry_run {
        return check(study);
    }
    let run = begin(&study.name, &[path, &study.problem], Arc::default(), flags)?;
    // the reference, every variant once, then all repetitions
    let mut meter = Meter::new(flags, 1 + variants(study).len() + study.repetitions, Some(&run.log));
    let mut tell = |line: &str| meter.frame(line, &[]);
    let outcome = Sweep::new(study, &mut tell, &|| run.is_interrupted()).run();
    meter.finish();
    let mut work = Work::default();
    let tally = outcome.and_then(|outcome| {
        let page = report::study::write(&run.folder, study, &outcome)?;
        print(&page)?;
        let solved = outcome.variants.iter().filter_map(|v| v.ending.as_ref().ok());
        solved.for_each(|solved| work.add(&solved.work));
        print(&format!("\nnext: {} (study.md, tables, pictures, accuracy.toml)\n", run.folder.path().display()))?;
        let frames_ok = outcome.variants.iter().filter(|v| v.ending.is_ok()).count();
        Ok(Tally { frames_ok, interrupted: outcome.interrupted, ..Tally::default() })
    });
    finish(&run, &work, tally, flags)
}

/// Every variant with its size and cost.
///
/// # Errors
/// What is wrong with the reference and with the variants, all at once.
pub(super) fn check(study: &Study) -> Result<Ending> {
    let all = variants(study);
    let mut mistakes = Vec::new();
    if let ReferenceSpec::Variant(change) = &study.reference
        && let Err(error) = Prepared::read(&study.problem, change)
    {
        mistakes.extend(error.into_mistakes());
    }
    let mut page = format!(
        "{}: study of {}; {} variants, each solved once and then timed {} times\n",
        study.name,
        study.problem.display(),
        all.len(),
        study.repetitions
    );
    for variant in &all {
        page += &match Prepared::read(&study.problem, &variant.change) {
            Ok(prepared) => {
                let model = &prepared.built.model;
                format!(
                    "  {}: {} elements, {} unknowns, factorisation of {:.1} Mflop\n",
                    variant.name,
                    model.mesh().elements(),
                    model.numbering().unknowns(),
                    model.factor_flops() / 1e6
                )
            }
            Err(error) => {
                mistakes.extend(error.into_mistakes());
                format!("  {}: a mistake\n", variant.name)
            }
        };
    }
    if !mistakes.is_empty() {
        return Err(Error::all(mistakes));
    }
    print(&page)?;
    Ok(Ending::Ok)
}
