//! Everything that a run writes for each frame, in one place for all tasks.

use super::frame::{Frame, MarkerPair, Probe, contact_states, muscle_states, probe_states};
use super::run_folder::RunFolder;
use super::tables::{
    ActivationTable, ContactTable, ConvergenceTable, EnergyTable, MarkerTable, MuscleTable, ProbeTable, write_cost,
};
use super::view::View;
use crate::error::Result;
use crate::forward::{Equilibrium, Work};
use crate::model::{Model, State};
use crate::scene::OutputSpec;
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
    contacts: Option<ContactTable>,
    markers: Option<MarkerTable>,
    probe_table: Option<ProbeTable>,
    view: View,
    frames: usize,
    /// Time spent in writing, s.
    seconds: f64,
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
            contacts: model.contacts().next().map(|_| ContactTable::create(run)).transpose()?,
            markers: fitted.then(|| MarkerTable::create(run)).transpose()?,
            probe_table: (!probes.is_empty()).then(|| ProbeTable::create(run)).transpose()?,
            view: View::new(run),
            frames: 0,
            seconds: 0.0,
        })
    }

    /// Writes a frame. `deviations` and `markers` are empty for a task that has none.
    ///
    /// # Errors
    /// Where a file cannot be written.
    pub fn frame(
        &mut self,
        frame: Frame,
        equilibrium: &Equilibrium,
        deviations: &[Option<f64>],
        markers: &[MarkerPair<'_>],
    ) -> Result<()> {
        let start = Instant::now();
        let state = &equilibrium.state;
        self.activations.add(frame, &state.controls, deviations)?;
        self.energies.add(frame, self.model, equilibrium)?;
        self.convergence.add(frame, &equilibrium.history)?;
        if let Some(table) = &mut self.muscles {
            table.add(frame, &muscle_states(self.model, state, &equilibrium.evaluation))?;
        }
        if let Some(table) = &mut self.contacts {
            table.add(frame, &contact_states(self.model, state))?;
        }
        if let Some(table) = &mut self.markers {
            table.add(frame, markers)?;
        }
        if let Some(table) = &mut self.probe_table {
            table.add(frame, state, &probe_states(self.probes, self.model, state))?;
        }
        if self.output.view && self.frames.is_multiple_of(self.output.every) {
            self.view.add(frame, self.model, state, markers)?;
        }
        self.frames += 1;
        self.seconds += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Writes the shape at which a frame failed; returns the path of the file.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn failed(&self, frame: Frame, state: &State) -> Result<std::path::PathBuf> {
        self.view.write_failed(frame, self.model, state)
    }

    /// Writes the table of costs.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn finish(&self, work: &Work) -> Result<()> {
        write_cost(self.run, self.model, work, self.seconds)
    }
}
