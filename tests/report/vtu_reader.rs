//! Reads VTU files with appended zlib blocks back, independently of the code that writes them.

use flate2::read::ZlibDecoder;
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

/// A file taken apart.
pub struct Vtu {
    pub head: String,
    arrays: HashMap<String, Array>,
    pub points: usize,
    pub cells: usize,
}

struct Array {
    components: usize,
    raw: Vec<u8>,
}

impl Vtu {
    pub fn read(path: &Path) -> Vtu {
        let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let mark = b"<AppendedData encoding=\"raw\">\n_";
        let start = bytes.windows(mark.len()).position(|w| w == mark).expect("appended data") + mark.len();
        let tail = b"\n</AppendedData>\n</VTKFile>\n";
        assert!(bytes.ends_with(tail));
        let data = &bytes[start..bytes.len() - tail.len()];
        let head = String::from_utf8(bytes[..start].to_vec()).expect("a head of text");
        let mut arrays = HashMap::new();
        let mut expected = 0;
        let mut entries: Vec<_> = head
            .split("<DataArray ")
            .skip(1)
            .filter(|entry| entry.contains("format=\"appended\""))
            .map(|entry| (attribute(entry, "offset").parse::<usize>().expect("an offset"), entry))
            .collect();
        entries.sort_by_key(|(offset, _)| *offset);
        for (offset, entry) in entries {
            // arrays stand one behind the other, without gaps
            assert_eq!(offset, expected, "{entry}");
            let (raw, length) = decode(&data[offset..]);
            expected += length;
            let components = attribute(entry, "NumberOfComponents").parse().expect("components");
            let name = attribute(entry, "Name").to_owned();
            assert!(arrays.insert(name, Array { components, raw }).is_none(), "twice: {entry}");
        }
        assert_eq!(expected, data.len(), "bytes behind the last array");
        let count = |name| attribute(&head, name).parse().expect("a count");
        let vtu = Vtu { points: count("NumberOfPoints"), cells: count("NumberOfCells"), arrays, head };
        vtu.assert_consistent();
        vtu
    }

    fn assert_consistent(&self) {
        let offsets = self.integers("offsets");
        let connectivity = self.integers("connectivity");
        assert_eq!(self.vectors("Points").len(), self.points);
        assert_eq!(self.types().len(), self.cells);
        assert_eq!(offsets.len(), self.cells);
        assert!(offsets.is_sorted());
        assert_eq!(offsets.last().map_or(0, |end| *end as usize), connectivity.len());
        assert!(connectivity.iter().all(|point| (0..self.points as i64).contains(point)));
    }

    /// The points of a cell.
    pub fn cell(&self, cell: usize) -> Vec<usize> {
        let offsets = self.integers("offsets");
        let start = if cell == 0 { 0 } else { offsets[cell - 1] as usize };
        self.integers("connectivity")[start..offsets[cell] as usize].iter().map(|point| *point as usize).collect()
    }

    pub fn types(&self) -> Vec<u8> {
        self.array("types", 1).clone()
    }

    pub fn scalars(&self, name: &str) -> Vec<f64> {
        self.array(name, 1).chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("8 bytes"))).collect()
    }

    pub fn vectors(&self, name: &str) -> Vec<[f64; 3]> {
        let number = |b: &[u8]| f64::from_le_bytes(b.try_into().expect("8 bytes"));
        self.array(name, 3).chunks_exact(24).map(|b| [0, 8, 16].map(|at| number(&b[at..at + 8]))).collect()
    }

    pub fn integers(&self, name: &str) -> Vec<i64> {
        self.array(name, 1).chunks_exact(8).map(|b| i64::from_le_bytes(b.try_into().expect("8 bytes"))).collect()
    }

    fn array(&self, name: &str, components: usize) -> &Vec<u8> {
        let array = self.arrays.get(name).unwrap_or_else(|| panic!("no array {name}"));
        assert_eq!(array.components, components, "{name}");
        &array.raw
    }
}

/// The value of an attribute in a piece of XML.
pub fn attribute<'a>(text: &'a str, name: &str) -> &'a str {
    let start = text.find(&format!("{name}=\"")).unwrap_or_else(|| panic!("no {name} in {text}")) + name.len() + 2;
    &text[start..start + text[start..].find('"').expect("a closing quote")]
}

/// One array: its bytes, and how many bytes it took in the file.
fn decode(data: &[u8]) -> (Vec<u8>, usize) {
    let number = |k: usize| u64::from_le_bytes(data[8 * k..8 * k + 8].try_into().expect("8 bytes")) as usize;
    let (blocks, size, last) = (number(0), number(1), number(2));
    let mut at = 8 * (3 + blocks);
    let mut raw = Vec::new();
    for block in 0..blocks {
        let length = number(3 + block);
        let before = raw.len();
        ZlibDecoder::new(&data[at..at + length]).read_to_end(&mut raw).expect("a zlib stream");
        at += length;
        let full = if block + 1 == blocks && last > 0 { last } else { size };
        assert_eq!(raw.len() - before, full, "block {block} of {blocks}");
    }
    (raw, at)
}
