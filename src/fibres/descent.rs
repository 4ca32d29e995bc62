//! Gauss-Newton steps on the true angular error.

use super::embed::{Sample, Samples};
use super::normal::{Angles, Corners, Pattern, Sums, roughness, solve, sums};
use crate::error::Result;
use crate::scene::LossSpec;

/// A step of every angle that is smaller than this ends the search, radians.
const TOLERANCE: f64 = 1e-8;
/// A step that lowers the sum by less than this part of it ends the search: it is a millionth of what the data leave open.
const GAIN: f64 = 1e-12;
/// The most halvings of a step.
const HALVINGS: usize = 12;

/// What is minimised, but for the smoothness.
pub struct Search<'a> {
    /// Where pairs of nodes stand in matrices.
    pub pattern: &'a Pattern,
    /// The data.
    pub samples: &'a Samples,
    /// Nodes and half turns at the corners of elements.
    pub corners: &'a Corners,
    /// How an error counts.
    pub loss: LossSpec,
    /// 1: only A is sought. 2: A and B.
    pub sought: usize,
    /// Nodes whose angles do not change.
    pub fixed: &'a [bool],
    /// The matrices of the smoothness, per angle.
    pub smooth: Vec<Vec<f64>>,
}

/// How a search ended.
#[derive(Debug, Clone)]
pub struct Descent {
    /// Steps that were taken.
    pub steps: usize,
    /// Whether the last one was below the tolerance.
    pub converged: bool,
    /// The sums at the end.
    pub sums: Sums,
}

impl Search<'_> {
    /// lambda for a smoothness: it is in relation to the weight of the data of an average element.
    pub fn lambda(&self, smoothness: f64) -> f64 {
        smoothness * self.samples.all.len() as f64 / self.samples.elements() as f64
    }

    /// The sums at some angles, over the samples that `take` takes.
    pub fn sums(&self, angles: &Angles, take: impl Fn(&Sample) -> bool + Sync) -> Sums {
        sums(self.pattern, self.samples, self.corners, angles, self.loss, self.sought, take)
    }

    /// The Gauss-Newton step from some angles, per sought angle and node; `sums` are those there.
    ///
    /// # Errors
    /// [`Error::FibreSystem`](crate::Error::FibreSystem).
    pub fn step(&self, angles: &Angles, sums: &Sums, lambda: f64) -> Result<Vec<Vec<f64>>> {
        let (_, rough) = roughness(self.corners, angles, self.sought);
        let one = |k: usize| {
            let factor = self.pattern.factor(&sums.normal[k], lambda, &self.smooth[k], self.fixed)?;
            let right: Vec<f64> = (0..angles.len())
                .map(|n| if self.fixed[n] { 0.0 } else { sums.gradient[k][n] - lambda * rough[k][n] })
                .collect();
            Ok(solve(&factor, &right))
        };
        (0..self.sought).map(one).collect()
    }

    /// Moves angles along `part` of a step.
    pub fn moved(&self, angles: &Angles, step: &[Vec<f64>], part: f64) -> Angles {
        let mut moved = angles.clone();
        for (k, step) in step.iter().enumerate() {
            moved.iter_mut().zip(step).for_each(|(angles, step)| angles[k] += part * step);
        }
        moved
    }

    /// Goes downhill until steps are small, at most `most` of them. A step that does not go down is halved.
    ///
    /// # Errors
    /// [`Error::FibreSystem`](crate::Error::FibreSystem).
    pub fn descend(&self, angles: &mut Angles, lambda: f64, most: usize) -> Result<Descent> {
        let value =
            |sums: &Sums, angles: &Angles| sums.cost + lambda * roughness(self.corners, angles, self.sought).0;
        let mut sums = self.sums(angles, |_| true);
        let mut now = value(&sums, angles);
        for steps in 0..most {
            let step = self.step(angles, &sums, lambda)?;
            let longest = step.iter().flatten().fold(0.0, |longest: f64, x| longest.max(x.abs()));
            // a step of more than a radian leaves the chart in which it was made
            let mut part = if longest > 1.0 { 1.0 / longest } else { 1.0 };
            let (mut better, before) = (false, now);
            for _ in 0..HALVINGS {
                let trial = self.moved(angles, &step, part);
                let there = self.sums(&trial, |_| true);
                let then = value(&there, &trial);
                // of equal values the newer is as good: at the bottom rounding decides
                if then <= now * (1.0 + 1e-12) {
                    (*angles, sums, now, better) = (trial, there, then, true);
                    break;
                }
                part *= 0.5;
            }
            if !better || longest < TOLERANCE || (part == 1.0 && before - now <= GAIN * before) {
                return Ok(Descent { steps: steps + 1, converged: better || longest < 1e-4, sums });
            }
        }
        Ok(Descent { steps: most, converged: false, sums })
    }
}
