//! `study.md`: the study on a page, also what the terminal shows.

use super::tables::{applies, refinements, theory};
use crate::scene::{Measure, Study};
use crate::study::front::{cheapest, front};
use crate::study::order::{Extrapolation, extrapolate, observed};
use crate::study::{Outcome, VariantResult};
use std::fmt::Write as _;

/// The page, in Markdown.
pub fn page(study: &Study, outcome: &Outcome) -> String {
    let measure = study.measure;
    let unit = measure.unit();
    let pairs: Vec<(f64, f64)> = outcome.variants.iter().map(|v| v.pair(measure)).collect();
    let on_front = front(&pairs);
    let mut text = format!(
        "# {}: what accuracy costs in time\n\nProblem {}. Errors: {} against {}.\nTimes: median (smallest to largest) of {} \
         solves after one that is not timed, in turn over all variants; reading, building and writing are not in them.\n\n",
        study.name,
        study.problem.display(),
        describe(measure),
        outcome.reference,
        study.repetitions
    );
    let headed = |unit: &str| if unit.is_empty() { "error".to_owned() } else { format!("error {unit}") };
    let _ = writeln!(
        text,
        "| | variant | {} | seconds | iterations | factorisations | Gflop | points | unknowns |\n|---|---|---|---|---|---|---|---|---|",
        headed(unit)
    );
    for (index, VariantResult { variant, ending }) in outcome.variants.iter().enumerate() {
        let _ = match ending {
            Ok(solved) => {
                let t = &solved.timing;
                let disturbed = match t.outliers() {
                    0 => String::new(),
                    n => format!(", {n} disturbed"),
                };
                writeln!(
                    text,
                    "| {} | {} | {} | {:.3} ({:.3} to {:.3}{disturbed}) | {} | {} | {:.3} | {} | {} |",
                    if on_front.contains(&index) { "front" } else { "" },
                    variant.name,
                    shown(pairs[index].0),
                    t.median(),
                    t.min(),
                    t.max(),
                    solved.work.iterations,
                    solved.work.linear.factorisations,
                    1e-9 * solved.work.linear.factor_flops,
                    solved.work.points.iter().sum::<usize>(),
                    solved.unknowns
                )
            }
            Err(failed) => {
                writeln!(text, "| failed | {} | {} {} | | | | | | |", variant.name, failed.code, failed.message)
            }
        };
    }
    text += "\n![error against time](error_time.svg)\n";
    estimates(study, outcome, &mut text);
    orders(study, outcome, &mut text);
    advice(study, outcome, &pairs, &mut text);
    if outcome.interrupted {
        text += "\nThe study was interrupted: not all repetitions were done.\n";
    }
    text
}

fn describe(measure: Measure) -> &'static str {
    match measure {
        Measure::Probes => "largest distance of a probe from its place",
        Measure::Markers => "root mean square distance of the markers from their places",
        Measure::Displacement => "root mean square difference of the displacement over the body",
        Measure::Gradient => "root mean square difference of the displacement gradient over the body",
        Measure::DetF => "root mean square difference of det F over the body",
        Measure::Energy => "relative difference of the stored energy",
        Measure::Activations => "root mean square difference of the activations",
    }
}

fn shown(error: f64) -> String {
    if error.is_nan() { String::new() } else { format!("{error:.2e}") }
}

/// Ratios of an estimate to the true error that count as good.
const GOOD: std::ops::RangeInclusive<f64> = 1.0 / 3.0..=3.0;

/// What the variants estimated of their own errors beside what the errors are.
fn estimates(study: &Study, outcome: &Outcome, text: &mut String) {
    if !study.estimate {
        return;
    }
    let unit = study.measure.unit();
    *text += &format!(
        "\n## Estimated errors\n\nA few Newton steps on halved elements; their seconds hold the building of that model.\n\n\
         | variant | estimate {unit} | true {unit} | ratio | seconds |\n|---|---|---|---|---|\n"
    );
    let mut ratios = Vec::new();
    for VariantResult { variant, ending } in &outcome.variants {
        let Ok(solved) = ending else { continue };
        let _ = match &solved.estimate {
            Some(Ok(own)) => {
                let (estimate, known) = (own.errors.get(study.measure), solved.errors.get(study.measure));
                let ratio = estimate.zip(known).map(|(estimate, known)| estimate / known);
                ratios.extend(ratio);
                writeln!(
                    text,
                    "| {} | {} | {} | {} | {:.3} |",
                    variant.name,
                    shown(estimate.unwrap_or(f64::NAN)),
                    shown(known.unwrap_or(f64::NAN)),
                    ratio.map(|ratio| format!("{ratio:.2}")).unwrap_or_default(),
                    own.seconds
                )
            }
            Some(Err(why)) => writeln!(text, "| {} | {} {} | | | |", variant.name, why.code, why.message),
            None => Ok(()),
        };
    }
    if !ratios.is_empty() {
        let good = ratios.iter().filter(|ratio| GOOD.contains(*ratio)).count();
        *text += &format!(
            "\nWithin a factor of 3 of the true error: {good} of {} variants ({:.0} %).\n",
            ratios.len(),
            100.0 * good as f64 / ratios.len() as f64
        );
    }
}

/// Observed orders beside theory, and what the probes converge to.
fn orders(study: &Study, outcome: &Outcome, text: &mut String) {
    let steps = refinements(study, outcome);
    if steps.is_empty() {
        return;
    }
    let measures: Vec<Measure> = Measure::ALL.into_iter().filter(|m| applies(outcome, *m)).collect();
    *text += "\n## Orders of convergence\n\n| from | to |";
    measures.iter().for_each(|m| *text += &format!(" {} |", m.word()));
    *text += &format!("\n|---|---|{}\n| | smooth theory |", "---|".repeat(measures.len()));
    measures.iter().for_each(|m| *text += &theory(*m).map_or(" |".into(), |order| format!(" {order} |")));
    *text += "\n";
    for (_, from, to) in &steps {
        *text += &format!("| {} | {} |", from.variant.name, to.variant.name);
        for measure in &measures {
            let at = |v: &VariantResult| Some((v.ending.as_ref().ok()?.element_size, v.pair(*measure).0));
            let order = at(from).zip(at(to)).and_then(|(coarse, fine)| observed(coarse, fine));
            *text += &order.map_or(" |".into(), |order| format!(" {order:.1} |"));
        }
        *text += "\n";
    }
    let mut limits = String::new();
    for (_, from, middle) in &steps {
        for (_, _, to) in steps.iter().filter(|(_, start, _)| std::ptr::eq(*start, *middle)) {
            for (probe, found) in limits_of([from, middle, to]) {
                limits += &format!(
                    "- {} to {}: displacement of probe {} tends to {:.4} mm with order {:.1}, the finest is uncertain by {:.1e} mm\n",
                    from.variant.name,
                    to.variant.name,
                    probe + 1,
                    found.value,
                    found.order,
                    found.uncertainty
                );
            }
        }
    }
    if !limits.is_empty() {
        *text += &format!("\nRichardson extrapolation of the size of each probe's displacement:\n\n{limits}");
    }
    *text += "\n![order](order.svg)\n";
}

fn limits_of(three: [&VariantResult; 3]) -> Vec<(usize, Extrapolation)> {
    let solved: Vec<_> = three.iter().filter_map(|v| v.ending.as_ref().ok()).collect();
    let [a, b, c] = solved[..] else { return Vec::new() };
    let probes = a.probe_distances.len();
    let found = |k: usize| {
        let at = |s: &crate::study::Solved| (s.element_size, s.probe_distances[k]);
        Some((k, extrapolate([at(a), at(b), at(c)])?))
    };
    (0..probes).filter_map(found).collect()
}

fn advice(study: &Study, outcome: &Outcome, pairs: &[(f64, f64)], text: &mut String) {
    let unit = study.measure.unit();
    *text += "\n## Advice\n\n";
    if let Some(target) = study.target {
        *text += &match cheapest(pairs, target) {
            Some(k) => format!(
                "For an error of {target} {unit}: **{}**, {:.3} s, error {:.2e} {unit}.\n",
                outcome.variants[k].variant.name, pairs[k].1, pairs[k].0
            ),
            None => format!("No variant reaches an error of {target} {unit}: add finer ones.\n"),
        };
    }
    *text += "On the front, cheapest first:\n\n";
    for k in front(pairs) {
        let (error, seconds) = pairs[k];
        *text += &format!("- {}: {seconds:.3} s, {error:.2e} {unit}\n", outcome.variants[k].variant.name);
    }
    *text += "\n![cost](cost.svg)\n";
}
