//! The numbers of one front: assembly, pivots, rows below, contribution to the parent.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::lblt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, ColMut, MatMut, MatRef, Par};
use rayon::prelude::*;

use super::scalar::Scalar;
use super::tree::{Front, Run};
use crate::math::sparse::SymmetricMatrix;

/// Columns of a contribution that are computed and stored together.
const STRIP: usize = 128;
/// Rows below the pivots that are solved together.
const CHUNK: usize = 256;
/// Operations of a front above which its strips and chunks are shared among threads.
const LEAST_SHARED: f64 = 2e7;

/// L and B of one front.
pub(super) struct Panel<T> {
    /// L11 with the diagonal of B, above L21; by columns.
    pub values: Vec<T>,
    /// Entries of B below its diagonal, 0 where a block of order 1 ends; one per pivot.
    pub subdiagonal: Vec<T>,
    /// Pivot eliminated at each place, counted from the first of its block.
    pub exchanges: Vec<usize>,
    /// The inverse of `exchanges`.
    inverse: Vec<usize>,
}

impl<T: Scalar> Panel<T> {
    /// Reserves the memory for `front`; `None` if there is not enough.
    pub fn new(front: &Front) -> Option<Self> {
        let (width, entries) = (front.width(), front.width() * front.height());
        let mut values = Vec::new();
        values.try_reserve_exact(entries).ok()?;
        values.resize(entries, T::default());
        Some(Self {
            values,
            subdiagonal: vec![T::default(); width],
            exchanges: (0..width).collect(),
            inverse: (0..width).collect(),
        })
    }

    /// L11 and L21.
    pub fn blocks(&self, front: &Front) -> (MatRef<'_, T>, MatRef<'_, T>) {
        MatRef::from_column_major_slice(&self.values, front.height(), front.width()).split_at_row(front.width())
    }
}

/// The lower triangle of what a front adds to its parent.
///
/// Stored are strips of [`STRIP`] columns, each a matrix by columns that starts at the row of its first column.
pub(super) struct Contribution<T> {
    order: usize,
    values: Vec<T>,
}

impl<T> Contribution<T> {
    fn entries(order: usize) -> usize {
        (0..order).step_by(STRIP).map(|first| (order - first) * STRIP.min(order - first)).sum()
    }

    /// Rows from `j` down of column `j`.
    fn column(&self, j: usize) -> &[T] {
        let (strip, first) = (j / STRIP, j - j % STRIP);
        let before = STRIP * (strip * self.order) - STRIP * STRIP * strip * strip.saturating_sub(1) / 2;
        let height = self.order - first;
        let column = before + (j - first) * height;
        &self.values[column + j - first..column + height]
    }
}

/// Memory that is used again: a fresh page costs more than a product that fills it.
pub(super) struct Pool<T>(Mutex<Vec<Vec<T>>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Pool(Mutex::default())
    }
}

impl<T: Scalar> Pool<T> {
    /// `len` numbers of any value; `None` if there is no memory.
    fn take(&self, len: usize) -> Option<Vec<T>> {
        let mut buffer = {
            let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            // the tightest that is large enough, else the largest
            let fit = |buffer: &Vec<T>| match buffer.capacity() {
                capacity if capacity >= len => (0, capacity),
                capacity => (1, usize::MAX - capacity),
            };
            match (0..free.len()).min_by_key(|&k| fit(&free[k])) {
                Some(best) => free.swap_remove(best),
                None => Vec::new(),
            }
        };
        if buffer.capacity() < len {
            buffer.clear();
            buffer.try_reserve_exact(len).ok()?;
        }
        buffer.resize(len, T::default());
        Some(buffer)
    }

    fn give(&self, buffer: Vec<T>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffer);
    }
}

/// What all fronts of a factorisation read.
pub(super) struct Source<'a, T> {
    pub matrix: &'a SymmetricMatrix,
    /// The equilibration.
    pub scale: &'a [f64],
    pub pool: &'a Pool<T>,
}

impl<T: Scalar> Source<'_, T> {
    /// Fills `panel` and returns the contribution to the parent; `None` if there is no memory.
    ///
    /// `children`: each child with its contribution, which is given back.
    pub fn factor(
        &self,
        front: &Front,
        panel: &mut Panel<T>,
        children: Vec<(&Front, Contribution<T>)>,
    ) -> Option<Contribution<T>> {
        let (width, below) = (front.width(), front.below);
        let is_shared = front.flops > LEAST_SHARED;
        self.assemble(front, &mut panel.values, &children);

        let mut product = self.pool.take((width + below) * width)?;
        eliminate(front, panel, &mut product, is_shared)?;
        let mut contribution =
            Contribution { order: below, values: self.pool.take(Contribution::<T>::entries(below))? };
        let (_, l21) = panel.blocks(front);
        let times_b = MatRef::from_column_major_slice(&product, width + below, width).split_at_row(width).1;
        let mut strips = Vec::new();
        let mut rest = contribution.values.as_mut_slice();
        for first in (0..below).step_by(STRIP) {
            let columns = first..below.min(first + STRIP);
            let (strip, others) = rest.split_at_mut((below - first) * columns.len());
            strips.push((columns, strip));
            rest = others;
        }
        for_each(is_shared, strips, |(columns, strip)| {
            let rows = below - columns.start;
            let l = l21.subrows(columns.start, rows);
            let bl = times_b.subrows(columns.start, columns.len());
            let product = MatMut::from_column_major_slice_mut(strip, rows, columns.len());
            let (triangle, rectangle) = product.split_at_row_mut(columns.len());
            let (l_triangle, l_rectangle) = l.split_at_row(columns.len());
            triangular::matmul(
                triangle,
                BlockStructure::TriangularLower,
                Accum::Replace,
                l_triangle,
                BlockStructure::Rectangular,
                bl.transpose(),
                BlockStructure::Rectangular,
                T::round(-1.0),
                Par::Seq,
            );
            matmul(rectangle, Accum::Replace, l_rectangle, bl.transpose(), T::round(-1.0), Par::Seq);
            for (child, added) in &children {
                let columns = columns.start + width..columns.end + width;
                add_columns(added, &child.to_parent, columns.clone(), columns.start, rows, strip);
            }
        });
        self.pool.give(product);
        for (_, child) in children {
            self.pool.give(child.values);
        }
        Some(contribution)
    }

    /// Memory that a contribution no longer needs.
    pub fn release(&self, contribution: Contribution<T>) {
        self.pool.give(contribution.values);
    }

    /// Adds the entries of the matrix and the contributions of the children to the columns of the pivots.
    fn assemble(&self, front: &Front, values: &mut [T], children: &[(&Front, Contribution<T>)]) {
        let pattern = &*self.matrix.pattern;
        let height = front.height();
        let strips: Vec<_> = values.chunks_mut(STRIP * height).enumerate().collect();
        for_each(front.flops > LEAST_SHARED, strips, |(strip, values)| {
            values.fill(T::default());
            let first = strip * STRIP;
            for (child, added) in children {
                add_columns(added, &child.to_parent, first..first + values.len() / height, 0, height, values);
            }
        });
        for block in &front.blocks {
            let (columns, rows) = (pattern.unknowns(block.column), pattern.unknowns(block.row));
            let is_diagonal = block.column == block.row;
            let offset = if is_diagonal { 0 } else { pattern.offset(block.column, block.row).unwrap_or(0) };
            for (a, column) in columns.clone().enumerate() {
                let skipped = if is_diagonal { a } else { 0 };
                let start = pattern.col_ptr()[column] + if is_diagonal { 0 } else { columns.len() - a + offset };
                let entries = &self.matrix.values[start..start + rows.len() - skipped];
                let scale = &self.scale[rows.start + skipped..rows.end];
                let s = self.scale[column];
                if block.transposed {
                    let first = block.place[0] + a + block.place[1] * height;
                    let row = values[first..].iter_mut().step_by(height);
                    row.zip(entries.iter().zip(scale)).for_each(|(f, (a, t))| *f += T::round(a * s * t));
                } else {
                    let first = block.place[0] + skipped + (block.place[1] + a) * height;
                    let column = &mut values[first..first + entries.len()];
                    column
                        .iter_mut()
                        .zip(entries.iter().zip(scale))
                        .for_each(|(f, (a, t))| *f += T::round(a * s * t));
                }
            }
        }
    }
}

/// Adds to `columns` of the parent, counted from its first pivot, what a child contributes to them.
///
/// `values` holds these columns, of `height` rows each, from row `first_row` of the parent down.
fn add_columns<T: Scalar>(
    child: &Contribution<T>,
    runs: &[Run],
    columns: Range<usize>,
    first_row: usize,
    height: usize,
    values: &mut [T],
) {
    for (place, run) in runs.iter().enumerate() {
        for to in run.to.max(columns.start)..(run.to + run.len).min(columns.end) {
            let from = run.from + to - run.to;
            let target = &mut values[(to - columns.start) * height..][..height];
            let mut source = child.column(from);
            let first = Run { from, to, len: run.len - (to - run.to) };
            for rows in std::iter::once(&first).chain(&runs[place + 1..]) {
                let (added, rest) = source.split_at(rows.len);
                source = rest;
                let start = rows.to - first_row;
                target[start..start + rows.len].iter_mut().zip(added).for_each(|(t, s)| *t += *s);
            }
        }
    }
}

/// Factors the columns of the pivots, block after block; `product` receives L B below each block.
///
/// ```text
/// F_ik -= sum_{m < k} L_im (L_km B_m)^T      all rows i of block k
/// F_kk = P^T L_kk B_k L_kk^T P,   L_ik B_k = F_ik P^T L_kk^-T     rows below block k
/// ```
///
/// P stays in the block: rows of L that belong to a later block are in the order before its exchanges.
fn eliminate<T: Scalar>(front: &Front, panel: &mut Panel<T>, product: &mut [T], is_shared: bool) -> Option<()> {
    let (width, height) = (front.width(), front.height());
    let mut l = MatMut::from_column_major_slice_mut(&mut panel.values, height, width);
    let mut product = MatMut::from_column_major_slice_mut(product, height, width);
    let widest = front.pivot_blocks.iter().map(ExactSizeIterator::len).max()?;
    let need = cholesky_in_place_scratch::<usize, T>(widest, Par::Seq, Default::default());
    let mut scratch = MemBuffer::try_new(need).ok()?;
    panel.subdiagonal.fill(T::default());
    for block in &front.pivot_blocks {
        let (start, len) = (block.start, block.len());
        let (before, columns) = l.rb_mut().split_at_col_mut(start);
        let (before, columns) =
            (before.rb().subrows(start, height - start), columns.subrows_mut(start, height - start));
        let (products_before, products) = product.rb_mut().split_at_col_mut(start);
        let of_block = products_before.rb().subrows(start, len);
        let (mut pivots, rows) = columns.subcols_mut(0, len).split_at_row_mut(len);
        matmul(pivots.rb_mut(), Accum::Add, before.subrows(0, len), of_block.transpose(), T::round(-1.0), Par::Seq);
        let subdiagonal = &mut panel.subdiagonal[block.clone()];
        let exchanges = &mut panel.exchanges[block.clone()];
        cholesky_in_place(
            pivots.rb_mut(),
            ColMut::from_slice_mut(subdiagonal).as_diagonal_mut(),
            exchanges,
            &mut panel.inverse[block.clone()],
            Par::Seq,
            MemStack::new(&mut scratch),
            Default::default(),
        );

        let pivots = pivots.rb();
        let products = products.subcols_mut(0, len).subrows_mut(start + len, height - start - len);
        let chunks: Vec<_> =
            chunks_of_rows(rows, CHUNK).into_iter().zip(chunks_of_rows(products, CHUNK)).enumerate().collect();
        for_each(is_shared, chunks, |(chunk, (mut rows, product))| {
            let before = before.subrows(len + chunk * CHUNK, rows.nrows());
            matmul(rows.rb_mut(), Accum::Add, before, of_block.transpose(), T::round(-1.0), Par::Seq);
            solve_rows(pivots, subdiagonal, exchanges, rows, product);
        });
    }
    Some(())
}

/// The rows of a matrix in pieces of `len`.
pub(super) fn chunks_of_rows<T>(matrix: MatMut<'_, T>, len: usize) -> Vec<MatMut<'_, T>> {
    let mut chunks = Vec::new();
    let mut rest = matrix;
    while rest.nrows() > 0 {
        let rows = len.min(rest.nrows());
        let (chunk, others) = rest.split_at_row_mut(rows);
        chunks.push(chunk);
        rest = others;
    }
    chunks
}

/// `rows` holds rows below a block of pivots and receives those of L; `product` receives L B.
fn solve_rows<T: Scalar>(
    pivots: MatRef<'_, T>,
    subdiagonal: &[T],
    exchanges: &[usize],
    mut rows: MatMut<'_, T>,
    mut product: MatMut<'_, T>,
) {
    for (j, &pivot) in exchanges.iter().enumerate() {
        product.rb_mut().col_mut(j).copy_from(rows.rb().col(pivot));
    }
    solve_unit_lower_triangular_in_place(pivots, product.rb_mut().transpose_mut(), Par::Seq);
    let product = product.rb();
    let mut j = 0;
    while j < exchanges.len() {
        if subdiagonal[j] == T::default() {
            let inverse = T::round(1.0) / pivots[(j, j)];
            let column = rows.rb_mut().col_mut(j);
            column.iter_mut().zip(product.col(j).iter()).for_each(|(l, p)| *l = *p * inverse);
            j += 1;
        } else {
            let inverse = Inverse::new(pivots[(j, j)], subdiagonal[j], pivots[(j + 1, j + 1)]);
            for i in 0..rows.nrows() {
                [rows[(i, j)], rows[(i, j + 1)]] = inverse.apply(product[(i, j)], product[(i, j + 1)]);
            }
            j += 2;
        }
    }
}

/// The inverse of a block of B of order 2, scaled by its large entry below the diagonal.
///
/// ```text
/// | a  b |^-1         1        |  d/b  -1  |
/// | b  d |    = -------------  |  -1   a/b |
///                b (ad/b^2 - 1)
/// ```
pub(super) struct Inverse<T> {
    a: T,
    d: T,
    factor: T,
}

impl<T: Scalar> Inverse<T> {
    pub fn new(a: T, b: T, d: T) -> Self {
        let one = T::round(1.0);
        let (a, d) = (a / b, d / b);
        Self { a, d, factor: one / (b * (a * d - one)) }
    }

    pub fn apply(&self, x: T, y: T) -> [T; 2] {
        [self.factor * (self.d * x - y), self.factor * (self.a * y - x)]
    }
}

/// Calls `f` for every item, on all threads if `is_shared`; what an item gets does not depend on it.
pub(super) fn for_each<I: Send>(is_shared: bool, items: Vec<I>, f: impl Fn(I) + Sync + Send) {
    if is_shared {
        items.into_par_iter().for_each(f);
    } else {
        items.into_iter().for_each(f);
    }
}
