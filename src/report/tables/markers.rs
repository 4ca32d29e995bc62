//! `markers.csv`: the markers of the model beside their measurements, a row per frame and marker.

use super::{Cell, Rows, Table, components, of_frame};
use crate::error::Result;
use crate::report::frame::{Frame, MarkerPair};
use crate::report::run_folder::RunFolder;

/// The table of the markers.
#[derive(Debug)]
pub struct MarkerTable(Table);

impl MarkerTable {
    /// A new table. x, y, z: the model; measured_x, ...: the recording, in the coordinates of the model; dx, ...:
    /// measured minus model. What hangs on a lost sample is empty.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<MarkerTable> {
        let columns = "frame,time_s,name,x_mm,y_mm,z_mm,measured_x_mm,measured_y_mm,measured_z_mm,\
                       dx_mm,dy_mm,dz_mm,distance_mm";
        Ok(MarkerTable(Table::create(&run.tables(), "markers", columns.split(','))?))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, markers: &[MarkerPair<'_>]) -> Result<()> {
        let mut rows = Rows::default();
        for marker in markers {
            let optional = |vector: Option<[f64; 3]>| vector.map_or([Cell::Empty; 3], components);
            let cells = of_frame(frame)
                .into_iter()
                .chain([marker.name.into()])
                .chain(components(marker.model))
                .chain(optional(marker.measured))
                .chain(optional(marker.residual()))
                .chain([marker.distance().into()]);
            rows.add(cells);
        }
        self.0.append(rows)
    }
}
