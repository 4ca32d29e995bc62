//! Left against right: pairs of names that end in `.L` and `.R`.

use super::frame::table;
use crate::math::tensor::{norm, subtract};
use crate::report::playback::{Control, Marker, Playback};
use crate::scene::ControlKind;

/// The section; `None` where nothing has a counterpart on the other side.
pub(super) fn section(run: &Playback) -> Option<String> {
    let muscles: Vec<_> = pairs(&run.controls, |control| &control.name)
        .filter(|(_, left, _)| left.kind == ControlKind::Activation)
        .map(|(name, left, right)| row(name, &peak(left), &peak(right), 3))
        .collect();
    let markers: Vec<_> = pairs(&run.markers, |marker| &marker.name)
        .map(|(name, left, right)| row(name, &way(left), &way(right), 2))
        .collect();
    if muscles.is_empty() && markers.is_empty() {
        return None;
    }
    let mut html = String::new();
    if !markers.is_empty() {
        html += "<p>The farthest that each marker moved from where it was in the first frame, millimetres:</p>\n";
        html += &table(["marker", "left", "right", "left - right", "asymmetry"], &markers);
    }
    if !muscles.is_empty() {
        html += "<p>The strongest activation of each muscle, a part of its greatest:</p>\n";
        html += &table(["muscle", "left", "right", "left - right", "asymmetry"], &muscles);
    }
    html += "<p class=\"note\">Asymmetry: (left - right) / (left + right), from -100 % (right only) to 100 % (left only). Left and right \
             are the subject's own.</p>";
    Some(html)
}

/// Name without its side, left, right.
pub(super) fn pairs<'a, T>(
    all: &'a [T],
    name: impl Fn(&'a T) -> &'a str + 'a,
) -> impl Iterator<Item = (&'a str, &'a T, &'a T)> {
    let names: Vec<&str> = all.iter().map(name).collect();
    let pairs: Vec<_> = names
        .iter()
        .enumerate()
        .filter_map(|(left, own)| {
            let own = own.strip_suffix(".L")?;
            let right = names.iter().position(|other| other.strip_suffix(".R") == Some(own))?;
            Some((own, &all[left], &all[right]))
        })
        .collect();
    pairs.into_iter()
}

fn row(name: &str, left: &f64, right: &f64, digits: usize) -> [String; 5] {
    let sum = left + right;
    // of two that are next to nothing the asymmetry means nothing
    let asymmetry = if sum > 1e-3 { format!("{:+.0} %", 100.0 * (left - right) / sum) } else { "-".into() };
    [
        name.to_owned(),
        format!("{left:.digits$}"),
        format!("{right:.digits$}"),
        format!("{:+.digits$}", left - right),
        asymmetry,
    ]
}

fn peak(control: &Control) -> f64 {
    control.values.iter().copied().fold(0.0, f64::max)
}

/// The way of the measured marker; of the model where it was never measured.
fn way(marker: &Marker) -> f64 {
    let measured: Vec<_> = marker.samples.iter().filter_map(|sample| sample.measured).collect();
    let points =
        if measured.is_empty() { marker.samples.iter().map(|sample| sample.model).collect() } else { measured };
    points.iter().map(|x| norm(subtract(*x, points[0]))).fold(0.0, f64::max)
}
