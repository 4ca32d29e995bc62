//! The sparse symmetric matrices of a space: one row and column per parameter.

use super::space::Space;
use crate::error::{Error, Result};
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Mat, Side};

/// Where the pairs of parameters of every element stand in the lower triangle of a sparse matrix.
pub struct Pattern {
    parameters: usize,
    symbolic: SymbolicSparseColMat<usize>,
    factor: SymbolicLlt<usize>,
    diagonal: Vec<usize>,
}

fn failed(error: impl std::fmt::Debug) -> Error {
    Error::FibreSystem { message: format!("{error:?}").into() }
}

impl Pattern {
    /// The pattern of a space.
    ///
    /// # Errors
    /// [`Error::FibreSystem`] where there is no memory for it.
    pub fn new(space: &Space) -> Result<Pattern> {
        let parameters = space.parameters;
        let mut below: Vec<Vec<usize>> = (0..parameters).map(|parameter| vec![parameter]).collect();
        for element in 0..space.elements() {
            let terms = (0..space.functions()).flat_map(|a| space.map.terms(element, a));
            let mut of_element: Vec<usize> = terms.map(|term| term.global as usize).collect();
            of_element.sort_unstable();
            of_element.dedup();
            for (k, p) in of_element.iter().enumerate() {
                below[*p].extend(&of_element[k + 1..]);
            }
        }
        let mut starts = vec![0];
        for rows in &mut below {
            rows.sort_unstable();
            rows.dedup();
            starts.push(starts[starts.len() - 1] + rows.len());
        }
        let diagonal = starts[..parameters].to_vec();
        let symbolic = SymbolicSparseColMat::new_checked(parameters, parameters, starts, None, below.concat());
        let factor = SymbolicLlt::try_new(symbolic.as_ref(), Side::Lower).map_err(failed)?;
        Ok(Pattern { parameters, symbolic, factor, diagonal })
    }

    /// The number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// A matrix of zeros: the numbers of its lower triangle.
    pub fn zeros(&self) -> Vec<f64> {
        vec![0.0; self.symbolic.row_idx().len()]
    }

    /// The place of a pair of parameters of one element.
    fn place(&self, p: usize, q: usize) -> usize {
        let (column, row) = (p.min(q), p.max(q));
        let (starts, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        starts[column] + rows[starts[column]..starts[column + 1]].binary_search(&row).unwrap_or_default()
    }

    /// Adds the symmetric matrix of an element, by its functions, to one of angle `k`.
    pub fn scatter(&self, space: &Space, element: usize, k: usize, of: impl Fn(usize, usize) -> f64, to: &mut [f64]) {
        for i in 0..space.functions() {
            for j in 0..space.functions() {
                let value = space.sign(element, i, k) * space.sign(element, j, k) * of(i, j);
                for s in space.map.terms(element, i) {
                    // once per pair of parameters; functions that share a parameter count both ways
                    for t in space.map.terms(element, j).iter().filter(|t| s.global >= t.global) {
                        to[self.place(s.global as usize, t.global as usize)] += s.scale * t.scale * value;
                    }
                }
            }
        }
    }

    /// The trace of a matrix.
    pub fn trace(&self, values: &[f64]) -> f64 {
        self.diagonal.iter().map(|place| values[*place]).sum()
    }

    /// y = M x for a symmetric matrix.
    pub fn apply(&self, values: &[f64], x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.parameters];
        let (starts, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        for column in 0..self.parameters {
            for place in starts[column]..starts[column + 1] {
                let row = rows[place];
                y[row] += values[place] * x[column];
                if row != column {
                    y[column] += values[place] * x[row];
                }
            }
        }
        y
    }

    /// The factors of H + lambda K, in which the rows and columns of fixed parameters are those of the identity.
    ///
    /// # Errors
    /// [`Error::FibreSystem`] where it is not positive definite: a value is not finite.
    pub fn factor(&self, data: &[f64], lambda: f64, smooth: &[f64], fixed: &[bool]) -> Result<Llt<usize, f64>> {
        let mut values: Vec<f64> = data.iter().zip(smooth).map(|(h, k)| h + lambda * k).collect();
        // what nothing determines, not even its neighbours, stays where it is
        let ridge = 1e-14 * (self.trace(&values) / self.parameters as f64).max(f64::MIN_POSITIVE);
        let (starts, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        for column in 0..self.parameters {
            for place in starts[column]..starts[column + 1] {
                if fixed[column] || fixed[rows[place]] {
                    values[place] = if rows[place] == column { 1.0 } else { 0.0 };
                }
            }
            values[starts[column]] += ridge;
        }
        let matrix = SparseColMatRef::new(self.symbolic.as_ref(), &values);
        Llt::try_new_with_symbolic(self.factor.clone(), matrix, Side::Lower).map_err(failed)
    }
}

/// Solves for one right side.
pub fn solve(factor: &Llt<usize, f64>, right: &[f64]) -> Vec<f64> {
    let mut x = Mat::from_fn(right.len(), 1, |i, _| right[i]);
    factor.solve_in_place(x.as_mut());
    (0..right.len()).map(|i| x[(i, 0)]).collect()
}
