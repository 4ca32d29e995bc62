//! The deformed host and the muscles for Zinc and cmgui: one EX file of version 3 per frame.

use super::run_folder::write_atomically;
use crate::error::Result;
use crate::math::tensor::{Vector, norm, normalised};
use crate::mesh::exf::{Points, write_elements, write_mesh_with, write_points};
use crate::model::{Model, State};
use std::path::Path;

/// Fields of the host.
const FIELDS: [&str; 2] = ["coordinates", "deformed"];

/// What is the same in the files of all states of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Common {
    /// The elements of the host, as text.
    elements: String,
    /// Reference positions of the points of all muscles, mm.
    points: Vec<Vector>,
}

impl Common {
    /// Of a model.
    pub fn new(model: &Model) -> Common {
        let mesh = model.mesh();
        let points = model.muscles().flat_map(|(_, muscle)| muscle.points()).map(|point| mesh.position(point.host));
        Common { elements: write_elements(mesh, &FIELDS), points: points.collect() }
    }
}

/// The text for a state. The region `/` holds the host with the fields `coordinates` (reference) and `deformed`, in mm;
/// elements and nodes are numbered from 1 in the order of the model. The region `/muscles` holds the quadrature points of
/// all muscles as data points: `coordinates`, `deformed`, unit `fibre`, `stretch`, `activation` and `muscle`, its number
/// from 1.
pub fn text(model: &Model, state: &State, common: &Common) -> String {
    let mesh = model.mesh();
    let x = model.current(state);
    let [coordinates, deformed] = FIELDS;
    let fields = [(coordinates, mesh.parameters.as_slice()), (deformed, x.as_slice())];
    write_mesh_with(mesh, &fields, &common.elements) + &points(model, state, &x, common)
}

/// The region of the muscles, whose host has the parameters `x`; nothing without muscles.
fn points(model: &Model, state: &State, x: &[Vector], common: &Common) -> String {
    let mesh = model.mesh();
    let [coordinates, deformed] = FIELDS;
    let (mut position, mut fibre) = (Vec::new(), Vec::new());
    let (mut stretch, mut activation, mut number) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (_, muscle)) in model.muscles().enumerate() {
        for in_element in muscle.points().chunk_by(|a, b| a.host.element == b.host.element) {
            let local = mesh.local_of(in_element[0].host.element, x);
            for point in in_element {
                let v = point.deformed_fibre(&local);
                position.push(mesh.interpolate(point.host, x));
                fibre.push(normalised(v));
                stretch.push(norm(v));
                activation.push(point.activation(&state.controls));
                number.push((index + 1) as f64);
            }
        }
    }
    if position.is_empty() {
        return String::new();
    }
    let fields = [
        Points::Vectors(coordinates, &common.points),
        Points::Vectors(deformed, &position),
        Points::Vectors("fibre", &fibre),
        Points::Scalars("stretch", &stretch),
        Points::Scalars("activation", &activation),
        Points::Scalars("muscle", &number),
    ];
    write_points("/muscles", &fields)
}

/// Writes the file, atomically.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write(path: &Path, model: &Model, state: &State, common: &Common) -> Result<()> {
    write_atomically(path, text(model, state, common).as_bytes())
}
