//! Markers on the model: from a name and a position in the problem to a material point and a label of the recording.

use crate::error::{Error, Place, Result};
use crate::markers::Recording;
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
    /// Standard deviation of its measured coordinates, mm; `None` where the problem gives none.
    pub sd: Option<f64>,
    /// Its column in the recording.
    pub column: usize,
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
        let column = recording.labels.iter().position(|label| *label == spec.name);
        if column.is_none() {
            mistakes.push(unknown_label(&spec.name, &recording.labels, &spec.place));
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
            markers.push(Marker { name, point: foot.point, distance: foot.distance, sd, column });
        }
    }
    if mistakes.is_empty() { Ok(markers) } else { Err(Error::all(mistakes)) }
}

fn unknown_label(name: &str, labels: &[String], place: &Place) -> Error {
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

/// Compares the size of the marker cloud in the recording with the model's: a ratio near a power of ten that another unit
/// explains is an error. The size is the root mean square distance from the centre over the markers that are present.
///
/// # Errors
/// [`Error::UnitsLookWrong`].
pub fn check_units(markers: &[Marker], mesh: &Mesh, recording: &Recording, fit: &FitSpec) -> Result<()> {
    let model: Vec<[f64; 3]> = markers.iter().map(|m| mesh.position(m.point)).collect();
    // the frame that shows the most markers
    let present =
        |k: &usize| markers.iter().filter(|m| recording.frames[*k].positions_mm[m.column].is_some()).count();
    let Some(best) = (0..recording.frames.len()).rev().max_by_key(present) else { return Ok(()) };
    let pairs: Vec<([f64; 3], [f64; 3])> = markers
        .iter()
        .zip(model)
        .filter_map(|(m, x)| recording.frames[best].positions_mm[m.column].map(|z| (x, z)))
        .collect();
    if pairs.len() < 2 {
        return Ok(());
    }
    let ratio = spread(pairs.iter().map(|p| p.1)) / spread(pairs.iter().map(|p| p.0));
    // a body does not grow or shrink threefold, and no two units lie closer
    if !ratio.is_finite() || (1.0 / 3.0..3.0).contains(&ratio) {
        return Ok(());
    }
    // the unit u for which ratio / in_mm(declared) x in_mm(u) is nearest to one
    let off = |units: Units| (ratio / fit.units.mm() * units.mm()).log10().abs();
    let likely = [Units::Mm, Units::Cm, Units::M].into_iter().min_by(|a, b| off(*a).total_cmp(&off(*b)));
    Err(Error::UnitsLookWrong {
        ratio,
        labels: pairs.len(),
        declared: fit.units.name(),
        likely: likely.unwrap_or(fit.units).name(),
        place: Box::new(fit.units_place.clone()),
    })
}

fn spread(points: impl Iterator<Item = [f64; 3]> + Clone) -> f64 {
    let count = points.clone().count() as f64;
    let mut centre = [0.0; 3];
    for p in points.clone() {
        for (c, p) in centre.iter_mut().zip(p) {
            *c += p / count;
        }
    }
    let square = |p: [f64; 3]| -> f64 { p.iter().zip(centre).map(|(p, c)| (p - c) * (p - c)).sum() };
    (points.map(square).sum::<f64>() / count).sqrt()
}
