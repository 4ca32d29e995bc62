//! Isochoric neo-Hookean solid (Treloar 1943).
//!
//! psi = mu/2 (J^(-2/3) I1 - 3),  I1 = tr C,  J = det F.
//!
//! With m = J^(-2/3), b = mu/2 m I1 and H = cof F = dJ/dF:
//! ```text
//! P = mu m F - 2/3 b/J H
//! A = mu m d_ik d_JL - 2/3 b/J d2J + M (x) H + H (x) M,   M = - 2/3 mu m/J F + 5/9 b/J^2 H
//! ```

use super::mooney_rivlin::second_derivative_of_j;
use super::{Law, PAIRS, Response};
use crate::math::lanes::{Lanes, MatrixLanes, cofactors, dot};

/// Constants of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeoHookean {
    /// Shear modulus, kPa.
    pub mu: f64,
}

impl Law for NeoHookean {
    fn name(&self) -> &'static str {
        "neo-hookean"
    }

    fn shear_modulus(&self) -> f64 {
        self.mu
    }

    #[inline(always)]
    fn response(&self, f: &MatrixLanes) -> Response {
        let h = cofactors(f);
        let inverse = dot(f[0], h[0]).recip();
        // m = J^(-2/3)
        let m = inverse.map(|r| {
            let r = r.cbrt();
            r * r
        });
        let i1 = dot(f[0], f[0]) + dot(f[1], f[1]) + dot(f[2], f[2]);
        let modulus = self.mu * m;
        let b = 0.5 * (modulus * i1);
        let along_h = (-2.0 / 3.0) * (b * inverse);
        let mixed_f = (-2.0 / 3.0) * (modulus * inverse);
        let mixed_h = (5.0 / 9.0) * (b * inverse * inverse);

        let mut stress = [[Lanes::ZERO; 3]; 3];
        let mut mixed = [[Lanes::ZERO; 3]; 3];
        for i in 0..3 {
            for p in 0..3 {
                stress[i][p] = modulus * f[i][p] + along_h * h[i][p];
                mixed[i][p] = mixed_f * f[i][p] + mixed_h * h[i][p];
            }
        }
        let mut tangent = [[[Lanes::ZERO; 3]; 3]; 6];
        for (pair, &(i, k)) in PAIRS.iter().enumerate() {
            for p in 0..3 {
                for q in 0..3 {
                    let mut a = mixed[i][p] * h[k][q] + h[i][p] * mixed[k][q];
                    if i == k && p == q {
                        a += modulus;
                    } else if i != k && p != q {
                        a += along_h * second_derivative_of_j(f, (i, k), (p, q));
                    }
                    tangent[pair][p][q] = a;
                }
            }
        }
        Response { energy: b + Lanes::splat(-1.5 * self.mu), stress, tangent }
    }
}
