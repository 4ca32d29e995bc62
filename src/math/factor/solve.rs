//! Forward and backward substitution over the fronts.
//!
//! A front has y at its pivots and z at the rows below. On the way up z is what its children gave for these rows, and what is left
//! of it goes to the parent; on the way down z is the solution there, which the parent has found:
//!
//! ```text
//! up:    y <- L11^-1 y,  z <- z - L21 y,  y <- B^-1 y
//! down:  y <- L11^-T (y - L21^T z)
//! ```
//!
//! Vectors lie row by row, the numbers of all columns of a row together. As in the factorisation threads share the subtrees, and
//! the rows and columns of large fronts; who computes what does not change how it is computed.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_unit_lower_triangular_in_place, solve_unit_upper_triangular_in_place};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

use super::front::{Inverse, Panel, chunks_of_rows, for_each};
use super::scalar::Scalar;
use super::tree::{Front, Tree};

/// Entries of L21 above which its product with a vector is shared among threads: 2 MB of doubles.
const LEAST_SHARED: usize = 1 << 18;
/// Rows below the pivots, and pivots, whose products with a vector are computed together.
const CHUNK: usize = 256;
const COLUMNS: usize = 32;

/// x <- (L B L^T)^-1 x for `columns` vectors in the order of elimination, row by row.
pub(super) fn solve<T: Scalar>(tree: &Tree, panels: &[Panel<T>], x: &mut [T], columns: usize) {
    let substitution = Substitution { tree, panels, columns };
    let trees = substitution.split(&tree.roots, x).0;
    trees.into_par_iter().for_each(|(root, x)| {
        substitution.up(root, x);
        substitution.down(root, x, Vec::new());
    });
}

/// What all fronts read.
struct Substitution<'a, T> {
    tree: &'a Tree,
    panels: &'a [Panel<T>],
    columns: usize,
}

impl<T: Scalar> Substitution<'_, T> {
    /// The parts of `x` of subtrees that follow each other from its beginning, and the rest.
    fn split<'x>(&self, roots: &[usize], x: &'x mut [T]) -> (Vec<(usize, &'x mut [T])>, &'x mut [T]) {
        let mut rest = x;
        let mut parts = Vec::new();
        for &root in roots {
            let (part, others) = rest.split_at_mut(self.unknowns(root) * self.columns);
            parts.push((root, part));
            rest = others;
        }
        (parts, rest)
    }

    /// Number of unknowns that a subtree eliminates.
    fn unknowns(&self, root: usize) -> usize {
        let fronts = &self.tree.fronts;
        fronts[root].pivots.end - fronts[fronts[root].first].pivots.start
    }

    /// From the leaves of a subtree to its root; gives what is left for the rows below it. `x` are the pivots of the subtree.
    fn up(&self, root: usize, x: &mut [T]) -> Vec<T> {
        let (heavy, next) = self.tree.branch(root);
        let (parts, rest) = self.split(heavy, x);
        let mut waiting: Vec<Vec<T>> = parts.into_par_iter().map(|(child, x)| self.up(child, x)).collect();
        let mut rest = rest;
        for f in next..=root {
            let front = &self.tree.fronts[f];
            let (pivots, others) = rest.split_at_mut(front.width() * self.columns);
            rest = others;
            let mut local = vec![T::default(); front.height() * self.columns];
            local[..pivots.len()].copy_from_slice(pivots);
            let given = waiting.split_off(waiting.len() - front.children.len());
            for (&child, mut given) in front.children.iter().zip(given) {
                self.for_each_run(child, &mut given, &mut local, |given, local| {
                    local.iter_mut().zip(given).for_each(|(l, g)| *l += *g);
                });
            }
            let mut below = local.split_off(pivots.len());
            forward(front, &self.panels[f], &mut local, &mut below, self.columns);
            divide_by_pivots(front, &self.panels[f], &mut local, self.columns);
            pivots.copy_from_slice(&local);
            waiting.push(below);
        }
        waiting.pop().unwrap_or_default()
    }

    /// From the root of a subtree to its leaves; `below` is the solution at the rows below the root.
    fn down(&self, root: usize, x: &mut [T], below: Vec<T>) {
        let (heavy, next) = self.tree.branch(root);
        let (parts, mut rest) = self.split(heavy, x);
        let mut waiting = vec![below];
        for f in (next..=root).rev() {
            let front = &self.tree.fronts[f];
            let (others, pivots) = rest.split_at_mut(rest.len() - front.width() * self.columns);
            rest = others;
            let below = waiting.pop().unwrap_or_default();
            backward(front, &self.panels[f], pivots, &below, self.columns);
            let mut local = [&*pivots, &below].concat();
            for &child in &front.children {
                let mut given = vec![T::default(); self.tree.fronts[child].below * self.columns];
                self.for_each_run(child, &mut given, &mut local, |given, local| given.copy_from_slice(local));
                waiting.push(given);
            }
        }
        parts.into_par_iter().zip(waiting).for_each(|((child, x), below)| self.down(child, x, below));
    }

    /// Calls `f` with each run of the rows below a front, in what these rows hold and in what its parent holds.
    fn for_each_run(&self, front: usize, given: &mut [T], parent: &mut [T], f: impl Fn(&mut [T], &mut [T])) {
        let c = self.columns;
        for run in &self.tree.fronts[front].to_parent {
            f(&mut given[run.from * c..][..run.len * c], &mut parent[run.to * c..][..run.len * c]);
        }
    }
}

/// y <- L11^-1 y, z <- z - L21 y, with the exchanges of each block of pivots before its elimination.
fn forward<T: Scalar>(front: &Front, panel: &Panel<T>, y: &mut [T], z: &mut [T], columns: usize) {
    let (l11, l21) = panel.blocks(front);
    let width = front.width();
    let mut y = MatMut::from_row_major_slice_mut(y, width, columns);
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
        subtract_product(l_later, y.rb(), later);
    }
    subtract_product(l21, y.rb(), MatMut::from_row_major_slice_mut(z, front.below, columns));
}

/// y <- L11^-T (y - L21^T z), the exchanges of each block of pivots undone after it.
fn backward<T: Scalar>(front: &Front, panel: &Panel<T>, y: &mut [T], z: &[T], columns: usize) {
    let (l11, l21) = panel.blocks(front);
    let width = front.width();
    let mut y = MatMut::from_row_major_slice_mut(y, width, columns);
    subtract_transposed_product(l21, MatRef::from_row_major_slice(z, front.below, columns), y.rb_mut());
    let mut before = Vec::new();
    for block in front.pivot_blocks.iter().rev() {
        let (start, len) = (block.start, block.len());
        let (mut y, later) = y.rb_mut().subrows_mut(start, width - start).split_at_row_mut(len);
        let (l, l_later) = l11.submatrix(start, start, width - start, len).split_at_row(len);
        subtract_transposed_product(l_later, later.rb(), y.rb_mut());
        solve_unit_upper_triangular_in_place(l.transpose(), y.rb_mut(), Par::Seq);
        for mut y in y.col_iter_mut() {
            before.clear();
            before.extend(y.rb().iter());
            panel.exchanges[block.clone()].iter().zip(&before).for_each(|(&to, value)| y[to] = *value);
        }
    }
}

/// z <- z - L y.
fn subtract_product<T: Scalar>(l: MatRef<'_, T>, y: MatRef<'_, T>, z: MatMut<'_, T>) {
    let chunks = chunks_of_rows(z, CHUNK).into_iter().enumerate().collect();
    for_each(l.nrows() * l.ncols() > LEAST_SHARED, chunks, |(chunk, z)| {
        let l = l.subrows(chunk * CHUNK, z.nrows());
        matmul(z, Accum::Add, l, y, T::round(-1.0), Par::Seq);
    });
}

/// y <- y - L^T z.
fn subtract_transposed_product<T: Scalar>(l: MatRef<'_, T>, z: MatRef<'_, T>, y: MatMut<'_, T>) {
    let chunks = chunks_of_rows(y, COLUMNS).into_iter().enumerate().collect();
    for_each(l.nrows() * l.ncols() > LEAST_SHARED, chunks, |(chunk, y)| {
        let l = l.subcols(chunk * COLUMNS, y.nrows());
        matmul(y, Accum::Add, l.transpose(), z, T::round(-1.0), Par::Seq);
    });
}

/// y <- B^-1 y.
fn divide_by_pivots<T: Scalar>(front: &Front, panel: &Panel<T>, y: &mut [T], columns: usize) {
    let (l11, _) = panel.blocks(front);
    let mut j = 0;
    while j < front.width() {
        let below = panel.subdiagonal[j];
        let (row, next) = y[j * columns..].split_at_mut(columns);
        if below == T::default() {
            let inverse = T::round(1.0) / l11[(j, j)];
            row.iter_mut().for_each(|y| *y *= inverse);
            j += 1;
        } else {
            let inverse = Inverse::new(l11[(j, j)], below, l11[(j + 1, j + 1)]);
            for (a, b) in row.iter_mut().zip(next) {
                [*a, *b] = inverse.apply(*a, *b);
            }
            j += 2;
        }
    }
}
