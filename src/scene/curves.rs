//! Controls over time, read from a table: `time_s,<control>,...`, one row per instant.
//!
//! The table `activations.csv` of a run is such a table too: its column `frame` and the deviations `<control>_sd` are
//! passed over.

use super::cursor::Mistakes;
use super::references::{first_use, help_for_name};
use super::spec::{ControlKind, ControlRange};
use crate::error::{Error, Place, Result};
use std::path::Path;
use std::sync::Arc;

/// Activations and poses of bones over time, linear between the rows and constant before the first and after the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// The instants, s, increasing; at least one.
    pub times_s: Vec<f64>,
    /// The controls, in the order of their columns.
    pub names: Vec<String>,
    /// For each control, its value at every instant: an activation from 0 to 1, degrees of a hinge, mm of a slide.
    pub columns: Vec<Vec<f64>>,
}

impl Curves {
    /// Reads the table at `path`, whose columns may be any of `controls`.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, otherwise every mistake in it, each with its line and column.
    pub fn read(path: &Path, controls: &[ControlRange]) -> Result<Curves> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::Io {
            action: "read",
            path: path.into(),
            source,
        })?;
        Curves::parse(&text, &path.display().to_string(), controls)
    }

    /// Reads the text of a table; `file` is what messages call it.
    ///
    /// # Errors
    /// Every mistake in the text, each with its line and column.
    pub fn parse(text: &str, file: &str, controls: &[ControlRange]) -> Result<Curves> {
        let mistakes = Mistakes::default();
        let file: Arc<str> = file.into();
        let mut lines = text
            .trim_start_matches('\u{feff}')
            .lines()
            .enumerate()
            .map(|(index, text)| Line { file: &file, number: index + 1, text })
            .filter(|line| !line.text.trim().is_empty());
        let all = lines.next().map(|line| line.cells()).unwrap_or_default();
        let width = all.len();
        let is_known = |name: &str| controls.iter().any(|control| control.name == name);
        let is_passed_over = |index: usize, name: &str| {
            index == 0 && name == "frame" || !is_known(name) && name.strip_suffix("_sd").is_some_and(is_known)
        };
        let passed_over: Vec<bool> = all.iter().enumerate().map(|(i, cell)| is_passed_over(i, cell.text)).collect();
        let header = kept(all, &passed_over);
        if header.first().is_none_or(|cell| cell.text != "time_s") {
            mistakes.add(Error::MissingKey {
                table: "the header of the table".into(),
                keys: "`time_s` as its first column".into(),
                help: "write the names of the columns in the first line, for example:\ntime_s,slab".into(),
                place: header.first().map_or_else(|| Place::whole(&file), |cell| cell.place.clone()),
            });
        }
        let named = header.get(1..).unwrap_or_default();
        let mut seen = Vec::new();
        // the range of each column
        let mut ranges: Vec<Option<&ControlRange>> = Vec::new();
        for Cell { text, place } in named {
            ranges.push(controls.iter().find(|control| control.name == *text));
            if ranges.last().is_some_and(Option::is_none) {
                let (kind, kinds) = what(controls);
                let known: Vec<String> = controls.iter().map(|control| control.name.clone()).collect();
                let help = help_for_name(text, &known, kinds);
                mistakes.add(Error::UnknownName { kind, name: (*text).into(), help, place: place.clone() });
            }
            first_use("column", text, place, &mut seen, &mistakes);
        }

        let mut curves = Curves {
            times_s: Vec::new(),
            names: named.iter().map(|cell| cell.text.to_string()).collect(),
            columns: vec![Vec::new(); named.len()],
        };
        for line in lines {
            let cells = line.cells();
            if cells.len() != width {
                mistakes.add(Error::WrongLength {
                    key: format!("line {}", line.number),
                    found: format!("{} cells", cells.len()).into(),
                    expected: format!("{width}, as the header has"),
                    place: line.place(0..line.text.len()),
                });
                continue;
            }
            let cells = kept(cells, &passed_over);
            let Some((time, values)) = cells.split_first() else { continue };
            if let Some(time_s) = time.number("time_s", &mistakes) {
                match curves.times_s.last() {
                    Some(&previous_s) if time_s <= previous_s => {
                        mistakes.add(Error::TimeOrder { time_s, previous_s, place: time.place.clone() });
                    }
                    _ => curves.times_s.push(time_s),
                }
            }
            for ((value, range), (name, column)) in
                values.iter().zip(&ranges).zip(curves.names.iter().zip(&mut curves.columns))
            {
                column.extend(value.control(name, *range, &mistakes));
            }
        }
        let mistakes = mistakes.sorted(&file);
        if !mistakes.is_empty() {
            return Err(Error::all(mistakes));
        }
        if curves.times_s.is_empty() {
            let (key, found) = (file.to_string(), "no rows".into());
            let expected = "at least one below the header".into();
            return Err(Error::WrongLength { key, found, expected, place: Place::whole(&file) });
        }
        Ok(curves)
    }

    /// The value of `control` at a time in seconds; `None` if it has no column.
    pub fn at(&self, control: &str, time_s: f64) -> Option<f64> {
        let column = &self.columns[self.names.iter().position(|name| name == control)?];
        let after = self.times_s.partition_point(|&time| time <= time_s);
        if after == 0 {
            return column.first().copied();
        }
        if after == column.len() {
            return column.last().copied();
        }
        // a(t) = a0 + (a1 - a0) (t - t0) / (t1 - t0)
        let part = (time_s - self.times_s[after - 1]) / (self.times_s[after] - self.times_s[after - 1]);
        Some(column[after - 1] + part * (column[after] - column[after - 1]))
    }
}

/// What controls are called: one, and several.
pub(super) fn what(controls: &[ControlRange]) -> (&'static str, &'static str) {
    match controls.iter().all(|control| control.kind == ControlKind::Activation) {
        true => ("muscle", "muscles"),
        false => ("control", "controls"),
    }
}

/// The cells of the columns that are not passed over.
fn kept<'a>(cells: Vec<Cell<'a>>, passed_over: &[bool]) -> Vec<Cell<'a>> {
    cells.into_iter().zip(passed_over).filter(|(_, passed_over)| !**passed_over).map(|(cell, _)| cell).collect()
}

/// A line of the table.
struct Line<'a> {
    file: &'a Arc<str>,
    /// From 1.
    number: usize,
    text: &'a str,
}

/// A cell without the blanks around it.
struct Cell<'a> {
    text: &'a str,
    place: Place,
}

impl<'a> Line<'a> {
    fn place(&self, span: std::ops::Range<usize>) -> Place {
        Place::on_line(self.file, self.number, self.text, span)
    }

    fn cells(&self) -> Vec<Cell<'a>> {
        let mut start = 0;
        let mut cells = Vec::new();
        for raw in self.text.split(',') {
            let text = raw.trim();
            let from = start + (raw.len() - raw.trim_start().len());
            cells.push(Cell { text, place: self.place(from..from + text.len()) });
            start += raw.len() + 1;
        }
        cells
    }
}

impl Cell<'_> {
    /// The finite number in the cell.
    fn number(&self, column: &str, mistakes: &Mistakes) -> Option<f64> {
        match self.text.parse::<f64>() {
            Ok(number) if number.is_finite() => return Some(number),
            Ok(_) => mistakes.add(self.out_of_range(column, "a finite number")),
            Err(_) => {
                let found =
                    if self.text.is_empty() { Box::from("empty") } else { format!("\"{}\"", self.text).into() };
                let (key, expected, place) = (column.into(), "a number".into(), self.place.clone());
                mistakes.add(Error::WrongType { key, expected, found, place });
            }
        }
        None
    }

    /// A number in the range of its control; any number where the control is not known.
    fn control(&self, column: &str, range: Option<&ControlRange>, mistakes: &Mistakes) -> Option<f64> {
        let value = self.number(column, mistakes)?;
        match range.filter(|range| !range.holds(value)) {
            None => Some(value),
            Some(range) => {
                mistakes.add(self.out_of_range(column, &range.allowed()));
                None
            }
        }
    }

    fn out_of_range(&self, column: &str, allowed: &str) -> Error {
        let (key, value, place) = (column.into(), self.text.into(), self.place.clone());
        Error::OutOfRange { key, value, allowed: allowed.into(), place }
    }
}
