//! `registration.csv`: where each marker sits on the model, and how the neutral frame of the recording fits there.

use super::{Cell, Rows, Table};
use crate::error::Result;
use crate::report::run_folder::RunFolder;

/// A marker on the model at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement<'a> {
    /// Its name.
    pub name: &'a str,
    /// From the position in the problem to the skin, onto which it is projected, mm.
    pub skin_mm: f64,
    /// From the skin to the registered neutral frame, mm; `None` where that does not show it.
    pub neutral_mm: Option<f64>,
    /// Whether it counted in the registration: it was shown, and not off.
    pub counted: bool,
}

/// Writes the table.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write_registration(run: &RunFolder, placements: &[Placement<'_>]) -> Result<()> {
    let columns = ["name", "skin_distance_mm", "neutral_distance_mm", "counted"];
    let mut table = Table::create(&run.tables(), "registration", columns)?;
    let mut rows = Rows::default();
    for Placement { name, skin_mm, neutral_mm, counted } in placements {
        let cells: [Cell<'_>; 4] =
            [(*name).into(), (*skin_mm).into(), (*neutral_mm).into(), usize::from(*counted).into()];
        rows.add(cells);
    }
    table.append(rows)
}
