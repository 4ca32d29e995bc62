//! How a recording is brought to the model: `[fit] register`, `neutral`, `axes` and `head`.

use super::cursor::{Item, POSITIVE, Reader, Table};
use super::interpret::frames;
use super::spec::{AxisSpec, FramesSpec, HeadSpec, RegisterSpec, RegistrationSpec};
use super::tree::Value;
use super::units::Units;

/// No recording has more frames.
pub(super) const MOST_FRAMES: usize = 1_000_000_000;

/// `units`: one of them, or `None` for "estimate".
pub(super) fn units(item: Item) -> Option<Option<Units>> {
    let [mm, cm, m] = Units::ALL.map(|units| (units.name(), Some(units)));
    item.choice(&[mm, cm, m, ("estimate", None)], &[])
}

/// The registration of a fit whose recording has these `units`.
pub(super) fn registration(table: &mut Table, units: Option<Option<Units>>) -> Option<RegistrationSpec> {
    let words = [RegisterSpec::None, RegisterSpec::Rigid, RegisterSpec::Similarity].map(|r| (r.word(), r));
    let register = table.or("register", RegisterSpec::None, |item| item.choice(&words, &[]));
    let register_place = table.place_of("register");
    let neutral = table.or("neutral", None, |item| match item.node.value {
        Value::Text(_) => item.choice(&[("first", None)], &[]),
        Value::Table(_) => item.table(frames).map(Some),
        _ => item.whole(0, MOST_FRAMES).map(|frame| Some(FramesSpec::one(frame))),
    });
    let neutral_place = table.place_of("neutral");
    let offset_sd_mm = table.optional("offset_sd_mm", |item| item.number(POSITIVE));
    let [x, y, z, ..] = AxisSpec::ALL;
    let axes = table.or("axes", [x, y, z], axes);
    let head_place = table.place_of("head");
    let head = table.or("head", HeadSpec::None, |item| item.table(head));
    if units == Some(None) && register.is_some_and(|register| register != RegisterSpec::Similarity) {
        return table
            .item("units")?
            .out_of_range("\"estimate\"", "mm, cm or m where register is not \"similarity\", which finds the scale");
    }
    Some(RegistrationSpec {
        register: register?,
        neutral: neutral?,
        offset_sd_mm: offset_sd_mm?,
        axes: axes?,
        head: head?,
        head_place,
        register_place,
        neutral_place,
    })
}

/// Fewer bone markers do not say how a head is turned.
const BONE_MARKERS: usize = 3;

fn head(table: &mut Table) -> Option<HeadSpec> {
    let markers: Reader<HeadSpec> = |item| {
        let labels = item.list("a list of labels", |entry| entry.name())?;
        let mut known = labels.clone();
        known.sort();
        known.dedup();
        if known.len() < BONE_MARKERS {
            let found = format!("{} different labels", known.len());
            return item
                .wrong_length(&found, "at least 3, which do not lie on a line; with 4 one that slips can be told");
        }
        Some(HeadSpec::BoneMarkers(known))
    };
    let estimate: Reader<HeadSpec> = |item| match item.flag()? {
        true => Some(HeadSpec::Estimate),
        false => item.out_of_range("false", "true; without the table the head does not move"),
    };
    let topic: Reader<HeadSpec> = |item| item.name().map(HeadSpec::PoseTopic);
    table.one_of(&[("bone_markers", markers), ("pose_topic", topic), ("estimate", estimate)])
}

/// Each coordinate once.
fn axes(item: Item) -> Option<[AxisSpec; 3]> {
    let words = AxisSpec::ALL.map(|axis| (axis.word(), axis));
    let axes = item.triple("a list of 3 axes", |entry| entry.choice(&words, &[]))?;
    let all = (0..3).all(|index| axes.iter().any(|axis| axis.index() == index));
    if all {
        return Some(axes);
    }
    let written = axes.map(|axis| format!("\"{}\"", axis.word())).join(", ");
    item.out_of_range(&format!("[{written}]"), "each of x, y, z once, with or without a minus")
}
