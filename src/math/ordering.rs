//! In which order to eliminate the groups of a [`BlockPattern`] so that the factor costs few operations.
//!
//! Eliminating a group couples all groups that it still touches. The best order is too hard to find; greedy rules
//! come close, and come closer when they are repeated with a little noise and the cheapest order is kept:
//!
//! - *minimum degree*: next is the group that touches the fewest unknowns (Rose 1972);
//! - *minimum fill*: next is the group whose elimination couples the fewest pairs that were not coupled;
//! - *approximate minimum degree* (Amestoy, Davis, Duff 1996), the usual choice, as one more candidate.
//!
//! Groups with equal closed neighbourhoods are merged first, and the operations of each candidate are counted exactly
//! on the graph of groups: the unknowns themselves are never looked at.

use std::collections::HashMap;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::amd;
use rayon::prelude::*;

use super::sparse::BlockPattern;
use greedy::Rule;

mod greedy;

/// Greedy orders tried on a small graph.
const RESTARTS: usize = 24;
/// Word operations that all restarts may take together, two rules alike; a few tenths of a second.
const BUDGET: usize = 300_000_000;
/// Above this many merged groups the square bit matrix of the greedy rules is too large; only the approximate rule runs.
const LARGEST_GREEDY: usize = 8192;

/// An order of elimination.
#[derive(Clone, Debug)]
pub struct Ordering {
    /// Groups that are not empty, first eliminated first.
    pub groups: Vec<usize>,
    /// Unknowns, first eliminated first; n.
    pub permutation: Vec<usize>,
    /// Operations of the factorisation, an addition and a multiplication counted as two: sum of the squares of the
    /// column lengths of L.
    pub flops: f64,
    /// Entries of L with its diagonal.
    pub factor_nnz: usize,
}

impl Ordering {
    /// Searches an order for `pattern`.
    ///
    /// `pressure_groups` names the groups whose diagonal block is zero or nearly so: the discontinuous pressures of an
    /// element, or a node all of whose displacements are prescribed. Such a group has no pivots of its own before
    /// displacements that it couples to have been eliminated, and waits for half of them. The same input gives the
    /// same order.
    pub fn new(pattern: &BlockPattern, pressure_groups: &[usize]) -> Self {
        let graph = Graph::of_groups(pattern);
        let mut is_pressure = vec![false; pattern.groups()];
        pressure_groups.iter().for_each(|&g| is_pressure[g] = true);

        let kept: Vec<usize> = (0..pattern.groups()).filter(|&g| graph.weight[g] > 0 && !is_pressure[g]).collect();
        let merged = Merged::new(&graph, &kept);
        let order = merged.expand(&cheapest_order(&merged.graph));
        let order = insert_pressures(&graph, &order, &is_pressure);
        let order = Elimination::new(&graph, &order).postorder(&order);

        let elimination = Elimination::new(&graph, &order);
        Self {
            permutation: order.iter().flat_map(|&g| pattern.unknowns(g)).collect(),
            groups: order,
            flops: elimination.flops,
            factor_nnz: elimination.factor_nnz,
        }
    }
}

/// An undirected graph with weights at its vertices.
struct Graph {
    /// Unknowns of each vertex.
    weight: Vec<usize>,
    /// Other vertices that each touches, ascending.
    neighbours: Vec<Vec<usize>>,
}

impl Graph {
    fn of_groups(pattern: &BlockPattern) -> Self {
        let mut neighbours = vec![Vec::new(); pattern.groups()];
        for g in 0..pattern.groups() {
            for &h in pattern.neighbours_above(g) {
                neighbours[g].push(h);
                neighbours[h].push(g);
            }
        }
        neighbours.iter_mut().for_each(|list| list.sort_unstable());
        Self { weight: (0..pattern.groups()).map(|g| pattern.unknowns(g).len()).collect(), neighbours }
    }

    fn len(&self) -> usize {
        self.weight.len()
    }
}

/// A graph in which vertices with the same neighbours, themselves included, have become one.
struct Merged {
    graph: Graph,
    /// Original vertices of each merged one.
    members: Vec<Vec<usize>>,
}

impl Merged {
    /// Merges the subgraph of the vertices `kept`.
    fn new(graph: &Graph, kept: &[usize]) -> Self {
        let mut is_kept = vec![false; graph.len()];
        kept.iter().for_each(|&v| is_kept[v] = true);
        let mut by_neighbourhood = HashMap::new();
        let mut members: Vec<Vec<usize>> = Vec::new();
        let mut merged_into = vec![usize::MAX; graph.len()];
        for &v in kept {
            let mut closed: Vec<usize> = graph.neighbours[v].iter().copied().filter(|&u| is_kept[u]).collect();
            closed.push(v);
            closed.sort_unstable();
            let index = *by_neighbourhood.entry(closed).or_insert(members.len());
            if index == members.len() {
                members.push(Vec::new());
            }
            members[index].push(v);
            merged_into[v] = index;
        }
        let neighbours = members.iter().enumerate().map(|(index, vertices)| {
            let touched = graph.neighbours[vertices[0]].iter().filter(|&&u| is_kept[u]).map(|&u| merged_into[u]);
            let mut list: Vec<usize> = touched.filter(|&other| other != index).collect();
            list.sort_unstable();
            list.dedup();
            list
        });
        let neighbours = neighbours.collect();
        let weight = members.iter().map(|vertices| vertices.iter().map(|&v| graph.weight[v]).sum()).collect();
        Self { graph: Graph { weight, neighbours }, members }
    }

    fn expand(&self, order: &[usize]) -> Vec<usize> {
        order.iter().flat_map(|&index| self.members[index].iter().copied()).collect()
    }
}

/// The candidate with the fewest operations.
fn cheapest_order(graph: &Graph) -> Vec<usize> {
    let mut candidates = vec![approximate_minimum_degree(graph)];
    if graph.len() <= LARGEST_GREEDY {
        candidates.extend(greedy_orders(graph));
    }
    let flops: Vec<f64> = candidates.par_iter().map(|order| Elimination::new(graph, order).flops).collect();
    let best = (0..candidates.len()).min_by(|&a, &b| flops[a].total_cmp(&flops[b])).unwrap_or(0);
    candidates.swap_remove(best)
}

/// Greedy orders with more and more noise, as many as the budget allows. What runs depends on the graph, not on time.
fn greedy_orders(graph: &Graph) -> Vec<Vec<usize>> {
    let mut orders = Vec::new();
    for rule in [Rule::MinimumDegree, Rule::MinimumFill] {
        let budget = BUDGET / 2;
        let Some((order, operations)) = greedy::order(graph, rule, 0.0, 0, budget) else { continue };
        orders.push(order);
        let restarts = (budget / operations.max(1)).min(RESTARTS / 2) as u64;
        let noise = |seed: u64| [0.02, 0.05, 0.1, 0.2][seed as usize % 4];
        let noisy = (1..restarts).into_par_iter();
        let noisy = noisy.filter_map(|seed| greedy::order(graph, rule, noise(seed), seed, budget));
        orders.extend(noisy.map(|(order, _)| order).collect::<Vec<_>>());
    }
    orders
}

/// The order of Amestoy, Davis and Duff; the order as numbered where faer refuses the graph.
fn approximate_minimum_degree(graph: &Graph) -> Vec<usize> {
    let n = graph.len();
    let mut col_ptr = vec![0];
    let mut row_idx = Vec::new();
    for v in 0..n {
        row_idx.push(v);
        row_idx.extend(graph.neighbours[v].iter().copied().filter(|&u| u > v));
        col_ptr.push(row_idx.len());
    }
    let pattern = SymbolicSparseColMat::<usize>::new_checked(n, n, col_ptr, None, row_idx);
    let (mut forward, mut inverse) = ((0..n).collect::<Vec<_>>(), vec![0; n]);
    let mut memory = MemBuffer::new(amd::order_scratch::<usize>(n, pattern.compute_nnz()));
    let stack = MemStack::new(&mut memory);
    match amd::order(&mut forward, &mut inverse, pattern.as_ref(), Default::default(), stack) {
        Ok(_) => forward,
        Err(_) => (0..n).collect(),
    }
}

/// Puts each pressure group where half of the unknowns of its other neighbours have been eliminated.
///
/// Right after its first neighbours there are too few displacements for all pressures that follow: pivots vanish. After
/// the last the pressures stay in every front in between: a third more operations, and no better residual.
fn insert_pressures(graph: &Graph, order: &[usize], is_pressure: &[bool]) -> Vec<usize> {
    let pressures = |v: usize| graph.neighbours[v].iter().copied().filter(|&g| is_pressure[g] && graph.weight[g] > 0);
    let mut total = vec![0; graph.len()];
    for &v in order {
        pressures(v).for_each(|g| total[g] += graph.weight[v]);
    }
    let mut eliminated = vec![0; graph.len()];
    let mut out = Vec::with_capacity(graph.len());
    for &v in order {
        out.push(v);
        for g in pressures(v) {
            let waits = 2 * eliminated[g] < total[g];
            eliminated[g] += graph.weight[v];
            if waits && 2 * eliminated[g] >= total[g] {
                out.push(g);
            }
        }
    }
    out.extend((0..graph.len()).filter(|&g| is_pressure[g] && graph.weight[g] > 0 && total[g] == 0));
    out
}

/// What eliminating a graph in a given order does, found without numbers.
struct Elimination {
    /// Place in the order of the first vertex that each place's elimination couples; its parent in the elimination
    /// tree (Liu 1990).
    parent: Vec<Option<usize>>,
    flops: f64,
    factor_nnz: usize,
}

impl Elimination {
    fn new(graph: &Graph, order: &[usize]) -> Self {
        let mut place = vec![usize::MAX; graph.len()];
        order.iter().enumerate().for_each(|(k, &v)| place[v] = k);
        let mut parent = vec![None; order.len()];
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); order.len()];
        let mut structure: Vec<Vec<usize>> = vec![Vec::new(); order.len()];
        let mut seen_by = vec![usize::MAX; order.len()];
        let (mut flops, mut factor_nnz) = (0.0, 0);
        for (k, &v) in order.iter().enumerate() {
            // structure(k) = neighbours of k and structures of its children, as far as they come after k
            let mut below = Vec::new();
            let mut add = |p: usize| {
                if p > k && p != usize::MAX && seen_by[p] != k {
                    seen_by[p] = k;
                    below.push(p);
                }
            };
            graph.neighbours[v].iter().for_each(|&u| add(place[u]));
            for child in std::mem::take(&mut children[k]) {
                std::mem::take(&mut structure[child]).into_iter().for_each(&mut add);
            }
            let height: usize = below.iter().map(|&p| graph.weight[order[p]]).sum();
            let weight = graph.weight[v];
            flops += (1..=weight).map(|j| ((height + j) as f64).powi(2)).sum::<f64>();
            factor_nnz += weight * height + weight * (weight + 1) / 2;
            parent[k] = below.iter().copied().min();
            if let Some(p) = parent[k] {
                children[p].push(k);
            }
            structure[k] = below;
        }
        Self { parent, flops, factor_nnz }
    }

    /// An equivalent order in which every subtree of the elimination tree is contiguous, as supernodes need.
    fn postorder(&self, order: &[usize]) -> Vec<usize> {
        let mut children = vec![Vec::new(); order.len()];
        let mut roots = Vec::new();
        for (k, parent) in self.parent.iter().enumerate() {
            parent.map_or(&mut roots, |p| &mut children[p]).push(k);
        }
        let mut out = Vec::with_capacity(order.len());
        // reversed preorder with the children reversed is a postorder
        let mut stack = roots;
        while let Some(k) = stack.pop() {
            out.push(order[k]);
            stack.append(&mut children[k]);
        }
        out.reverse();
        out
    }
}
