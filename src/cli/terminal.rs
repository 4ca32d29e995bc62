//! Standard output and standard error. The macros of the standard library panic when nobody reads any more
//! (`risorius check | head -1`); a run goes on.

use crate::error::{Error, Result};
use std::io::{ErrorKind, Write};

/// Prints a result on standard output.
///
/// # Errors
/// Where it cannot be written, for example on a full disk. A reader that has gone is none.
pub(super) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(Error::Io { action: "write to", path: "standard output".into(), source })
        }
        _ => Ok(()),
    }
}

/// Tells something on standard error. Where nobody hears it, nothing is lost: files hold all that matters.
pub(super) fn tell(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}
