//! `[[bone]]`: rigid bodies that move, and what is tied to them.

use super::cursor::{FINITE, Item, Mistakes, NOT_NEGATIVE, Reader, Table};
use super::face::{self, Anchors};
use super::interpret::direction;
use super::references::help_for_name;
use super::spec::{AttachmentSpec, BoneSpec, HingeSpec, MeshSpec, SlideSpec, TieSpec};
use super::tree::{Entry, Node, Value};
use crate::error::{Error, Place};

/// The ways in which a bone may move: the keys of its table.
const WAYS: [&str; 2] = ["hinge", "slide"];

pub(super) fn bone(table: &mut Table) -> Option<BoneSpec> {
    let name = table.required("name", "name = \"jaw\"", |item| item.name());
    let hinge = table.optional("hinge", |item| item.table(hinge));
    let slide = table.optional("slide", |item| item.table(slide));
    if matches!((&hinge, &slide), (Some(None), Some(None))) {
        let example = "hinge = { axis = [0, 1, 0], through_mm = [0, 0, 0], bounds_deg = [0, 35] }";
        return table.required("hinge", example, |_| None);
    }
    Some(BoneSpec { name: name?, hinge: hinge?, slide: slide?, place: table.place() })
}

fn hinge(table: &mut Table) -> Option<HingeSpec> {
    let axis = table.required("axis", "axis = [0, 1, 0]", direction);
    let through_mm = table.required("through_mm", "through_mm = [0, 0, 0]", |item| item.numbers(FINITE));
    let bounds_deg = table.required("bounds_deg", "bounds_deg = [0, 35]", bounds);
    Some(HingeSpec { axis: axis?, through_mm: through_mm?, bounds_deg: bounds_deg? })
}

fn slide(table: &mut Table) -> Option<SlideSpec> {
    let direction = table.required("direction", "direction = [1, 0, 0]", direction);
    let bounds_mm = table.required("bounds_mm", "bounds_mm = [0, 12]", bounds);
    Some(SlideSpec { direction: direction?, bounds_mm: bounds_mm? })
}

/// A lower and an upper bound; the reference shape, at 0, is between them.
fn bounds(item: Item) -> Option<[f64; 2]> {
    let bounds = item.list("a list of 2 numbers", |entry| entry.number(FINITE))?;
    match bounds[..] {
        [lower, upper] if lower <= 0.0 && 0.0 <= upper && lower < upper => Some([lower, upper]),
        [lower, upper] => {
            let allowed = "a lower and a greater upper bound with 0 between them, the place of the bone at rest";
            item.out_of_range(&format!("[{lower:?}, {upper:?}]"), allowed)
        }
        _ => item.wrong_length(&format!("{} entries", bounds.len()), "2, the lower and the upper bound"),
    }
}

/// The attachments of a table: one, or one for each place that a ligament or the origin of a muscle has.
pub(super) fn attachment(table: &mut Table, host: Option<&MeshSpec>) -> Option<Vec<AttachmentSpec>> {
    let named = table.one_of(&[
        ("position_mm", |item| Some((None, item))),
        ("ligament", |item| Some((Some(Anchors::Ligament), item))),
        ("origin", |item| Some((Some(Anchors::Origin), item))),
    ]);
    let positions_mm = named.and_then(|(kind, item)| match kind {
        None => item.numbers(FINITE).map(|at| vec![at]),
        Some(kind) => face::anchors(&item, host, kind),
    });
    let spring: Reader<TieSpec> = |item| {
        let stiffness_mn_per_mm = item.number(NOT_NEGATIVE)?;
        Some(TieSpec::Spring { stiffness_mn_per_mm })
    };
    let rigid: Reader<TieSpec> = |item| match item.flag()? {
        true => Some(TieSpec::Rigid),
        false => item.out_of_range("false", "true, or stiffness_mn_per_mm in its place"),
    };
    let tie = table.one_of(&[("stiffness_mn_per_mm", spring), ("rigid", rigid)]);
    let bone = carried(table);
    let (tie, bone, place) = (tie?, bone?, table.place());
    let at = |position_mm| AttachmentSpec { position_mm, tie, bone: bone.clone(), place: place.clone() };
    Some(positions_mm?.into_iter().map(at).collect())
}

/// The key `bone` of what a bone may carry; whether there is such a bone is asked once for all by [`known`].
pub(super) fn carried(table: &mut Table) -> Option<Option<String>> {
    table.optional("bone", |item| item.name())
}

/// The names of all bones, in the order of the file.
fn names(root: &Node) -> Vec<String> {
    root.tables("bone").iter().filter_map(Node::name).map(|(name, _)| name.to_owned()).collect()
}

/// The names of the controls of all bones, in the order of the file, even where the rest of a bone is mistaken.
pub(super) fn controls(root: &Node) -> Vec<String> {
    let of = |bone: &Node| -> Vec<String> {
        let Some((name, _)) = bone.name() else { return Vec::new() };
        let keys = |way: &&str| bone.entries().is_some_and(|entries| entries.iter().any(|entry| entry.key == *way));
        WAYS.into_iter().filter(keys).map(|way| format!("{name}.{way}")).collect()
    };
    root.tables("bone").iter().flat_map(of).collect()
}

/// Notes every bone that something names and that is none. A muscle may not be called like the control of a bone.
pub(super) fn known(root: &Node, mistakes: &Mistakes) {
    let bones = names(root);
    let clamps = root.tables("support").iter().filter_map(|support| entry(support, "clamp").map(|clamp| &clamp.node));
    let carried = ["sliding", "contact", "attachment"].into_iter().flat_map(|kind| root.tables(kind));
    for (name, place) in clamps.chain(carried).filter_map(named_bone) {
        if !bones.iter().any(|bone| bone == name) {
            let help = help_for_name(name, &bones, "bones");
            mistakes.add(Error::UnknownName { kind: "bone", name: name.into(), help, place: place.clone() });
        }
    }
    let controls = controls(root);
    for (name, place) in root.tables("muscle").iter().filter_map(Node::name) {
        let bone = root.tables("bone").iter().find(|bone| bone.name().is_some_and(|(own, _)| control_of(own, name)));
        if let Some(bone) = bone.filter(|_| controls.iter().any(|control| control == name)) {
            let first_line = bone.place.line;
            mistakes.add(Error::DuplicateName {
                kind: "control",
                name: name.into(),
                first_line,
                place: place.clone(),
            });
        }
    }
}

/// Whether `name` is that of a control of the bone.
fn control_of(bone: &str, name: &str) -> bool {
    name.strip_prefix(bone).and_then(|rest| rest.strip_prefix('.')).is_some_and(|way| WAYS.contains(&way))
}

fn entry<'n>(table: &'n Node, key: &str) -> Option<&'n Entry> {
    table.entries()?.iter().find(|entry| entry.key == key)
}

/// The text under `bone` in a table.
fn named_bone(table: &Node) -> Option<(&str, &Place)> {
    let bone = entry(table, "bone")?;
    match &bone.node.value {
        Value::Text(name) if !name.is_empty() => Some((name, &bone.node.place)),
        _ => None,
    }
}
