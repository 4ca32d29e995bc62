//! Tables of a fit of fibre angles. Angles in degrees.

use crate::fibres::{FibreFit, Spread};
use crate::report::tables::{Cell, Rows};

/// Width of a bin of `fibre_errors`, degrees.
const BIN: usize = 2;

/// Every table with its name.
pub(super) fn all(fit: &FibreFit) -> [(&'static str, String); 5] {
    [
        ("fibre_angles", angles(fit)),
        ("fibre_errors", errors(fit)),
        ("fibre_elements", elements(fit)),
        ("fibre_smoothness", smoothness(fit)),
        ("fibre_fit", numbers(fit)),
    ]
}

fn table(header: &'static str) -> Rows {
    let mut rows = Rows::default();
    rows.add(header.split(',').map(Cell::Text));
    rows
}

fn degrees(radians: f64) -> Cell<'static> {
    Cell::Number(radians.to_degrees())
}

fn yes(flag: bool) -> Cell<'static> {
    Cell::Count(usize::from(flag))
}

/// A row per node; an angle that was not sought is 0 and has no standard deviation.
fn angles(fit: &FibreFit) -> String {
    let mut rows = table("node,x_mm,y_mm,z_mm,a_deg,b_deg,g_deg,a_sd_deg,b_sd_deg,g_sd_deg,determined,fixed");
    for node in &fit.nodes {
        let name = node.name.to_string();
        let sd = node.sd.map(|sd| sd.map_or(Cell::Empty, degrees));
        let numbers = node.position.map(Cell::Number).into_iter().chain(node.angles.map(degrees)).chain(sd);
        rows.add([Cell::Text(&name)].into_iter().chain(numbers).chain([yes(node.determined), yes(node.fixed)]));
    }
    rows.text
}

/// How many axes have an error from .. to ..; all from 0 to 90 degrees.
fn errors(fit: &FibreFit) -> String {
    let mut counts = [0_usize; 90 / BIN];
    for error in &fit.errors {
        counts[((error.to_degrees() / BIN as f64) as usize).min(counts.len() - 1)] += 1;
    }
    let mut rows = table("from_deg,to_deg,axes");
    for (bin, count) in counts.iter().enumerate() {
        rows.add([(bin * BIN).into(), ((bin + 1) * BIN).into(), (*count).into()]);
    }
    rows.text
}

fn elements(fit: &FibreFit) -> String {
    let mut rows = table("element,axes,rms_deg,median_deg,p95_deg,max_deg");
    for element in &fit.elements {
        let Spread { count, rms, median, p95, most } = element.spread;
        let numbers = [rms, median, p95, most].map(degrees);
        rows.add([element.element.into(), count.into()].into_iter().chain(numbers));
    }
    rows.text
}

fn smoothness(fit: &FibreFit) -> String {
    let mut rows = table("smoothness,gcv_deg2,freedom");
    for tried in &fit.tried {
        let score = tried.score.is_finite().then(|| tried.score * 1_f64.to_degrees().powi(2));
        rows.add([tried.smoothness.into(), score.into(), tried.freedom.into()]);
    }
    rows.text
}

/// Single numbers by name.
fn numbers(fit: &FibreFit) -> String {
    let mut rows = table("quantity,value");
    let mut add = |name: &str, value: f64| rows.add([Cell::Text(name), value.into()]);
    let spreads = [("", Some(fit.spread)), ("held_out_", fit.held_out), ("sheet_", fit.sheets)];
    for (prefix, spread) in spreads.into_iter().filter_map(|(prefix, spread)| Some((prefix, spread?))) {
        add(&format!("{prefix}axes"), spread.count as f64);
        add(&format!("{prefix}rms_deg"), spread.rms.to_degrees());
        add(&format!("{prefix}median_deg"), spread.median.to_degrees());
        add(&format!("{prefix}p95_deg"), spread.p95.to_degrees());
    }
    add("outside", fit.outside.count as f64);
    add("projected", fit.outside.projected as f64);
    add("smoothness", fit.smoothness);
    add("unknowns", fit.unknowns as f64);
    add("freedom", fit.freedom);
    add("noise_deg", fit.noise.to_degrees());
    add("undetermined_nodes", fit.nodes.iter().filter(|node| !node.determined).count() as f64);
    add("elements_with_own_angles", fit.angles.own.len() as f64);
    add("chart", fit.chart as f64);
    add("steps", fit.steps as f64);
    rows.text
}
