//! The markers as points: where the model has them, where they were measured, and the difference.

use super::grid::{Field, Grid};
use crate::report::frame::MarkerPair;

/// Every marker of the model as a point, and every one that was measured as a second: `measured` is 0 on the first kind
/// and 1 on the second, `marker` its number. On points of the model `residual_mm` leads to the measurement (zero where it
/// was lost, and on measured points), and `distance_mm` is its length (NaN where it was lost).
pub fn points(markers: &[MarkerPair<'_>], time_s: f64) -> Grid {
    let lost = f64::NAN;
    let model = markers.iter().enumerate().map(|(number, marker)| {
        (marker.model, marker.residual().unwrap_or_default(), marker.distance().unwrap_or(lost), 0, number as i64)
    });
    let measured = markers.iter().enumerate().filter_map(|(number, marker)| {
        Some((marker.measured?, [0.0; 3], marker.distance().unwrap_or(lost), 1, number as i64))
    });
    let all: Vec<_> = model.chain(measured).collect();
    let fields = vec![
        Field::vectors("residual_mm", all.iter().map(|point| point.1).collect()),
        Field::scalars("distance_mm", all.iter().map(|point| point.2).collect()),
        Field::integers("measured", all.iter().map(|point| point.3).collect()),
        Field::integers("marker", all.iter().map(|point| point.4).collect()),
    ];
    Grid::vertices(time_s, all.iter().map(|point| point.0).collect(), fields)
}
