//! The one error type. Every variant has a stable code, carries the numbers a reader needs, and a remedy.
//!
//! Codes: `C` problem file, `M` recording, `K` markers against the model, `G` geometry, `S` solver, `F` fit,
//! `O` output. A code never changes its meaning; a retired code is not used again.

use std::path::PathBuf;

/// The result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, with its numbers, place and units.
///
/// `Display` gives the message (what, where, how much); [`Error::code`] the stable code, [`Error::help`] the
/// edit or command that mends it, [`Error::exit_code`] what the process returns.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    // ---- C: problem file ------------------------------------------------------------------------------
    // ---- M: recording ---------------------------------------------------------------------------------
    // ---- K: markers against the model -----------------------------------------------------------------
    // ---- G: geometry ----------------------------------------------------------------------------------
    // ---- S: solver ------------------------------------------------------------------------------------
    /// The factorisation met a pivot that is not a finite number.
    #[error("the tangent matrix cannot be factorised: it holds a value that is not finite")]
    NotFinite,
    /// The factorisation met a pivot that is exactly zero, or whose inverse overflows.
    #[error("the tangent matrix is singular: no pivot is left for unknown {unknown}")]
    Singular {
        /// Number of the unknown, counted from 0 after the supports have been removed.
        unknown: usize,
    },
    /// The factor of the tangent matrix does not fit into memory.
    #[error("no memory for the factor of the tangent matrix: {unknowns} unknowns, {entries} entries of 8 bytes")]
    FactorTooLarge {
        /// Number of unknowns.
        unknowns: usize,
        /// Entries of the triangular factor.
        entries: usize,
    },
    /// A solve was asked of a factor that was never filled, or whose last factorisation failed.
    #[error("the tangent matrix has not been factorised")]
    NotFactored,
    /// Newton's method found no equilibrium on the way to the asked load and controls.
    #[error(
        "no equilibrium beyond {:.4} of the way to the asked load and controls ({reason}; step cut {cuts} times, now {step:.1e})\n  worst point: element {element}, Gauss point {point}: det F = {det_f:.4}; residual {residual:.2e} mN, required {required:.1e} mN",
        reached
    )]
    NotConverged {
        /// Part of the way, 0 to 1, at which the last equilibrium was found.
        reached: f64,
        /// How often the step was cut.
        cuts: usize,
        /// The length of the step that failed.
        step: f64,
        /// Why Newton's method stopped.
        reason: &'static str,
        /// Host element of the smallest det F in the last iterate.
        element: usize,
        /// Its Gauss point, first direction fastest.
        point: usize,
        /// det F there.
        det_f: f64,
        /// Norm of the residual in the last iterate, mN.
        residual: f64,
        /// The norm required, mN.
        required: f64,
    },
    /// A refined solution of a linear system is not accurate enough.
    #[error(
        "a linear system was solved to a relative residual of {residual:.1e}, required {required:.1e}: the tangent is close to singular"
    )]
    InaccurateSolve {
        /// Relative residual reached.
        residual: f64,
        /// Relative residual required.
        required: f64,
    },
    // ---- F: fit ---------------------------------------------------------------------------------------
    // ---- O: output ------------------------------------------------------------------------------------
    /// A file could not be read or written.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The verb: `read`, `write`, `create`, `rename`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
}

impl Error {
    /// The stable code, for example `S003`.
    pub fn code(&self) -> &'static str {
        match self {
            Error::NotFinite => "S001",
            Error::NotConverged { .. } => "S003",
            Error::InaccurateSolve { .. } => "S004",
            Error::Singular { .. } => "S010",
            Error::FactorTooLarge { .. } => "S011",
            Error::NotFactored => "S012",
            Error::Io { .. } => "O001",
        }
    }

    /// The edit or command that mends it, where one is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Error::NotFinite => None,
            Error::InaccurateSolve { .. } => {
                Some("the body is at a limit point or held too little: check the supports and the path".into())
            }
            Error::NotConverged { .. } => Some(
                "the last equilibrium is kept; try shorter steps (--set solver.step_max=0.05), a volumetric term \
                 (--set tissue.kappa_kpa=10), a finer mesh where det F is small, or a smaller load"
                    .into(),
            ),
            Error::Singular { .. } => {
                Some("hold the body: check that the supports prevent every rigid motion".into())
            }
            Error::FactorTooLarge { .. } => Some("use a coarser mesh or a machine with more memory".into()),
            Error::NotFactored => None,
            Error::Io { .. } => Some("check that the path exists and that you may use it".into()),
        }
    }

    /// The exit code of the process: 3 invalid input, 4 not converged, 6 input or output failed.
    pub fn exit_code(&self) -> u8 {
        match self.code().as_bytes()[0] {
            b'S' | b'F' => 4,
            b'O' => 6,
            _ => 3,
        }
    }
}
