//! The XML files of VTK, unstructured grids and poly data: arrays as text, in base64 or appended, compressed by zlib or not
//! (VTK file formats, "XML file formats").

use super::vtk::{Array, Dataset};
use flate2::read::ZlibDecoder;
use std::io::Read;

type Result<T> = std::result::Result<T, String>;

/// How the file stores numbers.
struct Format<'a> {
    big_endian: bool,
    /// Bytes of a number in the header of an array.
    header: usize,
    compressed: bool,
    appended: &'a [u8],
    appended_base64: bool,
}

/// A tag: its name without the slash, what it is, and its attributes.
struct Tag<'a> {
    name: &'a str,
    closes: bool,
    empty: bool,
    attributes: &'a str,
}

impl<'a> Tag<'a> {
    fn parse(text: &'a str) -> Tag<'a> {
        let closes = text.starts_with('/');
        let empty = text.ends_with('/');
        let text = text.trim_start_matches('/').trim_end_matches('/');
        let end = text.find(char::is_whitespace).unwrap_or(text.len());
        Tag { name: &text[..end], closes, empty, attributes: &text[end..] }
    }

    /// The value of an attribute.
    fn get(&self, key: &str) -> Option<&'a str> {
        let mut rest = self.attributes;
        while let Some(equals) = rest.find('=') {
            let name = rest[..equals].trim();
            let after = rest[equals + 1..].trim_start();
            let quote = after.chars().next().filter(|c| matches!(c, '"' | '\''))?;
            let end = after[1..].find(quote)?;
            if name == key {
                return Some(&after[1..=end]);
            }
            rest = &after[end + 2..];
        }
        None
    }

    fn number(&self, key: &str) -> Option<usize> {
        self.get(key)?.trim().parse().ok()
    }
}

/// Reads a file; several pieces become one.
pub(super) fn read(bytes: &[u8]) -> Result<Dataset> {
    const APPENDED: &[u8] = b"<AppendedData";
    let split = bytes.windows(APPENDED.len()).position(|window| window == APPENDED);
    let head = std::str::from_utf8(&bytes[..split.unwrap_or(bytes.len())]).map_err(|_| "its head is not text")?;
    let rest = &bytes[split.unwrap_or(bytes.len())..];
    let mut format =
        Format { big_endian: false, header: 4, compressed: false, appended: &[], appended_base64: false };
    if let Some(start) = rest.iter().position(|byte| *byte == b'>') {
        let tag = String::from_utf8_lossy(&rest[1..start]).into_owned();
        format.appended_base64 = Tag::parse(&tag).get("encoding") == Some("base64");
        let underscore = rest[start..].iter().position(|byte| *byte == b'_').map(|place| start + place + 1);
        format.appended = &rest[underscore.unwrap_or(rest.len())..];
    }

    let mut dataset = Dataset::default();
    let mut piece: Vec<(String, Array)> = Vec::new();
    let mut section = String::new();
    let mut known = false;
    let mut at = 0;
    while let Some(open) = head[at..].find('<').map(|place| at + place) {
        let Some(close) = head[open..].find('>').map(|place| open + place) else { break };
        let tag = Tag::parse(&head[open + 1..close]);
        at = close + 1;
        match tag.name {
            "VTKFile" if !tag.closes => {
                known = matches!(tag.get("type"), Some("UnstructuredGrid" | "PolyData"));
                format.big_endian = tag.get("byte_order") == Some("BigEndian");
                format.header = if tag.get("header_type") == Some("UInt64") { 8 } else { 4 };
                match tag.get("compressor") {
                    None => {}
                    Some("vtkZLibDataCompressor") => format.compressed = true,
                    Some(other) => return Err(format!("arrays compressed by {other}; zlib is read")),
                }
            }
            "Piece" if tag.closes => add_piece(&mut dataset, std::mem::take(&mut piece))?,
            "Points" | "PointData" | "CellData" | "Cells" | "Lines" | "Verts" | "Polys" | "Strips" | "FieldData" => {
                section = if tag.closes || tag.empty { String::new() } else { tag.name.into() };
            }
            "DataArray" if !tag.closes => {
                let text = match head[at..].find('<').map(|place| at + place) {
                    Some(end) if !tag.empty => &head[at..end],
                    _ => "",
                };
                let wanted = !matches!(section.as_str(), "" | "FieldData") && tag.get("type") != Some("String");
                if wanted {
                    let name = tag.get("Name").unwrap_or_default();
                    let values = format.values(&tag, text).map_err(|why| format!("array `{name}`: {why}"))?;
                    let components = tag.number("NumberOfComponents").unwrap_or(1).max(1);
                    piece.push((section.clone(), Array { name: name.into(), components, values }));
                }
            }
            _ => {}
        }
    }
    if known { Ok(dataset) } else { Err("it is no VTKFile of the type UnstructuredGrid or PolyData".into()) }
}

/// Adds what stands in a piece.
fn add_piece(dataset: &mut Dataset, piece: Vec<(String, Array)>) -> Result<()> {
    let first = dataset.points.len();
    let list = |section: &str, name: &str| -> Option<Vec<usize>> {
        let found = piece.iter().find(|(of, array)| of == section && array.name == name);
        found.map(|(_, array)| array.values.iter().map(|x| *x as usize).collect())
    };
    // cells of poly data come in this order
    for section in ["Cells", "Verts", "Lines", "Strips", "Polys"] {
        let (Some(points), Some(ends)) = (list(section, "connectivity"), list(section, "offsets")) else { continue };
        let kinds = list(section, "types");
        let mut start = 0;
        for (cell, end) in ends.into_iter().enumerate() {
            let list = points.get(start..end).ok_or("cells whose offsets are out of range")?;
            dataset.cells.push(list.iter().map(|point| first + point).collect());
            let kind = kinds.as_ref().and_then(|kinds| kinds.get(cell)).copied();
            dataset.lines.push(section == "Lines" || matches!(kind, Some(3 | 4)));
            start = end;
        }
    }
    for (section, array) in piece {
        let arrays = match section.as_str() {
            "Points" => {
                dataset.points.extend(array.values.chunks_exact(3).map(|x| [x[0], x[1], x[2]]));
                continue;
            }
            "PointData" => &mut dataset.on_points,
            "CellData" => &mut dataset.on_cells,
            _ => continue,
        };
        match arrays.iter_mut().find(|known| known.name == array.name && known.components == array.components) {
            Some(known) => known.values.extend(array.values),
            None => arrays.push(array),
        }
    }
    Ok(())
}

impl Format<'_> {
    /// The numbers of an array.
    fn values(&self, tag: &Tag, text: &str) -> Result<Vec<f64>> {
        let raw = match tag.get("format") {
            Some("ascii") => {
                let number = |word: &str| word.parse().map_err(|_| format!("`{word}` where a number belongs"));
                return text.split_whitespace().map(number).collect();
            }
            Some("binary") => self.base64_array(text.trim().as_bytes())?,
            Some("appended") => {
                let offset = tag.number("offset").ok_or("it has no offset")?;
                let rest = self.appended.get(offset..).ok_or("its offset is beyond the file")?;
                if self.appended_base64 { self.base64_array(rest)? } else { self.raw_array(rest)? }
            }
            other => return Err(format!("the format {:?}", other.unwrap_or_default())),
        };
        let (size, number): (usize, fn([u8; 8]) -> f64) = match tag.get("type").unwrap_or_default() {
            "Int8" => (1, |b| f64::from(b[0] as i8)),
            "UInt8" => (1, |b| f64::from(b[0])),
            "Int16" => (2, |b| f64::from(i16::from_le_bytes([b[0], b[1]]))),
            "UInt16" => (2, |b| f64::from(u16::from_le_bytes([b[0], b[1]]))),
            "Int32" => (4, |b| f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            "UInt32" => (4, |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            "Float32" => (4, |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            "Int64" => (8, |b| i64::from_le_bytes(b) as f64),
            "UInt64" => (8, |b| u64::from_le_bytes(b) as f64),
            "Float64" => (8, f64::from_le_bytes),
            other => return Err(format!("numbers of the type `{other}`")),
        };
        Ok(raw.chunks_exact(size).map(|chunk| number(self.little(chunk))).collect())
    }

    /// Up to 8 bytes with the lowest first.
    fn little(&self, chunk: &[u8]) -> [u8; 8] {
        let mut bytes = [0; 8];
        bytes[..chunk.len()].copy_from_slice(chunk);
        if self.big_endian {
            bytes[..chunk.len()].reverse();
        }
        bytes
    }

    /// Number `index` of a header.
    fn header(&self, bytes: &[u8], index: usize) -> Result<usize> {
        let chunk = bytes.get(index * self.header..(index + 1) * self.header).ok_or("its header is cut short")?;
        usize::try_from(u64::from_le_bytes(self.little(chunk))).map_err(|_| "its header is not sensible".into())
    }

    fn raw_array(&self, bytes: &[u8]) -> Result<Vec<u8>> {
        const SHORT: &str = "it is cut short";
        if !self.compressed {
            let size = self.header(bytes, 0)?;
            let data = bytes.get(self.header..).and_then(|data| data.get(..size)).ok_or(SHORT)?;
            return Ok(data.to_vec());
        }
        let blocks = self.header(bytes, 0)?;
        let start = blocks.checked_add(3).and_then(|n| n.checked_mul(self.header)).ok_or(SHORT)?;
        self.inflated(bytes, bytes.get(start..).ok_or(SHORT)?)
    }

    /// Header and data in base64: encoded together where they are not compressed, else one after the other.
    fn base64_array(&self, text: &[u8]) -> Result<Vec<u8>> {
        const SHORT: &str = "it is cut short";
        let encoded = |bytes: usize| bytes.div_ceil(3).saturating_mul(4);
        let piece = |from: usize, to: usize| text.get(from..to.min(text.len())).ok_or(SHORT);
        let first = base64(piece(0, encoded(self.header))?)?;
        if !self.compressed {
            let size = self.header(&first, 0)?;
            let all = base64(piece(0, encoded(size.saturating_add(self.header)))?)?;
            return all.get(self.header..).and_then(|data| data.get(..size)).map(<[u8]>::to_vec).ok_or(SHORT.into());
        }
        let blocks = self.header(&first, 0)?;
        let length = encoded(blocks.saturating_add(3).saturating_mul(self.header));
        let header = base64(piece(0, length)?)?;
        let mut size = 0_usize;
        for block in 0..blocks {
            size = size.saturating_add(self.header(&header, 3 + block)?);
        }
        self.inflated(&header, &base64(piece(length, length.saturating_add(encoded(size)))?)?)
    }

    /// The blocks of `data` inflated; their number and sizes stand in `header`.
    fn inflated(&self, header: &[u8], mut data: &[u8]) -> Result<Vec<u8>> {
        let mut all = Vec::new();
        for block in 0..self.header(header, 0)? {
            let size = self.header(header, 3 + block)?;
            let packed = data.get(..size).ok_or("it is cut short")?;
            data = &data[size..];
            ZlibDecoder::new(packed).read_to_end(&mut all).map_err(|error| format!("zlib: {error}"))?;
        }
        Ok(all)
    }
}

/// Bytes from base64 (RFC 4648, section 4).
fn base64(text: &[u8]) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for character in text {
        let value = match character {
            b'A'..=b'Z' => character - b'A',
            b'a'..=b'z' => character - b'a' + 26,
            b'0'..=b'9' => character - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => break,
            white if white.is_ascii_whitespace() => continue,
            _ => return Err("it is not base64".into()),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    Ok(bytes)
}
