//! Symmetric matrices of small dense blocks on the diagonal and beside it: a chain, as the frames of a clip are.
//!
//! Elimination from both ends gives what the whole chain says of each block (Rauch, Tung and Striebel 1965):
//!   F_k = D_k - C_(k-1)^T F_(k-1)^-1 C_(k-1),   G_k = D_k - C_k G_(k+1)^-1 C_k^T,
//!   M_k = F_k + G_k - D_k is the inverse of block k of the inverse.
//! Variables that are fixed take no part: their rows and columns count only in the block that is asked for.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A block with those before it eliminated, and its factor without fixed variables.
type Eliminated = (DMatrix<f64>, Cholesky<f64, Dyn>);

/// The matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockTridiagonal {
    /// Blocks D_k on the diagonal, symmetric.
    pub diagonal: Vec<DMatrix<f64>>,
    /// Blocks C_k of the rows of block k and the columns of block k + 1.
    pub next: Vec<DMatrix<f64>>,
}

impl BlockTridiagonal {
    /// Zero, with blocks of these sizes.
    pub fn zeros(sizes: &[usize]) -> BlockTridiagonal {
        BlockTridiagonal {
            diagonal: sizes.iter().map(|n| DMatrix::zeros(*n, *n)).collect(),
            next: sizes.windows(2).map(|n| DMatrix::zeros(n[0], n[1])).collect(),
        }
    }

    /// Where each block begins, and the number of rows behind the last.
    pub fn starts(&self) -> Vec<usize> {
        let mut starts = vec![0];
        for block in &self.diagonal {
            starts.push(starts[starts.len() - 1] + block.nrows());
        }
        starts
    }

    /// The product with a vector.
    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        let starts = self.starts();
        let part = |k: usize| DVector::from_column_slice(&x[starts[k]..starts[k + 1]]);
        let row = |k: usize| {
            let mut sum = &self.diagonal[k] * part(k);
            if k > 0 {
                sum += self.next[k - 1].tr_mul(&part(k - 1));
            }
            if k < self.next.len() {
                sum += &self.next[k] * part(k + 1);
            }
            sum
        };
        (0..self.diagonal.len()).flat_map(|k| row(k).iter().copied().collect::<Vec<_>>()).collect()
    }

    /// The x of A x = b among those that are `free`, the others 0; `None` where the matrix is not positive there.
    pub fn solve(&self, free: &[bool], b: &[f64]) -> Option<Vec<f64>> {
        let starts = self.starts();
        let forward = self.forward(free)?;
        let masked = |k: usize| {
            DVector::from_iterator(
                starts[k + 1] - starts[k],
                (starts[k]..starts[k + 1]).map(|i| if free[i] { b[i] } else { 0.0 }),
            )
        };
        let mut y: Vec<DVector<f64>> = Vec::new();
        for k in 0..self.diagonal.len() {
            let mut right = masked(k);
            if k > 0 {
                right -= self.link(k - 1, free, [true, true]).tr_mul(&forward[k - 1].1.solve(&y[k - 1]));
            }
            y.push(right);
        }
        let mut x: Vec<DVector<f64>> = vec![DVector::zeros(0); self.diagonal.len()];
        for k in (0..self.diagonal.len()).rev() {
            let mut right = y[k].clone();
            if k + 1 < self.diagonal.len() {
                right -= self.link(k, free, [true, true]) * &x[k + 1];
            }
            x[k] = forward[k].1.solve(&right);
        }
        Some(x.iter().flat_map(|x| x.iter().copied()).collect())
    }

    /// M_k of every block: what is known of it with all others eliminated, those that are `free`; its own variables stay, fixed
    /// or not. `None` where the matrix is not positive.
    pub fn marginals(&self, free: &[bool]) -> Option<Vec<DMatrix<f64>>> {
        let forward = self.forward(free)?;
        let turned = self.turned();
        let free_turned: Vec<bool> = {
            let starts = self.starts();
            (0..self.diagonal.len()).rev().flat_map(|k| free[starts[k]..starts[k + 1]].to_vec()).collect()
        };
        let mut backward = turned.forward(&free_turned)?;
        backward.reverse();
        let of = |k: usize| &forward[k].0 + &backward[k].0 - &self.diagonal[k];
        Some((0..self.diagonal.len()).map(of).collect())
    }

    /// F_k of every block with its own fixed variables in it, and the factor of it without them.
    fn forward(&self, free: &[bool]) -> Option<Vec<Eliminated>> {
        let starts = self.starts();
        let mut all: Vec<Eliminated> = Vec::new();
        for k in 0..self.diagonal.len() {
            let mut whole = self.diagonal[k].clone();
            if k > 0 {
                let link = self.link(k - 1, free, [true, false]);
                whole -= link.tr_mul(&all[k - 1].1.solve(&link));
            }
            let own = &free[starts[k]..starts[k + 1]];
            let masked = DMatrix::from_fn(own.len(), own.len(), |a, b| match own[a] && own[b] {
                true => whole[(a, b)],
                false if a == b => 1.0,
                false => 0.0,
            });
            all.push((whole, masked.cholesky()?));
        }
        Some(all)
    }

    /// C_k without the rows, or the columns, of fixed variables.
    fn link(&self, k: usize, free: &[bool], [rows, columns]: [bool; 2]) -> DMatrix<f64> {
        let starts = self.starts();
        let block = &self.next[k];
        DMatrix::from_fn(block.nrows(), block.ncols(), |a, b| {
            let kept = (!rows || free[starts[k] + a]) && (!columns || free[starts[k + 1] + b]);
            if kept { block[(a, b)] } else { 0.0 }
        })
    }

    /// The chain from its other end.
    fn turned(&self) -> BlockTridiagonal {
        BlockTridiagonal {
            diagonal: self.diagonal.iter().rev().cloned().collect(),
            next: self.next.iter().rev().map(DMatrix::transpose).collect(),
        }
    }

    /// The largest entry on the diagonal.
    pub fn largest(&self) -> f64 {
        self.diagonal
            .iter()
            .flat_map(|block| block.diagonal().iter().copied().collect::<Vec<_>>())
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain() -> (BlockTridiagonal, DMatrix<f64>) {
        let sizes = [2, 3, 1, 2];
        let mut matrix = BlockTridiagonal::zeros(&sizes);
        let starts = matrix.starts();
        let n = starts[4];
        let wave = |a: usize, b: usize| ((3 * a.min(b) + 7 * a.max(b)) as f64).sin();
        let block_of = |i: usize| starts.iter().rposition(|start| *start <= i).unwrap_or(0);
        let dense = DMatrix::from_fn(n, n, |a, b| match block_of(a).abs_diff(block_of(b)) {
            0 | 1 => wave(a, b) + if a == b { 6.0 } else { 0.0 },
            _ => 0.0,
        });
        for k in 0..4 {
            matrix.diagonal[k] = dense.view((starts[k], starts[k]), (sizes[k], sizes[k])).into_owned();
            if k < 3 {
                matrix.next[k] = dense.view((starts[k], starts[k + 1]), (sizes[k], sizes[k + 1])).into_owned();
            }
        }
        (matrix, dense)
    }

    #[test]
    fn products_solutions_and_marginals_are_those_of_the_dense_matrix() {
        let (matrix, dense) = chain();
        let n = dense.nrows();
        let b: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let product = &dense * DVector::from_column_slice(&b);
        assert!(matrix.times(&b).iter().zip(product.iter()).all(|(a, b)| (a - b).abs() < 1e-13));

        let mut free = vec![true; n];
        (free[1], free[3]) = (false, false);
        let kept: Vec<usize> = (0..n).filter(|i| free[*i]).collect();
        let part = dense.select_rows(&kept).select_columns(&kept);
        let right = DVector::from_iterator(kept.len(), kept.iter().map(|i| b[*i]));
        let x = part.clone().cholesky().expect("positive").solve(&right);
        let found = matrix.solve(&free, &b).expect("positive");
        assert!(kept.iter().zip(x.iter()).all(|(i, x)| (found[*i] - x).abs() < 1e-13));
        assert_eq!((found[1], found[3]), (0.0, 0.0));

        // block 0 with its fixed variable: all but block 0 eliminated
        let marginals = matrix.marginals(&free).expect("positive");
        let own = [0, 1];
        let others: Vec<usize> = (2..n).filter(|i| free[*i]).collect();
        let across = dense.select_rows(&own).select_columns(&others);
        let inner = dense.select_rows(&others).select_columns(&others).cholesky().expect("positive");
        let schur = dense.view((0, 0), (2, 2)) - &across * inner.solve(&across.transpose());
        assert!((&marginals[0] - schur).amax() < 1e-13);
        // with all free it is the inverse of the block of the inverse
        let marginals = matrix.marginals(&vec![true; n]).expect("positive");
        let inverse = dense.try_inverse().expect("regular");
        let block = inverse.view((2, 2), (3, 3)).into_owned().try_inverse().expect("regular");
        assert!((&marginals[1] - block).amax() < 1e-12);
    }
}
