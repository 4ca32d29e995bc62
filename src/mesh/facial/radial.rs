//! A smooth vector field over the plane through given values at given points, mirrored at u = 0.
//!
//! f(p) = sum_i c_i |p - p_i|^3 + linear polynomial: of all fields through the values the one that bends least in the sense of
//! its kernel, twice continuously differentiable. Every point with u > 0 has a twin at -u. The first component of the field
//! changes its sign there and the others do not, so that they need the kernels
//!   |p - p_i|^3 - |p - p_i'|^3  and the polynomial u,    |p - p_i|^3 + |p - p_i'|^3  and the polynomial 1, v.

use crate::math::tensor::Vector;
use nalgebra::{DMatrix, DVector};

/// A field at a point with its derivatives by u and v up to the second, mm per unit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Jet {
    pub value: Vector,
    pub u: Vector,
    pub v: Vector,
    pub uu: Vector,
    pub uv: Vector,
    pub vv: Vector,
}

/// A kernel or polynomial at a point: value, u, v, uu, uv, vv.
type Scalar = [f64; 6];

/// The field.
#[derive(Debug, Clone)]
pub(super) struct Radial {
    centres: Vec<[f64; 2]>,
    /// Of the kernel at each centre: the odd component, then the two even ones.
    weights: Vec<Vector>,
    /// Of u for the first component; of 1 for the others.
    first: Vector,
    /// Of v for the second and third component.
    second: Vector,
}

/// |d|^3 and its derivatives.
fn cubed([du, dv]: [f64; 2]) -> Scalar {
    let r = (du * du + dv * dv).sqrt();
    let over = if r > 0.0 { 1.0 / r } else { 0.0 };
    let second = |a: f64, b: f64, same: f64| 3.0 * (same * r + a * b * over);
    [r * r * r, 3.0 * r * du, 3.0 * r * dv, second(du, du, 1.0), second(du, dv, 0.0), second(dv, dv, 1.0)]
}

/// The odd and the even kernel of a centre.
fn kernels([ui, vi]: [f64; 2], [u, v]: [f64; 2]) -> (Scalar, Scalar) {
    let own = cubed([u - ui, v - vi]);
    if ui == 0.0 {
        return ([0.0; 6], own);
    }
    let twin = cubed([u + ui, v - vi]);
    (std::array::from_fn(|k| own[k] - twin[k]), std::array::from_fn(|k| own[k] + twin[k]))
}

impl Radial {
    /// Through `values` at `centres`, all with u >= 0 and no two alike; where u = 0 the first component is 0. `None` where
    /// the centres do not determine a field: fewer than three, or all on a line.
    pub fn new(centres: &[[f64; 2]], values: &[Vector]) -> Option<Radial> {
        let lateral: Vec<usize> = (0..centres.len()).filter(|i| centres[*i][0] > 0.0).collect();
        let all: Vec<usize> = (0..centres.len()).collect();
        let (odd, first) = solve(centres, &lateral, values, true, &[0])?;
        let (even, rest) = solve(centres, &all, values, false, &[1, 2])?;
        let mut weights: Vec<Vector> = even.iter().map(|w| [0.0, w[0], w[1]]).collect();
        for (i, w) in lateral.iter().zip(odd) {
            weights[*i][0] = w[0];
        }
        let first = [first[0][0], rest[0][0], rest[0][1]];
        let second = [0.0, rest[1][0], rest[1][1]];
        Some(Radial { centres: centres.to_vec(), weights, first, second })
    }

    /// At a point on either side; the mirrored point has the mirrored value to the last bit.
    pub fn at(&self, u: f64, v: f64) -> Jet {
        let mirrored = u < 0.0;
        let p = [u.abs(), v];
        let mut sums = [[0.0; 3]; 6];
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            let (odd, even) = kernels(*centre, p);
            for (k, sum) in sums.iter_mut().enumerate() {
                sum[0] += weight[0] * odd[k];
                sum[1] += weight[1] * even[k];
                sum[2] += weight[2] * even[k];
            }
        }
        sums[0][0] += self.first[0] * p[0];
        sums[1][0] += self.first[0];
        for i in 1..3 {
            sums[0][i] += self.first[i] + self.second[i] * p[1];
            sums[2][i] += self.second[i];
        }
        if mirrored {
            // the first component is odd, and each derivative by u changes the sign once more
            for (k, sum) in sums.iter_mut().enumerate() {
                let flips = [0, 1, 0, 2, 1, 0][k];
                sum.iter_mut().enumerate().for_each(|(i, s)| {
                    if (flips + usize::from(i == 0)) % 2 == 1 {
                        *s = -*s;
                    }
                });
            }
        }
        let [value, u, v, uu, uv, vv] = sums;
        Jet { value, u, v, uu, uv, vv }
    }
}

/// The weights of the kernels at the centres `used` and of the polynomials, for the components `components`.
fn solve(
    centres: &[[f64; 2]],
    used: &[usize],
    values: &[Vector],
    odd: bool,
    components: &[usize],
) -> Option<(Vec<Vec<f64>>, Vec<Vec<f64>>)> {
    let polynomials = |p: [f64; 2]| if odd { vec![p[0]] } else { vec![1.0, p[1]] };
    let (n, m) = (used.len(), if odd { 1 } else { 2 });
    let mut matrix = DMatrix::zeros(n + m, n + m);
    for (row, i) in used.iter().enumerate() {
        for (column, j) in used.iter().enumerate() {
            let (o, e) = kernels(centres[*j], centres[*i]);
            matrix[(row, column)] = if odd { o[0] } else { e[0] };
        }
        let twins = if centres[*i][0] > 0.0 { 2.0 } else { 1.0 };
        for (k, p) in polynomials(centres[*i]).into_iter().enumerate() {
            matrix[(row, n + k)] = p;
            matrix[(n + k, row)] = twins * p;
        }
    }
    let factor = matrix.full_piv_lu();
    let mut weights = vec![Vec::new(); n + m];
    for component in components {
        let mut right = DVector::zeros(n + m);
        used.iter().enumerate().for_each(|(row, i)| right[row] = values[*i][*component]);
        let found = factor.solve(&right)?;
        weights.iter_mut().zip(found.iter()).for_each(|(w, x)| w.push(*x));
    }
    let polynomial = weights.split_off(n);
    weights.iter().chain(&polynomial).flatten().all(|w| w.is_finite()).then_some((weights, polynomial))
}
