//! `[task] kind = "study"`: the same problem solved in many ways. The file names a problem and what to change in it.

use super::cursor::{FINITE, Item, Mistakes, POSITIVE, Table};
use super::tree::{Node, Value};
use crate::error::{Error, Place};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A study as its file has it.
#[derive(Debug, Clone, Serialize)]
pub struct Study {
    /// What it is called: the key `name`, or else the name of its folder or file.
    pub name: String,
    /// The problem that is solved, absolute.
    pub problem: PathBuf,
    /// What is changed in all variants and the reference.
    pub base: Change,
    /// Which combinations of the factors are solved.
    pub design: Design,
    /// What may differ from variant to variant.
    pub factors: Vec<Factor>,
    /// Variants that are spelled out.
    pub variants: Vec<VariantSpec>,
    /// What errors are measured against.
    pub reference: ReferenceSpec,
    /// The error by which variants are ranked.
    pub measure: Measure,
    /// Timed solves of each variant after a first one that is not timed.
    pub repetitions: usize,
    /// Whether every variant estimates its own error too.
    pub estimate: bool,
    /// The error for which a setting is asked, in the unit of the measure.
    pub target: Option<f64>,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// Which combinations of the levels of the factors are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Design {
    /// All.
    Grid,
    /// The first level of every factor, and each other level alone.
    OneAtATime,
}

/// Something that is varied: `[[study.vary]]`.
#[derive(Debug, Clone, Serialize)]
pub struct Factor {
    /// What it is called.
    pub name: String,
    /// Its levels, at least one.
    pub levels: Vec<Level>,
}

/// One value of a factor.
#[derive(Debug, Clone, Serialize)]
pub struct Level {
    /// As tables and pictures show it.
    pub label: String,
    /// What it changes.
    pub change: Change,
}

/// What is changed in a problem.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Change {
    /// `key=value` as after `--set`.
    pub set: Vec<String>,
    /// Keys and tables that are taken away, as `contact.table`.
    pub without: Vec<String>,
    /// Threads of the solver, if they differ from the run's.
    pub threads: Option<usize>,
}

impl Change {
    /// This change and then another.
    pub fn then(&self, other: &Change) -> Change {
        Change {
            set: [&self.set[..], &other.set[..]].concat(),
            without: [&self.without[..], &other.without[..]].concat(),
            threads: other.threads.or(self.threads),
        }
    }
}

/// A variant that is spelled out: `[[study.variant]]`.
#[derive(Debug, Clone, Serialize)]
pub struct VariantSpec {
    /// Its name.
    pub name: String,
    /// What it changes.
    pub change: Change,
}

/// What errors are measured against: `[study] reference`.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceSpec {
    /// The same problem solved better.
    Variant(Change),
    /// Displacements of probes that are known, `<probe>.ux_mm` and so on, in the last frame.
    Values(Vec<(String, f64)>),
    /// Activations that are known: a table `frame,<control>,...`.
    Csv(PathBuf),
}

/// An error of a variant as one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Largest distance of a probe from its place in the reference, mm.
    Probes,
    /// Root mean square distance of the markers from their places in the reference, mm.
    Markers,
    /// Root mean square of the displacement's difference over the body, mm.
    Displacement,
    /// Root mean square of the displacement gradient's difference over the body.
    Gradient,
    /// Root mean square of the difference of det F over the body.
    DetF,
    /// Relative difference of the stored energy.
    Energy,
    /// Root mean square difference of the activations.
    Activations,
}

impl Measure {
    /// All, in the order of the tables.
    pub const ALL: [Measure; 7] = [
        Measure::Probes,
        Measure::Markers,
        Measure::Displacement,
        Measure::Gradient,
        Measure::DetF,
        Measure::Energy,
        Measure::Activations,
    ];

    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Measure::Probes => "probes",
            Measure::Markers => "markers",
            Measure::Displacement => "displacement",
            Measure::Gradient => "gradient",
            Measure::DetF => "det-f",
            Measure::Energy => "energy",
            Measure::Activations => "activations",
        }
    }

    /// The unit, empty for a number without one.
    pub fn unit(self) -> &'static str {
        match self {
            Measure::Probes | Measure::Markers | Measure::Displacement => "mm",
            Measure::Gradient | Measure::DetF | Measure::Energy | Measure::Activations => "",
        }
    }
}

/// Whether a tree is a study.
pub(super) fn is_study(root: &Node) -> bool {
    let entry = |node: &'_ Node, key: &str| -> Option<Node> {
        Some(node.entries()?.iter().find(|entry| entry.key == key)?.node.clone())
    };
    let kind = entry(root, "task").and_then(|task| entry(&task, "kind"));
    kind.is_some_and(|kind| matches!(&kind.value, Value::Text(kind) if kind == "study"))
}

/// Reads a study; paths are relative to `folder`.
pub(super) fn study(root: &Node, default_name: &str, folder: &Path, mistakes: &Mistakes) -> Option<Study> {
    Item { node: root, path: String::new(), mistakes }.table(|file| {
        let name = file.or("name", default_name.to_owned(), |item| item.name());
        file.required("task", "[task]\nkind = \"study\"", |item| {
            item.table(|task| task.required("kind", "kind = \"study\"", |item| item.text().map(drop)))
        });
        let example = "[study]\nproblem = \"../slab/problem.toml\"";
        let mut study = file.required("study", example, |item| item.table(|table| body(table, folder)))?;
        study.name = name?;
        Some(study)
    })
}

fn body(table: &mut Table, folder: &Path) -> Option<Study> {
    let problem = table.required("problem", "problem = \"../slab/problem.toml\"", |item| existing(&item, folder));
    let base = change(table);
    let designs = [("grid", Design::Grid), ("one-at-a-time", Design::OneAtATime)];
    let design = table.or("design", Design::Grid, |item| item.choice(&designs, &[]));
    let factors = table.tables("vary", factor);
    let variants = table.tables("variant", variant);
    let reference =
        table.required("reference", "reference = { set = { \"mesh.block.elements\" = [12, 4, 4] } }", |item| {
            reference(&item, folder)
        });
    let measures = Measure::ALL.map(|measure| (measure.word(), measure));
    let measure = table.or("measure", Measure::Probes, |item| item.choice(&measures, &[]));
    let repetitions = table.or("repetitions", 3, |item| item.whole(1, 1000));
    let estimate = table.or("estimate", false, |item| item.flag());
    let target = table.optional("target", |item| item.number(POSITIVE));
    let (factors, variants, base) = (factors?, variants?, base?);
    let reference = match reference? {
        ReferenceSpec::Variant(change) => ReferenceSpec::Variant(base.then(&change)),
        known => known,
    };
    if factors.is_empty() && variants.is_empty() {
        table.must_hold("vary", "[[study.vary]]\nkey = \"tissue.kappa_kpa\"\nvalues = [0, 1, 10]");
    }
    Some(Study {
        name: String::new(),
        problem: problem?,
        base,
        design: design?,
        factors,
        variants,
        reference,
        measure: measure?,
        repetitions: repetitions?,
        estimate: estimate?,
        target: target?,
        place: table.place(),
    })
}

/// A file that is there, absolute.
fn existing(item: &Item, folder: &Path) -> Option<PathBuf> {
    let path = folder.join(item.text()?);
    if path.is_file() {
        return Some(path);
    }
    let (key, place) = (item.path.clone(), item.node.place.clone());
    item.mistakes.add(Error::MissingFile { key, path, place });
    None
}

fn factor(table: &mut Table) -> Option<Factor> {
    let name = table.optional("name", |item| item.name());
    let key = table.optional("key", |item| item.name())?;
    let values = table.optional("values", |item| {
        let values = item.list("a list of values", |value| Some(value.node.to_toml()))?;
        if values.is_empty() { item.wrong_length("no entry", "at least one value") } else { Some(values) }
    })?;
    let without = table.optional("without", |item| item.name())?;
    let labels = table.optional("labels", |item| {
        let labels = item.list("a list of labels", |label| label.name())?;
        let (expected, what) = match &values {
            Some(values) => (values.len(), "one for each value"),
            None => (2, "for the effect on and off"),
        };
        match labels.len() {
            found if found == expected => Some(labels),
            found => item.wrong_length(&format!("{found} labels"), &format!("{expected}, {what}")),
        }
    })?;
    let level = |label: String, change: Change| Level { label, change };
    let (default, levels) = match (key, values, without) {
        (Some(key), Some(values), None) => {
            let labels = labels.unwrap_or_else(|| values.clone());
            let levels =
                labels.into_iter().zip(&values).map(|(label, value)| level(label, setting(&key, value))).collect();
            (key.rsplit('.').next().unwrap_or_default().to_owned(), levels)
        }
        (None, None, Some(gone)) => {
            let off = Change { without: vec![gone.clone()], ..Change::default() };
            let default = gone.rsplit('.').next().unwrap_or_default().to_owned();
            let labels = labels.unwrap_or_else(|| vec!["on".into(), "off".into()]);
            (
                default,
                labels
                    .into_iter()
                    .zip([Change::default(), off])
                    .map(|(label, change)| level(label, change))
                    .collect(),
            )
        }
        (Some(_), None, None) => {
            table.must_hold("values", "values = [0, 1, 10]");
            return None;
        }
        (key, values, without) => {
            let found = [("key", key.is_some()), ("values", values.is_some()), ("without", without.is_some())];
            let found: Vec<&str> = found.into_iter().filter(|(_, there)| *there).map(|(word, _)| word).collect();
            return table.not_exactly_one(&["key with values", "without"], &found);
        }
    };
    Some(Factor { name: name?.unwrap_or(default), levels })
}

/// `threads` is a key of the run, everything else one of the problem.
fn setting(key: &str, value: &str) -> Change {
    match value.parse() {
        Ok(threads) if key == "threads" => Change { threads: Some(threads), ..Change::default() },
        _ => Change { set: vec![format!("{key}={value}")], ..Change::default() },
    }
}

fn variant(table: &mut Table) -> Option<VariantSpec> {
    let name = table.required("name", "name = \"coarse\"", |item| item.name());
    let change = change(table);
    Some(VariantSpec { name: name?, change: change? })
}

/// `set` and `without`, both optional.
fn change(table: &mut Table) -> Option<Change> {
    let set = table.or("set", Vec::new(), |item| {
        let entries = item.node.entries();
        let settings = entries.map(|all| all.iter().map(|e| setting(&e.key, &e.node.to_toml())).collect());
        settings.or_else(|| item.wrong_type("a table: set = { \"tissue.kappa_kpa\" = 0 }"))
    });
    let without = table.or("without", Vec::new(), |item| item.list("a list of keys", |entry| entry.name()));
    let set = set?.iter().fold(Change::default(), |sum, change| sum.then(change));
    Some(set.then(&Change { without: without?, ..Change::default() }))
}

fn reference(item: &Item, folder: &Path) -> Option<ReferenceSpec> {
    item.node.entries().or_else(|| item.wrong_type("a table: reference = { set = { .. } }"))?;
    let mut found: Option<ReferenceSpec> = None;
    let complete = Item { node: item.node, path: item.path.clone(), mistakes: item.mistakes }.table(|table| {
        let values = table.optional("values", |item| {
            let entries = item.node.entries().or_else(|| item.wrong_type("a table of numbers"))?;
            let number = |entry: &super::tree::Entry| {
                let value =
                    Item { node: &entry.node, path: format!("{}.{}", item.path, entry.key), mistakes: item.mistakes };
                let known = entry.key.rsplit_once('.').is_some_and(|(_, u)| ["ux_mm", "uy_mm", "uz_mm"].contains(&u));
                let number = value.number(FINITE);
                if known {
                    Some((entry.key.clone(), number?))
                } else {
                    value.out_of_range(&entry.key, "<probe>.ux_mm, <probe>.uy_mm or <probe>.uz_mm")
                }
            };
            let all: Vec<Option<(String, f64)>> = entries.iter().map(number).collect();
            all.into_iter().collect::<Option<Vec<_>>>()
        })?;
        let csv = table.optional("csv", |item| existing(&item, folder))?;
        let has_change = table.has("set") || table.has("without");
        let change = change(table);
        found = match (values, csv, has_change) {
            (Some(values), None, false) => Some(ReferenceSpec::Values(values)),
            (None, Some(csv), false) => Some(ReferenceSpec::Csv(csv)),
            (None, None, true) => change.map(ReferenceSpec::Variant),
            (values, csv, _) => {
                let found = [("values", values.is_some()), ("csv", csv.is_some()), ("set", has_change)];
                let found: Vec<&str> = found.into_iter().filter(|(_, there)| *there).map(|(word, _)| word).collect();
                return table.not_exactly_one(&["set", "values", "csv"], &found);
            }
        };
        Some(())
    });
    complete?;
    found
}
