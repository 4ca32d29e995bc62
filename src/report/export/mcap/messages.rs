//! The messages of a frame.

use crate::math::tensor::{Vector, norm, subtract};
use crate::report::playback::{Body, Playback, Shape};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// A time, ns since the epoch of the clock.
#[derive(Clone, Copy)]
pub(super) struct Stamp(pub u64);

impl Stamp {
    fn value(self) -> Value {
        json!({"sec": self.0 / 1_000_000_000, "nsec": self.0 % 1_000_000_000})
    }
}

/// The frame of the model's coordinates.
const FRAME: &str = "head";
/// Numbers of kinds in foxglove.PackedElementField.
const FLOAT32: u8 = 7;
/// foxglove.LinePrimitive: pairs of points.
const LINE_LIST: u8 = 2;
/// Diameter of a marker, m.
const MARKER: f64 = 0.002;

/// mm in m, to a tenth of a micrometre: more digits would be most of the file.
fn metres(c: f64) -> f64 {
    (1e4 * c).round() * 1e-7
}

fn point(p: Vector) -> Value {
    let [x, y, z] = p.map(metres);
    json!({"x": x, "y": y, "z": z})
}

fn colour([r, g, b, a]: [f64; 4]) -> Value {
    json!({"r": r, "g": g, "b": b, "a": a})
}

/// No translation, no rotation.
fn origin() -> Value {
    json!({"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": no_rotation()})
}

fn no_rotation() -> Value {
    json!({"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0})
}

pub(super) fn transform(stamp: Stamp) -> Value {
    json!({
        "timestamp": stamp.value(), "parent_frame_id": "world", "child_frame_id": FRAME,
        "translation": {"x": 0.0, "y": 0.0, "z": 0.0}, "rotation": no_rotation(),
    })
}

/// One entity that takes the place of the one before, with some of its lists filled.
fn scene(stamp: Stamp, id: &str, filled: &[(&str, Vec<Value>)]) -> Value {
    let mut entity = json!({
        "timestamp": stamp.value(), "frame_id": FRAME, "id": id, "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": true,
        "metadata": [], "arrows": [], "cubes": [], "spheres": [], "cylinders": [], "lines": [], "triangles": [], "texts": [],
        "models": [],
    });
    for (list, values) in filled {
        entity[*list] = json!(values);
    }
    json!({"deletions": [], "entities": [entity]})
}

fn triangles(body: &Body, points: &[Vector], shade: [f64; 4]) -> Value {
    json!({
        "pose": origin(),
        "points": points.iter().map(|p| point(*p)).collect::<Vec<_>>(),
        "color": colour(shade),
        "colors": [],
        "indices": body.triangles().flatten().collect::<Vec<u32>>(),
    })
}

pub(super) fn skin(run: &Playback, shape: &Shape, stamp: Stamp) -> Value {
    scene(stamp, "skin", &[("triangles", vec![triangles(&run.skin, &shape.skin, [0.87, 0.67, 0.57, 0.6])])])
}

/// Dark at rest, bright red from an activation of 0.3 on.
pub(super) fn muscles(run: &Playback, shape: &Shape, row: usize, stamp: Stamp) -> Value {
    let all = run.muscles.iter().zip(&shape.muscles).map(|(body, points)| {
        let activation = run.activation_of(&body.name).map_or(0.0, |control| control.values[row]);
        let part = (activation / 0.3).clamp(0.0, 1.0);
        triangles(body, points, [0.35 + 0.65 * part, 0.2, 0.2, 1.0])
    });
    scene(stamp, "muscles", &[("triangles", all.collect())])
}

/// A cloud of points with one more number each.
fn cloud(stamp: Stamp, name: &str, points: impl Iterator<Item = (Vector, f64)>) -> Value {
    let mut bytes = Vec::new();
    for ([x, y, z], value) in points {
        for number in [1e-3 * x, 1e-3 * y, 1e-3 * z, value] {
            bytes.extend_from_slice(&(number as f32).to_le_bytes());
        }
    }
    let field = |name: &str, offset: u32| json!({"name": name, "offset": offset, "type": FLOAT32});
    json!({
        "timestamp": stamp.value(), "frame_id": FRAME, "pose": origin(), "point_stride": 16,
        "fields": [field("x", 0), field("y", 4), field("z", 8), field(name, 12)],
        "data": STANDARD.encode(bytes),
    })
}

pub(super) fn skin_points(run: &Playback, shape: &Shape, stamp: Stamp) -> Value {
    let points = shape.skin.iter().zip(&run.skin.rest).map(|(x, r)| (*x, norm(subtract(*x, *r))));
    cloud(stamp, "displacement_mm", points)
}

/// The measured ones have no point where they were lost.
pub(super) fn marker_points(run: &Playback, row: usize, stamp: Stamp, measured: bool) -> Value {
    let points = run.markers.iter().filter_map(|marker| {
        let sample = &marker.samples[row];
        let at = if measured { sample.measured? } else { sample.model };
        Some((at, sample.distance().unwrap_or(f64::NAN)))
    });
    cloud(stamp, "residual_mm", points)
}

pub(super) fn markers(run: &Playback, row: usize, stamp: Stamp) -> Value {
    let sphere = |at: Vector, shade| {
        json!({
            "pose": {"position": point(at), "orientation": no_rotation()},
            "size": {"x": MARKER, "y": MARKER, "z": MARKER}, "color": colour(shade),
        })
    };
    let (mut spheres, mut ends) = (Vec::new(), Vec::new());
    for marker in &run.markers {
        let sample = &marker.samples[row];
        spheres.push(sphere(sample.model, [0.1, 0.4, 0.9, 1.0]));
        if let Some(measured) = sample.measured {
            spheres.push(sphere(measured, [0.05, 0.05, 0.05, 1.0]));
            ends.extend([point(sample.model), point(measured)]);
        }
    }
    let lines = json!({
        "type": LINE_LIST, "pose": origin(), "thickness": 2.0, "scale_invariant": true, "points": ends,
        "color": colour([0.9, 0.1, 0.1, 1.0]), "colors": [], "indices": [],
    });
    scene(stamp, "markers", &[("spheres", spheres), ("lines", vec![lines])])
}

pub(super) fn activations(run: &Playback, row: usize, stamp: Stamp) -> Value {
    let control = |control: &crate::report::playback::Control| {
        let [lower, upper] = control.intervals[row].map_or([None; 2], |ends| ends.map(Some));
        json!({
            "name": control.name, "value": control.values[row], "lower_95": lower, "upper_95": upper,
            "minimum": control.range[0], "maximum": control.range[1], "unit": control.kind.unit(),
        })
    };
    let controls: Vec<Value> = run.controls.iter().map(control).collect();
    json!({"timestamp": stamp.value(), "frame": run.frames[row].index, "controls": controls})
}

pub(super) fn solver(run: &Playback, row: usize, stamp: Stamp) -> Value {
    let distances: Vec<f64> = run.markers.iter().filter_map(|marker| marker.samples[row].distance()).collect();
    let rms = (!distances.is_empty())
        .then(|| (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt());
    let effort = run.effort.get(row).copied().unwrap_or_default();
    json!({
        "timestamp": stamp.value(), "frame": run.frames[row].index,
        "markers_measured": distances.len(), "markers": run.markers.len(),
        "marker_rms_mm": rms, "marker_max_mm": distances.iter().copied().reduce(f64::max),
        "steps": effort.steps, "newton_iterations": effort.iterations,
        "residual_mn": effort.residual_mn, "required_mn": effort.required_mn,
    })
}
