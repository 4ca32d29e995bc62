//! Measured directions as a table: `x,y,z,vx,vy,vz` with `sx,sy,sz`, `weight`, `sd_deg`, `confidence` and `trace` where
//! there are any; or traces of fascicles as `trace,x,y,z`, their points in order.

use super::data::{Axes, Axis};
use crate::error::{Error, Place, Result};
use crate::math::tensor::Vector;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// The columns there may be.
const COLUMNS: [&str; 13] =
    ["x", "y", "z", "vx", "vy", "vz", "sx", "sy", "sz", "weight", "sd_deg", "confidence", "trace"];
/// More mistakes than this in one file are not told.
const MOST_TOLD: usize = 20;

/// Reads a table.
///
/// # Errors
/// [`Error::Io`]; every mistake in it, each with its line and column (the first 20).
pub fn read(path: &Path) -> Result<Axes> {
    let text =
        std::fs::read_to_string(path).map_err(|source| Error::Io { action: "read", path: path.into(), source })?;
    parse(&text, &path.display().to_string())
}

/// Reads the text of a table; `file` is what messages call it. An axis counts by weight x confidence / sd_deg^2, each 1
/// where its column is absent. Cells of a sheet that are all empty are no measurement.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, file: &str) -> Result<Axes> {
    let file: Arc<str> = file.into();
    let mut lines =
        text.trim_start_matches('\u{feff}').lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let (_, header) = lines.next().unwrap_or((0, ""));
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let columns = columns(&names, header, &file)?;
    let at = |name: &str| columns[COLUMNS.iter().position(|known| *known == name).unwrap_or_default()];
    let place = |xyz: [&str; 3]| xyz.map(at);
    let (position, fibre, sheet) = (place(["x", "y", "z"]), place(["vx", "vy", "vz"]), place(["sx", "sy", "sz"]));
    let is_trace = fibre.iter().all(Option::is_none);

    let mut mistakes: Vec<Error> = Vec::new();
    let mut axes = Axes::default();
    let mut groups: HashMap<&str, u32> = HashMap::new();
    let mut traces: Vec<(u32, f64, Vec<Vector>)> = Vec::new();
    for (index, (number, line)) in lines.enumerate() {
        if mistakes.len() >= MOST_TOLD {
            break;
        }
        let mut cells = [""; 32];
        let mut count = 0;
        for cell in line.split(',') {
            if count < cells.len() {
                cells[count] = cell.trim();
            }
            count += 1;
        }
        if count != names.len() {
            mistakes.push(Error::WrongLength {
                key: format!("line {}", number + 1),
                found: format!("{count} cells").into(),
                expected: format!("{}, as the header has", names.len()),
                place: Place::on_line(&file, number + 1, line, 0..line.len()),
            });
            continue;
        }
        let mut read = |column: Option<usize>, default: f64, least: f64| -> f64 {
            let Some(column) = column else { return default };
            match cells[column].parse::<f64>() {
                Ok(value) if value.is_finite() && value >= least => value,
                _ => {
                    let start = cells[column].as_ptr() as usize - line.as_ptr() as usize;
                    let place = Place::on_line(&file, number + 1, line, start..start + cells[column].len());
                    let expected = match least {
                        f64::NEG_INFINITY => "a finite number",
                        0.0 => "a number that is 0 or more",
                        _ => "a number greater than 0",
                    };
                    let found =
                        if cells[column].is_empty() { "empty".into() } else { format!("\"{}\"", cells[column]) };
                    mistakes.push(Error::WrongType {
                        key: names[column].into(),
                        expected: expected.into(),
                        found: found.into(),
                        place,
                    });
                    default
                }
            }
        };
        const ANY: f64 = f64::NEG_INFINITY;
        let x = position.map(|column| read(column, 0.0, ANY));
        let sd = read(at("sd_deg"), 1.0, f64::MIN_POSITIVE);
        let weight = read(at("weight"), 1.0, 0.0) * read(at("confidence"), 1.0, 0.0) / (sd * sd);
        let next = groups.len() as u32;
        let group = at("trace").map_or(index as u32, |column| *groups.entry(cells[column]).or_insert(next));
        if is_trace {
            match traces.last_mut().filter(|(last, _, _)| *last == group) {
                Some((_, _, points)) => points.push(x),
                None => traces.push((group, weight, vec![x])),
            }
            continue;
        }
        let fibre = fibre.map(|column| read(column, 0.0, ANY));
        let measured = sheet.iter().flatten().any(|column| !cells[*column].is_empty());
        let sheet = measured.then(|| sheet.map(|column| read(column, 0.0, ANY)));
        axes.add(Axis { position: x, fibre, sheet, weight, group });
    }
    if !mistakes.is_empty() {
        return Err(Error::all(mistakes));
    }
    traces.iter().for_each(|(group, weight, points)| axes.add_trace(points, *weight, *group));
    if axes.all.is_empty() {
        let (key, expected) = (file.to_string(), "at least one axis, or two points of a trace".into());
        return Err(Error::WrongLength { key, found: "none".into(), expected, place: Place::whole(&file) });
    }
    Ok(axes)
}

/// For each of [`COLUMNS`] where it stands.
fn columns(names: &[&str], header: &str, file: &Arc<str>) -> Result<[Option<usize>; 13]> {
    let mut columns = [None; 13];
    let mut mistakes = Vec::new();
    let place = |name: &str| {
        let start = (name.as_ptr() as usize).saturating_sub(header.as_ptr() as usize);
        Place::on_line(file, 1, header, start..start + name.len())
    };
    for (index, name) in names.iter().enumerate() {
        match COLUMNS.iter().position(|known| known == name) {
            Some(column) if columns[column].is_none() && index < 32 => columns[column] = Some(index),
            Some(_) => mistakes.push(Error::DuplicateName {
                kind: "column",
                name: (*name).into(),
                first_line: 1,
                place: place(name),
            }),
            None => mistakes.push(Error::UnknownName {
                kind: "column",
                name: (*name).into(),
                help: format!("the columns are {}", COLUMNS.join(", ")),
                place: place(name),
            }),
        }
    }
    let lacks = |needed: &[&'static str]| -> Vec<&'static str> {
        needed.iter().filter(|name| !names.contains(name)).copied().collect()
    };
    let fibre = lacks(&["vx", "vy", "vz"]);
    let mut missing = lacks(&["x", "y", "z"]);
    match fibre.len() {
        3 => missing.extend(lacks(&["trace"])),
        _ => missing.extend(fibre),
    }
    let sheet = lacks(&["sx", "sy", "sz"]);
    missing.extend(if sheet.len() < 3 { sheet } else { Vec::new() });
    if !missing.is_empty() {
        let keys = missing.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        mistakes.push(Error::MissingKey {
            table: "the header of the table".into(),
            keys: keys.into(),
            help: "write x,y,z,vx,vy,vz for directions, or trace,x,y,z for the points of traces".into(),
            place: Place::on_line(file, 1, header, 0..header.len()),
        });
    }
    if mistakes.is_empty() { Ok(columns) } else { Err(Error::all(mistakes)) }
}
