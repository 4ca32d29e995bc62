//! `activations.csv`: the controls, a row per frame; behind them their standard deviations where they were fitted. A hinge
//! is in degrees, a slide in mm, an activation has no unit.

use super::{Rows, Table, of_frame};
use crate::error::Result;
use crate::report::frame::Frame;
use crate::report::run_folder::RunFolder;

/// The table of the activations.
#[derive(Debug)]
pub struct ActivationTable {
    table: Table,
    with_deviations: bool,
}

impl ActivationTable {
    /// A new table: `frame,time_s,<control>,...` and, `with_deviations`, a column `<control>_sd` for every control.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create<'a>(
        run: &RunFolder,
        controls: impl IntoIterator<Item = &'a str>,
        with_deviations: bool,
    ) -> Result<ActivationTable> {
        let controls: Vec<&str> = controls.into_iter().collect();
        let deviations: Vec<String> = match with_deviations {
            true => controls.iter().map(|name| format!("{name}_sd")).collect(),
            false => Vec::new(),
        };
        let columns = ["frame", "time_s"].into_iter().chain(controls).chain(deviations.iter().map(String::as_str));
        Ok(ActivationTable { table: Table::create(&run.tables(), "activations", columns)?, with_deviations })
    }

    /// Adds a frame: one value per control and one standard deviation, which is `None` for a control that was given.
    pub fn add(&mut self, frame: Frame, controls: &[f64], deviations: &[Option<f64>]) -> Result<()> {
        let mut rows = Rows::default();
        let values = controls.iter().map(|value| (*value).into());
        let deviations = deviations.iter().filter(|_| self.with_deviations).map(|deviation| (*deviation).into());
        rows.add(of_frame(frame).into_iter().chain(values).chain(deviations));
        self.table.append(rows)
    }
}
