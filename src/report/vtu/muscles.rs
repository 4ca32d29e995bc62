//! The muscles as points: their quadrature points, moved with the host.

use super::grid::{Field, Grid};
use crate::math::tensor::{norm, normalised};
use crate::model::{Model, State};

/// All quadrature points of all muscles at a state: fibre stretch, unit fibre direction, tension (force per reference cross-section
/// of the fibres, kPa = mN/mm2), activation, index of the muscle (in the order of the model), host element, reference volume (mm3).
pub fn points(model: &Model, state: &State, time_s: f64) -> Grid {
    let mesh = model.mesh();
    let x = model.current(state);
    let (mut position, mut stretch, mut fibre, mut tension) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut activation, mut index, mut element, mut volume) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (number, (_, muscle)) in model.muscles().enumerate() {
        for in_element in muscle.points().chunk_by(|a, b| a.host.element == b.host.element) {
            let local = mesh.local_of(in_element[0].host.element, &x);
            for point in in_element {
                let v = point.deformed_fibre(&local);
                position.push(mesh.interpolate(point.host, &x));
                let active = point.activation(&state.controls);
                stretch.push(norm(v));
                fibre.push(normalised(v));
                tension.push(muscle.law().tension(norm(v), active).force);
                activation.push(active);
                index.push(number as i64);
                element.push(point.host.element as i64);
                volume.push(point.weight);
            }
        }
    }
    let fields = vec![
        Field::scalars("stretch", stretch),
        Field::vectors("fibre", fibre),
        Field::scalars("tension_kpa", tension),
        Field::scalars("activation", activation),
        Field::integers("muscle", index),
        Field::integers("element", element),
        Field::scalars("volume_mm3", volume),
    ];
    Grid::vertices(time_s, position, fields)
}
