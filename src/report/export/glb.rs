//! Binary glTF 2.0: skin and muscles at rest, deformation modes as morph targets, an animation that plays the run, and the
//! activations as curves.
//!
//! Lengths are metres, as glTF wants. Points stand in the order of the run's mesh, the same in every export. A program that
//! knows no extras finds each activation as the x translation of an empty node `activation <name>`.

use super::modes::{Modes, modes};
use crate::error::Result;
use crate::math::tensor::{Vector, add_scaled, subtract};
use crate::report::playback::{Body, Playback};
use serde_json::{Value, json};

/// Kinds of numbers in accessors (glTF 2.0, 3.6.2.2).
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
/// Targets of buffer views (5.11.5).
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// mm in metres.
const METRE: f64 = 1e-3;

/// The bytes of the file.
///
/// # Errors
/// [`Error::NoShapes`](crate::Error::NoShapes).
pub fn file(run: &Playback) -> Result<Vec<u8>> {
    run.shown()?;
    let modes = modes(run);
    let mut out = Document::default();
    let bodies: Vec<&Body> = std::iter::once(&run.skin).chain(&run.muscles).collect();
    for (index, body) in bodies.iter().enumerate() {
        let mesh = out.mesh(body, index, &modes);
        out.meshes.push(mesh);
    }
    let names: Vec<&str> = modes.targets.iter().map(|target| target.name.as_str()).collect();
    // scene nodes: the root, the bodies, then an empty one per activation
    let mut nodes = vec![
        json!({"name": run.scene.name, "children": (1..=bodies.len() + run.controls.len()).collect::<Vec<_>>()}),
    ];
    nodes.extend(bodies.iter().enumerate().map(|(mesh, body)| json!({"name": body.name, "mesh": mesh})));
    nodes.extend(run.controls.iter().map(|control| {
        json!({"name": format!("activation {}", control.name), "extras": {"unit": control.kind.unit(), "range": control.range}})
    }));

    // an animation needs times that increase and are not negative
    let mut kept: Vec<usize> = Vec::new();
    for (number, shape) in run.shapes.iter().enumerate() {
        let last = kept.last().map(|last: &usize| run.shapes[*last].frame.time_s as f32);
        if shape.frame.time_s >= 0.0 && last.is_none_or(|last| shape.frame.time_s as f32 > last) {
            kept.push(number);
        }
    }
    let mut animations = Vec::new();
    if !kept.is_empty() {
        let times =
            out.scalars(&kept.iter().map(|number| run.shapes[*number].frame.time_s as f32).collect::<Vec<_>>(), true);
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        if !names.is_empty() {
            let weights: Vec<f32> =
                kept.iter().flat_map(|number| &modes.weights[*number]).map(|w| *w as f32).collect();
            samplers.push(json!({"input": times, "output": out.scalars(&weights, false), "interpolation": "LINEAR"}));
            channels.extend(
                (1..=bodies.len()).map(|node| json!({"sampler": 0, "target": {"node": node, "path": "weights"}})),
            );
        }
        for (number, control) in run.controls.iter().enumerate() {
            let value = |shape: &usize| control.values[run.position(run.shapes[*shape].frame)] as f32;
            let curve: Vec<[f32; 3]> = kept.iter().map(|shape| [value(shape), 0.0, 0.0]).collect();
            let node = 1 + bodies.len() + number;
            channels.push(json!({"sampler": samplers.len(), "target": {"node": node, "path": "translation"}}));
            samplers
                .push(json!({"input": times, "output": out.vectors(&curve, None, false), "interpolation": "LINEAR"}));
        }
        animations.push(json!({"name": "run", "samplers": samplers, "channels": channels}));
    }

    let activations: serde_json::Map<String, Value> =
        run.controls.iter().map(|control| (control.name.clone(), json!(control.values))).collect();
    let mut document = json!({
        "asset": {"version": "2.0", "generator": concat!("risorius ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"name": run.scene.name, "nodes": [0]}],
        "nodes": nodes,
        "meshes": out.meshes,
        "materials": [
            {"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": [0.87, 0.67, 0.57, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8},
             "doubleSided": true},
            {"name": "muscle", "pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.16, 0.13, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.6}},
        ],
        "accessors": out.accessors,
        "bufferViews": out.views,
        "buffers": [{"byteLength": out.binary.len()}],
        "extras": {
            "time_s": run.frames.iter().map(|frame| frame.time_s).collect::<Vec<_>>(),
            "activations": activations,
            "modes": names,
            "largest_error_of_modes_mm": modes.largest_error_mm,
        },
    });
    if !animations.is_empty() {
        document["animations"] = json!(animations);
    }
    Ok(container(document.to_string().into_bytes(), out.binary))
}

/// The parts of a document that grow.
#[derive(Default)]
struct Document {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
}

impl Document {
    /// A body with all targets of the modes.
    fn mesh(&mut self, body: &Body, index: usize, modes: &Modes) -> Value {
        let metres =
            |points: &[Vector]| -> Vec<[f32; 3]> { points.iter().map(|p| p.map(|c| (METRE * c) as f32)).collect() };
        let single = |points: &[Vector]| -> Vec<[f32; 3]> { points.iter().map(|p| p.map(|c| c as f32)).collect() };
        let normals = body.normals(&body.rest);
        let corners: Vec<u32> = body.triangles().flatten().collect();
        let mut primitive = json!({
            "attributes": {
                "POSITION": self.vectors(&metres(&body.rest), Some(ARRAY_BUFFER), true),
                "NORMAL": self.vectors(&single(&normals), Some(ARRAY_BUFFER), false),
            },
            "indices": self.indices(&corners),
            "material": usize::from(index > 0),
        });
        let mut targets = Vec::new();
        for target in &modes.targets {
            let shift = &target.bodies[index];
            let moved: Vec<Vector> = body.rest.iter().zip(shift).map(|(r, d)| add_scaled(*r, 1.0, *d)).collect();
            let turned: Vec<Vector> =
                body.normals(&moved).iter().zip(&normals).map(|(now, n)| subtract(*now, *n)).collect();
            targets.push(json!({
                "POSITION": self.vectors(&metres(shift), Some(ARRAY_BUFFER), true),
                "NORMAL": self.vectors(&single(&turned), Some(ARRAY_BUFFER), false),
            }));
        }
        let mut mesh = json!({"name": body.name});
        if !targets.is_empty() {
            primitive["targets"] = json!(targets);
            mesh["weights"] = json!(vec![0.0; targets.len()]);
            // the place where programs look for the names of targets
            mesh["extras"] = json!({"targetNames": modes.targets.iter().map(|t| &t.name).collect::<Vec<_>>()});
        }
        mesh["primitives"] = json!([primitive]);
        mesh
    }

    fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        self.accessor(
            json!({"bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(), "type": "SCALAR"}),
        )
    }

    fn vectors(&mut self, vectors: &[[f32; 3]], target: Option<u32>, with_ends: bool) -> usize {
        let bytes: Vec<u8> = vectors.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        let mut accessor =
            json!({"bufferView": view, "componentType": FLOAT, "count": vectors.len(), "type": "VEC3"});
        if with_ends {
            let end = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..3).map(|d| vectors.iter().map(|v| v[d]).reduce(pick).unwrap_or(0.0)).collect()
            };
            accessor["min"] = json!(end(f32::min));
            accessor["max"] = json!(end(f32::max));
        }
        self.accessor(accessor)
    }

    fn scalars(&mut self, scalars: &[f32], with_ends: bool) -> usize {
        let bytes: Vec<u8> = scalars.iter().flat_map(|c| c.to_le_bytes()).collect();
        let view = self.view(&bytes, None);
        let mut accessor =
            json!({"bufferView": view, "componentType": FLOAT, "count": scalars.len(), "type": "SCALAR"});
        if with_ends {
            accessor["min"] = json!([scalars.iter().copied().fold(f32::INFINITY, f32::min)]);
            accessor["max"] = json!([scalars.iter().copied().fold(f32::NEG_INFINITY, f32::max)]);
        }
        self.accessor(accessor)
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        // all numbers have four bytes: what follows stays aligned
        self.binary.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

/// The container (glTF 2.0, chapter 4): head, JSON padded with blanks, binary padded with zeros.
fn container(mut json: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let mut bytes = b"glTF".to_vec();
    for number in [2, length as u32, json.len() as u32] {
        bytes.extend_from_slice(&number.to_le_bytes());
    }
    bytes.extend_from_slice(b"JSON");
    bytes.append(&mut json);
    bytes.extend_from_slice(&(binary.len() as u32).to_le_bytes());
    bytes.extend_from_slice(b"BIN\0");
    bytes.append(&mut binary);
    bytes
}
