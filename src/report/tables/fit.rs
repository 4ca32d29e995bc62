//! `fit.csv`: how the fit of each frame converged, a row per Gauss-Newton iteration.

use super::{Cell, Rows, Table, of_frame};
use crate::error::Result;
use crate::fit::estimate::FitIteration;
use crate::report::frame::Frame;
use crate::report::run_folder::RunFolder;

/// The table of the fit's iterations.
#[derive(Debug)]
pub struct FitTable(Table);

impl FitTable {
    /// A new table: `frame,time_s,iteration,cost,step,trust,rejected`: half the sum of the squared weighted residuals after
    /// the iteration, the largest change of a control as a part of its range, the trust radius in ln(activation + onset), and steps that were
    /// tried and rejected.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<FitTable> {
        let columns = "frame,time_s,iteration,cost,step,trust,rejected";
        Ok(FitTable(Table::create(&run.tables(), "fit", columns.split(','))?))
    }

    /// Adds the iterations of a frame.
    pub fn add(&mut self, frame: Frame, iterations: &[FitIteration]) -> Result<()> {
        let mut rows = Rows::default();
        for (number, i) in iterations.iter().enumerate() {
            let [index, time] = of_frame(frame);
            let rejected = Cell::Count(i.rejected as usize);
            rows.add([index, time, number.into(), i.cost.into(), i.step.into(), i.trust.into(), rejected]);
        }
        self.0.append(rows)
    }
}
