//! CSV (RFC 4180), in two layouts that the header tells apart.
//!
//! ```text
//! time_s,nose_x_mm,nose_y_mm,nose_z_mm,chin_x_mm,...        wide: a row per frame
//! frame,time_s,name,x_mm,y_mm,z_mm                          long: a row per frame and marker, as tables/markers.csv
//! ```
//!
//! The unit at the end of a column may be missing. Empty cells are lost samples. In the long layout other columns are passed
//! over; in the wide one every column must be a time, a frame number or a coordinate.

use super::super::format::Sample;
use super::{FileFormat, Tracks, Wrong, lines, number, sample, stamp_ns};

pub(super) struct Csv;

type Result<T> = std::result::Result<T, Wrong>;

/// Names of the column of times, s.
const TIME: [&str; 3] = ["time_s", "time", "t"];
/// Names of the column of labels.
const LABEL: [&str; 3] = ["name", "marker", "label"];
/// What may stand behind the name of a column.
const UNITS: [&str; 3] = ["mm", "cm", "m"];

impl FileFormat for Csv {
    fn name(&self) -> &'static str {
        "csv"
    }

    fn extension(&self) -> &'static str {
        "csv"
    }

    fn read(&self, bytes: &[u8], allow_truncated: bool) -> Result<Tracks> {
        let (lines, truncated) = lines(bytes, allow_truncated)?;
        let rows = lines.iter().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let mut rows = rows.map(|(number, line)| cells(line, *number).map(|cells| (*number, cells)));
        let (head, header) = rows.next().unwrap_or(Err(Wrong::line(1, "the file is empty")))?;
        let header: Vec<String> = header.iter().map(|name| name.trim().to_owned()).collect();
        let rows = rows.map(|row| {
            let (line, cells) = row?;
            if cells.len() == header.len() {
                return Ok((line, cells));
            }
            Err(Wrong::line(line, format!("the row has {} cells, the header {}", cells.len(), header.len())))
        });
        let rows: Vec<(usize, Vec<String>)> = rows.collect::<Result<_>>()?;
        let named = |names: &[&str]| header.iter().position(|name| names.contains(&name.to_lowercase().as_str()));
        let time = named(&TIME).ok_or_else(|| Wrong::line(head, "there is no column `time_s`"))?;
        let tracks = match named(&LABEL) {
            Some(label) => long(&header, head, (time, named(&["frame"]), label), &rows)?,
            None => wide(&header, head, (time, named(&["frame"])), &rows)?,
        };
        Ok(Tracks { truncated, ..tracks })
    }
}

/// The cells of a line.
fn cells(line: &str, number: usize) -> Result<Vec<String>> {
    let mut cells = Vec::new();
    let mut rest = line;
    loop {
        let (cell, after) = match rest.strip_prefix('"') {
            None => {
                let end = rest.find(',').unwrap_or(rest.len());
                (rest[..end].to_owned(), &rest[end..])
            }
            Some(mut inner) => {
                let mut cell = String::new();
                loop {
                    let end = inner.find('"').ok_or_else(|| Wrong::line(number, "a quote is not closed"))?;
                    cell += &inner[..end];
                    inner = &inner[end + 1..];
                    match inner.strip_prefix('"') {
                        Some(more) => (cell.push('"'), inner = more).1,
                        None => break,
                    }
                }
                (cell, inner)
            }
        };
        cells.push(cell);
        match after.strip_prefix(',') {
            Some(more) => rest = more,
            None if after.is_empty() => return Ok(cells),
            None => return Err(Wrong::line(number, "something follows a closed quote")),
        }
    }
}

/// Label, axis (0 to 2) and unit of a column called like `nose_x_mm`, `nose.x` or `nose:X`.
fn coordinate(column: &str) -> Option<(&str, usize, Option<&str>)> {
    let (stem, unit) = match column.rsplit_once('_') {
        Some((stem, unit)) if UNITS.contains(&unit) => (stem, Some(unit)),
        _ => (column, None),
    };
    let (rest, axis) = match stem.char_indices().next_back()? {
        (at, 'x' | 'X') => (&stem[..at], 0),
        (at, 'y' | 'Y') => (&stem[..at], 1),
        (at, 'z' | 'Z') => (&stem[..at], 2),
        _ => return None,
    };
    match rest.strip_suffix(['_', '.', ':', ' ']) {
        Some(label) => Some((label, axis, unit)),
        None if rest.is_empty() => Some(("", axis, unit)),
        None => None,
    }
}

fn note(units: &mut Vec<String>, unit: Option<&str>) {
    if let Some(unit) = unit.filter(|unit| !units.iter().any(|known| known == unit)) {
        units.push(unit.to_owned());
    }
}

fn time_of(cells: &[String], line: usize, column: usize) -> Result<i64> {
    let time = number(&cells[column], line, column)?.ok_or_else(|| Wrong::line(line, "the row has no time"))?;
    stamp_ns(time, || format!("line {line}"))
}

fn wide(
    header: &[String],
    head: usize,
    (time, frame): (usize, Option<usize>),
    rows: &[(usize, Vec<String>)],
) -> Result<Tracks> {
    let mut tracks = Tracks::default();
    let mut markers: Vec<(&str, [Option<usize>; 3])> = Vec::new();
    for (place, column) in header.iter().enumerate() {
        if place == time || Some(place) == frame {
            continue;
        }
        let Some((label, axis, unit)) = coordinate(column).filter(|(label, ..)| !label.is_empty()) else {
            return Err(Wrong::line(head, format!("column `{column}` is neither a time, a frame nor a coordinate")));
        };
        note(&mut tracks.units, unit);
        let known = match markers.iter().position(|(known, _)| *known == label) {
            Some(known) => known,
            None => {
                markers.push((label, [None; 3]));
                markers.len() - 1
            }
        };
        if markers[known].1[axis].replace(place).is_some() {
            return Err(Wrong::line(head, format!("column `{column}` stands there twice")));
        }
    }
    let mut complete = Vec::with_capacity(markers.len());
    for (label, axes) in markers {
        let [Some(x), Some(y), Some(z)] = axes else {
            return Err(Wrong::line(head, format!("`{label}` has not all of x, y and z")));
        };
        complete.push((label, [x, y, z]));
    }
    let markers = complete;
    if markers.is_empty() {
        return Err(Wrong::line(head, "there is no column of coordinates"));
    }
    for (line, cells) in rows {
        let of = |(label, axes): &(&str, [usize; 3])| -> Result<(String, Sample)> {
            let [x, y, z] = axes.map(|column| number(&cells[column], *line, column));
            Ok((label.to_string(), sample([x?, y?, z?], *line, label)?))
        };
        tracks.frames.push(markers.iter().map(of).collect::<Result<_>>()?);
        tracks.stamps_ns.push(time_of(cells, *line, time)?);
    }
    Ok(tracks)
}

fn long(
    header: &[String],
    head: usize,
    (time, frame, label): (usize, Option<usize>, usize),
    rows: &[(usize, Vec<String>)],
) -> Result<Tracks> {
    let mut tracks = Tracks::default();
    let mut axes = [None; 3];
    for (place, column) in header.iter().enumerate() {
        if let Some(("", axis, unit)) = coordinate(column) {
            note(&mut tracks.units, unit);
            if axes[axis].replace(place).is_some() {
                return Err(Wrong::line(head, format!("column `{column}` stands there twice")));
            }
        }
    }
    let [Some(x), Some(y), Some(z)] = axes else {
        return Err(Wrong::line(head, "there are not all of the columns `x_mm`, `y_mm` and `z_mm`"));
    };
    let mut last: Option<(i64, &str)> = None;
    for (line, cells) in rows {
        let stamp = time_of(cells, *line, time)?;
        let number_of = frame.map_or("", |frame| cells[frame].trim());
        if last != Some((stamp, number_of)) {
            tracks.frames.push(Vec::new());
            tracks.stamps_ns.push(stamp);
            last = Some((stamp, number_of));
        }
        let name = cells[label].trim();
        let [x, y, z] = [x, y, z].map(|column| number(&cells[column], *line, column));
        let sample = sample([x?, y?, z?], *line, name)?;
        tracks.frames.last_mut().into_iter().for_each(|shown| shown.push((name.to_owned(), sample)));
    }
    Ok(tracks)
}
