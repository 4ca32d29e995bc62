//! Numbers that carry their derivatives along xi1, xi2 and xi3, none of them twice in the same direction.

use std::ops::Mul;

/// A value and its mixed derivatives, indexed by the bit mask d1 + 2 d2 + 4 d3: what a cubic Hermite has at a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jet(pub [f64; 8]);

impl Jet {
    /// f(self) from f and its first three derivatives at the value of self.
    ///
    /// Taylor's series ends, because the part n without the value is a sum of products of different directions:
    /// f(v + n) = f(v) + f'(v) n + f''(v) n n / 2 + f'''(v) n n n / 6.
    fn compose(self, f: [f64; 4]) -> Jet {
        let mut n = self;
        n.0[0] = 0.0;
        let (square, cube) = (n * n, n * n * n);
        let mut sum = [0.0; 8];
        for (m, sum) in sum.iter_mut().enumerate() {
            *sum = f[1] * n.0[m] + f[2] / 2.0 * square.0[m] + f[3] / 6.0 * cube.0[m];
        }
        sum[0] = f[0];
        Jet(sum)
    }

    /// (sin, cos).
    pub fn sin_cos(self) -> (Jet, Jet) {
        let (s, c) = self.0[0].sin_cos();
        (self.compose([s, c, -s, -c]), self.compose([c, -s, -c, s]))
    }

    /// (sinh, cosh).
    pub fn sinh_cosh(self) -> (Jet, Jet) {
        let (s, c) = (self.0[0].sinh(), self.0[0].cosh());
        (self.compose([s, c, s, c]), self.compose([c, s, c, s]))
    }

    /// factor x self.
    pub fn scaled(self, factor: f64) -> Jet {
        Jet(self.0.map(|x| factor * x))
    }
}

impl Mul for Jet {
    type Output = Jet;

    /// Leibniz: the derivative m of a b is the sum over the parts s of m of a_s b_(m without s).
    fn mul(self, other: Jet) -> Jet {
        Jet(std::array::from_fn(|m| (0..=m).filter(|s| s & m == *s).map(|s| self.0[s] * other.0[m ^ s]).sum()))
    }
}
