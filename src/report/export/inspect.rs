//! What is in a file that was exported: its parts and what each holds. MCAP and EX files have readers of their own.

use crate::error::{Error, Result};
use crate::report::run_folder::failed;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::statistics::Statistics;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// What a file holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Exhibit {
    /// The file.
    pub path: PathBuf,
    /// Its length, bytes.
    pub bytes: u64,
    /// What it is.
    pub what: String,
    /// Its parts, in their order.
    pub parts: Vec<Part>,
}

/// A column, a body, a curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Part {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub holds: BTreeMap<&'static str, Value>,
}

impl Part {
    fn new<const N: usize>(name: impl Into<String>, holds: [(&'static str, Value); N]) -> Part {
        // what is not known is not told
        let holds = holds.into_iter().filter(|(_, value)| !value.is_null());
        Part { name: name.into(), holds: holds.collect() }
    }
}

/// What a reader finds: a word on the whole, and the parts; else what is wrong.
type Found = std::result::Result<(String, Vec<Part>), String>;
type Reader = fn(File) -> Found;

/// The readers, by the ends of names.
const READERS: [(&str, Reader); 5] = [
    ("glb", glb),
    ("sto", |file| sto(&text(file)?)),
    ("obj", |file| obj(&text(file)?)),
    ("ply", ply),
    ("parquet", table),
];

/// Looks into a file; `None` where the end of its name is not that of an export.
///
/// # Errors
/// [`Error::DamagedRun`], [`Error::Io`].
pub fn inspect(path: &Path) -> Result<Option<Exhibit>> {
    let end = path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default();
    let Some((_, reader)) = READERS.iter().find(|(known, _)| *known == end) else { return Ok(None) };
    let file = File::open(path).map_err(failed("read", path))?;
    let bytes = file.metadata().map_err(failed("read", path))?.len();
    match reader(file) {
        Ok((what, parts)) => Ok(Some(Exhibit { path: path.into(), bytes, what, parts })),
        Err(message) => Err(Error::DamagedRun { path: path.into(), message: message.into() }),
    }
}

fn text(file: File) -> std::result::Result<String, String> {
    std::io::read_to_string(file).map_err(|error| error.to_string())
}

fn bytes(mut file: File) -> std::result::Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map(|_| bytes).map_err(|error| error.to_string())
}

/// Columns of a table with their types and ranges.
fn table(file: File) -> Found {
    let file = SerializedFileReader::new(file).map_err(|error| error.to_string())?;
    let file = file.metadata();
    let (rows, schema) = (file.file_metadata().num_rows(), file.file_metadata().schema_descr());
    let column = |(number, column): (usize, &parquet::schema::types::ColumnDescPtr)| {
        let known: Vec<&Statistics> =
            file.row_groups().iter().filter_map(|group| group.column(number).statistics()).collect();
        let empty: u64 = known.iter().filter_map(|known| known.null_count_opt()).sum();
        let range = known.iter().filter_map(|known| match known {
            Statistics::Int64(known) => Some([*known.min_opt()? as f64, *known.max_opt()? as f64]),
            Statistics::Double(known) => Some([*known.min_opt()?, *known.max_opt()?]),
            _ => None,
        });
        let range = range.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
        let kind = column.physical_type().to_string();
        let range = match kind.as_str() {
            "INT64" => json!(range.map(|range| range.map(|end| end as i64))),
            _ => json!(range),
        };
        Part::new(column.name(), [("type", json!(kind)), ("empty", json!(empty)), ("range", range)])
    };
    let parts: Vec<Part> = schema.columns().iter().enumerate().map(column).collect();
    Ok((format!("table, {rows} rows, {} columns", parts.len()), parts))
}

/// Meshes, and what moves over time.
fn glb(file: File) -> Found {
    let bytes = bytes(file)?;
    let number = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let document = || -> Option<Value> {
        let length = number(12).filter(|_| bytes.starts_with(b"glTF"))?;
        serde_json::from_slice(bytes.get(20..20_usize.checked_add(length)?)?).ok()
    };
    let document = document().ok_or("it has no glTF document")?;
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let count = |accessor: &Value| accessor.as_u64().map(|at| document["accessors"][at as usize]["count"].clone());
    let mesh = |mesh: &Value| {
        let primitive = &mesh["primitives"][0];
        let triangles = count(&primitive["indices"]).and_then(|corners| Some(corners.as_u64()? / 3));
        Part::new(
            mesh["name"].as_str().unwrap_or_default(),
            [
                ("points", json!(count(&primitive["attributes"]["POSITION"]))),
                ("triangles", json!(triangles)),
                ("targets", json!(list(&primitive["targets"]).len())),
            ],
        )
    };
    let mut parts: Vec<Part> = list(&document["meshes"]).iter().map(mesh).collect();
    for animation in list(&document["animations"]) {
        for channel in list(&animation["channels"]) {
            let node = &document["nodes"][channel["target"]["node"].as_u64().unwrap_or_default() as usize];
            if channel["target"]["path"] != "translation" {
                continue;
            }
            let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap_or_default() as usize];
            let holds = [("keys", json!(count(&sampler["input"]))), ("unit", node["extras"]["unit"].clone())];
            parts.push(Part::new(node["name"].as_str().unwrap_or_default(), holds));
        }
    }
    let error = document["extras"]["largest_error_of_modes_mm"].as_f64();
    let error = error.map_or(String::new(), |error| format!(", modes within {error:.4} mm"));
    Ok((format!("scene `{}`{error}", document["scenes"][0]["name"].as_str().unwrap_or_default()), parts))
}

/// Columns with their ranges.
fn sto(text: &str) -> Found {
    let mut lines = text.lines().skip_while(|line| *line != "endheader").skip(1);
    let names: Vec<&str> = lines.next().ok_or("it has no `endheader` with columns behind it")?.split('\t').collect();
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; names.len()];
    let mut rows = 0;
    for line in lines {
        let values: Vec<f64> = line.split('\t').map_while(|cell| cell.parse().ok()).collect();
        if values.len() != names.len() {
            return Err(format!("row {} does not have {} numbers", rows + 1, names.len()));
        }
        ranges.iter_mut().zip(values).for_each(|(range, x)| *range = [range[0].min(x), range[1].max(x)]);
        rows += 1;
    }
    let range = |range: [f64; 2]| (rows > 0).then_some(range);
    let parts = names.iter().zip(ranges).map(|(name, known)| Part::new(*name, [("range", json!(range(known)))]));
    Ok((format!("storage, {rows} rows, {} columns", names.len()), parts.collect()))
}

/// Objects.
fn obj(text: &str) -> Found {
    let mut found: Vec<(&str, [usize; 2])> = Vec::new();
    for line in text.lines() {
        match (line.split_once(' '), found.last_mut()) {
            (Some(("o", name)), _) => found.push((name, [0; 2])),
            (Some(("v", _)), Some((_, [points, _]))) => *points += 1,
            (Some(("f", _)), Some((_, [_, faces]))) => *faces += 1,
            _ => {}
        }
    }
    let what = text.lines().next().and_then(|line| line.strip_prefix("# ")).unwrap_or("meshes").to_owned();
    match found.is_empty() {
        true => Err("it has no object".into()),
        false => Ok((what, found.iter().map(|(name, [points, faces])| body(name, *points, *faces)).collect())),
    }
}

/// The skin.
fn ply(file: File) -> Found {
    let bytes = bytes(file)?;
    let end = bytes.windows(11).position(|part| part == b"end_header\n").ok_or("it has no `end_header`")?;
    let head = String::from_utf8_lossy(&bytes[..end]);
    let count = |element: &str| {
        let line = head.lines().find_map(|line| line.strip_prefix("element ")?.strip_prefix(element));
        line.and_then(|count| count.trim().parse().ok()).ok_or(format!("its head counts no `{element}`"))
    };
    let what = head.lines().find_map(|line| line.strip_prefix("comment ")).unwrap_or("mesh").to_owned();
    Ok((what, vec![body("skin", count("vertex")?, count("face")?)]))
}

fn body(name: &str, points: usize, faces: usize) -> Part {
    Part::new(name, [("points", json!(points)), ("faces", json!(faces))])
}

impl fmt::Display for Exhibit {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "{}: {:.1} kB, {}", self.path.display(), self.bytes as f64 / 1e3, self.what)?;
        for Part { name, holds } in &self.parts {
            let said: Vec<String> = holds.iter().map(|(what, value)| format!("{what} {}", plain(value))).collect();
            writeln!(out, "  {name:<30} {}", said.join(", "))?;
        }
        Ok(())
    }
}

/// A value without quotes; a range in words.
fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(ends) => ends.iter().map(plain).collect::<Vec<_>>().join(" to "),
        other => other.to_string(),
    }
}
