//! `risorius new DIR --template face`: a problem to start from.

use super::terminal::print;
use super::{Ending, Template};
use crate::error::{Error, Result};
use crate::scene::FACE;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::Path;

/// A file of a template.
type File = (&'static str, Vec<u8>);

impl Template {
    /// The files of a template: problems of `problems/`, with what they name beside them.
    fn files(self) -> Vec<File> {
        let problem = |text: &str| ("problem.toml", text.as_bytes().to_vec());
        match self {
            Template::Face => {
                vec![problem(include_str!("../../data/face/problem.toml")), ("face.toml", FACE.as_bytes().to_vec())]
            }
            Template::Forward => vec![problem(include_str!("../../problems/slab/problem.toml"))],
            Template::Fit => vec![
                problem(
                    &include_str!("../../problems/beam/problem.toml")
                        .replace("../../data/beam.mcap", "recording.mcap"),
                ),
                ("recording.mcap", include_bytes!("../../data/beam.mcap").to_vec()),
            ],
            Template::Fibres => vec![
                problem(include_str!("../../problems/fibres/problem.toml")),
                ("axes.csv", include_bytes!("../../problems/fibres/axes.csv").to_vec()),
                ("traces.csv", include_bytes!("../../problems/fibres/traces.csv").to_vec()),
            ],
            Template::Study => {
                let study = include_str!("../../problems/bending_study/problem.toml");
                let bending = include_bytes!("../../problems/bending/problem.toml").to_vec();
                vec![problem(&study.replace("../bending/problem.toml", "bending.toml")), ("bending.toml", bending)]
            }
        }
    }
}

/// Writes the files of a template into a folder, which is made; files that are there already are kept, and an error.
pub(super) fn new(folder: &Path, template: Template) -> Result<Ending> {
    let io = |action, path: &Path, source| Error::Io { action, path: path.into(), source };
    fs::create_dir_all(folder).map_err(|source| io("make", folder, source))?;
    let paths: Vec<_> = template.files().into_iter().map(|(name, bytes)| (folder.join(name), bytes)).collect();
    // nothing is written if anything is in the way
    if let Some((path, _)) = paths.iter().find(|(path, _)| path.exists()) {
        let source = std::io::Error::new(ErrorKind::AlreadyExists, "it is there already; choose another folder");
        return Err(io("write", path, source));
    }
    for (number, (path, bytes)) in paths.iter().enumerate() {
        let file = fs::OpenOptions::new().write(true).create_new(true).open(path);
        file.and_then(|mut file| file.write_all(bytes)).map_err(|source| {
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
