//! The page that a run ends with: on the terminal and in `summary.txt`.

mod fit;
mod forward;
mod marker_errors;
mod mesh_errors;
mod outer;
mod outliers;
mod told;

pub use fit::{FitSummary, FittedFrame};
pub use forward::ForwardSummary;
pub use marker_errors::{ErrorsOf, MarkerErrors};
pub use mesh_errors::MeshErrors;
pub use outer::{outer_page, outer_warnings};
pub use outliers::Outliers;
pub use told::ToldSummary;

/// Lines of a table: the first column to the left, the others to the right, two blanks between, two in front. No lines
/// where there are no rows.
fn columns<const N: usize>(header: [&str; N], rows: &[[String; N]]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].as_str()).chain([header[column]]);
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: [usize; N] = std::array::from_fn(width);
    let line = |row: [&str; N]| {
        let cells = row.iter().enumerate().map(|(column, cell)| match column {
            0 => format!("{cell:<0$}", widths[0]),
            _ => format!("{cell:>0$}", widths[column]),
        });
        format!("  {}", cells.collect::<Vec<_>>().join("  ")).trim_end().to_owned() + "\n"
    };
    let rows = rows.iter().map(|row| line(row.each_ref().map(String::as_str)));
    std::iter::once(line(header)).chain(rows).collect()
}

/// A value that may be missing, with `digits` behind the point.
fn optional(value: Option<f64>, digits: usize) -> String {
    value.filter(|value| value.is_finite()).map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
}

/// A count with its noun: `1 frame`, `2 frames`.
fn count(number: usize, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}
