//! What was asked: a problem file as plain, checked data.
//!
//! Reading is strict. An unknown key, a value of the wrong kind or out of its range, a name that refers to nothing:
//! each is a mistake with its file, line, column and remedy, and all mistakes of a file are told at once. Numerics
//! have defaults, physics has none; a table that is absent is an effect that is absent.
//!
//! [`Scene::read`] reads a file, merges `--set` overrides into it before anything is checked, and [`Scene::lock`]
//! writes the result with nothing left unsaid.

mod bones;
mod contacts;
mod cursor;
mod curves;
mod effects;
mod face;
mod fibres;
mod fibres_lock;
mod interpret;
mod lock;
mod nearest;
mod objectives;
mod outer;
mod overrides;
mod references;
mod registration;
mod spec;
mod study;
mod tree;
mod units;

pub use curves::Curves;
pub use face::{FACE, built_in_face};
pub use fibres::{
    AnglesSpec, FibreBody, FibreDataSpec, FibreProblem, FieldSpec, FixedNodeSpec, LossSpec, OutsideSpec,
    SmoothnessSpec,
};
pub use objectives::{ClipSpec, EffortSpec, MarkerLossSpec, ObjectivesSpec, PriorSpec, SmoothSpec};
pub use outer::{AngleMode, OuterSpec, OuterUnknown, OuterWhat};
pub use references::expected_ranges;
pub use spec::*;
pub use study::{Change, Design, Factor, Level, Measure, ReferenceSpec, Study, VariantSpec};
pub use units::Units;

use crate::error::{Error, Result, Warning};
use cursor::Mistakes;
use references::{References, flatten_controls, unique_names};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tree::Source;

/// Everything a problem file says, and its defaults where it says nothing.
#[derive(Debug, Clone, Serialize)]
pub struct Scene {
    /// What the problem is called: the key `name`, or else the name of its folder or file.
    pub name: String,
    /// Where relative paths of the file start; absolute.
    #[serde(skip)]
    pub folder: PathBuf,
    /// What to do.
    pub task: Task,
    /// The host body.
    pub mesh: MeshSpec,
    /// Its passive tissue.
    pub tissue: TissueSpec,
    /// Parts of the tissue with other constants.
    pub regions: Vec<RegionSpec>,
    /// The muscles in it.
    pub muscles: Vec<MuscleSpec>,
    /// Rigid bodies that move, and carry what is tied to them.
    pub bones: Vec<BoneSpec>,
    /// What holds or moves its surface.
    pub supports: Vec<SupportSpec>,
    /// Faces that stay on a surface and slide along it.
    pub slidings: Vec<ContactSpec>,
    /// Faces that stay before a surface and may lift off.
    pub contacts: Vec<ContactSpec>,
    /// The forces on it.
    pub loads: Vec<LoadSpec>,
    /// Points of it that are tied to space or to a bone.
    pub attachments: Vec<AttachmentSpec>,
    /// Activations and poses of bones, in the order of the file; what has none rests at 0.
    pub controls: Vec<ControlSpec>,
    /// Points whose motion is written down.
    pub probes: Vec<ProbeSpec>,
    /// How activations are found; present whenever `task` is [`Task::Fit`].
    pub fit: Option<FitSpec>,
    /// The markers on the surface; at least one when `task` is [`Task::Fit`].
    pub markers: Vec<MarkerSpec>,
    /// How equilibrium is found.
    pub solver: SolverSpec,
    /// What is written beside the tables.
    pub output: OutputSpec,
    /// What is allowed, and probably not meant.
    #[serde(skip)]
    pub warnings: Vec<Warning>,
}

impl Task {
    /// The word in the problem file.
    pub fn word(self) -> &'static str {
        match self {
            Task::Forward => "forward",
            Task::Fit => "fit",
        }
    }
}

impl Scene {
    /// Reads the problem file at `path`. Each of `overrides` is a `key=value` as it follows `--set`, for example
    /// `solver.step_max=0.02`, `muscle.slab.gauss=4`, `muscle[0].gauss=4`, `controls.slab=0.1`; they are merged in
    /// their order before anything is checked. Files that the problem names must exist, and tables of activations
    /// are read and checked.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, otherwise every mistake in it and in the overrides.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Scene> {
        Scene::read_changed(path, overrides, &[])
    }

    /// As [`Scene::read`], without the keys and tables that `without` names, for example `contact.table`.
    ///
    /// # Errors
    /// As [`Scene::read`]; something named that is not there.
    pub fn read_changed(path: &Path, overrides: &[String], without: &[String]) -> Result<Scene> {
        let file = File::read(path)?;
        interpret_text(&file.text, &file.name, file.folder, (overrides, without), true)
    }

    /// Reads a problem from a text, without looking at any other file. `file` is what messages call it, and relative
    /// paths start at `folder`. Overrides as for [`Scene::read`].
    ///
    /// # Errors
    /// Every mistake in the text and in the overrides.
    pub fn parse(text: &str, file: &str, folder: &Path, overrides: &[String]) -> Result<Scene> {
        interpret_text(text, file, folder, (overrides, &[]), false)
    }

    /// What the controls of the scene may be: the muscles, then the bones.
    pub fn control_ranges(&self) -> Vec<ControlRange> {
        let muscles = self.muscles.iter().map(|muscle| ControlRange::activation(&muscle.name));
        muscles.chain(self.bones.iter().flat_map(ControlRange::of_bone)).collect()
    }

    /// Whether a bone carries anything.
    fn carries(&self, bone: &BoneSpec) -> bool {
        let clamped = self.supports.iter().filter_map(|support| match &support.kind {
            SupportKind::Clamp { bone, .. } => bone.as_ref(),
            _ => None,
        });
        let met = self.slidings.iter().chain(&self.contacts).filter_map(|contact| contact.bone.as_ref());
        let tied = self.attachments.iter().filter_map(|attachment| attachment.bone.as_ref());
        clamped.chain(met).chain(tied).any(|name| *name == bone.name)
    }
}

/// What a file asks for.
pub enum Problem {
    /// To solve one problem.
    Scene(Box<Scene>),
    /// To solve a problem in many ways.
    Study(Box<Study>),
    /// To fit fibre angles to measured directions.
    Fibres(Box<FibreProblem>),
}

impl Problem {
    /// Reads a file; overrides as for [`Scene::read`].
    ///
    /// # Errors
    /// As [`Scene::read`].
    pub fn read(path: &Path, overrides: &[String]) -> Result<Problem> {
        let file = File::read(path)?;
        let mut root = Source::new(&file.name, &file.text).tree().map_err(Error::all)?;
        if !study::is_study(&root) && !fibres::is_fibres(&root) {
            return Scene::read(path, overrides).map(|scene| Problem::Scene(Box::new(scene)));
        }
        let mistakes = Mistakes::default();
        for (index, argument) in overrides.iter().enumerate() {
            if let Err(mistake) = overrides::apply(&mut root, argument, index + 1) {
                mistakes.add(mistake);
            }
        }
        let folder = absolute(file.folder)?;
        if fibres::is_fibres(&root) {
            unique_names(&root, "muscle", &mistakes);
            let references = References::new(&root, &folder, true);
            let fibres = fibres::fibres(&root, &default_name(&file.name, &folder), &references, &mistakes);
            return match (fibres, mistakes.sorted(&file.name)) {
                (Some(fibres), mistakes) if mistakes.is_empty() => Ok(Problem::Fibres(Box::new(fibres))),
                (_, mistakes) => Err(Error::all(mistakes)),
            };
        }
        let study = study::study(&root, &default_name(&file.name, &folder), &folder, &mistakes);
        match (study, mistakes.sorted(&file.name)) {
            (Some(study), mistakes) if mistakes.is_empty() => Ok(Problem::Study(Box::new(study))),
            (_, mistakes) => Err(Error::all(mistakes)),
        }
    }
}

/// A problem file as text.
struct File<'p> {
    name: String,
    text: String,
    folder: &'p Path,
}

impl File<'_> {
    fn read(path: &Path) -> Result<File<'_>> {
        let bytes = std::fs::read(path).map_err(|source| Error::Io { action: "read", path: path.into(), source })?;
        let name = path.display().to_string();
        let text = String::from_utf8(bytes).map_err(|error| not_unicode(&name, &error))?;
        Ok(File { name, text, folder: path.parent().unwrap_or(Path::new("")) })
    }
}

fn absolute(folder: &Path) -> Result<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    std::path::absolute(folder).map_err(|source| Error::Io { action: "find", path: folder.into(), source })
}

fn not_unicode(file: &str, error: &std::string::FromUtf8Error) -> Error {
    let good = error.utf8_error().valid_up_to();
    let text = String::from_utf8_lossy(error.as_bytes());
    let place = Source::new(file, &text).place(good..good + 1);
    Error::Syntax { message: "it is not UTF-8 text".into(), place }
}

fn interpret_text(
    text: &str,
    file: &str,
    folder: &Path,
    (overrides, without): (&[String], &[String]),
    on_disk: bool,
) -> Result<Scene> {
    let folder = absolute(folder)?;
    let mut root = Source::new(file, text).tree().map_err(Error::all)?;
    let mistakes = Mistakes::default();
    flatten_controls(&mut root);
    face::expand_muscles(&mut root);
    for (index, argument) in overrides.iter().enumerate() {
        if let Err(mistake) = overrides::apply(&mut root, argument, index + 1) {
            mistakes.add(mistake);
        }
        flatten_controls(&mut root);
        face::expand_muscles(&mut root);
    }
    for path in without {
        if let Err(mistake) = overrides::remove(&mut root, path) {
            mistakes.add(mistake);
        }
    }
    for kind in ["muscle", "region", "bone", "probe", "marker", "sliding", "contact"] {
        unique_names(&root, kind, &mistakes);
    }
    bones::known(&root, &mistakes);
    let references = References::new(&root, &folder, on_disk);
    let scene = interpret::scene(&root, &default_name(file, &folder), &references, &mistakes);
    let mistakes = mistakes.sorted(file);
    match scene {
        Some(mut scene) if mistakes.is_empty() => {
            scene.warnings = warnings(&scene, &file.into());
            Ok(scene)
        }
        _ => Err(Error::all(mistakes)),
    }
}

/// `problems/smile/problem.toml` is called `smile`, `bend.toml` is called `bend`.
fn default_name(file: &str, folder: &Path) -> String {
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = folder.file_name().map(|name| name.to_string_lossy().into_owned());
    match folder {
        Some(folder) if stem == "problem" || stem.is_empty() => folder,
        _ if stem.is_empty() => "problem".into(),
        _ => stem,
    }
}

/// What the file allows itself and its writer probably did not mean.
fn warnings(scene: &Scene, file: &Arc<str>) -> Vec<Warning> {
    let unused = |what: String, place: &crate::Place, help: String| Warning {
        code: "C015",
        message: format!("{what} is not used by the task \"{}\"", scene.task.word()),
        place: Some(place.clone()),
        help: Some(help),
    };
    let mut warnings = Vec::new();
    match (&scene.fit, scene.task) {
        (Some(fit), Task::Forward) => {
            let help = "write kind = \"fit\" in [task] to find activations from markers".into();
            warnings.push(unused("`fit`".into(), &fit.place, help));
        }
        (Some(fit), Task::Fit) => {
            for control in scene.controls.iter().filter(|control| fit.unknowns.contains(&control.name)) {
                let help = format!("`{0}` is among the unknowns: remove it there to hold it", control.name);
                warnings.push(unused(format!("the value of the control `{}`", control.name), &control.place, help));
            }
        }
        (None, _) => {}
    }
    let pressure = scene.loads.iter().find(|load| matches!(load.kind, LoadKind::Pressure { .. }));
    if let (Some(fit), Task::Fit, Some(load)) = (&scene.fit, scene.task, pressure)
        && fit.sensitivity == SensitivitySpec::Tangent
    {
        warnings.push(Warning {
            code: "C020",
            message: "under a pressure on a face with a free rim, sensitivities from the tangent are approximate"
                .into(),
            place: Some(load.place.clone()),
            help: Some("write sensitivity = \"finite-difference\" in [fit] if the fit is slow or stalls".into()),
        });
    }
    for bone in scene.bones.iter().filter(|bone| !scene.carries(bone)) {
        warnings.push(Warning {
            code: "C021",
            message: format!("nothing is tied to the bone `{}`: its motion changes nothing", bone.name),
            place: Some(bone.place.clone()),
            help: Some(format!("write bone = \"{}\" in a clamp, sliding, contact or attachment", bone.name)),
        });
    }
    if let (Some(marker), Task::Forward) = (scene.markers.first(), scene.task) {
        let help = "write a [[probe]] to follow a point of the body".into();
        warnings.push(unused("`marker`".into(), &marker.place, help));
    }
    let springs = scene.loads.iter().any(|load| matches!(load.kind, LoadKind::Spring { .. }));
    if scene.supports.is_empty() && scene.attachments.is_empty() && !springs {
        warnings.push(Warning {
            code: "C016",
            message: "nothing holds the body: there is no [[support]]".into(),
            place: Some(crate::Place::whole(file)),
            help: Some("add, for example:\n[[support]]\nclamp = { face = \"xi1=0\" }".into()),
        });
    }
    warnings
}
