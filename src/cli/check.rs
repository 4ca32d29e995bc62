//! `risorius check problem.toml`: everything but the solve.

use super::problem::{Source, chosen_frames, recording_warnings};
use super::{Ending, Flags};
use crate::error::Result;
use crate::fit::Fit;
use crate::model::Model;
use crate::model::build::build;
use crate::scene::{Scene, Task};
use std::path::Path;

pub(super) fn check(path: Option<&Path>, flags: &Flags) -> Result<Ending> {
    let source = Source::read(path, flags)?;
    let scene = &source.scene;
    let built = build(scene)?;
    let mut warnings = scene.warnings.clone();
    warnings.extend(built.warnings);
    print!("{}", describe(scene, &built.model));
    if let (Task::Fit, Some(fit)) = (scene.task, &scene.fit) {
        let recording = source.recording(fit)?;
        warnings.extend(recording_warnings(&recording));
        let frames = chosen_frames(fit, &recording)?;
        let prepared = Fit::new(&built.model, scene, fit, &recording)?;
        let farthest = prepared.markers().iter().map(|m| m.distance).fold(0.0, f64::max);
        println!(
            "recording: {} of {} frames, {} of {} labels used; farthest marker {farthest:.3} mm from the surface",
            frames.len(),
            recording.frames.len(),
            prepared.markers().len(),
            recording.labels.len()
        );
    }
    flags.warn(&warnings);
    println!("ok: {}", if warnings.is_empty() { "no mistakes" } else { "no mistakes, but see the warnings" });
    Ok(if flags.strict && !warnings.is_empty() { Ending::Warned } else { Ending::Ok })
}

/// Size, effects and cost of a problem in a few lines.
pub(super) fn describe(scene: &Scene, model: &Model) -> String {
    let (mesh, numbering) = (model.mesh(), model.numbering());
    let mut text = format!(
        "{}: {}; {} elements, {} nodes, {} unknowns ({} pressures, {}), kappa {} kPa\n",
        scene.name,
        scene.task.word(),
        mesh.elements(),
        mesh.nodes,
        numbering.unknowns(),
        numbering.pressures(),
        model.space().name(),
        scene.tissue.kappa_kpa
    );
    text += "effects on, with quadrature points per evaluation:\n";
    for (term, points) in model.terms().iter().zip(model.points()) {
        text += &format!("  {:<20} {points:>8}\n", term.name());
    }
    text += &format!(
        "one Newton iteration: factorisation of {:.2} Gflop, {:.1} MB of factor\n",
        model.factor_flops() / 1e9,
        8e-6 * model.symbolic().factor_nnz() as f64
    );
    text
}
