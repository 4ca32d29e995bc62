//! The folder `view`: the shapes of every frame, and the lists that play them.

use super::exf;
use super::frame::{Frame, MarkerPair};
use super::pvd::Collection;
use super::run_folder::RunFolder;
use super::vtu::xml::Before;
use super::vtu::{Grid, bezier, contact, linear, markers, muscles, residuals};
use crate::error::Result;
use crate::model::{Model, State};
use crate::term::contact::ContactPoint;
use std::path::PathBuf;

/// Writes shapes frame by frame.
#[derive(Debug, Clone)]
pub struct View {
    folder: PathBuf,
    /// What the EX files of all frames have in common, from the first on.
    common: Option<exf::Common>,
    shape: Series,
    linear: Series,
    muscles: Series,
    contact: Series,
    markers: Series,
    residuals: Series,
}

/// Files `<folder>/<name>_0000.vtu` and their list `<folder>/<name>.pvd`.
#[derive(Debug, Clone)]
struct Series {
    folder: PathBuf,
    name: &'static str,
    collection: Collection,
    before: Before,
}

impl View {
    /// In the folder of a run. Nothing is written before the first frame.
    pub fn new(run: &RunFolder) -> View {
        let folder = run.view();
        View {
            shape: Series::new(folder.clone(), "result"),
            linear: Series::new(folder.join("linear"), "result"),
            muscles: Series::new(folder.clone(), "muscles"),
            contact: Series::new(folder.clone(), "contact"),
            markers: Series::new(folder.clone(), "markers"),
            residuals: Series::new(folder.clone(), "residuals"),
            common: None,
            folder,
        }
    }

    /// Adds a frame: the exact shape (also as an EX file), the resampled one, the muscles if the model has any, the markers and
    /// the points of contacts if there are any.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io).
    pub fn add(
        &mut self,
        frame: Frame,
        model: &Model,
        state: &State,
        markers: &[MarkerPair<'_>],
        contacts: &[Vec<ContactPoint>],
    ) -> Result<()> {
        let time_s = frame.time_s;
        let common = self.common.get_or_insert_with(|| exf::Common::new(model));
        exf::write(&self.folder.join(format!("result_{:04}.exf", frame.index)), model, state, common)?;
        self.shape.add(frame, &bezier::shape(model, state, time_s))?;
        self.linear.add(frame, &linear::shape(model, state, time_s))?;
        if model.muscles().next().is_some() {
            self.muscles.add(frame, &muscles::points(model, state, time_s))?;
        }
        if !contacts.is_empty() {
            self.contact.add(frame, &contact::points(contacts, time_s))?;
        }
        if !markers.is_empty() {
            self.markers.add(frame, &markers::points(markers, time_s))?;
            self.residuals.add(frame, &residuals::lines(markers, time_s))?;
        }
        Ok(())
    }

    /// Writes a state beside the frames, for example the iterate at which one failed, as `<name>.vtu`; returns its path.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io).
    pub fn write_beside(&self, name: &str, frame: Frame, model: &Model, state: &State) -> Result<PathBuf> {
        let path = self.folder.join(format!("{name}.vtu"));
        bezier::shape(model, state, frame.time_s).write(&path)?;
        Ok(path)
    }
}

impl Series {
    fn new(folder: PathBuf, name: &'static str) -> Series {
        let collection = Collection::new(folder.join(format!("{name}.pvd")));
        Series { collection, folder, name, before: Before::default() }
    }

    fn add(&mut self, frame: Frame, grid: &Grid) -> Result<()> {
        let file = format!("{}_{:04}.vtu", self.name, frame.index);
        grid.write_after(&self.folder.join(&file), &mut self.before)?;
        self.collection.add(frame.time_s, &file)
    }
}
