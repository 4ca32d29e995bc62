//! Task `fibres`: fibre angles from measured directions.

use super::progress::{stage, took};
use super::run::{Tally, begin, finish};
use super::terminal::print;
use super::{Ending, Flags};
use crate::error::{Result, Warning};
use crate::fibres::{FibreFit, data, fit, mesh, place};
use crate::forward::Work;
use crate::report::{self, FrameWarning, Log};
use crate::scene::{FibreBody, FibreProblem, GeometrySpec};
use std::path::Path;
use std::sync::Arc;

/// Reads, fits, and leaves tables, pictures and a page, which is printed.
pub(super) fn run(problem: &FibreProblem, path: &Path, flags: &Flags) -> Result<Ending> {
    if flags.dry_run {
        return check(problem);
    }
    let log: Arc<Log> = Arc::default();
    // files are read before anything is written: a mistake in them leaves no folder behind
    let read = stage(&log, flags, "read the mesh and the axes", || Read::new(problem))?;
    let files: Vec<&Path> = [path].into_iter().chain(inputs(problem)).collect();
    let run = begin(&problem.name, &files, Arc::clone(&log), flags)?;
    run.folder.write("problem.lock.toml", problem.lock())?;
    let mut tally = Tally::default();
    let outcome = read.fit(problem).and_then(|fit| {
        fit.stages.iter().for_each(|(what, seconds)| took(&log, flags, what, *seconds));
        for warning in read.warning.iter().chain(&fit.warnings) {
            log.warn(warning);
            flags.warn(std::slice::from_ref(warning));
            tally.warnings.push(FrameWarning::new(0, warning));
        }
        let page = stage(&log, flags, "write what was found", || {
            report::fibres::write(&run.folder, problem, &fit, read.axes.empty)
        })?;
        print(&page)?;
        print(&format!("\nnext: {} (fibres.exf, tables, fibres.svg, view)\n", run.folder.path().display()))?;
        tally.frames_ok = 1;
        Ok(tally)
    });
    finish(&run, &Work::default(), outcome, flags)
}

/// Everything but the fit.
///
/// # Errors
/// What is wrong with the files.
pub(super) fn check(problem: &FibreProblem) -> Result<Ending> {
    let read = Read::new(problem)?;
    let (fibres, sheets, outside) = place(problem, &read.mesh, &read.axes.all)?;
    print(&format!(
        "{}: fibres; {} elements, {} nodes; {} measured axes in {} files, {} of them outside the mesh\n\
         {} axes and {} sheets are used\nok: no mistakes\n",
        problem.name,
        read.mesh.elements(),
        read.mesh.nodes,
        read.axes.all.len(),
        problem.data.len(),
        outside.count,
        fibres.all.len(),
        sheets.all.len()
    ))?;
    Ok(Ending::Ok)
}

/// The files of a problem.
struct Read {
    mesh: crate::mesh::Mesh,
    names: Vec<i64>,
    axes: data::Axes,
    warning: Option<Warning>,
}

impl Read {
    fn new(problem: &FibreProblem) -> Result<Read> {
        let (mesh, names, warning) = mesh(&problem.body)?;
        Ok(Read { mesh, names, axes: data::read(&problem.data)?, warning })
    }

    fn fit(&self, problem: &FibreProblem) -> Result<FibreFit> {
        fit(problem, &self.mesh, &self.names, &self.axes.all)
    }
}

/// Files that the problem names.
fn inputs(problem: &FibreProblem) -> impl Iterator<Item = &Path> {
    let geometries = match &problem.body {
        FibreBody::Mesh(host) => [Some(&host.geometry), None],
        FibreBody::Muscle { muscle, host } => [Some(&muscle.geometry), host.as_ref().map(|host| &host.geometry)],
    };
    let meshes = geometries.into_iter().flatten().filter_map(|geometry| match geometry {
        GeometrySpec::Exf(spec) => Some(spec.path.as_path()),
        GeometrySpec::Face(spec) => spec.landmarks.as_deref(),
        GeometrySpec::Block(_) | GeometrySpec::Blocks(_) | GeometrySpec::FaceMuscle(_) => None,
    });
    meshes.chain(problem.data.iter().map(|data| data.file.as_path()))
}
