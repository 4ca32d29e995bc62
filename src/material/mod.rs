//! Stress at a point. FAMILY of tissue laws, and the force-stretch law of muscle fibres.
//!
//! To add a tissue law: one file here with its energy and derivatives, and a few lines elsewhere (`src/guide/adding.md`); the
//! conformance tests of `tests/laws.rs` then run on it.

pub mod fibre;
pub mod guccione;
pub mod mooney_rivlin;
pub mod neo_hookean;

use crate::math::lanes::{Lanes, MatrixLanes};

pub use guccione::Guccione;
pub use mooney_rivlin::MooneyRivlin;
pub use neo_hookean::NeoHookean;

/// The pairs (i, k) of spatial components for which a tangent is stored; the others follow by symmetry.
pub const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Energy density and its derivatives by the deformation gradient F, at eight points.
#[derive(Debug, Clone, Copy)]
pub struct Response {
    /// psi, kPa (= uJ/mm3).
    pub energy: Lanes,
    /// P = dpsi/dF, kPa: `stress[i][J]`.
    pub stress: MatrixLanes,
    /// A = dP/dF, kPa: `tangent[pair][J][L]` = d2 psi / (dF_iJ dF_kL) for (i, k) = [`PAIRS`]`[pair]`.
    pub tangent: [MatrixLanes; 6],
}

/// A hyperelastic tissue law.
///
/// Implementations are inlined into the tissue kernel, which is compiled for several instruction sets; mark
/// [`Law::response`] `#[inline(always)]`.
pub trait Law: Send + Sync {
    /// The name used in problem files and results.
    fn name(&self) -> &'static str;

    /// psi(F), P(F), A(F) at eight points. F must have det F > 0; elsewhere the result is meaningless but finite or NaN.
    fn response(&self, f: &MatrixLanes) -> Response;

    /// A modulus for scaling (kPa): the shear modulus at rest, of a shear along the fibres where there are any.
    fn shear_modulus(&self) -> f64;
}
