//! PVD: the list of files, one per frame, that ParaView opens as one animation.

use super::run_folder::write_atomically;
use super::vtu::xml::escape;
use crate::error::Result;
use std::path::PathBuf;

/// A list of files that grows; the file of the list is whole after every frame.
#[derive(Debug, Clone)]
pub struct Collection {
    path: PathBuf,
    entries: String,
}

impl Collection {
    /// An empty list that will be written to `path`; the files it names lie in the same folder.
    pub fn new(path: PathBuf) -> Collection {
        Collection { path, entries: String::new() }
    }

    /// Adds a file at a time (s), and writes the list.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io).
    pub fn add(&mut self, time_s: f64, file: &str) -> Result<()> {
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
