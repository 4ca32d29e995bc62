//! The file format: an XML head that says where each array stands, then the arrays as zlib blocks.
//!
//! An array is preceded by UInt64 numbers: how many blocks, the bytes of a full block, the bytes of the last block if it
//! is not full (else 0), and the compressed bytes of each (VTK file formats, "XML file formats", appended data).

use super::grid::{CellKind, Field, Grid, Values};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{Result, Write};

/// Bytes of a block before compression.
const BLOCK: usize = 1 << 18;

/// Arrays by their names as they were in the file before, raw and compressed: in a series most of connectivity, reference and
/// numbers of elements stay as they are, and need not be compressed again.
#[derive(Debug, Clone, Default)]
pub struct Before(BTreeMap<String, (Vec<u8>, Vec<u8>)>);

impl Before {
    /// Appends the compressed bytes of an array.
    fn append(&mut self, appended: &mut Vec<u8>, name: &str, raw: Vec<u8>) -> Result<()> {
        if let Some((_, packed)) = self.0.get(name).filter(|(known, _)| *known == raw) {
            appended.extend_from_slice(packed);
            return Ok(());
        }
        let packed = packed(&raw)?;
        appended.extend_from_slice(&packed);
        self.0.insert(name.to_owned(), (raw, packed));
        Ok(())
    }
}

/// The bytes of a VTU file. Version 2.2: below 2.1 VTK permutes the edge nodes of higher-order hexahedra.
///
/// # Errors
/// Those of the compressor.
pub fn file(grid: &Grid, before: &mut Before) -> Result<Vec<u8>> {
    let mut appended = Appended { bytes: Vec::new(), before };
    let on_points = fields(&mut appended, &grid.on_points)?;
    let mut on_cells = fields(&mut appended, &grid.on_cells)?;
    let mut degrees = "";
    if grid.kind == CellKind::BezierHexahedron {
        degrees = " HigherOrderDegrees=\"HigherOrderDegrees\"";
        let degree = floats(std::iter::repeat_n(3.0, 3 * grid.cells()));
        on_cells += &array(&mut appended, "HigherOrderDegrees", "Float64", 3, degree)?;
    }
    let points = array(&mut appended, "Points", "Float64", 3, floats(grid.points.iter().flatten().copied()))?;
    let per_cell = grid.kind.points() as i64;
    let ends = (1..=grid.cells() as i64).map(|cell| cell * per_cell);
    let mut cells = array(&mut appended, "connectivity", "Int64", 1, integers(grid.connectivity.iter().copied()))?;
    cells += &array(&mut appended, "offsets", "Int64", 1, integers(ends))?;
    cells += &array(&mut appended, "types", "UInt8", 1, vec![grid.kind.number(); grid.cells()])?;

    let head = format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"2.2\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
         compressor=\"vtkZLibDataCompressor\">\n\
         <UnstructuredGrid>\n\
         <FieldData>\n\
         <DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{:?}</DataArray>\n\
         </FieldData>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n\
         <PointData>\n{on_points}</PointData>\n\
         <CellData{degrees}>\n{on_cells}</CellData>\n\
         <Points>\n{points}</Points>\n\
         <Cells>\n{cells}</Cells>\n\
         </Piece>\n\
         </UnstructuredGrid>\n\
         <AppendedData encoding=\"raw\">\n_",
        grid.time_s,
        grid.points.len(),
        grid.cells()
    );
    let mut bytes = head.into_bytes();
    bytes.append(&mut appended.bytes);
    bytes.extend_from_slice(b"\n</AppendedData>\n</VTKFile>\n");
    Ok(bytes)
}

/// Text between the quotes of an attribute.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// What stands behind the head.
struct Appended<'b> {
    bytes: Vec<u8>,
    before: &'b mut Before,
}

fn fields(appended: &mut Appended<'_>, fields: &[Field]) -> Result<String> {
    let entry = |field: &Field| match &field.values {
        Values::Scalars(values) => array(appended, field.name, "Float64", 1, floats(values.iter().copied())),
        Values::Vectors(values) => {
            array(appended, field.name, "Float64", 3, floats(values.iter().flatten().copied()))
        }
        Values::Integers(values) => array(appended, field.name, "Int64", 1, integers(values.iter().copied())),
    };
    fields.iter().map(entry).collect()
}

/// Appends an array; returns its entry in the head.
fn array(appended: &mut Appended<'_>, name: &str, kind: &str, components: usize, raw: Vec<u8>) -> Result<String> {
    let offset = appended.bytes.len();
    appended.before.append(&mut appended.bytes, name, raw)?;
    let name = escape(name);
    Ok(format!(
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" \
         offset=\"{offset}\"/>\n"
    ))
}

/// The numbers about the blocks, and the blocks.
fn packed(raw: &[u8]) -> Result<Vec<u8>> {
    let mut packed = Vec::new();
    let blocks = raw.par_chunks(BLOCK).map(deflated).collect::<Result<Vec<_>>>()?;
    for number in [blocks.len(), BLOCK, raw.len() % BLOCK].into_iter().chain(blocks.iter().map(Vec::len)) {
        packed.extend_from_slice(&(number as u64).to_le_bytes());
    }
    blocks.iter().for_each(|block| packed.extend_from_slice(block));
    Ok(packed)
}

fn deflated(raw: &[u8]) -> Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(raw)?;
    encoder.finish()
}

fn floats(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(f64::to_le_bytes).collect()
}

fn integers(values: impl IntoIterator<Item = i64>) -> Vec<u8> {
    values.into_iter().flat_map(i64::to_le_bytes).collect()
}
