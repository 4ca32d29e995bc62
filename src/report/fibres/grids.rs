//! A fitted field for ParaView.

use crate::fibres::streamlines::size;
use crate::fibres::{FibreFit, measured as measured_axis};
use crate::math::tensor::{Vector, add_scaled};
use crate::mesh::MaterialPoint;
use crate::mesh::element::ends;
use crate::mesh::fibre_angles::axes;
use crate::report::vtu::{CellKind, Field, Grid};

/// Corners of a VTK_HEXAHEDRON, as local nodes.
const HEXAHEDRON: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];
/// More measured axes than this are thinned out.
const MOST_AXES: usize = 20_000;

/// Parts of an element of a tricubic field along each direction.
const PARTS: usize = 3;

/// Every element as a hexahedron with straight edges, or where the field is tricubic as 3 x 3 x 3 of them; they do not share points,
/// as the frames of the angles jump between elements. On points: fibre, sheet, the angles (degrees), and of the nearest node its
/// name, the standard deviation of A and whether the data determine it.
pub(super) fn field(fit: &FibreFit) -> Grid {
    let mesh = &fit.mesh;
    let (mut points, mut fibre, mut sheet, mut node) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut angles: [Vec<f64>; 3] = Default::default();
    let (mut determined, mut sd, mut owner) = (Vec::new(), Vec::new(), Vec::new());
    let parts = if fit.angles.tricubic.is_some() { PARTS } else { 1 };
    for element in 0..mesh.elements() {
        for part in 0..parts.pow(3) {
            owner.push(element as i64);
            let first = [part % parts, part / parts % parts, part / parts / parts];
            for corner in HEXAHEDRON {
                let end = ends(corner);
                let xi = std::array::from_fn(|d| (first[d] + end[d]) as f64 / parts as f64);
                let at = MaterialPoint { element, xi };
                let here = fit.angles.at(mesh, element, xi);
                let [along, across, _] = axes(&mesh.jacobian(at), here);
                points.push(mesh.position(at));
                fibre.push(along);
                sheet.push(across);
                (0..3).for_each(|k| angles[k].push(here[k].to_degrees()));
                let nearest: usize = (0..3).map(|d| usize::from(xi[d] > 0.5) << d).sum();
                let answer = &fit.nodes[mesh.corners[element][nearest]];
                determined.push(i64::from(answer.determined));
                sd.push(answer.sd[0].unwrap_or(f64::NAN).to_degrees());
                node.push(answer.name);
            }
        }
    }
    let [a, b, g] = angles;
    Grid {
        time_s: 0.0,
        kind: CellKind::Hexahedron,
        connectivity: (0..points.len() as i64).collect(),
        points,
        on_points: vec![
            Field::vectors("fibre", fibre),
            Field::vectors("sheet", sheet),
            Field::scalars("a_deg", a),
            Field::scalars("b_deg", b),
            Field::scalars("g_deg", g),
            Field::scalars("a_sd_deg", sd),
            Field::integers("determined", determined),
            Field::integers("node", node),
        ],
        on_cells: vec![Field::integers("element", owner)],
    }
}

/// Streamlines as straight pieces; on cells: the number of the line.
pub(super) fn streamlines(lines: &[Vec<Vector>]) -> Grid {
    let (mut points, mut connectivity, mut number) = (Vec::new(), Vec::new(), Vec::new());
    for (index, line) in lines.iter().enumerate() {
        let first = points.len() as i64;
        for piece in 0..line.len().saturating_sub(1) as i64 {
            connectivity.extend([first + piece, first + piece + 1]);
            number.push(index as i64);
        }
        points.extend(line);
    }
    let on_cells = vec![Field::integers("line", number)];
    Grid { time_s: 0.0, kind: CellKind::Line, points, connectivity, on_points: Vec::new(), on_cells }
}

/// The two ends of some measured axes, spread over all, as pieces of a fifth of an element; and their errors.
pub(super) fn pieces(fit: &FibreFit, most: usize) -> Vec<([Vector; 2], f64)> {
    let stride = fit.samples.all.len().div_ceil(most).max(1);
    let piece = |(sample, error): (&crate::fibres::embed::Sample, &f64)| {
        let (x, v) = measured_axis(&fit.mesh, sample);
        let half = 0.1 * size(&fit.mesh, sample.element as usize);
        ([add_scaled(x, -half, v), add_scaled(x, half, v)], *error)
    };
    fit.samples.all.iter().zip(&fit.errors).step_by(stride).map(piece).collect()
}

/// Measured axes as pieces of lines; on cells: their errors, degrees.
pub(super) fn measured(fit: &FibreFit) -> Grid {
    let pieces = pieces(fit, MOST_AXES);
    let errors = pieces.iter().map(|(_, error)| error.to_degrees()).collect();
    Grid {
        time_s: 0.0,
        kind: CellKind::Line,
        points: pieces.iter().flat_map(|(ends, _)| *ends).collect(),
        connectivity: (0..2 * pieces.len() as i64).collect(),
        on_points: Vec::new(),
        on_cells: vec![Field::scalars("error_deg", errors)],
    }
}
