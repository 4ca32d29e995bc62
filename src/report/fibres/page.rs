//! The page of a fit of fibre angles.

use crate::fibres::{FibreFit, Spread};
use crate::scene::{FibreProblem, LossSpec, SmoothnessSpec};

fn spread(name: &str, spread: &Spread) -> String {
    let Spread { count, rms, median, p95, most } = *spread;
    let [rms, median, p95, most] = [rms, median, p95, most].map(f64::to_degrees);
    format!("  {name:<22} {median:>9.4} {p95:>9.4} {rms:>9.4} {most:>9.4}   {count}\n")
}

/// The page for terminal and file.
pub(super) fn page(problem: &FibreProblem, fit: &FibreFit, empty: usize) -> String {
    let mut text = format!(
        "{}: fibres; {} elements, {} nodes, {} of angles {}\n",
        problem.name,
        fit.mesh.elements(),
        fit.mesh.nodes,
        fit.unknowns,
        crate::scene::AnglesSpec::ALL.iter().find(|(spec, _)| *spec == problem.angles).map_or("", |(_, word)| word)
    );
    text += &format!("{} measured axes used", fit.spread.count);
    if fit.outside.count > 0 {
        let [near, far] = fit.outside.distance;
        text += &format!(
            ", {} outside the mesh ({near:.3} to {far:.3} mm), of which {} projected",
            fit.outside.count, fit.outside.projected
        );
    }
    if empty > 0 {
        text += &format!(", {empty} without a direction or weight passed over");
    }
    text += "\n\nangular errors, degrees       median       p95       rms       max   axes\n";
    text += &spread("fit", &fit.spread);
    text += &fit.held_out.as_ref().map(|held_out| spread("held out", held_out)).unwrap_or_default();
    text += &fit.sheets.as_ref().map(|sheets| spread("sheets", sheets)).unwrap_or_default();
    let chosen = match problem.smoothness {
        SmoothnessSpec::Gcv => "by generalised cross-validation",
        SmoothnessSpec::Weight(_) => "as given",
    };
    let loss = match problem.loss {
        LossSpec::Quadratic => "quadratic loss".to_owned(),
        LossSpec::HuberDeg(scale) => format!("Huber loss of {scale} degrees"),
        LossSpec::CauchyDeg(scale) => format!("Cauchy loss of {scale} degrees"),
    };
    text += &format!(
        "\nsmoothness {:.3e} {chosen}, {loss}: the data determine {:.1} of {} numbers\n",
        fit.smoothness, fit.freedom, fit.unknowns
    );
    text +=
        &format!("noise of an axis that counts fully: {:.4} degrees along each direction\n", fit.noise.to_degrees());
    let sure: Vec<f64> = fit
        .nodes
        .iter()
        .filter(|node| node.determined && !node.fixed)
        .filter_map(|node| node.sd[0])
        .map(f64::to_degrees)
        .collect();
    let middle = |mut list: Vec<f64>| {
        list.sort_by(f64::total_cmp);
        list.get(list.len() / 2).copied()
    };
    let undetermined = fit.nodes.iter().filter(|node| !node.determined).count();
    text += &format!("nodes: {} determined by the data, {undetermined} not", fit.nodes.len() - undetermined);
    if let Some(sd) = middle(sure) {
        text += &format!("; sd of A at a determined one {sd:.4} degrees (median)");
    }
    text += "\n";
    if fit.chart > 0 {
        let names = ["xi1", "xi2", "xi3"];
        let [a, b, c] = [0, 1, 2].map(|d| names[(d + fit.chart) % 3]);
        text += &format!(
            "the data run along f3: in fibres.exf and the tables xi1, xi2, xi3 are the directions {a}, {b}, {c} of the problem\n"
        );
    }
    if !fit.angles.own.is_empty() {
        text += &format!(
            "the angle turns around: {} elements have half turns of their own (versions in fibres.exf)\n",
            fit.angles.own.len()
        );
    }
    let mut worst: Vec<_> = fit.elements.iter().collect();
    worst.sort_by(|a, b| b.spread.median.total_cmp(&a.spread.median));
    text += "\nelements that fit worst       median       p95       rms       max   axes\n";
    for element in worst.iter().take(3) {
        text += &spread(&format!("element {}", element.element), &element.spread);
    }
    text
}
