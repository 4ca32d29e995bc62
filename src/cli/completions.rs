//! `risorius completions SHELL`: what a shell needs to complete commands and flags.

use super::terminal::print;
use super::{Cli, Ending};
use crate::error::Result;
use clap::CommandFactory;
use clap_complete::Shell;

pub(super) fn completions(shell: Shell) -> Result<Ending> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "risorius", &mut script);
    print(&String::from_utf8_lossy(&script))?;
    Ok(Ending::Ok)
}
