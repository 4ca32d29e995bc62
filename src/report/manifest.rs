//! `manifest.json`: what was run, on what, from which inputs, and what it cost.

use super::machine;
use super::run_folder::{RunFolder, failed};
use super::status::write_json;
use crate::error::{Error, Result};
use crate::forward::Work;
use crate::model::Model;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The contents of `manifest.json`, written when a run begins and again when it ends. What is not known, or not yet, is `null`.
#[derive(Debug, Clone, Serialize)]
pub struct Manifest {
    /// Version of this crate.
    pub version: &'static str,
    /// Commit it was built from, if `RISORIUS_GIT` was set when it was.
    pub git: Option<&'static str>,
    /// The command line.
    pub command: Vec<String>,
    /// Files that were read.
    pub inputs: Vec<Input>,
    /// Threads of the solver.
    pub threads: usize,
    /// The machine.
    pub host: Host,
    /// Size of the problem.
    pub numerics: Option<Numerics>,
    /// Work done.
    pub work: Option<WorkDone>,
    /// Wall time of the run, s.
    pub wall_seconds: Option<f64>,
    /// Processor time of all threads, s.
    pub cpu_seconds: Option<f64>,
    /// Greatest memory held, bytes.
    pub peak_memory_bytes: Option<u64>,
}

/// A file that was read, with what tells it from any other.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// The path as it was used.
    pub path: PathBuf,
    /// Its length, bytes.
    pub bytes: u64,
    /// SHA-256 of its contents, hexadecimal.
    pub sha256: String,
}

/// The machine that ran.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Host {
    /// Operating system.
    pub os: &'static str,
    /// Architecture.
    pub arch: &'static str,
    /// Name of the processor.
    pub cpu: Option<String>,
}

/// Size of the discrete problem.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Numerics {
    /// Elements of the host.
    pub elements: usize,
    /// Its nodes.
    pub nodes: usize,
    /// Muscles in it.
    pub muscles: usize,
    /// Unknowns of the linear system, pressures included.
    pub unknowns: usize,
    /// Pressures among them.
    pub pressures: usize,
    /// Entries of the lower triangle of the tangent.
    pub tangent_entries: usize,
    /// Entries of its factor.
    pub factor_entries: usize,
    /// Operations of one factorisation.
    pub flops_per_factorisation: f64,
}

/// Counts and seconds of [`Work`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorkDone {
    /// Newton iterations.
    pub newton_iterations: usize,
    /// Steps of paths that failed and were cut.
    pub cuts: usize,
    /// Evaluations of energy and force.
    pub force_evaluations: usize,
    /// Evaluations with stiffness, each followed by an assembly.
    pub assemblies: usize,
    /// Factorisations of the tangent.
    pub factorisations: usize,
    /// Right-hand sides solved.
    pub solves: usize,
    /// Sweeps that refined solutions.
    pub refinement_sweeps: usize,
    /// Operations of all factorisations.
    pub factor_flops: f64,
    /// Wall time of evaluations and assemblies, s.
    pub assembly_seconds: f64,
    /// Wall time of factorisations, s.
    pub factor_seconds: f64,
    /// Wall time of solves, s.
    pub solve_seconds: f64,
}

impl Manifest {
    /// Of a run that begins.
    pub fn begun(command: Vec<String>, inputs: Vec<Input>, threads: usize) -> Manifest {
        Manifest {
            version: env!("CARGO_PKG_VERSION"),
            git: option_env!("RISORIUS_GIT"),
            command,
            inputs,
            threads,
            host: Host { os: std::env::consts::OS, arch: std::env::consts::ARCH, cpu: machine::cpu_name() },
            numerics: None,
            work: None,
            wall_seconds: None,
            cpu_seconds: None,
            peak_memory_bytes: None,
        }
    }

    /// Of the run when it ends, in this process; `wall_seconds` since it began.
    pub fn ended(self, work: &Work, wall_seconds: f64) -> Manifest {
        Manifest {
            work: Some(WorkDone::from(work)),
            wall_seconds: Some(wall_seconds),
            cpu_seconds: machine::cpu_seconds(),
            peak_memory_bytes: machine::peak_memory_bytes(),
            ..self
        }
    }

    /// That of a run as it stands; null where there is none.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::DamagedRun`].
    pub fn read(run: &Path) -> Result<Value> {
        let path = run.join("manifest.json");
        match std::fs::read(&path) {
            Ok(bytes) => serde_json::from_slice(&bytes)
                .map_err(|error| Error::DamagedRun { path, message: error.to_string().into() }),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Value::Null),
            Err(source) => Err(Error::Io { action: "read", path, source }),
        }
    }

    /// Writes `manifest.json`, atomically.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, run: &RunFolder) -> Result<()> {
        write_json(run, "manifest.json", self)
    }
}

impl Input {
    /// Reads a file for its length and hash.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn read(path: &Path) -> Result<Input> {
        let mut file = File::open(path).map_err(failed("read", path))?;
        let mut hash = Sha256::new();
        let bytes = std::io::copy(&mut file, &mut hash).map_err(failed("read", path))?;
        let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Input { path: path.into(), bytes, sha256 })
    }
}

impl Numerics {
    /// Of a model.
    pub fn of(model: &Model) -> Numerics {
        Numerics {
            elements: model.mesh().elements(),
            nodes: model.mesh().nodes,
            muscles: model.muscles().count(),
            unknowns: model.numbering().unknowns(),
            pressures: model.numbering().pressures(),
            tangent_entries: model.symbolic().pattern().nnz(),
            factor_entries: model.symbolic().factor_nnz(),
            flops_per_factorisation: model.factor_flops(),
        }
    }
}

impl From<&Work> for WorkDone {
    fn from(work: &Work) -> WorkDone {
        WorkDone {
            newton_iterations: work.iterations,
            cuts: work.cuts,
            force_evaluations: work.force_evaluations,
            assemblies: work.assemblies,
            factorisations: work.linear.factorisations,
            solves: work.linear.solves,
            refinement_sweeps: work.linear.sweeps,
            factor_flops: work.linear.factor_flops,
            assembly_seconds: work.assembly_seconds,
            factor_seconds: work.linear.factor_time.as_secs_f64(),
            solve_seconds: work.linear.solve_time.as_secs_f64(),
        }
    }
}
