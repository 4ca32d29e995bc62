//! A finished run read back from its folder: what moved, what was measured, what was found. Nothing is solved again: the
//! nodal parameters in `view/result_<frame>.exf` are exact.

mod activity;
pub mod body;
pub mod contents;
pub mod facets;
pub mod sheet;
mod tracks;

pub use activity::Activity;
pub use body::Body;
pub use contents::Contents;
pub use sheet::Sheet;
pub use tracks::{Control, Effort, Marker, Sample};

use super::frame::Frame;
use super::status::Status;
use crate::error::{Error, Result};
use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::exf::ExFile;
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use crate::model::build::host;
use crate::scene::{Problem, Scene, Task};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A run of the task `forward` or `fit`.
#[derive(Debug)]
pub struct Playback {
    /// The folder.
    pub folder: PathBuf,
    /// The problem, from its lock file.
    pub scene: Scene,
    /// Why its recording cannot be read any more; the scene is without its fit then.
    pub lost_recording: Option<String>,
    /// The text of its lock file.
    pub lock: String,
    /// How it ended.
    pub status: Status,
    /// The frames that converged.
    pub frames: Vec<Frame>,
    /// Activations and poses of bones: a value per frame each.
    pub controls: Vec<Control>,
    /// The markers of a fit: a sample per frame each.
    pub markers: Vec<Marker>,
    /// What each frame took.
    pub effort: Vec<Effort>,
    /// The skin before anything moved.
    pub skin: Body,
    /// The muscles before anything moved.
    pub muscles: Vec<Body>,
    /// The frames whose shapes were kept.
    pub shapes: Vec<Shape>,
}

/// Where everything is in a frame, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// The frame.
    pub frame: Frame,
    /// The points of the skin.
    pub skin: Vec<Vector>,
    /// The points of every muscle.
    pub muscles: Vec<Vec<Vector>>,
}

/// Nodes of the host further than this from where they were, mm, make it another host.
const SAME_MESH: f64 = 1e-6;

impl Playback {
    /// Reads the folder of a run.
    ///
    /// # Errors
    /// [`Error::NotARun`] for another folder, or the run of a study or of fibres; [`Error::DamagedRun`]; [`Error::Io`].
    pub fn read(folder: &Path) -> Result<Playback> {
        let activity = Activity::read(folder)?;
        let kept = activity.kept();
        let Activity { folder, scene, lost_recording, lock, status, frames, controls } = activity;
        let tables = folder.join("tables");
        let markers =
            Sheet::find(&tables, "markers")?.map_or(Ok(Vec::new()), |sheet| tracks::markers(&sheet, &frames))?;
        if scene.fit.is_some() && scene.task == Task::Fit && markers.is_empty() && !frames.is_empty() {
            return Err(not_a_run(&folder, "tables/markers.csv"));
        }
        let convergence = Sheet::find(&tables, "convergence")?;
        let effort = convergence.map_or(Ok(Vec::new()), |sheet| tracks::effort(&sheet, &frames))?;

        let host = host(&scene.mesh)?;
        let skin = Body::skin(&host);
        let locator = Locator::new(&host);
        let muscles: Vec<Body> =
            scene.muscles.par_iter().map(|spec| Body::muscle(spec, &locator)).collect::<Result<_>>()?;
        drop(locator);
        if let Some((_, path)) = kept.first() {
            same_mesh(path, &host)?;
        }
        let shape = |(frame, path): &(Frame, PathBuf)| -> Result<Shape> {
            let deformed = deformed(path, &host)?;
            let muscles = muscles.iter().map(|muscle| muscle.points(&deformed)).collect();
            Ok(Shape { frame: *frame, skin: skin.points(&deformed), muscles })
        };
        let shapes = kept.par_iter().map(shape).collect::<Result<_>>()?;
        Ok(Playback {
            folder,
            scene,
            lost_recording,
            lock,
            status,
            frames,
            controls,
            markers,
            effort,
            skin,
            muscles,
            shapes,
        })
    }

    /// The shapes, of which there is at least one.
    ///
    /// # Errors
    /// [`Error::NoShapes`].
    pub fn shown(&self) -> Result<&[Shape]> {
        if self.shapes.is_empty() { Err(Error::NoShapes { path: self.folder.clone() }) } else { Ok(&self.shapes) }
    }

    /// The shape whose skin is farthest from rest.
    pub fn farthest(&self) -> Option<&Shape> {
        let way = |shape: &Shape| {
            let moved = shape.skin.iter().zip(&self.skin.rest).map(|(x, r)| norm(subtract(*x, *r)));
            moved.fold(0.0, f64::max)
        };
        self.shapes.iter().max_by(|a, b| way(a).total_cmp(&way(b)))
    }

    /// The number of a frame among [`Playback::frames`].
    pub fn position(&self, frame: Frame) -> usize {
        self.frames.iter().position(|known| known.index == frame.index).unwrap_or(0)
    }

    /// The control that drives a muscle with one activation.
    pub fn activation_of(&self, muscle: &str) -> Option<&Control> {
        self.controls.iter().find(|control| control.name == muscle)
    }
}

/// The problem of a run. A recording that is not there any more is no reason not to show what was found.
fn problem(folder: &Path, path: &Path) -> Result<(Scene, Option<String>)> {
    match Problem::read(path, &[]) {
        Ok(Problem::Scene(scene)) => Ok((*scene, None)),
        Ok(Problem::Study(_) | Problem::Fibres(_)) => Err(not_a_run(folder, "the problem of a forward run or fit")),
        Err(error) => match &error {
            Error::MissingFile { key, .. } if key == "fit.markers" => {
                let forward = ["task.kind=\"forward\"".to_owned()];
                Ok((Scene::read_changed(path, &forward, &["fit".to_owned()])?, Some(error.to_string())))
            }
            _ => Err(error),
        },
    }
}

/// The status of a run.
///
/// # Errors
/// [`Error::NotARun`] where there is none.
pub fn status(folder: &Path) -> Result<Status> {
    let text = std::fs::read(folder.join("status.json")).map_err(|_| not_a_run(folder, "status.json"))?;
    serde_json::from_slice(&text)
        .map_err(|error| Error::DamagedRun { path: folder.join("status.json"), message: error.to_string().into() })
}

/// The tables of a run of any task, by their names.
///
/// # Errors
/// [`Error::NotARun`] where there is no folder of tables; [`Error::DamagedRun`]; [`Error::Io`].
pub fn sheets(run: &Path) -> Result<BTreeMap<String, Sheet>> {
    let folder = run.join("tables");
    let mut sheets = BTreeMap::new();
    for entry in std::fs::read_dir(&folder).map_err(|_| not_a_run(run, "tables"))?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if let Some(name) = name.strip_suffix(".csv")
            && let Some(sheet) = Sheet::find(&folder, name)?
        {
            sheets.insert(name.to_owned(), sheet);
        }
    }
    Ok(sheets)
}

fn not_a_run(folder: &Path, lacks: &'static str) -> Error {
    Error::NotARun { path: folder.into(), lacks }
}

const CHANGED: &str = "it is not on the mesh of the problem: a file that the problem names has changed since";

/// Compares the reference mesh in an EX file of a run with that of its problem.
fn same_mesh(path: &Path, host: &Mesh) -> Result<()> {
    let reference = ExFile::read(path)?.geometry(Some("coordinates"))?.mesh;
    let far = |element: usize| {
        let inside = MaterialPoint { element, xi: [0.25, 0.5, 0.75] };
        norm(subtract(reference.position(inside), host.position(inside))) > SAME_MESH
    };
    if reference.elements() != host.elements() || (0..host.elements()).any(far) {
        return Err(Error::DamagedRun { path: path.into(), message: CHANGED.into() });
    }
    Ok(())
}

/// The field `deformed` of an EX file of a run on `host`.
fn deformed(path: &Path, host: &Mesh) -> Result<Mesh> {
    let mesh = ExFile::read(path)?.geometry(Some("deformed"))?.mesh;
    let damaged = |message: &str| Err(Error::DamagedRun { path: path.into(), message: message.into() });
    if mesh.elements() != host.elements() {
        return damaged(CHANGED);
    }
    match mesh.parameters.iter().flatten().all(|x| x.is_finite()) {
        true => Ok(mesh),
        false => damaged("a parameter of its shape is not a finite number"),
    }
}
