//! Continuous angles from axes: which half turns nodes and corners of elements have.
//!
//! An axis at a node has the angles (A, B), and as well (A + pi, -B). Between two nodes it matters which: from -60 to 60 degrees
//! the fibre may pass through 0 or through 90. The data inside the element know. Then a tree of edges through the mesh
//! gives every node its half turns; an element in which the tree closes otherwise (on a way about a hole that
//! the fibre turns along) keeps half turns of its own at some corners.

use super::embed::{Sample, Samples};
use super::space::Angles;
use crate::mesh::element::ends;
use rayon::prelude::*;
use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::PI;

/// Steps of the turn per element that are tried, in each direction from -STEPS to STEPS.
const STEPS: i32 = 4;
/// The turn per element in one of them.
const STEP: f64 = PI / 4.0;
/// Samples of an element that are looked at.
const MOST: usize = 200;
/// With fewer than this some turn would fit by chance, and the nearer way between two axes is taken: among 9^3 turns the best
/// sum of n random axes is about sqrt(ln 729 / n), a half of what it could be for 30.
const LEAST: usize = 30;
/// How much better a turn by pi along one direction must fit than none.
const PRICE: f64 = 0.02;

/// The change of A along xi1, xi2, xi3 in an element: the greatest |sum of w exp(2 i (alpha - g . xi))| / sum of w over a grid
/// of g, alpha the angle of the axis in the plane (f1, f2), w its length there; a turn must earn its place.
fn turn(samples: &[Sample]) -> Option<[f64; 3]> {
    if samples.len() < LEAST {
        return None;
    }
    let across = (2 * STEPS + 1) as usize;
    let mut sums = vec![[0.0_f64; 2]; across.pow(3)];
    let mut total = 0.0;
    let stride = samples.len().div_ceil(MOST);
    for sample in samples.iter().step_by(stride) {
        let [x, y, _] = sample.axis;
        let weight = sample.weight * (x * x + y * y);
        total += weight;
        let double = 2.0 * y.atan2(x);
        // exp(-2 i k STEP (xi - 1/2)) for all k, per direction
        let turned = sample.xi.map(|xi| {
            (-STEPS..=STEPS).map(|k| (-2.0 * STEP * f64::from(k) * (xi - 0.5)).sin_cos()).collect::<Vec<_>>()
        });
        for (i, first) in turned[2].iter().enumerate() {
            for (j, second) in turned[1].iter().enumerate() {
                let (s, c) = double.sin_cos();
                let (s, c) = (s * first.1 + c * first.0, c * first.1 - s * first.0);
                let (s, c) = (s * second.1 + c * second.0, c * second.1 - s * second.0);
                for (k, third) in turned[0].iter().enumerate() {
                    let sum = &mut sums[(i * across + j) * across + k];
                    sum[0] += weight * (c * third.1 - s * third.0);
                    sum[1] += weight * (s * third.1 + c * third.0);
                }
            }
        }
    }
    let steps =
        |index: usize| [index % across, index / across % across, index / across / across].map(|k| k as i32 - STEPS);
    let score = |index: usize| {
        let squares: i32 = steps(index).iter().map(|k| k * k).sum();
        sums[index][0].hypot(sums[index][1]) / total - PRICE * f64::from(squares) * (STEP / PI).powi(2)
    };
    let best = (0..sums.len()).max_by(|a, b| score(*a).total_cmp(&score(*b)))?;
    (total > 0.0).then(|| steps(best).map(|k| f64::from(k) * STEP))
}

/// Makes the angles at the nodes continuous, beginning at node `first`, and tells the half turns that are left at corners.
pub fn unwrap(samples: &Samples, corners: &[[usize; 8]], angles: &mut Angles, first: usize) -> Vec<[i32; 8]> {
    let turns: Vec<Option<[f64; 3]>> = (0..samples.elements()).into_par_iter().map(|e| turn(samples.of(e))).collect();
    // votes of the elements for the half turns along each edge, from the lower to the higher node
    let mut votes: BTreeMap<(usize, usize), BTreeMap<i32, f64>> = BTreeMap::new();
    for (e, nodes) in corners.iter().enumerate() {
        let sure = match turns[e] {
            Some(_) => samples.of(e).len().min(MOST) as f64,
            None => 1e-3,
        };
        for corner in 0..8 {
            for d in (0..3).filter(|d| corner >> d & 1 == 0) {
                let (p, q) = (nodes[corner], nodes[corner | 1 << d]);
                if p == q {
                    continue;
                }
                let change = turns[e].map_or(0.0, |turn| turn[d]);
                let k = ((change - (angles[q][0] - angles[p][0])) / PI).round() as i32;
                let (edge, k) = if p < q { ((p, q), k) } else { ((q, p), -k) };
                *votes.entry(edge).or_default().entry(k).or_insert(0.0) += sure;
            }
        }
    }
    let elected: BTreeMap<(usize, usize), i32> = votes
        .into_iter()
        .map(|(edge, votes)| {
            let best = votes.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k);
            (edge, best)
        })
        .collect();
    let along = |p: usize, q: usize| match p.cmp(&q) {
        std::cmp::Ordering::Less => elected.get(&(p, q)).copied().unwrap_or(0),
        std::cmp::Ordering::Equal => 0,
        std::cmp::Ordering::Greater => -elected.get(&(q, p)).copied().unwrap_or(0),
    };

    let mut neighbours: Vec<Vec<usize>> = vec![Vec::new(); angles.len()];
    for (p, q) in elected.keys() {
        neighbours[*p].push(*q);
        neighbours[*q].push(*p);
    }
    let mut half_turns: Vec<Option<i32>> = vec![None; angles.len()];
    for seed in std::iter::once(first).chain(0..angles.len()) {
        if half_turns[seed].is_some() {
            continue;
        }
        half_turns[seed] = Some(0);
        let mut queue = VecDeque::from([seed]);
        while let Some(p) = queue.pop_front() {
            for &q in &neighbours[p] {
                if half_turns[q].is_none() {
                    half_turns[q] = half_turns[p].map(|k| k + along(p, q));
                    queue.push_back(q);
                }
            }
        }
    }
    let half_turns: Vec<i32> = half_turns.into_iter().map(Option::unwrap_or_default).collect();
    for (angles, k) in angles.iter_mut().zip(&half_turns) {
        angles[0] += PI * f64::from(*k);
        angles[1] *= if k % 2 == 0 { 1.0 } else { -1.0 };
    }
    let left = |nodes: &[usize; 8]| {
        // half turns along edges from corner 0, less those that the nodes have
        let mut local = [0; 8];
        for corner in 1..8 {
            let d = (0..3).find(|d| ends(corner)[*d] == 1).unwrap_or_default();
            let from = corner & !(1 << d);
            local[corner] = local[from] + along(nodes[from], nodes[corner]);
        }
        let left: [i32; 8] = std::array::from_fn(|c| local[c] - (half_turns[nodes[c]] - half_turns[nodes[0]]));
        // the element as a whole may turn: most corners are to have none
        let common = (0..8).max_by_key(|c| (left.iter().filter(|k| **k == left[*c]).count(), 8 - c));
        left.map(|k| k - left[common.unwrap_or_default()])
    };
    corners.iter().map(left).collect()
}
