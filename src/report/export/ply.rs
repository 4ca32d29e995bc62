//! The skin of one frame as PLY (binary, little endian), mm, with the length of its displacement at every point.

use crate::math::tensor::{norm, subtract};
use crate::report::playback::{Playback, Shape};

/// The bytes of the file.
pub fn file(run: &Playback, shape: &Shape) -> Vec<u8> {
    let skin = &run.skin;
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment {}, frame {} at {:?} s; mm\nelement vertex {}\n\
         property double x\nproperty double y\nproperty double z\nproperty float displacement_mm\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        run.scene.name.replace(char::is_control, " "),
        shape.frame.index,
        shape.frame.time_s,
        skin.rest.len(),
        skin.quads.len()
    )
    .into_bytes();
    for (point, rest) in shape.skin.iter().zip(&skin.rest) {
        point.iter().for_each(|c| bytes.extend_from_slice(&c.to_le_bytes()));
        bytes.extend_from_slice(&(norm(subtract(*point, *rest)) as f32).to_le_bytes());
    }
    for quad in &skin.quads {
        bytes.push(4);
        quad.iter().for_each(|point| bytes.extend_from_slice(&(*point as i32).to_le_bytes()));
    }
    bytes
}
