//! How a recording is brought to the model: `[fit] register`, `neutral` and `axes`.

use super::cursor::{Item, Table};
use super::spec::{AxisSpec, RegisterSpec, RegistrationSpec};
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
        _ => item.whole(0, MOST_FRAMES).map(Some),
    });
    let neutral_place = table.place_of("neutral");
    let [x, y, z, ..] = AxisSpec::ALL;
    let axes = table.or("axes", [x, y, z], axes);
    if units == Some(None) && register.is_some_and(|register| register != RegisterSpec::Similarity) {
        return table
            .item("units")?
            .out_of_range("\"estimate\"", "mm, cm or m where register is not \"similarity\", which finds the scale");
    }
    Some(RegistrationSpec { register: register?, neutral: neutral?, axes: axes?, register_place, neutral_place })
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
