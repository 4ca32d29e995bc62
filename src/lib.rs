#![forbid(unsafe_code)]
#![warn(missing_docs)]
//! risorius finds out which muscles moved a face.
//!
//! # The balance
//!
//! Displacement u and pressure p of a body in equilibrium make the energy stationary for the given activations a:
//!
//! ```text
//! Pi(u, p; a) =  sum over tissue points      w [ psi(F) - p (J - 1) + kappa/4 (J^2 - 1 - 2 ln J) ]
//!              + sum over muscles m, points  w sigma_max [ a_m G_act(s) + G_pas(s) ]
//!              - work of dead loads
//!
//! r(u, p; a) = dPi/d(u, p) = 0,   K = dr/d(u, p) symmetric and indefinite,   K d(u, p)/da = - dr/da
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | X, x = X + u | reference and current position | mm |
//! | F = dx/dX, J = det F | deformation gradient, volume ratio | |
//! | w | Gauss weight x reference volume | mm3 |
//! | psi | energy density of the tissue's law | kPa |
//! | p | pressure, positive in compression | kPa |
//! | n0, s = \|F n0\| / lambda_ofl | fibre direction, normalised stretch | |
//! | a_m | activation of muscle m, in \[0, 1\] | |
//! | sigma_max | isometric stress of a muscle | kPa |
//! | r | forces | mN |
//! | Pi | energy | uJ |
//!
//! Each line of Pi is one [`term::Term`]; an effect that a scene does not name has no term. Displacement is interpolated by
//! tricubic Hermite hexahedra, pressure by one of [`term::pressure::PRESSURE_SPACES`].
//!
//! # Where to read on
//!
//! | what | where |
//! |---|---|
//! | every key of a problem file, every table of a run, the face, recordings, what was checked, how to add to it | [`guide`] |
//! | tissue: incompressible, with its laws | [`term::tissue`], [`material`] |
//! | muscles: fibres, quadrature, soft ends | [`term::muscle`], [`material::fibre`], [`term::muscle_rule`], [`term::taper`] |
//! | loads: gravity, traction, follower pressure, forces on points | [`term::load`] |
//! | contact and sliding: surfaces, laws, two faces that yield | [`term::contact`], [`term::contact::mutual`] |
//! | springs, ties, bones, supports | [`term::spring`], [`term::tie`], [`term::bone`], [`model::supports`] |
//! | what a fit minimises, and what it is sure of | [`fit::objective`], [`fit::identifiability`] |
//!
//! # The way of the data
//!
//! ```text
//! scene::Scene -> model::build -> model::Model -> forward::Solver -> forward::Equilibrium
//!                                                      ^
//!            markers::read -> markers::Recording -> fit::Fit -> fit::Estimate -> report
//! ```
//!
//! ```
//! use risorius::forward::{Drive, Solver};
//! use risorius::model::build::build;
//! use risorius::scene::Scene;
//! use std::path::Path;
//!
//! let text = r#"
//!     [task]
//!     kind = "forward"
//!     [mesh]
//!     block = { origin_mm = [0, 0, 0], size_mm = [40, 10, 10], elements = [4, 1, 1] }
//!     [tissue]
//!     mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
//!     [[support]]
//!     clamp = { face = "xi1=0" }
//!     [[load]]
//!     traction = { face = "xi1=1", kpa = [0, 0, -0.01] }
//! "#;
//! let scene = Scene::parse(text, "cantilever.toml", Path::new("."), &[])?;
//! let model = build(&scene)?.model;
//! let mut solver = Solver::new(&model, Default::default())?;
//! let found = solver.equilibrium(&model.rest(), &Drive { controls: vec![], load: 1.0 }).map_err(risorius::Error::from)?;
//! assert_eq!(found.negative_modes, Some(0));
//! assert!(model.external_work(&found.state) > 0.0);
//! # Ok::<(), risorius::Error>(())
//! ```

pub mod cli;
pub mod error;
pub mod fibres;
pub mod fit;
pub mod forward;
pub mod guide;
pub mod markers;
pub mod material;
pub mod math;
pub mod mesh;
pub mod model;
pub mod report;
pub mod scene;
pub mod solve;
pub mod study;
pub mod term;

pub use error::{Error, Place, Result, Warning};
