//! `contact.csv`: area, pressure, penetration and force, a row per frame and sliding or contact.

use super::{Rows, Table, of_frame};
use crate::error::Result;
use crate::math::tensor::norm;
use crate::report::frame::{ContactState, Frame};
use crate::report::run_folder::RunFolder;

/// The table of slidings and contacts.
#[derive(Debug)]
pub struct ContactTable(Table);

impl ContactTable {
    /// A new table. Areas and pressures are per reference area; the force is that of the surface on the body.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<ContactTable> {
        let columns = "frame,time_s,name,area_mm2,pressure_mean_kpa,pressure_max_kpa,penetration_mm,force_mn,\
                       force_x_mn,force_y_mn,force_z_mn";
        Ok(ContactTable(Table::create(&run.tables(), "contact", columns.split(','))?))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, contacts: &[ContactState<'_>]) -> Result<()> {
        let mut rows = Rows::default();
        for c in contacts {
            let [x, y, z] = c.force;
            let numbers = [c.area, c.mean_pressure, c.max_pressure, c.penetration, norm(c.force), x, y, z];
            rows.add(of_frame(frame).into_iter().chain([c.name.into()]).chain(numbers.map(Into::into)));
        }
        self.0.append(rows)
    }
}
