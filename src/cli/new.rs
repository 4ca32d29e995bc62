//! `risorius new DIR --template face`: a problem to start from.

use super::terminal::print;
use super::{Ending, Template};
use crate::error::{Error, Result};
use crate::scene::FACE;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::Path;

/// The problem of the template `face`.
const FACE_PROBLEM: &str = include_str!("../../data/face/problem.toml");

impl Template {
    /// The files of a template.
    fn files(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Template::Face => &[("problem.toml", FACE_PROBLEM), ("face.toml", FACE)],
        }
    }
}

/// Writes the files of a template into a folder, which is made; files that are there already are kept, and an error.
pub(super) fn new(folder: &Path, template: Template) -> Result<Ending> {
    let io = |action, path: &Path, source| Error::Io { action, path: path.into(), source };
    fs::create_dir_all(folder).map_err(|source| io("make", folder, source))?;
    let paths = template.files().iter().map(|(name, text)| (folder.join(name), *text));
    let paths: Vec<_> = paths.collect();
    // nothing is written if anything is in the way
    if let Some((path, _)) = paths.iter().find(|(path, _)| path.exists()) {
        let source = std::io::Error::new(ErrorKind::AlreadyExists, "it is there already; choose another folder");
        return Err(io("write", path, source));
    }
    for (number, (path, text)) in paths.iter().enumerate() {
        let file = fs::OpenOptions::new().write(true).create_new(true).open(path);
        file.and_then(|mut file| file.write_all(text.as_bytes())).map_err(|source| {
            // all or nothing, so that it can be tried again; the first error is the one to tell
            let made = number + usize::from(source.kind() != ErrorKind::AlreadyExists);
            paths[..made].iter().for_each(|(path, _)| drop(fs::remove_file(path)));
            io("write", path, source)
        })?;
    }
    let problem = folder.join("problem.toml");
    let mut page = String::new();
    for (path, _) in &paths {
        page += &format!("wrote {}\n", path.display());
    }
    page += &format!("next: risorius check {0}\n      risorius run {0}\n", problem.display());
    print(&page)?;
    Ok(Ending::Ok)
}
