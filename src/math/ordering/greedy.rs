//! Greedy elimination of a small graph held as a matrix of bits.

use super::Graph;

/// Which vertex goes next.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Rule {
    /// The one with the lightest neighbours.
    MinimumDegree,
    /// The one whose neighbours lack the least coupling among themselves.
    MinimumFill,
}

/// Orders the vertices of `graph` and counts the word operations it took; `None` when they exceed `budget`.
///
/// Each vertex's score is multiplied by a random number between 1 and 1 + `noise`, drawn once from `seed`.
pub(super) fn order(graph: &Graph, rule: Rule, noise: f64, seed: u64, budget: usize) -> Option<(Vec<usize>, usize)> {
    let n = graph.len();
    let mut random = SplitMix64(seed);
    let factor: Vec<f64> = (0..n).map(|_| 1.0 + noise * random.unit()).collect();
    let mut bits = Adjacency::new(graph);
    let mut score: Vec<f64> = (0..n).map(|v| bits.score(v, rule)).collect();
    let mut alive: Vec<usize> = (0..n).collect();
    let mut order = Vec::with_capacity(n);
    while !alive.is_empty() {
        let mut best = 0;
        for candidate in 1..alive.len() {
            let (a, b) = (alive[candidate], alive[best]);
            if score[a] * factor[a] < score[b] * factor[b] {
                best = candidate;
            }
        }
        // remove, not swap_remove: ties go to the lowest number
        let v = alive.remove(best);
        bits.operations += alive.len();
        order.push(v);
        for u in bits.eliminate(v, rule) {
            score[u] = bits.score(u, rule);
        }
        if bits.operations > budget {
            return None;
        }
    }
    Some((order, bits.operations))
}

/// Square matrix of bits: which living vertices touch which.
struct Adjacency {
    weight: Vec<f64>,
    /// Words of a row.
    width: usize,
    rows: Vec<u64>,
    operations: usize,
}

impl Adjacency {
    fn new(graph: &Graph) -> Self {
        let width = graph.len().div_ceil(64);
        let mut rows = vec![0; graph.len() * width];
        for (v, neighbours) in graph.neighbours.iter().enumerate() {
            neighbours.iter().for_each(|&u| rows[v * width + u / 64] |= 1 << (u % 64));
        }
        Self { weight: graph.weight.iter().map(|&w| w as f64).collect(), width, rows, operations: 0 }
    }

    fn row(&self, v: usize) -> &[u64] {
        &self.rows[v * self.width..(v + 1) * self.width]
    }

    /// Couples the neighbours of `v` with each other and takes `v` out; gives the vertices whose score has changed.
    fn eliminate(&mut self, v: usize, rule: Rule) -> Vec<usize> {
        let clique = self.row(v).to_vec();
        let mut changed = clique.clone();
        for u in ones(&clique) {
            let row = &mut self.rows[u * self.width..(u + 1) * self.width];
            row.iter_mut().zip(&clique).for_each(|(word, added)| *word |= added);
            row[u / 64] &= !(1 << (u % 64));
            row[v / 64] &= !(1 << (v % 64));
            if rule == Rule::MinimumFill {
                changed.iter_mut().zip(&*row).for_each(|(word, touched)| *word |= touched);
            }
            self.operations += 2 * self.width;
        }
        ones(&changed).collect()
    }

    /// Minimum degree: weight of the neighbours. Minimum fill: sum of w_a w_b over the ordered pairs of neighbours a, b
    /// that do not touch, plus one so that noise can tell vertices without fill apart.
    fn score(&mut self, v: usize, rule: Rule) -> f64 {
        let neighbours = self.row(v);
        let mut sum = 0.0;
        let mut operations = self.width;
        match rule {
            Rule::MinimumDegree => ones(neighbours).for_each(|u| {
                sum += self.weight[u];
                operations += 1;
            }),
            Rule::MinimumFill => {
                for u in ones(neighbours) {
                    let mut missing = -self.weight[u];
                    for (word, (all, touched)) in neighbours.iter().zip(self.row(u)).enumerate() {
                        for bit in ones(&[all & !touched]) {
                            missing += self.weight[64 * word + bit];
                            operations += 1;
                        }
                    }
                    sum += missing * self.weight[u];
                    operations += 2 * self.width;
                }
                sum += 1.0;
            }
        }
        self.operations += operations;
        sum
    }
}

/// Positions of the bits that are set, ascending.
fn ones(words: &[u64]) -> impl Iterator<Item = usize> + '_ {
    words.iter().enumerate().flat_map(|(index, &word)| {
        std::iter::successors((word != 0).then_some(word), |w| Some(w & (w - 1)).filter(|&rest| rest != 0))
            .map(move |w| 64 * index + w.trailing_zeros() as usize)
    })
}

/// Steele, Lea, Flood 2014: a random sequence in one 64-bit state.
struct SplitMix64(u64);

impl SplitMix64 {
    /// Uniform in [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}
