//! Lists of files, one per frame, that open as one animation: PVD for ParaView, and `.vtu.series` in JSON, which ParaView and
//! programs on VTK read too.

use super::run_folder::write_atomically;
use super::vtu::xml::escape;
use crate::error::Result;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A list of files that grows; the files of the list are whole after every frame.
#[derive(Debug, Clone)]
pub struct Collection {
    path: PathBuf,
    entries: String,
    series: Vec<Value>,
}

impl Collection {
    /// An empty list that will be written to `path`, which ends in `.pvd`, and beside it; the files it names lie in the same folder.
    pub fn new(path: PathBuf) -> Collection {
        Collection { path, entries: String::new(), series: Vec::new() }
    }

    /// Adds a file at a time (s), and writes both lists.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io).
    pub fn add(&mut self, time_s: f64, file: &str) -> Result<()> {
        self.series.push(json!({"name": file, "time": time_s}));
        let series = json!({"file-series-version": "1.0", "files": self.series});
        write_atomically(&self.path.with_extension("vtu.series"), format!("{series:#}\n").as_bytes())?;
        let file = escape(file);
        self.entries += &format!("<DataSet timestep=\"{time_s:?}\" part=\"0\" file=\"{file}\"/>\n");
        let text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
             <Collection>\n{}</Collection>\n</VTKFile>\n",
            self.entries
        );
        write_atomically(&self.path, text.as_bytes())
    }
}
