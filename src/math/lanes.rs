//! Eight numbers at a time, for formulas evaluated at eight quadrature points at once.
//!
//! Plain arrays with inlined arithmetic: inside a kernel that was compiled for wide vector instructions each operation
//! becomes one instruction or a few, and elsewhere it stays correct.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// The number of lanes.
pub const WIDTH: usize = 8;

/// Eight independent numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; WIDTH]);

impl Lanes {
    /// All lanes zero.
    pub const ZERO: Lanes = Lanes([0.0; WIDTH]);

    /// The same number in all lanes.
    #[inline(always)]
    pub fn splat(x: f64) -> Lanes {
        Lanes([x; WIDTH])
    }

    /// Each lane mapped by `f`.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f64) -> f64) -> Lanes {
        let mut r = self.0;
        for x in &mut r {
            *x = f(*x);
        }
        Lanes(r)
    }

    /// 1 / x in each lane.
    #[inline(always)]
    pub fn recip(self) -> Lanes {
        self.map(|x| 1.0 / x)
    }
}

macro_rules! elementwise {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl $trait for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $method(self, other: Lanes) -> Lanes {
                let mut r = self.0;
                for l in 0..WIDTH {
                    r[l] = self.0[l] $operator other.0[l];
                }
                Lanes(r)
            }
        }
    };
}
elementwise!(Add, add, +);
elementwise!(Sub, sub, -);
elementwise!(Mul, mul, *);

impl Mul<Lanes> for f64 {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        Lanes::splat(self) * other
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Lanes) {
        *self = *self + other;
    }
}

impl Neg for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn neg(self) -> Lanes {
        self.map(|x| -x)
    }
}

/// A 3x3 matrix at eight points, `m[row][column]`.
pub type MatrixLanes = [[Lanes; 3]; 3];

/// The cofactors of m: cof m = det(m) m^-T, so that d(det m)/dm = cof m.
#[inline(always)]
pub fn cofactors(m: &MatrixLanes) -> MatrixLanes {
    let mut c = [[Lanes::ZERO; 3]; 3];
    for i in 0..3 {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        for j in 0..3 {
            let (p, q) = ((j + 1) % 3, (j + 2) % 3);
            c[i][j] = m[a][p] * m[b][q] - m[a][q] * m[b][p];
        }
    }
    c
}

/// a . b
#[inline(always)]
pub fn dot(a: [Lanes; 3], b: [Lanes; 3]) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
