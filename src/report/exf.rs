//! The deformed host and the muscles for Zinc and cmgui: one EX file of version 3 per frame.

use super::run_folder::write_atomically;
use crate::error::Result;
use crate::math::tensor::{norm, normalised};
use crate::mesh::exf::{Points, write_mesh, write_points};
use crate::model::{Model, State};
use std::path::Path;

/// The text for a state. The region `/` holds the host with the fields `coordinates` (reference) and `deformed`, in mm;
/// elements and nodes are numbered from 1 in the order of the model. The region `/muscles` holds the quadrature points of
/// all muscles as data points: `coordinates`, `deformed`, unit `fibre`, `stretch`, `activation` and `muscle`, its number
/// from 1.
pub fn text(model: &Model, state: &State) -> String {
    let mesh = model.mesh();
    let x = model.current(state);
    let mut text = write_mesh(mesh, &[("coordinates", &mesh.parameters), ("deformed", &x)]);
    let (mut reference, mut position, mut fibre) = (Vec::new(), Vec::new(), Vec::new());
    let (mut stretch, mut activation, mut number) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (_, muscle)) in model.muscles().enumerate() {
        for in_element in muscle.points().chunk_by(|a, b| a.host.element == b.host.element) {
            let local = mesh.local_of(in_element[0].host.element, &x);
            for point in in_element {
                let v = point.deformed_fibre(&local);
                reference.push(mesh.position(point.host));
                position.push(mesh.interpolate(point.host, &x));
                fibre.push(normalised(v));
                stretch.push(norm(v));
                activation.push(point.activation(&state.controls));
                number.push((index + 1) as f64);
            }
        }
    }
    if !reference.is_empty() {
        let fields = [
            Points::Vectors("coordinates", &reference),
            Points::Vectors("deformed", &position),
            Points::Vectors("fibre", &fibre),
            Points::Scalars("stretch", &stretch),
            Points::Scalars("activation", &activation),
            Points::Scalars("muscle", &number),
        ];
        text += &write_points("/muscles", &fields);
    }
    text
}

/// Writes the file, atomically.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write(path: &Path, model: &Model, state: &State) -> Result<()> {
    write_atomically(path, text(model, state).as_bytes())
}
