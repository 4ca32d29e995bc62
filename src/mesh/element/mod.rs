//! FAMILY of hexahedral elements: how a field inside an element follows from the parameters at its corners.
//!
//! Local node k = i + 2 j + 4 l, where (i, j, l) are its ends (0 or 1) along (xi1, xi2, xi3). Local function
//! a = node x (parameters per node) + derivative. To add an element: one file here and one line in [`ELEMENTS`];
//! the conformance tests then run on it.

mod tricubic_hermite;
mod trilinear;

pub use tricubic_hermite::TricubicHermite;
pub use trilinear::Trilinear;

/// The most functions an element may have.
pub const MAX_FUNCTIONS: usize = 64;

/// Every element there is.
pub const ELEMENTS: [&dyn Element; 2] = [&TricubicHermite, &Trilinear];

/// A tensor-product basis on the unit cube.
pub trait Element: Send + Sync + std::fmt::Debug {
    /// The name used in problem files and results.
    fn name(&self) -> &'static str;

    /// Parameters at each of the eight nodes: 1 for values alone, 8 with all mixed derivatives.
    fn parameters_per_node(&self) -> usize;

    /// Values of the 1-D functions of this basis at x in [0, 1]; function index = parameters x end + derivative.
    fn values_1d(&self, x: f64) -> [f64; 4];

    /// Their first derivatives.
    fn slopes_1d(&self, x: f64) -> [f64; 4];

    /// For local function `a`, the index of its 1-D factor in each direction.
    fn factors(&self, a: usize) -> [usize; 3];

    /// The number of functions, at most [`MAX_FUNCTIONS`].
    fn functions(&self) -> usize {
        8 * self.parameters_per_node()
    }

    /// N_a(xi), one per function.
    fn values(&self, xi: [f64; 3]) -> [f64; MAX_FUNCTIONS] {
        let h = xi.map(|x| self.values_1d(x));
        let mut n = [0.0; MAX_FUNCTIONS];
        for (a, n) in n.iter_mut().enumerate().take(self.functions()) {
            let [i, j, k] = self.factors(a);
            *n = h[0][i] * h[1][j] * h[2][k];
        }
        n
    }

    /// dN_a/dxi, one per function.
    fn gradients(&self, xi: [f64; 3]) -> [[f64; 3]; MAX_FUNCTIONS] {
        let h = xi.map(|x| self.values_1d(x));
        let d = xi.map(|x| self.slopes_1d(x));
        let mut g = [[0.0; 3]; MAX_FUNCTIONS];
        for (a, g) in g.iter_mut().enumerate().take(self.functions()) {
            let [i, j, k] = self.factors(a);
            *g = [d[0][i] * h[1][j] * h[2][k], h[0][i] * d[1][j] * h[2][k], h[0][i] * h[1][j] * d[2][k]];
        }
        g
    }
}

/// The ends (0 or 1) of local node k along each direction.
pub fn ends(node: usize) -> [usize; 3] {
    [node & 1, (node >> 1) & 1, node >> 2]
}
