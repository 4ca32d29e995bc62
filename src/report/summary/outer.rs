//! What all frames share, for the page of a fit.

use super::{columns, count, optional};
use crate::error::Warning;
use crate::fit::identifiability::TOO_ALIKE;
use crate::fit::outer::{Compared, Found, Outcome};
use std::fmt::Write;

/// A paragraph of the page; `controls` are the names of those that are sought.
pub fn outer_page(outcome: &Outcome, controls: &[&str]) -> String {
    let used = outcome.frames.iter().filter(|frame| !frame.held_out).count();
    let iterations = count(outcome.iterations.len(), "iteration");
    let mut page = format!("what all frames share, from {} ({iterations})\n", count(used, "frame"));
    let row = |(k, found): (usize, &Found)| {
        let [lower, upper] = found.interval;
        let worst = match outcome.confounding.worst(k) {
            Some((frame, control, correlation)) => {
                format!("{correlation:.3} with {} in frame {frame}", controls[control])
            }
            None => "-".into(),
        };
        [
            found.unknown.what.label(),
            format!("{} {}", digits(found.value), found.unknown.what.unit()),
            format!("{} to {}", digits(lower), digits(upper)),
            optional(found.sd, 4),
            optional(found.sd_with_known_controls, 4),
            worst,
        ]
    };
    let rows: Vec<_> = outcome.found.iter().enumerate().map(row).collect();
    let header = ["", "value", "95 % interval", "sd", "sd with known controls", "largest correlation"];
    page += &columns(header, &rows);
    let factors = outcome.found.iter().any(|found| found.unknown.what.is_factor());
    if factors {
        page += "  deviations of factors are those of their logarithms\n";
    }
    for (a, b, correlation) in alike(outcome) {
        let _ = writeln!(page, "  {a} and {b} are hardly told apart: their errors correlate by {correlation:.3}");
    }
    for (held_out, what) in [(false, "used"), (true, "held out")] {
        let own: Vec<&Compared> = outcome.frames.iter().filter(|frame| frame.held_out == held_out).collect();
        if !own.is_empty() {
            let before = rms(own.iter().map(|frame| frame.before_mm));
            let after = rms(own.iter().map(|frame| frame.after_mm));
            let frames = count(own.len(), "frame");
            let _ = writeln!(page, "  {frames} {what}: markers {before} mm before, {after} mm with what was found");
        }
    }
    let inflated = (0..controls.len()).filter_map(|k| Some((controls[k], outcome.confounding.inflation(k)?)));
    let inflated: Vec<String> =
        inflated.filter(|(_, by)| *by > 1.1).map(|(name, by)| format!("{name} {by:.1}")).collect();
    if !inflated.is_empty() {
        let _ = writeln!(
            page,
            "  deviations of controls elsewhere hold for these values; with what is not known of them they are up to so many times \
             as large: {}",
            inflated.join(", ")
        );
    }
    page + "\n"
}

/// What of it cannot be told from the controls: the frame where that is worst, if there is one, and F013.
pub fn outer_warnings(outcome: &Outcome, controls: &[&str]) -> Vec<(Option<usize>, Warning)> {
    let warning = |(k, found): (usize, &Found)| {
        let label = found.unknown.what.label();
        let worst = outcome.confounding.worst(k);
        let alike = worst.filter(|(.., correlation)| correlation.abs() > TOO_ALIKE);
        let with = alike.map(|(frame, control, correlation)| {
            format!("its errors correlate by {correlation:.3} with those of `{}` in frame {frame}", controls[control])
        });
        let message = match (found.prior_dominated, found.sd, with) {
            (true, None, _) => format!("`{label}` lies on its bound, {} {}", found.value, found.unknown.what.unit()),
            (true, Some(sd), with) => {
                let with = with.map(|with| format!("; {with}")).unwrap_or_default();
                format!(
                    "`{label}` is not determined by these markers: its standard deviation {sd:.2} is that of what was known \
                     before{with}"
                )
            }
            (false, _, Some(with)) => format!("`{label}` and a control are hardly told apart: {with}"),
            (false, _, None) => return None,
        };
        let help = "hold a control that is known, or give what is known of it from elsewhere: sd = 0.1".to_owned();
        let frame = worst.map(|(frame, ..)| frame);
        Some((frame, Warning { code: "F013", message, place: Some(found.unknown.place.clone()), help: Some(help) }))
    };
    outcome.found.iter().enumerate().filter_map(warning).collect()
}

/// Pairs of outer unknowns that are hardly told apart.
fn alike(outcome: &Outcome) -> Vec<(String, String, f64)> {
    let label = |k: usize| outcome.found[k].unknown.what.label();
    let all = (0..outcome.found.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    let of = |(a, b)| (label(a), label(b), outcome.correlation[(a, b)]);
    all.map(of).filter(|(.., correlation)| correlation.abs() > TOO_ALIKE).collect()
}

/// Root mean square, unless one is missing.
fn rms(values: impl Iterator<Item = Option<f64>>) -> String {
    match values.collect::<Option<Vec<f64>>>() {
        Some(all) if !all.is_empty() => {
            format!("{:.4}", (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt())
        }
        _ => "(a frame failed)".into(),
    }
}

/// Four digits that count.
fn digits(value: f64) -> String {
    let whole = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", (3 - whole).clamp(0, 6) as usize)
}
