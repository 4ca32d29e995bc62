//! `risorius advise`: which further markers would tell more of the controls.

use super::prepare::{Clip, prepare};
use super::problem::Source;
use super::progress::Meter;
use super::scout::new_marker_sd;
use super::terminal::print;
use super::{Ending, Flags};
use crate::error::{Error, Result};
use crate::fit::Fit;
use crate::fit::advise::{Advice, Criterion, View, advise, candidates};
use crate::fit::identifiability::Evidence;
use crate::math::tensor::Vector;
use crate::report::run_folder::write_atomically;
use crate::report::tables::advice_table;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Frames that are looked at, evenly spaced over the clip.
const FRAMES: usize = 24;
/// Controls shown for each marker.
const SHOWN: usize = 3;

/// What is asked.
pub(super) struct Question<'a> {
    /// A problem file, or the folder of a fit that was run.
    pub path: &'a Path,
    pub markers: usize,
    pub criterion: Criterion,
    pub apart_mm: f64,
    pub json: bool,
}

pub(super) fn run(question: &Question<'_>, flags: &Flags) -> Result<Ending> {
    let folder = question.path.is_dir().then_some(question.path);
    let file = folder.map_or_else(|| question.path.to_path_buf(), |folder| folder.join("problem.lock.toml"));
    let source = Source::read(Some(&file), flags)?;
    let prepared = prepare(&source)?;
    flags.warn(&prepared.warnings);
    let (Some(Clip { recording, frames, .. }), Some(spec)) = (&prepared.clip, &source.scene.fit) else {
        return Err(Error::NotAFit { path: file });
    };
    let model = &prepared.built.model;
    let fitted =
        folder.map(|folder| fitted(&folder.join("tables/activations.csv"), model.controls().len())).transpose()?;
    let mut fit = Fit::new(model, &source.scene, spec, recording)?;
    // frames to look at, with the controls where they are known
    let all: Vec<(usize, Option<Vec<f64>>)> = match fitted {
        Some(fitted) => fitted.into_iter().map(|(frame, controls)| (frame, Some(controls))).collect(),
        None => frames.iter().map(|frame| (*frame, None)).collect(),
    };
    let all = evenly(all, FRAMES);

    let points = candidates(model.mesh());
    let positions: Vec<Vector> = points.iter().map(|point| model.mesh().position(*point)).collect();
    let taken: Vec<Vector> = fit.markers().iter().map(|marker| model.mesh().position(marker.point)).collect();
    let sd = new_marker_sd(&fit);
    let mut meter = Meter::new(flags, all.len(), None);
    let mut views = Vec::new();
    for (frame, controls) in &all {
        let estimate = match controls {
            Some(controls) => fit.at(recording, *frame, fit.unknowns().iter().map(|k| controls[*k]).collect()),
            None => fit.frame(recording, *frame),
        };
        match estimate {
            Ok(estimate) => {
                let evidence = Evidence::of(&estimate, model.controls(), fit.unknowns());
                let rates = fit.rates_at(&points, &estimate.equilibrium.state);
                views.extend(evidence.zip(rates).map(|(evidence, rates)| View::new(&evidence, &rates, sd)));
                meter.frame(&format!("frame {frame}: rms {:.3} mm", estimate.rms_mm), &[]);
            }
            Err(error) => {
                meter.fail(&error, flags);
                meter.frame(&format!("frame {frame}: failed"), &[]);
            }
        }
    }
    meter.finish();
    let seen = views.len();
    let advice = advise(views, &positions, &taken, (question.criterion, question.markers, question.apart_mm));
    let names: Vec<&str> = model.controls().iter().map(|control| control.name.as_str()).collect();
    let told = Told { advice: &advice, positions: &positions, names: &names, frames: seen, sd_mm: sd };
    if let Some(folder) = folder {
        write_atomically(&folder.join("tables/advice.csv"), told.table().as_bytes())?;
    }
    print(&if question.json { told.json(question.criterion) } else { told.page(question.criterion) })?;
    Ok(if seen == 0 { Ending::NotConverged } else { Ending::Ok })
}

/// What is printed.
struct Told<'a> {
    advice: &'a [Advice],
    positions: &'a [Vector],
    names: &'a [&'a str],
    frames: usize,
    sd_mm: f64,
}

impl Told<'_> {
    fn page(&self, criterion: Criterion) -> String {
        let what = match criterion {
            Criterion::D => "makes the volume of the controls' error smallest",
            Criterion::A => "makes the sum of the controls' variances smallest",
        };
        let mut page = format!("over {} frames, the marker that {what}, then the next:\n", self.frames);
        if self.advice.is_empty() {
            page += "  none: no free place on the surface would tell more\n";
        }
        for (number, advice) in self.advice.iter().enumerate() {
            let [x, y, z] = self.positions[advice.candidate];
            let effects = advice
                .effects
                .iter()
                .take(SHOWN)
                .map(|(k, before, after)| format!("{} {} to {}", self.names[*k], short(*before), short(*after)));
            let effects: Vec<String> = effects.collect();
            page += &format!("  {}. ({x:.1}, {y:.1}, {z:.1}) mm   sd of {}\n", number + 1, effects.join(", "));
        }
        if let Some(first) = self.advice.first() {
            let [x, y, z] = self.positions[first.candidate];
            page += &format!(
                "add the first, for example:\n[[marker]]\nname = \"...\"\nposition_mm = [{x:.2}, {y:.2}, {z:.2}]\n"
            );
        }
        page
    }

    fn table(&self) -> String {
        let rows =
            self.advice.iter().map(|advice| (self.positions[advice.candidate], advice.gain, &advice.effects[..]));
        advice_table(rows, self.names)
    }

    fn json(&self, criterion: Criterion) -> String {
        let markers: Vec<_> = self
            .advice
            .iter()
            .map(|advice| {
                let effects = advice.effects.iter().map(
                    |(k, before, after)| json!({ "control": self.names[*k], "sd_before": before, "sd_after": after }),
                );
                json!({
                    "position_mm": self.positions[advice.candidate],
                    "gain": advice.gain,
                    "controls": effects.collect::<Vec<_>>(),
                })
            })
            .collect();
        let criterion = match criterion {
            Criterion::D => "d",
            Criterion::A => "a",
        };
        let all = json!({ "criterion": criterion, "frames": self.frames, "sd_mm": self.sd_mm, "markers": markers });
        format!("{all:#}\n")
    }
}

/// The frames of a fit that was run, with all controls in the order of the model.
fn fitted(path: &Path, controls: usize) -> Result<Vec<(usize, Vec<f64>)>> {
    let io = |source| Error::Io { action: "read", path: PathBuf::from(path), source };
    let text = std::fs::read_to_string(path).map_err(io)?;
    let row = |line: &str| {
        let mut cells = line.split(',');
        let frame = cells.next()?.parse().ok()?;
        let values: Option<Vec<f64>> = cells.skip(1).take(controls).map(|cell| cell.parse().ok()).collect();
        values.filter(|values| values.len() == controls).map(|values| (frame, values))
    };
    let rows: Option<Vec<_>> = text.lines().skip(1).map(row).collect();
    rows.ok_or_else(|| {
        io(std::io::Error::new(std::io::ErrorKind::InvalidData, "it is no table of activations of this problem"))
    })
}

/// At most `most` of them, evenly spaced.
fn evenly<T>(all: Vec<T>, most: usize) -> Vec<T> {
    let step = all.len().div_ceil(most).max(1);
    all.into_iter().step_by(step).collect()
}

fn short(sd: f64) -> String {
    if sd < 1e-3 { format!("{sd:.1e}") } else { format!("{sd:.4}") }
}
