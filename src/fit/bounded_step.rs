//! The step of the fit: a convex quadratic program in a box, solved by Clarabel.
//!
//!   minimise 1/2 d^T H d + g^T d,   lower <= d <= upper

use crate::error::{Error, Result};
use crate::math::block_tridiagonal::BlockTridiagonal;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use nalgebra::{DMatrix, DVector};

/// The minimiser of the quadratic program. `h` is symmetric and positive semidefinite; the box must not be empty.
///
/// # Errors
/// [`Error::StepNotSolved`] with Clarabel's status by name unless that is Solved, or nearly.
pub fn bounded_step(h: &DMatrix<f64>, g: &[f64], lower: &[f64], upper: &[f64]) -> Result<Vec<f64>> {
    let n = g.len();
    let largest = (0..n).map(|i| h[(i, i)]).fold(0.0, f64::max);
    let column = |j: usize| (0..=j).map(|i| (i, h[(i, j)])).collect();
    let times = |d: &[f64]| (0..n).map(|i| (0..n).map(|k| h[(i, k)] * d[k]).sum()).collect();
    program(largest, column, (&|fixed| on_active_set(h, g, fixed), &times), g, lower, upper)
}

/// The same for a chain of blocks.
///
/// # Errors
/// As [`bounded_step`].
pub fn bounded_step_in_chain(h: &BlockTridiagonal, g: &[f64], lower: &[f64], upper: &[f64]) -> Result<Vec<f64>> {
    let starts = &h.starts();
    let column = |j: usize| {
        let block = starts.partition_point(|start| *start <= j) - 1;
        let at = j - starts[block];
        let above =
            block.checked_sub(1).map(|k| (0..h.next[k].nrows()).map(move |i| (starts[k] + i, h.next[k][(i, at)])));
        let own = (0..=at).map(|i| (starts[block] + i, h.diagonal[block][(i, at)]));
        above.into_iter().flatten().chain(own).collect()
    };
    let exact = |fixed: &[Option<f64>]| {
        let free: Vec<bool> = fixed.iter().map(Option::is_none).collect();
        let held: Vec<f64> = fixed.iter().map(|f| f.unwrap_or(0.0)).collect();
        let right: Vec<f64> = h.times(&held).iter().zip(g).map(|(h, g)| -g - h).collect();
        let found = h.solve(&free, &right)?;
        Some(found.iter().zip(fixed).map(|(found, fixed)| fixed.unwrap_or(*found)).collect())
    };
    program(h.largest(), column, (&exact, &|d| h.times(d)), g, lower, upper)
}

/// The minimiser with some entries fixed, if there is one, and H times a vector.
type Exact<'a> = (&'a dyn Fn(&[Option<f64>]) -> Option<Vec<f64>>, &'a dyn Fn(&[f64]) -> Vec<f64>);

/// `column` gives the entries of a column down to the diagonal.
fn program(
    largest: f64,
    column: impl Fn(usize) -> Vec<(usize, f64)>,
    exact: Exact<'_>,
    g: &[f64],
    lower: &[f64],
    upper: &[f64],
) -> Result<Vec<f64>> {
    let n = g.len();
    if n == 0 {
        return Ok(Vec::new());
    }
    // Clarabel's tolerances are absolute: bring the problem to unit size
    let scale = largest.max(f64::MIN_POSITIVE);
    let (mut columns, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for j in 0..n {
        for (i, value) in column(j) {
            rows.push(i);
            values.push(value / scale);
        }
        columns.push(rows.len());
    }
    let p = CscMatrix::new(n, n, columns, rows, values);
    let q: Vec<f64> = g.iter().map(|g| g / scale).collect();
    // d + s = upper, - d + s = - lower, s >= 0
    let a = CscMatrix::new(
        2 * n,
        n,
        (0..=n).map(|j| 2 * j).collect(),
        (0..n).flat_map(|j| [j, n + j]).collect(),
        (0..n).flat_map(|_| [1.0, -1.0]).collect(),
    );
    let b: Vec<f64> = upper.iter().copied().chain(lower.iter().map(|l| -l)).collect();
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .max_threads(1)
        .tol_gap_abs(1e-12)
        .tol_gap_rel(1e-12)
        .tol_feas(1e-12)
        .build()
        .map_err(|_| Error::StepNotSolved { status: "InvalidSettings" })?;
    let mut solver = DefaultSolver::new(&p, &q, &a, &b, &[NonnegativeConeT(2 * n)], settings)
        .map_err(|_| Error::StepNotSolved { status: "InvalidProblem" })?;
    solver.solve();
    let status = solver.solution.status;
    // the last digits are found below; where curvatures lie ten powers of ten apart Clarabel comes near them only
    if !matches!(status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return Err(Error::StepNotSolved { status: name(status) });
    }
    let (x, z, slack) = (&solver.solution.x, &solver.solution.z, &solver.solution.s);
    // rows of the constraints: first upper bounds, then lower; an active one has a multiplier larger than its slack
    let active = |row: usize| z[row] > slack[row];
    let fixed: Vec<Option<f64>> =
        (0..n).map(|i| if active(i) { Some(upper[i]) } else { active(n + i).then_some(lower[i]) }).collect();
    let inside = |d: &[f64]| d.iter().zip(lower).zip(upper).all(|((d, l), u)| (l..=u).contains(&d));
    let first = exact.0(&fixed).filter(|d| inside(d));
    match on_right_set(exact, fixed, g, (lower, upper)).or(first) {
        Some(exact) => Ok(exact),
        // a degenerate active set: what Clarabel found, which is inside to its tolerance
        None => Ok(x.iter().zip(lower).zip(upper).map(|((d, l), u)| d.clamp(*l, *u)).collect()),
    }
}

/// Most changes of the set of active bounds, and the part of the terms of a slope that is rounding.
const CHANGES: usize = 30;
const ROUNDING: f64 = 1e-10;

/// The minimiser, from a guess of its active bounds: what lies beyond a bound is held there, what a bound holds against its
/// slope is let go (primal-dual active sets, Hintermueller, Ito and Kunisch 2002). `None` where that does not end.
fn on_right_set(
    (exact, times): Exact<'_>,
    mut fixed: Vec<Option<f64>>,
    g: &[f64],
    (lower, upper): (&[f64], &[f64]),
) -> Option<Vec<f64>> {
    for _ in 0..CHANGES {
        let d = exact(&fixed)?;
        let hd = times(&d);
        let right = |i: usize| {
            let (slope, rounding) = (g[i] + hd[i], ROUNDING * (g[i].abs() + hd[i].abs()));
            match fixed[i] {
                Some(at) if at <= lower[i] => (slope >= -rounding).then_some(at),
                Some(at) => (slope <= rounding).then_some(at),
                None if d[i] < lower[i] => Some(lower[i]),
                None => (d[i] > upper[i]).then_some(upper[i]),
            }
        };
        let next: Vec<Option<f64>> = (0..g.len()).map(right).collect();
        if next == fixed {
            return Some(d);
        }
        fixed = next;
    }
    None
}

/// The minimiser with some entries fixed: an interior-point method only comes near a bound, and this ends on it.
fn on_active_set(h: &DMatrix<f64>, g: &[f64], fixed: &[Option<f64>]) -> Option<Vec<f64>> {
    let n = g.len();
    let free: Vec<usize> = (0..n).filter(|i| fixed[*i].is_none()).collect();
    let mut d: Vec<f64> = fixed.iter().map(|f| f.unwrap_or(0.0)).collect();
    let right = DVector::from_iterator(
        free.len(),
        free.iter().map(|i| -g[*i] - (0..n).map(|k| h[(*i, k)] * d[k]).sum::<f64>()),
    );
    let solution = h.select_rows(&free).select_columns(&free).cholesky()?.solve(&right);
    for (i, value) in free.iter().zip(solution.iter()) {
        d[*i] = *value;
    }
    d.iter().all(|d| d.is_finite()).then_some(d)
}

/// Every status of Clarabel by name.
fn name(status: SolverStatus) -> &'static str {
    match status {
        SolverStatus::Unsolved => "Unsolved",
        SolverStatus::Solved => "Solved",
        SolverStatus::PrimalInfeasible => "PrimalInfeasible",
        SolverStatus::DualInfeasible => "DualInfeasible",
        SolverStatus::AlmostSolved => "AlmostSolved",
        SolverStatus::AlmostPrimalInfeasible => "AlmostPrimalInfeasible",
        SolverStatus::AlmostDualInfeasible => "AlmostDualInfeasible",
        SolverStatus::MaxIterations => "MaxIterations",
        SolverStatus::MaxTime => "MaxTime",
        SolverStatus::NumericalError => "NumericalError",
        SolverStatus::InsufficientProgress => "InsufficientProgress",
        SolverStatus::CallbackTerminated => "CallbackTerminated",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The solution satisfies the optimality conditions: the gradient vanishes inside and points outwards on bounds.
    #[test]
    fn satisfies_the_optimality_conditions() {
        let mut seed = 7_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for n in [1, 2, 5, 30] {
            for size in [1e-6, 1.0, 1e6] {
                let j = DMatrix::from_fn(2 * n, n, |_, _| size * random());
                let h = j.tr_mul(&j);
                let g: Vec<f64> = (0..n).map(|_| size * size * random()).collect();
                let (lower, upper) = (vec![-0.1; n], vec![0.3; n]);
                let d = bounded_step(&h, &g, &lower, &upper).expect("solved");
                for i in 0..n {
                    let slope = g[i] + (0..n).map(|k| h[(i, k)] * d[k]).sum::<f64>();
                    let allowed = 1e-6 * h[(i, i)];
                    assert!((lower[i]..=upper[i]).contains(&d[i]));
                    assert!(d[i] == lower[i] || slope <= allowed, "n {n} size {size}: {slope:e}");
                    assert!(d[i] == upper[i] || slope >= -allowed, "n {n} size {size}: {slope:e}");
                }
            }
        }
    }

    /// Active bounds that are all wrong are mended, here of a matrix for which that is sure to end (an M-matrix).
    #[test]
    fn a_wrong_guess_of_active_bounds_is_mended() {
        let n = 12;
        let h = DMatrix::from_fn(n, n, |i, k| match i.abs_diff(k) {
            0 => 2.5,
            1 => -1.0,
            _ => 0.0,
        });
        let g: Vec<f64> = (0..n).map(|i| 2.0 * (0.9 * i as f64).cos()).collect();
        let (lower, upper) = (vec![-0.5; n], vec![0.4; n]);
        let times = |d: &[f64]| -> Vec<f64> { (0..n).map(|i| (0..n).map(|k| h[(i, k)] * d[k]).sum()).collect() };
        let exact = |fixed: &[Option<f64>]| on_active_set(&h, &g, fixed);
        let own = bounded_step(&h, &g, &lower, &upper).expect("solved");
        assert!(own.contains(&-0.5) && own.contains(&0.4), "{own:?}");
        for guess in [vec![None; n], vec![Some(0.4); n], vec![Some(-0.5); n]] {
            let found = on_right_set((&exact, &times), guess, &g, (&lower, &upper)).expect("it ends");
            assert!(found.iter().zip(&own).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {own:?}");
        }
    }

    #[test]
    fn a_problem_that_cannot_be_solved_is_an_error() {
        let h = DMatrix::from_element(1, 1, f64::NAN);
        assert!(matches!(bounded_step(&h, &[1.0], &[0.0], &[1.0]), Err(Error::StepNotSolved { .. })));
    }
}
