//! Factorisation of a symmetric indefinite matrix, and solves with it.
//!
//! ```text
//! P S A S P^T = L B L^T      S diagonal (equilibration), P permutation, B diagonal blocks of order 1 and 2
//! ```
//!
//! The structure of L depends on the pattern alone: [`Symbolic`] holds it, once per model. [`Factor`] holds numbers and
//! is refilled in place. Unknowns are eliminated in dense fronts along a tree (Duff and Reid 1983); pivots are chosen
//! within blocks of a front (Bunch and Kaufman 1977), so L never grows beyond what [`Symbolic`] predicts. Threads share
//! the subtrees, and the strips of large fronts; who computes what does not change how it is computed.
//!
//! Solves are refined against a matrix that may be newer than the factored one. Results have the same bits for any
//! number of threads.

use std::ops::AddAssign;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::ordering::Ordering;
use super::refine;
use super::sparse::{BlockPattern, SymmetricMatrix};
use crate::{Error, Result};
use equilibrate::equilibrate;
use front::{Contribution, Panel, Pool, Source};
use scalar::Scalar;
use tree::{Front, Tree};

pub use scalar::Precision;

mod equilibrate;
mod front;
mod scalar;
mod solve;
mod tree;

/// Right-hand sides solved together by one thread.
const BATCH: usize = 16;
/// Numbers checked together by one thread.
const CHECKED: usize = 1 << 16;
/// A pivot of the equilibrated matrix below so many units of rounding is rounding, not a number.
const ZERO_PIVOT: f64 = 64.0;

/// The structure of the factor; computed once per pattern, shared by threads.
#[derive(Debug)]
pub struct Symbolic {
    pattern: Arc<BlockPattern>,
    tree: Tree,
    flops: f64,
    factor_nnz: usize,
}

impl Symbolic {
    /// Finds the structure of L for `pattern` eliminated in the order `ordering`.
    ///
    /// # Errors
    /// [`Error::FactorTooLarge`] if the numbers of the factor could not be addressed.
    pub fn new(pattern: Arc<BlockPattern>, ordering: &Ordering) -> Result<Arc<Self>> {
        let tree = Tree::new(&pattern, ordering);
        let symbolic = Self { pattern, tree, flops: ordering.flops, factor_nnz: ordering.factor_nnz };
        let entries = |sum: usize, front: &Front| sum.checked_add(front.width().checked_mul(front.height())?);
        match symbolic.tree.fronts.iter().try_fold(0, entries) {
            Some(entries) if entries <= isize::MAX as usize / size_of::<f64>() => Ok(Arc::new(symbolic)),
            _ => Err(symbolic.too_large()),
        }
    }

    /// The pattern of the matrices that can be factored.
    pub fn pattern(&self) -> &Arc<BlockPattern> {
        &self.pattern
    }

    fn too_large(&self) -> Error {
        Error::FactorTooLarge { unknowns: self.pattern.n(), entries: self.factor_nnz }
    }

    /// Entries of L with its diagonal.
    pub fn factor_nnz(&self) -> usize {
        self.factor_nnz
    }

    /// Operations of one factorisation, an addition and a multiplication counted as two.
    pub fn flops(&self) -> f64 {
        self.flops
    }
}

/// Signs of the eigenvalues of the factored matrix, by Sylvester's law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inertia {
    /// Positive eigenvalues.
    pub positive: usize,
    /// Negative eigenvalues.
    pub negative: usize,
    /// Eigenvalues that cannot be told from zero in the precision of the factor after equilibration.
    pub zero: usize,
}

/// How good a solution is and what it took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveQuality {
    /// Largest |S (b - A x)| / |S b| over the right-hand sides, with S the equilibration and Euclidean norms.
    pub residual: f64,
    /// Solves with the factor after the first one.
    pub sweeps: usize,
}

/// Work done; add up with `+=`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Numeric factorisations.
    pub factorisations: usize,
    /// Right-hand sides solved.
    pub solves: usize,
    /// Refinement sweeps, each one solve and one product for all right-hand sides of a call.
    pub sweeps: usize,
    /// Operations of the factorisations.
    pub factor_flops: f64,
    /// Wall time of the factorisations.
    pub factor_time: Duration,
    /// Wall time of the solves.
    pub solve_time: Duration,
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.factorisations += other.factorisations;
        self.solves += other.solves;
        self.sweeps += other.sweeps;
        self.factor_flops += other.factor_flops;
        self.factor_time += other.factor_time;
        self.solve_time += other.solve_time;
    }
}

/// The numbers of L, B and S, and the memory to compute them; one per thread of work, refilled in place.
pub struct Factor {
    symbolic: Arc<Symbolic>,
    /// s_i, powers of two: scaling rounds nothing.
    scale: Vec<f64>,
    numbers: Numbers,
    inertia: Inertia,
    is_valid: bool,
    work: Work,
}

/// L and B in one precision or the other.
enum Numbers {
    Double(Fronts<f64>),
    Single(Fronts<f32>),
}

/// L and B of every front, and memory that they share.
struct Fronts<T> {
    panels: Vec<Panel<T>>,
    pool: Pool<T>,
}

impl Factor {
    /// Reserves the memory; factors nothing yet.
    ///
    /// # Errors
    /// [`Error::FactorTooLarge`] if there is not enough.
    pub fn new(symbolic: Arc<Symbolic>, precision: Precision) -> Result<Self> {
        let n = symbolic.pattern.n();
        let numbers = match precision {
            Precision::Double => Fronts::new(&symbolic.tree).map(Numbers::Double),
            Precision::Single => Fronts::new(&symbolic.tree).map(Numbers::Single),
        };
        Ok(Self {
            scale: vec![1.0; n],
            numbers: numbers.ok_or_else(|| symbolic.too_large())?,
            inertia: Inertia::default(),
            is_valid: n == 0,
            work: Work::default(),
            symbolic,
        })
    }

    /// Factors `a` in place of what was factored before.
    ///
    /// # Errors
    /// [`Error::NotFinite`] if a value of `a` is NaN or infinite, [`Error::Singular`] if a pivot vanishes,
    /// [`Error::FactorTooLarge`] if there is no memory for the fronts. The factor then solves nothing until it is
    /// refilled.
    ///
    /// # Panics
    /// If `a` has another pattern.
    pub fn refactor(&mut self, a: &SymmetricMatrix) -> Result<()> {
        let start = Instant::now();
        assert!(Arc::ptr_eq(&a.pattern, &self.symbolic.pattern), "the matrix has the pattern of the factor");
        self.is_valid = false;
        let is_finite = |values: &[f64]| values.iter().fold(true, |all, value| all & value.is_finite());
        if !a.values.par_chunks(CHECKED).all(is_finite) {
            return Err(Error::NotFinite);
        }
        equilibrate(a, &mut self.scale);
        let (tree, scale) = (&self.symbolic.tree, self.scale.as_slice());
        let inertia = match &mut self.numbers {
            Numbers::Double(fronts) => fronts.factor(tree, a, scale),
            Numbers::Single(fronts) => fronts.factor(tree, a, scale),
        };
        self.inertia = inertia.ok_or_else(|| self.symbolic.too_large())??;
        self.is_valid = true;
        self.work.factorisations += 1;
        self.work.factor_flops += self.symbolic.flops;
        self.work.factor_time += start.elapsed();
        Ok(())
    }

    /// Solves A X = B for `columns` right-hand sides stored one after the other in `rhs`, in place.
    ///
    /// `a` may be newer than the factored matrix, and of another pattern: the factor is then a preconditioner. Sweeps go on
    /// until the relative residual of every column is at most `tolerance` or no longer falls; see [`SolveQuality`].
    ///
    /// # Errors
    /// [`Error::NotFinite`] if `a` or `rhs` holds NaN or infinity, [`Error::NotFactored`] without a valid factor.
    ///
    /// # Panics
    /// If `a` has another order or `rhs` is not n times `columns` long.
    pub fn solve(
        &mut self,
        a: &SymmetricMatrix,
        rhs: &mut [f64],
        columns: usize,
        tolerance: f64,
    ) -> Result<SolveQuality> {
        self.solve_within(a, rhs, columns, tolerance, refine::MOST_SWEEPS)
    }

    /// The same with no more than so many sweeps: for a factor that is old.
    ///
    /// # Errors
    /// # Panics
    /// As [`Factor::solve`].
    pub fn solve_within(
        &mut self,
        a: &SymmetricMatrix,
        rhs: &mut [f64],
        columns: usize,
        tolerance: f64,
        sweeps: usize,
    ) -> Result<SolveQuality> {
        let start = Instant::now();
        assert!(a.pattern.n() == self.symbolic.pattern.n(), "the matrix has the order of the factor");
        assert!(rhs.len() == self.symbolic.pattern.n() * columns, "n x columns numbers");
        if !self.is_valid {
            return Err(Error::NotFactored);
        }
        let weights: Vec<f64> = self.scale.iter().map(|s| s * s).collect();
        let quality = refine::solve(a, |x| self.precondition(x), &weights, rhs, columns, (tolerance, sweeps))?;
        self.work.solves += columns;
        self.work.sweeps += quality.sweeps;
        self.work.solve_time += start.elapsed();
        Ok(quality)
    }

    /// x <- S P^T (L B L^T)^-1 P S x for each column.
    fn precondition(&self, x: &mut [f64]) {
        let tree = &self.symbolic.tree;
        match &self.numbers {
            Numbers::Double(fronts) => fronts.precondition(tree, &self.scale, x),
            Numbers::Single(fronts) => fronts.precondition(tree, &self.scale, x),
        }
    }

    /// Signs of the eigenvalues of the matrix last factored.
    pub fn inertia(&self) -> Inertia {
        self.inertia
    }

    /// Operations of one factorisation.
    pub fn flops(&self) -> f64 {
        self.symbolic.flops
    }

    /// The structure that this factor fills.
    pub fn symbolic(&self) -> &Arc<Symbolic> {
        &self.symbolic
    }

    /// What this factor has done since it was made.
    pub fn work(&self) -> Work {
        self.work
    }
}

impl<T: Scalar> Fronts<T> {
    /// Reserves the memory of the panels; `None` if there is not enough.
    fn new(tree: &Tree) -> Option<Self> {
        let panels = tree.fronts.iter().map(Panel::new).collect::<Option<_>>()?;
        Some(Fronts { panels, pool: Pool::default() })
    }

    /// S A S in fronts; `None` if there is no memory for them.
    fn factor(&mut self, tree: &Tree, matrix: &SymmetricMatrix, scale: &[f64]) -> Option<Result<Inertia>> {
        let source = Source { matrix, scale, pool: &self.pool };
        let mut rest = self.panels.as_mut_slice();
        let mut trees = Vec::new();
        for &root in &tree.roots {
            let (panels, others) = rest.split_at_mut(root + 1 - tree.fronts[root].first);
            trees.push((root, panels));
            rest = others;
        }
        let done: Option<Vec<_>> =
            trees.into_par_iter().map(|(root, panels)| factor_subtree(&source, tree, root, panels)).collect();
        for contribution in done? {
            source.release(contribution);
        }
        Some(self.count_signs(tree))
    }

    /// x <- S P^T (L B L^T)^-1 P S x for each column.
    fn precondition(&self, tree: &Tree, scale: &[f64], x: &mut [f64]) {
        let n = scale.len();
        let order = &tree.permutation;
        x.par_chunks_mut(n * BATCH).for_each(|x| {
            let columns = x.len() / n;
            let mut permuted = vec![T::default(); x.len()];
            for (column, x) in x.chunks(n).enumerate() {
                let rows = permuted.iter_mut().skip(column).step_by(columns);
                rows.zip(order).for_each(|(y, &i)| *y = T::round(scale[i] * x[i]));
            }
            solve::solve(tree, &self.panels, &mut permuted, columns);
            for (column, x) in x.chunks_mut(n).enumerate() {
                let rows = permuted.iter().skip(column).step_by(columns);
                rows.zip(order).for_each(|(y, &i)| x[i] = scale[i] * y.widen());
            }
        });
    }

    /// Signs of the blocks of B.
    fn count_signs(&self, tree: &Tree) -> Result<Inertia> {
        let mut inertia = Inertia::default();
        let zero = ZERO_PIVOT * T::epsilon_impl().widen();
        for (front, panel) in tree.fronts.iter().zip(&self.panels) {
            let (block, _) = panel.blocks(front);
            let mut j = 0;
            while j < front.width() {
                let (d, below) = (block[(j, j)].widen(), panel.subdiagonal[j].widen());
                // eigenvalues of a block of order 2 from its mean and its radius
                let order = if below == 0.0 { 1 } else { 2 };
                let (mean, radius) = match order {
                    1 => (d, 0.0),
                    _ => {
                        let next = block[(j + 1, j + 1)].widen();
                        (0.5 * (d + next), (0.5 * (d - next)).hypot(below))
                    }
                };
                for eigenvalue in [mean + radius, mean - radius].into_iter().take(order) {
                    if !eigenvalue.is_finite() || eigenvalue == 0.0 {
                        let start = front.pivot_blocks.iter().map(|block| block.start).rfind(|&start| start <= j);
                        let first = front.pivots.start + start.unwrap_or(0);
                        let unknown = tree.permutation[first + panel.exchanges[j]];
                        return Err(Error::Singular { unknown });
                    }
                    match eigenvalue {
                        value if value.abs() <= zero => inertia.zero += 1,
                        value if value > 0.0 => inertia.positive += 1,
                        _ => inertia.negative += 1,
                    }
                }
                j += order;
            }
        }
        Ok(inertia)
    }
}

/// Factors the subtree that ends with front `root` and returns its contribution; `None` if there is no memory.
///
/// Below `root`, the first front with two or more heavy children lets the threads of the pool share these; all fronts
/// that remain come after them and are factored one after the other. `panels` are those of the subtree.
fn factor_subtree<T: Scalar>(
    source: &Source<'_, T>,
    tree: &Tree,
    root: usize,
    panels: &mut [Panel<T>],
) -> Option<Contribution<T>> {
    let (heavy, next) = tree.branch(root);
    let mut rest = panels;
    let mut parts = Vec::new();
    for &child in heavy {
        let (panels, others) = rest.split_at_mut(child + 1 - tree.fronts[child].first);
        parts.push((child, panels));
        rest = others;
    }
    let heavy: Vec<_> =
        parts.into_par_iter().map(|(child, panels)| factor_subtree(source, tree, child, panels)).collect();
    let mut waiting = heavy.into_iter().collect::<Option<Vec<_>>>()?;
    for (f, panel) in (next..=root).zip(rest) {
        let front = &tree.fronts[f];
        let contributions = waiting.split_off(waiting.len() - front.children.len());
        let children = front.children.iter().map(|&child| &tree.fronts[child]).zip(contributions).collect();
        waiting.push(source.factor(front, panel, children)?);
    }
    waiting.pop()
}
