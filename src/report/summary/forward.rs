//! The page of a forward run.

use super::{MeshErrors, columns, count, optional};
use crate::model::WorstPoint;
use crate::report::frame::{BoneState, Frame, MuscleState, ProbeState};
use std::fmt;

/// What the page shows: all frames in counts, the last one in numbers. `Display` is the page; it ends with a newline.
#[derive(Debug, Clone)]
pub struct ForwardSummary<'a> {
    /// Name of the problem.
    pub name: &'a str,
    /// Frames that converged.
    pub frames_ok: usize,
    /// Frames that did not.
    pub frames_failed: usize,
    /// The last frame that converged.
    pub frame: Frame,
    /// Its probes.
    pub probes: &'a [ProbeState<'a>],
    /// Its muscles.
    pub muscles: &'a [MuscleState<'a>],
    /// Its bones.
    pub bones: &'a [BoneState<'a>],
    /// Energy of the tissue, uJ.
    pub tissue_energy: f64,
    /// Work of dead loads, uJ.
    pub external_work: f64,
    /// Torque (mN mm) and axial force (mN) of each support that rotates.
    pub reactions: &'a [(f64, f64)],
    /// Range of det F.
    pub det_f: WorstPoint,
    /// Change of the volume, as a part of it.
    pub volume_change: f64,
    /// What was estimated of the mesh's error.
    pub mesh_errors: &'a MeshErrors,
    /// Newton iterations of all frames.
    pub iterations: usize,
    /// Wall time, s.
    pub seconds: f64,
    /// The folder of the run.
    pub folder: &'a str,
}

impl fmt::Display for ForwardSummary<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ForwardSummary { name, frames_ok, frames_failed, frame, det_f, .. } = self;
        write!(out, "{name}: {} in equilibrium", count(*frames_ok, "frame"))?;
        if *frames_failed > 0 {
            write!(out, ", {} NOT CONVERGED (see status.json)", count(*frames_failed, "frame"))?;
        }
        let iterations = count(self.iterations, "Newton iteration");
        writeln!(out, "; {iterations}, {:.2} s", self.seconds)?;
        if *frames_ok == 0 {
            return Ok(());
        }
        writeln!(out, "\nframe {} at {:.3} s", frame.index, frame.time_s)?;
        let three = |v: [f64; 3]| v.map(|c| format!("{c:.4}"));
        let probes = self.probes.iter().map(|probe| {
            let ([x, y, z], [ux, uy, uz]) = (three(probe.position), three(probe.displacement));
            [probe.name.to_owned(), x, y, z, ux, uy, uz]
        });
        out.write_str(&columns(
            ["probe", "x mm", "y mm", "z mm", "ux mm", "uy mm", "uz mm"],
            &probes.collect::<Vec<_>>(),
        ))?;
        let muscles = self.muscles.iter().map(|m| {
            let stretches = [m.mean_stretch, m.min_stretch, m.max_stretch].map(|s| format!("{s:.4}"));
            let [mean, min, max] = stretches;
            [m.name.to_owned(), format!("{:.4}", m.activation), mean, min, max, format!("{:.4}", m.energy)]
        });
        let header = ["muscle", "activation", "stretch", "min", "max", "energy uJ"];
        out.write_str(&columns(header, &muscles.collect::<Vec<_>>()))?;
        let bones = self.bones.iter().map(|b| {
            let numbers = [b.hinge_deg, b.torque, b.slide_mm, b.slide_force].map(|number| optional(number, 4));
            let [hinge, torque, slide, force] = numbers;
            [b.name.to_owned(), hinge, torque, slide, force]
        });
        let header = ["bone", "hinge deg", "torque mN mm", "slide mm", "force mN"];
        out.write_str(&columns(header, &bones.collect::<Vec<_>>()))?;
        let energies = [("tissue energy", self.tissue_energy), ("work of loads", self.external_work)];
        for (what, energy) in energies {
            writeln!(out, "  {what} {energy:.4} uJ")?;
        }
        for (number, (torque, axial)) in self.reactions.iter().enumerate() {
            writeln!(out, "  rotation {number}: torque {torque:.4} mN mm, axial force {axial:.4} mN")?;
        }
        writeln!(
            out,
            "  det F {:.4} to {:.4} (smallest in element {}); the volume changes by {:+.3} %",
            det_f.min,
            det_f.max,
            det_f.element,
            100.0 * self.volume_change
        )?;
        write!(out, "{}", self.mesh_errors)?;
        writeln!(out, "\nnext: tables in {0}/tables, shapes in {0}/view/result.pvd (ParaView)", self.folder)
    }
}
