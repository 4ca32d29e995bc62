//! The faces in contact as points: their quadrature points, moved with the host.

use super::grid::{Field, Grid};
use crate::model::{Model, State};
use crate::term::contact::ContactPoint;

/// All quadrature points of all slidings and contacts at a state: pressure (kPa per reference area), gap (mm, NaN beyond
/// the edge of a surface), normal of the surface, index of the contact (in the order of the model), host element, reference
/// area (mm2).
pub fn points(model: &Model, state: &State, time_s: f64) -> Grid {
    let all: Vec<_> = model
        .contacts()
        .enumerate()
        .flat_map(|(number, (term, _))| {
            model.contact_points(state, term).into_iter().map(move |point| (number as i64, point))
        })
        .collect();
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
