//! The tables of a study.

use crate::report::tables::{Cell, Rows};
use crate::scene::{Measure, Study};
use crate::study::front::front;
use crate::study::order::observed;
use crate::study::{Outcome, Solved, VariantResult};

/// Element sizes that differ by less are the same.
const SAME_SIZE: f64 = 1e-3;

/// `study.csv`: a row per variant.
pub(super) fn variants(study: &Study, outcome: &Outcome) -> String {
    let measures: Vec<Measure> = Measure::ALL.into_iter().filter(|m| applies(outcome, *m)).collect();
    let mut header: Vec<String> = vec!["variant".into()];
    header.extend(study.factors.iter().map(|factor| factor.name.clone()));
    header.extend(["status".into(), "code".into()]);
    header.extend(measures.iter().map(|m| column("error", *m)));
    if study.estimate {
        header.extend(measures.iter().map(|m| column("estimate", *m)));
        header.push("estimate_seconds".into());
    }
    header.extend(
        "seconds_median,seconds_min,seconds_max,repetitions_disturbed,build_seconds,elements,unknowns,newton_iterations,\
         force_evaluations,assemblies,points,factorisations,factor_flops,factor_gflop_s,solves,memory_mb,on_front"
            .split(',')
            .map(str::to_owned),
    );
    let mut rows = Rows::default();
    rows.add(header.iter().map(|name| Cell::Text(name)));
    let pairs: Vec<(f64, f64)> = outcome.variants.iter().map(|v| v.pair(study.measure)).collect();
    let on_front = front(&pairs);
    for (index, VariantResult { variant, ending }) in outcome.variants.iter().enumerate() {
        let labels = study.factors.iter().enumerate().map(|(k, factor)| match &variant.levels {
            Some(levels) => Cell::Text(&factor.levels[levels[k]].label),
            None => Cell::Empty,
        });
        let mut row = vec![Cell::Text(&variant.name)];
        row.extend(labels);
        match ending {
            Err(failed) => row.extend([Cell::Text("failed"), Cell::Text(failed.code)]),
            Ok(solved) => {
                row.extend([Cell::Text("solved"), Cell::Empty]);
                row.extend(measures.iter().map(|m| solved.errors.get(*m).map_or(Cell::Empty, Cell::Number)));
                if study.estimate {
                    let own = solved.estimate.as_ref().and_then(|own| own.as_ref().ok());
                    row.extend(measures.iter().map(|m| Cell::from(own.and_then(|own| own.errors.get(*m)))));
                    row.push(own.map(|own| own.seconds).into());
                }
                row.extend(costs(solved));
                row.push(Cell::Count(usize::from(on_front.contains(&index))));
            }
        }
        row.resize(header.len(), Cell::Empty);
        rows.add(row);
    }
    rows.text
}

fn costs(solved: &Solved) -> [Cell<'static>; 16] {
    let (timing, work, linear) = (&solved.timing, &solved.work, &solved.work.linear);
    [
        timing.median().into(),
        timing.min().into(),
        timing.max().into(),
        timing.outliers().into(),
        solved.build_seconds.into(),
        solved.elements.into(),
        solved.unknowns.into(),
        work.iterations.into(),
        work.force_evaluations.into(),
        work.assemblies.into(),
        work.points.iter().sum::<usize>().into(),
        linear.factorisations.into(),
        linear.factor_flops.into(),
        (1e-9 * linear.factor_flops / linear.factor_time.as_secs_f64()).into(),
        linear.solves.into(),
        solved.memory_mb.into(),
    ]
}

/// `effects.csv`: what each effect and each stage cost in the first solve of a variant. Seconds of effects are summed over
/// threads.
pub(super) fn effects(outcome: &Outcome) -> String {
    let mut rows = Rows::default();
    rows.add("variant,part,seconds,clock,points".split(',').map(Cell::Text));
    for VariantResult { variant, ending } in &outcome.variants {
        let Ok(solved) = ending else { continue };
        let work = &solved.work;
        for ((effect, seconds), points) in solved.effects.iter().zip(&work.term_seconds).zip(&work.points) {
            rows.add([
                Cell::Text(&variant.name),
                Cell::Text(effect),
                (*seconds).into(),
                "threads".into(),
                (*points).into(),
            ]);
        }
        for (stage, seconds) in stages(solved) {
            rows.add([Cell::Text(&variant.name), stage.into(), seconds.into(), "wall".into(), Cell::Empty]);
        }
    }
    rows.text
}

/// The stages of a solve and their wall time, s.
pub(super) fn stages(solved: &Solved) -> [(&'static str, f64); 3] {
    let linear = &solved.work.linear;
    [
        ("assembly", solved.work.assembly_seconds),
        ("factorisation", linear.factor_time.as_secs_f64()),
        ("solve", linear.solve_time.as_secs_f64()),
    ]
}

/// `orders.csv`: the observed order between two variants that differ in one factor and in the size of their elements.
pub(super) fn orders(study: &Study, outcome: &Outcome) -> String {
    let mut rows = Rows::default();
    rows.add("factor,from,to,measure,order,theory".split(',').map(Cell::Text));
    for (factor, from, to) in refinements(study, outcome) {
        for measure in Measure::ALL {
            let at = |v: &VariantResult| Some((v.ending.as_ref().ok()?.element_size, v.pair(measure).0));
            if let Some(order) = at(from).zip(at(to)).and_then(|(coarse, fine)| observed(coarse, fine)) {
                rows.add([
                    Cell::Text(factor),
                    Cell::Text(&from.variant.name),
                    Cell::Text(&to.variant.name),
                    measure.word().into(),
                    order.into(),
                    theory(measure).map_or(Cell::Empty, Cell::Number),
                ]);
            }
        }
    }
    rows.text
}

/// The order that a smooth solution has on tricubic elements.
pub(super) fn theory(measure: Measure) -> Option<f64> {
    match measure {
        Measure::Probes | Measure::Markers | Measure::Displacement => Some(4.0),
        Measure::Gradient | Measure::DetF => Some(3.0),
        Measure::Energy => Some(6.0),
        Measure::Activations => None,
    }
}

/// Pairs of variants in which only one factor differs, from larger elements to the next smaller ones.
pub(super) fn refinements<'o>(
    study: &'o Study,
    outcome: &'o Outcome,
) -> Vec<(&'o str, &'o VariantResult, &'o VariantResult)> {
    let mut all = Vec::new();
    for (k, factor) in study.factors.iter().enumerate() {
        for from in &outcome.variants {
            let size = |v: &VariantResult| v.ending.as_ref().ok().map(|solved| solved.element_size);
            let alike = |to: &&VariantResult| match (&from.variant.levels, &to.variant.levels) {
                (Some(a), Some(b)) => (0..a.len()).all(|j| (j == k) != (a[j] == b[j])),
                _ => false,
            };
            // sizes come from the quadrature of the volume: the same mesh has not always the same bits
            let is_finer = |to: &&VariantResult| {
                size(to).zip(size(from)).is_some_and(|(fine, coarse)| fine < (1.0 - SAME_SIZE) * coarse)
            };
            let smaller = outcome.variants.iter().filter(alike).filter(is_finer);
            let next = smaller.max_by(|a, b| size(a).partial_cmp(&size(b)).unwrap_or(std::cmp::Ordering::Equal));
            all.extend(next.map(|to| (factor.name.as_str(), from, to)));
        }
    }
    all
}

/// Whether any variant has an error of a measure.
pub(super) fn applies(outcome: &Outcome, measure: Measure) -> bool {
    outcome.variants.iter().any(|v| v.pair(measure).0.is_finite())
}

/// `error_probes_mm` and so on.
fn column(what: &str, measure: Measure) -> String {
    let unit = match measure.unit() {
        "" => String::new(),
        unit => format!("_{unit}"),
    };
    format!("{what}_{}{unit}", measure.word().replace('-', "_"))
}
