//! `bones.csv`: pose of every bone and what it exerts on the body, a row per frame and bone.

use super::{Rows, Table, of_frame};
use crate::error::Result;
use crate::report::frame::{BoneState, Frame};
use crate::report::run_folder::RunFolder;

/// The table of the bones.
#[derive(Debug)]
pub struct BoneTable(Table);

impl BoneTable {
    /// A new table: `frame,time_s,name,hinge_deg,slide_mm`, then `torque_mn_mm` about the hinge where it is now,
    /// `slide_force_mn` along the slide, and the whole force, all of the bone on the body: the body exerts the opposite on
    /// the bone. What a bone does not have is empty.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<BoneTable> {
        let columns =
            "frame,time_s,name,hinge_deg,slide_mm,torque_mn_mm,slide_force_mn,force_x_mn,force_y_mn,force_z_mn";
        Ok(BoneTable(Table::create(&run.tables(), "bones", columns.split(','))?))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, bones: &[BoneState<'_>]) -> Result<()> {
        let mut rows = Rows::default();
        for bone in bones {
            let numbers = [bone.hinge_deg, bone.slide_mm, bone.torque, bone.slide_force];
            let cells = of_frame(frame).into_iter().chain([bone.name.into()]).chain(numbers.map(Into::into));
            rows.add(cells.chain(bone.force.map(Into::into)));
        }
        self.0.append(rows)
    }
}
