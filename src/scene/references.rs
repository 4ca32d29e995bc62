//! What a problem refers to: muscles and bones by the names of their controls, files by their paths.

use super::Curves;
use super::bones;
use super::cursor::{ACTIVATION, FINITE, Item, Mistakes};
use super::curves::what;
use super::nearest::nearest;
use super::spec::{
    ActivationSpec, BoneSpec, ControlKind, ControlRange, ControlSpec, ControlValue, GeometrySpec, MuscleSpec,
};
use super::tree::{Entry, Node, Value};
use crate::error::{Error, Place};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The things that names and paths in a problem may refer to.
pub(super) struct References {
    folder: PathBuf,
    muscles: Vec<String>,
    /// The controls of bones.
    bones: Vec<String>,
    /// Whether files must exist.
    on_disk: bool,
    /// The columns of the tables of curves read so far; `None` for one with mistakes.
    columns: RefCell<BTreeMap<PathBuf, Option<Vec<String>>>>,
}

impl References {
    /// The muscles and bones are those of the tree, even where the rest of their table is mistaken.
    pub fn new(root: &Node, folder: &Path, on_disk: bool) -> References {
        let mut muscles: Vec<String> = Vec::new();
        for (name, _) in root.tables("muscle").iter().filter_map(Node::name) {
            if !muscles.iter().any(|known| known == name) {
                muscles.push(name.into());
            }
        }
        let bones = bones::controls(root);
        References { folder: folder.into(), muscles, bones, on_disk, columns: RefCell::default() }
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether files that the problem names are read.
    pub fn reads_files(&self) -> bool {
        self.on_disk
    }

    /// The names of all muscles, in the order of the file.
    pub fn muscles(&self) -> Vec<String> {
        self.muscles.clone()
    }

    /// Whether there are bones that can be controlled.
    pub fn has_bones(&self) -> bool {
        !self.bones.is_empty()
    }

    /// What all controls may be. The specs of the bones are absent where one of them is mistaken; then their controls may be
    /// anything.
    fn ranges(&self, specs: Option<&[BoneSpec]>) -> Vec<ControlRange> {
        let anything = |name: &String| {
            let (name, kind) = (name.clone(), ControlKind::Slide);
            ControlRange { name, kind, lower: f64::NEG_INFINITY, upper: f64::INFINITY }
        };
        let bones = match specs {
            Some(specs) => specs.iter().flat_map(ControlRange::of_bone).collect(),
            None => self.bones.iter().map(anything).collect::<Vec<_>>(),
        };
        self.muscles.iter().map(|name| ControlRange::activation(name)).chain(bones).collect()
    }

    /// Notes if `name` is that of no control.
    fn control(&self, name: &str, place: &Place, mistakes: &Mistakes) -> Option<()> {
        let all: Vec<String> = self.muscles.iter().chain(&self.bones).cloned().collect();
        if all.iter().any(|known| known == name) {
            return Some(());
        }
        let (kind, kinds) = what(&self.ranges(None));
        let help = help_for_name(name, &all, kinds);
        mistakes.add(Error::UnknownName { kind, name: name.into(), help, place: place.clone() });
        None
    }

    /// `[fit] unknowns`: names of controls, each once.
    pub fn unknowns(&self, item: &Item) -> Option<Vec<String>> {
        let mut seen: Vec<(String, u32)> = Vec::new();
        let names = item.list("a list of names of muscles", |entry| {
            let (name, place) = (entry.name()?, &entry.node.place);
            self.control(&name, place, entry.mistakes)?;
            first_use("unknown", &name, place, &mut seen, entry.mistakes)?;
            Some(name)
        })?;
        if names.is_empty() {
            return item.wrong_length("no entry", "the name of at least one muscle");
        }
        Some(names)
    }

    /// `[controls]`: a value for each named muscle, or a list with one for each node of a field; angles and ways of bones.
    /// The specs of muscles and bones tell which is which; they are absent where one of them is mistaken.
    pub fn controls(
        &self,
        item: &Item,
        muscles: Option<&[MuscleSpec]>,
        bones: Option<&[BoneSpec]>,
    ) -> Option<Vec<ControlSpec>> {
        let Some(entries) = item.node.entries() else {
            // The type is wrong, which `table` notes.
            return item.table(|_| None);
        };
        let ranges = self.ranges(bones);
        let mut seen = Vec::new();
        let read = |Entry { key: name, place, node }: &Entry| {
            let control = Item { node, path: format!("controls.{name}"), mistakes: item.mistakes };
            let known = self.control(name, place, item.mistakes);
            let of_bone = ranges.iter().find(|range| range.name == *name && range.kind != ControlKind::Activation);
            let first = first_use("control", name, place, &mut seen, item.mistakes);
            let value = match node.value {
                Value::Table(_) => control.table(|table| {
                    let path = table.required("csv", "csv = \"curves.csv\"", |item| self.file(&item))?;
                    known.and_then(|()| self.column(&path, name, &ranges, &control)).map(|()| ControlValue::Csv(path))
                }),
                Value::List(_) if of_bone.is_none() => {
                    nodes(&control, muscles.and_then(|all| all.iter().find(|muscle| muscle.name == *name)))
                }
                _ => match of_bone {
                    Some(range) => pose(&control, range),
                    None if known.is_some() => control.number(ACTIVATION),
                    // of what is not known nothing is known
                    None => control.number(FINITE),
                }
                .map(ControlValue::Constant),
            };
            known?;
            first?;
            Some(ControlSpec { name: name.clone(), value: value?, place: place.clone() })
        };
        let controls: Vec<Option<ControlSpec>> = entries.iter().map(read).collect();
        controls.into_iter().collect()
    }

    /// A path, from the folder of the problem.
    pub fn file(&self, item: &Item) -> Option<PathBuf> {
        let path = self.folder.join(item.name()?);
        if path.to_str().is_none() {
            return item.out_of_range("a path", "valid Unicode, its folder too");
        }
        if self.on_disk && !path.is_file() {
            let (key, place) = (item.path.clone(), item.node.place.clone());
            item.mistakes.add(Error::MissingFile { key, path, place });
            return None;
        }
        Some(path)
    }

    /// Reads a table of what controls are expected to be, which may be in any unit, and notes if it has a column for none of
    /// the `unknowns`.
    pub fn expected(&self, path: &Path, unknowns: Option<&[String]>, item: &Item) -> Option<()> {
        let Some(unknowns) = unknowns.filter(|_| self.on_disk) else { return Some(()) };
        let curves = match Curves::read(path, &expected_ranges(self.ranges(None))) {
            Ok(curves) => curves,
            Err(error) => {
                error.into_mistakes().into_iter().for_each(|mistake| item.mistakes.add(mistake));
                return None;
            }
        };
        if curves.names.iter().any(|name| unknowns.contains(name)) {
            return Some(());
        }
        let count = format!("no column for any of {}", unknowns.join(", "));
        item.wrong_length(&count, "at least one")
    }

    /// Reads a table of curves once, and notes if it has no column for this control.
    fn column(&self, path: &Path, name: &str, ranges: &[ControlRange], control: &Item) -> Option<()> {
        if !self.on_disk {
            return Some(());
        }
        let mut read = self.columns.borrow_mut();
        let columns = read.entry(path.into()).or_insert_with(|| match Curves::read(path, ranges) {
            Ok(curves) => Some(curves.names),
            Err(Error::Mistakes(mistakes)) => {
                mistakes.into_iter().for_each(|mistake| control.mistakes.add(mistake));
                None
            }
            Err(mistake) => {
                control.mistakes.add(mistake);
                None
            }
        });
        let columns = columns.as_ref()?;
        if columns.iter().any(|column| column == name) {
            return Some(());
        }
        let help = help_for_name(name, columns, "columns of the file");
        let place = control.node.place.clone();
        control.mistakes.add(Error::UnknownName { kind: "column", name: name.into(), help, place });
        None
    }
}

/// Controls that may have any value: of a table that is still multiplied by a gain.
pub fn expected_ranges(ranges: Vec<ControlRange>) -> Vec<ControlRange> {
    let any = |range| ControlRange { lower: f64::NEG_INFINITY, upper: f64::INFINITY, ..range };
    ranges.into_iter().map(any).collect()
}

/// The angle or way of a bone, within its bounds.
fn pose(control: &Item, range: &ControlRange) -> Option<f64> {
    let value = control.number(FINITE)?;
    if range.holds(value) {
        return Some(value);
    }
    let unit = range.kind.unit();
    control.out_of_range(&format!("{value:?} {unit}"), &range.allowed())
}

/// The activations of a field at its nodes.
fn nodes(control: &Item, muscle: Option<&MuscleSpec>) -> Option<ControlValue> {
    if muscle.is_some_and(|muscle| muscle.activation == ActivationSpec::Uniform) {
        // a list where a number belongs: the type is wrong, which `number` notes
        return control.number(ACTIVATION).map(ControlValue::Constant);
    }
    let values = control.list("a list of numbers", |item| item.number(ACTIVATION))?;
    // the nodes of a mesh in a file are counted when the model is built
    let count = muscle.and_then(|muscle| match &muscle.geometry {
        GeometrySpec::Block(block) => Some(block.nodes()),
        _ => None,
    });
    match count {
        Some(count) if count != values.len() => control.wrong_length(
            &format!("activations for {} nodes", values.len()),
            &format!("{count}, one for each node of the block, x fastest"),
        ),
        _ => Some(ControlValue::Nodes(values)),
    }
}

/// Makes `[controls]` a flat table. TOML reads the dot of `risorius.L = 0.1` as a table in a table; here it belongs
/// to the name. A table that holds `csv` is a value, and so is an empty one.
pub(super) fn flatten_controls(root: &mut Node) {
    let Value::Table(tables) = &mut root.value else { return };
    let controls = tables.iter_mut().find(|table| table.key == "controls");
    if let Some(Entry { node: Node { value: Value::Table(entries), .. }, .. }) = controls {
        *entries = entries.drain(..).flat_map(flat).collect();
    }
}

fn flat(outer: Entry) -> Vec<Entry> {
    match outer.node.value {
        Value::Table(inner) if !inner.is_empty() && inner.iter().all(|entry| entry.key != "csv") => inner
            .into_iter()
            .flat_map(flat)
            .map(|entry| Entry {
                key: format!("{}.{}", outer.key, entry.key),
                place: outer.place.until(&entry.place),
                node: entry.node,
            })
            .collect(),
        _ => vec![outer],
    }
}

/// Notes every name that two tables of the list `kind` share.
pub(super) fn unique_names(root: &Node, kind: &'static str, mistakes: &Mistakes) {
    let mut seen = Vec::new();
    for (name, place) in root.tables(kind).iter().filter_map(Node::name) {
        first_use(kind, name, place, &mut seen, mistakes);
    }
}

/// Notes if `name` was used before; `seen` holds the names so far and their lines.
pub(super) fn first_use(
    kind: &'static str,
    name: &str,
    place: &Place,
    seen: &mut Vec<(String, u32)>,
    mistakes: &Mistakes,
) -> Option<()> {
    if let Some((_, first_line)) = seen.iter().find(|(used, _)| used == name) {
        let (first_line, place) = (*first_line, place.clone());
        mistakes.add(Error::DuplicateName { kind, name: name.into(), first_line, place });
        return None;
    }
    seen.push((name.into(), place.line));
    Some(())
}

/// The nearest of `known`, or the first of them.
pub(super) fn help_for_name(name: &str, known: &[String], what: &str) -> String {
    const SHOWN: usize = 12;
    match nearest(name, known.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => format!("there are no {what}"),
        None => {
            let more = if known.len() > SHOWN { ", ..." } else { "" };
            format!("{what}: {}{more}", known.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", "))
        }
    }
}
