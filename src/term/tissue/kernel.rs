//! Sum factorisation over the tensor-product basis of the tricubic Hermite element.
//!
//! With N_a = h_a1(xi1) h_a2(xi2) h_a3(xi3) on a grid of G x G x G points, sums over points and functions are done one
//! direction at a time: 150 times fewer operations than the plain loop for the stiffness.
//! Points are numbered q = g1 + G g2 + G^2 g3; functions a by their three 1-D factors (a1, a2, a3), each 0 to 3.

use crate::mesh::element::{Element, TricubicHermite};

/// c[a] += x[a] s, with a fused multiply-add where the machine has one.
#[inline(always)]
fn axpy<const FMA: bool, const N: usize>(c: &mut [f64; N], x: &[f64; N], s: f64) {
    for a in 0..N {
        c[a] = if FMA { x[a].mul_add(s, c[a]) } else { c[a] + x[a] * s };
    }
}

/// 1-D values, derivatives and their products at the points of a Gauss rule.
#[derive(Debug)]
pub struct Tables {
    /// Points per direction, G.
    pub points: usize,
    /// `h[d][g][a]`: value (d = 0) or derivative (d = 1) of 1-D function a at point g.
    h: [Vec<[f64; 4]>; 2],
    /// `products[t][g][a + 4 b]` = h[t / 2][g][a] h[t % 2][g][b].
    products: [Vec<[f64; 16]>; 4],
    /// Local function of the factors (a1, a2, a3), index a1 + 4 a2 + 16 a3.
    function: [usize; 64],
}

/// Which 1-D table of direction `d` belongs to the derivative along `alpha`.
const fn derivative(alpha: usize, d: usize) -> usize {
    (alpha == d) as usize
}

/// Derivative pairs (alpha, beta), as 3 alpha + beta, by the product table that they use in direction 3.
const PAIRS_BY_TABLE: [&[usize]; 4] = [&[0, 1, 3, 4], &[2, 5], &[6, 7], &[8]];

impl Tables {
    /// For the abscissae of a 1-D rule.
    pub fn new(abscissae: &[f64]) -> Tables {
        let values: Vec<[f64; 4]> = abscissae.iter().map(|&x| TricubicHermite.values_1d(x)).collect();
        let slopes: Vec<[f64; 4]> = abscissae.iter().map(|&x| TricubicHermite.slopes_1d(x)).collect();
        let h = [values, slopes];
        let products = std::array::from_fn(|t| {
            (0..abscissae.len())
                .map(|g| std::array::from_fn(|ab| h[t / 2][g][ab % 4] * h[t % 2][g][ab / 4]))
                .collect()
        });
        let mut function = [0; 64];
        for a in 0..64 {
            let [i, j, k] = TricubicHermite.factors(a);
            function[i + 4 * j + 16 * k] = a;
        }
        Tables { points: abscissae.len(), h, products, function }
    }

    /// d(field)/dxi_alpha at all points, for N fields at once: `out[alpha][q]` from local parameters `local[a]`.
    #[inline(always)]
    pub fn gradients<const FMA: bool, const N: usize>(&self, local: &[[f64; N]; 64], out: &mut [Vec<[f64; N]>; 3]) {
        let g = self.points;
        // direction 3 first: [derivative in 3][a1 + 4 a2]
        for g3 in 0..g {
            let mut plane = [[[0.0; N]; 16]; 2];
            for (d, plane) in plane.iter_mut().enumerate() {
                for a3 in 0..4 {
                    for (r, sum) in plane.iter_mut().enumerate() {
                        axpy::<FMA, N>(sum, &local[self.function[r + 16 * a3]], self.h[d][g3][a3]);
                    }
                }
            }
            for g2 in 0..g {
                // [derivatives in (2, 3): none, 2, 3][a1]
                let mut line = [[[0.0; N]; 4]; 3];
                for (line, (d2, d3)) in line.iter_mut().zip([(0, 0), (1, 0), (0, 1)]) {
                    for a2 in 0..4 {
                        for (a1, sum) in line.iter_mut().enumerate() {
                            axpy::<FMA, N>(sum, &plane[d3][a1 + 4 * a2], self.h[d2][g2][a2]);
                        }
                    }
                }
                for g1 in 0..g {
                    let q = g1 + g * (g2 + g * g3);
                    for (alpha, line) in line.iter().enumerate() {
                        let mut sum = [0.0; N];
                        for (a1, value) in line.iter().enumerate() {
                            axpy::<FMA, N>(&mut sum, value, self.h[derivative(alpha, 0)][g1][a1]);
                        }
                        out[alpha][q] = sum;
                    }
                }
            }
        }
    }

    /// sum over points and alpha of field(alpha, q) dN_a/dxi_alpha, for N fields at once.
    #[inline(always)]
    pub fn tested<const FMA: bool, const N: usize>(
        &self,
        field: impl Fn(usize, usize) -> [f64; N],
        out: &mut [[f64; N]; 64],
    ) {
        let g = self.points;
        *out = [[0.0; N]; 64];
        for g3 in 0..g {
            let mut plane = [[[0.0; N]; 16]; 2];
            for g2 in 0..g {
                let mut line = [[[0.0; N]; 4]; 3];
                for g1 in 0..g {
                    let q = g1 + g * (g2 + g * g3);
                    for (alpha, line) in line.iter_mut().enumerate() {
                        let value = field(alpha, q);
                        for (a1, sum) in line.iter_mut().enumerate() {
                            axpy::<FMA, N>(sum, &value, self.h[derivative(alpha, 0)][g1][a1]);
                        }
                    }
                }
                for (line, (d2, d3)) in line.iter().zip([(0, 0), (1, 0), (0, 1)]) {
                    for a2 in 0..4 {
                        for (a1, value) in line.iter().enumerate() {
                            axpy::<FMA, N>(&mut plane[d3][a1 + 4 * a2], value, self.h[d2][g2][a2]);
                        }
                    }
                }
            }
            for (d, plane) in plane.iter().enumerate() {
                for a3 in 0..4 {
                    for (r, value) in plane.iter().enumerate() {
                        axpy::<FMA, N>(&mut out[self.function[r + 16 * a3]], value, self.h[d][g3][a3]);
                    }
                }
            }
        }
    }

    /// Adds sum over points of dN_a/dxi_alpha A[3 alpha + beta][q] dN_b/dxi_beta to `block[64 a + b]`.
    ///
    /// `symmetric` says that A[3 alpha + beta] = A[3 beta + alpha]: then half of the block is computed and mirrored.
    #[inline(always)]
    pub fn stiffness<const FMA: bool>(
        &self,
        tangent: &[Vec<f64>; 9],
        symmetric: bool,
        scratch: &mut Scratch,
        block: &mut [f64; 4096],
    ) {
        let g = self.points;
        let table = |d: usize, pair: usize| 2 * derivative(pair / 3, d) + derivative(pair % 3, d);
        // direction 1: first[pair][g2 + G g3][a1 + 4 b1]
        for (pair, values) in tangent.iter().enumerate() {
            let products = &self.products[table(0, pair)];
            for r in 0..g * g {
                let mut sum = [0.0; 16];
                for (g1, product) in products.iter().enumerate() {
                    axpy::<FMA, 16>(&mut sum, product, values[g1 + g * r]);
                }
                scratch.first[pair * g * g + r] = sum;
            }
        }
        // direction 2: second[t3 G + g3][a2 + 4 b2][a1 + 4 b1]
        for (t3, pairs) in PAIRS_BY_TABLE.iter().enumerate() {
            for g3 in 0..g {
                let second = &mut scratch.second[t3 * g + g3];
                for (ab, sum) in second.iter_mut().enumerate() {
                    *sum = [0.0; 16];
                    for &pair in *pairs {
                        let products = &self.products[table(1, pair)];
                        let first = &scratch.first[pair * g * g + g * g3..][..g];
                        for (product, first) in products.iter().zip(first) {
                            axpy::<FMA, 16>(sum, first, product[ab]);
                        }
                    }
                }
            }
        }
        // direction 3
        for ab in 0..16 {
            let (a2, b2) = (ab % 4, ab / 4);
            for b3 in 0..4 {
                for a3 in 0..4 {
                    if symmetric && a3 > b3 {
                        continue;
                    }
                    let mut sum = [0.0; 16];
                    for t3 in 0..4 {
                        for g3 in 0..g {
                            let product = self.products[t3][g3][a3 + 4 * b3];
                            axpy::<FMA, 16>(&mut sum, &scratch.second[t3 * g + g3][ab], product);
                        }
                    }
                    for b1 in 0..4 {
                        let b = self.function[b1 + 4 * b2 + 16 * b3];
                        for a1 in 0..4 {
                            let a = self.function[a1 + 4 * a2 + 16 * a3];
                            block[64 * a + b] += sum[a1 + 4 * b1];
                            if symmetric && a3 < b3 {
                                block[64 * b + a] += sum[a1 + 4 * b1];
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Room for the intermediate sums of [`Tables::stiffness`].
#[derive(Debug)]
pub struct Scratch {
    first: Vec<[f64; 16]>,
    second: Vec<[[f64; 16]; 16]>,
}

impl Scratch {
    /// For a rule with `points` per direction.
    pub fn new(points: usize) -> Scratch {
        Scratch { first: vec![[0.0; 16]; 9 * points * points], second: vec![[[0.0; 16]; 16]; 4 * points] }
    }
}
