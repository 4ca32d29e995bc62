//! The command line: see `risorius --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    risorius::cli::main()
}
