//! `[fit.outer]`: what does not change from frame to frame and is found from several of them.

use super::Scene;
use super::cursor::{FINITE, Item, Mistakes, POSITIVE, Table};
use super::references::help_for_name;
use super::registration::MOST_FRAMES;
use super::spec::{FitSpec, LawSpec, MarkerSpec, MuscleSpec, RegionSpec};
use crate::error::{Error, Place};
use serde::Serialize;

/// Unknowns that all frames share.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OuterSpec {
    /// `[[fit.outer.unknown]]`, at least one.
    pub unknowns: Vec<OuterUnknown>,
    /// `frames`: the frames from which they are found; without it all that are fitted.
    pub frames: Option<Vec<usize>>,
    /// `held_out`: frames that have no say in them and show whether they hold elsewhere.
    pub held_out: Vec<usize>,
    /// The change of an unknown, as a part of its range, at which the search ends; the step that shows it is still taken.
    pub tolerance: f64,
    /// The most Gauss-Newton steps.
    pub max_iterations: usize,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// Something that all frames share: `[[fit.outer.unknown]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OuterUnknown {
    /// What it is.
    #[serde(flatten)]
    pub what: OuterWhat,
    /// What is known of it before: the standard deviation of the logarithm of a factor, or of an angle, degrees; without it no
    /// more than the bounds.
    pub sd: Option<f64>,
    /// The smallest and the greatest factor, or degrees.
    pub bounds: [f64; 2],
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// What may be found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OuterWhat {
    /// A factor on all constants of stress of a region, or of the tissue outside all regions.
    Stiffness(Option<String>),
    /// A factor on the greatest stress of a muscle.
    SigmaMax(String),
    /// Degrees that are added to the fibre angle A of a muscle.
    FibreAngle(String, AngleMode),
}

/// How an angle that is added is spread over a muscle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AngleMode {
    /// The same everywhere.
    Constant,
    /// From minus its value to its value along x, y or z (0, 1, 2), from one side of the box around the muscle's mesh to the
    /// other.
    Along(usize),
}

impl AngleMode {
    const ALL: [(&'static str, AngleMode); 4] = [
        ("constant", AngleMode::Constant),
        ("x", AngleMode::Along(0)),
        ("y", AngleMode::Along(1)),
        ("z", AngleMode::Along(2)),
    ];

    /// The word in problem files.
    pub fn word(self) -> &'static str {
        let [constant, x, y, z] = AngleMode::ALL.map(|(word, _)| word);
        match self {
            AngleMode::Constant => constant,
            AngleMode::Along(axis) => [x, y, z][axis.min(2)],
        }
    }

    /// Its place in `fibre_turn_deg` of a muscle.
    pub fn index(self) -> usize {
        match self {
            AngleMode::Constant => 0,
            AngleMode::Along(axis) => 1 + axis,
        }
    }
}

impl OuterWhat {
    /// As tables call it: `stiffness.tissue`, `sigma_max.top`, `fibre_angle.top.x`.
    pub fn label(&self) -> String {
        match self {
            OuterWhat::Stiffness(region) => format!("stiffness.{}", region.as_deref().unwrap_or("tissue")),
            OuterWhat::SigmaMax(muscle) => format!("sigma_max.{muscle}"),
            OuterWhat::FibreAngle(muscle, mode) => format!("fibre_angle.{muscle}.{}", mode.word()),
        }
    }

    /// Whether it is a factor, which stays positive: it is sought as its logarithm.
    pub fn is_factor(&self) -> bool {
        !matches!(self, OuterWhat::FibreAngle(..))
    }

    /// The unit of its value.
    pub fn unit(&self) -> &'static str {
        if self.is_factor() { "times" } else { "deg" }
    }

    /// The value at which it changes nothing.
    pub fn neutral(&self) -> f64 {
        if self.is_factor() { 1.0 } else { 0.0 }
    }

    /// Changes a scene by it.
    pub fn apply(&self, value: f64, scene: &mut Scene) {
        let muscle = |muscles: &mut Vec<MuscleSpec>, name: &str, change: &dyn Fn(&mut MuscleSpec)| {
            muscles.iter_mut().filter(|muscle| muscle.name == name).for_each(change);
        };
        match self {
            OuterWhat::Stiffness(None) => scene.tissue.law = stiffened(scene.tissue.law, value),
            OuterWhat::Stiffness(Some(name)) => {
                let regions = scene.regions.iter_mut().filter(|region| region.name == *name);
                regions.for_each(|region: &mut RegionSpec| region.law = stiffened(region.law, value));
            }
            OuterWhat::SigmaMax(name) => muscle(&mut scene.muscles, name, &|m| m.blemker.sigma_max_kpa *= value),
            OuterWhat::FibreAngle(name, mode) => {
                muscle(&mut scene.muscles, name, &|m| m.fibre_turn_deg[mode.index()] += value);
            }
        }
    }
}

/// A law whose stresses are `factor` times as great.
fn stiffened(law: LawSpec, factor: f64) -> LawSpec {
    match law {
        LawSpec::MooneyRivlin { c1_kpa, c2_kpa } => {
            LawSpec::MooneyRivlin { c1_kpa: factor * c1_kpa, c2_kpa: factor * c2_kpa }
        }
        LawSpec::NeoHookean { mu_kpa } => LawSpec::NeoHookean { mu_kpa: factor * mu_kpa },
        LawSpec::Guccione { c_kpa, bf, bt, bfs, fibre } => {
            LawSpec::Guccione { c_kpa: factor * c_kpa, bf, bt, bfs, fibre }
        }
    }
}

impl OuterSpec {
    /// The values at which nothing changes.
    pub fn neutral(&self) -> Vec<f64> {
        self.unknowns.iter().map(|unknown| unknown.what.neutral()).collect()
    }

    /// A scene changed by values of all unknowns.
    pub fn applied(&self, values: &[f64], scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        for (unknown, value) in self.unknowns.iter().zip(values) {
            unknown.what.apply(*value, &mut scene);
        }
        scene
    }
}

/// Bounds of a factor, and of an angle in degrees.
const FACTOR: [f64; 2] = [0.1, 10.0];
const ANGLE: [f64; 2] = [-90.0, 90.0];

/// `[fit.outer]`.
pub(super) fn outer(table: &mut Table) -> Option<OuterSpec> {
    const EXAMPLE: &str = "[[fit.outer.unknown]]\nstiffness = \"tissue\"";
    table.must_hold("unknown", EXAMPLE);
    let unknowns = table.tables("unknown", unknown);
    let list = |item: Item| {
        let frames = item.list("a list of frames", |entry| entry.whole(0, MOST_FRAMES))?;
        let mut once = frames.clone();
        once.sort_unstable();
        once.dedup();
        match (frames.len(), once.len()) {
            (0, _) => item.wrong_length("no entry", "at least one frame"),
            (all, different) if different < all => {
                item.wrong_length(&format!("{all} entries, {different} of them different"), "each frame once")
            }
            _ => Some(once),
        }
    };
    let frames = table.optional("frames", list);
    let held_out = table.optional("held_out", list);
    if let (Some(Some(frames)), Some(Some(held_out))) = (&frames, &held_out)
        && let Some(both) = held_out.iter().find(|frame| frames.contains(frame))
    {
        return table.item("held_out")?.out_of_range(&format!("frame {both}"), "a frame that is not among `frames`");
    }
    let tolerance = table.or("tolerance", 1e-4, |item| item.number(super::cursor::PART));
    let max_iterations = table.or("max_iterations", 30, |item| item.whole(1, 10_000));
    let unknowns = unknowns?;
    for (k, unknown) in unknowns.iter().enumerate() {
        if let Some(first) = unknowns[..k].iter().find(|other| other.what == unknown.what) {
            table.mistakes().add(Error::DuplicateName {
                kind: "outer unknown",
                name: unknown.what.label(),
                first_line: first.place.line,
                place: unknown.place.clone(),
            });
            return None;
        }
    }
    Some(OuterSpec {
        unknowns,
        frames: frames?,
        held_out: held_out?.unwrap_or_default(),
        tolerance: tolerance?,
        max_iterations: max_iterations?,
        place: table.place(),
    })
}

fn unknown(table: &mut Table) -> Option<OuterUnknown> {
    let stiffness = table.optional("stiffness", |item| item.name())?;
    let sigma_max = table.optional("sigma_max", |item| item.name())?;
    let fibre_angle = table.optional("fibre_angle", |item| item.name())?;
    let found = [
        ("stiffness", stiffness.is_some()),
        ("sigma_max", sigma_max.is_some()),
        ("fibre_angle", fibre_angle.is_some()),
    ];
    let what = match (stiffness, sigma_max, fibre_angle) {
        (Some(name), None, None) => OuterWhat::Stiffness((name != "tissue").then_some(name)),
        (None, Some(muscle), None) => OuterWhat::SigmaMax(muscle),
        (None, None, Some(muscle)) => {
            let mode = table.or("mode", AngleMode::Constant, |item| item.choice(&AngleMode::ALL, &[]))?;
            OuterWhat::FibreAngle(muscle, mode)
        }
        _ => {
            let choices = found.map(|(key, _)| key);
            let found: Vec<&str> = found.into_iter().filter(|(_, there)| *there).map(|(key, _)| key).collect();
            return table.not_exactly_one(&choices, &found);
        }
    };
    let (sd, bounds) = if what.is_factor() { ("sd", "bounds") } else { ("sd_deg", "bounds_deg") };
    let sd = table.optional(sd, |item| item.number(POSITIVE));
    let limits = if what.is_factor() { FACTOR } else { ANGLE };
    let allowed = if what.is_factor() { POSITIVE } else { FINITE };
    let neutral = what.neutral();
    let bounds = table.or(bounds, limits, |item| {
        let both = item.list("a list of 2 numbers", |entry| entry.number(allowed))?;
        match both[..] {
            [lower, upper] if lower < neutral && neutral < upper => Some([lower, upper]),
            [_, _] => {
                item.out_of_range(&item.node.to_toml(), &format!("[lower, upper] with {neutral:?} between them"))
            }
            _ => item.wrong_length(&format!("{} entries", both.len()), "2 (lower, upper)"),
        }
    });
    Some(OuterUnknown { what, sd: sd?, bounds: bounds?, place: table.place() })
}

/// Notes names of outer unknowns that refer to nothing, and what cannot stand beside them.
pub(super) fn check(
    fit: &FitSpec,
    scene: (&[MuscleSpec], &[RegionSpec]),
    markers: &[MarkerSpec],
    mistakes: &Mistakes,
) {
    let Some(outer) = &fit.outer else { return };
    let (muscles, regions) = scene;
    for unknown in &outer.unknowns {
        let (kind, name, known, kinds) = match &unknown.what {
            OuterWhat::Stiffness(None) => continue,
            OuterWhat::Stiffness(Some(name)) => {
                let known = std::iter::once("tissue".to_owned()).chain(regions.iter().map(|r| r.name.clone()));
                ("region", name, known.collect::<Vec<_>>(), "names of tissue")
            }
            OuterWhat::SigmaMax(name) | OuterWhat::FibreAngle(name, _) => {
                ("muscle", name, muscles.iter().map(|m| m.name.clone()).collect(), "muscles")
            }
        };
        if !known.contains(name) {
            let help = help_for_name(name, &known, kinds);
            let place = unknown.place.clone();
            mistakes.add(Error::UnknownName { kind, name: name.as_str().into(), help, place });
        }
    }
    if markers.iter().any(|marker| marker.sd_mm.or(fit.sd_mm).is_none()) {
        mistakes.add(Error::MissingKey {
            table: "`fit`".into(),
            keys: "`sd_mm`".into(),
            help:
                "how sure `outer` is comes from the standard deviation of the markers; add, for example:\nsd_mm = 0.3"
                    .into(),
            place: fit.place.clone(),
        });
    }
    if fit.objectives.smoothness != super::SmoothSpec::default() {
        mistakes.add(Error::NotInThisVersion {
            key: "fit.outer".into(),
            what: "outer unknowns of frames that smoothness ties to each other",
            instead: "find the outer unknowns without smoothness, write them into the problem, then smooth".into(),
            place: outer.place.clone(),
        });
    }
}
