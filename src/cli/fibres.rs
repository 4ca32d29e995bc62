//! Task `fibres`: fibre angles from measured directions.

use super::run::{Tally, begin, finish};
use super::terminal::{print, tell};
use super::{Ending, Flags};
use crate::cli::diagnostics::render_warning;
use crate::error::{Result, Warning};
use crate::fibres::{FibreFit, data, fit, mesh, place};
use crate::forward::Work;
use crate::report::{self, FrameWarning};
use crate::scene::{FibreBody, FibreProblem, GeometrySpec};
use std::path::Path;

/// Reads, fits, and leaves tables, pictures and a page, which is printed.
pub(super) fn run(problem: &FibreProblem, path: &Path, flags: &Flags) -> Result<Ending> {
    if flags.dry_run {
        return check(problem);
    }
    // files are read before anything is written: a mistake in them leaves no folder behind
    let read = Read::new(problem)?;
    let files: Vec<&Path> = [path].into_iter().chain(inputs(problem)).collect();
    let run = begin(&problem.name, &files, flags)?;
    let mut tally = Tally::default();
    let outcome = read.fit(problem).and_then(|fit| {
        for warning in read.warning.iter().chain(&fit.warnings) {
            if flags.shows_warnings() {
                tell(&render_warning(warning, flags.colour()));
            }
            tally.warnings.push(FrameWarning::new(0, warning));
        }
        let page = report::fibres::write(&run.folder, problem, &fit, read.axes.empty)?;
        print(&page)?;
        print(&format!("\nnext: {} (fibres.exf, tables, fibres.svg, view)\n", run.folder.path().display()))?;
        tally.frames_ok = 1;
        Ok(tally)
    });
    finish(&run, None, &Work::default(), outcome, flags)
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
    let geometry = match &problem.body {
        FibreBody::Mesh(spec) => &spec.geometry,
        FibreBody::Muscle(spec) => &spec.geometry,
    };
    let mesh = match geometry {
        GeometrySpec::Exf(spec) => Some(spec.path.as_path()),
        GeometrySpec::Face(spec) => spec.landmarks.as_deref(),
        _ => None,
    };
    mesh.into_iter().chain(problem.data.iter().map(|data| data.file.as_path()))
}
