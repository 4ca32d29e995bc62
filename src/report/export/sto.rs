//! Activations as a storage file of OpenSim: a head, then columns between tabs, the first of them time in seconds.

use crate::report::playback::Playback;
use crate::scene::ControlKind;

/// The text of the file. Poses of bones are not in it: to OpenSim they are coordinates of another model.
pub fn text(run: &Playback) -> String {
    let columns: Vec<_> = run.controls.iter().filter(|control| control.kind == ControlKind::Activation).collect();
    let mut text = format!(
        "activations\nversion=1\nnRows={}\nnColumns={}\ninDegrees=no\nendheader\ntime",
        run.frames.len(),
        1 + columns.len()
    );
    columns.iter().for_each(|control| text += &format!("\t{}", control.name.replace(char::is_whitespace, "_")));
    text.push('\n');
    for (row, frame) in run.frames.iter().enumerate() {
        text += &format!("{:?}", frame.time_s);
        columns.iter().for_each(|control| text += &format!("\t{:?}", control.values[row]));
        text.push('\n');
    }
    text
}
