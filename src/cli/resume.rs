//! `risorius resume RUN`: goes on after Ctrl-C, a crash or a full disk.

use super::chunk::{done, parts};
use super::prepare::prepare;
use super::problem::Source;
use super::run::{self, Run};
use super::terminal::tell;
use super::{Ending, Flags};
use crate::error::{Error, Result};
use crate::report::state::{Checkpoints, Guard};
use crate::report::{Outcome, Status};
use std::path::Path;

pub(super) fn resume(folder: &Path, flags: &Flags) -> Result<Ending> {
    let guard = Guard::read(folder)?;
    let mut changes = guard.changes(folder);
    if !flags.set().is_empty() || flags.accuracy.is_some() {
        changes.push("what the flags set".into());
    }
    if !changes.is_empty() {
        return Err(Error::ProblemChanged { path: folder.into(), changes: changes.join(", ").into() });
    }
    if let Some(Outcome::Converged | Outcome::Partial) = Status::read(folder).map(|status| status.status) {
        tell(&format!("nothing to do: the fit in {} went to its end\n", folder.display()));
        return Ok(Ending::Ok);
    }
    let checkpoints = Checkpoints::open(folder)?;
    let source = Source::read(Some(&folder.join("problem.lock.toml")), flags)?;
    let prepared = prepare(&source)?;
    let done = match (&source.scene.fit, &prepared.clip) {
        (Some(spec), Some(clip)) => done(&parts(spec, clip, &checkpoints)?),
        _ => 0,
    };
    flags.warn(&prepared.warnings);
    if !flags.quiet {
        tell(&format!("{done} frames are done\n"));
    }
    if flags.dry_run {
        return Ok(Ending::Ok);
    }
    run::go_on(source, prepared, Run::again(folder, guard.inputs)?, flags, checkpoints)
}
