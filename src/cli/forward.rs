//! Task `forward`: equilibria for given activations, one after the other in time.

use super::Flags;
use super::noticed::noticed;
use super::progress::Meter;
use super::run::{Run, Tally};
use super::terminal::print;
use crate::cli::diagnostics::render_error;
use crate::error::Result;
use crate::fit::sequence::settings;
use crate::forward::{Drive, Equilibrium, Solver, Work};
use crate::model::build::Built;
use crate::report::summary::ForwardSummary;
use crate::report::{FailedFrame, Frame, Probe, Record, muscle_states, probe_states};
use crate::scene::{ControlValue, Curves, Scene};

/// Solves every frame, writes it, prints the page.
pub(super) fn forward(scene: &Scene, built: &Built, run: &Run, flags: &Flags, work: &mut Work) -> Result<Tally> {
    let model = &built.model;
    let probes = probes(scene, built);
    let mut record = Record::create(&run.folder, model, &probes, &scene.output, false)?;
    let drives = drives(scene, built)?;
    let mut solver = Solver::new(model, settings(scene))?;
    let mut meter = Meter::new(flags, drives.len());
    let mut tally = Tally::default();
    let mut state = model.rest();
    let mut last: Option<(Frame, Equilibrium)> = None;
    for (index, (time_s, drive)) in drives.iter().enumerate() {
        if run.is_interrupted() {
            tally.interrupted = true;
            break;
        }
        let frame = Frame { index, time_s: *time_s };
        let before = solver.work().iterations;
        match solver.equilibrium(&state, drive) {
            Ok(found) => {
                record.frame(frame, &found, &[], &[], &[])?;
                tally.frames_ok += 1;
                let iterations = solver.work().iterations - before;
                let range = found.evaluation.det_f;
                meter.frame(format!(
                    "t {time_s:.3} s: {iterations} iterations, det F {:.3} to {:.3}",
                    range.min, range.max
                ));
                tally.warn(frame, noticed(frame, model, &found), &mut meter, flags);
                state.clone_from(&found.state);
                last = Some((frame, found));
            }
            Err(failure) => {
                meter.say(&render_error(&failure.error, flags.colour()));
                let [last_good, failed] = record.failed(frame, &failure)?;
                meter.say(&format!(
                    "  written: the last equilibrium, {:.1} % of the way: {}; the iterate that failed: {}\n",
                    100.0 * failure.reached,
                    last_good.display(),
                    failed.display()
                ));
                meter.frame(format!("t {time_s:.3} s: failed"));
                tally.failed.push(FailedFrame::new(index, &failure.error));
                // the next frame starts from the last equilibrium on the way
                state = failure.last_good;
            }
        }
        run.write_running(&tally)?;
    }
    meter.finish();
    *work = solver.work();
    record.finish(work)?;
    if let Some((frame, found)) = &last {
        let x = model.current(&found.state);
        let summary = ForwardSummary {
            name: &scene.name,
            frames_ok: tally.frames_ok,
            frames_failed: tally.failed.len(),
            frame: *frame,
            probes: &probe_states(&probes, model, &found.state),
            muscles: &muscle_states(model, &found.state, &found.evaluation),
            tissue_energy: found.evaluation.energies[0],
            external_work: model.external_work(&found.state),
            reactions: &model.supports().rotation_reactions(model.mesh(), &found.evaluation.force, &x),
            det_f: found.evaluation.det_f,
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

/// The probes of a scene with the places that were found for them.
pub(super) fn probes(scene: &Scene, built: &Built) -> Vec<Probe> {
    scene.probes.iter().zip(&built.probes).map(|(spec, at)| Probe { name: spec.name.clone(), at: *at }).collect()
}

/// Time and drive of every frame: one frame where all controls are constant, else one for every time of the curves.
fn drives(scene: &Scene, built: &Built) -> Result<Vec<(f64, Drive)>> {
    let muscles: Vec<String> = scene.muscles.iter().map(|m| m.name.clone()).collect();
    // muscles driven by a table: name, controls, table
    let mut curves: Vec<(&str, &[usize], Curves)> = Vec::new();
    let mut controls = vec![0.0; built.model.controls().len()];
    for control in &scene.controls {
        let own = built.model.muscle_controls(&control.name);
        if let ControlValue::Csv(path) = &control.value {
            curves.push((&control.name, own, Curves::read(path, &muscles)?));
        }
        for (k, value) in own.iter().zip(control.value.constants(own.len()).unwrap_or_default()) {
            controls[*k] = value;
        }
    }
    let mut times: Vec<f64> = curves.iter().flat_map(|(.., c)| c.times_s.iter().copied()).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    if times.is_empty() {
        return Ok(vec![(0.0, Drive { controls, load: 1.0 })]);
    }
    let at = |time_s: f64| {
        let mut controls = controls.clone();
        for (name, own, curve) in &curves {
            own.iter().for_each(|k| controls[*k] = curve.at(name, time_s).unwrap_or(0.0));
        }
        (time_s, Drive { controls, load: 1.0 })
    };
    Ok(times.into_iter().map(at).collect())
}
