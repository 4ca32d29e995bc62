//! `risorius run [problem.toml]`: does what the problem's task says, and leaves a run folder.

use super::check::describe;
use super::outer::Settled;
use super::prepare::{Prepared, prepare};
use super::problem::Source;
use super::progress::{Meter, stage};
use super::terminal::tell;
use super::{Ending, Flags, fibres, fit, forward, more_about, outer, study};
use crate::error::{Error, Result, Warning};
use crate::forward::Work;
use crate::report::html;
use crate::report::manifest::{Input, Numerics};
use crate::report::state::{Checkpoints, Guard};
use crate::report::{FailedFrame, Frame, FrameWarning, Log, Manifest, RunFolder, Status};
use crate::scene::{ControlValue, FitSpec, GeometrySpec, Problem, Study, Task};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What a task needs besides the scene.
pub(super) struct Run {
    pub folder: RunFolder,
    pub start: Instant,
    /// What is run, on what.
    pub manifest: Manifest,
    /// What came up before the first frame.
    pub noticed: Vec<(Frame, Warning)>,
    /// What it says, for `log.jsonl`.
    pub log: Arc<Log>,
    interrupted: Arc<AtomicBool>,
}

/// How the frames of a run ended.
#[derive(Default)]
pub(super) struct Tally {
    pub frames_ok: usize,
    pub failed: Vec<FailedFrame>,
    pub interrupted: bool,
    /// What came up on the way.
    pub warnings: Vec<FrameWarning>,
}

impl Tally {
    /// Keeps what a frame gave notice of.
    pub fn keep(&mut self, frame: Frame, warnings: &[Warning]) {
        self.warnings.extend(warnings.iter().map(|warning| FrameWarning::new(frame.index, warning)));
    }

    /// Shows what a frame gave notice of, and keeps it.
    pub fn warn(&mut self, frame: Frame, warnings: Vec<Warning>, meter: &Meter, flags: &Flags) {
        warnings.iter().for_each(|warning| meter.warn(warning, flags));
        self.keep(frame, &warnings);
    }

    /// How the run stands, while it goes on.
    pub fn running(&self) -> Status {
        let warnings = self.warnings.clone();
        Status { warnings, ..Status::running(self.frames_ok, self.failed.clone()) }
    }
}

impl Run {
    /// That begins now; the log is kept in its folder.
    fn new(folder: RunFolder, inputs: Vec<Input>, log: Arc<Log>) -> Run {
        log.keep_in(&folder);
        let manifest = Manifest::begun(std::env::args().collect(), inputs, rayon::current_num_threads());
        let (start, interrupted) = (Instant::now(), watch_interrupt());
        Run { folder, start, manifest, noticed: Vec::new(), log, interrupted }
    }

    /// That goes on in the folder of a run that began before.
    pub fn again(folder: &Path, inputs: Vec<Input>) -> Result<Run> {
        Ok(Run::new(RunFolder::open(folder)?, inputs, Arc::default()))
    }

    /// Whether Ctrl-C was pressed.
    pub fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

pub(super) fn run(path: Option<&Path>, flags: &Flags) -> Result<Ending> {
    if let Some(path) = path {
        match Problem::read(path, &flags.set)? {
            Problem::Study(study) => {
                let study = Study { estimate: study.estimate || flags.estimate, ..*study };
                return study::run(&study, path, flags);
            }
            Problem::Fibres(problem) => return fibres::run(&problem, path, flags),
            Problem::Scene(_) => {}
        }
    }
    let (start, log) = (Instant::now(), Arc::new(Log::default()));
    let mut source = stage(&log, flags, "read the problem", || Source::read(path, flags))?;
    // the recording is read before anything is written: a mistake in it leaves no folder behind
    let prepared = stage(&log, flags, "build the model and lay the recording on it", || prepare(&source))?;
    let Prepared { built, halved, warnings, .. } = &prepared;
    flags.warn(warnings);
    warnings.iter().for_each(|warning| log.warn(warning));
    if flags.strict && !warnings.is_empty() {
        let noun = if warnings.len() == 1 { "warning" } else { "warnings" };
        tell(&format!("error: {} {noun} under --strict, nothing was run\n", warnings.len()));
        return Ok(Ending::Warned);
    }
    if !flags.quiet {
        tell(&describe(&source.scene, &built.model, halved.as_ref()));
    }
    if flags.dry_run {
        return Ok(Ending::Ok);
    }

    let folder = run_folder(&source.scene.name, flags)?;
    let mut inputs = Vec::new();
    for path in path.into_iter().map(Path::to_path_buf).chain(input_files(&source)) {
        inputs.push(Input::read(&path)?);
    }
    keep_recording(&mut source, &folder, &mut inputs)?;
    let lock = source.scene.lock();
    folder.write("problem.lock.toml", &lock)?;
    let checkpoints = match source.scene.task {
        Task::Fit => Some(Checkpoints::create(&folder, &Guard::new(&lock, inputs.clone()))?),
        Task::Forward => None,
    };
    let run = Run { start, ..Run::new(folder, inputs, log) };
    Status::running(0, Vec::new()).write(&run.folder)?;
    solve(source, prepared, run, flags, checkpoints)
}

/// Goes on with a fit that was interrupted.
pub(super) fn go_on(
    source: Source,
    prepared: Prepared,
    run: Run,
    flags: &Flags,
    checkpoints: Checkpoints,
) -> Result<Ending> {
    solve(source, prepared, run, flags, Some(checkpoints))
}

/// Finds what all frames share, then does the task.
fn solve(
    mut source: Source,
    prepared: Prepared,
    mut run: Run,
    flags: &Flags,
    checkpoints: Option<Checkpoints>,
) -> Result<Ending> {
    let mut work = Work::default();
    let resumable = checkpoints.is_some();
    run.manifest.numerics = Some(Numerics::of(&prepared.built.model));
    let begun = run.manifest.write(&run.folder);
    let settled = match begun.and_then(|()| outer::settle(&mut source, prepared, checkpoints, &mut run, flags)) {
        Ok(settled) => settled,
        Err(error) => {
            let ending = finish(&run, &work, Err(error), flags);
            if resumable {
                tell_resume(&ending, run.folder.path());
            }
            return ending;
        }
    };
    let Settled { prepared, checkpoints, interrupted } = settled;
    let outcome = match interrupted {
        true => Ok(Tally { interrupted, ..Tally::default() }),
        false => stage(&run.log, flags, "solve the frames", || {
            task(&source, &prepared, &run, flags, checkpoints.as_ref(), &mut work)
        }),
    };
    let ending = finish(&run, &work, outcome, flags);
    if resumable {
        tell_resume(&ending, run.folder.path());
    }
    ending
}

fn task(
    source: &Source,
    prepared: &Prepared,
    run: &Run,
    flags: &Flags,
    checkpoints: Option<&Checkpoints>,
    work: &mut Work,
) -> Result<Tally> {
    match (&prepared.clip, &source.scene.fit, checkpoints) {
        (Some(clip), Some(spec), Some(checkpoints)) => {
            fit::fit(&source.scene, spec, prepared, clip, (run, flags), checkpoints, work)
        }
        _ => forward::forward(&source.scene, prepared, run, flags, work),
    }
}

/// The folder that the flags name, or the next one of this name.
fn run_folder(name: &str, flags: &Flags) -> Result<RunFolder> {
    match &flags.out {
        Some(path) => RunFolder::create_at(path, flags.force),
        None => RunFolder::create(Path::new("runs"), name),
    }
}

/// Makes the folder of a run that reads these files, and writes that it runs.
pub(super) fn begin(name: &str, files: &[&Path], log: Arc<Log>, flags: &Flags) -> Result<Run> {
    let inputs = files.iter().map(|path| Input::read(path)).collect::<Result<_>>()?;
    let folder = run_folder(name, flags)?;
    let run = Run::new(folder, inputs, log);
    Status::running(0, Vec::new()).write(&run.folder)?;
    run.manifest.write(&run.folder)?;
    Ok(run)
}

/// Writes status and manifest whatever happened, and says how the command ends.
pub(super) fn finish(run: &Run, work: &Work, outcome: Result<Tally>, flags: &Flags) -> Result<Ending> {
    let manifest = run.manifest.clone().ended(work, run.start.elapsed().as_secs_f64()).write(&run.folder);
    // the first error is the one to tell
    let ended = outcome.and_then(|tally| manifest.and_then(|()| conclude(run, tally, flags)));
    if let Err(error) = &ended {
        run.log.error(error);
        Status::write_failed(&run.folder, error);
        let frames = Status::read(run.folder.path()).map_or(0, |status| status.frames_ok);
        if frames > 0 {
            let folder = run.folder.path().display();
            tell(&format!("ended early: {frames} frames are finished and kept in {folder}\n"));
        }
    }
    ended
}

/// Writes and says how the frames of a run ended.
fn conclude(run: &Run, tally: Tally, flags: &Flags) -> Result<Ending> {
    let Tally { frames_ok, failed, interrupted, warnings } = tally;
    let ending = match failed.len() {
        _ if interrupted => Ending::Interrupted,
        0 if !warnings.is_empty() && flags.strict => Ending::Warned,
        0 => Ending::Ok,
        _ => Ending::NotConverged,
    };
    let folder = run.folder.path().display();
    match ending {
        Ending::Interrupted => tell(&format!("interrupted: {frames_ok} frames are finished and kept in {folder}\n")),
        Ending::NotConverged => tell(&format!(
            "not converged: {} of {} frames; what was found, and why, is in {folder} (status.json){}",
            failed.len(),
            frames_ok + failed.len(),
            more_about(failed.iter().map(|frame| frame.code.as_str()))
        )),
        Ending::Ok | Ending::Warned => {}
    }
    let status = match interrupted {
        true => Status::interrupted(frames_ok, failed),
        false => Status::finished(frames_ok, failed),
    };
    let status = Status { exit: Some(ending.exit_code()), warnings, ..status };
    status.write(&run.folder)?;
    if frames_ok > 0 {
        stage(&run.log, flags, "make the page", || write_page(&run.folder, flags))?;
    }
    run.log.ended(&status);
    Ok(ending)
}

/// Says how a fit that did not come to its end goes on.
fn tell_resume(ending: &Result<Ending>, folder: &Path) {
    if let Ok(Ending::Interrupted) | Err(Error::Io { .. }) = ending {
        tell(&format!("go on with: risorius resume {}\n", folder.display()));
    }
}

/// Writes `report.html`. What the run found is on disk already: a page that cannot be made is no reason to fail.
fn write_page(folder: &RunFolder, flags: &Flags) -> Result<()> {
    match html::write(folder.path()) {
        Ok(path) if !flags.quiet => tell(&format!("all on one page: {}\n", path.display())),
        Ok(_) => {}
        Err(error @ Error::Io { .. }) => return Err(error),
        Err(error) => flags.warn(&[Warning {
            code: "O009",
            message: format!("report.html could not be made: {error}"),
            place: None,
            help: Some(format!(
                "everything else is there; try again with: risorius report {}",
                folder.path().display()
            )),
        }]),
    }
    Ok(())
}

/// Files that the scene names and that are read from disk.
fn input_files(source: &Source) -> Vec<PathBuf> {
    let scene = &source.scene;
    let curves = scene.controls.iter().filter_map(|c| match &c.value {
        ControlValue::Csv(path) => Some(path.clone()),
        ControlValue::Constant(_) | ControlValue::Nodes(_) => None,
    });
    let markers = scene.fit.iter().filter(|f| scene.task == Task::Fit && source.embedded_recording(f).is_none());
    let geometries = std::iter::once(&scene.mesh.geometry).chain(scene.muscles.iter().map(|muscle| &muscle.geometry));
    let meshes = geometries.filter_map(|geometry| match geometry {
        GeometrySpec::Exf(exf) => Some(exf.path.clone()),
        GeometrySpec::Face(face) => face.landmarks.clone(),
        GeometrySpec::Block(_) | GeometrySpec::Blocks(_) | GeometrySpec::FaceMuscle(_) => None,
    });
    let expected = scene.fit.iter().filter(|_| scene.task == Task::Fit).flat_map(|fit| &fit.objectives.priors);
    let curves = curves.chain(expected.map(|prior| prior.csv.clone()));
    let mut files: Vec<PathBuf> = curves.chain(meshes).chain(markers.map(|f| f.markers.clone())).collect();
    files.sort();
    files.dedup();
    files
}

/// A run of the built-in problem keeps its recording, and its lock file points there.
fn keep_recording(source: &mut Source, folder: &RunFolder, inputs: &mut Vec<Input>) -> Result<()> {
    let Some(bytes) = source.scene.fit.as_ref().and_then(|f| source.embedded_recording(f)) else { return Ok(()) };
    folder.write("recording.mcap", bytes)?;
    let path = folder.path().join("recording.mcap");
    let path = std::path::absolute(&path).map_err(|error| Error::Io { action: "find", path, source: error })?;
    inputs.push(Input::read(&path)?);
    if let Some(FitSpec { markers, .. }) = &mut source.scene.fit {
        *markers = path;
    }
    Ok(())
}

/// Set by Ctrl-C, looked at between frames. A second handler cannot be set in one process; then Ctrl-C ends it at once.
fn watch_interrupt() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&flag);
    if ctrlc::set_handler(move || seen.store(true, Ordering::Relaxed)).is_err() {
        tell("note: Ctrl-C will end the run at once\n");
    }
    flag
}
