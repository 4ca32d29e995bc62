//! The tree of fronts: which unknowns are eliminated together, and where every number goes.
//!
//! A *front* eliminates some unknowns, its pivots, at once. It is a dense symmetric matrix over its pivots and over the
//! unknowns below that they couple to (Duff and Reid 1983):
//!
//! ```text
//! | F11      |   pivots             F11 = L11 B L11^T,  L21 = F21 L11^-T B^-1
//! | F21  F22 |   rows below         contribution to the parent: F22 - L21 B L21^T
//! ```
//!
//! Its parent eliminates the first of the rows below. All unknowns of a group stay together, so the structure is found
//! on the groups alone, and numbers move in runs of consecutive unknowns.

use std::ops::Range;

use super::super::ordering::Ordering;
use super::super::sparse::BlockPattern;

/// Time to move an entry of a front, in operations: writing it, adding it to the parent, reading it in a product.
const MOVE: f64 = 60.0;
/// Time to begin a front, in operations.
const BEGIN: f64 = 2e5;
/// Most pivots of a block.
const WIDEST: usize = 104;
/// Fronts below a subtree are worth another thread above this number of operations,
const LEAST_TASK: f64 = 4e6;
/// and above this part of all operations, which bounds the depth of the recursion.
const TASK_PART: f64 = 1.0 / 128.0;

/// All fronts in an order in which children come before their parents and every subtree is contiguous.
#[derive(Debug)]
pub(super) struct Tree {
    pub fronts: Vec<Front>,
    /// Fronts without a parent.
    pub roots: Vec<usize>,
    /// Unknowns, first eliminated first; n.
    pub permutation: Vec<usize>,
}

/// What one front eliminates and where its numbers come from and go to.
#[derive(Debug)]
pub(super) struct Front {
    /// Places of the pivots in [`Tree::permutation`].
    pub pivots: Range<usize>,
    /// Pivots among which a pivot is chosen, counted from the first of the front; whole groups, in order.
    pub pivot_blocks: Vec<Range<usize>>,
    /// Number of rows below the pivots.
    pub below: usize,
    /// Places of the rows below, as the fewest ranges, ascending.
    pub below_runs: Vec<Range<usize>>,
    /// Blocks of the matrix that are added to this front.
    pub blocks: Vec<Block>,
    /// Largest subtree first.
    pub children: Vec<usize>,
    /// Children whose subtrees are worth a thread each; they are the first of `children`.
    pub heavy_children: usize,
    /// First front of the subtree, which ends with this front.
    pub first: usize,
    /// Where the rows below are in the parent.
    pub to_parent: Vec<Run>,
    /// Operations of this front.
    pub flops: f64,
}

/// The entries of the matrix between the unknowns of two groups, and their place in a front.
#[derive(Debug)]
pub(super) struct Block {
    /// The groups; `column` is at most `row`.
    pub column: usize,
    pub row: usize,
    /// First row and first column in the front.
    pub place: [usize; 2],
    /// Whether `row` is eliminated first: its unknowns are the columns in the front.
    pub transposed: bool,
}

/// Consecutive rows of a front that are consecutive in its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// First row, counted from the first row below the pivots.
    pub from: usize,
    /// First row in the parent, counted from its first pivot.
    pub to: usize,
    pub len: usize,
}

impl Front {
    pub fn width(&self) -> usize {
        self.pivots.len()
    }

    pub fn height(&self) -> usize {
        self.width() + self.below
    }
}

/// A front while fronts are being merged; names groups by their place in the order.
struct Draft {
    pivots: Vec<usize>,
    width: usize,
    below: usize,
    children: Vec<usize>,
}

impl Tree {
    /// Finds the fronts for `pattern` eliminated in about the order `ordering`.
    pub fn new(pattern: &BlockPattern, ordering: &Ordering) -> Self {
        let order = &ordering.groups;
        let structure = group_structure(pattern, order);
        let size = |place: usize| pattern.unknowns(order[place]).len();
        let mut drafts: Vec<Draft> = (0..order.len())
            .map(|k| Draft {
                pivots: vec![k],
                width: size(k),
                below: structure[k].iter().map(|&p| size(p)).sum(),
                children: Vec::new(),
            })
            .collect();
        let mut top = Vec::new();
        for k in 0..drafts.len() {
            merge_children(&mut drafts, k);
            match structure[k].iter().min() {
                Some(&parent) => drafts[parent].children.push(k),
                None => top.push(k),
            }
        }
        Self::lay_out(pattern, order, &structure, &mut drafts, top)
    }

    /// Where threads part below a front: the first front down from it with two or more heavy children gives them and the front after
    /// their subtrees, with which those begin that come one after the other. The subtrees lie one after the other from the
    /// first front on.
    pub fn branch(&self, root: usize) -> (&[usize], usize) {
        let mut branch = &self.fronts[root];
        while branch.heavy_children == 1 {
            branch = &self.fronts[branch.children[0]];
        }
        let heavy = &branch.children[..branch.heavy_children];
        (heavy, heavy.last().map_or(self.fronts[root].first, |last| last + 1))
    }

    fn lay_out(
        pattern: &BlockPattern,
        order: &[usize],
        structure: &[Vec<usize>],
        drafts: &mut [Draft],
        mut top: Vec<usize>,
    ) -> Self {
        // operations of every subtree; children have lower numbers than their parents
        let mut work = vec![0.0; drafts.len()];
        for k in 0..drafts.len() {
            let mut children = std::mem::take(&mut drafts[k].children);
            children.sort_by(|&a, &b| f64::total_cmp(&work[b], &work[a]));
            work[k] = flops(drafts[k].width, drafts[k].below) + children.iter().map(|&c| work[c]).sum::<f64>();
            drafts[k].children = children;
        }
        top.sort_by(|&a, &b| f64::total_cmp(&work[b], &work[a]));
        let total: f64 = top.iter().map(|&k| work[k]).sum();

        // reversed preorder is a postorder in which the heaviest child comes first
        let mut sequence = Vec::new();
        let mut stack = top.clone();
        while let Some(k) = stack.pop() {
            sequence.push(k);
            stack.extend(&drafts[k].children);
        }
        sequence.reverse();
        let mut number = vec![usize::MAX; drafts.len()];
        sequence.iter().enumerate().for_each(|(f, &k)| number[k] = f);

        // where the unknowns of each group are eliminated, and by which front
        let mut permutation = Vec::with_capacity(pattern.n());
        let mut start = vec![usize::MAX; pattern.groups()];
        let mut front_of = vec![usize::MAX; pattern.groups()];
        let mut fronts: Vec<Front> = Vec::with_capacity(sequence.len());
        for (f, &k) in sequence.iter().enumerate() {
            let draft = &drafts[k];
            let first_pivot = permutation.len();
            let mut pivot_blocks: Vec<Range<usize>> = Vec::new();
            // blocks about equal, none wider than the limit unless a group is
            let width = draft.width.div_ceil(draft.width.div_ceil(WIDEST));
            for &place in &draft.pivots {
                let g = order[place];
                start[g] = permutation.len();
                front_of[g] = f;
                permutation.extend(pattern.unknowns(g));
                let end = permutation.len() - first_pivot;
                match pivot_blocks.last_mut() {
                    Some(block) if end - block.start <= width => block.end = end,
                    _ => pivot_blocks.push(start[g] - first_pivot..end),
                }
            }
            let heavy = |c: &&usize| work[**c] > LEAST_TASK && work[**c] > TASK_PART * total;
            fronts.push(Front {
                pivots: first_pivot..permutation.len(),
                pivot_blocks,
                below: draft.below,
                below_runs: Vec::new(),
                blocks: Vec::new(),
                heavy_children: draft.children.iter().take_while(heavy).count(),
                children: draft.children.iter().map(|&c| number[c]).collect(),
                first: draft.children.first().map_or(f, |&c| fronts[number[c]].first),
                to_parent: Vec::new(),
                flops: flops(draft.width, draft.below),
            });
        }
        for (f, &k) in sequence.iter().enumerate() {
            let mut groups: Vec<usize> = structure[k].iter().map(|&place| order[place]).collect();
            groups.sort_unstable_by_key(|&g| start[g]);
            for g in groups {
                let rows = start[g]..start[g] + pattern.unknowns(g).len();
                match fronts[f].below_runs.last_mut() {
                    Some(last) if last.end == rows.start => last.end = rows.end,
                    _ => fronts[f].below_runs.push(rows),
                }
            }
        }
        for f in 0..fronts.len() {
            for c in fronts[f].children.clone() {
                fronts[c].to_parent = runs_in_parent(&fronts[c], &fronts[f]);
            }
        }
        for g in 0..pattern.groups() {
            if pattern.unknowns(g).is_empty() {
                continue;
            }
            for &h in std::iter::once(&g).chain(pattern.neighbours_above(g)) {
                let transposed = start[h] < start[g];
                let (first, second) = if transposed { (h, g) } else { (g, h) };
                let front = &mut fronts[front_of[first]];
                let place = [local_row(front, start[second]), start[first] - front.pivots.start];
                front.blocks.push(Block { column: g, row: h, place, transposed });
            }
        }
        Self { fronts, roots: top.iter().map(|&k| number[k]).collect(), permutation }
    }
}

/// Places in the order that each group couples to when it is eliminated.
fn group_structure(pattern: &BlockPattern, order: &[usize]) -> Vec<Vec<usize>> {
    let mut place = vec![usize::MAX; pattern.groups()];
    order.iter().enumerate().for_each(|(k, &g)| place[g] = k);
    let mut structure: Vec<Vec<usize>> = vec![Vec::new(); order.len()];
    for g in 0..pattern.groups() {
        for &h in pattern.neighbours_above(g) {
            let (a, b) = (place[g].min(place[h]), place[g].max(place[h]));
            structure[a].push(b);
        }
    }
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); order.len()];
    let mut seen_by = vec![usize::MAX; order.len()];
    for k in 0..order.len() {
        // structure(k) = neighbours of k and structures of its children, as far as they come after k
        let mut union = std::mem::take(&mut structure[k]);
        seen_by[k] = k;
        union.iter().for_each(|&p| seen_by[p] = k);
        for &child in &children[k] {
            for &p in &structure[child] {
                if seen_by[p] != k {
                    seen_by[p] = k;
                    union.push(p);
                }
            }
        }
        if let Some(&parent) = union.iter().min() {
            children[parent].push(k);
        }
        structure[k] = union;
    }
    structure
}

/// Lets front `k` eliminate what its children eliminate, one child after the other, as long as that saves time.
///
/// The rows below a child are pivots of its parent or rows below them, so the merged front is no higher than the two
/// widths and the rows below the parent. It holds zeros that the two fronts did not, but moves fewer numbers.
fn merge_children(drafts: &mut [Draft], k: usize) {
    loop {
        let saving = |c: usize| {
            let (child, parent) = (&drafts[c], &drafts[k]);
            time(child.width, child.below) + time(parent.width, parent.below)
                - time(child.width + parent.width, parent.below)
        };
        let best = drafts[k].children.iter().copied().enumerate().map(|(place, c)| (place, c, saving(c)));
        let Some((place, c, saved)) = best.max_by(|a, b| a.2.total_cmp(&b.2)) else { return };
        if saved <= 0.0 {
            return;
        }
        drafts[k].children.swap_remove(place);
        let pivots = std::mem::take(&mut drafts[c].pivots);
        let grandchildren = std::mem::take(&mut drafts[c].children);
        let width = drafts[c].width;
        drafts[k].pivots.splice(0..0, pivots);
        drafts[k].children.extend(grandchildren);
        drafts[k].width += width;
    }
}

/// Operations of a front: the sum of the squares of the lengths of its columns.
///
/// ```text
/// sum_{j = 1..w} (b + j)^2 = w b^2 + b w (w + 1) + w (w + 1) (2 w + 1) / 6
/// ```
fn flops(width: usize, below: usize) -> f64 {
    let (w, b) = (width as f64, below as f64);
    w * b * b + b * w * (w + 1.0) + w * (w + 1.0) * (2.0 * w + 1.0) / 6.0
}

/// Time of a front in operations of a large product.
fn time(width: usize, below: usize) -> f64 {
    let height = (width + below) as f64;
    flops(width, below) + MOVE * 0.5 * height * height + BEGIN
}

/// Row of the front, counted from its first pivot, that holds the unknown at `place`.
fn local_row(front: &Front, place: usize) -> usize {
    if front.pivots.contains(&place) {
        return place - front.pivots.start;
    }
    let mut row = front.width();
    for run in &front.below_runs {
        if run.contains(&place) {
            return row + place - run.start;
        }
        row += run.len();
    }
    row
}

/// Where the rows below `child` are in `parent`.
fn runs_in_parent(child: &Front, parent: &Front) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut from = 0;
    for range in &child.below_runs {
        let mut place = range.start;
        while place < range.end {
            let holder = std::iter::once(&parent.pivots).chain(&parent.below_runs).find(|run| run.contains(&place));
            let end = holder.map_or(range.end, |run| run.end.min(range.end));
            let run = Run { from, to: local_row(parent, place), len: end - place };
            match runs.last_mut() {
                Some(last) if last.to + last.len == run.to => last.len += run.len,
                _ => runs.push(run),
            }
            from += run.len;
            place = end;
        }
    }
    runs
}
