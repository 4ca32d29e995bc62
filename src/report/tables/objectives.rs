//! `objectives.csv`: what each part of the objective of a fit costs; `outliers.csv`: markers that a robust loss sets aside.

use super::{Cell, Rows, Table, of_frame};
use crate::error::Result;
use crate::report::frame::{Frame, Outlier};
use crate::report::run_folder::RunFolder;

/// The table of the costs.
#[derive(Debug)]
pub struct ObjectiveTable(Table);

impl ObjectiveTable {
    /// A new table `frame,time_s,objective,value`: minus the logarithm of a probability, up to a constant.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<ObjectiveTable> {
        Ok(ObjectiveTable(Table::create(&run.tables(), "objectives", "frame,time_s,objective,value".split(','))?))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, costs: &[(String, f64)]) -> Result<()> {
        let mut rows = Rows::default();
        let [index, time] = of_frame(frame);
        costs.iter().for_each(|(name, value)| rows.add([index, time, Cell::Text(name), (*value).into()]));
        self.0.append(rows)
    }
}

/// The table of the outliers.
#[derive(Debug)]
pub struct OutlierTable(Table);

impl OutlierTable {
    /// A new table `frame,time_s,marker,distance_mm,distance_sds,weight`: markers that count less than half of what a marker
    /// nearby does.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<OutlierTable> {
        let columns = "frame,time_s,marker,distance_mm,distance_sds,weight";
        Ok(OutlierTable(Table::create(&run.tables(), "outliers", columns.split(','))?))
    }

    /// Adds those of a frame.
    pub fn add(&mut self, frame: Frame, outliers: &[Outlier<'_>]) -> Result<()> {
        let mut rows = Rows::default();
        let [index, time] = of_frame(frame);
        for Outlier { name, distance_mm, distance_sds, weight } in outliers {
            let numbers = [*distance_mm, *distance_sds, *weight].map(Cell::Number);
            rows.add([index, time, Cell::Text(name)].into_iter().chain(numbers));
        }
        self.0.append(rows)
    }
}
