//! The work that solves take.

use crate::math::factor;

/// Work done, in counts and seconds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Work {
    /// Newton iterations, failed steps included.
    pub iterations: usize,
    /// Evaluations of energy and force in all elements.
    pub force_evaluations: usize,
    /// Evaluations with stiffness, each followed by an assembly.
    pub assemblies: usize,
    /// Steps of paths that failed and were cut.
    pub cuts: usize,
    /// Quadrature points evaluated, one count per term.
    pub points: Vec<usize>,
    /// Time in each term, summed over threads, s.
    pub term_seconds: Vec<f64>,
    /// Wall time of evaluations and assemblies, s.
    pub assembly_seconds: f64,
    /// Factorisations and solves.
    pub linear: factor::Work,
}

impl Work {
    /// Adds what was done elsewhere.
    pub fn add(&mut self, other: &Work) {
        self.iterations += other.iterations;
        self.force_evaluations += other.force_evaluations;
        self.assemblies += other.assemblies;
        self.cuts += other.cuts;
        self.points.resize(self.points.len().max(other.points.len()), 0);
        self.points.iter_mut().zip(&other.points).for_each(|(a, b)| *a += b);
        self.term_seconds.resize(self.term_seconds.len().max(other.term_seconds.len()), 0.0);
        self.term_seconds.iter_mut().zip(&other.term_seconds).for_each(|(a, b)| *a += b);
        self.assembly_seconds += other.assembly_seconds;
        self.linear += other.linear;
    }
}
