//! `energies.csv`: energies, work, the range of det F, and what turned faces take, a row per frame.

use super::{Cell, Rows, Table, of_frame};
use crate::error::Result;
use crate::forward::Equilibrium;
use crate::model::Model;
use crate::model::supports::Support;
use crate::report::frame::Frame;
use crate::report::run_folder::RunFolder;

/// The table of the energies.
#[derive(Debug)]
pub struct EnergyTable {
    table: Table,
    /// The volume before anything moved, mm3.
    volume: f64,
}

impl EnergyTable {
    /// A new table: `frame,time_s,tissue_uj,<muscle>_uj,...,external_work_uj,det_f_min,det_f_max,volume_change,negative_modes` (the change
    /// as a part of the volume at rest; the modes of the
    /// tangent beyond one per pressure: more than none is a saddle), then for every support that rotates, counted among
    /// these from 0 in the order of the scene, `torque_<n>_mn_mm` (about its axis) and `axial_force_<n>_mn` (along it) that
    /// it exerts on the body.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder, model: &Model) -> Result<EnergyTable> {
        let mut columns: Vec<String> = ["frame", "time_s", "tissue_uj"].map(String::from).into();
        columns.extend(model.muscles().map(|(term, _)| format!("{}_uj", model.terms()[term].name())));
        columns.extend(
            ["external_work_uj", "det_f_min", "det_f_max", "volume_change", "negative_modes"].map(String::from),
        );
        let rotations = model.supports().iter().filter(|support| matches!(support, Support::Rotate { .. }));
        for (n, _) in rotations.enumerate() {
            columns.extend([format!("torque_{n}_mn_mm"), format!("axial_force_{n}_mn")]);
        }
        let table = Table::create(&run.tables(), "energies", columns.iter().map(String::as_str))?;
        Ok(EnergyTable { table, volume: model.mesh().volume(&model.mesh().parameters) })
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, model: &Model, equilibrium: &Equilibrium) -> Result<()> {
        let evaluation = &equilibrium.evaluation;
        let mut cells: Vec<Cell<'_>> = of_frame(frame).into();
        // the tissue is the first term
        cells.push(evaluation.energies[0].into());
        cells.extend(model.muscles().map(|(term, _)| Cell::Number(evaluation.energies[term])));
        cells.push(model.external_work(&equilibrium.state).into());
        cells.extend([evaluation.det_f.min, evaluation.det_f.max].map(Cell::Number));
        let x = model.current(&equilibrium.state);
        cells.push(Cell::Number(model.mesh().volume(&x) / self.volume - 1.0));
        cells.push(equilibrium.negative_modes.map_or(Cell::Empty, Cell::Count));
        let reactions = model.supports().rotation_reactions(model.mesh(), &evaluation.force, &x);
        cells.extend(reactions.iter().flat_map(|(torque, axial)| [*torque, *axial]).map(Cell::Number));
        let mut rows = Rows::default();
        rows.add(cells);
        self.table.append(rows)
    }
}
