//! Marker files of motion capture: C3D, TRC and CSV, known by the end of their name.
//!
//! None of them has checksums. What they say twice is compared (numbers of frames, markers and columns), so that a file that
//! is cut short or out of step is an error; a digit that another one took the place of cannot be seen.

mod c3d;
mod csv;
mod trc;

use std::path::Path;

use super::format::Sample;
use crate::error::{Error, Result};

/// What a file holds.
#[derive(Debug, Default)]
pub(super) struct Tracks {
    /// One per frame, nanoseconds.
    pub stamps_ns: Vec<i64>,
    /// Label and sample of every marker of a frame.
    pub frames: Vec<Vec<(String, Sample)>>,
    /// The units it says it is in.
    pub units: Vec<String>,
    /// Set where the file stops too early, and that was allowed.
    pub truncated: bool,
}

/// A kind of file. To add one: a file with its `FileFormat`, and a line in [`FILES`].
pub(super) trait FileFormat: Sync {
    /// In messages and reports.
    fn name(&self) -> &'static str;

    /// The end of the names of such files, in lower case.
    fn extension(&self) -> &'static str;

    /// Reads the whole; `allow_truncated` accepts the intact part of a file that stops too early.
    fn read(&self, bytes: &[u8], allow_truncated: bool) -> std::result::Result<Tracks, Wrong>;
}

/// Every kind.
const FILES: [&dyn FileFormat; 3] = [&c3d::C3d, &trc::Trc, &csv::Csv];

/// What is wrong with a file, and where: `line 7`, `byte 512`.
#[derive(Debug)]
pub(super) struct Wrong {
    pub at: String,
    pub message: String,
}

impl Wrong {
    fn line(line: usize, message: impl Into<String>) -> Wrong {
        Wrong { at: format!("line {line}"), message: message.into() }
    }

    fn byte(byte: usize, message: impl Into<String>) -> Wrong {
        Wrong { at: format!("byte {byte}"), message: message.into() }
    }

    /// As an error of the file.
    pub fn error(self, path: &Path) -> Error {
        Error::MarkerFile { path: path.into(), at: self.at.into(), message: self.message.into() }
    }
}

/// The kind of a file, by the end of its name.
pub(super) fn kind(path: &Path) -> Option<&'static dyn FileFormat> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    FILES.into_iter().find(|format| format.extension() == extension)
}

/// Reads a file of a known kind; `path` names it in messages.
pub(super) fn read(format: &dyn FileFormat, path: &Path, bytes: &[u8], allow_truncated: bool) -> Result<Tracks> {
    format.read(bytes, allow_truncated).map_err(|wrong| wrong.error(path))
}

/// Number, from 1, and text of each line.
type Lines<'a> = Vec<(usize, &'a str)>;

/// A text in whole lines. The last one must be closed, or a number in it could have lost digits; where a
/// short file is allowed it is left out.
fn lines(bytes: &[u8], allow_truncated: bool) -> std::result::Result<(Lines<'_>, bool), Wrong> {
    let text =
        std::str::from_utf8(bytes).map_err(|error| Wrong::byte(error.valid_up_to(), "this is not UTF-8 text"))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let closed = text.ends_with('\n') || text.is_empty();
    let mut lines: Lines<'_> = text.lines().enumerate().map(|(index, line)| (index + 1, line)).collect();
    if !closed {
        let (number, _) = lines.pop().unwrap_or((1, ""));
        if !allow_truncated {
            return Err(Wrong::line(number, "the last line is not closed by a line end: the file is cut short"));
        }
    }
    Ok((lines, !closed))
}

/// The number in a cell; `None` in an empty one.
fn number(cell: &str, line: usize, column: usize) -> std::result::Result<Option<f64>, Wrong> {
    match cell.trim() {
        "" => Ok(None),
        cell => {
            let number = cell.parse().ok();
            number.map(Some).ok_or_else(|| Wrong::line(line, format!("column {} is no number: `{cell}`", column + 1)))
        }
    }
}

/// A position of three cells, all of them empty where it is lost.
fn sample(cells: [Option<f64>; 3], line: usize, label: &str) -> std::result::Result<Sample, Wrong> {
    match cells {
        [Some(x), Some(y), Some(z)] => Ok(Sample::Position([x, y, z])),
        [None, None, None] => Ok(Sample::Absent),
        _ => Err(Wrong::line(line, format!("`{label}` has some coordinates and lacks others"))),
    }
}

/// Nanoseconds of a time in seconds.
fn stamp_ns(seconds: f64, at: impl FnOnce() -> String) -> std::result::Result<i64, Wrong> {
    let stamp = (seconds * 1e9).round();
    if stamp.abs() < 2_f64.powi(62) {
        Ok(stamp as i64)
    } else {
        Err(Wrong { at: at(), message: format!("the time {seconds} s is none") })
    }
}
