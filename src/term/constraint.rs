//! Terms whose law holds exactly only in the limit of multipliers l that an outer loop renews (Uzawa's method).
//!
//! At the fixed point l = psi'(g; l). How the fixed point moves with the controls follows from B dx = 0 on the points that
//! are closed, with B = sqrt(w) dg/dx: K dx + B^T z = - dr/dq, where K holds the penalty too. Where a bone carries what the
//! gap is measured to, it is B dx + sqrt(w) dg/dq = 0.

use super::ElementState;

/// A term with multipliers.
pub trait Constraint {
    /// The number of multipliers, over all elements.
    fn multipliers(&self) -> usize;

    /// The gap that may remain, mm.
    fn tolerance(&self) -> f64;

    /// Renews the multipliers of one element in the list of all; returns the largest gap that should be zero, mm.
    fn renew(&self, state: &ElementState<'_>, multipliers: &mut [f64]) -> f64;

    /// Adds B^T z of one element; `z` has one entry per multiplier.
    fn add_constraint_force(&self, state: &ElementState<'_>, z: &[f64], force: &mut [[f64; 64]; 3]);

    /// Sets z = B du in one element for the change `du` of its local parameters; zero at points that are open.
    fn constraint_rate(&self, state: &ElementState<'_>, du: &[[f64; 64]; 3], z: &mut [f64]);

    /// Adds sqrt(w) dg/dq in one element for the control q at a fixed shape; zero at points that are open.
    fn add_control_rate(&self, _control: usize, _state: &ElementState<'_>, _z: &mut [f64]) {}
}
