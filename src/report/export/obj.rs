//! Skin and muscles of one frame as Wavefront OBJ, mm: an object each, quadrilaterals.

use crate::report::playback::{Playback, Shape};
use std::fmt::Write as _;

/// The text of the file.
pub fn text(run: &Playback, shape: &Shape) -> String {
    let mut text = format!("# {}, frame {} at {:?} s; mm\n", run.scene.name, shape.frame.index, shape.frame.time_s);
    let mut first = 1;
    let muscles = run.muscles.iter().zip(&shape.muscles);
    for (body, points) in std::iter::once((&run.skin, &shape.skin)).chain(muscles) {
        text += &format!("o {}\n", body.name.replace(char::is_whitespace, "_"));
        // writing to a string cannot fail
        for [x, y, z] in points {
            let _ = writeln!(text, "v {x:?} {y:?} {z:?}");
        }
        for quad in &body.quads {
            let [a, b, c, d] = quad.map(|point| point + first);
            let _ = writeln!(text, "f {a} {b} {c} {d}");
        }
        first += points.len() as u32;
    }
    text
}
