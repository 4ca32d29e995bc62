//! What a run leaves behind, so that nothing has to be asked of the program again.
//!
//! ```text
//! runs/<name>-0001/
//!   status.json, manifest.json          how it stands, what was run on what
//!   summary.txt                         the page that the terminal showed
//!   report.html                         the same and more for a browser
//!   log.jsonl                           what the run said, a line of JSON each
//!   tables/*.csv                        numbers; units in the column names, a lost value is an empty cell
//!   tables/activations.sto              the activations for OpenSim
//!   view/result.pvd, muscles.pvd, contact.pvd, markers.pvd, residuals.pvd, linear/result.pvd      shapes for ParaView
//!   state/                              checkpoints of a fit: `risorius resume` goes on from them
//!   view/result_0000.exf, ...           the same shapes for Zinc and cmgui
//! ```
//!
//! Whole files are written atomically, tables grow frame by frame: a crash or a full disk leaves every finished frame
//! readable.

pub mod exf;
pub mod export;
pub mod fibres;
pub mod frame;
pub mod html;
pub mod log;
pub mod machine;
pub mod manifest;
pub mod playback;
pub mod pvd;
pub mod record;
pub mod run_folder;
pub mod state;
pub mod status;
pub mod study;
pub mod summary;
pub mod tables;
pub mod view;
pub mod vtu;

pub use frame::{
    BoneState, ContactState, Frame, MarkerPair, MeshError, MuscleState, Outlier, Probe, ProbeState, bone_states,
    contact_points, contact_states, contact_sums, muscle_states, probe_states,
};
pub use log::{Level, Log};
pub use manifest::{Input, Manifest};
pub use record::Record;
pub use run_folder::RunFolder;
pub use status::{FailedFrame, FrameWarning, Outcome, Status};
pub use view::View;
