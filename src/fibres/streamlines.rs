//! Fitted fibres as lines through the body.

use crate::math::tensor::{Vector, add_scaled, dot, norm, subtract};
use crate::mesh::fibre_angles::FibreAngles;
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use rayon::prelude::*;

/// Steps of a line to each side.
const MOST_STEPS: usize = 400;

/// The fibre at a point.
fn fibre(mesh: &Mesh, angles: &FibreAngles, at: MaterialPoint) -> Vector {
    angles.direction(mesh, at.element, &mesh.local(at.element), at.xi)
}

/// The line along the fibres through a material point, to both sides until it leaves the body or has taken 400 steps of
/// `step` mm; midpoint rule.
pub fn line(locator: &Locator<'_>, angles: &FibreAngles, seed: MaterialPoint, step: f64) -> Vec<Vector> {
    let mesh = locator.mesh();
    let start = mesh.position(seed);
    let side = |sign: f64| {
        let (mut points, mut x) = (Vec::new(), start);
        let first = fibre(mesh, angles, seed);
        let mut along: Vector = first.map(|c| sign * c);
        for _ in 0..MOST_STEPS {
            // the sign of a fibre says nothing: go on as before
            let towards = |v: Vector, along: Vector| if dot(v, along) < 0.0 { v.map(|c| -c) } else { v };
            let Some(half) = locator.holder(add_scaled(x, 0.5 * step, along)) else { break };
            let middle = towards(fibre(mesh, angles, half), along);
            let next = add_scaled(x, step, middle);
            let Some(at) = locator.holder(next) else { break };
            points.push(next);
            along = towards(fibre(mesh, angles, at), middle);
            x = next;
        }
        points
    };
    let mut points = side(-1.0);
    points.reverse();
    points.push(start);
    points.extend(side(1.0));
    points
}

/// Lines through the middles of at most `most` elements, spread over the mesh; with steps of an eighth of an element.
pub fn lines(locator: &Locator<'_>, angles: &FibreAngles, most: usize) -> Vec<Vec<Vector>> {
    let mesh = locator.mesh();
    let elements = mesh.elements();
    // several seeds in each element of a small mesh, one in some elements of a large one
    let per_side = (1..=4).rev().find(|n| elements * n * n * n <= most).unwrap_or(1);
    let stride = elements.div_ceil(most.max(1)).max(1);
    let seeds: Vec<MaterialPoint> = (0..elements)
        .step_by(stride)
        .flat_map(|element| {
            (0..per_side * per_side * per_side).map(move |k| {
                let place = |k: usize| (k as f64 + 0.5) / per_side as f64;
                let xi = [k % per_side, k / per_side % per_side, k / per_side / per_side].map(place);
                MaterialPoint { element, xi }
            })
        })
        .collect();
    seeds.par_iter().map(|seed| line(locator, angles, *seed, size(mesh, seed.element) / 8.0)).collect()
}

/// The longest way along a local direction through the middle of an element, mm.
pub fn size(mesh: &Mesh, element: usize) -> f64 {
    let at = |d: usize, end: f64| {
        let mut xi = [0.5; 3];
        xi[d] = end;
        mesh.position(MaterialPoint { element, xi })
    };
    (0..3).map(|d| norm(subtract(at(d, 1.0), at(d, 0.0)))).fold(0.0, f64::max)
}
