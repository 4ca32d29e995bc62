//! The folder of a run: `runs/<name>-0001` or the next free number, or a folder that the user names.

use crate::error::{Error, Result};
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Sub-folders of every run.
const SUB_FOLDERS: [&str; 3] = ["tables", "view", "view/linear"];
/// Sub-folders that a run fills and a later one in the same place replaces.
const REPLACED: [&str; 3] = ["tables", "view", "state"];
/// Files of a run that one of another task, or one that fails, would not replace; the status, by which a run is known, goes last.
const REMOVED: [&str; 8] = [
    "log.jsonl",
    "problem.lock.toml",
    "report.html",
    "study.md",
    "fibres.exf",
    "summary.txt",
    "manifest.json",
    "status.json",
];
/// What surely fits where a file of its length is already, bytes: a block of the disk.
const BLOCK: usize = 4096;

/// A folder that exists, holds the sub-folders of a run, and belongs to this run alone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// Makes `<parent>/<name>-0001`, or the number after the highest one there. Runs that start at the same time get
    /// different numbers. Characters of `name` that do not belong in a file name become `_`.
    ///
    /// # Errors
    /// [`Error::Io`] where nothing can be written.
    pub fn create(parent: &Path, name: &str) -> Result<RunFolder> {
        fs::create_dir_all(parent).map_err(failed("create", parent))?;
        let name = file_name(name);
        for number in highest_number(parent, &name)?.saturating_add(1).. {
            let path = parent.join(format!("{name}-{number:04}"));
            // create_dir fails where the folder exists: two runs cannot both make it
            match fs::create_dir(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => continue,
                Err(error) => return Err(failed("create", &path)(error)),
                Ok(()) => return RunFolder { path }.with_sub_folders(),
            }
        }
        Err(failed("create", parent)(ErrorKind::AlreadyExists.into()))
    }

    /// Uses the folder `path`, which is made if need be and must be empty. With `force` it need not be: an earlier run
    /// in it is replaced, and files that no run wrote stay.
    ///
    /// # Errors
    /// [`Error::FolderNotEmpty`]; [`Error::Io`] where nothing can be written.
    pub fn create_at(path: &Path, force: bool) -> Result<RunFolder> {
        fs::create_dir_all(path).map_err(failed("create", path))?;
        let entries = fs::read_dir(path).map_err(failed("read", path))?.count();
        if entries > 0 && !force {
            return Err(Error::FolderNotEmpty { path: path.into(), entries });
        }
        if holds_a_run(path) {
            for folder in REPLACED.map(|name| path.join(name)) {
                match fs::remove_dir_all(&folder) {
                    Err(error) if error.kind() != ErrorKind::NotFound => {
                        return Err(failed("remove", &folder)(error));
                    }
                    _ => {}
                }
            }
            for file in REMOVED.map(|name| path.join(name)) {
                match fs::remove_file(&file) {
                    Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed("remove", &file)(error)),
                    _ => {}
                }
            }
        }
        RunFolder { path: path.into() }.with_sub_folders()
    }

    /// The folder of a run that began before; what it left stays.
    ///
    /// # Errors
    /// [`Error::Io`] where nothing can be written.
    pub fn open(path: &Path) -> Result<RunFolder> {
        RunFolder { path: path.into() }.with_sub_folders()
    }

    fn with_sub_folders(self) -> Result<RunFolder> {
        for folder in SUB_FOLDERS.map(|name| self.path.join(name)) {
            fs::create_dir_all(&folder).map_err(failed("create", &folder))?;
        }
        Ok(self)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// `tables/`: CSV files.
    pub fn tables(&self) -> PathBuf {
        self.path.join("tables")
    }

    /// `view/`: the exact shape, muscles, markers; `view/linear/` holds the resampled shape.
    pub fn view(&self) -> PathBuf {
        self.path.join("view")
    }

    /// Writes the file `name` of the folder, atomically.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> Result<()> {
        write_atomically(&self.path.join(name), contents.as_ref())
    }
}

/// Writes a file so that a reader finds either what was there before or all of `contents`: into a file beside it,
/// which then takes its name.
///
/// # Errors
/// [`Error::Io`]; the file beside it is gone then.
pub fn write_atomically(path: &Path, contents: &[u8]) -> Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    let beside = path.with_file_name(name);
    let written = fs::write(&beside, contents).map_err(failed("write", path));
    let renamed = written.and_then(|()| fs::rename(&beside, path).map_err(failed("rename", path)));
    if renamed.is_err() {
        // the first error is the one to tell
        let _ = fs::remove_file(&beside);
    }
    renamed
}

/// Writes over a file that is there, in its place: for a disk that has no room for a second one beside it. Not atomic, so that it is
/// for short texts only; longer ones are refused.
///
/// # Errors
/// [`Error::Io`].
pub fn write_over(path: &Path, contents: &[u8]) -> Result<()> {
    if contents.len() > BLOCK {
        return Err(failed("write", path)(ErrorKind::StorageFull.into()));
    }
    let write = || {
        let mut file = fs::OpenOptions::new().write(true).open(path)?;
        file.write_all(contents)?;
        file.set_len(contents.len() as u64)
    };
    write().map_err(failed("write", path))
}

/// An error of the operating system as one of ours.
pub(super) fn failed(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
    let path = path.to_path_buf();
    move |source| Error::Io { action, path, source }
}

/// A name that is one component of a path on every system.
fn file_name(name: &str) -> String {
    let allowed = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ' | '+');
    let name: String = name.trim().chars().map(|c| if allowed(c) { c } else { '_' }).collect();
    match name.strip_prefix('.') {
        Some(rest) => format!("_{rest}"),
        None if name.is_empty() => "run".into(),
        None => name,
    }
}

/// The highest number of a `<name>-<number>` in a folder, 0 if there is none.
fn highest_number(parent: &Path, name: &str) -> Result<u32> {
    let mut highest = 0;
    for entry in fs::read_dir(parent).map_err(failed("read", parent))? {
        let entry = entry.map_err(failed("read", parent))?.file_name();
        let number = entry.to_str().and_then(|entry| entry.strip_prefix(name)?.strip_prefix('-')?.parse().ok());
        highest = highest.max(number.unwrap_or(0));
    }
    Ok(highest)
}

/// Whether a run wrote its status here: only then are its sub-folders ours to remove.
fn holds_a_run(path: &Path) -> bool {
    let status = fs::read(path.join("status.json")).ok();
    let status = status.and_then(|text| serde_json::from_slice::<serde_json::Value>(&text).ok());
    status.is_some_and(|status| status.get("frames_ok").is_some() && status.get("frames_failed").is_some())
}
