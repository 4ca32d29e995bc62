//! The faces in contact as points: their quadrature points, moved with the host.

use super::grid::{Field, Grid};
use crate::term::contact::ContactPoint;

/// The quadrature points of all slidings and contacts: pressure (kPa per reference area), gap (mm, NaN beyond
/// the edge of a surface), normal of the surface, index of the contact (in the order of the model), host element, reference
/// area (mm2).
pub fn points(contacts: &[Vec<ContactPoint>], time_s: f64) -> Grid {
    let numbered = contacts.iter().enumerate();
    let all: Vec<_> =
        numbered.flat_map(|(number, points)| points.iter().map(move |point| (number as i64, point))).collect();
    let scalars = |f: fn(&ContactPoint) -> f64| all.iter().map(|(_, p)| f(p)).collect();
    let fields = vec![
        Field::scalars("contact_pressure_kpa", scalars(|p| p.pressure)),
        Field::scalars("gap_mm", scalars(|p| p.gap.unwrap_or(f64::NAN))),
        Field::vectors("normal", all.iter().map(|(_, p)| p.normal).collect()),
        Field::integers("contact", all.iter().map(|(number, _)| *number).collect()),
        Field::integers("element", all.iter().map(|(_, p)| p.at.element as i64).collect()),
        Field::scalars("area_mm2", scalars(|p| p.area)),
    ];
    Grid::vertices(time_s, all.iter().map(|(_, p)| p.position).collect(), fields)
}
