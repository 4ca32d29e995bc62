//! Transversely isotropic exponential solid (Guccione et al. 1995), in the form and with the names of Land et al. 2015.
//!
//! psi = c/2 (exp Q - 1),  Q = sum over a, b of B_ab E_ab^2,  E = (C - I)/2 in axes of which the first is the fibre,
//! ```text
//! B = [bf bfs bfs; bfs bt bt; bfs bt bt].
//! ```
//!
//! E is the whole strain, as published, not its isochoric part: split laws of fibres change their meaning where the
//! volume changes a little. In an incompressible body both give the same stress, and only the pressure p differs.
//!
//! With R the rotation into the axes, F' = F R^T, and g = c exp Q:
//! ```text
//! S_ab   = g B_ab E_ab,   P' = F' S,   P = P' R
//! A'_iakc = d_ik S_ac + 2/g P'_ia P'_kc + g/2 (d_ac sum_b B_ab F'_ib F'_kb + B_ac F'_ic F'_ka)
//! ```

use super::{Law, PAIRS, Response};
use crate::math::lanes::{Lanes, MatrixLanes};
use crate::math::tensor::{Matrix, Vector, cross, normalised};

/// Constants of the law and the direction of its fibres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guccione {
    /// Scale of the stress, kPa.
    c: f64,
    /// Exponents B.
    exponents: Matrix,
    /// Unit vectors, one a row: the fibre and two across it.
    axes: Matrix,
}

impl Guccione {
    /// `c` in kPa; exponents along the fibre, across it and for shear along it; `fibre` of any length but zero.
    pub fn new(c: f64, bf: f64, bt: f64, bfs: f64, fibre: Vector) -> Guccione {
        let along = normalised(fibre);
        // the axis that the fibre is least along is surely not the fibre
        let least = (0..3).fold(0, |least, d| if along[d].abs() < along[least].abs() { d } else { least });
        let mut other = [0.0; 3];
        other[least] = 1.0;
        let across = normalised(cross(along, other));
        Guccione {
            c,
            exponents: [[bf, bfs, bfs], [bfs, bt, bt], [bfs, bt, bt]],
            axes: [along, across, cross(along, across)],
        }
    }
}

impl Law for Guccione {
    fn name(&self) -> &'static str {
        "guccione"
    }

    /// c bfs/2, of a shear along the fibres.
    fn shear_modulus(&self) -> f64 {
        0.5 * self.c * self.exponents[0][1]
    }

    #[inline(always)]
    fn response(&self, f: &MatrixLanes) -> Response {
        let (b, axes) = (&self.exponents, &self.axes);
        let mut g = [[Lanes::ZERO; 3]; 3];
        for i in 0..3 {
            for a in 0..3 {
                g[i][a] = axes[a][0] * f[i][0] + axes[a][1] * f[i][1] + axes[a][2] * f[i][2];
            }
        }
        // B_ab E_ab and Q
        let mut scaled = [[Lanes::ZERO; 3]; 3];
        let mut q = Lanes::ZERO;
        for a in 0..3 {
            for c in 0..3 {
                let product = g[0][a] * g[0][c] + g[1][a] * g[1][c] + g[2][a] * g[2][c];
                let strain = 0.5 * (product + Lanes::splat(if a == c { -1.0 } else { 0.0 }));
                scaled[a][c] = b[a][c] * strain;
                q += scaled[a][c] * strain;
            }
        }
        let scale = self.c * q.map(f64::exp);
        let (half, twice_inverse) = (0.5 * scale, 2.0 * scale.recip());
        let energy = q.map(|q| 0.5 * self.c * q.exp_m1());
        let mut rotated = [[Lanes::ZERO; 3]; 3];
        for i in 0..3 {
            for a in 0..3 {
                let sum = g[i][0] * scaled[0][a] + g[i][1] * scaled[1][a] + g[i][2] * scaled[2][a];
                rotated[i][a] = scale * sum;
            }
        }
        let mut tangent = [[[Lanes::ZERO; 3]; 3]; 6];
        for (pair, &(i, k)) in PAIRS.iter().enumerate() {
            let mut in_axes = [[Lanes::ZERO; 3]; 3];
            for a in 0..3 {
                for c in 0..3 {
                    let mut sum =
                        twice_inverse * rotated[i][a] * rotated[k][c] + half * (b[a][c] * (g[i][c] * g[k][a]));
                    if a == c {
                        for d in 0..3 {
                            sum += half * (b[a][d] * (g[i][d] * g[k][d]));
                        }
                    }
                    if i == k {
                        sum += scale * scaled[a][c];
                    }
                    in_axes[a][c] = sum;
                }
            }
            tangent[pair] = back(&in_axes, axes);
        }
        let mut stress = [[Lanes::ZERO; 3]; 3];
        for i in 0..3 {
            for p in 0..3 {
                stress[i][p] = axes[0][p] * rotated[i][0] + axes[1][p] * rotated[i][1] + axes[2][p] * rotated[i][2];
            }
        }
        Response { energy, stress, tangent }
    }
}

/// R^T m R
#[inline(always)]
fn back(m: &MatrixLanes, r: &Matrix) -> MatrixLanes {
    let mut half = [[Lanes::ZERO; 3]; 3];
    let mut whole = [[Lanes::ZERO; 3]; 3];
    for a in 0..3 {
        for q in 0..3 {
            half[a][q] = r[0][q] * m[a][0] + r[1][q] * m[a][1] + r[2][q] * m[a][2];
        }
    }
    for p in 0..3 {
        for q in 0..3 {
            whole[p][q] = r[0][p] * half[0][q] + r[1][p] * half[1][q] + r[2][p] * half[2][q];
        }
    }
    whole
}
