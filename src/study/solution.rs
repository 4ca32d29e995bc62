//! One solve of a problem in memory: what it found, in which time, with what work. Nothing is written.

use super::norms::Seen;
use crate::error::{Error, Result};
use crate::fit::placement::Marker;
use crate::fit::recording::{chosen_frames, poses, read};
use crate::fit::sequence::settings;
use crate::fit::{Estimate, Fit, placement, registration};
use crate::forward::drives::drives;
use crate::forward::{Equilibrium, Solver, Work};
use crate::markers::Recording;
use crate::mesh::MaterialPoint;
use crate::model::build::{Built, build};
use crate::scene::{Change, ClipSpec, Scene, Task};
use std::path::Path;
use std::time::Instant;

/// A problem with its model and its recording.
pub struct Prepared {
    /// The problem.
    pub scene: Scene,
    /// Its model.
    pub built: Built,
    /// The time that building the model took, s.
    pub build_seconds: f64,
    /// The recording and the frames of it that are fitted, for the task fit.
    clip: Option<(Recording, Vec<usize>)>,
}

/// What a solve found.
pub struct Solution {
    /// The equilibrium of every frame.
    pub frames: Vec<Equilibrium>,
    /// Time of every frame, s.
    pub times_s: Vec<f64>,
    /// The markers, for the task fit.
    pub markers: Vec<Marker>,
    /// What was fitted in every frame, for the task fit.
    pub fits: Vec<Estimate>,
    /// Wall time of the solve, s; reading and building are not in it.
    pub seconds: f64,
    /// Work done.
    pub work: Work,
}

impl Solution {
    /// Places of the markers in the host.
    pub fn points(&self) -> Vec<MaterialPoint> {
        self.markers.iter().map(|marker| marker.point).collect()
    }

    /// As norms see it; `markers` are its [`Solution::points`].
    pub(super) fn seen<'a>(&'a self, prepared: &'a Prepared, markers: &'a [MaterialPoint]) -> Seen<'a> {
        Seen {
            model: &prepared.built.model,
            probes: &prepared.built.probes,
            markers,
            states: self.frames.iter().map(|frame| &frame.state).collect(),
            last: self.frames.last().map(|frame| &frame.evaluation),
        }
    }
}

impl Prepared {
    /// Reads the problem at `path` with a change, builds its model and reads its recording.
    ///
    /// # Errors
    /// Every mistake in the changed problem.
    pub fn read(path: &Path, change: &Change) -> Result<Prepared> {
        let scene = Scene::read_changed(path, &change.set, &change.without)?;
        if let Some(outer) = scene.fit.as_ref().and_then(|fit| fit.outer.as_ref()).filter(|_| scene.task == Task::Fit)
        {
            return Err(Error::NotInThisVersion {
                key: "fit.outer".into(),
                what: "a study of what all frames share",
                instead: "run the problem, and write what was found into it".into(),
                place: outer.place.clone(),
            });
        }
        let start = Instant::now();
        let built = build(&scene)?;
        let build_seconds = start.elapsed().as_secs_f64();
        let clip = match (scene.task, &scene.fit) {
            (Task::Fit, Some(fit)) => {
                let mut recording = read(fit)?;
                let frames = chosen_frames(fit, &recording)?;
                let mesh = built.model.mesh();
                let markers = placement::place(&scene, fit, mesh, &recording)?;
                let poses = poses(fit, &recording, None)?;
                registration::register(&scene, fit, mesh, &markers, &mut recording, poses.as_ref())?;
                Some((recording, frames))
            }
            _ => None,
        };
        Ok(Prepared { scene, built, build_seconds, clip })
    }

    /// Solves every frame.
    ///
    /// # Errors
    /// The first frame that fails.
    pub fn solve(&self) -> Result<Solution> {
        match (&self.clip, &self.scene.fit) {
            (Some((recording, frames)), Some(spec)) => {
                let markers = placement::place(&self.scene, spec, self.built.model.mesh(), recording)?;
                let start = Instant::now();
                let mut fit = Fit::new(&self.built.model, &self.scene, spec, recording)?;
                let mut found: Vec<_> =
                    frames.iter().map(|frame| fit.frame(recording, *frame)).collect::<Result<_>>()?;
                if spec.objectives.clip == ClipSpec::Smoother {
                    let passed: Vec<_> = found.drain(..).map(Some).collect();
                    let smoothed = fit.smooth(recording, frames, &passed, &|| false)?;
                    found = smoothed.into_iter().flat_map(|clip| clip.frames).collect::<Result<_>>()?;
                }
                Ok(Solution {
                    seconds: start.elapsed().as_secs_f64(),
                    times_s: found.iter().map(|estimate| estimate.time_s).collect(),
                    frames: found.iter().map(|estimate| estimate.equilibrium.clone()).collect(),
                    fits: found,
                    markers,
                    work: fit.work(),
                })
            }
            _ => self.forward(),
        }
    }

    fn forward(&self) -> Result<Solution> {
        let model = &self.built.model;
        let drives = drives(&self.scene, model)?;
        let start = Instant::now();
        let mut solver = Solver::new(model, settings(&self.scene))?;
        let mut state = model.rest();
        let mut frames = Vec::with_capacity(drives.len());
        for (_, drive) in &drives {
            let found = solver.equilibrium(&state, drive)?;
            state.clone_from(&found.state);
            frames.push(found);
        }
        let seconds = start.elapsed().as_secs_f64();
        let times_s = drives.iter().map(|(time_s, _)| *time_s).collect();
        Ok(Solution { frames, times_s, markers: Vec::new(), fits: Vec::new(), seconds, work: solver.work() })
    }
}
