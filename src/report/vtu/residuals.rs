//! The residuals of markers as lines from the model to the measurement: to be seen without a filter, or as arrows by a glyph.

use super::grid::{CellKind, Field, Grid};
use crate::report::frame::MarkerPair;

/// A line for every marker that was measured; on lines: its vector and length, mm, and the number of the marker.
pub fn lines(markers: &[MarkerPair<'_>], time_s: f64) -> Grid {
    let measured: Vec<_> = markers
        .iter()
        .enumerate()
        .filter_map(|(number, marker)| Some((number as i64, marker, marker.measured?, marker.residual()?)))
        .collect();
    Grid {
        time_s,
        kind: CellKind::Line,
        points: measured.iter().flat_map(|(_, marker, place, _)| [marker.model, *place]).collect(),
        connectivity: (0..2 * measured.len() as i64).collect(),
        on_points: Vec::new(),
        on_cells: vec![
            Field::vectors("residual_mm", measured.iter().map(|(.., residual)| *residual).collect()),
            Field::scalars("distance_mm", measured.iter().filter_map(|(_, marker, ..)| marker.distance()).collect()),
            Field::integers("marker", measured.iter().map(|(number, ..)| *number).collect()),
        ],
    }
}
