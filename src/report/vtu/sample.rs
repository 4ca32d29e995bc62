//! The fields of a state at points of an element.

use crate::math::tensor::{Vector, determinant};
use crate::mesh::position_and_jacobian;
use crate::model::{Model, State};

/// Intervals along each edge of an element into which the linear shape is cut.
pub(super) const CUTS: usize = 2;
/// Points along each edge.
pub(super) const ALONG: usize = CUTS + 1;

/// Fields at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Reference position, mm.
    pub reference: Vector,
    /// Current position, mm.
    pub position: Vector,
    /// Pressure, kPa.
    pub pressure: f64,
    /// det F = det(dx/dxi) / det(dX/dxi).
    pub det_f: f64,
}

/// The fields at a regular grid of [`ALONG`]^3 points of an element, xi1 fastest.
pub(super) fn samples(model: &Model, state: &State, element: usize) -> Vec<Sample> {
    let mesh = model.mesh();
    let reference = mesh.local(element);
    model.with_local(state, element, |at| {
        let sample = |index: usize| {
            let xi = [index % ALONG, index / ALONG % ALONG, index / (ALONG * ALONG)].map(|k| k as f64 / CUTS as f64);
            let (x, dx) = position_and_jacobian(mesh.element, at.x, xi);
            let (big_x, d_big_x) = position_and_jacobian(mesh.element, &reference, xi);
            let pressure = model.space().values(xi).iter().zip(at.p).map(|(psi, p)| psi * p).sum();
            let det_f = determinant(&dx) / determinant(&d_big_x);
            Sample { reference: big_x, position: x, pressure, det_f }
        };
        (0..ALONG.pow(3)).map(sample).collect()
    })
}
