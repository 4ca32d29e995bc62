//! Markers on the model: from a name and a position in the problem to a material point and a label of the recording.

use super::registration::{at_rest, neutral_frames};
use crate::error::{Error, Place, Result};
use crate::markers::Recording;
use crate::math::motion::{Pair, spread};
use crate::mesh::surface::Surface;
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::{FitSpec, Scene, Units};

/// A marker that is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Its label.
    pub name: String,
    /// Where it sits.
    pub point: MaterialPoint,
    /// How far the position in the problem was from the surface, mm.
    pub distance: f64,
    /// Standard deviation of its measured coordinates, mm, with what the neutral frames leave open of its offset; `None` where
    /// the problem gives none.
    pub sd: Option<f64>,
    /// What part of its distance at rest is taken for an offset.
    pub offset_part: f64,
    /// Its column in the recording.
    pub column: usize,
}

impl Marker {
    /// An offset of the standard deviation s, of which the mean of n neutral frames, with the noise e = sd / sqrt(n), tells all but
    /// s e / sqrt(s^2 + e^2):
    ///   o = s^2 / (s^2 + e^2) (z - x),  sd'^2 = sd^2 + s^2 e^2 / (s^2 + e^2), or sd^2 + s^2 where none of them shows it.
    /// The rest of it is one error for all frames; each frame counts it as its own.
    fn with_offset(&mut self, s: f64, seen: usize) {
        let noise = self.sd.map_or(0.0, |sd| sd * sd / seen.max(1) as f64);
        let part = if seen > 0 { s * s / (s * s + noise) } else { 0.0 };
        let left = if seen > 0 { part * noise } else { s * s };
        self.sd = self.sd.map(|sd| (sd * sd + left).sqrt());
        self.offset_part = part;
    }
}

/// Places the markers of a scene on the surface of the host and finds them in the recording.
///
/// # Errors
/// All mistakes at once: markers far from the surface, markers that the recording does not have.
pub fn place(scene: &Scene, fit: &FitSpec, mesh: &Mesh, recording: &Recording) -> Result<Vec<Marker>> {
    let surface = Surface::new(mesh);
    let mut markers = Vec::new();
    let mut mistakes = Vec::new();
    for spec in &scene.markers {
        let column = recording.labels.iter().position(|label| *label == spec.label);
        if column.is_none() {
            mistakes.push(unknown_label(&spec.label, &recording.labels, &spec.place));
        }
        let Some(foot) = surface.project(spec.position_mm) else { continue };
        if foot.distance > fit.max_marker_distance_mm {
            mistakes.push(Error::MarkerFarFromSurface {
                name: spec.name.as_str().into(),
                distance: foot.distance,
                limit: fit.max_marker_distance_mm,
                foot: mesh.position(foot.point),
                place: Box::new(spec.place.clone()),
            });
        } else if let Some(column) = column {
            let sd = spec.sd_mm.or(fit.sd_mm);
            let name = spec.name.clone();
            let (point, distance) = (foot.point, foot.distance);
            markers.push(Marker { name, point, distance, sd, offset_part: 0.0, column });
        }
    }
    if let Some(prior) = fit.registration.offset_sd_mm.filter(|_| mistakes.is_empty()) {
        let neutral = neutral_frames(fit, &markers, recording)?;
        for marker in &mut markers {
            let shown = neutral.iter().filter_map(|frame| recording.frames.get(*frame)?.positions_mm[marker.column]);
            marker.with_offset(prior, shown.count());
        }
    }
    if mistakes.is_empty() { Ok(markers) } else { Err(Error::all(mistakes)) }
}

/// The error of a label that the recording does not have.
pub(super) fn unknown_label(name: &str, labels: &[String], place: &Place) -> Error {
    const SHOWN: usize = 12;
    let mut list = labels.iter().take(SHOWN).map(|l| format!("`{l}`")).collect::<Vec<_>>().join(", ");
    if labels.len() > SHOWN {
        list.push_str(&format!(" and {} more", labels.len() - SHOWN));
    }
    let nearest = labels
        .iter()
        // in one case, so that `lip.left` is nearer to `lip.L` than to `lip.R`
        .map(|label| (strsim::jaro_winkler(&name.to_lowercase(), &label.to_lowercase()), label))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, label)| label.as_str().into());
    Error::UnknownLabel { name: name.into(), labels: list.into(), nearest, place: Box::new(place.clone()) }
}

/// Compares the size of the marker cloud in the recording with the model's, in the neutral frames.
///
/// # Errors
/// As [`units_against`].
pub fn check_units(markers: &[Marker], mesh: &Mesh, recording: &Recording, fit: &FitSpec) -> Result<()> {
    let rest = at_rest(fit, recording, &neutral_frames(fit, markers, recording)?);
    let pair = |m: &Marker| rest[m.column].map(|z| (z, mesh.position(m.point)));
    let pairs: Vec<Pair> = markers.iter().filter_map(pair).collect();
    // a size that was estimated has been brought to the model's by now
    units_against(&pairs, fit.units.unwrap_or(Units::Mm), fit)
}

/// Compares the sizes of the two sides of pairs of (recording, model): a ratio far from one is a wrong unit. The size is the
/// root mean square distance from the centre.
///
/// # Errors
/// [`Error::UnitsLookWrong`].
pub fn units_against(pairs: &[Pair], units: Units, fit: &FitSpec) -> Result<()> {
    if pairs.len() < 2 {
        return Ok(());
    }
    let size = |points: Vec<[f64; 3]>| spread(&points);
    let ratio = size(pairs.iter().map(|p| p.0).collect()) / size(pairs.iter().map(|p| p.1).collect());
    size_against(ratio, pairs.len(), units, fit)
}

/// Whether a recording of so many labels is `ratio` times the size of the model because its units are wrong.
///
/// # Errors
/// [`Error::UnitsLookWrong`].
pub(super) fn size_against(ratio: f64, labels: usize, units: Units, fit: &FitSpec) -> Result<()> {
    // a body does not grow or shrink threefold, and no two units lie closer
    if !ratio.is_finite() || (1.0 / 3.0..3.0).contains(&ratio) {
        return Ok(());
    }
    // the unit u for which ratio / in_mm(declared) x in_mm(u) is nearest to one
    let off = |other: Units| (ratio / units.mm() * other.mm()).log10().abs();
    let likely = Units::ALL.into_iter().min_by(|a, b| off(*a).total_cmp(&off(*b)));
    Err(Error::UnitsLookWrong {
        ratio,
        labels,
        declared: units.name(),
        // a unit that leaves the sizes more than twofold apart explains nothing
        likely: likely.filter(|likely| off(*likely) < 0.3).map(Units::name),
        place: Box::new(fit.units_place.clone()),
    })
}
