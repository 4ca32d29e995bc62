//! The exact shape: every tricubic Hermite element is a Bezier hexahedron of order 3.
//!
//! Values on points are Bezier coefficients, and elements do not share points: 64 each, so that a pressure may jump.

use super::grid::{CellKind, Field, Grid};
use super::sample::samples;
use crate::math::tensor::{Vector, subtract};
use crate::mesh::bezier::control_values;
use crate::mesh::element::{Trilinear, ends};
use crate::model::{Model, State};
use rayon::prelude::*;

/// The control points of one element in the order of VTK, and what else is shown of it.
struct Cell {
    position: [Vector; 64],
    reference: [Vector; 64],
    pressure: [f64; 64],
    /// Range of det F over 3 x 3 x 3 points.
    det_f: [f64; 2],
}

/// The deformed host at a state. On points: displacement and reference position (mm), pressure (kPa), raised from
/// trilinear to order 3. On cells: the element, and the range of det F over 3 x 3 x 3 points.
pub fn shape(model: &Model, state: &State, time_s: f64) -> Grid {
    let order = vtk_order();
    let cells: Vec<Cell> =
        (0..model.mesh().elements()).into_par_iter().map(|element| cell(model, state, element, &order)).collect();
    let gather = |pick: fn(&Cell) -> &[Vector; 64]| cells.iter().flat_map(pick).copied().collect::<Vec<Vector>>();
    let (points, reference) = (gather(|cell| &cell.position), gather(|cell| &cell.reference));
    let displacement = points.iter().zip(&reference).map(|(x, r)| subtract(*x, *r)).collect();
    let range = |end: usize| cells.iter().map(|cell| cell.det_f[end]).collect();
    Grid {
        time_s,
        kind: CellKind::BezierHexahedron,
        connectivity: (0..points.len() as i64).collect(),
        on_points: vec![
            Field::vectors("displacement_mm", displacement),
            Field::vectors("reference_mm", reference),
            Field::scalars("pressure_kpa", cells.iter().flat_map(|cell| cell.pressure).collect()),
        ],
        on_cells: vec![
            Field::integers("element", (0..cells.len() as i64).collect()),
            Field::scalars("det_f_min", range(0)),
            Field::scalars("det_f_max", range(1)),
        ],
        points,
    }
}

fn cell(model: &Model, state: &State, element: usize, order: &[usize; 64]) -> Cell {
    let mesh = model.mesh();
    let controls = |local: &[[f64; 64]; 3]| -> [Vector; 64] {
        let components = local.each_ref().map(|component| control_values(mesh.element, component));
        order.map(|q| std::array::from_fn(|i| components[i][q]))
    };
    let (position, pressure) = model.with_local(state, element, |at| {
        // every pressure space lies within the trilinear functions: its values at the corners say all
        let mut corners = [0.0; 64];
        for (corner, value) in corners.iter_mut().enumerate().take(8) {
            let psi = model.space().values(ends(corner).map(|end| end as f64));
            *value = psi.iter().zip(at.p).map(|(psi, p)| psi * p).sum();
        }
        (controls(at.x), control_values(&Trilinear, &corners))
    });
    let det_f = samples(model, state, element)
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], s| [min.min(s.det_f), max.max(s.det_f)]);
    Cell { position, reference: controls(&mesh.local(element)), pressure: order.map(|q| pressure[q]), det_f }
}

/// For every point of a VTK_BEZIER_HEXAHEDRON of order 3 in turn, its index i + 4 j + 16 k along (xi1, xi2, xi3):
/// corners, edges, faces, body (vtkHigherOrderHexahedron::PointIndexFromIJK).
fn vtk_order() -> [usize; 64] {
    const ROUND: [[usize; 2]; 4] = [[0, 0], [3, 0], [3, 3], [0, 3]];
    const INNER: [usize; 2] = [1, 2];
    const ON_FACE: [[usize; 2]; 4] = [[1, 1], [2, 1], [1, 2], [2, 2]];
    let mut points: Vec<[usize; 3]> = Vec::with_capacity(64);
    for k in [0, 3] {
        points.extend(ROUND.map(|[i, j]| [i, j, k]));
    }
    for k in [0, 3] {
        points.extend(INNER.map(|t| [t, 0, k]));
        points.extend(INNER.map(|t| [3, t, k]));
        points.extend(INNER.map(|t| [t, 3, k]));
        points.extend(INNER.map(|t| [0, t, k]));
    }
    for [i, j] in ROUND {
        points.extend(INNER.map(|t| [i, j, t]));
    }
    for i in [0, 3] {
        points.extend(ON_FACE.map(|[s, t]| [i, s, t]));
    }
    for j in [0, 3] {
        points.extend(ON_FACE.map(|[s, t]| [s, j, t]));
    }
    for k in [0, 3] {
        points.extend(ON_FACE.map(|[s, t]| [s, t, k]));
    }
    for k in INNER {
        points.extend(ON_FACE.map(|[s, t]| [s, t, k]));
    }
    std::array::from_fn(|n| points[n][0] + 4 * points[n][1] + 16 * points[n][2])
}
