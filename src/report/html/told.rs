//! What the markers can and cannot tell, from the tables about it.

use super::charts::shown;
use super::frame::{escape, table};
use crate::error::Result;
use crate::math::normal::TWO_SIDED_95;
use crate::report::playback::{Control, Playback, Sheet};
use std::collections::BTreeMap;
use std::path::Path;

/// An interval wider than this part of the range says little.
const WIDE: f64 = 0.2;
/// What is left of a marker is told where it is this many times what noise leaves.
const BEYOND_NOISE: f64 = 2.0;

/// The section; `None` for a run without markers.
pub(super) fn section(run: &Playback) -> Result<Option<String>> {
    if run.markers.is_empty() {
        return Ok(None);
    }
    let tables = run.folder.join("tables");
    let told = Sheet::find(&tables, "identifiability")?;
    let mut html = String::from(
        "<p>For each control the frame in which it is strongest, with the interval that holds the truth in 95 of 100 repetitions, \
         as far as noise of the markers tells. A model that is wrong, or a mesh that is too coarse, is not in it.</p>\n",
    );
    let rows = run.controls.iter().map(|control| row(run, control, told.as_ref()));
    html += &table(["control", "strongest", "in frame", "95 % interval", "so"], &rows.collect::<Result<Vec<_>>>()?);
    if let Some(sheet) = told {
        html += &dominated(&sheet)?;
    }
    for (name, part) in [
        ("combinations", combinations as fn(&Sheet) -> Result<String>),
        ("pairs", together),
        ("unexplained", unexplained),
        ("advice", advice),
    ] {
        html += &find(&tables, name, part)?;
    }
    Ok(Some(html))
}

fn find(tables: &Path, name: &str, part: fn(&Sheet) -> Result<String>) -> Result<String> {
    Sheet::find(tables, name)?.map_or(Ok(String::new()), |sheet| part(&sheet))
}

fn row(run: &Playback, control: &Control, told: Option<&Sheet>) -> Result<[String; 5]> {
    let (at, value) =
        control.values.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::NAN));
    let frame = run.frames.get(at).map(|frame| frame.index.to_string()).unwrap_or_default();
    let interval = control.intervals.get(at).copied().flatten();
    let said = match told {
        Some(sheet) => of_frame(sheet, &frame, &control.label())?,
        None => None,
    };
    let verdict = match (said, interval) {
        (Some(said), _) => said,
        (None, Some([low, high])) if high - low > WIDE * (control.range[1] - control.range[0]) => {
            "the markers say little".into()
        }
        (None, Some(_)) => "determined by the markers".into(),
        (None, None) => "given, not sought".into(),
    };
    let interval = interval.map_or("-".into(), |[low, high]| format!("{} to {}", number(low), number(high)));
    Ok([control.label(), number(value), frame, interval, verdict])
}

/// What the table says of a control in a frame; `None` where it was not sought.
fn of_frame(sheet: &Sheet, frame: &str, control: &str) -> Result<Option<String>> {
    let [frames, controls, bound, wants] =
        [sheet.column("frame")?, sheet.column("control")?, sheet.column("bound")?, sheet.column("wants")?];
    let [prior, bias, bridged] = [sheet.column("prior_dominated")?, sheet.column("bias")?, sheet.column("bridged")?];
    let is_it = |row: &usize| sheet.text(*row, frames) == frame && sheet.text(*row, controls) == control;
    let Some(row) = (0..sheet.len()).find(is_it) else { return Ok(None) };
    let mut said = match sheet.text(row, bound) {
        _ if sheet.text(row, bridged) == "1" => "the frame failed: its neighbours say this".to_owned(),
        _ if sheet.text(row, prior) == "1" => "the markers say little".into(),
        side @ ("lower" | "upper") => match sheet.finite(row, wants)? {
            Some(wants) => format!("on its {side} bound; without it at {}", number(wants)),
            None => format!("on its {side} bound"),
        },
        _ => "determined by the markers".into(),
    };
    if let Some(bias) = sheet.finite(row, bias)? {
        said += &format!("; the mesh shifts it by {}", shown(bias));
    }
    Ok(Some(said))
}

/// Controls that follow what was assumed of them rather than the markers.
fn dominated(sheet: &Sheet) -> Result<String> {
    let (control, prior) = (sheet.column("control")?, sheet.column("prior_dominated")?);
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for row in (0..sheet.len()).filter(|row| sheet.text(*row, prior) == "1") {
        let name = sheet.text(row, control);
        match counts.iter_mut().find(|(known, _)| *known == name) {
            Some((_, count)) => *count += 1,
            None => counts.push((name, 1)),
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

/// What no marker of the whole clip sees, or else what they see least.
fn combinations(sheet: &Sheet) -> Result<String> {
    let [frame, sd] = [sheet.column("frame")?, sheet.column("sd")?];
    let [determined, words] = [sheet.column("determined")?, sheet.column("combination")?];
    let of_clip: Vec<usize> = (0..sheet.len()).filter(|row| sheet.text(*row, frame).is_empty()).collect();
    let unseen: Vec<[String; 1]> = of_clip
        .iter()
        .filter(|row| sheet.text(**row, determined) == "0")
        .map(|row| [sheet.text(*row, words).to_owned()])
        .collect();
    if !unseen.is_empty() {
        return Ok(format!(
            "<p>Over the whole clip no marker determines these combinations of controls in parts of their ranges:</p>\n{}",
            table(["combination"], &unseen)
        ));
    }
    match of_clip[..] {
        [_, .., last] => Ok(format!(
            "<p>The markers tell every combination of controls; least {}, to {} of their ranges.</p>\n",
            escape(sheet.text(last, words)),
            shown(sheet.known(last, sd)?)
        )),
        _ => Ok(String::new()),
    }
}

/// Pairs of which only a sum is known; in the frame in which they are most alike, what of them is determined.
fn together(sheet: &Sheet) -> Result<String> {
    let [a, b, frame] = [sheet.column("a")?, sheet.column("b")?, sheet.column("frame")?];
    let [correlation, weight] = [sheet.column("correlation")?, sheet.column("weight")?];
    let [value, sd] = [sheet.column("together")?, sheet.column("together_sd")?];
    let mut pairs: BTreeMap<(&str, &str), (usize, usize, f64)> = BTreeMap::new();
    for row in 0..sheet.len() {
        let strong = sheet.known(row, correlation)?;
        let pair = pairs.entry((sheet.text(row, a), sheet.text(row, b))).or_insert((0, row, strong));
        pair.0 += 1;
        if strong.abs() > pair.2.abs() {
            (pair.1, pair.2) = (row, strong);
        }
    }
    if pairs.is_empty() {
        return Ok(String::new());
    }
    let mut rows = Vec::new();
    for ((a, b), (count, row, strong)) in pairs {
        let weight = sheet.known(row, weight)?;
        let sign = if weight < 0.0 { "-" } else { "+" };
        let sum = format!(
            "{a} {sign} {:.2} {b} = {} +/- {} in frame {}",
            weight.abs(),
            number(sheet.known(row, value)?),
            number(TWO_SIDED_95 * sheet.known(row, sd)?),
            sheet.text(row, frame)
        );
        rows.push([format!("{a}, {b}"), count.to_string(), shown(strong), sum]);
    }
    Ok(format!(
        "<p>These cannot be told apart by the markers: what they do together is known, the split between them is not.</p>\n{}",
        table(["pair", "frames", "correlation, at most", "known (95 %)"], &rows)
    ))
}

/// Markers whose residual no admissible control removes.
fn unexplained(sheet: &Sheet) -> Result<String> {
    let [marker, left, expected] = [sheet.column("marker")?, sheet.column("left_mm")?, sheet.column("expected_mm")?];
    let mut sums: BTreeMap<&str, [f64; 3]> = BTreeMap::new();
    for row in 0..sheet.len() {
        let [count, left_mm2, expected_mm2] = sums.entry(sheet.text(row, marker)).or_default();
        *count += 1.0;
        *left_mm2 += sheet.known(row, left)?.powi(2);
        *expected_mm2 += sheet.known(row, expected)?.powi(2);
    }
    let rms = sums.into_iter().map(|(name, [count, left, expected])| {
        (name, (left / count).sqrt(), (expected / count).sqrt().max(f64::MIN_POSITIVE))
    });
    let mut beyond: Vec<_> = rms.filter(|(_, left, expected)| *left > BEYOND_NOISE * expected).collect();
    if beyond.is_empty() {
        return Ok("<p>No marker is off by more than twice what noise leaves.</p>\n".into());
    }
    beyond.sort_by(|a, b| (b.1 / b.2).total_cmp(&(a.1 / a.2)));
    let rows: Vec<_> =
        beyond.iter().map(|(name, left, expected)| [(*name).to_owned(), shown(*left), shown(*expected)]).collect();
    Ok(format!(
        "<p>No admissible activations explain these markers: the model lacks something there, or the marker is not where it is \
         said to be. Root mean square over the frames, mm:</p>\n{}",
        table(["marker", "remains", "noise alone leaves"], &rows)
    ))
}

/// Markers that were proposed, each with the control that it tells most of.
fn advice(sheet: &Sheet) -> Result<String> {
    let [name, control] = [sheet.column("number")?, sheet.column("control")?];
    let place = [sheet.column("x_mm")?, sheet.column("y_mm")?, sheet.column("z_mm")?];
    let [before, after] = [sheet.column("sd_before")?, sheet.column("sd_after")?];
    let mut best: BTreeMap<usize, (f64, [String; 4])> = BTreeMap::new();
    for row in 0..sheet.len() {
        let (was, is) = (sheet.known(row, before)?, sheet.known(row, after)?);
        let number_of = sheet.count(row, name)?;
        if best.get(&number_of).is_some_and(|(ratio, _)| *ratio <= is / was) {
            continue;
        }
        let mut at = [0.0; 3];
        for (coordinate, column) in at.iter_mut().zip(place) {
            *coordinate = sheet.known(row, column)?;
        }
        let cells = [
            number_of.to_string(),
            at.map(|coordinate| format!("{coordinate:.1}")).join(", "),
            sheet.text(row, control).to_owned(),
            format!("{} to {}", number(was), number(is)),
        ];
        best.insert(number_of, (is / was, cells));
    }
    if best.is_empty() {
        return Ok(String::new());
    }
    let rows: Vec<_> = best.into_values().map(|(_, cells)| cells).collect();
    Ok(format!(
        "<p>Markers to add (risorius advise), the best first, each with those before it in place:</p>\n{}",
        table(["number", "near, mm", "tells most of", "standard deviation"], &rows)
    ))
}

/// Four digits behind the point, or an exponent where that would hide it.
fn number(value: f64) -> String {
    match value.abs() {
        size if size > 0.0 && size < 1e-3 => format!("{value:.1e}"),
        _ => format!("{value:.4}"),
    }
}
