//! Measured directions in files of VTK: vectors or diffusion tensors on points or cells, or lines as traces of fascicles.

use super::data::{Axes, Axis};
use super::xml;
use crate::error::{Error, Result};
use crate::math::tensor::Vector;
use std::path::Path;

/// Values on points or cells.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Array {
    pub name: String,
    /// Numbers per point or cell.
    pub components: usize,
    pub values: Vec<f64>,
}

/// What a file of VTK holds, as far as it is of use here.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Dataset {
    pub points: Vec<Vector>,
    /// The points of every cell.
    pub cells: Vec<Vec<usize>>,
    /// Whether each cell is a line.
    pub lines: Vec<bool>,
    pub on_points: Vec<Array>,
    pub on_cells: Vec<Array>,
}

impl Array {
    /// Whether it can hold directions: vectors, or tensors with 6 or 9 components.
    pub fn is_direction(&self) -> bool {
        matches!(self.components, 3 | 6 | 9)
    }
}

/// Reads the directions of a VTU or VTP file, or of a legacy VTK file, ASCII or binary.
///
/// # Errors
/// [`Error::Io`]; [`Error::Axes`] where it is not such a file, or where it is not clear what to read of it.
pub fn read(path: &Path, field: Option<&str>) -> Result<Axes> {
    axes(&dataset(path)?, field).map_err(|message| Error::Axes { path: path.into(), message: message.into() })
}

/// Reads a file, by its ending.
pub(super) fn dataset(path: &Path) -> Result<Dataset> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { action: "read", path: path.into(), source })?;
    let is_legacy = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("vtk"));
    let read = match is_legacy {
        true => Legacy { bytes: &bytes, at: 0, binary: false }.read(),
        false => xml::read(&bytes),
    };
    read.map_err(|message| Error::Axes { path: path.into(), message: message.into() })
}

/// The directions of a dataset: of the field with this name, or of the only one that can hold directions, or else its lines.
/// A field `weight` of one component beside it is their weight.
pub(super) fn axes(dataset: &Dataset, field: Option<&str>) -> std::result::Result<Axes, String> {
    let all = || dataset.on_points.iter().chain(&dataset.on_cells).filter(|array| array.is_direction());
    let names = || all().map(|array| array.name.as_str()).collect::<Vec<_>>().join(", ");
    let chosen = match field {
        Some(field) => {
            let found = all().find(|array| array.name == field);
            Some(found.ok_or_else(|| format!("no field `{field}` of 3, 6 or 9 components, but {}", names()))?)
        }
        None if all().count() > 1 => return Err(format!("several fields of 3, 6 or 9 components: {}", names())),
        None => all().next(),
    };
    let mut axes = Axes::default();
    let Some(array) = chosen else {
        let lines = dataset.cells.iter().zip(&dataset.lines).filter(|(_, is_line)| **is_line).map(|(cell, _)| cell);
        for (group, line) in lines.enumerate() {
            let points: Option<Vec<Vector>> = line.iter().map(|point| dataset.points.get(*point).copied()).collect();
            axes.add_trace(&points.ok_or("a line with a point that is not there")?, 1.0, group as u32);
        }
        return if axes.all.is_empty() {
            Err("no field of vectors or tensors, and no lines".into())
        } else {
            Ok(axes)
        };
    };
    let on_points = dataset.on_points.iter().any(|known| std::ptr::eq(known, array));
    let places: Vec<Vector> = if on_points {
        dataset.points.clone()
    } else {
        let middle = |cell: &Vec<usize>| -> Option<Vector> {
            let mut sum = [0.0; 3];
            for point in cell {
                let x = dataset.points.get(*point)?;
                (0..3).for_each(|i| sum[i] += x[i] / cell.len() as f64);
            }
            Some(sum)
        };
        let middles: Option<Vec<Vector>> = dataset.cells.iter().map(middle).collect();
        middles.ok_or("a cell with a point that is not there")?
    };
    if array.values.len() != array.components * places.len() {
        return Err(format!("field `{}` has {} numbers for {} places", array.name, array.values.len(), places.len()));
    }
    let beside = if on_points { &dataset.on_points } else { &dataset.on_cells };
    let weights = beside.iter().find(|other| other.name == "weight" && other.components == 1);
    for (index, (position, v)) in places.into_iter().zip(array.values.chunks_exact(array.components)).enumerate() {
        let weight = weights.and_then(|weights| weights.values.get(index)).copied().unwrap_or(1.0);
        match *v {
            [x, y, z] => {
                axes.add(Axis { position, fibre: [x, y, z], sheet: None, weight, group: index as u32 });
            }
            [xx, yy, zz, xy, yz, xz] => axes.add_tensor(position, [xx, yy, zz, xy, yz, xz], weight, index as u32),
            [xx, xy, xz, _, yy, yz, _, _, zz] => {
                axes.add_tensor(position, [xx, yy, zz, xy, yz, xz], weight, index as u32);
            }
            _ => {}
        }
    }
    if axes.all.is_empty() { Err(format!("field `{}` is zero everywhere", array.name)) } else { Ok(axes) }
}

/// A legacy file on its way to be read.
struct Legacy<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl<'a> Legacy<'a> {
    fn line(&mut self) -> Option<&'a str> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        self.at += end + 1;
        std::str::from_utf8(&rest[..end]).ok().map(str::trim)
    }

    /// The next word, in ASCII.
    fn word(&mut self) -> Option<&'a str> {
        while self.bytes.get(self.at)?.is_ascii_whitespace() {
            self.at += 1;
        }
        let start = self.at;
        while self.bytes.get(self.at).is_some_and(|byte| !byte.is_ascii_whitespace()) {
            self.at += 1;
        }
        std::str::from_utf8(&self.bytes[start..self.at]).ok()
    }

    /// So many numbers of a type.
    fn numbers(&mut self, count: usize, kind: &str) -> std::result::Result<Vec<f64>, String> {
        let short = || format!("it ends before the {count} numbers it promises");
        // every number takes at least one byte: what is promised must be there before memory is taken for it
        if count > self.bytes.len() {
            return Err(short());
        }
        if !self.binary {
            let number = |word: Option<&str>| {
                let word = word.ok_or_else(short)?;
                word.parse::<f64>().map_err(|_| format!("`{word}` where a number belongs"))
            };
            return (0..count).map(|_| number(self.word())).collect();
        }
        let (size, number): (usize, fn(&[u8]) -> f64) = match kind {
            "char" => (1, |b| f64::from(b[0] as i8)),
            "unsigned_char" => (1, |b| f64::from(b[0])),
            "short" => (2, |b| f64::from(i16::from_be_bytes([b[0], b[1]]))),
            "unsigned_short" => (2, |b| f64::from(u16::from_be_bytes([b[0], b[1]]))),
            "int" => (4, |b| f64::from(i32::from_be_bytes([b[0], b[1], b[2], b[3]]))),
            "unsigned_int" => (4, |b| f64::from(u32::from_be_bytes([b[0], b[1], b[2], b[3]]))),
            "float" => (4, |b| f64::from(f32::from_be_bytes([b[0], b[1], b[2], b[3]]))),
            "double" => (8, |b| f64::from_be_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]])),
            "vtktypeint64" | "long" => {
                (8, |b| i64::from_be_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f64)
            }
            other => return Err(format!("numbers of the type `{other}`")),
        };
        let bytes = self.bytes.get(self.at..self.at + size * count).ok_or_else(short)?;
        self.at += size * count;
        Ok(bytes.chunks_exact(size).map(number).collect())
    }

    fn read(&mut self) -> std::result::Result<Dataset, String> {
        let first = self.line().unwrap_or_default();
        if !first.starts_with("# vtk DataFile") {
            return Err("it does not start with `# vtk DataFile Version`".into());
        }
        self.line();
        self.binary = match self.line().unwrap_or_default() {
            "ASCII" => false,
            "BINARY" => true,
            other => return Err(format!("`{other}` where ASCII or BINARY belongs")),
        };
        let mut dataset = Dataset::default();
        let (mut grid, mut spacing, mut origin): (Option<Vec<usize>>, _, _) = (None, [1.0; 3], [0.0; 3]);
        let mut is_structured_points = false;
        // the arrays that follow are on points, on cells, or nowhere
        let mut on: Option<(bool, usize)> = None;
        while let Some(line) = self.line() {
            let words: Vec<&str> = line.split_whitespace().collect();
            let Some(keyword) = words.first().map(|word| word.to_uppercase()) else { continue };
            let count = |index: usize| -> std::result::Result<usize, String> {
                let number = words.get(index).and_then(|word| word.parse().ok());
                number.ok_or_else(|| format!("`{line}` without the numbers it should have"))
            };
            let kind = |index: usize| words.get(index).map_or(String::new(), |word| word.to_lowercase());
            let three = |words: &[&str]| -> std::result::Result<Vector, String> {
                let numbers: Vec<f64> = words.iter().skip(1).filter_map(|word| word.parse().ok()).collect();
                numbers.try_into().map_err(|_| format!("`{line}` without 3 numbers"))
            };
            match keyword.as_str() {
                "DATASET" => match kind(1).as_str() {
                    "structured_points" => is_structured_points = true,
                    "polydata" | "unstructured_grid" | "structured_grid" => {}
                    other => return Err(format!("a data set of the kind `{other}`")),
                },
                "DIMENSIONS" => grid = Some((1..4).map(count).collect::<std::result::Result<_, _>>()?),
                "SPACING" | "ASPECT_RATIO" => spacing = three(&words)?,
                "ORIGIN" => origin = three(&words)?,
                "POINTS" => {
                    let numbers = self.numbers(count(1)?.saturating_mul(3), &kind(2))?;
                    dataset.points = numbers.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect();
                }
                "LINES" | "CELLS" | "VERTICES" | "POLYGONS" | "TRIANGLE_STRIPS" => {
                    let (cells, size) = (count(1)?, count(2)?);
                    let is_line = keyword == "LINES";
                    let next = self.at;
                    let offsets = self.line().unwrap_or_default().to_uppercase();
                    let lists: Vec<Vec<usize>> = if offsets.starts_with("OFFSETS") {
                        let kind = |line: &str| line.split_whitespace().nth(1).unwrap_or("").to_lowercase();
                        let ends = self.numbers(cells, &kind(&offsets))?;
                        let header = std::iter::from_fn(|| self.line()).find(|line| !line.is_empty()).unwrap_or("");
                        let points = self.numbers(size, &kind(header))?;
                        let piece = |pair: &[f64]| points.get(pair[0] as usize..pair[1] as usize);
                        let pieces: Option<Vec<&[f64]>> = ends.windows(2).map(piece).collect();
                        let pieces = pieces.ok_or("cells whose offsets are out of range")?;
                        pieces.into_iter().map(|piece| piece.iter().map(|x| *x as usize).collect()).collect()
                    } else {
                        self.at = next;
                        let numbers = self.numbers(size, "int")?;
                        let (mut lists, mut rest) = (Vec::new(), &numbers[..]);
                        while let [points, more @ ..] = rest {
                            let points = (*points as usize).min(more.len());
                            lists.push(more[..points].iter().map(|x| *x as usize).collect());
                            rest = &more[points..];
                        }
                        lists
                    };
                    dataset.lines.extend(std::iter::repeat_n(is_line, lists.len()));
                    dataset.cells.extend(lists);
                }
                "CELL_TYPES" => {
                    let kinds = self.numbers(count(1)?, "int")?;
                    // 3 and 4 are a line and a line of several pieces
                    dataset.lines = kinds.iter().map(|kind| *kind == 3.0 || *kind == 4.0).collect();
                }
                "POINT_DATA" => on = Some((true, count(1)?)),
                "CELL_DATA" => on = Some((false, count(1)?)),
                "VECTORS" | "NORMALS" | "TENSORS" | "TENSORS6" | "SCALARS" => {
                    let components = match keyword.as_str() {
                        "TENSORS" => 9,
                        "TENSORS6" => 6,
                        "SCALARS" => words.get(3).and_then(|word| word.parse().ok()).unwrap_or(1),
                        _ => 3,
                    };
                    if keyword == "SCALARS" {
                        let table = self.at;
                        if !self.line().unwrap_or_default().starts_with("LOOKUP_TABLE") {
                            self.at = table;
                        }
                    }
                    let (_, places) = on.ok_or("values before POINT_DATA or CELL_DATA")?;
                    let values = self.numbers(places.saturating_mul(components), &kind(2))?;
                    let array = Array { name: words.get(1).copied().unwrap_or_default().into(), components, values };
                    self.keep(&mut dataset, on, array);
                }
                "FIELD" => {
                    for _ in 0..count(2)? {
                        let header = std::iter::from_fn(|| self.line()).find(|line| !line.is_empty()).unwrap_or("");
                        let parts: Vec<&str> = header.split_whitespace().collect();
                        let [name, components, places, kind] = parts[..] else {
                            return Err(format!("`{header}` where the name and size of an array belong"));
                        };
                        let size =
                            |word: &str| word.parse::<usize>().map_err(|_| format!("`{header}` without sizes"));
                        let (components, places) = (size(components)?, size(places)?);
                        let values = self.numbers(components.saturating_mul(places), &kind.to_lowercase())?;
                        self.keep(&mut dataset, on, Array { name: name.into(), components, values });
                    }
                }
                "METADATA" => while self.line().is_some_and(|line| !line.is_empty()) {},
                _ => {
                    return Err(format!(
                        "`{}` where a keyword belongs",
                        keyword.chars().take(40).collect::<String>()
                    ));
                }
            }
        }
        if let (true, Some([x, y, z])) = (is_structured_points, grid.as_deref()) {
            let (x, y, z) = (*x, *y, *z);
            if x.saturating_mul(y).saturating_mul(z) > self.bytes.len() {
                return Err("more points than the file has bytes".into());
            }
            let point = |k: usize| {
                let place = [k % x, k / x % y, k / x / y];
                std::array::from_fn(|i| origin[i] + spacing[i] * place[i] as f64)
            };
            dataset.points = (0..x * y * z).map(point).collect();
        }
        Ok(dataset)
    }

    fn keep(&self, dataset: &mut Dataset, on: Option<(bool, usize)>, array: Array) {
        match on {
            Some((true, _)) => dataset.on_points.push(array),
            Some((false, _)) => dataset.on_cells.push(array),
            None => {}
        }
    }
}
