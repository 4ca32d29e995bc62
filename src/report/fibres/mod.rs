//! What a fit of fibre angles leaves behind.
//!
//! ```text
//! summary.txt                      the page that the terminal showed
//! fibres.exf                       mesh and angles, ready for `[[muscle]] exf = "fibres.exf"`, `angles_field = "fibres"`
//! fibres.svg                       fitted fibres and measured axes
//! tables/fibre_*.csv               angles, errors, elements, smoothness
//! view/fibres.vtu, streamlines.vtu, measured.vtu
//! ```

mod grids;
mod page;
mod picture;
mod tables;

use super::run_folder::RunFolder;
use crate::error::Result;
use crate::fibres::FibreFit;
use crate::fibres::streamlines::lines;
use crate::mesh::exf::{write_angles, write_mesh};
use crate::mesh::location::Locator;
use crate::scene::FibreProblem;

/// The name of the field of angles in the EX file.
const FIELD: &str = "fibres";
/// Streamlines at most.
const MOST_LINES: usize = 600;

/// Writes everything, and returns the page for the terminal.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write(folder: &RunFolder, problem: &FibreProblem, fit: &FibreFit, empty: usize) -> Result<String> {
    let mesh = &fit.mesh;
    let exf = write_mesh(mesh, &[("coordinates", &mesh.parameters)]) + &write_angles(mesh, FIELD, &fit.angles);
    folder.write("fibres.exf", exf)?;
    for (name, text) in tables::all(fit) {
        folder.write(&format!("tables/{name}.csv"), text)?;
    }
    let streamlines = lines(&Locator::new(mesh), &fit.angles, MOST_LINES);
    let view = folder.view();
    grids::field(fit).write(&view.join("fibres.vtu"))?;
    grids::streamlines(&streamlines).write(&view.join("streamlines.vtu"))?;
    grids::measured(fit).write(&view.join("measured.vtu"))?;
    if let Some(picture) = picture::draw(&problem.name, fit, &streamlines) {
        folder.write("fibres.svg", picture)?;
    }
    let page = page::page(problem, fit, empty);
    folder.write("summary.txt", &page)?;
    Ok(page)
}
