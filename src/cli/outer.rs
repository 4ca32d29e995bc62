//! What all frames share, found before the frames are fitted one by one.

use super::Flags;
use super::prepare::{Prepared, prepare};
use super::problem::Source;
use super::run::Run;
use super::terminal::tell;
use crate::error::Result;
use crate::fit::outer::{Outcome, find};
use crate::fit::sequence::sought;
use crate::report::state::{Checkpoints, Guard};
use crate::report::summary::{outer_page, outer_warnings};
use crate::report::tables::write_outer;
use crate::report::{Frame, Level};
use crate::scene::Task;

/// The file with the paragraph of the page.
pub(super) const PAGE: &str = "outer.txt";

/// A problem in which nothing is left to find that all frames share.
pub(super) struct Settled {
    pub prepared: Prepared,
    pub checkpoints: Option<Checkpoints>,
    /// Whether it was interrupted before.
    pub interrupted: bool,
}

/// Finds what `[fit.outer]` asks for, if the problem has it. The scene of `source`, its model and `problem.lock.toml` then hold
/// what was found, and `[fit.outer]` no more; `problem.outer.toml` keeps the problem as it was asked.
pub(super) fn settle(
    source: &mut Source,
    prepared: Prepared,
    checkpoints: Option<Checkpoints>,
    run: &mut Run,
    flags: &Flags,
) -> Result<Settled> {
    let scene = &source.scene;
    let asked = scene.fit.as_ref().filter(|_| scene.task == Task::Fit);
    let asked = asked.and_then(|fit| Some((fit, fit.outer.as_ref()?)));
    let (Some((fit, outer)), Some(clip)) = (asked, &prepared.clip) else {
        return Ok(Settled { prepared, checkpoints, interrupted: false });
    };
    let mut say = |line: String| {
        run.log.add(Level::Info, None, &line, &[]);
        if !flags.quiet {
            tell(&format!("{line}\n"));
        }
    };
    let found = find(scene, (fit, outer), (&clip.recording, &clip.frames), &|| run.is_interrupted(), &mut say)?;
    let Some(outcome) = found else { return Ok(Settled { prepared, checkpoints, interrupted: true }) };
    let model = &prepared.built.model;
    let names: Vec<&str> = sought(fit, model).into_iter().map(|k| model.controls()[k].name.as_str()).collect();
    write_outer(&run.folder, &outcome, &names)?;
    run.folder.write(PAGE, outer_page(&outcome, &names))?;
    let first = outcome.frames.first().map_or(0, |frame| frame.frame);
    for (frame, warning) in outer_warnings(&outcome, &names) {
        flags.warn(std::slice::from_ref(&warning));
        run.log.warn(&warning);
        let index = frame.unwrap_or(first);
        run.noticed.push((Frame { index, time_s: clip.recording.frames[index].time_s }, warning));
    }
    let Outcome { scene: mut with, .. } = outcome;
    with.fit.iter_mut().for_each(|fit| fit.outer = None);
    run.folder.write("problem.outer.toml", scene.lock())?;
    let lock = with.lock();
    run.folder.write("problem.lock.toml", &lock)?;
    let checkpoints = match checkpoints {
        Some(_) => Some(Checkpoints::create(&run.folder, &Guard::new(&lock, run.manifest.inputs.clone()))?),
        None => None,
    };
    source.scene = with;
    Ok(Settled { prepared: prepare(source)?, checkpoints, interrupted: false })
}
