//! The path from one equilibrium to another: steps of adaptive length with a predictor.

/// Lengths of steps along a path from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepLimits {
    /// The first step.
    pub first: f64,
    /// The longest step.
    pub max: f64,
    /// The shortest step; a shorter one means failure.
    pub min: f64,
}

/// Chooses the length of each step from how hard the last one was.
#[derive(Debug, Clone)]
pub struct Stepper {
    limits: StepLimits,
    /// Where on the path the last solution is.
    reached: f64,
    length: f64,
    cuts: usize,
}

impl Stepper {
    /// At the beginning of a path.
    pub fn new(limits: StepLimits) -> Stepper {
        Stepper { limits, reached: 0.0, length: limits.first.min(limits.max).min(1.0), cuts: 0 }
    }

    /// At the end of a path.
    pub fn at_end() -> Stepper {
        Stepper { limits: StepLimits { first: 0.0, max: 0.0, min: 0.0 }, reached: 1.0, length: 0.0, cuts: 0 }
    }

    /// The place on the path where the last solution is.
    pub fn reached(&self) -> f64 {
        self.reached
    }

    /// The place to try next, or `None` at the end of the path.
    pub fn next(&self) -> Option<f64> {
        if self.reached >= 1.0 {
            return None;
        }
        let next = self.reached + self.length;
        // no sliver at the end
        Some(if next > 1.0 - 1e-3 * self.length { 1.0 } else { next })
    }

    /// The step to `place` succeeded in `iterations`.
    pub fn succeeded(&mut self, place: f64, iterations: usize) {
        let taken = place - self.reached;
        self.reached = place;
        // hard steps are followed by shorter ones, easy ones by longer ones
        let factor = match iterations {
            0..=3 => 2.0,
            4..=5 => 1.4,
            6..=7 => 1.0,
            _ => 0.7,
        };
        self.length = (taken * factor).min(self.limits.max);
    }

    /// A solution at `place` was found in another way: the path goes on from there, carefully.
    pub fn resumed(&mut self, place: f64) {
        self.reached = place;
        self.length = self.limits.first.min(self.limits.max).min(1.0);
    }

    /// The step failed; `false` when no shorter step is allowed.
    pub fn failed(&mut self) -> bool {
        self.cuts += 1;
        self.length *= 0.4;
        self.length >= self.limits.min
    }

    /// How often a step was cut.
    pub fn cuts(&self) -> usize {
        self.cuts
    }

    /// The current length.
    pub fn length(&self) -> f64 {
        self.length
    }
}
