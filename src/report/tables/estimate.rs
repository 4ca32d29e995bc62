//! `estimate.csv`: estimated errors of the mesh, a row per frame and point, and per control of a fit.

use super::{Cell, Rows, Table, of_frame};
use crate::error::Result;
use crate::report::frame::{Frame, MeshError};
use crate::report::run_folder::RunFolder;

/// The table of estimated errors.
#[derive(Debug)]
pub struct EstimateTable(Table);

impl EstimateTable {
    /// A new table `frame,time_s,kind,name,error_mm,bias`: of the `body` the largest error anywhere, of a `probe` or `marker` its
    /// own, mm; of a `control` that was fitted what it is too great by, empty where it lies on a bound or is not
    /// determined.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<EstimateTable> {
        let columns = "frame,time_s,kind,name,error_mm,bias";
        Ok(EstimateTable(Table::create(&run.tables(), "estimate", columns.split(','))?))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, error: &MeshError) -> Result<()> {
        let mut rows = Rows::default();
        let [index, time] = of_frame(frame);
        let mut row = |kind: &'static str, name: &str, error: Cell<'_>, bias: Cell<'_>| {
            rows.add([index, time, kind.into(), Cell::Text(name), error, bias]);
        };
        row("body", "anywhere", error.largest_mm.into(), Cell::Empty);
        error.points.iter().for_each(|(name, mm)| row(error.kind, name, (*mm).into(), Cell::Empty));
        error.biases.iter().for_each(|(name, bias)| row("control", name, Cell::Empty, (*bias).into()));
        self.0.append(rows)
    }
}
