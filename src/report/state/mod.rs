//! Checkpoints of a fit: `state/`.
//!
//! ```text
//! state/problem.json          what the fit is of: the program, the lock file and every input, by their hashes
//! state/frame_000012.bin      a frame that is done, or that failed
//! state/memory.bin            which frame comes next, and what it starts from
//! state/chunk_1/              the same of the second chunk, where a clip is fitted in chunks
//! ```
//!
//! Every file is written beside its place and renamed; `memory.bin` comes last and says what counts. Each carries the hash of
//! `problem.json` and of its own contents: one of another problem, or a damaged one, is refused.

mod codec;
mod stored;

use super::manifest::Input;
use super::run_folder::{RunFolder, failed, write_atomically};
use super::status::{FailedFrame, write_json};
use crate::error::{Error, Result};
use crate::fit::Estimate;
use crate::fit::advise::MarkerHelp;
use crate::fit::estimate::Memory;
use crate::model::State;
use crate::report::frame::MeshError;
use codec::{Bytes, Stored};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// First bytes of a checkpoint.
const MAGIC: &[u8; 16] = b"risorius state 5";

/// What a fit is of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Guard {
    /// Version of the program.
    pub version: String,
    /// SHA-256 of `problem.lock.toml`, hexadecimal.
    pub lock_sha256: String,
    /// Files that were read.
    pub inputs: Vec<Input>,
}

/// A frame that was fitted, with all that its rows are made of.
#[derive(Debug, Clone)]
pub struct SavedFrame {
    /// The fit.
    pub estimate: Estimate,
    /// The error of the mesh, if it was estimated.
    pub error: Option<MeshError>,
    /// Why it was not, if it should have been, and the remedy.
    pub unestimated: Option<(String, Option<String>)>,
    /// The marker that would tell its worst pair apart.
    pub help: Option<MarkerHelp>,
}

/// How a frame ended.
#[derive(Debug, Clone)]
pub enum SavedOutcome {
    /// It converged.
    Fitted(Box<SavedFrame>),
    /// It did not.
    Failed(FailedFrame),
}

/// What goes from frame to frame.
#[derive(Debug, Clone)]
pub struct Carried {
    /// Of the fit.
    pub fit: Memory,
    /// The tangent on halved elements, if the error of the mesh is estimated.
    pub halved: Option<[State; 2]>,
}

/// The folder `state` of a run, or the part of it that belongs to a chunk.
#[derive(Debug, Clone)]
pub struct Checkpoints {
    folder: PathBuf,
    guard: [u8; 32],
}

/// What an earlier process left of a chunk.
#[derive(Debug)]
pub struct Left {
    /// The first frame that is not done, as a place in the fit.
    pub next: usize,
    /// What it starts from; `None` where the chunk has not begun.
    pub carried: Option<Carried>,
}

impl Guard {
    /// Of a lock file and inputs, for this program.
    pub fn new(lock: &str, inputs: Vec<Input>) -> Guard {
        Guard {
            version: env!("CARGO_PKG_VERSION").into(),
            lock_sha256: hex(&Sha256::digest(lock.as_bytes())),
            inputs,
        }
    }

    /// Reads what the run in a folder is of.
    ///
    /// # Errors
    /// [`Error::NothingToResume`].
    pub fn read(run: &Path) -> Result<Guard> {
        let nothing = |reason: String| Error::NothingToResume { path: run.into(), reason: reason.into() };
        let path = run.join("state/problem.json");
        let text = std::fs::read_to_string(&path).map_err(|error| nothing(format!("{}: {error}", path.display())))?;
        serde_json::from_str(&text).map_err(|error| nothing(format!("{}: {error}", path.display())))
    }

    /// What is not as it was, as a list of words; empty where nothing changed.
    pub fn changes(&self, run: &Path) -> Vec<String> {
        let mut changes = Vec::new();
        if self.version != env!("CARGO_PKG_VERSION") {
            changes.push(format!("the program (it was version {})", self.version));
        }
        let lock = std::fs::read(run.join("problem.lock.toml"));
        if lock.map(|lock| hex(&Sha256::digest(lock))).ok().as_deref() != Some(&self.lock_sha256) {
            changes.push("problem.lock.toml".into());
        }
        for input in &self.inputs {
            if Input::read(&input.path).ok().as_ref() != Some(input) {
                changes.push(input.path.display().to_string());
            }
        }
        changes
    }
}

impl Checkpoints {
    /// Makes the folder, for a run that begins.
    ///
    /// # Errors
    /// [`Error::Io`], here and below.
    pub fn create(run: &RunFolder, guard: &Guard) -> Result<Checkpoints> {
        let folder = run.path().join("state");
        std::fs::create_dir_all(&folder).map_err(failed("create", &folder))?;
        write_json(run, "state/problem.json", guard)?;
        Checkpoints::open(run.path())
    }

    /// Those of a run that began before.
    pub fn open(run: &Path) -> Result<Checkpoints> {
        let path = run.join("state/problem.json");
        let guard = std::fs::read(&path).map_err(failed("read", &path))?;
        Ok(Checkpoints { folder: run.join("state"), guard: Sha256::digest(guard).into() })
    }

    /// Those of a chunk: of the first one these.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn of_chunk(&self, chunk: usize) -> Result<Checkpoints> {
        if chunk == 0 {
            return Ok(self.clone());
        }
        let folder = self.folder.join(format!("chunk_{chunk}"));
        std::fs::create_dir_all(&folder).map_err(failed("create", &folder))?;
        Ok(Checkpoints { folder, guard: self.guard })
    }

    /// Keeps the frame that is number `at` (from 0) of the fit, and what the next one starts from.
    pub fn save(&self, at: usize, frame: &SavedOutcome, carried: &Carried) -> Result<()> {
        self.write(&frame_name(at), |out| frame.put(out))?;
        self.write("memory.bin", |out| {
            (at + 1).put(out);
            carried.fit.put(out);
            carried.halved.put(out);
        })
    }

    /// What is there of a chunk that begins with the frame that is number `start`. Every frame is read, to see that it can be.
    ///
    /// # Errors
    /// [`Error::BadCheckpoint`] for a file that is damaged or of another problem.
    pub fn left(&self, start: usize) -> Result<Left> {
        let memory = "memory.bin";
        if !self.folder.join(memory).is_file() {
            return Ok(Left { next: start, carried: None });
        }
        let take = |from: &mut Bytes<'_>| {
            let next = usize::take(from)?;
            Some((next, Carried { fit: Stored::take(from)?, halved: Stored::take(from)? }))
        };
        let (next, carried) = self.read(memory, take)?;
        (start..next).try_for_each(|at| self.frame(at).map(drop))?;
        Ok(Left { next, carried: Some(carried) })
    }

    /// The frame that is number `at` of the fit.
    ///
    /// # Errors
    /// As [`Checkpoints::left`].
    pub fn frame(&self, at: usize) -> Result<SavedOutcome> {
        self.read(&frame_name(at), SavedOutcome::take)
    }

    fn write(&self, name: &str, put: impl FnOnce(&mut Vec<u8>)) -> Result<()> {
        let mut bytes = [MAGIC.as_slice(), &self.guard].concat();
        put(&mut bytes);
        let hash = Sha256::digest(&bytes);
        bytes.extend(hash);
        write_atomically(&self.folder.join(name), &bytes)
    }

    fn read<T>(&self, name: &str, take: impl FnOnce(&mut Bytes<'_>) -> Option<T>) -> Result<T> {
        let path = self.folder.join(name);
        let bytes = std::fs::read(&path).map_err(failed("read", &path))?;
        let bad = |reason: &'static str| Error::BadCheckpoint { path: path.clone(), reason };
        let (contents, hash) = bytes.split_last_chunk::<32>().ok_or_else(|| bad("it is cut short"))?;
        let own: [u8; 32] = Sha256::digest(contents).into();
        if own != *hash {
            return Err(bad("its checksum is wrong"));
        }
        let rest = contents.strip_prefix(MAGIC.as_slice()).ok_or_else(|| bad("it is of another version"))?;
        let rest = rest.strip_prefix(&self.guard).ok_or_else(|| bad("it is of another problem"))?;
        let mut rest = Bytes(rest);
        let value = take(&mut rest).filter(|_| rest.0.is_empty());
        value.ok_or_else(|| bad("its contents are not those of a frame"))
    }
}

fn frame_name(at: usize) -> String {
    format!("frame_{at:06}.bin")
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
