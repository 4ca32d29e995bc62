//! Terms that couple elements which need not share a node: faces that meet, as in [`contact::mutual`](super::contact::mutual).
//!
//! What meets what changes with the state. A coupling therefore sees the whole body, and gives small systems, one for
//! each pair of faces that meet at this state.

use crate::math::tensor::Vector;
use crate::mesh::Mesh;
use crate::mesh::face::Face;

use super::Want;
use super::contact::ContactPoint;

/// What a coupling is told about the body.
#[derive(Debug, Clone, Copy)]
pub struct BodyState<'a> {
    /// The host.
    pub mesh: &'a Mesh,
    /// Global parameters of the current geometry x = X + u, mm.
    pub x: &'a [Vector],
    /// Factor on loads, 0 to 1 along the load path.
    pub load: f64,
    /// By how much contact sets in more slowly than its law says, mm.
    pub easing: f64,
    /// The multipliers of the coupling; empty for one that has none.
    pub multipliers: &'a [f64],
}

/// What two faces exert on each other. The local entries are, of the first face and then of the second, component by
/// component those functions of the element that are not zero on the face ([`crate::mesh::face::Side::functions`]).
#[derive(Debug, Clone)]
pub struct FacePair {
    /// The faces.
    pub faces: [Face; 2],
    /// dPi/du, one per local entry.
    pub force: Vec<f64>,
    /// d2Pi/du du, row by row; empty unless it was wanted.
    pub stiffness: Vec<f64>,
}

/// What a coupling adds to the balance.
#[derive(Debug, Clone, Default)]
pub struct Coupled {
    /// Energy, uJ.
    pub energy: f64,
    /// The pairs of faces that meet, in a fixed order, each once.
    pub pairs: Vec<FacePair>,
}

/// An effect between faces of the host.
pub trait Coupling: Send + Sync {
    /// Quadrature points: a count of work.
    fn points(&self) -> usize;

    /// See [`ContactLaw::eases`](super::contact::law::ContactLaw::eases).
    fn eases(&self) -> Option<f64>;

    /// Pairs of faces that are so near at rest that they may be expected to meet: a hint for the order of elimination.
    fn neighbours(&self) -> &[[Face; 2]];

    /// Energy, forces and, if wanted, stiffness.
    fn add(&self, body: &BodyState<'_>, want: Want) -> Coupled;

    /// dr/d(load).
    fn load_force(&self, body: &BodyState<'_>) -> Vec<FacePair>;

    /// All quadrature points at a state.
    fn contact_points(&self, body: &BodyState<'_>) -> Vec<ContactPoint>;

    /// The number of multipliers; 0 for a law without.
    fn multipliers(&self) -> usize;

    /// The gap that may remain where there are multipliers, mm.
    fn tolerance(&self) -> f64;

    /// Renews the multipliers; returns the largest gap that should be zero, mm.
    fn renew(&self, body: &BodyState<'_>, multipliers: &mut [f64]) -> f64;

    /// B^T z, see [`super::constraint`].
    fn constraint_force(&self, body: &BodyState<'_>, z: &[f64]) -> Vec<FacePair>;

    /// Sets z = B du for the change `du` of the global parameters.
    fn constraint_rate(&self, body: &BodyState<'_>, du: &[Vector], z: &mut [f64]);
}
