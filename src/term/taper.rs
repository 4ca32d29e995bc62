//! Fibres that end softly.
//!
//! A muscle whose fibres all end in one face pulls there with a traction that jumps, T n (n . N): the strain of the host
//! would have to jump with it, and a host with continuous strain comes near that only slowly. With a taper t the fibres
//! of a cross-section end one after the other: where a fibre has the distance d to its nearer end, along its own
//! direction, a part of them is left,
//! ```text
//! s(d / t) = 3 (d/t)^2 - 2 (d/t)^3  for d < t,  else 1,
//! ```
//! by which the muscle's weights w are multiplied, and so its energy, force and stiffness. In a muscle shorter than 2 t
//! the part never reaches one.

use crate::math::tensor::Vector;
use crate::mesh::location::Locator;

/// Steps in which the way to the end of a fibre is walked.
const STEPS: usize = 16;

/// Halvings of the step that leaves the muscle.
const HALVINGS: usize = 40;

/// s(d / t) at the reference position `at` (mm) in the muscle that `own` searches, for the unit fibre direction `fibre`
/// and t = `taper` (mm).
pub fn part_of_fibres(own: &Locator<'_>, at: Vector, fibre: Vector, taper: f64) -> f64 {
    let ahead = way_to_end(own, at, fibre, taper);
    let d = ahead.min(way_to_end(own, at, fibre.map(|c| -c), taper)) / taper;
    d * d * (3.0 - 2.0 * d)
}

/// Distance from `at` along the unit vector `direction` to where the muscle ends, at most `reach`, mm.
fn way_to_end(own: &Locator<'_>, at: Vector, direction: Vector, reach: f64) -> f64 {
    let inside = |way: f64| own.holder(std::array::from_fn(|i| at[i] + way * direction[i])).is_some();
    let step = reach / STEPS as f64;
    let Some(first) = (1..=STEPS).find(|k| !inside(step * *k as f64)) else { return reach };
    let (mut low, mut high) = (step * (first - 1) as f64, step * first as f64);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *(if inside(middle) { &mut low } else { &mut high }) = middle;
    }
    0.5 * (low + high)
}
