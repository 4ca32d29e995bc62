//! Are symmetric indefinite systems of mixed elements solved fast, exactly and reproducibly?
//!
//! The systems are synthetic: random positive definite element matrices for the displacements, random constraint rows
//! for the pressures, on grids of box elements. They have the shape and the signs of a mixed body, not its physics.

use std::sync::Arc;

use risorius::Error;
use risorius::math::factor::{Factor, Inertia, Precision, Symbolic};
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
            let v = random.vector(unknowns.len());
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

fn factored(grid: &Grid, matrix: &SymmetricMatrix) -> Factor {
    factored_in(grid, matrix, Precision::Double)
}

fn factored_in(grid: &Grid, matrix: &SymmetricMatrix, precision: Precision) -> Factor {
    let symbolic = Symbolic::new(matrix.pattern.clone(), &grid.ordering(&matrix.pattern)).unwrap();
    let mut factor = Factor::new(symbolic, precision).unwrap();
    factor.refactor(matrix).unwrap();
    factor
}

fn dense(matrix: &SymmetricMatrix) -> nalgebra::DMatrix<f64> {
    let pattern = &matrix.pattern;
    let mut dense = nalgebra::DMatrix::zeros(pattern.n(), pattern.n());
    for j in 0..pattern.n() {
        for entry in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
            let i = pattern.row_idx()[entry];
            dense[(i, j)] = matrix.values[entry];
            dense[(j, i)] = matrix.values[entry];
        }
    }
    dense
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    norm(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>())
}

fn small_grids() -> Vec<(&'static str, Grid)> {
    // a clamped face, a symmetry plane, and nodes here and there that lost some or all displacements
    let supported = |[i, j, k]: [usize; 3]| match (i, j, k) {
        (0, _, _) => 0,
        (_, 0, _) => 16,
        _ if (i + 2 * j + 3 * k) % 5 == 0 => 3,
        _ => 24,
    };
    vec![
        ("continuous", Grid::new([3, 2, 1], Pressure::Continuous, |_| 24)),
        ("discontinuous", Grid::new([3, 2, 1], Pressure::Discontinuous, |_| 24)),
        ("continuous, supported", Grid::new([3, 2, 2], Pressure::Continuous, supported)),
        ("discontinuous, supported", Grid::new([3, 2, 2], Pressure::Discontinuous, supported)),
    ]
}

#[test]
fn offsets_agree_with_a_search_in_every_column() {
    for (name, grid) in small_grids() {
        let pattern = grid.pattern();
        for g in 0..pattern.groups() {
            for h in g + 1..pattern.groups() {
                let touch = grid.cliques.iter().any(|clique| clique.contains(&g) && clique.contains(&h));
                let offset = pattern.offset(g, h);
                assert_eq!(
                    offset.is_some(),
                    touch && !pattern.unknowns(h).is_empty() && !pattern.unknowns(g).is_empty()
                );
                for (a, column) in pattern.unknowns(g).enumerate() {
                    let rows = &pattern.row_idx()[pattern.col_ptr()[column]..pattern.col_ptr()[column + 1]];
                    for (b, row) in pattern.unknowns(h).enumerate() {
                        let computed = offset.map(|offset| pattern.unknowns(g).len() - a + offset + b);
                        assert_eq!(rows.binary_search(&row).ok(), computed, "{name}");
                    }
                }
            }
        }
    }
}

#[test]
fn products_and_solutions_agree_with_dense_matrices() {
    for (name, grid) in small_grids() {
        let matrix = grid.matrix(&grid.pattern(), 5, 10.0, 1.0);
        let n = matrix.pattern.n();
        let reference = dense(&matrix);
        assert_eq!(matrix.diagonal(), reference.diagonal().as_slice());

        let x = Random(11).vector(3 * n);
        let mut b = vec![0.0; 3 * n];
        matrix.multiply_columns(&x, &mut b, 3);
        let expected = &reference * nalgebra::DMatrix::from_column_slice(n, 3, &x);
        assert!(difference(&b, expected.as_slice()) <= 1e-14 * norm(&b), "{name}");

        let mut solved = b.clone();
        let mut factor = factored(&grid, &matrix);
        let quality = factor.solve(&matrix, &mut solved, 3, 1e-14).unwrap();
        let expected = reference.lu().solve(&nalgebra::DMatrix::from_column_slice(n, 3, &b)).unwrap();
        assert!(difference(&solved, expected.as_slice()) <= 1e-10 * norm(&x), "{name}: {quality:?}");
        assert_eq!(factor.inertia(), grid.expected_inertia(), "{name}");
    }
}

#[test]
fn large_systems_are_solved_to_rounding_with_the_right_inertia() {
    for (cells, pressure) in [([12, 8, 1], Pressure::Continuous), ([8, 6, 2], Pressure::Discontinuous)] {
        let grid = Grid::new(cells, pressure, |[_, _, k]| if k == 0 { 12 } else { 24 });
        // stiffness over four decades, pressures in a unit of their own
        let matrix = grid.matrix(&grid.pattern(), 2, 100.0, 1e5);
        let mut factor = factored(&grid, &matrix);
        // a right-hand side as large as the matrix times the solution: else rounding in A x alone exceeds the tolerance
        let expected: Vec<f64> = Random(3).vector(matrix.pattern.n());
        let mut b = vec![0.0; expected.len()];
        matrix.multiply(&expected, &mut b);
        let mut x = b.clone();
        let quality = factor.solve(&matrix, &mut x, 1, 1e-14).unwrap();
        let mut product = vec![0.0; b.len()];
        matrix.multiply(&x, &mut product);
        assert!(quality.residual <= 1e-12 && quality.sweeps <= 3, "{quality:?}");
        assert!(difference(&product, &b) <= 1e-12 * norm(&b));
        assert_eq!(factor.inertia(), grid.expected_inertia());
    }
}

#[test]
fn a_factor_in_single_precision_gives_the_same_solutions_with_more_sweeps() {
    for (cells, pressure) in [([12, 8, 1], Pressure::Continuous), ([8, 6, 2], Pressure::Discontinuous)] {
        let grid = Grid::new(cells, pressure, |[_, _, k]| if k == 0 { 12 } else { 24 });
        let matrix = grid.matrix(&grid.pattern(), 2, 100.0, 1e5);
        let mut b = vec![0.0; 3 * matrix.pattern.n()];
        matrix.multiply_columns(&Random(3).vector(b.len()), &mut b, 3);
        let [double, single] = [Precision::Double, Precision::Single].map(|precision| {
            let mut factor = factored_in(&grid, &matrix, precision);
            let mut x = b.clone();
            let quality = factor.solve(&matrix, &mut x, 3, 1e-13).unwrap();
            assert!(quality.residual <= 1e-13, "{precision:?}: {quality:?}");
            // over five decades single precision cannot tell small eigenvalues from zero, but takes none for negative
            let (inertia, expected) = (factor.inertia(), grid.expected_inertia());
            assert_eq!(inertia.negative, expected.negative, "{precision:?}");
            assert_eq!(inertia.positive + inertia.zero, expected.positive, "{precision:?}");
            (x, quality.sweeps)
        });
        assert!(difference(&double.0, &single.0) <= 1e-9 * norm(&double.0));
        assert!(single.1 > double.1 && single.1 <= 8, "{} and {} sweeps", single.1, double.1);
    }
}

#[test]
fn the_order_costs_less_than_approximate_minimum_degree_on_the_unknowns() {
    use faer::Side;
    use faer::sparse::linalg::cholesky::{SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky};
    use faer::sparse::linalg::{SupernodalThreshold, SymbolicSupernodalParams};
    let grid = Grid::new([14, 10, 1], Pressure::Continuous, |_| 24);
    let pattern = grid.pattern();
    let columns = faer::sparse::SymbolicSparseColMatRef::new_checked(
        pattern.n(),
        pattern.n(),
        pattern.col_ptr(),
        None,
        pattern.row_idx(),
    );
    // no relaxation: the count is that of the order alone
    let symbolic = |order| {
        let parameters = faer::sparse::linalg::cholesky::CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            supernodal_params: SymbolicSupernodalParams { relax: None },
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(columns, Side::Lower, order, parameters).unwrap();
        let SymbolicCholeskyRaw::Supernodal(structure) = symbolic.raw() else { panic!("supernodes were asked for") };
        let mut flops = 0.0;
        for s in 0..structure.n_supernodes() {
            let width = structure.supernode_end()[s] - structure.supernode_begin()[s];
            let height = structure.supernode(s).pattern().len();
            flops += (1..=width).map(|j| ((height + j) as f64).powi(2)).sum::<f64>();
        }
        flops
    };
    let ordering = grid.ordering(&pattern);
    let mut inverse = vec![0; pattern.n()];
    ordering.permutation.iter().enumerate().for_each(|(place, &unknown)| inverse[unknown] = place);
    let ours = symbolic(SymmetricOrdering::Custom(faer::perm::PermRef::new_checked(
        &ordering.permutation,
        &inverse,
        pattern.n(),
    )));
    let amd = symbolic(SymmetricOrdering::Amd);
    assert!((ours - ordering.flops).abs() <= 1e-9 * ours, "counted {} on groups, {ours} on unknowns", ordering.flops);
    assert!(ours <= 0.95 * amd, "{ours} against {amd}");
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    // fronts large enough to be shared among threads
    for (cells, pressure) in [([14, 10, 1], Pressure::Continuous), ([8, 6, 1], Pressure::Discontinuous)] {
        let grid = Grid::new(cells, pressure, |_| 24);
        let pattern = grid.pattern();
        let matrix = grid.matrix(&pattern, 1, 10.0, 1.0);
        let newer = grid.matrix(&pattern, 1, 12.0, 1.0);
        let run = |threads| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let mut factor = factored(&grid, &matrix);
                let mut x = Random(3).vector(20 * pattern.n());
                factor.solve(&newer, &mut x, 20, 1e-9).unwrap();
                x.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
            })
        };
        let one = run(1);
        assert!(one == run(2) && one == run(4));
    }
}

#[test]
fn parts_that_do_not_touch_are_solved_side_by_side() {
    let mut grid = Grid::new([6, 2, 1], Pressure::Continuous, |_| 24);
    // no element between the third and the fourth row of nodes
    grid.cliques.retain(|clique| clique[0] % 7 != 2);
    let matrix = grid.matrix(&grid.pattern(), 4, 10.0, 1.0);
    let b = Random(3).vector(matrix.pattern.n());
    let mut x = b.clone();
    let mut factor = factored(&grid, &matrix);
    let quality = factor.solve(&matrix, &mut x, 1, 1e-13).unwrap();
    let mut product = vec![0.0; b.len()];
    matrix.multiply(&x, &mut product);
    assert!(quality.residual <= 1e-13 && difference(&product, &b) <= 1e-11 * norm(&b), "{quality:?}");
    assert_eq!(factor.inertia(), grid.expected_inertia());
}

#[test]
fn a_stale_factor_still_solves_the_new_matrix() {
    let grid = Grid::new([8, 6, 1], Pressure::Continuous, |_| 24);
    let pattern = grid.pattern();
    let old = grid.matrix(&pattern, 1, 10.0, 1.0);
    let new = grid.matrix(&pattern, 1, 14.0, 1.0);
    let mut factor = factored(&grid, &old);
    let b = Random(3).vector(pattern.n());
    let mut x = b.clone();
    let quality = factor.solve(&new, &mut x, 1, 1e-9).unwrap();
    let mut product = vec![0.0; b.len()];
    new.multiply(&x, &mut product);
    assert!(quality.residual <= 1e-9 && quality.sweeps > 1, "{quality:?}");
    assert!(difference(&product, &b) <= 1e-8 * norm(&b));
    let work = factor.work();
    assert_eq!((work.factorisations, work.solves, work.sweeps), (1, 1, quality.sweeps));
    assert_eq!(work.factor_flops, factor.flops());
}

/// Where two places touch that were apart, the matrix has entries that the factor does not know.
#[test]
fn a_factor_of_another_pattern_still_solves_the_new_matrix() {
    let grid = Grid::new([8, 6, 1], Pressure::Continuous, |_| 24);
    let mut touching = Grid::new([8, 6, 1], Pressure::Continuous, |_| 24);
    let nodes = touching.group_start.len() - 1;
    touching.cliques.push(vec![0, nodes - 1]);
    let old = grid.matrix(&grid.pattern(), 1, 10.0, 1.0);
    let new = touching.matrix(&touching.pattern(), 1, 10.0, 1.0);
    let mut factor = factored(&grid, &old);
    let b = Random(3).vector(new.pattern.n());
    let mut x = b.clone();
    let quality = factor.solve_within(&new, &mut x, 1, 1e-9, 60).unwrap();
    let mut product = vec![0.0; b.len()];
    new.multiply(&x, &mut product);
    assert!(quality.residual <= 1e-9 && quality.sweeps > 1, "{quality:?}");
    assert!(difference(&product, &b) <= 1e-8 * norm(&b));
    let few = factor.solve_within(&new, &mut b.clone(), 1, 1e-9, 1).unwrap();
    assert!(few.residual > 1e-9 && few.sweeps <= 1, "{few:?}");
}

#[test]
fn a_useless_factor_says_so_and_ends() {
    let grid = Grid::new([3, 2, 1], Pressure::Continuous, |_| 24);
    let pattern = grid.pattern();
    let mut factor = factored(&grid, &grid.matrix(&pattern, 1, 10.0, 1.0));
    let mut x = Random(3).vector(pattern.n());
    let quality = factor.solve(&grid.matrix(&pattern, 99, 1e6, 1.0), &mut x, 1, 1e-12).unwrap();
    assert!(quality.residual > 1e-12 && quality.residual <= 1.0, "{quality:?}");
}

#[test]
fn values_that_are_not_finite_are_refused() {
    let grid = Grid::new([2, 2, 1], Pressure::Discontinuous, |_| 24);
    let good = grid.matrix(&grid.pattern(), 1, 10.0, 1.0);
    let mut factor = factored(&grid, &good);
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut rhs = vec![1.0; good.pattern.n()];
        rhs[7] = value;
        assert!(matches!(factor.solve(&good, &mut rhs, 1, 1e-12), Err(Error::NotFinite)));
        let mut bad = good.clone();
        bad.values[1000] = value;
        let mut rhs = vec![1.0; good.pattern.n()];
        assert!(matches!(factor.solve(&bad, &mut rhs, 1, 1e-12), Err(Error::NotFinite)));
        assert!(matches!(factor.refactor(&bad), Err(Error::NotFinite)));
        assert!(matches!(factor.solve(&good, &mut rhs, 1, 1e-12), Err(Error::NotFactored)));
        factor.refactor(&good).unwrap();
    }
}

#[test]
fn a_singular_matrix_is_refused_and_names_an_unknown() {
    let grid = Grid::new([2, 1, 1], Pressure::Continuous, |_| 24);
    let pattern = grid.pattern();
    let mut factor =
        Factor::new(Symbolic::new(pattern.clone(), &grid.ordering(&pattern)).unwrap(), Precision::Double).unwrap();
    let refused = factor.refactor(&SymmetricMatrix::zeros(pattern.clone()));
    assert!(matches!(refused, Err(Error::Singular { unknown }) if unknown < pattern.n()), "{refused:?}");
}

#[test]
fn the_empty_system_is_solved() {
    let pattern = Arc::new(BlockPattern::new(&[0, 0, 0], [[0usize, 1].as_slice()]));
    let matrix = SymmetricMatrix::zeros(pattern.clone());
    let ordering = Ordering::new(&pattern, &[]);
    let mut factor = Factor::new(Symbolic::new(pattern, &ordering).unwrap(), Precision::Double).unwrap();
    factor.refactor(&matrix).unwrap();
    let quality = factor.solve(&matrix, &mut [], 4, 1e-12).unwrap();
    assert_eq!((quality.residual, quality.sweeps, factor.inertia()), (0.0, 0, Inertia::default()));
}
