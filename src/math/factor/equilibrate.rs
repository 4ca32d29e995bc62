//! Scaling of rows and columns, so that pivots of unlike units can be compared.

use std::ops::Range;

use rayon::prelude::*;

use crate::math::sparse::SymmetricMatrix;

/// A row with a zero diagonal gets its scale from the rows it couples to.
const PASSES: usize = 3;
/// Partial maxima, because one would wait for itself at every entry.
const LANES: usize = 8;

/// s_i such that the largest |s_i a_ij s_j| of every row comes close to one (Ruiz 2001), rounded to powers of two.
///
/// ```text
/// s_i <- s_i / sqrt(max_j |s_i a_ij s_j|), repeated
/// ```
pub(super) fn equilibrate(a: &SymmetricMatrix, scale: &mut [f64]) {
    let parts = a.pattern.parts();
    scale.fill(1.0);
    for _ in 0..PASSES {
        // a maximum is the same in any order
        let maxima: Vec<_> = parts.par_iter().map(|groups| row_maxima(a, scale, groups.clone())).collect();
        let mut largest = vec![0.0_f64; scale.len()];
        for maxima in maxima {
            largest.iter_mut().zip(maxima).for_each(|(all, part)| *all = all.max(part));
        }
        for (s, size) in scale.iter_mut().zip(largest) {
            if size > 0.0 && size.is_finite() {
                *s /= size.sqrt();
            }
        }
    }
    scale.iter_mut().for_each(|s| *s = s.log2().round().exp2());
}

/// max_j |s_i a_ij s_j| over the columns of `groups` and their mirror images.
fn row_maxima(a: &SymmetricMatrix, scale: &[f64], groups: Range<usize>) -> Vec<f64> {
    let pattern = &*a.pattern;
    let mut largest = vec![0.0_f64; scale.len()];
    let mut runs = Vec::new();
    for g in groups {
        pattern.row_runs(g, &mut runs);
        let own = pattern.unknowns(g);
        for j in own.clone() {
            let mut entries = &a.values[pattern.col_ptr()[j]..pattern.col_ptr()[j + 1]];
            let s = scale[j];
            let mut largest_in_column = [0.0_f64; LANES];
            for rows in std::iter::once(j..own.end).chain(runs.iter().cloned()) {
                let (block, rest) = entries.split_at(rows.len());
                entries = rest;
                let in_rows = &mut largest[rows.clone()];
                for ((block, scale), in_rows) in
                    block.chunks(LANES).zip(scale[rows].chunks(LANES)).zip(in_rows.chunks_mut(LANES))
                {
                    for (((&value, &t), largest), in_column) in
                        block.iter().zip(scale).zip(in_rows).zip(&mut largest_in_column)
                    {
                        let size = (t * value * s).abs();
                        *largest = if size > *largest { size } else { *largest };
                        *in_column = if size > *in_column { size } else { *in_column };
                    }
                }
            }
            largest[j] = largest_in_column.into_iter().fold(largest[j], f64::max);
        }
    }
    largest
}
