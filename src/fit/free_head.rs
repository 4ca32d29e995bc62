//! A head whose motion is estimated from the fitted markers themselves, together with the controls.
//!
//! Six unknowns per frame, a turn and a shift h, minimise together with the controls q
//!
//!   1/2 sum |m_k(q) - h^-1(z_k)|^2 / sd_k^2
//!
//! For every q the best h is a weighted rigid fit, which needs no iteration and no start; the sum that is left depends on q
//! alone (variable projection, Golub and Pereyra 1973; with the derivative of Kaufman 1975). With Q an orthonormal basis of
//! the six columns H = d(weighted residual)/dh,
//!
//!   J = (1 - Q Q^T) J_q
//!
//! With a robust loss the rigid fit is weighed again until it settles, and the projection counts markers by the same weights.
//!
//! and J^T J = J_q^T J_q - J_q^T H (H^T H)^-1 H^T J_q is the information on q with h unknown: standard deviations from it hold
//! what the head takes away. h itself has the covariance (H^T H)^-1 + T C T^T and the covariance - T C with the controls, where
//! C is that of the controls and T = (H^T H)^-1 H^T J_q.

use super::covariance::Bound;
use super::frame::Measured;
use super::objective::loss::Loss;
use crate::math::motion::{Allowed, Motion, Pair, centre, weighted};
use crate::math::tensor::{norm, subtract};
use nalgebra::{DMatrix, SMatrix};

/// Steps of a fit that sets outliers aside, and the change of a weight at which it ends.
const REWEIGHTED: usize = 200;
const SETTLED: f64 = 1e-13;

/// The motion that takes the measured markers nearest to those of the model, by their weights and as the loss counts them:
/// where it is robust, by squares that are weighed again until that changes nothing. `None` below three of them, and where they
/// lie on a line.
pub fn nearest(model: &[[f64; 3]], measured: &[Measured], loss: Loss) -> Option<Motion> {
    let pairs: Vec<Pair> = measured.iter().zip(model).map(|(m, x)| (m.position, *x)).collect();
    let fitted = |rho: &[f64]| weighted(&pairs, |k| rho[k] * measured[k].weight * measured[k].weight, Allowed::RIGID);
    let mut rho = vec![1.0; measured.len()];
    let mut motion = fitted(&rho)?;
    if loss == Loss::Quadratic {
        return Some(motion);
    }
    for _ in 0..REWEIGHTED {
        let next = weights(model, measured, &motion, loss);
        let change = next.iter().zip(&rho).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        (motion, rho) = (fitted(&next)?, next);
        if change < SETTLED {
            break;
        }
    }
    Some(motion)
}

/// How much each measured marker counts by a loss where they are placed by a motion.
pub fn weights(model: &[[f64; 3]], measured: &[Measured], motion: &Motion, loss: Loss) -> Vec<f64> {
    let residual = |(m, x): (&Measured, &[f64; 3])| subtract(*x, motion.place(m.position)).map(|d| m.weight * d);
    loss.weights(&measured.iter().zip(model).flat_map(residual).collect::<Vec<f64>>())
}

/// H: by a turn (rad) about the centre of the placed markers, then by a shift (mm), of the motion that takes the measured
/// markers to the model.
fn columns(motion: &Motion, measured: &[Measured]) -> DMatrix<f64> {
    let placed: Vec<[f64; 3]> = measured.iter().map(|m| motion.place(m.position)).collect();
    let middle = centre(placed.iter().copied());
    let mut h = DMatrix::zeros(3 * measured.len(), 6);
    for (k, (y, m)) in placed.iter().zip(measured).enumerate() {
        let [x, y, z] = std::array::from_fn(|i| y[i] - middle[i]);
        // -(omega x y) - tau
        let rows = [[0.0, -z, y, -1.0, 0.0, 0.0], [z, 0.0, -x, 0.0, -1.0, 0.0], [-y, x, 0.0, 0.0, 0.0, -1.0]];
        for (i, row) in rows.iter().enumerate() {
            for (c, value) in row.iter().enumerate() {
                h[(3 * k + i, c)] = m.weight * value;
            }
        }
    }
    h
}

/// J from J_q: what no motion of the head explains, the markers counting by `rho`.
pub fn project(j: &DMatrix<f64>, motion: &Motion, measured: &[Measured], rho: &[f64]) -> DMatrix<f64> {
    let h = columns(motion, measured);
    let weighted = scaled(&h, rho);
    // 1 - H (H^T W H)^-1 H^T W with W^1/2 H = Q R
    let qr = weighted.qr();
    let (q, r) = (qr.q(), qr.r());
    let part = q.tr_mul(&scaled(j, rho));
    match r.solve_upper_triangular(&part) {
        Some(moved) => j - h * moved,
        None => j - &q * q.tr_mul(j),
    }
}

/// W^1/2 times the rows.
fn scaled(rows: &DMatrix<f64>, rho: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.nrows(), rows.ncols(), |row, k| rho[row / 3].sqrt() * rows[(row, k)])
}

/// How a frame's head was found.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeHead {
    /// From the model to where the head is in the frame, in the coordinates of the registered recording.
    pub motion: Motion,
    /// Standard deviations of the turn (degrees, about x, y, z through the centre of the markers) and of the shift of that
    /// centre (mm); `None` where they are not determined.
    pub sd: Option<[f64; 6]>,
    /// For every control that is sought: its largest correlation with one of the six; `None` on a bound.
    pub correlation: Vec<Option<f64>>,
    /// For every control that is sought: its standard deviation over what it would be with a head that is known; `None` on a
    /// bound.
    pub inflation: Vec<Option<f64>>,
}

/// The head at the end of a fit. `rho` is how much each marker counts, `j` is J_q there, `bounds` where the controls that are sought lie, `variance` that of a
/// weighted residual.
pub fn describe(
    back: &Motion,
    (measured, rho): (&[Measured], &[f64]),
    j: &DMatrix<f64>,
    bounds: &[Bound],
    variance: Option<f64>,
) -> FreeHead {
    let (h, j) = (scaled(&columns(back, measured), rho), scaled(j, rho));
    let free: Vec<usize> = (0..bounds.len()).filter(|k| bounds[*k] == Bound::Free).collect();
    let of_controls = j.select_columns(&free);
    let unknown = FreeHead {
        motion: back.inverse(),
        sd: None,
        correlation: vec![None; bounds.len()],
        inflation: vec![None; bounds.len()],
    };
    let information = SMatrix::<f64, 6, 6>::from_iterator(h.tr_mul(&h).iter().copied());
    let Some(inverse) = information.cholesky().map(|factor| factor.inverse()) else { return unknown };
    let inverse = DMatrix::from_iterator(6, 6, inverse.iter().copied());
    let t = &inverse * h.tr_mul(&of_controls);
    let known = of_controls.tr_mul(&of_controls);
    let reduced = &known - of_controls.tr_mul(&h) * &t;
    let (Some(known), Some(c)) = (known.cholesky(), reduced.cholesky()) else { return unknown };
    let (known, c) = (known.inverse(), c.inverse());
    let covariance = &inverse + &t * &c * t.transpose();
    let cross = &t * &c;
    let unit = [180.0 / std::f64::consts::PI, 1.0];
    let size = |k: usize| (covariance[(k, k)] * variance.unwrap_or(f64::NAN)).sqrt() * unit[k / 3];
    let mut head = FreeHead { sd: variance.map(|_| std::array::from_fn(size)), ..unknown };
    for (a, k) in free.iter().enumerate() {
        let correlation = |i: usize| (cross[(i, a)] / (covariance[(i, i)] * c[(a, a)]).sqrt()).abs();
        head.correlation[*k] = Some((0..6).map(correlation).fold(0.0, f64::max));
        head.inflation[*k] = Some((c[(a, a)] / known[(a, a)]).sqrt());
    }
    head
}

/// A paragraph of a page: how the heads of these frames moved, of a point that stays with them, and what that costs the
/// controls, by their names. Empty without frames.
pub fn page(heads: &[(usize, FreeHead)], of: [f64; 3], controls: &[&str]) -> String {
    let most = |size: &dyn Fn(&FreeHead) -> f64| {
        heads.iter().map(|(frame, head)| (*frame, size(head))).max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let turn = most(&|head| head.motion.angle().to_degrees());
    let shift = most(&|head| norm(subtract(head.motion.place(of), of)));
    let (Some((turn_frame, turn)), Some((shift_frame, shift))) = (turn, shift) else { return String::new() };
    let mut text = format!(
        "head: estimated with the controls; it turns by up to {turn:.2} degrees (frame {turn_frame}) and moves by up to {shift:.2} \
         mm (frame {shift_frame})\n"
    );
    let largest =
        |of: &dyn Fn(&[f64; 6]) -> f64| heads.iter().filter_map(|(_, h)| h.sd.as_ref().map(of)).fold(0.0, f64::max);
    text += &format!(
        "  standard deviations up to {:.3} degrees and {:.3} mm\n",
        largest(&|sd| sd[..3].iter().copied().fold(0.0, f64::max)),
        largest(&|sd| sd[3..].iter().copied().fold(0.0, f64::max))
    );
    for (k, name) in controls.iter().enumerate() {
        let worst = |of: &dyn Fn(&FreeHead) -> Option<f64>| heads.iter().filter_map(|(_, h)| of(h)).reduce(f64::max);
        if let (Some(inflation), Some(correlation)) = (worst(&|h| h.inflation[k]), worst(&|h| h.correlation[k])) {
            text += &format!(
                "  {name}: its sd is up to {inflation:.2} times that with a known head, its correlation with the head up to {correlation:.3}\n"
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The gradient from projected derivatives is that of the sum that is left when the head is fitted anew, with an outlier.
    #[test]
    fn the_gradient_is_that_of_the_sum_without_the_head() {
        let entry = |a: usize, b: usize| ((7 * a + 3 * b + a * b) as f64).sin();
        let count = 7;
        let place = |k: usize, q: &[f64]| -> [f64; 3] {
            std::array::from_fn(|i| 30.0 * entry(k, i) + (0..2).map(|c| entry(3 * k + i, c + 5) * q[c]).sum::<f64>())
        };
        let measured: Vec<Measured> = (0..count)
            .map(|k| {
                let off = if k == 2 { 9.0 } else { 0.2 };
                let x = place(k, &[0.3, -0.2]);
                let weight = 1.0 + 0.2 * entry(k, 1);
                Measured { marker: k, position: std::array::from_fn(|i| x[i] + off * entry(k, i + 9)), weight }
            })
            .collect();
        let model = |q: &[f64]| -> Vec<[f64; 3]> { (0..count).map(|k| place(k, q)).collect() };
        let residuals = |q: &[f64], motion: &Motion| -> Vec<f64> {
            let of = |(m, x): (&Measured, [f64; 3])| subtract(x, motion.place(m.position)).map(|d| m.weight * d);
            measured.iter().zip(model(q)).flat_map(of).collect()
        };
        let j = DMatrix::from_fn(3 * count, 2, |row, c| measured[row / 3].weight * entry(row, c + 5));
        for loss in [Loss::Quadratic, Loss::Huber { k: 1.5 }, Loss::Cauchy { c: 3.0 }] {
            let cost = |q: &[f64]| loss.cost(&residuals(q, &nearest(&model(q), &measured, loss).expect("seen")));
            let q = [0.1, 0.4];
            let motion = nearest(&model(&q), &measured, loss).expect("seen");
            let rho = weights(&model(&q), &measured, &motion, loss);
            let (gradient, _) = loss.model(&residuals(&q, &motion), &project(&j, &motion, &measured, &rho));
            for c in 0..2 {
                let moved = |by: f64| {
                    let mut moved = q;
                    moved[c] += by;
                    cost(&moved)
                };
                let slope = (moved(1e-4) - moved(-1e-4)) / 2e-4;
                assert!(
                    (slope - gradient[c]).abs() < 1e-5 * slope.abs().max(1.0),
                    "{loss:?}: {slope} {}",
                    gradient[c]
                );
            }
        }
    }
}
