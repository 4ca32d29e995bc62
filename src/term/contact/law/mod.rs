//! FAMILY of contact laws: the energy per reference area that keeps a gap closed, or open.
//!
//! psi(g) has the slope psi' = - pressure (kPa) and the curvature psi'' >= 0 (kPa/mm). How to add a law:
//! `src/guide/adding.md`.

pub mod augmented;
pub mod barrier;
pub mod penalty;
pub mod smooth;

pub use augmented::Augmented;
pub use barrier::Barrier;
pub use penalty::Penalty;
pub use smooth::Smooth;

/// Which gaps a law allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Allows {
    /// g = 0: the body stays on the surface and slides along it.
    Closed,
    /// g >= 0: the body may lift off.
    ClosedOrOpen,
}

/// psi and its derivatives by the gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// psi, kPa mm.
    pub energy: f64,
    /// psi', kPa: minus the pressure.
    pub slope: f64,
    /// psi'', kPa/mm.
    pub stiffness: f64,
}

impl Response {
    /// No contact.
    pub const NONE: Response = Response { energy: 0.0, slope: 0.0, stiffness: 0.0 };
}

/// A law of frictionless contact.
pub trait ContactLaw: Send + Sync + std::fmt::Debug {
    /// The name used in problem files.
    fn name(&self) -> &'static str;

    /// The response to a gap (mm) with a multiplier (kPa); NaN where the law does not admit the gap.
    fn response(&self, gap: f64, allows: Allows, multiplier: f64) -> Response;

    /// The range over which it sets in, mm, if that may be widened for a while: contact that opens and closes softly is found in far
    /// fewer steps, and is a good guess for what opens and closes at once.
    fn eases(&self) -> Option<f64> {
        None
    }

    /// The response of a law that sets in over a range that is wider by `easing` mm, if it may be.
    fn eased(&self, _easing: f64, gap: f64, allows: Allows, multiplier: f64) -> Response {
        self.response(gap, allows, multiplier)
    }

    /// Its stiffness k, kPa/mm.
    fn stiffness(&self) -> f64;

    /// The gap (mm) at which contact begins before anything touches.
    fn range(&self) -> f64 {
        0.0
    }

    /// The gap (mm) to which multipliers close a gap that should be zero; `None` for a law that has no multipliers.
    fn gap_tolerance(&self) -> Option<f64> {
        None
    }
}
