//! A symmetric sparse matrix whose pattern is made of blocks and never changes.
//!
//! Unknowns are numbered so that the unknowns of a group are contiguous. Stored is the lower triangle by columns
//! (compressed sparse columns, rows ascending, diagonal included). A column of group g holds
//!
//! ```text
//! rows of g from the diagonal down | all rows of h1 | all rows of h2 | ...     g < h1 < h2 < ..., adjacent to g
//! ```
//!
//! so the place of every entry follows by arithmetic from one [`BlockPattern::offset`] per pair of groups.

use std::ops::Range;
use std::sync::Arc;

use faer::sparse::SymbolicSparseColMat;
use rayon::prelude::*;

/// Pieces into which a product is cut. Fixed, so that the order of the sums does not depend on the threads.
const PARTS: usize = 8;
/// Right-hand sides multiplied in one pass over the matrix: their partial sums fit in the cache.
const BATCH: usize = 8;

/// Which entries of a symmetric matrix may differ from zero; built once, shared by every matrix of a model.
#[derive(Debug)]
pub struct BlockPattern {
    /// First unknown of each group, and the number of unknowns; groups + 1.
    group_start: Vec<usize>,
    /// Groups adjacent to group g and above it: `neighbours[neighbour_start[g]..neighbour_start[g + 1]]`, ascending.
    neighbours: Vec<usize>,
    neighbour_start: Vec<usize>,
    /// Rows of the neighbours listed before this one; parallel to `neighbours`.
    offsets: Vec<usize>,
    /// Column pointers and row indices, checked once.
    columns: SymbolicSparseColMat<usize>,
}

impl BlockPattern {
    /// Couples all groups of each clique with each other.
    ///
    /// `group_start`: first unknown of each group followed by the number of unknowns (prefix sums; a group may be
    /// empty). `cliques`: groups of each element, in any order.
    ///
    /// # Panics
    /// If `group_start` is empty, does not start at 0 or descends, or if a clique names a group that does not exist.
    pub fn new<'a>(group_start: &[usize], cliques: impl IntoIterator<Item = &'a [usize]>) -> Self {
        assert!(group_start.first() == Some(&0), "prefix sums start at 0");
        assert!(group_start.is_sorted(), "prefix sums ascend");
        let groups = group_start.len() - 1;
        let size = |g: usize| group_start[g + 1] - group_start[g];

        let cliques: Vec<Vec<usize>> =
            cliques.into_iter().map(|clique| clique.iter().copied().filter(|&g| size(g) > 0).collect()).collect();
        let mut cliques_of = vec![Vec::new(); groups];
        for (index, clique) in cliques.iter().enumerate() {
            for &g in clique {
                cliques_of[g].push(index);
            }
        }

        let mut neighbours = Vec::new();
        let mut neighbour_start = vec![0];
        let mut offsets = Vec::new();
        let mut seen_by = vec![usize::MAX; groups];
        for (g, own_cliques) in cliques_of.iter().enumerate() {
            let first = neighbours.len();
            for &h in own_cliques.iter().flat_map(|&index| &cliques[index]) {
                if h > g && seen_by[h] != g {
                    seen_by[h] = g;
                    neighbours.push(h);
                }
            }
            neighbours[first..].sort_unstable();
            offsets.extend(neighbours[first..].iter().scan(0, |rows, &h| {
                let offset = *rows;
                *rows += size(h);
                Some(offset)
            }));
            neighbour_start.push(neighbours.len());
        }

        let n = group_start[groups];
        let mut col_ptr = Vec::with_capacity(n + 1);
        let mut row_idx = Vec::new();
        col_ptr.push(0);
        for g in 0..groups {
            let above = &neighbours[neighbour_start[g]..neighbour_start[g + 1]];
            for column in group_start[g]..group_start[g + 1] {
                row_idx.extend(column..group_start[g + 1]);
                for &h in above {
                    row_idx.extend(group_start[h]..group_start[h + 1]);
                }
                col_ptr.push(row_idx.len());
            }
        }
        let columns = SymbolicSparseColMat::new_checked(n, n, col_ptr, None, row_idx);
        Self { group_start: group_start.to_vec(), neighbours, neighbour_start, offsets, columns }
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.columns.ncols()
    }

    /// Number of stored entries: lower triangle with the diagonal.
    pub fn nnz(&self) -> usize {
        self.row_idx().len()
    }

    /// Number of groups, the empty ones included.
    pub fn groups(&self) -> usize {
        self.group_start.len() - 1
    }

    /// Unknowns of group `g`, which are its rows and its columns.
    pub fn unknowns(&self, g: usize) -> Range<usize> {
        self.group_start[g]..self.group_start[g + 1]
    }

    /// Where each column starts in [`row_idx`](Self::row_idx), and the number of entries; n + 1.
    pub fn col_ptr(&self) -> &[usize] {
        self.columns.col_ptr()
    }

    /// Row of each stored entry.
    pub fn row_idx(&self) -> &[usize] {
        self.columns.row_idx()
    }

    /// Groups that share a clique with `g`, are not empty and come after it; ascending.
    pub fn neighbours_above(&self, g: usize) -> &[usize] {
        &self.neighbours[self.neighbour_start[g]..self.neighbour_start[g + 1]]
    }

    /// Rows of other groups before those of `h` in a column of `g`, for h > g; `None` where the two do not touch.
    ///
    /// With a the index of a column in g and b that of a row in h, the entry is stored at
    /// `col_ptr[first + a] + (size of g - a) + offset + b`, with `first` the first unknown of g. The diagonal block
    /// needs no offset: row a + b of column a is stored at `col_ptr[first + a] + b`.
    pub fn offset(&self, g: usize, h: usize) -> Option<usize> {
        let place = self.neighbours_above(g).binary_search(&h).ok()?;
        Some(self.offsets[self.neighbour_start[g] + place])
    }

    /// Cuts the groups into at most [`PARTS`] ranges of about equal numbers of entries.
    pub(super) fn parts(&self) -> Vec<Range<usize>> {
        let entries_before = |g: usize| self.col_ptr()[self.group_start[g]];
        let mut parts = Vec::with_capacity(PARTS);
        let mut first = 0;
        for part in 1..=PARTS {
            let goal = self.nnz() * part / PARTS;
            let mut end = first;
            while end < self.groups() && entries_before(end + 1) <= goal {
                end += 1;
            }
            if end > first {
                parts.push(first..end);
            }
            first = end;
        }
        parts
    }

    /// Rows below group `g` that its columns hold, as the fewest contiguous ranges.
    pub(super) fn row_runs(&self, g: usize, runs: &mut Vec<Range<usize>>) {
        runs.clear();
        for &h in self.neighbours_above(g) {
            let rows = self.unknowns(h);
            match runs.last_mut() {
                Some(last) if last.end == rows.start => last.end = rows.end,
                _ => runs.push(rows),
            }
        }
    }
}

/// A symmetric matrix on a [`BlockPattern`].
#[derive(Clone, Debug)]
pub struct SymmetricMatrix {
    /// Where the entries are.
    pub pattern: Arc<BlockPattern>,
    /// Lower triangle in the order of [`BlockPattern::row_idx`].
    pub values: Vec<f64>,
}

impl SymmetricMatrix {
    /// The zero matrix.
    pub fn zeros(pattern: Arc<BlockPattern>) -> Self {
        let values = vec![0.0; pattern.nnz()];
        Self { pattern, values }
    }

    /// The entries a_jj.
    pub fn diagonal(&self) -> Vec<f64> {
        let (first_of_column, _) = self.pattern.col_ptr().split_at(self.pattern.n());
        first_of_column.iter().map(|&entry| self.values[entry]).collect()
    }

    /// A += scale B on the entries that A has.
    pub fn add_scaled(&mut self, scale: f64, b: &SymmetricMatrix) {
        let pattern = &*self.pattern;
        let (rows, start) = (pattern.row_idx(), pattern.col_ptr());
        let (b_rows, b_start) = (b.pattern.row_idx(), b.pattern.col_ptr());
        for column in 0..pattern.n() {
            let mut entry = start[column];
            for k in b_start[column]..b_start[column + 1] {
                // rows ascend in both
                while entry < start[column + 1] && rows[entry] < b_rows[k] {
                    entry += 1;
                }
                if entry < start[column + 1] && rows[entry] == b_rows[k] {
                    self.values[entry] += scale * b.values[k];
                }
            }
        }
    }

    /// Sets all rows and columns to zero that are not `kept`.
    pub fn keep(&mut self, kept: &[bool]) {
        let pattern = &*self.pattern;
        for column in 0..pattern.n() {
            for entry in pattern.col_ptr()[column]..pattern.col_ptr()[column + 1] {
                if !kept[column] || !kept[pattern.row_idx()[entry]] {
                    self.values[entry] = 0.0;
                }
            }
        }
    }

    /// y = A x for one vector of length n. The same bits for any number of threads.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        self.multiply_columns(x, y, 1);
    }

    /// Y = A X for `columns` vectors stored one after the other. The same bits for any number of threads.
    ///
    /// # Panics
    /// If `x` or `y` is not n times `columns` long.
    pub fn multiply_columns(&self, x: &[f64], y: &mut [f64], columns: usize) {
        let n = self.pattern.n();
        assert!(x.len() == n * columns && y.len() == n * columns, "n x columns numbers each");
        if n == 0 {
            return;
        }
        let parts = self.pattern.parts();
        for (x, y) in x.chunks(n * BATCH).zip(y.chunks_mut(n * BATCH)) {
            let sums: Vec<Vec<f64>> =
                parts.par_iter().map(|groups| self.partial_product(groups.clone(), x)).collect();
            y.fill(0.0);
            for (groups, sum) in parts.iter().zip(&sums) {
                let first = self.pattern.unknowns(groups.start).start;
                for (y, sum) in y.chunks_mut(n).zip(sum.chunks(n - first)) {
                    y[first..].iter_mut().zip(sum).for_each(|(y, s)| *y += s);
                }
            }
        }
    }

    /// What the stored columns of `groups`, and their mirror images, add to A X.
    ///
    /// Rows above the first column of `groups` get nothing: each vector of the result starts at that row.
    fn partial_product(&self, groups: Range<usize>, x: &[f64]) -> Vec<f64> {
        let pattern = &*self.pattern;
        let n = pattern.n();
        let first = pattern.unknowns(groups.start).start;
        let height = n - first;
        let mut sum = vec![0.0; height * (x.len() / n)];
        let mut runs = Vec::new();
        for g in groups {
            pattern.row_runs(g, &mut runs);
            let own = pattern.unknowns(g);
            for j in own.clone() {
                let column = &self.values[pattern.col_ptr()[j]..pattern.col_ptr()[j + 1]];
                let (diagonal, below) = (column[0], &column[1..]);
                for (x, y) in x.chunks(n).zip(sum.chunks_mut(height)) {
                    let mut entries = below;
                    let mut mirrored = diagonal * x[j];
                    for rows in std::iter::once(j + 1..own.end).chain(runs.iter().cloned()) {
                        let (block, rest) = entries.split_at(rows.len());
                        entries = rest;
                        mirrored +=
                            dot_and_add(block, &x[rows.clone()], x[j], &mut y[rows.start - first..rows.end - first]);
                    }
                    y[j - first] += mirrored;
                }
            }
        }
        sum
    }
}

/// a . x and y += a s in one pass over a. Eight partial sums, because one would wait for itself at every addition.
fn dot_and_add(a: &[f64], x: &[f64], s: f64, y: &mut [f64]) -> f64 {
    const LANES: usize = 8;
    let mut lanes = [0.0; LANES];
    let (a_head, a_tail) = a.as_chunks::<LANES>();
    let (x_head, x_tail) = x.as_chunks::<LANES>();
    let (y_head, y_tail) = y.as_chunks_mut::<LANES>();
    for ((a, x), y) in a_head.iter().zip(x_head).zip(y_head) {
        for lane in 0..LANES {
            lanes[lane] += a[lane] * x[lane];
            y[lane] += a[lane] * s;
        }
    }
    let mut tail = 0.0;
    for ((a, x), y) in a_tail.iter().zip(x_tail).zip(y_tail) {
        tail += a * x;
        *y += a * s;
    }
    lanes.iter().sum::<f64>() + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four groups of 2, 0, 3, 1 unknowns; the second is empty; the last touches only the third.
    fn small() -> BlockPattern {
        BlockPattern::new(&[0, 2, 2, 5, 6], [[2usize, 1, 0].as_slice(), &[3, 2]])
    }

    #[test]
    fn columns_hold_the_diagonal_first_and_neighbours_in_order() {
        let pattern = small();
        assert_eq!(pattern.n(), 6);
        assert_eq!(pattern.col_ptr(), [0, 5, 9, 13, 16, 18, 19]);
        assert_eq!(pattern.row_idx(), [0, 1, 2, 3, 4, 1, 2, 3, 4, 2, 3, 4, 5, 3, 4, 5, 4, 5, 5]);
    }

    #[test]
    fn offsets_exist_only_between_groups_that_touch() {
        let pattern = small();
        assert_eq!(pattern.offset(0, 2), Some(0));
        assert_eq!(pattern.offset(2, 3), Some(0));
        assert_eq!(pattern.offset(0, 3), None);
        assert_eq!(pattern.offset(0, 1), None);
        assert_eq!(pattern.neighbours_above(1), [0usize; 0]);
    }

    #[test]
    fn a_group_without_a_clique_keeps_its_own_block() {
        let pattern = BlockPattern::new(&[0, 2], []);
        assert_eq!(pattern.row_idx(), [0, 1, 1]);
    }

    #[test]
    fn parts_cover_every_group_once() {
        let start: Vec<usize> = (0..=40).map(|g| 3 * g).collect();
        let cliques: Vec<[usize; 2]> = (0..39).map(|g| [g, g + 1]).collect();
        let parts = BlockPattern::new(&start, cliques.iter().map(|c| c.as_slice())).parts();
        assert_eq!(parts.len(), PARTS);
        assert_eq!(parts.into_iter().flatten().collect::<Vec<_>>(), (0..40).collect::<Vec<_>>());
    }
}
