//! Measured axes in the mesh: each in its element, in the frame of the fibre angles there.

use super::data::Axis;
use crate::math::tensor::{Matrix, Vector, dot, norm, normalised};
use crate::mesh::fibre_angles::axes;
use crate::mesh::location::Locator;
use crate::mesh::{Mesh, position_and_jacobian};
use crate::scene::OutsideSpec;
use rayon::prelude::*;

/// A measured axis in its element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Index of the element.
    pub element: u32,
    /// As of [`Axis`].
    pub group: u32,
    /// Where in the element.
    pub xi: [f64; 3],
    /// The unit axis in the frame (f1, f2, f3).
    pub axis: Vector,
    /// How much it counts; on average 1.
    pub weight: f64,
}

/// Samples sorted by element.
#[derive(Debug, Clone)]
pub struct Samples {
    /// The samples.
    pub all: Vec<Sample>,
    /// `starts[e]..starts[e + 1]` are those of element e.
    pub starts: Vec<usize>,
}

/// What became of the points.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Outside {
    /// Points that no element holds.
    pub count: usize,
    /// Those of them that are used at the nearest point of the mesh.
    pub projected: usize,
    /// Distance of the nearest and of the farthest of them, mm; 0 where there is none.
    pub distance: [f64; 2],
}

impl Samples {
    /// Sorts samples, and divides their weights by the mean.
    pub fn new(mut all: Vec<Sample>, elements: usize) -> Samples {
        all.sort_by_key(|sample| sample.element);
        let mean = all.iter().map(|sample| sample.weight).sum::<f64>() / all.len().max(1) as f64;
        let mut starts = vec![0; elements + 1];
        for sample in &mut all {
            sample.weight /= mean;
            starts[sample.element as usize + 1] += 1;
        }
        for e in 0..elements {
            starts[e + 1] += starts[e];
        }
        Samples { all, starts }
    }

    /// The samples of an element.
    pub fn of(&self, element: usize) -> &[Sample] {
        &self.all[self.starts[element]..self.starts[element + 1]]
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        self.starts.len() - 1
    }
}

/// The frame (f1, f2, f3) of the fibre angles for dX/dxi.
pub fn frame(jacobian: &Matrix) -> [Vector; 3] {
    axes(jacobian, [0.0; 3])
}

/// A vector in a frame.
pub fn in_frame(frame: &[Vector; 3], v: Vector) -> Vector {
    frame.map(|f| dot(f, v))
}

/// A vector from its components in a frame.
pub fn from_frame(frame: &[Vector; 3], [a, b, c]: Vector) -> Vector {
    std::array::from_fn(|i| a * frame[0][i] + b * frame[1][i] + c * frame[2][i])
}

/// The angles (A, B, G) of a unit fibre and, if there is one, a sheet axis across it, both in the frame; A within
/// (-pi/2, pi/2], as the signs of the axes are free.
pub fn angles_of(fibre: Vector, sheet: Option<Vector>) -> [f64; 3] {
    let flip = fibre[0] < 0.0 || (fibre[0] == 0.0 && fibre[1] < 0.0);
    let [x, y, z] = if flip { fibre.map(|c| -c) } else { fibre };
    let (a, b) = (y.atan2(x), (-z).atan2(x.hypot(y)));
    let g = sheet.map_or(0.0, |sheet| {
        let [across, up] = across_and_up(a, b, sheet);
        (up / across).atan()
    });
    [a, b, if g.is_finite() { g } else { 0.0 }]
}

/// The components of a vector in the frame along b and c of the fibre angles A and B.
pub fn across_and_up(a: f64, b: f64, v: Vector) -> [f64; 2] {
    let in_plane = a.cos() * v[0] + a.sin() * v[1];
    [-a.sin() * v[0] + a.cos() * v[1], b.cos() * v[2] + b.sin() * in_plane]
}

/// Finds every axis in the mesh. The sheet axes, where there are any, are samples of their own in the second list: their
/// elements, and their axes as vectors in the frame, not yet across the fibre.
pub fn embed(locator: &Locator<'_>, axes: &[Axis], rule: OutsideSpec) -> (Samples, Samples, Outside) {
    let found: Vec<(Option<Sample>, Option<Sample>, Option<f64>)> = axes
        .par_iter()
        .map(|axis| {
            let (at, distance) = match locator.locate(axis.position) {
                Ok(at) => (at, None),
                Err(outside) => (outside.nearest, Some(outside.distance)),
            };
            let used = match (distance, rule) {
                (None, _) => true,
                (Some(distance), OutsideSpec::ProjectMm(limit)) => distance <= limit,
                (Some(_), OutsideSpec::Drop) => false,
            };
            if !used {
                return (None, None, distance);
            }
            let frame = frame(&locator.jacobian(at));
            let sample = |v: Vector| Sample {
                element: at.element as u32,
                group: axis.group,
                xi: at.xi,
                axis: in_frame(&frame, normalised(v)),
                weight: axis.weight,
            };
            let finite = |sample: &Sample| sample.axis.iter().all(|x| x.is_finite());
            (Some(sample(axis.fibre)).filter(finite), axis.sheet.map(sample).filter(finite), distance)
        })
        .collect();
    let distances = || found.iter().filter_map(|(_, _, distance)| *distance);
    let outside = Outside {
        count: distances().count(),
        projected: found.iter().filter(|(sample, _, distance)| sample.is_some() && distance.is_some()).count(),
        distance: match distances().count() {
            0 => [0.0; 2],
            _ => [distances().fold(f64::INFINITY, f64::min), distances().fold(0.0, f64::max)],
        },
    };
    let elements = locator.mesh().elements();
    let fibres = Samples::new(found.iter().filter_map(|(fibre, _, _)| *fibre).collect(), elements);
    let sheets = Samples::new(found.iter().filter_map(|(_, sheet, _)| *sheet).collect(), elements);
    (fibres, sheets, outside)
}

/// The part of the weight of axes that run along the third direction of a frame, within 15 degrees.
fn along(mesh: &Mesh, samples: &Samples, shift: usize) -> f64 {
    let along = |element: usize| -> f64 {
        let local = mesh.local(element);
        let one = |sample: &Sample| {
            let (_, jacobian) = position_and_jacobian(mesh.element, &local, sample.xi);
            let v = from_frame(&frame(&jacobian), sample.axis);
            let renamed: Matrix = std::array::from_fn(|i| std::array::from_fn(|d| jacobian[i][(d + shift) % 3]));
            let third = dot(frame(&renamed)[2], v).abs();
            if third > 15.0_f64.to_radians().cos() { sample.weight } else { 0.0 }
        };
        samples.of(element).iter().map(one).sum()
    };
    let sum: Vec<f64> = (0..samples.elements()).into_par_iter().map(along).collect();
    sum.iter().sum::<f64>() / samples.all.len().max(1) as f64
}

/// By how much to rename the local directions: 0 unless more than a twentieth of the data runs along f3 and another
/// choice has less than half of that.
pub fn chart(mesh: &Mesh, samples: &Samples) -> usize {
    let as_is = along(mesh, samples, 0);
    if as_is <= 0.05 {
        return 0;
    }
    let others = [1, 2].map(|shift| (shift, along(mesh, samples, shift)));
    let (shift, best) = if others[1].1 < others[0].1 { others[1] } else { others[0] };
    if best < 0.5 * as_is { shift } else { 0 }
}

/// The same samples in the mesh with renamed directions; `renamed` is that mesh.
pub fn recharted(mesh: &Mesh, renamed: &Mesh, samples: &Samples, shift: usize) -> Samples {
    let moved = samples.all.par_iter().map(|sample| {
        let at = |xi| crate::mesh::MaterialPoint { element: sample.element as usize, xi };
        let v = from_frame(&frame(&mesh.jacobian(at(sample.xi))), sample.axis);
        let xi = std::array::from_fn(|d| sample.xi[(d + shift) % 3]);
        Sample { xi, axis: in_frame(&frame(&renamed.jacobian(at(xi))), v), ..*sample }
    });
    Samples { all: moved.collect(), starts: samples.starts.clone() }
}

/// A sheet axis across the fibre with these angles, as an axis in the plane (b, c); `None` where it runs along the
/// fibre within 10 degrees.
pub fn across(sheet: &Sample, [a, b, _]: [f64; 3]) -> Option<Sample> {
    let [x, y] = across_and_up(a, b, sheet.axis);
    let length = norm([x, y, 0.0]);
    (length > 10.0_f64.to_radians().sin()).then(|| Sample {
        axis: [x / length, y / length, 0.0],
        weight: sheet.weight * length * length,
        ..*sheet
    })
}
