//! `probes.csv`: where the probes are, a row per frame and probe.

use super::{Rows, Table, components, of_frame};
use crate::error::Result;
use crate::model::State;
use crate::report::frame::{Frame, ProbeState};
use crate::report::run_folder::RunFolder;

/// The table of the probes.
#[derive(Debug)]
pub struct ProbeTable(Table);

impl ProbeTable {
    /// A new table in the folder of a run.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<ProbeTable> {
        let columns = "frame,time_s,load,name,x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm";
        Ok(ProbeTable(Table::create(&run.tables(), "probes", columns.split(','))?))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, state: &State, probes: &[ProbeState<'_>]) -> Result<()> {
        let mut rows = Rows::default();
        for probe in probes {
            let place = components(probe.position).into_iter().chain(components(probe.displacement));
            rows.add(of_frame(frame).into_iter().chain([state.load.into(), probe.name.into()]).chain(place));
        }
        self.0.append(rows)
    }
}
