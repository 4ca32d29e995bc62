//! Forward and backward substitution over the fronts.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_unit_lower_triangular_in_place, solve_unit_upper_triangular_in_place};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};

use super::front::{Inverse, Panel};
use super::scalar::Scalar;
use super::tree::{Front, Tree};

/// x <- (L B L^T)^-1 x for `columns` vectors in the order of elimination, stored one after the other.
pub(super) fn solve<T: Scalar>(tree: &Tree, panels: &[Panel<T>], x: &mut [T], columns: usize) {
    let n = tree.permutation.len();
    let largest = |rows: fn(&Front) -> usize| tree.fronts.iter().map(rows).max().unwrap_or(0);
    let mut pivots = vec![T::default(); largest(Front::width) * columns];
    let mut below = vec![T::default(); largest(|front| front.below) * columns];
    for (front, panel) in tree.fronts.iter().zip(panels) {
        let y = &mut pivots[..front.width() * columns];
        let z = &mut below[..front.below * columns];
        copy_pivots(front, x, n, y);
        forward(front, panel, y, z, columns);
        for_each_run(front, n, x, z, |x, z| x.iter_mut().zip(z).for_each(|(x, z)| *x -= *z));
        divide_by_pivots(front, panel, y);
        write_pivots(front, y, x, n);
    }
    for (front, panel) in tree.fronts.iter().zip(panels).rev() {
        let y = &mut pivots[..front.width() * columns];
        let z = &mut below[..front.below * columns];
        copy_pivots(front, x, n, y);
        for_each_run(front, n, x, z, |x, z| z.copy_from_slice(x));
        backward(front, panel, y, z, columns);
        write_pivots(front, y, x, n);
    }
}

/// y <- L11^-1 y, z <- L21 y, with the exchanges of each block of pivots before its elimination.
fn forward<T: Scalar>(front: &Front, panel: &Panel<T>, y: &mut [T], z: &mut [T], columns: usize) {
    let (l11, l21) = panel.blocks(front);
    let width = front.width();
    let mut y = MatMut::from_column_major_slice_mut(y, width, columns);
    let mut before = Vec::new();
    for block in &front.pivot_blocks {
        let (start, len) = (block.start, block.len());
        let (mut y, later) = y.rb_mut().subrows_mut(start, width - start).split_at_row_mut(len);
        for mut y in y.rb_mut().col_iter_mut() {
            before.clear();
            before.extend(y.rb().iter());
            y.rb_mut().iter_mut().zip(&panel.exchanges[block.clone()]).for_each(|(y, &from)| *y = before[from]);
        }
        let (l, l_later) = l11.submatrix(start, start, width - start, len).split_at_row(len);
        solve_unit_lower_triangular_in_place(l, y.rb_mut(), Par::Seq);
        matmul(later, Accum::Add, l_later, y.rb(), T::round(-1.0), Par::Seq);
    }
    let z = MatMut::from_column_major_slice_mut(z, front.below, columns);
    matmul(z, Accum::Replace, l21, y.rb(), T::round(1.0), Par::Seq);
}

/// y <- L11^-T (y - L21^T z), the exchanges of each block of pivots undone after it.
fn backward<T: Scalar>(front: &Front, panel: &Panel<T>, y: &mut [T], z: &[T], columns: usize) {
    let (l11, l21) = panel.blocks(front);
    let width = front.width();
    let mut y = MatMut::from_column_major_slice_mut(y, width, columns);
    let z = MatRef::from_column_major_slice(z, front.below, columns);
    matmul(y.rb_mut(), Accum::Add, l21.transpose(), z, T::round(-1.0), Par::Seq);
    let mut before = Vec::new();
    for block in front.pivot_blocks.iter().rev() {
        let (start, len) = (block.start, block.len());
        let (mut y, later) = y.rb_mut().subrows_mut(start, width - start).split_at_row_mut(len);
        let (l, l_later) = l11.submatrix(start, start, width - start, len).split_at_row(len);
        matmul(y.rb_mut(), Accum::Add, l_later.transpose(), later.rb(), T::round(-1.0), Par::Seq);
        solve_unit_upper_triangular_in_place(l.transpose(), y.rb_mut(), Par::Seq);
        for mut y in y.col_iter_mut() {
            before.clear();
            before.extend(y.rb().iter());
            panel.exchanges[block.clone()].iter().zip(&before).for_each(|(&to, value)| y[to] = *value);
        }
    }
}

fn copy_pivots<T: Copy>(front: &Front, x: &[T], n: usize, y: &mut [T]) {
    let pivots = front.pivots.clone();
    x.chunks(n).zip(y.chunks_mut(front.width())).for_each(|(x, y)| y.copy_from_slice(&x[pivots.clone()]));
}

fn write_pivots<T: Copy>(front: &Front, y: &[T], x: &mut [T], n: usize) {
    let pivots = front.pivots.clone();
    x.chunks_mut(n).zip(y.chunks(front.width())).for_each(|(x, y)| x[pivots.clone()].copy_from_slice(y));
}

/// Calls `f` with each run of rows below the pivots, in `x` and in `z`, which holds these rows alone.
fn for_each_run<T>(front: &Front, n: usize, x: &mut [T], z: &mut [T], f: impl Fn(&mut [T], &mut [T])) {
    if front.below == 0 {
        return;
    }
    for (x, mut rest) in x.chunks_mut(n).zip(z.chunks_mut(front.below)) {
        for run in &front.below_runs {
            let (z, others) = rest.split_at_mut(run.len());
            f(&mut x[run.clone()], z);
            rest = others;
        }
    }
}

/// y <- B^-1 y.
fn divide_by_pivots<T: Scalar>(front: &Front, panel: &Panel<T>, y: &mut [T]) {
    let (l11, _) = panel.blocks(front);
    let width = front.width();
    let mut j = 0;
    while j < width {
        let below = panel.subdiagonal[j];
        if below == T::default() {
            let inverse = T::round(1.0) / l11[(j, j)];
            y.chunks_mut(width).for_each(|y| y[j] *= inverse);
            j += 1;
        } else {
            let inverse = Inverse::new(l11[(j, j)], below, l11[(j + 1, j + 1)]);
            for y in y.chunks_mut(width) {
                [y[j], y[j + 1]] = inverse.apply(y[j], y[j + 1]);
            }
            j += 2;
        }
    }
}
