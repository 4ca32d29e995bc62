//! What a scene asks for over time: the controls of every frame.

use super::Drive;
use crate::error::Result;
use crate::model::Model;
use crate::scene::{ControlValue, Curves, Scene};

/// Time and drive of every frame: one frame where all controls are constant, else one for every time of the curves.
///
/// # Errors
/// A table of curves that cannot be read.
pub fn drives(scene: &Scene, model: &Model) -> Result<Vec<(f64, Drive)>> {
    let ranges = scene.control_ranges();
    // what a table drives: name, controls, table
    let mut curves: Vec<(&str, Vec<usize>, Curves)> = Vec::new();
    let mut controls = vec![0.0; model.controls().len()];
    for control in &scene.controls {
        let own = model.controls_of(&control.name);
        for (k, value) in own.iter().zip(control.value.constants(own.len()).unwrap_or_default()) {
            controls[*k] = value;
        }
        if let ControlValue::Csv(path) = &control.value {
            curves.push((&control.name, own, Curves::read(path, &ranges)?));
        }
    }
    let mut times: Vec<f64> = curves.iter().flat_map(|(.., c)| c.times_s.iter().copied()).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    if times.is_empty() {
        return Ok(vec![(0.0, Drive { controls, load: 1.0 })]);
    }
    let at = |time_s: f64| {
        let mut controls = controls.clone();
        for (name, own, curve) in &curves {
            own.iter().for_each(|k| controls[*k] = curve.at(name, time_s).unwrap_or(0.0));
        }
        (time_s, Drive { controls, load: 1.0 })
    };
    Ok(times.into_iter().map(at).collect())
}
