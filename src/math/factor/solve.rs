//! Forward and backward substitution over the fronts.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_unit_lower_triangular_in_place, solve_unit_upper_triangular_in_place};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};

use super::front::{Inverse, Panel};
use super::tree::{Front, Tree};

/// x <- (L B L^T)^-1 x for `columns` vectors in the order of elimination, stored one after the other.
pub(super) fn solve(tree: &Tree, panels: &[Panel], x: &mut [f64], columns: usize) {
    let n = tree.permutation.len();
    let widest = tree.fronts.iter().map(Front::width).max().unwrap_or(0);
    let highest = tree.fronts.iter().map(|front| front.below).max().unwrap_or(0);
    let mut exchanged = vec![0.0; widest];
    let (mut pivots, mut below) = (vec![0.0; widest * columns], vec![0.0; highest * columns]);
    for (front, panel) in tree.fronts.iter().zip(panels) {
        let (l11, l21) = panel.blocks(front);
        let pivots = &mut pivots[..front.width() * columns];
        let below = &mut below[..front.below * columns];
        for (x, pivots) in x.chunks(n).zip(pivots.chunks_mut(front.width())) {
            let x = &x[front.pivots.clone()];
            pivots.copy_from_slice(x);
        }
        for block in &front.pivot_blocks {
            for y in pivots.chunks_mut(front.width()) {
                exchanged[..block.len()].copy_from_slice(&y[block.clone()]);
                y[block.clone()]
                    .iter_mut()
                    .zip(&panel.exchanges[block.clone()])
                    .for_each(|(y, &from)| *y = exchanged[from]);
            }
            let y = MatMut::from_column_major_slice_mut(pivots, front.width(), columns);
            let (mut y, later) =
                y.subrows_mut(block.start, front.width() - block.start).split_at_row_mut(block.len());
            let (l, l_later) = l11
                .submatrix(block.start, block.start, front.width() - block.start, block.len())
                .split_at_row(block.len());
            solve_unit_lower_triangular_in_place(l, y.rb_mut(), Par::Seq);
            matmul(later, Accum::Add, l_later, y.rb(), -1.0, Par::Seq);
        }
        let y = MatRef::from_column_major_slice(pivots, front.width(), columns);
        let product = MatMut::from_column_major_slice_mut(below, front.below, columns);
        matmul(product, Accum::Replace, l21, y, 1.0, Par::Seq);
        if front.below > 0 {
            for (x, below) in x.chunks_mut(n).zip(below.chunks(front.below)) {
                let mut below = below;
                for run in &front.below_runs {
                    let (subtracted, rest) = below.split_at(run.len());
                    below = rest;
                    x[run.clone()].iter_mut().zip(subtracted).for_each(|(x, s)| *x -= s);
                }
            }
        }
        divide_by_pivots(l11, panel, pivots);
        for (x, pivots) in x.chunks_mut(n).zip(pivots.chunks(front.width())) {
            x[front.pivots.clone()].copy_from_slice(pivots);
        }
    }
    for (front, panel) in tree.fronts.iter().zip(panels).rev() {
        let (l11, l21) = panel.blocks(front);
        let pivots = &mut pivots[..front.width() * columns];
        let below = &mut below[..front.below * columns];
        for (x, pivots) in x.chunks(n).zip(pivots.chunks_mut(front.width())) {
            pivots.copy_from_slice(&x[front.pivots.clone()]);
        }
        let mut y = MatMut::from_column_major_slice_mut(pivots, front.width(), columns);
        if front.below > 0 {
            for (x, below) in x.chunks(n).zip(below.chunks_mut(front.below)) {
                let mut below = below;
                for run in &front.below_runs {
                    let (copied, rest) = below.split_at_mut(run.len());
                    below = rest;
                    copied.copy_from_slice(&x[run.clone()]);
                }
            }
            let below = MatRef::from_column_major_slice(below, front.below, columns);
            matmul(y.rb_mut(), Accum::Add, l21.transpose(), below, -1.0, Par::Seq);
        }
        for block in front.pivot_blocks.iter().rev() {
            let y = y.rb_mut().subrows_mut(block.start, front.width() - block.start);
            let (mut y, later) = y.split_at_row_mut(block.len());
            let (l, l_later) = l11
                .submatrix(block.start, block.start, front.width() - block.start, block.len())
                .split_at_row(block.len());
            matmul(y.rb_mut(), Accum::Add, l_later.transpose(), later.rb(), -1.0, Par::Seq);
            solve_unit_upper_triangular_in_place(l.transpose(), y.rb_mut(), Par::Seq);
            for column in 0..columns {
                let mut y = y.rb_mut().col_mut(column);
                exchanged.iter_mut().zip(y.rb().iter()).for_each(|(e, y)| *e = *y);
                panel.exchanges[block.clone()].iter().zip(&exchanged).for_each(|(&to, e)| y[to] = *e);
            }
        }
        for (x, pivots) in x.chunks_mut(n).zip(pivots.chunks(front.width())) {
            x[front.pivots.clone()].copy_from_slice(pivots);
        }
    }
}

/// y <- B^-1 y.
fn divide_by_pivots(l11: MatRef<'_, f64>, panel: &Panel, pivots: &mut [f64]) {
    let width = panel.subdiagonal.len();
    let mut j = 0;
    while j < width {
        let below = panel.subdiagonal[j];
        if below == 0.0 {
            let inverse = 1.0 / l11[(j, j)];
            pivots.chunks_mut(width).for_each(|y| y[j] *= inverse);
            j += 1;
        } else {
            let inverse = Inverse::new(l11[(j, j)], below, l11[(j + 1, j + 1)]);
            for y in pivots.chunks_mut(width) {
                [y[j], y[j + 1]] = inverse.apply(y[j], y[j + 1]);
            }
            j += 2;
        }
    }
}
