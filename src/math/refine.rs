//! Iterative refinement that also converges with a stale factor.
//!
//! Plain refinement adds M^-1 r to x. Here the step length, and parts of earlier steps, are chosen so that the residual
//! is the smallest possible: the method of generalised conjugate residuals (Eisenstat, Elman, Schultz 1983), equal to
//! GMRES preconditioned from the right. With a fresh factor the first sweep does all the work, as in plain
//! refinement.
//!
//! ```text
//! z = M^-1 r,  q = A z;  for each earlier pair: beta = <q, q_k>, q -= beta q_k, z -= beta z_k
//! scale the pair by 1 / |q|;  alpha = <r, q>,  x += alpha z,  r -= alpha q
//! ```

use super::factor::SolveQuality;
use super::sparse::SymmetricMatrix;
use crate::{Error, Result};

/// Most solves with the factor after the first one in one call; a factor that needs more is no use.
pub(super) const MOST_SWEEPS: usize = 39;
/// Earlier steps that are kept: memory is 2 x 16 vectors per right-hand side at most.
const KEPT_STEPS: usize = 16;
/// Refinement stops when a sweep leaves more than this part of every residual above the tolerance.
const LEAST_FALL: f64 = 0.9;
/// Residuals above this are no rounding. They may stand still while the steps collect what a stale factor has wrong: a kink
/// that opened or closed takes a step or two; so many sweeps.
const NO_ROUNDING: f64 = 1e-6;
const STANDSTILL: usize = 4;
/// A residual above this after half of the sweeps will not come down in the other half.
const HOPELESS: f64 = 0.3;

/// Solves A X = B in place of `rhs` with `precondition`, x <- M^-1 x, so that |b - A x| <= `tolerance` |b| per column, with
/// no more than so many sweeps after the first solve.
///
/// Norms and products are weighted: <a, b> = sum of w_i a_i b_i.
pub(super) fn solve(
    a: &SymmetricMatrix,
    precondition: impl Fn(&mut [f64]),
    weights: &[f64],
    rhs: &mut [f64],
    columns: usize,
    (tolerance, sweeps): (f64, usize),
) -> Result<SolveQuality> {
    let n = weights.len();
    let mut quality = SolveQuality { residual: 0.0, sweeps: 0 };
    if rhs.is_empty() {
        return Ok(quality);
    }
    let product = |a: &[f64], b: &[f64]| dot(weights, a, b);
    let norms = |x: &[f64]| x.chunks(n).map(|x| product(x, x).sqrt()).collect::<Vec<f64>>();

    let sizes = norms(rhs);
    if sizes.iter().any(|size| !size.is_finite()) {
        return Err(Error::NotFinite);
    }
    let relative = |norms: &[f64]| -> Vec<f64> {
        norms.iter().zip(&sizes).map(|(r, &b)| if b > 0.0 { r / b } else { 0.0 }).collect()
    };
    let b = rhs.to_vec();
    let mut r = b.clone();
    let x = rhs;
    x.fill(0.0);
    let mut residuals = relative(&sizes);
    let mut steps: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    let mut still = 0;
    for solves in 0..=sweeps {
        if residuals.iter().all(|&residual| residual <= tolerance) {
            break;
        }
        let mut z = r.clone();
        precondition(&mut z);
        let mut q = vec![0.0; z.len()];
        a.multiply_columns(&z, &mut q, columns);
        for column in 0..columns {
            let range = column * n..(column + 1) * n;
            let (z, q) = (&mut z[range.clone()], &mut q[range.clone()]);
            for (z_k, q_k) in &steps {
                let beta = product(q, &q_k[range.clone()]);
                add(q, -beta, &q_k[range.clone()]);
                add(z, -beta, &z_k[range.clone()]);
            }
            let size = product(q, q).sqrt();
            // a column that is solved exactly has no direction left
            let inverse = if size > 0.0 { 1.0 / size } else { 0.0 };
            z.iter_mut().chain(q.iter_mut()).for_each(|value| *value *= inverse);
            let alpha = product(&r[range.clone()], q);
            add(&mut x[range.clone()], alpha, z);
            add(&mut r[range], -alpha, q);
        }
        let mut new = relative(&norms(&r));
        if new.iter().all(|&residual| residual <= tolerance) {
            // r was updated, not computed: what counts is the residual of x
            a.multiply_columns(x, &mut r, columns);
            r.iter_mut().zip(&b).for_each(|(r, b)| *r = b - *r);
            new = relative(&norms(&r));
            steps.clear();
        }
        if new.iter().any(|residual| !residual.is_finite()) {
            return Err(Error::NotFinite);
        }
        quality.sweeps = solves;
        let falls = new.iter().zip(&residuals).any(|(new, old)| *new > tolerance && *new <= LEAST_FALL * old);
        residuals = new;
        still = if falls { 0 } else { still + 1 };
        let hopeless = solves == sweeps / 2 && residuals.iter().any(|residual| *residual > HOPELESS);
        if hopeless {
            break;
        }
        if still > 0 && (still > STANDSTILL || residuals.iter().all(|residual| *residual <= NO_ROUNDING)) {
            break;
        }
        if steps.len() == KEPT_STEPS {
            steps.remove(0);
        }
        steps.push((z, q));
    }
    quality.residual = residuals.into_iter().fold(0.0, f64::max);
    Ok(quality)
}

/// Sum of w_i a_i b_i. Eight partial sums, because one would wait for itself at every addition.
fn dot(w: &[f64], a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut lanes = [0.0; LANES];
    for ((w, a), b) in w.chunks(LANES).zip(a.chunks(LANES)).zip(b.chunks(LANES)) {
        for (lane, ((w, a), b)) in lanes.iter_mut().zip(w.iter().zip(a).zip(b)) {
            *lane += w * a * b;
        }
    }
    lanes.iter().sum()
}

/// y += s x.
fn add(y: &mut [f64], s: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += s * x);
}
