//! How sure the angles are: standard deviations, nodes that the data do not determine, errors of data held out.

use super::descent::Search;
use super::embed::Sample;
use super::misfit::misfit;
use super::normal::Sums;
use super::space::Angles;
use crate::error::Result;
use faer::Mat;
use faer::linalg::solvers::Solve;
use rayon::prelude::*;

/// The change of an angle from node to node that is thought possible where there are no data, radians: 45 degrees.
const POSSIBLE: f64 = std::f64::consts::FRAC_PI_4;
/// Angles with a standard deviation above this, radians, with nothing but the data and [`POSSIBLE`] to go by, are not
/// determined by the data: 25 degrees. A node without data has at least 45 / sqrt(8/3) = 27.6 degrees, [`TRILINEAR`] being the
/// diagonal of the smoothness at a node of eight elements, even if all its neighbours are known.
const DETERMINED: f64 = 25.0 / 180.0 * std::f64::consts::PI;
/// The smoothness of a value at a node of eight trilinear elements; that of other fields is brought to it.
const TRILINEAR: f64 = 8.0 / 3.0;
/// The least standard deviation of the data that is believed, radians: a tenth of a degree.
const LEAST_NOISE: f64 = 1.745e-3;

/// Standard deviations at the nodes.
#[derive(Debug, Clone)]
pub struct Certainty {
    /// Per sought angle and node, radians: of the fit with its smoothness.
    pub sd: Vec<Vec<f64>>,
    /// Whether the data determine the angles of the node, without help of the smoothness.
    pub determined: Vec<bool>,
}

/// The diagonal of the inverse at the values of the nodes.
fn variances(search: &Search, normal: &[f64], lambda: f64, k: usize) -> Result<Vec<f64>> {
    const AT_ONCE: usize = 64;
    let factor = search.pattern.factor(normal, lambda, &search.roughness.matrices[k], search.fixed)?;
    let parameters = search.pattern.parameters();
    let parts: Vec<Vec<f64>> = search
        .space
        .values
        .par_chunks(AT_ONCE)
        .map(|values| {
            let mut columns = Mat::from_fn(parameters, values.len(), |i, j| if i == values[j] { 1.0 } else { 0.0 });
            factor.solve_in_place(columns.as_mut());
            values.iter().enumerate().map(|(j, value)| columns[(*value, j)]).collect()
        })
        .collect();
    Ok(parts.concat())
}

/// Standard deviations for data whose noise has the standard deviation `noise` (radians, of an axis of weight 1).
///
/// Determined is told by a second inverse whose smoothness stands for neighbours that differ by 45 degrees: near data it says what
/// they say, away from them it is beyond 25 degrees from the first node on.
///
/// # Errors
/// [`Error::FibreSystem`](crate::Error::FibreSystem).
pub fn certainty(search: &Search, sums: &Sums, lambda: f64, noise: f64) -> Result<Certainty> {
    let believed = noise.max(LEAST_NOISE);
    let weak = (believed / POSSIBLE).powi(2) * TRILINEAR / search.roughness.of_a_node();
    let fixed: Vec<bool> = search.space.values.iter().map(|value| search.fixed[*value]).collect();
    let mut certainty = Certainty { sd: Vec::new(), determined: vec![true; fixed.len()] };
    for k in 0..search.sought {
        let fitted = variances(search, &sums.normal[k], lambda, k)?;
        let alone = variances(search, &sums.normal[k], weak, k)?;
        let none = |fixed: bool, sd: f64| if fixed { 0.0 } else { sd };
        certainty
            .sd
            .push(fitted.iter().zip(&fixed).map(|(variance, fixed)| none(*fixed, noise * variance.sqrt())).collect());
        for ((determined, variance), fixed) in certainty.determined.iter_mut().zip(&alone).zip(&fixed) {
            *determined &= none(*fixed, believed * variance.sqrt()) <= DETERMINED;
        }
    }
    Ok(certainty)
}

/// The angular errors at some angles of the samples that `take` takes, in their order, radians.
pub fn errors(search: &Search, angles: &Angles, take: impl Fn(&Sample) -> bool + Sync) -> Vec<f64> {
    let of_element = |e: usize| {
        let local = search.space.local(e, angles);
        let taken = search.samples.of(e).iter().filter(|sample| take(sample));
        taken.map(|sample| misfit(search.space.at(&local, sample.xi), sample.axis).theta).collect::<Vec<_>>()
    };
    (0..search.samples.elements()).into_par_iter().flat_map_iter(of_element).collect()
}

/// Which part of the data a sample is in: all of a group in the same.
fn fold(sample: &Sample, folds: usize) -> usize {
    let mut bits = u64::from(sample.group).wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) % folds as u64) as usize
}

/// Angular errors of every part of the data against the fit to the rest, radians. Each of these fits is one Gauss-Newton step
/// from the fit to all, with its smoothness: the parts change it little.
///
/// # Errors
/// [`Error::FibreSystem`](crate::Error::FibreSystem).
pub fn held_out(search: &Search, angles: &Angles, sums: &Sums, lambda: f64, folds: usize) -> Result<Vec<f64>> {
    let mut all = Vec::with_capacity(search.samples.all.len());
    for part in 0..folds {
        let mut rest = sums.clone();
        rest.add(-1.0, &search.sums(angles, |sample| fold(sample, folds) == part));
        let step = search.step(angles, &rest, lambda)?;
        let without = search.moved(angles, &step, 1.0);
        all.extend(errors(search, &without, |sample| fold(sample, folds) == part));
    }
    Ok(all)
}
