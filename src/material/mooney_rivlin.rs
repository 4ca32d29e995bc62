//! Isochoric Mooney-Rivlin solid (Wu et al. 2013, Eq. 3).
//!
//! psi = c1 (J^(-2/3) I1 - 3) + c2 (J^(-4/3) I2 - 3),  I1 = tr C,  I2 = (I1^2 - tr C^2)/2,  J = det F.
//!
//! With psi_1 = dpsi/dI1 and so on, and H = cof F:
//! ```text
//! dI1/dF = 2 F,  dI2/dF = 2 (I1 F - B F),  dJ/dF = H
//! d2I1 = 2 d_ik d_JL
//! d2I2 = 4 F_iJ F_kL + 2 I1 d_ik d_JL - 2 (d_ik C_JL + F_iL F_kJ + B_ik d_JL)
//! d2J  = e_ikm e_JLM F_mM
//! P = psi_1 dI1 + psi_2 dI2 + psi_J H
//! A = psi_1 d2I1 + psi_2 d2I2 + psi_J d2J + dJ (x) (psi_1J dI1 + psi_2J dI2) + transposed + psi_JJ H (x) H
//! ```

use super::{Law, PAIRS, Response};
use crate::math::lanes::{Lanes, MatrixLanes, cofactors, dot};

/// Constants of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MooneyRivlin {
    /// kPa.
    pub c1: f64,
    /// kPa.
    pub c2: f64,
}

impl Law for MooneyRivlin {
    fn name(&self) -> &'static str {
        "mooney-rivlin"
    }

    fn shear_modulus(&self) -> f64 {
        2.0 * (self.c1 + self.c2)
    }

    #[inline(always)]
    fn response(&self, f: &MatrixLanes) -> Response {
        let h = cofactors(f);
        let j = dot(f[0], h[0]);
        // C = F^T F, B = F F^T, and B F
        let mut c = [[Lanes::ZERO; 3]; 3];
        let mut b = [[Lanes::ZERO; 3]; 3];
        for p in 0..3 {
            for q in p..3 {
                c[p][q] = f[0][p] * f[0][q] + f[1][p] * f[1][q] + f[2][p] * f[2][q];
                c[q][p] = c[p][q];
                b[p][q] = dot(f[p], f[q]);
                b[q][p] = b[p][q];
            }
        }
        let i1 = c[0][0] + c[1][1] + c[2][2];
        let mut squared = Lanes::ZERO;
        for row in &c {
            squared += dot(*row, *row);
        }
        let i2 = 0.5 * (i1 * i1 - squared);

        let inverse = j.recip();
        // J^(-2/3) and J^(-4/3)
        let m23 = j.map(|j| {
            let r = 1.0 / j.cbrt();
            r * r
        });
        let m43 = m23 * m23;
        let (bar1, bar2) = (self.c1 * (m23 * i1), self.c2 * (m43 * i2));
        let energy = bar1 + bar2 + Lanes::splat(-3.0 * (self.c1 + self.c2));
        let psi_1 = self.c1 * m23;
        let psi_2 = self.c2 * m43;
        let psi_j = ((-2.0 / 3.0) * bar1 + (-4.0 / 3.0) * bar2) * inverse;
        let psi_1j = (-2.0 / 3.0) * (psi_1 * inverse);
        let psi_2j = (-4.0 / 3.0) * (psi_2 * inverse);
        let psi_jj = ((10.0 / 9.0) * bar1 + (28.0 / 9.0) * bar2) * (inverse * inverse);

        let mut d1 = [[Lanes::ZERO; 3]; 3];
        let mut d2 = [[Lanes::ZERO; 3]; 3];
        let mut stress = [[Lanes::ZERO; 3]; 3];
        // the mixed term: A has (mixed (x) H + H (x) mixed) with mixed = psi_1J dI1 + psi_2J dI2 + psi_JJ H / 2
        let mut mixed = [[Lanes::ZERO; 3]; 3];
        for i in 0..3 {
            for p in 0..3 {
                d1[i][p] = 2.0 * f[i][p];
                let bf = b[i][0] * f[0][p] + b[i][1] * f[1][p] + b[i][2] * f[2][p];
                d2[i][p] = 2.0 * (i1 * f[i][p] - bf);
                stress[i][p] = psi_1 * d1[i][p] + psi_2 * d2[i][p] + psi_j * h[i][p];
                mixed[i][p] = psi_1j * d1[i][p] + psi_2j * d2[i][p] + 0.5 * (psi_jj * h[i][p]);
            }
        }
        let two_psi_2 = 2.0 * psi_2;
        let spherical = 2.0 * (psi_1 + psi_2 * i1);
        let mut tangent = [[[Lanes::ZERO; 3]; 3]; 6];
        for (pair, &(i, k)) in PAIRS.iter().enumerate() {
            for p in 0..3 {
                for q in 0..3 {
                    let mut a = mixed[i][p] * h[k][q]
                        + h[i][p] * mixed[k][q]
                        + two_psi_2 * (2.0 * (f[i][p] * f[k][q]) - f[i][q] * f[k][p]);
                    if p == q {
                        a = a - two_psi_2 * b[i][k];
                    }
                    if i == k {
                        a = a - two_psi_2 * c[p][q];
                        if p == q {
                            a += spherical;
                        }
                    } else if p != q {
                        a += psi_j * second_derivative_of_j(f, (i, k), (p, q));
                    }
                    tangent[pair][p][q] = a;
                }
            }
        }
        Response { energy, stress, tangent }
    }
}

/// d2 J / (dF_iJ dF_kL) = e_ikm e_JLM F_mM for i != k and J != L; it is zero otherwise.
#[inline(always)]
pub fn second_derivative_of_j(f: &MatrixLanes, (i, k): (usize, usize), (p, q): (usize, usize)) -> Lanes {
    let (m, n) = (3 - i - k, 3 - p - q);
    let same_sense = ((k + 3 - i) % 3 == 1) == ((q + 3 - p) % 3 == 1);
    if same_sense { f[m][n] } else { -f[m][n] }
}
