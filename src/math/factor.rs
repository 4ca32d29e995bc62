//! Factorisation of a symmetric indefinite matrix, and solves with it.
//!
//! ```text
//! P S A S P^T = L B L^T      S diagonal (equilibration), P permutation, B diagonal blocks of order 1 and 2
//! ```
//!
//! The structure of L depends on the pattern alone: [`Symbolic`] holds it, once per model. [`Factor`] holds numbers and
//! is refilled in place. Pivots are chosen within dense blocks of columns that share their structure (Bunch and
//! Kaufman 1977), so L never grows beyond what [`Symbolic`] predicts.
//!
//! Solves are refined against a matrix that may be newer than the factored one. Results have the same bits for any
//! number of threads.

use std::ops::AddAssign;
use std::sync::Arc;
use std::time::{Duration, Instant};

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SupernodalIntranodeLbltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, IntranodeLbltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::{Conj, MatMut, Par, Side};
use rayon::prelude::*;

use super::ordering::Ordering;
use super::refine;
use super::sparse::{BlockPattern, SymmetricMatrix};
use crate::{Error, Result};

/// Dense products run on the calling thread. faer can cut them, but the fronts of a thin body are so small that two
/// threads gain nothing, and the cut would change the bits.
const PARALLELISM: Par = Par::Seq;
/// Right-hand sides solved together by one thread.
const BATCH: usize = 8;
/// Passes of equilibration: a row with a zero diagonal gets its scale from the rows it couples to.
const EQUILIBRATION_PASSES: usize = 3;
/// A pivot of the equilibrated matrix below this is rounding, not a number.
const ZERO_PIVOT: f64 = 64.0 * f64::EPSILON;

/// The structure of the factor; computed once per pattern, shared by threads.
#[derive(Debug)]
pub struct Symbolic {
    pattern: Arc<BlockPattern>,
    cholesky: SymbolicCholesky<usize>,
    flops: f64,
    factor_nnz: usize,
}

impl Symbolic {
    /// Finds the structure of L for `pattern` eliminated in the order `ordering`.
    ///
    /// # Errors
    /// [`Error::FactorTooLarge`] if the structure does not fit into memory.
    pub fn new(pattern: Arc<BlockPattern>, ordering: &Ordering) -> Result<Arc<Self>> {
        let n = pattern.n();
        let mut inverse = vec![0; n];
        ordering.permutation.iter().enumerate().for_each(|(place, &unknown)| inverse[unknown] = place);
        let order = SymmetricOrdering::Custom(PermRef::new_checked(&ordering.permutation, &inverse, n));
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let factor_nnz = ordering.factor_nnz;
        let cholesky = factorize_symbolic_cholesky(pattern.as_faer(), Side::Lower, order, parameters)
            .map_err(|_| Error::FactorTooLarge { unknowns: n, entries: factor_nnz })?;
        Ok(Arc::new(Self { pattern, cholesky, flops: ordering.flops, factor_nnz }))
    }

    /// The pattern of the matrices that can be factored.
    pub fn pattern(&self) -> &Arc<BlockPattern> {
        &self.pattern
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
    /// Eigenvalues that cannot be told from zero in double precision after equilibration.
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
    /// S A S on the pattern of A.
    scaled: Vec<f64>,
    /// L and the diagonal of B, as faer lays them out.
    values: Vec<f64>,
    /// Entries of B below its diagonal.
    subdiagonal: Vec<f64>,
    /// Exchanges within supernodes: forward and inverse.
    pivots: (Vec<usize>, Vec<usize>),
    scratch: MemBuffer,
    inertia: Inertia,
    is_valid: bool,
    work: Work,
}

impl Factor {
    /// Reserves the memory; factors nothing yet.
    ///
    /// # Errors
    /// [`Error::FactorTooLarge`] if there is not enough.
    pub fn new(symbolic: Arc<Symbolic>) -> Result<Self> {
        let (n, entries) = (symbolic.pattern.n(), symbolic.factor_nnz);
        let too_large = || Error::FactorTooLarge { unknowns: n, entries };
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.cholesky.len_val()).map_err(|_| too_large())?;
        values.resize(symbolic.cholesky.len_val(), 0.0);
        let need = symbolic.cholesky.factorize_numeric_intranode_lblt_scratch::<f64>(PARALLELISM, Default::default());
        let scratch = MemBuffer::try_new(need).map_err(|_| too_large())?;
        Ok(Self {
            scale: vec![1.0; n],
            scaled: vec![0.0; symbolic.pattern.nnz()],
            values,
            subdiagonal: vec![0.0; n],
            pivots: ((0..n).collect(), (0..n).collect()),
            scratch,
            inertia: Inertia::default(),
            is_valid: n == 0,
            work: Work::default(),
            symbolic,
        })
    }

    /// Factors `a` in place of what was factored before.
    ///
    /// # Errors
    /// [`Error::NotFinite`] if a value of `a` is NaN or infinite, [`Error::Singular`] if a pivot vanishes. The factor
    /// then solves nothing until it is refilled.
    ///
    /// # Panics
    /// If `a` has another pattern.
    pub fn refactor(&mut self, a: &SymmetricMatrix) -> Result<()> {
        let start = Instant::now();
        assert!(Arc::ptr_eq(&a.pattern, &self.symbolic.pattern), "the matrix has the pattern of the factor");
        self.is_valid = false;
        if !a.values.iter().all(|value| value.is_finite()) {
            return Err(Error::NotFinite);
        }
        let pattern = &*self.symbolic.pattern;
        let n = pattern.n();
        if n > 0 {
            equilibrate(a, &mut self.scale);
            scale_symmetrically(a, &self.scale, &mut self.scaled);
            self.symbolic.cholesky.factorize_numeric_intranode_lblt(
                &mut self.values,
                &mut self.subdiagonal,
                &mut self.pivots.0,
                &mut self.pivots.1,
                SparseColMatRef::new(pattern.as_faer(), &self.scaled),
                Side::Lower,
                PARALLELISM,
                MemStack::new(&mut self.scratch),
                Default::default(),
            );
        }
        self.inertia = self.count_signs()?;
        self.is_valid = true;
        self.work.factorisations += 1;
        self.work.factor_flops += self.symbolic.flops;
        self.work.factor_time += start.elapsed();
        Ok(())
    }

    /// Solves A X = B for `columns` right-hand sides stored one after the other in `rhs`, in place.
    ///
    /// `a` may be newer than the factored matrix: the factor is then a preconditioner. Sweeps go on until the relative
    /// residual of every column is at most `tolerance` or no longer falls; see [`SolveQuality`].
    ///
    /// # Errors
    /// [`Error::NotFinite`] if `a` or `rhs` holds NaN or infinity, [`Error::NotFactored`] without a valid factor.
    ///
    /// # Panics
    /// If `a` has another pattern or `rhs` is not n times `columns` long.
    pub fn solve(
        &mut self,
        a: &SymmetricMatrix,
        rhs: &mut [f64],
        columns: usize,
        tolerance: f64,
    ) -> Result<SolveQuality> {
        let start = Instant::now();
        assert!(Arc::ptr_eq(&a.pattern, &self.symbolic.pattern), "the matrix has the pattern of the factor");
        assert!(rhs.len() == self.symbolic.pattern.n() * columns, "n x columns numbers");
        if !self.is_valid {
            return Err(Error::NotFactored);
        }
        let weights: Vec<f64> = self.scale.iter().map(|s| s * s).collect();
        let quality = refine::solve(a, |x| self.precondition(x), &weights, rhs, columns, tolerance)?;
        self.work.solves += columns;
        self.work.sweeps += quality.sweeps;
        self.work.solve_time += start.elapsed();
        Ok(quality)
    }

    /// x <- S P^T (L B L^T)^-1 P S x for each column.
    fn precondition(&self, x: &mut [f64]) {
        let n = self.scale.len();
        let cholesky = &self.symbolic.cholesky;
        let pivots = PermRef::new_checked(&self.pivots.0, &self.pivots.1, n);
        let factor = IntranodeLbltRef::new(cholesky, &self.values, &self.subdiagonal, pivots);
        let scale_rows = |x: &mut [f64]| {
            x.chunks_mut(n).for_each(|column| column.iter_mut().zip(&self.scale).for_each(|(x, s)| *x *= s));
        };
        x.par_chunks_mut(n * BATCH).for_each(|x| {
            let columns = x.len() / n;
            let mut scratch = MemBuffer::new(cholesky.solve_in_place_scratch::<f64>(columns, PARALLELISM));
            scale_rows(x);
            factor.solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(x, n, columns),
                PARALLELISM,
                MemStack::new(&mut scratch),
            );
            scale_rows(x);
        });
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

    /// Signs of the blocks of B.
    fn count_signs(&self) -> Result<Inertia> {
        let mut inertia = Inertia::default();
        let SymbolicCholeskyRaw::Supernodal(structure) = self.symbolic.cholesky.raw() else {
            return Ok(inertia); // only the empty matrix has no supernodes
        };
        let pivots = PermRef::new_checked(&self.pivots.0, &self.pivots.1, self.scale.len());
        let factor = SupernodalIntranodeLbltRef::new(structure, &self.values, &self.subdiagonal, pivots);
        for (supernode, &first) in structure.supernode_begin()[..structure.n_supernodes()].iter().enumerate() {
            let block = factor.supernode(supernode).val();
            let mut j = 0;
            while j < block.ncols() {
                let (d, below) = (block[(j, j)], self.subdiagonal[first + j]);
                // eigenvalues of a block of order 2 from its mean and its radius
                let order = if below == 0.0 { 1 } else { 2 };
                let (mean, radius) = match order {
                    1 => (d, 0.0),
                    _ => (0.5 * (d + block[(j + 1, j + 1)]), (0.5 * (d - block[(j + 1, j + 1)])).hypot(below)),
                };
                for eigenvalue in [mean + radius, mean - radius].into_iter().take(order) {
                    if !eigenvalue.is_finite() || eigenvalue == 0.0 {
                        return Err(Error::Singular { unknown: self.unknown_of_pivot(first + j) });
                    }
                    match eigenvalue {
                        value if value.abs() <= ZERO_PIVOT => inertia.zero += 1,
                        value if value > 0.0 => inertia.positive += 1,
                        _ => inertia.negative += 1,
                    }
                }
                j += order;
            }
        }
        Ok(inertia)
    }

    /// The unknown eliminated by the pivot at `place`.
    fn unknown_of_pivot(&self, place: usize) -> usize {
        let exchanged = self.pivots.0[place];
        self.symbolic.cholesky.perm().map_or(exchanged, |order| order.arrays().0[exchanged])
    }
}

/// s_i such that the largest |s_i a_ij s_j| of every row comes close to one (Ruiz 2001), rounded to powers of two.
///
/// ```text
/// s_i <- s_i / sqrt(max_j |s_i a_ij s_j|), repeated
/// ```
fn equilibrate(a: &SymmetricMatrix, scale: &mut [f64]) {
    let (col_ptr, row_idx) = (a.pattern.col_ptr(), a.pattern.row_idx());
    let mut largest = vec![0.0_f64; scale.len()];
    scale.fill(1.0);
    for _ in 0..EQUILIBRATION_PASSES {
        largest.fill(0.0);
        for j in 0..scale.len() {
            let entries = col_ptr[j]..col_ptr[j + 1];
            let mut largest_in_column = 0.0_f64;
            for (&i, &value) in row_idx[entries.clone()].iter().zip(&a.values[entries]) {
                let size = (scale[i] * value * scale[j]).abs();
                largest[i] = largest[i].max(size);
                largest_in_column = largest_in_column.max(size);
            }
            largest[j] = largest[j].max(largest_in_column);
        }
        for (s, &size) in scale.iter_mut().zip(&largest) {
            if size > 0.0 && size.is_finite() {
                *s /= size.sqrt();
            }
        }
    }
    scale.iter_mut().for_each(|s| *s = s.log2().round().exp2());
}

/// out = S A S.
fn scale_symmetrically(a: &SymmetricMatrix, scale: &[f64], out: &mut [f64]) {
    let (col_ptr, row_idx) = (a.pattern.col_ptr(), a.pattern.row_idx());
    for (j, s) in scale.iter().enumerate() {
        for entry in col_ptr[j]..col_ptr[j + 1] {
            out[entry] = scale[row_idx[entry]] * a.values[entry] * s;
        }
    }
}
