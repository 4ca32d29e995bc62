//! Are symmetric indefinite systems of mixed elements solved fast, exactly and reproducibly?
//!
//! The systems are synthetic: random positive definite element matrices for the displacements, random constraint rows
//! for the pressures, on grids of box elements. They have the shape and the signs of a mixed body, not its physics.

use std::sync::Arc;

use risorius::Error;
use risorius::math::factor::{Factor, Inertia, Symbolic};
use risorius::math::ordering::Ordering;
use risorius::math::sparse::{BlockPattern, SymmetricMatrix};

/// A uniform random sequence in [-1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }
}

/// How the pressures are numbered.
#[derive(Clone, Copy, PartialEq)]
enum Pressure {
    /// One unknown at each node, last in its group.
    Continuous,
    /// A group of eight unknowns for each element.
    Discontinuous,
}

/// A grid of elements with its unknowns.
struct Grid {
    group_start: Vec<usize>,
    cliques: Vec<Vec<usize>>,
    pressure_groups: Vec<usize>,
    /// Whether each unknown is a pressure.
    is_pressure: Vec<bool>,
}

impl Grid {
    /// `cells` elements along each direction, `displacements(node)` displacement unknowns at a node.
    fn new(cells: [usize; 3], pressure: Pressure, displacements: impl Fn([usize; 3]) -> usize) -> Self {
        let [nx, ny, nz] = cells.map(|c| c + 1);
        let node = |i, j, k| i + nx * (j + ny * k);
        let mut grid = Self { group_start: vec![0], cliques: vec![], pressure_groups: vec![], is_pressure: vec![] };
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    let size = displacements([i, j, k]);
                    grid.is_pressure.extend(vec![false; size]);
                    if pressure == Pressure::Continuous {
                        if size == 0 {
                            grid.pressure_groups.push(grid.group_start.len() - 1);
                        }
                        grid.is_pressure.push(true);
                    }
                    grid.group_start.push(grid.is_pressure.len());
                }
            }
        }
        for k in 0..cells[2] {
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    let corner = |c: usize| node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                    let mut clique: Vec<usize> = (0..8).map(corner).collect();
                    if pressure == Pressure::Discontinuous {
                        let group = grid.group_start.len() - 1;
                        grid.pressure_groups.push(group);
                        clique.push(group);
                        grid.is_pressure.extend([true; 8]);
                        grid.group_start.push(grid.is_pressure.len());
                    }
                    grid.cliques.push(clique);
                }
            }
        }
        grid
    }

    fn pattern(&self) -> Arc<BlockPattern> {
        Arc::new(BlockPattern::new(&self.group_start, self.cliques.iter().map(|clique| clique.as_slice())))
    }

    /// Sum over the elements of [[I + v v^T, B^T], [B, 0]], entries placed by the offsets of the pattern.
    ///
    /// Elements differ in stiffness by a factor of `contrast`; pressures are `pressure_scale` times a natural unit.
    fn matrix(&self, pattern: &Arc<BlockPattern>, seed: u64, contrast: f64, pressure_scale: f64) -> SymmetricMatrix {
        let mut random = Random(seed);
        let mut matrix = SymmetricMatrix::zeros(pattern.clone());
        for clique in &self.cliques {
            let mut groups = clique.clone();
            groups.sort_unstable();
            let unknowns: Vec<usize> = groups.iter().flat_map(|&g| pattern.unknowns(g)).collect();
            let stiffness = contrast.powf(random.next());
            let v = random.vector(pattern.n().min(1).max(unknowns.len()));
            // the diagonal keeps the constraint rows of an element independent
            let mut entry = |a: usize, b: usize| match (self.is_pressure[unknowns[a]], self.is_pressure[unknowns[b]])
            {
                (false, false) => stiffness * (v[a] * v[b] + if a == b { 1.0 } else { 0.0 }),
                (true, true) => 0.0,
                _ => pressure_scale * random.next(),
            };
            let mut first_column = 0;
            for (place, &g) in groups.iter().enumerate() {
                let size = pattern.unknowns(g).len();
                for a in 0..size {
                    let start = pattern.col_ptr()[pattern.unknowns(g).start + a];
                    for b in a..size {
                        matrix.values[start + b - a] += entry(first_column + b, first_column + a);
                    }
                    let mut first_row = first_column + size;
                    for &h in &groups[place + 1..] {
                        let rows = pattern.unknowns(h).len();
                        for b in 0..rows {
                            let offset = pattern.offset(g, h).unwrap();
                            matrix.values[start + size - a + offset + b] += entry(first_row + b, first_column + a);
                        }
                        first_row += rows;
                    }
                }
                first_column += size;
            }
        }
        matrix
    }

    fn ordering(&self, pattern: &BlockPattern) -> Ordering {
        Ordering::new(pattern, &self.pressure_groups)
    }

    fn expected_inertia(&self) -> Inertia {
        let negative = self.is_pressure.iter().filter(|&&p| p).count();
        Inertia { positive: self.is_pressure.len() - negative, negative, zero: 0 }
    }
}
#[test]
fn bench() {
    for (c, p) in [([28, 20, 1], Pressure::Continuous), ([28, 20, 1], Pressure::Discontinuous)] {
        let t = std::time::Instant::now();
        let grid = Grid::new(c, p, |_| 24);
        let pattern = grid.pattern();
        eprintln!("n {} nnz {} pattern {:?}", pattern.n(), pattern.nnz(), t.elapsed());
        let t = std::time::Instant::now();
        let ordering = grid.ordering(&pattern);
        eprintln!("ordering {:?} flops {:.3}G nnzL {}", t.elapsed(), ordering.flops / 1e9, ordering.factor_nnz);
        let a = grid.matrix(&pattern, 1, 10.0, 100.0);
        let t = std::time::Instant::now();
        let s = Symbolic::new(pattern.clone(), &ordering).unwrap();
        eprintln!("symbolic {:?}", t.elapsed());
        let mut f = Factor::new(s).unwrap();
        for threads in [1, 2, 1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let t = std::time::Instant::now();
                f.refactor(&a).unwrap();
                let tf = t.elapsed();
                let b = Random(3).vector(pattern.n());
                let mut x = b.clone();
                let t = std::time::Instant::now();
                let q = f.solve(&a, &mut x, 1, 1e-13);
                let ts = t.elapsed();
                let mut y = b.clone();
                let t = std::time::Instant::now();
                a.multiply(&x, &mut y);
                let tm = t.elapsed();
                let mut xx = Random(3).vector(32 * pattern.n());
                let t = std::time::Instant::now();
                let q32 = f.solve(&a, &mut xx, 32, 1e-13);
                let ts32 = t.elapsed();
                let mut yy = xx.clone();
                let t = std::time::Instant::now();
                a.multiply_columns(&xx, &mut yy, 32);
                let tm32 = t.elapsed();
                let mut h = 0u64;
                for v in &x { h = h.wrapping_mul(31).wrapping_add(v.to_bits()); }
                for v in &xx { h = h.wrapping_mul(31).wrapping_add(v.to_bits()); }
                let res = y.iter().zip(&b).map(|(y, b)| (y - b).powi(2)).sum::<f64>().sqrt() / b.iter().map(|b| b * b).sum::<f64>().sqrt();
                eprintln!("{threads} thr: factor {tf:?} solve {ts:?} {q:?} true {res:.1e} mul {tm:?} solve32 {ts32:?} {q32:?} mul32 {tm32:?} hash {h:x} {:?}", f.inertia());
            });
        }
        assert_eq!(f.inertia(), grid.expected_inertia());
    }
}
