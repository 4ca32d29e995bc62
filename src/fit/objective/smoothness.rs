//! Smoothness in time. From frame to frame, dt apart:
//!   first:   |a_t - a_(t-1)|^2 / (2 s^2 dt), a random walk;
//!   second:  |v_t - v_(t-1)|^2 / (2 s^2 dt'), v_t = (a_t - a_(t-1)) / dt, dt' the mean of both intervals: a random walk of the rate.
//!
//! A fit that goes frame by frame looks back: it expects what came before. For a random walk what came before is known with its
//! own covariance C, so that a_t has the covariance C + s^2 dt 1 before its markers are seen, as in a Kalman filter. For the
//! rate the line through the last two frames is expected, as uncertain as both of them are, their errors taken as independent.

use super::{Instant, Objective, Past, Sum};
use crate::scene::SmoothSpec;
use nalgebra::{DMatrix, DVector};

/// Frames are not nearer in time than this, s: stamps that stand twice.
const LEAST_STEP: f64 = 1e-4;

/// How fast controls may change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothness {
    /// Per root of a second.
    pub first: Option<f64>,
    /// Per root of a cubed second.
    pub second: Option<f64>,
}

impl Smoothness {
    /// `None` where nothing is asked for.
    pub fn new(spec: &SmoothSpec) -> Option<Smoothness> {
        let SmoothSpec { first, second } = *spec;
        (first.is_some() || second.is_some()).then_some(Smoothness { first, second })
    }

    /// The parts of the sum over all frames: each is weight / 2 x |sum of c a_k|^2 over the frames k with their factors c.
    pub fn links(&self, times_s: &[f64]) -> Vec<Link> {
        let step = |k: usize| (times_s[k] - times_s[k - 1]).abs().max(LEAST_STEP);
        let mut links = Vec::new();
        for k in 1..times_s.len() {
            if let Some(s) = self.first {
                links.push(Link { weight: 1.0 / (s * s * step(k)), frames: vec![(k - 1, -1.0), (k, 1.0)] });
            }
            if let (Some(s), true) = (self.second, k > 1) {
                let (before, after) = (step(k - 1), step(k));
                let factors = [1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after];
                let frames = factors.iter().enumerate().map(|(i, c)| (k - 2 + i, *c)).collect();
                links.push(Link { weight: 2.0 / (s * s * (before + after)), frames });
            }
        }
        links
    }
}

/// A part of the sum over frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Its weight, in parts of ranges.
    pub weight: f64,
    /// Frames with their factors, in their order.
    pub frames: Vec<(usize, f64)>,
}

impl Objective for Smoothness {
    fn name(&self) -> &'static str {
        "smoothness"
    }

    fn words(&self) -> String {
        let first = self.first.map(|s| format!("change of sd {s} per root second"));
        let second = self.second.map(|s| format!("change of rate of sd {s} per root cubed second"));
        let words: Vec<String> = first.into_iter().chain(second).collect();
        format!("smoothness ({})", words.join(", "))
    }

    fn add(&self, at: &Instant<'_>, sum: &mut Sum) {
        let Some(last) = at.before.first() else { return };
        let n = at.a.len();
        let mut expect = |expected: &[f64], precision: &DMatrix<f64>| {
            let d = DVector::from_fn(n, |k, _| at.a[k] - expected[k]);
            let g = precision * &d;
            sum.value += 0.5 * d.dot(&g);
            sum.gradient.iter_mut().zip(g.iter()).for_each(|(s, g)| *s += g);
            sum.hessian += precision;
        };
        let after = (at.time_s - last.time_s).abs().max(LEAST_STEP);
        if let Some(s) = self.first {
            let spread = &last.covariance + DMatrix::from_diagonal_element(n, n, s * s * after);
            if let Some(precision) = spread.cholesky() {
                expect(&last.a, &precision.inverse());
            }
        }
        if let (Some(s), [last, earlier, ..]) = (self.second, at.before) {
            let before = (last.time_s - earlier.time_s).abs().max(LEAST_STEP);
            let part = after / before;
            let expected: Vec<f64> = (0..n).map(|k| last.a[k] + part * (last.a[k] - earlier.a[k])).collect();
            let own = s * s * 0.5 * (before + after) * after * after;
            let spread = &last.covariance * (1.0 + part).powi(2)
                + &earlier.covariance * (part * part)
                + DMatrix::from_diagonal_element(n, n, own);
            if let Some(precision) = spread.cholesky() {
                expect(&expected, &precision.inverse());
            }
        }
    }
}

impl Past {
    /// How many are kept.
    pub const KEPT: usize = 2;
}
