//! How smooth: generalised cross-validation (Golub, Heath and Wahba 1979) of the problem made linear where the search stands.
//!
//! GCV(lambda) = (S(lambda) / N) / (1 - tr(lambda) / N)^2, S the weighted squares of the residuals, N their number, tr the
//! trace of (H + lambda K)^-1 H: how many numbers the data determine.

use super::descent::Search;
use super::normal::Sums;
use super::pattern::solve;
use super::space::Angles;
use crate::error::Result;
use faer::Mat;
use faer::linalg::solvers::Solve;
use rayon::prelude::*;

/// Powers of ten of the smoothness that are tried.
const POWERS: std::ops::RangeInclusive<i32> = -12..=6;
/// So few parameters have an exact trace.
const EXACT: usize = 300;
/// Random vectors for the trace of larger ones (Hutchinson 1990).
const PROBES: usize = 32;
/// Residuals below this are rounding, radians.
const ROUNDING: f64 = 1e-10;

/// A smoothness that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tried {
    /// The smoothness, in relation to the data.
    pub smoothness: f64,
    /// GCV, radians squared.
    pub score: f64,
    /// tr: numbers that the data determine.
    pub freedom: f64,
}

/// H times vectors whose products with (H + lambda K)^-1 H make the trace.
pub struct Trace {
    vectors: Mat<f64>,
    images: Vec<Mat<f64>>,
    factor: f64,
}

impl Trace {
    /// For the matrices of some sums.
    pub fn new(search: &Search, sums: &Sums) -> Trace {
        let parameters = search.pattern.parameters();
        let (count, factor) = if parameters <= EXACT { (parameters, 1.0) } else { (PROBES, 1.0 / PROBES as f64) };
        let mut state = 1_u64;
        let vectors = Mat::from_fn(parameters, count, |i, j| {
            if parameters <= EXACT {
                return if i == j { 1.0 } else { 0.0 };
            }
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            if state >> 63 == 0 { 1.0 } else { -1.0 }
        });
        let image = |normal: &Vec<f64>| {
            let columns: Vec<Vec<f64>> = (0..count)
                .map(|j| {
                    let column: Vec<f64> = (0..parameters).map(|i| vectors[(i, j)]).collect();
                    search.pattern.apply(normal, &column)
                })
                .collect();
            Mat::from_fn(parameters, count, |i, j| if search.fixed[i] { 0.0 } else { columns[j][i] })
        };
        let images = sums.normal.iter().map(image).collect();
        Trace { vectors, images, factor }
    }

    /// GCV and trace at a smoothness.
    ///
    /// # Errors
    /// [`Error::FibreSystem`](crate::Error::FibreSystem).
    pub fn score(&self, search: &Search, angles: &Angles, sums: &Sums, smoothness: f64) -> Result<Tried> {
        let lambda = search.lambda(smoothness);
        let (_, rough) = search.roughness.at(search.space, angles);
        let (mut squares, mut freedom) = (sums.squares, 0.0);
        for k in 0..search.sought {
            let factor =
                search.pattern.factor(&sums.normal[k], lambda, &search.roughness.matrices[k], search.fixed)?;
            let right: Vec<f64> = (0..angles.len())
                .map(|n| if search.fixed[n] { 0.0 } else { sums.gradient[k][n] - lambda * rough[k][n] })
                .collect();
            let step = solve(&factor, &right);
            let image = search.pattern.apply(&sums.normal[k], &step);
            let of_parameter = |n: usize| step[n] * (image[n] - 2.0 * sums.gradient[k][n]);
            squares += (0..angles.len()).map(of_parameter).sum::<f64>();
            let mut solved = self.images[k].clone();
            factor.solve_in_place(solved.as_mut());
            let column = |j: usize| (0..solved.nrows()).map(|i| self.vectors[(i, j)] * solved[(i, j)]).sum::<f64>();
            freedom += self.factor * (0..solved.ncols()).map(column).sum::<f64>();
        }
        let squares = squares.max(sums.count * ROUNDING * ROUNDING);
        let left = 1.0 - freedom / sums.count;
        let score = if left > 1e-6 { squares / sums.count / (left * left) } else { f64::INFINITY };
        Ok(Tried { smoothness, score, freedom })
    }
}

/// The smoothness with the least GCV at some angles: over powers of ten, or over the power next to `near` on either side, and
/// then a golden section. The first is the chosen one; then all that were tried.
///
/// # Errors
/// [`Error::FibreSystem`](crate::Error::FibreSystem).
pub fn choose(search: &Search, angles: &Angles, sums: &Sums, near: Option<f64>) -> Result<(Tried, Vec<Tried>)> {
    let trace = Trace::new(search, sums);
    let score = |power: f64| trace.score(search, angles, sums, 10_f64.powf(power));
    let powers: Vec<f64> = match near {
        Some(near) => [-1.0, 0.0, 1.0].iter().map(|step| near.log10() + step).collect(),
        None => POWERS.map(f64::from).collect(),
    };
    let mut tried = powers.par_iter().map(|power| score(*power)).collect::<Result<Vec<_>>>()?;
    let best = (0..tried.len()).min_by(|a, b| tried[*a].score.total_cmp(&tried[*b].score)).unwrap_or_default();
    let (mut low, mut high) = (powers[best.saturating_sub(1)], powers[(best + 1).min(powers.len() - 1)]);
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let inner = |low: f64, high: f64| [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let [a, b] = inner(low, high);
    let mut pair = [score(a)?, score(b)?];
    for _ in 0..6 {
        tried.extend(pair);
        let [a, b] = inner(low, high);
        if pair[0].score <= pair[1].score {
            high = b;
            let [a, _] = inner(low, high);
            pair = [score(a)?, pair[0]];
        } else {
            low = a;
            let [_, b] = inner(low, high);
            pair = [pair[1], score(b)?];
        }
    }
    tried.extend(pair);
    tried.sort_by(|a, b| a.smoothness.total_cmp(&b.smoothness));
    tried.dedup();
    let best = tried.iter().min_by(|a, b| a.score.total_cmp(&b.score)).copied();
    let none = Tried { smoothness: 1.0, score: f64::INFINITY, freedom: 0.0 };
    Ok((best.unwrap_or(none), tried))
}
