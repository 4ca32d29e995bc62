//! What the tables of a run say, frame by frame.

use super::sheet::Sheet;
use crate::error::Result;
use crate::math::normal::TWO_SIDED_95;
use crate::math::tensor::{Vector, norm, subtract};
use crate::report::frame::Frame;
use crate::scene::{ControlKind, ControlRange, Scene};
use std::path::Path;

/// An activation, or the pose of a bone, over the frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: ControlKind,
    /// Smallest and greatest admissible value.
    pub range: [f64; 2],
    /// One per frame.
    pub values: Vec<f64>,
    /// The interval that holds the truth with 95 %, as far as noise tells: of a fit, where it is known.
    pub intervals: Vec<Option<[f64; 2]>>,
}

/// A marker over the frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Its name.
    pub name: String,
    /// One per frame.
    pub samples: Vec<Sample>,
}

/// A marker in a frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Where the model has it.
    pub model: Vector,
    /// Where it was measured.
    pub measured: Option<Vector>,
}

/// What a frame took.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Steps of the path to it; of a fit, of its last equilibrium.
    pub steps: usize,
    /// Newton iterations of these.
    pub iterations: usize,
    /// The residual it ended with, mN.
    pub residual_mn: f64,
    /// What it may be, mN.
    pub required_mn: f64,
}

impl Control {
    /// Its name with its unit, if it has one: as tables of what the markers tell call it.
    pub fn label(&self) -> String {
        format!("{} {}", self.name, self.kind.unit()).trim_end().to_owned()
    }
}

impl Sample {
    /// Distance between model and measurement, mm.
    pub fn distance(&self) -> Option<f64> {
        self.measured.map(|measured| norm(subtract(measured, self.model)))
    }
}

pub(super) fn frames(activations: &Sheet) -> Result<Vec<Frame>> {
    let (frame, time) = (activations.column("frame")?, activations.column("time_s")?);
    let row = |row| Ok(Frame { index: activations.count(row, frame)?, time_s: activations.known(row, time)? });
    (0..activations.len()).map(row).collect()
}

/// Every column that is neither the frame nor a deviation. Intervals come from `identifiability.csv` where there is one, else
/// from the deviations, kept within the range.
pub(super) fn controls(activations: &Sheet, scene: &Scene, tables: &Path) -> Result<Vec<Control>> {
    let ranges = scene.control_ranges();
    let names: Vec<&String> = activations.columns().iter().skip(2).collect();
    let is_deviation =
        |name: &str| name.strip_suffix("_sd").is_some_and(|own| names.iter().any(|other| *other == own));
    let told = Sheet::find(tables, "identifiability")?;
    let mut controls = Vec::new();
    for name in names.iter().filter(|name| !is_deviation(name)) {
        let range = ranges.iter().find(|range| range.name == **name).cloned();
        let ControlRange { kind, lower, upper, .. } = range.unwrap_or_else(|| ControlRange::activation(name));
        let column = activations.column(name)?;
        let values =
            (0..activations.len()).map(|row| activations.known(row, column)).collect::<Result<Vec<f64>>>()?;
        let mut intervals = vec![None; values.len()];
        if let Ok(column) = activations.column(&format!("{name}_sd")) {
            for (row, interval) in intervals.iter_mut().enumerate() {
                let half = activations.number(row, column)?.map(|sd| TWO_SIDED_95 * sd);
                *interval =
                    half.map(|half| [values[row] - half, values[row] + half].map(|end| end.clamp(lower, upper)));
            }
        }
        controls.push(Control { name: (*name).clone(), kind, range: [lower, upper], values, intervals });
    }
    if let Some(told) = told {
        refine(&told, &frames(activations)?, &mut controls)?;
    }
    Ok(controls)
}

/// Intervals as the table of what the markers tell has them.
fn refine(told: &Sheet, frames: &[Frame], controls: &mut [Control]) -> Result<()> {
    let [frame, name, lower, upper] =
        [told.column("frame")?, told.column("control")?, told.column("lower_95")?, told.column("upper_95")?];
    for row in 0..told.len() {
        let index = told.count(row, frame)?;
        let at = frames.iter().position(|known| known.index == index);
        let control = controls.iter_mut().find(|control| control.label() == told.text(row, name));
        if let (Some(at), Some(control)) = (at, control) {
            let ends = told.number(row, lower)?.zip(told.number(row, upper)?);
            control.intervals[at] = ends.map(|(lower, upper)| [lower, upper]).or(control.intervals[at]);
        }
    }
    Ok(())
}

pub(super) fn markers(sheet: &Sheet, frames: &[Frame]) -> Result<Vec<Marker>> {
    let column = |name: &str| sheet.column(name);
    let (frame, name) = (column("frame")?, column("name")?);
    let model = [column("x_mm")?, column("y_mm")?, column("z_mm")?];
    let measured = [column("measured_x_mm")?, column("measured_y_mm")?, column("measured_z_mm")?];
    let mut markers: Vec<Marker> = Vec::new();
    for row in 0..sheet.len() {
        let index = sheet.count(row, frame)?;
        // activations come last: a run that was killed may have written the markers of a frame without them
        if !frames.iter().any(|known| known.index == index) {
            continue;
        }
        let [x, y, z] = model;
        let model = [sheet.known(row, x)?, sheet.known(row, y)?, sheet.known(row, z)?];
        let [x, y, z] = measured;
        let measured = match (sheet.finite(row, x)?, sheet.finite(row, y)?, sheet.finite(row, z)?) {
            (Some(x), Some(y), Some(z)) => Some([x, y, z]),
            _ => None,
        };
        let own = sheet.text(row, name);
        let at = markers.iter().position(|marker| marker.name == own).unwrap_or_else(|| {
            markers.push(Marker { name: own.to_owned(), samples: Vec::new() });
            markers.len() - 1
        });
        markers[at].samples.push(Sample { model, measured });
    }
    match markers.iter().find(|marker| marker.samples.len() != frames.len()) {
        None => Ok(markers),
        Some(marker) => {
            let (name, rows) = (&marker.name, marker.samples.len());
            Err(sheet.damaged(format!("marker `{name}` has {rows} rows for {} frames", frames.len())))
        }
    }
}

pub(super) fn effort(sheet: &Sheet, frames: &[Frame]) -> Result<Vec<Effort>> {
    let column = |name: &str| sheet.column(name);
    let (frame, iteration) = (column("frame")?, column("iteration")?);
    let (residual, required) = (column("residual_mn")?, column("required_mn")?);
    let mut all = vec![Effort::default(); frames.len()];
    for row in 0..sheet.len() {
        let index = sheet.count(row, frame)?;
        let Some(at) = frames.iter().position(|known| known.index == index) else { continue };
        let own = &mut all[at];
        // the last row of a step has the number of its iterations
        match sheet.count(row, iteration)? {
            0 => own.steps += 1,
            _ => own.iterations += 1,
        }
        own.residual_mn = sheet.number(row, residual)?.unwrap_or(f64::NAN);
        own.required_mn = sheet.number(row, required)?.unwrap_or(f64::NAN);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables of what the markers tell call the pose of a bone by its name and unit.
    #[test]
    fn intervals_of_bones_are_found() {
        let text = "[task]\nkind = \"forward\"\n[mesh]\nblock = { origin_mm = [0, 0, 0], size_mm = [10, 10, 10], elements = [1, 1, 1] }\n\
                    [tissue]\nneo-hookean = { mu_kpa = 1 }\n[[bone]]\nname = \"jaw\"\n\
                    hinge = { axis = [0, 1, 0], through_mm = [0, 0, 0], bounds_deg = [0, 35] }\n\
                    [[support]]\nclamp = { face = \"xi1=0\", bone = \"jaw\" }\n";
        let scene = Scene::parse(text, "jaw.toml", Path::new("."), &[]).expect("a scene");
        let sheet = |name: &str, text: &str| Sheet::parse(name.into(), text).expect("a table");
        let activations = sheet("activations", "frame,time_s,jaw.hinge,jaw.hinge_sd\n4,0.1,3.0,1.0\n");
        let mut found = controls(&activations, &scene, Path::new("nowhere")).expect("controls");
        assert_eq!(found.len(), 1);
        let [low, high] = found[0].intervals[0].expect("from the deviation");
        assert!((low - 1.04).abs() < 1e-3 && (high - 4.96).abs() < 1e-3, "{low} {high}");
        let told = sheet("told", "frame,control,lower_95,upper_95\n4,jaw.hinge deg,2.5,3.75\n5,jaw.hinge deg,0,1\n");
        refine(&told, &frames(&activations).expect("frames"), &mut found).expect("refined");
        assert_eq!(found[0].intervals, [Some([2.5, 3.75])]);
    }
}
