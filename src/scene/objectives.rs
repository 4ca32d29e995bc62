//! What a fit minimises beside the distances of markers: keys and tables of `[fit]`.

use super::cursor::{FINITE, Item, Mistakes, POSITIVE, Range, Reader, Table};
use super::references::References;
use super::spec::{FitSpec, MarkerSpec};
use super::tree::Value;
use crate::error::Error;
use serde::Serialize;
use std::path::PathBuf;

/// An exponent of the effort.
const EXPONENT: Range = Range { allowed: "from 2 to 10", holds: |x| (2.0..=10.0).contains(&x) };

/// How the frames of a clip are fitted: `clip`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClipSpec {
    /// One after the other: what comes later has no say.
    Causal,
    /// All at once, after that.
    Smoother,
}

/// The objective of a fit. Activations and their deviations have no unit; controls of bones count in parts of their ranges.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectivesSpec {
    /// How a marker's residual counts: `loss`.
    pub loss: MarkerLossSpec,
    /// `effort`, if it counts.
    pub effort: Option<EffortSpec>,
    /// `sparsity = { scale = .. }`: the sum of activations over this.
    pub sparsity: Option<f64>,
    /// `similarity = { sd = .. }`: standard deviation of the difference between left and right.
    pub similarity: Option<f64>,
    /// `clip`.
    pub clip: ClipSpec,
    /// `smoothness`.
    pub smoothness: SmoothSpec,
    /// `[[fit.prior]]`.
    pub priors: Vec<PriorSpec>,
}

/// How the residual of a marker counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MarkerLossSpec {
    /// By its square.
    Quadratic,
    /// By its square up to so many standard deviations, then linearly.
    HuberSds(f64),
    /// By the logarithm of 1 + its square over that of so many standard deviations.
    CauchySds(f64),
}

/// The cost of activity: sum of w |a / sd|^exponent / exponent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffortSpec {
    /// The activation that costs as much as a marker coordinate one standard deviation off, for exponent 2.
    pub sd: f64,
    /// At least 2.
    pub exponent: f64,
    /// Whether muscles count by their volume, in relation to the mean of all.
    pub by_volume: bool,
}

/// How fast controls may change.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SmoothSpec {
    /// `sd_per_root_s`: standard deviation of the change in a second; it grows with the root of time.
    pub first: Option<f64>,
    /// `sd_per_root_s3`: standard deviation of the change of the rate (1/s) in a second.
    pub second: Option<f64>,
}

/// Values that controls are expected to have over time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PriorSpec {
    /// A table with `time_s` and a column for each control.
    pub csv: PathBuf,
    /// Standard deviation of what is expected.
    pub sd: f64,
    /// What the values of the table are multiplied by.
    pub gain: f64,
    /// How much later than in the table they are expected, s.
    pub delay_s: f64,
}

impl Default for ObjectivesSpec {
    fn default() -> ObjectivesSpec {
        ObjectivesSpec {
            loss: MarkerLossSpec::Quadratic,
            effort: None,
            sparsity: None,
            similarity: None,
            clip: ClipSpec::Causal,
            smoothness: SmoothSpec::default(),
            priors: Vec::new(),
        }
    }
}

impl ObjectivesSpec {
    /// The key of something whose weight against the markers needs their standard deviation.
    fn weighed(&self) -> Option<&'static str> {
        let keys = [
            (self.loss != MarkerLossSpec::Quadratic, "loss"),
            (self.effort.is_some(), "effort"),
            (self.sparsity.is_some(), "sparsity"),
            (self.similarity.is_some(), "similarity"),
            (self.smoothness != SmoothSpec::default(), "smoothness"),
            (!self.priors.is_empty(), "prior"),
        ];
        keys.into_iter().find(|(there, _)| *there).map(|(_, key)| key)
    }
}

/// The keys of `[fit]`; `unknowns` are the controls that it seeks, where they are known.
pub(super) fn objectives(
    table: &mut Table,
    references: &References,
    unknowns: Option<&[String]>,
) -> Option<ObjectivesSpec> {
    let loss = table.or("loss", MarkerLossSpec::Quadratic, |item| match item.node.value {
        Value::Text(_) => item.choice(&[("quadratic", MarkerLossSpec::Quadratic)], &[]),
        _ => item.table(|table| {
            let huber: Reader<MarkerLossSpec> = |item| item.number(POSITIVE).map(MarkerLossSpec::HuberSds);
            let cauchy: Reader<MarkerLossSpec> = |item| item.number(POSITIVE).map(MarkerLossSpec::CauchySds);
            table.one_of(&[("huber_sds", huber), ("cauchy_sds", cauchy)])
        }),
    });
    let effort = table.optional("effort", |item| item.table(effort));
    let sparsity = table.optional("sparsity", |item| {
        item.table(|table| table.required("scale", "scale = 0.05", |item| item.number(POSITIVE)))
    });
    let similarity = table.optional("similarity", |item| similarity(&item, unknowns));
    let smoothness = table.or("smoothness", SmoothSpec::default(), |item| {
        item.table(|table| {
            let first = table.optional("sd_per_root_s", |item| item.number(POSITIVE));
            let second = table.optional("sd_per_root_s3", |item| item.number(POSITIVE));
            match (first?, second?) {
                (None, None) => table.not_exactly_one(&["sd_per_root_s", "sd_per_root_s3"], &[]),
                (first, second) => Some(SmoothSpec { first, second }),
            }
        })
    });
    let clips = [("causal", ClipSpec::Causal), ("smoother", ClipSpec::Smoother)];
    let clip = table.or("clip", ClipSpec::Causal, |item| item.choice(&clips, &[]));
    if (clip, smoothness) == (Some(ClipSpec::Smoother), Some(SmoothSpec::default())) {
        // present, and yet nothing ties the frames
        table.require("smoothness", "smoothness = { sd_per_root_s = 0.2 }");
    }
    let priors = table.tables("prior", |table| prior(table, references, unknowns));
    Some(ObjectivesSpec {
        loss: loss?,
        effort: effort?,
        sparsity: sparsity?,
        similarity: similarity?,
        clip: clip?,
        smoothness: smoothness?,
        priors: priors?,
    })
}

fn effort(table: &mut Table) -> Option<EffortSpec> {
    let sd = table.required("sd", "sd = 0.2", |item| item.number(POSITIVE));
    let exponent = table.or("exponent", 2.0, |item| item.number(EXPONENT));
    let by_volume = table.or("by", false, |item| item.choice(&[("muscle", false), ("volume", true)], &[]));
    Some(EffortSpec { sd: sd?, exponent: exponent?, by_volume: by_volume? })
}

fn similarity(item: &Item, unknowns: Option<&[String]>) -> Option<f64> {
    let sd = item.table(|table| table.required("sd", "sd = 0.05", |item| item.number(POSITIVE)))?;
    let paired = |name: &String| {
        let right = name.strip_suffix(".L").map(|stem| format!("{stem}.R"));
        right.is_some_and(|right| unknowns.is_none_or(|all| all.contains(&right)))
    };
    match unknowns {
        Some(all) if !all.iter().any(paired) => {
            item.wrong_length("no pair of unknowns called <name>.L and <name>.R", "at least one")
        }
        _ => Some(sd),
    }
}

fn prior(table: &mut Table, references: &References, unknowns: Option<&[String]>) -> Option<PriorSpec> {
    let csv = table.required("csv", "csv = \"emg.csv\"", |item| {
        let path = references.file(&item)?;
        references.expected(&path, unknowns, &item).map(|()| path)
    });
    let sd = table.required("sd", "sd = 0.05", |item| item.number(POSITIVE));
    let gain = table.or("gain", 1.0, |item| item.number(POSITIVE));
    let delay_s = table.or("delay_s", 0.0, |item| item.number(FINITE));
    Some(PriorSpec { csv: csv?, sd: sd?, gain: gain?, delay_s: delay_s? })
}

/// Notes if the markers have no standard deviation and something must be weighed against them.
pub(super) fn need_deviations(fit: &FitSpec, markers: &[MarkerSpec], mistakes: &Mistakes) {
    let without = markers.iter().filter(|marker| marker.sd_mm.or(fit.sd_mm).is_none()).count();
    if let (Some(key), true) = (fit.objectives.weighed(), without > 0) {
        mistakes.add(Error::MissingKey {
            table: "`fit`".into(),
            keys: "`sd_mm`".into(),
            help: format!(
                "`{key}` is weighed against markers by their standard deviation, which {without} of them do not have; add, for \
                 example:\nsd_mm = 0.3"
            ),
            place: fit.place.clone(),
        });
    }
}
