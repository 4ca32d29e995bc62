//! `head.csv`: the motion of the head that was taken out of a recording, a row per frame.

use super::{Cell, Rows, Table, components, of_frame};
use crate::error::Result;
use crate::report::frame::Frame;
use crate::report::run_folder::RunFolder;

/// The head in a frame, against the neutral one, in the coordinates of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadRow {
    /// The frame.
    pub frame: Frame,
    /// Rotation vector, degrees, and shift of the centre of the markers, mm; `None` where they are not known.
    pub motion: Option<[[f64; 3]; 2]>,
    /// How well the bone markers agree, mm, where there are any.
    pub rms_mm: Option<f64>,
    /// How many of them count.
    pub markers: usize,
}

/// Writes the table.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write_head(run: &RunFolder, heads: &[HeadRow]) -> Result<()> {
    let columns = "frame,time_s,turn_x_deg,turn_y_deg,turn_z_deg,shift_x_mm,shift_y_mm,shift_z_mm,bone_rms_mm,bone_markers";
    let mut table = Table::create(&run.tables(), "head", columns.split(','))?;
    let mut rows = Rows::default();
    for HeadRow { frame, motion, rms_mm, markers } in heads {
        let [turn, shift] = motion.map_or([[Cell::Empty; 3]; 2], |motion| motion.map(components));
        let rest = [(*rms_mm).into(), (*markers).into()];
        rows.add(of_frame(*frame).into_iter().chain(turn).chain(shift).chain(rest));
    }
    table.append(rows)
}
