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
    let columns =
        "frame,time_s,turn_x_deg,turn_y_deg,turn_z_deg,shift_x_mm,shift_y_mm,shift_z_mm,bone_rms_mm,bone_markers";
    let mut table = Table::create(&run.tables(), "head", columns.split(','))?;
    let mut rows = Rows::default();
    for HeadRow { frame, motion, rms_mm, markers } in heads {
        let [turn, shift] = motion.map_or([[Cell::Empty; 3]; 2], |motion| motion.map(components));
        let rest = [(*rms_mm).into(), (*markers).into()];
        rows.add(of_frame(*frame).into_iter().chain(turn).chain(shift).chain(rest));
    }
    table.append(rows)
}

/// A head that was estimated, with how sure it is.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeHeadRow {
    /// The frame.
    pub frame: Frame,
    /// Rotation vector, degrees, and shift of the centre of the markers, mm.
    pub motion: [[f64; 3]; 2],
    /// Their standard deviations.
    pub sd: Option<[f64; 6]>,
    /// For every control that is sought: its largest correlation with the head, and how many times larger that makes its
    /// standard deviation.
    pub confounding: Vec<[Option<f64>; 2]>,
}

/// Writes `head.csv` of a head that was estimated together with these controls.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write_free_head(run: &RunFolder, controls: &[&str], heads: &[FreeHeadRow]) -> Result<()> {
    let columns = "frame,time_s,turn_x_deg,turn_y_deg,turn_z_deg,shift_x_mm,shift_y_mm,shift_z_mm,turn_x_sd_deg,\
                   turn_y_sd_deg,turn_z_sd_deg,shift_x_sd_mm,shift_y_sd_mm,shift_z_sd_mm";
    let named: Vec<String> =
        controls.iter().flat_map(|name| [format!("correlation_{name}"), format!("inflation_{name}")]).collect();
    let columns = columns.split(',').chain(named.iter().map(String::as_str));
    let mut table = Table::create(&run.tables(), "head", columns)?;
    let mut rows = Rows::default();
    for FreeHeadRow { frame, motion: [turn, shift], sd, confounding } in heads {
        let sd = sd.map_or([Cell::Empty; 6], |sd| sd.map(Cell::Number));
        let confounding = confounding.iter().flatten().map(|value| Cell::from(*value));
        let motion = components(*turn).into_iter().chain(components(*shift));
        rows.add(of_frame(*frame).into_iter().chain(motion).chain(sd).chain(confounding));
    }
    table.append(rows)
}
