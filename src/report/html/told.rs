//! What the markers can and cannot tell: from the tables about it where there are any, else from the standard deviations.

use super::charts::shown;
use super::frame::table;
use crate::error::Result;
use crate::report::playback::{Control, Playback, Sheet};

/// An interval wider than this part of the range says little.
const WIDE: f64 = 0.2;

/// The section; `None` for a run without markers.
pub(super) fn section(run: &Playback) -> Result<Option<String>> {
    if run.markers.is_empty() {
        return Ok(None);
    }
    let mut html = String::from(
        "<p>For each control the frame in which it is strongest, with the interval that holds the truth in 95 of 100 repetitions, \
         as far as noise of the markers tells. A model that is wrong, or a mesh that is too coarse, is not in it.</p>\n",
    );
    let rows: Vec<[String; 5]> = run.controls.iter().map(|control| row(run, control)).collect();
    html += &table(["control", "strongest", "in frame", "95 % interval", "so"], &rows);
    let tables = run.folder.join("tables");
    if let Some(sheet) = Sheet::find(&tables, "identifiability")? {
        html += &dominated(&sheet)?;
    }
    if let Some(sheet) = Sheet::find(&tables, "pairs")? {
        html += &together(&sheet)?;
    }
    Ok(Some(html))
}

fn row(run: &Playback, control: &Control) -> [String; 5] {
    let (at, value) =
        control.values.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::NAN));
    let [lower, upper] = control.range;
    let at_bound = |value: f64| value <= lower || value >= upper;
    let (interval, verdict) = match control.intervals.get(at).copied().flatten() {
        Some([low, high]) if high - low > WIDE * (upper - lower) => {
            (format!("{low:.4} to {high:.4}"), "the markers say little")
        }
        Some([low, high]) => (format!("{low:.4} to {high:.4}"), "determined by the markers"),
        None if at_bound(value) => ("-".into(), "on its bound"),
        None => ("-".into(), "given, or not determined"),
    };
    let frame = run.frames.get(at).map(|frame| frame.index.to_string()).unwrap_or_default();
    let unit = control.kind.unit();
    [format!("{} {unit}", control.name).trim_end().to_owned(), format!("{value:.4}"), frame, interval, verdict.into()]
}

/// Controls that follow what was assumed of them rather than the markers.
fn dominated(sheet: &Sheet) -> Result<String> {
    let (control, prior) = (sheet.column("control")?, sheet.column("prior_dominated")?);
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for row in 0..sheet.len() {
        if matches!(sheet.text(row, prior), "1" | "true" | "yes") {
            let name = sheet.text(row, control);
            match counts.iter_mut().find(|(known, _)| *known == name) {
                Some((_, count)) => *count += 1,
                None => counts.push((name, 1)),
            }
        }
    }
    if counts.is_empty() {
        return Ok(String::new());
    }
    let rows: Vec<[String; 2]> = counts.iter().map(|(name, count)| [(*name).to_owned(), count.to_string()]).collect();
    Ok(format!(
        "<p>What was assumed about these says more than the markers, in so many frames:</p>\n{}",
        table(["control", "frames"], &rows)
    ))
}

/// Pairs of which only a sum is known.
fn together(sheet: &Sheet) -> Result<String> {
    let [a, b, correlation] = [sheet.column("a")?, sheet.column("b")?, sheet.column("correlation")?];
    let mut pairs: Vec<(&str, &str, usize, f64)> = Vec::new();
    for row in 0..sheet.len() {
        let (a, b) = (sheet.text(row, a), sheet.text(row, b));
        let strong = sheet.number(row, correlation)?.unwrap_or(0.0);
        match pairs.iter_mut().find(|pair| (pair.0, pair.1) == (a, b)) {
            Some(pair) => {
                pair.2 += 1;
                pair.3 = if strong.abs() > pair.3.abs() { strong } else { pair.3 };
            }
            None => pairs.push((a, b, 1, strong)),
        }
    }
    if pairs.is_empty() {
        return Ok(String::new());
    }
    let rows: Vec<[String; 3]> =
        pairs.iter().map(|(a, b, count, strong)| [format!("{a}, {b}"), count.to_string(), shown(*strong)]).collect();
    Ok(format!(
        "<p>These cannot be told apart by the markers: what they do together is known, the split between them is not.</p>\n{}",
        table(["pair", "frames", "correlation, at most"], &rows)
    ))
}
