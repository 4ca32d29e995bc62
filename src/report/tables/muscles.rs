//! `muscles.csv`: activation, stretch and energy, a row per frame and muscle.

use super::{Rows, Table, of_frame};
use crate::error::Result;
use crate::report::frame::{Frame, MuscleState};
use crate::report::run_folder::RunFolder;

/// The table of the muscles.
#[derive(Debug)]
pub struct MuscleTable(Table);

impl MuscleTable {
    /// A new table. The mean of the fibre stretch is weighted by reference volume; `descending_points` counts the
    /// points on the descending limb ([`Model::descending_fibres`](crate::model::Model::descending_fibres)).
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<MuscleTable> {
        let columns = "frame,time_s,name,activation,stretch_mean,stretch_min,stretch_max,energy_uj,descending_points";
        Ok(MuscleTable(Table::create(&run.tables(), "muscles", columns.split(','))?))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, muscles: &[MuscleState<'_>]) -> Result<()> {
        let mut rows = Rows::default();
        for m in muscles {
            let numbers = [m.activation, m.mean_stretch, m.min_stretch, m.max_stretch, m.energy];
            let cells = of_frame(frame).into_iter().chain([m.name.into()]).chain(numbers.map(Into::into));
            rows.add(cells.chain([m.descending_points.into()]));
        }
        self.0.append(rows)
    }
}
