//! What is in the folder of a run, in a few lines.

use super::{sheets, status};
use crate::error::Result;
use crate::report::Manifest;
use crate::report::export::Format;
use crate::report::manifest::Numerics;
use crate::report::status::Status;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// What a folder holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contents {
    /// The folder.
    pub path: PathBuf,
    /// How the run ended.
    #[serde(flatten)]
    pub status: Status,
    /// Size of the problem; `None` where the task has no model, or it was not known yet.
    pub numerics: Option<Numerics>,
    /// First and last time, s; `None` without frames.
    pub time_s: Option<[f64; 2]>,
    /// Of every control its least and greatest value, and the frame of the latter.
    pub controls: BTreeMap<String, Peak>,
    /// Markers with their root mean square and largest residual, mm.
    pub markers: BTreeMap<String, Residual>,
    /// Frames whose shape was kept.
    pub shapes: usize,
    /// Rows of every table.
    pub tables: BTreeMap<String, usize>,
    /// All files, bytes.
    pub bytes: u64,
}

/// The range of a control.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Peak {
    /// The least value.
    pub least: f64,
    /// The greatest.
    pub greatest: f64,
    /// Its frame.
    pub frame: usize,
}

/// How far the model is from a marker.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Residual {
    /// Frames in which it was measured.
    pub measured: usize,
    /// Root mean square, mm.
    pub rms_mm: f64,
    /// Largest, mm.
    pub max_mm: f64,
}

impl Contents {
    /// Looks into a folder: a run of any task.
    ///
    /// # Errors
    /// [`Error::NotARun`](crate::Error::NotARun), [`Error::DamagedRun`](crate::Error::DamagedRun),
    /// [`Error::Io`](crate::Error::Io).
    pub fn of(folder: &Path) -> Result<Contents> {
        let status = status(folder)?;
        let numerics = Numerics::deserialize(&Manifest::read(folder)?["numerics"]).ok();
        let tables = sheets(folder)?;
        let (mut time_s, mut controls, mut markers) = (None, BTreeMap::new(), BTreeMap::new());
        if let Some(sheet) = tables.get("activations").filter(|sheet| !sheet.is_empty()) {
            let (frame, time) = (sheet.column("frame")?, sheet.column("time_s")?);
            time_s = Some([sheet.known(0, time)?, sheet.known(sheet.len() - 1, time)?]);
            for (column, name) in
                sheet.columns().iter().enumerate().skip(2).filter(|(_, name)| !name.ends_with("_sd"))
            {
                let mut peak = Peak { least: f64::INFINITY, greatest: f64::NEG_INFINITY, frame: 0 };
                for row in 0..sheet.len() {
                    let value = sheet.known(row, column)?;
                    peak.least = peak.least.min(value);
                    if value > peak.greatest {
                        (peak.greatest, peak.frame) = (value, sheet.count(row, frame)?);
                    }
                }
                controls.insert(name.clone(), peak);
            }
        }
        if let Some(sheet) = tables.get("markers") {
            let (name, distance) = (sheet.column("name")?, sheet.column("distance_mm")?);
            for row in 0..sheet.len() {
                let none = Residual { measured: 0, rms_mm: 0.0, max_mm: 0.0 };
                let own = markers.entry(sheet.text(row, name).to_owned()).or_insert(none);
                if let Some(distance) = sheet.number(row, distance)? {
                    // a sum of squares until the end
                    own.rms_mm += distance * distance;
                    own.measured += 1;
                    own.max_mm = own.max_mm.max(distance);
                }
            }
            markers.values_mut().for_each(|own| own.rms_mm = (own.rms_mm / own.measured.max(1) as f64).sqrt());
        }
        let mut seen = Seen::default();
        seen.folder(folder);
        Ok(Contents {
            path: folder.into(),
            status,
            numerics,
            time_s,
            controls,
            markers,
            shapes: seen.shapes,
            tables: tables.into_iter().map(|(name, sheet)| (name, sheet.len())).collect(),
            bytes: seen.bytes,
        })
    }
}

#[derive(Default)]
struct Seen {
    bytes: u64,
    shapes: usize,
}

impl Seen {
    fn folder(&mut self, folder: &Path) {
        // what cannot be read is not counted
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            match entry.metadata() {
                Ok(data) if data.is_dir() => self.folder(&entry.path()),
                Ok(data) => {
                    self.bytes += data.len();
                    let in_view = folder.file_name().is_some_and(|folder| folder == "view");
                    self.shapes += usize::from(in_view && name.starts_with("result_") && name.ends_with(".exf"));
                }
                Err(_) => {}
            }
        }
    }
}

impl fmt::Display for Contents {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Status { status, frames_ok, frames_failed, warnings, error, exit: _ } = &self.status;
        let word = serde_json::to_value(status).ok().and_then(|word| word.as_str().map(str::to_owned));
        write!(out, "{}: {}", self.path.display(), word.unwrap_or_default())?;
        writeln!(out, ", {frames_ok} frames, {:.1} MB", self.bytes as f64 / 1e6)?;
        if let Some(Numerics { elements, nodes, muscles, unknowns, .. }) = self.numerics {
            writeln!(out, "model: {elements} elements, {nodes} nodes, {unknowns} unknowns, {muscles} muscles")?;
        }
        if let Some([first, last]) = self.time_s {
            writeln!(out, "time: {first:.3} to {last:.3} s")?;
        }
        for failed in frames_failed {
            writeln!(
                out,
                "frame {} failed: {} {}",
                failed.frame,
                failed.code,
                failed.message.lines().next().unwrap_or_default()
            )?;
        }
        if let Some(error) = error {
            writeln!(out, "ended by {}: {}", error.code, error.message)?;
        }
        if !warnings.is_empty() {
            writeln!(out, "{} warnings, in status.json", warnings.len())?;
        }
        if !self.controls.is_empty() {
            writeln!(out, "controls                          least    greatest  in frame")?;
            for (name, Peak { least, greatest, frame }) in &self.controls {
                writeln!(out, "  {name:<30} {least:>8.4} {greatest:>11.4} {frame:>9}")?;
            }
        }
        if !self.markers.is_empty() {
            writeln!(out, "markers                          rms mm      max mm  measured")?;
            for (name, Residual { measured, rms_mm, max_mm }) in &self.markers {
                writeln!(out, "  {name:<30} {rms_mm:>8.3} {max_mm:>11.3} {measured:>9}")?;
            }
        }
        let tables = self.tables.iter().map(|(name, rows)| format!("{name} ({rows})"));
        writeln!(out, "tables, with rows: {}", tables.collect::<Vec<_>>().join(", "))?;
        if self.shapes == 0 {
            return writeln!(out, "no shapes were kept: --to sto,parquet is all that can be exported");
        }
        writeln!(out, "shapes: {} frames", self.shapes)?;
        writeln!(
            out,
            "risorius export {} --to {}",
            self.path.display(),
            Format::ALL.map(|(_, word, _)| word).join(",")
        )
    }
}
