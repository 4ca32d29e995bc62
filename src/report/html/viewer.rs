//! The shapes through time, for viewer.js: positions as whole numbers of 16 bits.

use super::camera::Camera;
use super::pictures::picture;
use crate::math::tensor::{Vector, norm, subtract};
use crate::report::playback::{Body, Playback, Shape};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// The script.
pub(super) const SCRIPT: &str = include_str!("viewer.js");
/// Bytes of positions at most: more frames than fit are thinned out.
const MOST_BYTES: usize = 3_000_000;

/// The section: viewer, data, and the pictures that take its place. `None` without shapes.
pub(super) fn section(run: &Playback) -> Option<String> {
    let farthest = run.farthest()?;
    let camera = Camera::new(run);
    let most = farthest.skin.iter().zip(&run.skin.rest).map(|(x, r)| norm(subtract(*x, *r))).fold(0.0, f64::max);
    let points = run.skin.rest.len() + run.muscles.iter().map(|body| body.rest.len()).sum::<usize>();
    let every = run.shapes.len().div_ceil((MOST_BYTES / (6 * points)).max(1)).max(1);
    let mut kept: Vec<&Shape> = run.shapes.iter().step_by(every).collect();
    if !kept.iter().any(|shape| shape.frame == farthest.frame) {
        kept.push(farthest);
        kept.sort_by_key(|shape| shape.frame.index);
    }
    let thinned = match every {
        1 => String::new(),
        _ => format!(" One in {every} of {} shapes is shown, and the one that moved most.", run.shapes.len()),
    };
    let markers = if run.markers.is_empty() {
        ""
    } else {
        " Markers: blue the model, black the measurement, red what is between."
    };
    let at = |shape: &Shape| {
        format!("frame {}, {:.3} s: the skin moves by up to {most:.2} mm here", shape.frame.index, shape.frame.time_s)
    };
    Some(format!(
        "<div id=\"viewer\"><canvas></canvas><div class=\"tools\"><button type=\"button\">play</button>\
         <input type=\"range\" name=\"frame\" min=\"0\" value=\"0\" aria-label=\"frame\"><output></output>\
         <label><input type=\"checkbox\" name=\"skin\" checked> skin</label>\
         <label><input type=\"checkbox\" name=\"glass\" checked> see through</label>\
         <label><input type=\"checkbox\" name=\"muscles\" checked> muscles</label>\
         <label><input type=\"checkbox\" name=\"markers\" checked> markers</label></div>\n\
         <script type=\"application/json\" id=\"viewer-data\">{}</script></div>\
         <div class=\"pictures\">{}{}</div>\n\
         <p class=\"note\">Skin: colour is displacement, up to {most:.2} mm. Muscles: redder is more active.{markers}{thinned} \
         Drag turns, the wheel zooms.</p>",
        // a name could hold the end of the script
        data(run, &kept, &camera, most, farthest).to_string().replace('<', "\\u003c"),
        picture(run, &run.skin.rest, &camera, most, "before anything moves"),
        picture(run, &farthest.skin, &camera, most, &at(farthest))
    ))
}

fn data(run: &Playback, kept: &[&Shape], camera: &Camera, most: f64, farthest: &Shape) -> Value {
    let rest: Vec<&[Vector]> =
        std::iter::once(&run.skin).chain(&run.muscles).map(|body| body.rest.as_slice()).collect();
    let shapes: Vec<Vec<&[Vector]>> = kept
        .iter()
        .map(|shape| std::iter::once(&shape.skin).chain(&shape.muscles).map(Vec::as_slice).collect())
        .collect();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in std::iter::once(&rest).chain(&shapes).flatten().copied().flatten() {
        for d in 0..3 {
            low[d] = low[d].min(point[d]);
            high[d] = high[d].max(point[d]);
        }
    }
    let middle: Vector = std::array::from_fn(|d| 0.5 * (low[d] + high[d]));
    let step = (0..3).map(|d| high[d] - low[d]).fold(1e-9, f64::max) / 65_000.0;
    let body = |index: usize, body: &Body| {
        let all = std::iter::once(&rest).chain(&shapes).flat_map(|shape| shape[index]);
        let numbers = all.flat_map(|x| (0..3).map(|d| ((x[d] - middle[d]) / step).round() as i16));
        let bytes: Vec<u8> = numbers.flat_map(i16::to_le_bytes).collect();
        let indices: Vec<u8> = body.triangles().flatten().flat_map(u32::to_le_bytes).collect();
        let control = run.activation_of(&body.name);
        let activation = |shape: &&Shape| control.map_or(0.0, |control| control.values[run.position(shape.frame)]);
        json!({
            "name": body.name, "indices": STANDARD.encode(indices), "shapes": STANDARD.encode(bytes),
            "activation": kept.iter().map(activation).collect::<Vec<f64>>(),
        })
    };
    let bodies: Vec<Value> =
        std::iter::once(&run.skin).chain(&run.muscles).enumerate().map(|(k, b)| body(k, b)).collect();
    let strongest = run.muscles.iter().filter_map(|body| run.activation_of(&body.name));
    let strongest = strongest.flat_map(|control| control.values.iter().copied()).fold(1e-3, f64::max);
    // to a micrometre
    let short = |x: Vector| x.map(|c| (1e3 * c).round() * 1e-3);
    let pairs = |shape: &&Shape| -> Vec<Value> {
        let row = run.position(shape.frame);
        run.markers.iter().map(|m| json!([short(m.samples[row].model), m.samples[row].measured.map(short)])).collect()
    };
    let markers: Vec<Vec<Value>> = if run.markers.is_empty() { Vec::new() } else { kept.iter().map(pairs).collect() };
    json!({
        "bodies": bodies, "low": middle, "step": step, "most": most, "strongest": strongest, "markers": markers,
        "times": kept.iter().map(|shape| shape.frame.time_s).collect::<Vec<_>>(),
        "frames": kept.iter().map(|shape| shape.frame.index).collect::<Vec<_>>(),
        "first": kept.iter().position(|shape| shape.frame == farthest.frame),
        "up": camera.up, "yaw": camera.yaw, "pitch": camera.pitch, "centre": camera.centre, "size": camera.size,
    })
}
