//! Everything that a run writes for each frame, in one place for all tasks.

use super::frame::{
    Frame, MarkerPair, MeshError, Outlier, Probe, bone_states, contact_points, contact_sums, muscle_states,
    probe_states,
};
use super::run_folder::RunFolder;
use super::tables::{
    ActivationTable, BoneTable, ContactTable, ConvergenceTable, EnergyTable, EstimateTable, FitTable, FrameCost,
    IdentifiabilityTables, MarkerTable, MuscleTable, ObjectiveTable, OutlierTable, OutputSeconds, ProbeTable,
    storage, write_cost,
};
use super::view::View;
use crate::error::Result;
use crate::fit::estimate::FitIteration;
use crate::fit::identifiability::{ClipKnowledge, Told};
use crate::forward::{Equilibrium, Failure, Work};
use crate::model::{Model, State};
use crate::scene::OutputSpec;
use std::path::PathBuf;
use std::time::Instant;

/// The tables and shapes of a run.
pub struct Record<'a> {
    run: &'a RunFolder,
    model: &'a Model,
    probes: &'a [Probe],
    output: OutputSpec,
    activations: ActivationTable,
    energies: EnergyTable,
    convergence: ConvergenceTable,
    muscles: Option<MuscleTable>,
    bones: Option<BoneTable>,
    contacts: Option<ContactTable>,
    fit: Option<(MarkerTable, FitTable, IdentifiabilityTables, ObjectiveTable)>,
    outliers: Option<OutlierTable>,
    probe_table: Option<ProbeTable>,
    estimates: Option<EstimateTable>,
    /// Time and activations of every frame that is done, for OpenSim.
    activity: Vec<(f64, Vec<f64>)>,
    view: View,
    frames: usize,
    seconds: OutputSeconds,
    solved: Vec<FrameCost>,
}

impl<'a> Record<'a> {
    /// Opens the tables; one that would stay empty is not made. `fitted` says that frames have markers and deviations.
    ///
    /// # Errors
    /// Where a file cannot be written.
    pub fn create(
        run: &'a RunFolder,
        model: &'a Model,
        probes: &'a [Probe],
        output: &OutputSpec,
        fitted: bool,
    ) -> Result<Record<'a>> {
        let controls = model.controls().iter().map(|c| c.name.as_str());
        Ok(Record {
            run,
            model,
            probes,
            output: *output,
            activations: ActivationTable::create(run, controls, fitted)?,
            energies: EnergyTable::create(run, model)?,
            convergence: ConvergenceTable::create(run)?,
            muscles: model.muscles().next().map(|_| MuscleTable::create(run)).transpose()?,
            bones: model.bones().first().map(|_| BoneTable::create(run)).transpose()?,
            contacts: model.contacts().next().map(|_| ContactTable::create(run)).transpose()?,
            fit: match fitted {
                true => Some((
                    MarkerTable::create(run)?,
                    FitTable::create(run)?,
                    IdentifiabilityTables::create(run)?,
                    ObjectiveTable::create(run)?,
                )),
                false => None,
            },
            outliers: None,
            probe_table: (!probes.is_empty()).then(|| ProbeTable::create(run)).transpose()?,
            estimates: None,
            activity: Vec::new(),
            view: View::new(run),
            frames: 0,
            seconds: OutputSeconds::default(),
            solved: Vec::new(),
        })
    }

    /// Writes a frame, all but its activations. `markers` and `iterations` of a fit are empty for a task that has none.
    ///
    /// # Errors
    /// Where a file cannot be written.
    pub fn frame(
        &mut self,
        frame: Frame,
        equilibrium: &Equilibrium,
        markers: &[MarkerPair<'_>],
        iterations: &[FitIteration],
    ) -> Result<()> {
        let state = &equilibrium.state;
        let contacts = contact_points(self.model, state);
        self.energies.add(frame, self.model, equilibrium)?;
        self.convergence.add(frame, &equilibrium.history)?;
        if let Some(table) = &mut self.muscles {
            table.add(frame, &muscle_states(self.model, state, &equilibrium.evaluation))?;
        }
        if let Some(table) = &mut self.bones {
            table.add(frame, &bone_states(self.model, state, &equilibrium.evaluation))?;
        }
        if let Some(table) = &mut self.contacts {
            table.add(frame, &contact_sums(self.model, &contacts))?;
        }
        if let Some((table, fit, ..)) = &mut self.fit {
            table.add(frame, markers)?;
            fit.add(frame, iterations)?;
        }
        if let Some(table) = &mut self.probe_table {
            table.add(frame, state, &probe_states(self.probes, self.model, state))?;
        }
        if self.output.view && self.frames.is_multiple_of(self.output.every) {
            self.view.add(frame, self.model, state, markers, &contacts)?;
        }
        self.frames += 1;
        Ok(())
    }

    /// Writes the activations of a frame, the last of its rows: a frame that stands in `activations.csv` is complete, whatever
    /// ended the run. `deviations` are empty for a task that has none.
    ///
    /// # Errors
    /// Where the row cannot be written.
    pub fn done(&mut self, frame: Frame, equilibrium: &Equilibrium, deviations: &[Option<f64>]) -> Result<()> {
        let controls = &equilibrium.state.controls;
        self.activity.push((frame.time_s, self.model.activations().map(|k| controls[k]).collect()));
        self.activations.add(frame, controls, deviations)
    }

    /// Writes what the markers of a frame tell; `names` are those of all controls and of all markers, `biases` one per control
    /// that was sought or none.
    ///
    /// # Errors
    /// Where a file cannot be written.
    pub fn told(
        &mut self,
        frame: Frame,
        told: &Told,
        names: (&[String], &[String]),
        biases: &[Option<f64>],
    ) -> Result<()> {
        self.fit.as_mut().map_or(Ok(()), |(_, _, tables, _)| tables.add(frame, told, names, biases))
    }

    /// Writes what the parts of the objective of a frame cost, and the markers that its loss sets aside.
    ///
    /// # Errors
    /// Where a file cannot be written.
    pub fn objectives(&mut self, frame: Frame, costs: &[(String, f64)], outliers: &[Outlier<'_>]) -> Result<()> {
        if let Some((.., table)) = &mut self.fit {
            table.add(frame, costs)?;
        }
        if outliers.is_empty() {
            return Ok(());
        }
        if self.outliers.is_none() {
            self.outliers = Some(OutlierTable::create(self.run)?);
        }
        self.outliers.as_mut().map_or(Ok(()), |table| table.add(frame, outliers))
    }

    /// Writes which combinations of controls the whole clip tells.
    ///
    /// # Errors
    /// Where a file cannot be written.
    pub fn told_of_clip(&mut self, clip: &ClipKnowledge, controls: &[String]) -> Result<()> {
        self.fit.as_mut().map_or(Ok(()), |(_, _, tables, _)| tables.clip(&clip.combinations(), controls))
    }

    /// Writes the estimated errors of a frame.
    ///
    /// # Errors
    /// Where they cannot be written.
    pub fn estimate(&mut self, frame: Frame, error: &MeshError) -> Result<()> {
        if self.estimates.is_none() {
            self.estimates = Some(EstimateTable::create(self.run)?);
        }
        self.estimates.as_mut().map_or(Ok(()), |table| table.add(frame, error))
    }

    /// Writes the last equilibrium on the way to a frame that failed, the iterate at which it failed, and how Newton's method
    /// came there; returns the paths of the two states.
    ///
    /// # Errors
    /// Where they cannot be written.
    pub fn failed(&mut self, frame: Frame, failure: &Failure) -> Result<[PathBuf; 2]> {
        self.convergence.add(frame, &failure.history)?;
        let write = |name: &str, state: &State| self.view.write_beside(name, frame, self.model, state);
        Ok([write("last_good", &failure.last_good)?, write("failed", &failure.failed)?])
    }

    /// Counts what was written since `start`.
    pub fn wrote_since(&mut self, start: Instant) {
        self.seconds.written += start.elapsed().as_secs_f64();
    }

    /// Counts for how long solving waited, s.
    pub fn waited(&mut self, seconds: f64) {
        self.seconds.waited += seconds;
    }

    /// Keeps what it took to solve a frame.
    pub fn solved(&mut self, cost: FrameCost) {
        self.solved.push(cost);
    }

    /// What writing took so far.
    pub fn seconds(&self) -> OutputSeconds {
        self.seconds
    }

    /// Writes `activations.sto`, whose head counts its rows, and the table of costs; `estimate` is the work and the seconds of estimates.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn finish(&self, work: &Work, estimate: Option<(&Work, f64)>) -> Result<()> {
        let names: Vec<&str> = self.model.activations().map(|k| self.model.controls()[k].name.as_str()).collect();
        if !names.is_empty() {
            let text = storage(names.into_iter(), self.activity.iter().cloned());
            self.run.write("tables/activations.sto", text)?;
        }
        write_cost(self.run, self.model, work, (self.seconds, &self.solved), estimate)
    }
}
