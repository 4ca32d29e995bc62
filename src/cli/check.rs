//! `risorius check problem.toml`: everything but the solve.

use super::prepare::{Clip, Prepared, prepare};
use super::problem::Source;
use super::terminal::print;
use super::{Ending, Flags, fibres, study};
use crate::error::{Missing, Result};
use crate::model::Model;
use crate::model::halved::Halved;
use crate::scene::{ControlRange, Problem, Scene, Task};
use std::path::Path;

pub(super) fn check(path: Option<&Path>, flags: &Flags) -> Result<Ending> {
    if let Some(path) = path {
        match Problem::read(path, &flags.set)? {
            Problem::Study(study) => return study::check(&study),
            Problem::Fibres(problem) => return fibres::check(&problem),
            Problem::Scene(_) => {}
        }
    }
    let source = Source::read(path, flags)?;
    let Prepared { built, clip, halved, warnings } = prepare(&source)?;
    let mut page = describe(&source.scene, &built.model, halved.as_ref());
    page += &clip.as_ref().map(describe_clip).unwrap_or_default();
    page += if warnings.is_empty() { "ok: no mistakes\n" } else { "ok: no mistakes, but see the warnings\n" };
    flags.warn(&warnings);
    print(&page)?;
    Ok(if flags.strict && !warnings.is_empty() { Ending::Warned } else { Ending::Ok })
}

/// Size, effects and cost of a problem in a few lines.
pub(super) fn describe(scene: &Scene, model: &Model, halved: Option<&Halved>) -> String {
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
    for bone in &scene.bones {
        let ranges = ControlRange::of_bone(bone).into_iter();
        let ranges = ranges.map(|ControlRange { name, kind, lower, upper }| {
            format!("{name} from {lower} to {upper} {}", kind.unit())
        });
        text += &format!("  bone {:<15} {}\n", bone.name, ranges.collect::<Vec<_>>().join(", "));
    }
    let effects = scene.effects();
    let off: Vec<&str> = effects.iter().filter(|(_, count)| *count == 0).map(|(effect, _)| *effect).collect();
    text += &format!("effects off: {}\n", off.join(", "));
    text += &format!(
        "one Newton iteration: factorisation of {:.1} Mflop, {:.1} MB of factor\n",
        model.factor_flops() / 1e6,
        8e-6 * model.symbolic().factor_nnz() as f64
    );
    if let Some(halved) = halved {
        let model = &halved.built.model;
        text += &format!(
            "estimate of the error: a few more iterations {}, with {} unknowns: factorisation of {:.1} Mflop, {:.1} MB of factor\n",
            if scene.task == Task::Fit { "per frame" } else { "at the end" },
            model.numbering().unknowns(),
            model.factor_flops() / 1e6,
            8e-6 * model.symbolic().factor_nnz() as f64
        );
    }
    text
}

/// What a fit will use of its recording, and what is missing there.
fn describe_clip(Clip { recording, registration, frames, markers, .. }: &Clip) -> String {
    let health = &recording.health;
    let labels: Vec<_> = markers.iter().map(|marker| &health.labels[marker.column]).collect();
    let missing = labels.iter().fold(Missing::default(), |sum, label| sum.plus(label.missing));
    let farthest = markers.iter().map(|marker| marker.distance).fold(0.0, f64::max);
    let rate = health.rate_hz.map(|rate| format!(" at {rate:.1} Hz")).unwrap_or_default();
    let mut text = format!(
        "recording: {} of {} frames used, {:.2} s{rate}; {} of {} labels used\n",
        frames.len(),
        health.frames,
        health.duration_s,
        markers.len(),
        recording.labels.len()
    );
    let (gaps, back, twice) = (health.gaps.len(), health.backward_steps, health.duplicate_stamps);
    if gaps + back + twice > 0 {
        text += &format!("  its clock has {gaps} gaps, {back} steps back in time, {twice} stamps twice\n");
    }
    text += &format!("  {} of {} samples are missing", missing.total(), labels.len() * health.frames);
    if missing.total() > 0 {
        text += &format!(": {missing}");
    }
    text + &format!("\n  the farthest marker is placed {farthest:.3} mm from the surface\n{registration}")
}
