//! Tables as CSV (RFC 4180 with `\n`): one file each, every file one kind of row.
//!
//! Numbers are written with the fewest digits that give the same bits again. A value that is not known, or not a number,
//! is an empty cell. The rows of a frame are written at once; where that fails the table ends with the frame before.

mod activations;
mod bones;
mod contact;
mod convergence;
mod cost;
mod energies;
mod estimate;
mod fit;
mod head;
mod identifiability;
mod markers;
mod muscles;
mod objectives;
mod outer;
mod probes;
mod registration;
mod storage;

pub use activations::ActivationTable;
pub use bones::BoneTable;
pub use contact::ContactTable;
pub use convergence::ConvergenceTable;
pub use cost::{FrameCost, OutputSeconds, write_cost};
pub use energies::EnergyTable;
pub use estimate::EstimateTable;
pub use fit::FitTable;
pub use head::{FreeHeadRow, HeadRow, write_free_head, write_head};
pub use identifiability::{IdentifiabilityTables, advice_table};
pub use markers::MarkerTable;
pub use muscles::MuscleTable;
pub use objectives::{ObjectiveTable, OutlierTable};
pub use outer::write_outer;
pub use probes::ProbeTable;
pub use registration::{Placement, write_registration};
pub use storage::storage;

use super::frame::Frame;
use super::run_folder::failed;
use crate::error::{Error, Result};
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A value in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell<'a> {
    Text(&'a str),
    Number(f64),
    Count(usize),
    Empty,
}

impl From<f64> for Cell<'_> {
    fn from(number: f64) -> Self {
        Cell::Number(number)
    }
}

impl From<Option<f64>> for Cell<'_> {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Cell::Empty, Cell::Number)
    }
}

impl From<usize> for Cell<'_> {
    fn from(count: usize) -> Self {
        Cell::Count(count)
    }
}

impl<'a> From<&'a str> for Cell<'a> {
    fn from(text: &'a str) -> Self {
        Cell::Text(text)
    }
}

/// Rows of cells as text.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// The rows so far.
    pub(in crate::report) text: String,
}

impl Rows {
    /// Appends a row.
    pub fn add<'a>(&mut self, cells: impl IntoIterator<Item = Cell<'a>>) {
        for (column, cell) in cells.into_iter().enumerate() {
            if column > 0 {
                self.text.push(',');
            }
            self.push(cell);
        }
        self.text.push('\n');
    }

    fn push(&mut self, cell: Cell<'_>) {
        // writing to a string cannot fail
        let _ = match cell {
            Cell::Text(text) if text.contains([',', '"', '\n', '\r']) => {
                write!(self.text, "\"{}\"", text.replace('"', "\"\""))
            }
            Cell::Text(text) => write!(self.text, "{text}"),
            // {:?} takes an exponent where it is shorter
            Cell::Number(number) if !number.is_nan() => write!(self.text, "{number:?}"),
            Cell::Count(count) => write!(self.text, "{count}"),
            Cell::Number(_) | Cell::Empty => Ok(()),
        };
    }
}

/// A file of rows that grows.
#[derive(Debug)]
pub(super) struct Table {
    path: PathBuf,
    file: File,
    /// Length of what is whole, bytes.
    length: u64,
}

impl Table {
    /// A new table `<folder>/<name>.csv` with a header.
    pub fn create<'a>(folder: &Path, name: &str, columns: impl IntoIterator<Item = &'a str>) -> Result<Table> {
        let path = folder.join(format!("{name}.csv"));
        let file = File::create(&path).map_err(failed("create", &path))?;
        let mut table = Table { path, file, length: 0 };
        let mut header = Rows::default();
        header.add(columns.into_iter().map(Cell::Text));
        table.append(header)?;
        Ok(table)
    }

    /// Appends rows, all or none.
    pub fn append(&mut self, rows: Rows) -> Result<()> {
        match self.file.write_all(rows.text.as_bytes()) {
            Ok(()) => {
                self.length += rows.text.len() as u64;
                Ok(())
            }
            Err(source) => {
                // a half-written row goes; the error that matters is the one of writing
                let _ = self.file.set_len(self.length);
                Err(Error::Io { action: "write", path: self.path.clone(), source })
            }
        }
    }
}

/// The first cells of a row: number and time of the frame.
fn of_frame<'a>(frame: Frame) -> [Cell<'a>; 2] {
    [frame.index.into(), frame.time_s.into()]
}

/// The three components of a vector.
fn components<'a>(vector: [f64; 3]) -> [Cell<'a>; 3] {
    vector.map(Cell::Number)
}
