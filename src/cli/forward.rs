//! Task `forward`: equilibria for given activations, one after the other in time.

use super::Flags;
use super::estimate::{Estimated, Estimates, of_probes};
use super::noticed::noticed;
use super::prepare::Prepared;
use super::progress::{Meter, stage};
use super::run::{Run, Tally};
use super::terminal::print;
use super::writer::{Desk, Writer, beside};
use crate::error::Result;
use crate::fit::sequence::settings;
use crate::forward::drives::drives;
use crate::forward::{Drive, Equilibrium, Solver, Work};
use crate::model::Model;
use crate::model::build::Built;
use crate::report::summary::{ForwardSummary, MeshErrors};
use crate::report::{FailedFrame, Frame, Probe, Record, bone_states, muscle_states, probe_states};
use crate::scene::Scene;
use std::sync::Arc;

/// A frame that converged.
type Solved = (Frame, Arc<Equilibrium>);

/// Solves every frame, writes it, prints the page.
pub(super) fn forward(
    scene: &Scene,
    prepared: &Prepared,
    run: &Run,
    flags: &Flags,
    work: &mut Work,
) -> Result<Tally> {
    let built = &prepared.built;
    let model = &built.model;
    let probes = probes(scene, built);
    let record = Record::create(&run.folder, model, &probes, &scene.output, false)?;
    let drives = drives(scene, model)?;
    let mut solver = stage(&run.log, flags, "order the unknowns", || Solver::new(model, settings(scene)))?;
    let meter = Meter::new(flags, drives.len(), Some(&run.log));
    solver.set_watch(meter.steps(flags));
    let mut desk = Desk { record, meter };
    let (mut tally, last) = beside(&mut desk, |writer| frames(model, &mut solver, &drives, writer, (run, flags)))?;
    let mut estimates = Estimates::new(prepared, settings(scene), of_probes(&probes))?;
    let mut mesh_errors = MeshErrors::default();
    if let Some((frame, found)) = &last {
        let Estimated { error, warning } = estimates.forward(*frame, &found.state);
        if let Some(error) = &error {
            desk.record.estimate(*frame, error)?;
            mesh_errors.add(*frame, error);
        }
        tally.warn(*frame, warning.into_iter().collect(), &desk.meter, flags);
    }
    desk.meter.finish();
    *work = solver.work();
    let cost = estimates.cost();
    cost.iter().for_each(|(work, seconds)| mesh_errors.took(work.iterations, *seconds));
    desk.finish(work, cost, &run.log, flags)?;
    if let Some((frame, found)) = &last {
        let x = model.current(&found.state);
        let summary = ForwardSummary {
            name: &scene.name,
            frames_ok: tally.frames_ok,
            frames_failed: tally.failed.len(),
            frame: *frame,
            probes: &probe_states(&probes, model, &found.state),
            muscles: &muscle_states(model, &found.state, &found.evaluation),
            bones: &bone_states(model, &found.state, &found.evaluation),
            tissue_energy: found.evaluation.energies[0],
            external_work: model.external_work(&found.state),
            reactions: &model.supports().rotation_reactions(model.mesh(), &found.evaluation.force, &x),
            det_f: found.evaluation.det_f,
            volume_change: model.mesh().volume(&x) / model.mesh().volume(&model.mesh().parameters) - 1.0,
            mesh_errors: &mesh_errors,
            iterations: work.iterations,
            seconds: run.start.elapsed().as_secs_f64(),
            folder: &run.folder.path().display().to_string(),
        };
        let page = summary.to_string();
        run.folder.write("summary.txt", &page)?;
        print(&page)?;
    }
    Ok(tally)
}

/// Solves frame after frame and hands each over to be written; gives back how they ended, and the last that converged.
fn frames<'a>(
    model: &Model,
    solver: &mut Solver<'_>,
    drives: &[(f64, Drive)],
    writer: &mut Writer<'a>,
    (run, flags): (&'a Run, &'a Flags),
) -> Result<(Tally, Option<Solved>)> {
    let mut tally = Tally::default();
    let mut state = model.rest();
    let mut last = None;
    for (index, (time_s, drive)) in drives.iter().enumerate() {
        if run.is_interrupted() {
            tally.interrupted = true;
            break;
        }
        let frame = Frame { index, time_s: *time_s };
        let before = solver.work().iterations;
        match solver.equilibrium(&state, drive) {
            Ok(found) => {
                tally.frames_ok += 1;
                let iterations = solver.work().iterations - before;
                let warnings = noticed(frame, model, &found);
                tally.keep(frame, &warnings);
                state.clone_from(&found.state);
                let found = Arc::new(found);
                last = Some((frame, Arc::clone(&found)));
                let status = tally.running();
                writer.write(move |Desk { record, meter }| {
                    record.frame(frame, &found, &[], &[])?;
                    record.done(frame, &found, &[])?;
                    say(frame, iterations, &found, meter);
                    warnings.iter().for_each(|warning| meter.warn(warning, flags));
                    status.write(&run.folder)
                })?;
            }
            Err(failure) => {
                tally.failed.push(FailedFrame::new(index, &failure.error));
                // the next frame starts from the last equilibrium on the way
                state.clone_from(&failure.last_good);
                let status = tally.running();
                writer.write(move |Desk { record, meter }| {
                    meter.fail(&failure.error, flags);
                    let [last_good, failed] = record.failed(frame, &failure)?;
                    meter.say(&format!(
                        "  written: the last equilibrium, {:.1} % of the way: {}; the iterate that failed: {}\n",
                        100.0 * failure.reached,
                        last_good.display(),
                        failed.display()
                    ));
                    meter.frame(
                        &format!("t {:.3} s: failed", frame.time_s),
                        &[("frame", frame.index as f64), ("frame_time_s", frame.time_s)],
                    );
                    status.write(&run.folder)
                })?;
            }
        }
    }
    Ok((tally, last))
}

/// Says that a frame is done.
fn say(Frame { index, time_s }: Frame, iterations: usize, found: &Equilibrium, meter: &mut Meter) {
    let range = found.evaluation.det_f;
    let [low, high] = [range.min, range.max];
    meter.frame(
        &format!("t {time_s:.3} s: {iterations} iterations, det F {low:.3} to {high:.3}"),
        &[
            ("frame", index as f64),
            ("frame_time_s", time_s),
            ("iterations", iterations as f64),
            ("det_f_min", low),
            ("det_f_max", high),
        ],
    );
}

/// The probes of a scene with the places that were found for them.
pub(super) fn probes(scene: &Scene, built: &Built) -> Vec<Probe> {
    scene.probes.iter().zip(&built.probes).map(|(spec, at)| Probe { name: spec.name.clone(), at: *at }).collect()
}
