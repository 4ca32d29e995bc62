//! The shape for measuring: every element resampled as 2 x 2 x 2 hexahedra with straight edges, on which the filters of
//! ParaView (probe, slice, contour) are exact, as they are not on Bezier cells.

use super::grid::{CellKind, Field, Grid};
use super::sample::{ALONG, CUTS, Sample, samples};
use crate::math::tensor::subtract;
use crate::model::{Model, State};
use rayon::prelude::*;

/// The deformed host at a state, with values at 3 x 3 x 3 points per element; elements do not share points. On points:
/// displacement and reference position (mm), pressure (kPa), det F. On cells: the element.
pub fn shape(model: &Model, state: &State, time_s: f64) -> Grid {
    let elements = model.mesh().elements();
    let all: Vec<Sample> =
        (0..elements).into_par_iter().flat_map_iter(|element| samples(model, state, element)).collect();
    let point = |element: usize, [i, j, k]: [usize; 3]| (element * ALONG.pow(3) + i + ALONG * (j + ALONG * k)) as i64;
    let mut connectivity = Vec::new();
    for element in 0..elements {
        for cell in 0..CUTS.pow(3) {
            let first = [cell % CUTS, cell / CUTS % CUTS, cell / (CUTS * CUTS)];
            connectivity.extend(HEXAHEDRON.map(|e| point(element, std::array::from_fn(|d| first[d] + e[d]))));
        }
    }
    let cell_elements = (0..elements as i64).flat_map(|element| std::iter::repeat_n(element, CUTS.pow(3)));
    Grid {
        time_s,
        kind: CellKind::Hexahedron,
        points: all.iter().map(|sample| sample.position).collect(),
        connectivity,
        on_points: vec![
            Field::vectors("displacement_mm", all.iter().map(|s| subtract(s.position, s.reference)).collect()),
            Field::vectors("reference_mm", all.iter().map(|s| s.reference).collect()),
            Field::scalars("pressure_kpa", all.iter().map(|s| s.pressure).collect()),
            Field::scalars("det_f", all.iter().map(|s| s.det_f).collect()),
        ],
        on_cells: vec![Field::integers("element", cell_elements.collect())],
    }
}

/// Corners of a VTK_HEXAHEDRON: around the bottom, then around the top.
const HEXAHEDRON: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
