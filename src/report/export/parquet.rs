//! Every table of a run as Parquet (<https://parquet.apache.org/docs/file-format>): the columns of the CSV file under their
//! names and in their order, with types.
//!
//! | cells of a column | type |
//! |---|---|
//! | whole numbers without a point, as counts are written | INT64 |
//! | numbers, or no cell with anything in it | DOUBLE |
//! | anything else, and names whatever they look like | BYTE_ARRAY, UTF-8 |
//!
//! An empty cell is a null. All rows are one group, compressed by zstd.

use super::Exported;
use crate::error::{Error, Result};
use crate::report::playback::{Sheet, sheets, status};
use crate::report::run_folder::failed;
use parquet::basic::{Compression, LogicalType, Type as Physical, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::Result as Written;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};
use std::path::Path;
use std::sync::Arc;

/// Columns of names that users give, or that may be empty: a marker called 7 is no number, and a table must not change its
/// types from run to run.
const NAMES: [&str; 9] = ["name", "control", "marker", "a", "b", "variant", "from", "to", "code"];
/// The table whose columns bear the names of controls, so that `a` may be a muscle.
const OF_CONTROLS: &str = "activations";

/// Writes `tables/<name>.parquet` for every `tables/<name>.csv` of a run of any task.
///
/// # Errors
/// [`Error::NotARun`], [`Error::DamagedRun`], [`Error::Io`].
pub fn write(run: &Path, folder: &Path, done: &mut Exported) -> Result<()> {
    status(run)?;
    let folder = folder.join("tables");
    std::fs::create_dir_all(&folder).map_err(failed("create", &folder))?;
    for (name, sheet) in sheets(run)? {
        let path = folder.join(format!("{name}.parquet"));
        let bytes = file(&name, &sheet).map_err(|error| {
            let source = std::io::Error::other(error);
            Error::Io { action: "write", path: path.clone(), source }
        })?;
        done.write(path, bytes)?;
    }
    Ok(())
}

/// The bytes of the file of a table.
fn file(name: &str, sheet: &Sheet) -> Written<Vec<u8>> {
    let columns: Vec<Column<'_>> = (0..sheet.columns().len()).map(|column| Column::of(name, sheet, column)).collect();
    let fields = sheet.columns().iter().zip(&columns).map(|(name, column)| column.field(name));
    let schema = Type::group_type_builder(name).with_fields(fields.collect::<Written<_>>()?).build()?;
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::default())).build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    for column in columns {
        if let Some(mut writer) = group.next_column()? {
            column.write(&mut writer)?;
            writer.close()?;
        }
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

/// The cells of a column; `None` is an empty one.
enum Column<'a> {
    Counts(Vec<Option<i64>>),
    Numbers(Vec<Option<f64>>),
    Words(Vec<Option<&'a str>>),
}

impl<'a> Column<'a> {
    fn of(table: &str, sheet: &'a Sheet, column: usize) -> Column<'a> {
        let cell = |row| Some(sheet.text(row, column)).filter(|text| !text.is_empty());
        let cells: Vec<Option<&str>> = (0..sheet.len()).map(cell).collect();
        if table != OF_CONTROLS && NAMES.contains(&sheet.columns()[column].as_str()) {
            return Column::Words(cells);
        }
        // 007 is not how a count is written
        let count = |text: &str| text.parse().ok().filter(|count: &i64| count.to_string() == text);
        match (every(&cells, count), every(&cells, |text| text.parse().ok())) {
            (Some(counts), _) if cells.iter().any(Option::is_some) => Column::Counts(counts),
            (_, Some(numbers)) => Column::Numbers(numbers),
            _ => Column::Words(cells),
        }
    }

    fn field(&self, name: &str) -> Written<TypePtr> {
        let (physical, logical) = match self {
            Column::Counts(_) => (Physical::INT64, None),
            Column::Numbers(_) => (Physical::DOUBLE, None),
            Column::Words(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        // an optional value, which the builder takes for the default
        Type::primitive_type_builder(name, physical).with_logical_type(logical).build().map(Arc::new)
    }

    fn write(self, writer: &mut SerializedColumnWriter<'_>) -> Written<()> {
        match self {
            Column::Counts(cells) => put::<Int64Type>(writer, cells),
            Column::Numbers(cells) => put::<DoubleType>(writer, cells),
            Column::Words(cells) => {
                put::<ByteArrayType>(writer, cells.into_iter().map(|cell| cell.map(ByteArray::from)).collect())
            }
        }
    }
}

/// All cells read in one way; `None` where one of them cannot be.
fn every<T>(cells: &[Option<&str>], read: impl Fn(&str) -> Option<T>) -> Option<Vec<Option<T>>> {
    cells.iter().map(|cell| cell.map_or(Some(None), |text| read(text).map(Some))).collect()
}

/// Writes cells: a level for each, 1 where it has a value, and the values.
fn put<D: DataType>(writer: &mut SerializedColumnWriter<'_>, cells: Vec<Option<D::T>>) -> Written<()> {
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<D::T> = cells.into_iter().flatten().collect();
    writer.typed::<D>().write_batch(&values, Some(&levels), None).map(drop)
}
