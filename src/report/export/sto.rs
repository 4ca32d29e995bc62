//! Activations for OpenSim.

use crate::report::Frame;
use crate::report::playback::Activity;
use crate::report::tables::storage;
use crate::scene::ControlKind;

/// The text of the file. Poses of bones are not in it: to OpenSim they are coordinates of another model.
pub fn text(run: &Activity) -> String {
    let columns: Vec<_> = run.controls.iter().filter(|control| control.kind == ControlKind::Activation).collect();
    let rows = run.frames.iter().enumerate();
    let row =
        |(row, frame): (usize, &Frame)| (frame.time_s, columns.iter().map(|control| control.values[row]).collect());
    storage(columns.iter().map(|control| control.name.as_str()), rows.map(row))
}
