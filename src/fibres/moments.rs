//! The matrix of an element, sum of w N_i N_j over its data, by moments: products of two functions of a tensor-product basis are
//! polynomials, of which there are far fewer than pairs of functions.
//!
//! In one direction h_i h_j = sum over a of c_ija L_a, L_a the Legendre polynomials on [0, 1]; so
//! sum of w N_i N_j = sum over abc of c_a c_b c_c M_abc with M_abc = sum of w L_a(xi1) L_b(xi2) L_c(xi3):
//! 343 numbers instead of 2080 of a tricubic Hermite element.

use crate::math::quadrature::GaussRule;
use crate::mesh::element::Element;

/// Polynomials: products of two cubics have degree 6.
pub const DEGREES: usize = 7;
/// The same with room to a multiple of vector instructions.
const ROW: usize = 8;

/// M_abc at `moments[a][b][c]`.
pub type Moments = [[[f64; ROW]; DEGREES]; DEGREES];

/// c_ija of a basis.
#[derive(Debug, Clone)]
pub struct Products([[[f64; DEGREES]; 4]; 4]);

/// L_0 to L_6 at x in [0, 1]: (n + 1) L_(n+1) = (2 n + 1) (2 x - 1) L_n - n L_(n-1).
pub fn legendre(x: f64) -> [f64; ROW] {
    let t = 2.0 * x - 1.0;
    let mut l = [1.0, t, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for n in 1..DEGREES - 1 {
        let k = n as f64;
        l[n + 1] = ((2.0 * k + 1.0) * t * l[n] - k * l[n - 1]) / (k + 1.0);
    }
    l
}

/// Adds a place with polynomials `l` along each direction and weights of several matrices.
#[inline]
pub fn add(moments: &mut [Moments], l: &[[f64; ROW]; 3], weights: &[f64]) {
    for (moments, weight) in moments.iter_mut().zip(weights) {
        for a in 0..DEGREES {
            let first = weight * l[0][a];
            for b in 0..DEGREES {
                let second = first * l[1][b];
                let row = &mut moments[a][b];
                for c in 0..ROW {
                    row[c] += second * l[2][c];
                }
            }
        }
    }
}

impl Products {
    /// Of a basis: c_ija = (2 a + 1) times the integral of h_i h_j L_a.
    pub fn new(basis: &dyn Element) -> Products {
        // seven points are exact to degree 13
        let rule = GaussRule::new(DEGREES);
        let mut products = [[[0.0; DEGREES]; 4]; 4];
        for (x, weight) in rule.points.iter().zip(&rule.weights) {
            let (h, l) = (basis.values_1d(*x), legendre(*x));
            for i in 0..4 {
                for j in 0..4 {
                    for a in 0..DEGREES {
                        products[i][j][a] += weight * (2 * a + 1) as f64 * h[i] * h[j] * l[a];
                    }
                }
            }
        }
        Products(products)
    }

    /// Fills in the matrix that has these moments, by functions of the basis.
    pub fn fill<const N: usize>(&self, basis: &dyn Element, moments: &Moments, matrix: &mut [[f64; N]; N]) {
        // one direction after the other: pairs (i, j) of 1-D functions in the place of degrees
        let mut third = [[[0.0; 16]; DEGREES]; DEGREES];
        let mut second = vec![[[0.0; 16]; 16]; DEGREES];
        for a in 0..DEGREES {
            for b in 0..DEGREES {
                for pair in 0..16 {
                    let c = &self.0[pair / 4][pair % 4];
                    third[a][b][pair] = (0..DEGREES).map(|k| c[k] * moments[a][b][k]).sum();
                }
            }
            for pair in 0..16 {
                let c = &self.0[pair / 4][pair % 4];
                for other in 0..16 {
                    second[a][pair][other] = (0..DEGREES).map(|k| c[k] * third[a][k][other]).sum();
                }
            }
        }
        let mut first = vec![[[0.0; 16]; 16]; 16];
        for pair in 0..16 {
            let c = &self.0[pair / 4][pair % 4];
            for other in 0..16 {
                for last in 0..16 {
                    first[pair][other][last] = (0..DEGREES).map(|k| c[k] * second[k][other][last]).sum();
                }
            }
        }
        let factors: Vec<[usize; 3]> = (0..N).map(|function| basis.factors(function)).collect();
        for i in 0..N {
            for j in 0..N {
                let [p, q, r] = std::array::from_fn(|d| 4 * factors[i][d] + factors[j][d]);
                matrix[i][j] = first[p][q][r];
            }
        }
    }
}
