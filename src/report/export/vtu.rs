//! The shapes for ParaView: those of the run, exact and linear, with the lists that play them.

use super::Exported;
use crate::error::Result;
use crate::report::playback::Activity;
use crate::report::run_folder::failed;
use std::path::Path;

/// Ends of the names of files that belong to it.
const ENDS: [&str; 3] = [".vtu", ".pvd", ".vtu.series"];

/// Copies `view/*` and `view/linear/*` but for the EX files.
pub fn copy(run: &Activity, folder: &Path, done: &mut Exported) -> Result<()> {
    run.shown()?;
    for part in ["", "linear"] {
        let (from, to) = (run.folder.join("view").join(part), folder.join(part));
        std::fs::create_dir_all(&to).map_err(failed("create", &to))?;
        let entries = std::fs::read_dir(&from).map_err(failed("read", &from))?;
        let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names.filter(|name| ENDS.iter().any(|end| name.ends_with(end))).collect();
        // the order of a folder is that of the disk
        names.sort();
        for name in names {
            let path = from.join(&name);
            let bytes = std::fs::read(&path).map_err(failed("read", &path))?;
            done.write(to.join(name), bytes)?;
        }
    }
    Ok(())
}
