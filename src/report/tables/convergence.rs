//! `convergence.csv`: how Newton's method came to each equilibrium, a row per iteration.

use super::{Cell, Rows, Table};
use crate::error::Result;
use crate::forward::Step;
use crate::report::frame::Frame;
use crate::report::run_folder::RunFolder;

/// The table of the iterations.
#[derive(Debug)]
pub struct ConvergenceTable(Table);

impl ConvergenceTable {
    /// A new table. `step` counts the steps of the path from 0 and `place` is where on it, 0 to 1; `kind` is `walked`,
    /// `snapped` (the body was let go) or `failed` (the last step of a frame that did not converge). A row of an iteration
    /// holds the residual before it, the part of the full Newton step that was taken, and the corrections with the same
    /// tangent that followed; the last row of a step holds the residual it ended with.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<ConvergenceTable> {
        let columns = "frame,step,place,kind,iteration,residual_mn,required_mn,damping,corrections";
        Ok(ConvergenceTable(Table::create(&run.tables(), "convergence", columns.split(','))?))
    }

    /// Adds the path of a frame.
    pub fn add(&mut self, frame: Frame, history: &[Step]) -> Result<()> {
        let mut rows = Rows::default();
        for (number, step) in history.iter().enumerate() {
            let mut add = |iteration: usize, residual: f64, required: f64, damping, corrections| {
                let place =
                    [frame.index.into(), number.into(), step.place.into(), step.kind.word().into(), iteration.into()];
                rows.add(place.into_iter().chain([residual.into(), required.into(), damping, corrections]));
            };
            for (k, i) in step.iterations.iter().enumerate() {
                add(k, i.residual, i.required, i.factor.into(), i.corrections.into());
            }
            add(step.iterations.len(), step.residual, step.required, Cell::Empty, Cell::Empty);
        }
        self.0.append(rows)
    }
}
