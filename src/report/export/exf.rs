//! The exact shape as EX files: those of the run, which hold everything, and a script for cmgui that plays them.

use super::Exported;
use crate::error::Result;
use crate::report::playback::Activity;
use crate::report::run_folder::failed;
use std::path::Path;

/// Copies `view/result_<frame>.exf`, and writes `result.com`, which reads each file at its time.
pub fn copy(run: &Activity, folder: &Path, done: &mut Exported) -> Result<()> {
    let mut script = String::from("# cmgui: gfx read region <file> time <s>\n");
    for (frame, path) in run.shown()? {
        let name = format!("result_{:04}.exf", frame.index);
        let bytes = std::fs::read(&path).map_err(failed("read", &path))?;
        done.write(folder.join(&name), bytes)?;
        script += &format!("gfx read region {name} time {:?}\n", frame.time_s);
    }
    done.write(folder.join("result.com"), script)
}
