//! What others open. FAMILY: each format in a file of its own, made from a [`Playback`], or from tables and files as they are.

pub mod exf;
pub mod glb;
pub mod inspect;
pub mod mcap;
pub mod modes;
pub mod obj;
pub mod parquet;
pub mod ply;
pub mod sto;
pub mod vtu;

use super::playback::{Activity, Playback, Shape};
use super::run_folder::{failed, write_atomically};
use crate::error::{Error, Result, Warning};
use std::path::{Path, PathBuf};

/// A format to export to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// Skin, muscles, deformation modes and activation curves for Blender and game engines.
    Glb,
    /// Everything over time for Foxglove, Lichtblick and Rerun.
    Mcap,
    /// Activations for OpenSim.
    Sto,
    /// The exact shape for Zinc and cmgui, a file per frame.
    Exf,
    /// Skin and muscles of one frame.
    Obj,
    /// The skin of one frame with its displacement.
    Ply,
    /// The tables of a run of any task, with types.
    Parquet,
    /// The shapes for ParaView, exact and linear.
    Vtu,
}

impl Format {
    /// All of them, with their words and what they are for.
    pub const ALL: [(Format, &'static str, &'static str); 8] = [
        (Format::Glb, "glb", "Blender and game engines: skin, muscles, deformation modes, activation curves"),
        (Format::Mcap, "mcap", "Foxglove, Lichtblick, Rerun: everything over time, with a layout"),
        (Format::Sto, "sto", "OpenSim: activations"),
        (Format::Exf, "exf", "Zinc and cmgui: the exact shape, a file per frame"),
        (Format::Obj, "obj", "anything that reads meshes: skin and muscles of one frame"),
        (Format::Ply, "ply", "the skin of one frame with its displacement"),
        (Format::Parquet, "parquet", "pandas, R, DuckDB: every table with its types, of a study or of fibres too"),
        (Format::Vtu, "vtu", "ParaView: the exact shape and the linear one, as they are in the run's view"),
    ];
}

/// What was written, and what is to be known about it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Exported {
    /// The files.
    pub files: Vec<PathBuf>,
    /// What their reader must know.
    pub warnings: Vec<Warning>,
}

impl Exported {
    fn write(&mut self, path: PathBuf, contents: impl AsRef<[u8]>) -> Result<()> {
        write_atomically(&path, contents.as_ref())?;
        self.files.push(path);
        Ok(())
    }
}

/// Writes the run in the folder `run` into `folder` in some formats; files of the same name are replaced. `frame` chooses the
/// one that formats of a single frame show: by default that which moved most.
///
/// # Errors
/// [`Error::NotARun`], [`Error::DamagedRun`], [`Error::NoShapes`], [`Error::NoSuchShape`], [`Error::Io`].
pub fn export(run: &Path, formats: &[Format], frame: Option<usize>, folder: &Path) -> Result<Exported> {
    std::fs::create_dir_all(folder).map_err(failed("create", folder))?;
    let mut done = Exported::default();
    let mut of_shapes = Vec::new();
    for format in formats {
        match format {
            Format::Sto => done.write(folder.join("activations.sto"), sto::text(&Activity::read(run)?))?,
            Format::Exf => exf::copy(&Activity::read(run)?, folder, &mut done)?,
            Format::Vtu => vtu::copy(&Activity::read(run)?, folder, &mut done)?,
            // tables are there whatever the task
            Format::Parquet => parquet::write(run, folder, &mut done)?,
            Format::Glb | Format::Mcap | Format::Obj | Format::Ply => of_shapes.push(*format),
        }
    }
    // reading shapes takes nearly all of the time: once, and only for what is made from them
    if !of_shapes.is_empty() {
        show(&Playback::read(run)?, &of_shapes, frame, folder, &mut done)?;
    }
    Ok(done)
}

/// Writes the formats that are made from a [`Playback`].
fn show(run: &Playback, formats: &[Format], frame: Option<usize>, folder: &Path, done: &mut Exported) -> Result<()> {
    for format in formats {
        match format {
            Format::Glb => done.write(folder.join("result.glb"), glb::file(run)?)?,
            Format::Mcap => mcap::write(run, folder, done)?,
            Format::Obj => {
                let shape = chosen(run, frame)?;
                done.write(folder.join(format!("frame_{:04}.obj", shape.frame.index)), obj::text(run, shape))?;
            }
            Format::Ply => {
                let shape = chosen(run, frame)?;
                done.write(folder.join(format!("frame_{:04}.ply", shape.frame.index)), ply::file(run, shape))?;
            }
            Format::Sto | Format::Exf | Format::Vtu | Format::Parquet => {}
        }
    }
    Ok(())
}

/// The shape of a frame, or that which moved most.
fn chosen(run: &Playback, frame: Option<usize>) -> Result<&Shape> {
    let shapes = run.shown()?;
    match frame {
        None => Ok(run.farthest().unwrap_or(&shapes[0])),
        Some(frame) => shapes.iter().find(|shape| shape.frame.index == frame).ok_or_else(|| {
            let kept: Vec<String> = shapes.iter().map(|shape| shape.frame.index.to_string()).collect();
            Error::NoSuchShape { path: run.folder.clone(), frame, kept: kept.join(", ").into() }
        }),
    }
}
