//! `risorius markers convert IN OUT.mcap` and `risorius markers match problem.toml`.

use super::problem::Source;
use super::terminal::{print, tell};
use super::{Ending, Flags};
use crate::error::{Error, Place, Result, Warning};
use crate::fit::registration::{Proposal, propose};
use crate::markers::{self, ReadOptions, WriteOptions, write_json};
use crate::model::build::host;
use crate::scene::{Scene, Units};
use std::path::Path;

/// Writes the markers of a file as MCAP, in millimetres.
pub(super) fn convert(
    input: &Path,
    output: &Path,
    units: Option<Units>,
    topic: Option<&str>,
    flags: &Flags,
) -> Result<Ending> {
    if output.exists() && !flags.force {
        return Err(Error::FileExists { path: output.into() });
    }
    let topic = topic.map(str::to_owned);
    let mut recording = markers::read(input, &ReadOptions { topic: topic.clone(), ..ReadOptions::default() })?;
    let declared = &recording.source.units_declared;
    let known = match &declared[..] {
        [unit] => Units::from_name(unit),
        _ => None,
    };
    let units =
        units.or(known).ok_or_else(|| Error::NoUnits { path: input.into(), declared: declared.join(", ").into() })?;
    if units != Units::Mm {
        recording = markers::read(input, &ReadOptions { topic, units, ..ReadOptions::default() })?;
    }
    let warnings = super::problem::recording_warnings(&recording);
    flags.warn(&warnings);
    write_json(output, &recording.labels, &recording.frames, &WriteOptions::default())?;
    print(&format!(
        "wrote {}: {} frames of {} markers over {:.3} s, read from {} in {units}, in millimetres\n",
        output.display(),
        recording.frames.len(),
        recording.labels.len(),
        recording.health.duration_s,
        recording.source.format
    ))?;
    Ok(if flags.strict && !warnings.is_empty() { Ending::Warned } else { Ending::Ok })
}

/// A proposal whose runner-up is no worse than this many times is not sure.
const UNSURE: f64 = 1.5;

/// Proposes the labels of the markers of a problem, as TOML to put in the place of its own.
pub(super) fn match_labels(path: &Path, flags: &Flags) -> Result<Ending> {
    let source = Source::read(Some(path), flags)?;
    let scene = &source.scene;
    let Some(fit) = scene.fit.as_ref().filter(|_| !scene.markers.is_empty()) else {
        let place = Place::whole(&path.display().to_string());
        return Err(Error::NothingToMatch { place: Box::new(place) });
    };
    let recording = source.recording(fit)?;
    let found = propose(scene, fit, &host(&scene.mesh)?, recording)?;
    let unsure = found.second_mm.filter(|second| *second < UNSURE * found.rms_mm);
    if let Some(second_mm) = unsure {
        flags.warn(&[Warning {
            code: "K016",
            message: format!(
                "another assignment of the labels fits nearly as well (rms {second_mm:.2} mm, this one {:.2} mm)",
                found.rms_mm
            ),
            place: None,
            help: Some("compare a few of them with a picture of the markers".into()),
        }]);
    }
    let (page, changed) = tables(scene, &found);
    print(&page)?;
    if !flags.quiet {
        tell(&format!(
            "frame {}: {} of {} markers matched with an rms of {:.3} mm; {changed} labels differ from the problem\n",
            found.frame,
            found.labels.iter().flatten().count(),
            scene.markers.len(),
            found.rms_mm
        ));
    }
    Ok(if flags.strict && unsure.is_some() { Ending::Warned } else { Ending::Ok })
}

/// The tables of the markers with their labels, and how many of those are new.
fn tables(scene: &Scene, found: &Proposal) -> (String, usize) {
    let mut page = String::new();
    let mut changed = 0;
    for (spec, proposed) in scene.markers.iter().zip(&found.labels) {
        let label = match proposed {
            Some((label, distance)) if *label == spec.label => format!("{label:?}    # {distance:.2} mm off"),
            Some((label, distance)) => {
                changed += 1;
                format!("{label:?}    # {distance:.2} mm off, was {:?}", spec.label)
            }
            None => format!("{:?}    # no label is left for it", spec.label),
        };
        let sd = spec.sd_mm.map(|sd_mm| format!("sd_mm = {sd_mm:?}\n")).unwrap_or_default();
        page += &format!(
            "[[marker]]\nname = {:?}\nlabel = {label}\nposition_mm = {:?}\n{sd}",
            spec.name, spec.position_mm
        );
    }
    (page, changed)
}
