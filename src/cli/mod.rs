//! The command line: one file per command. It asks, calls and prints; it never computes.
//!
//! Standard output carries results, standard error progress and messages. Exit codes: 0 ok, 2 usage, 3 invalid input,
//! 4 not converged (what converged is written), 5 warnings under `--strict`, 6 input or output failed, 130 interrupted.

mod advise;
mod book;
mod check;
mod chunk;
mod completions;
pub mod diagnostics;
mod estimate;
mod explain;
mod export;
mod fibres;
mod fit;
mod forward;
mod inspect;
mod intake;
mod markers;
mod new;
mod noticed;
mod outer;
mod prepare;
mod problem;
mod progress;
mod report;
mod resume;
mod run;
mod scout;
mod side_by_side;
mod study;
mod telling;
mod terminal;
mod writer;

use clap::error::{ContextKind, ContextValue};
use clap::{Args, Parser, Subcommand, ValueEnum};
use diagnostics::{Colour, render_error, render_warning};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::path::PathBuf;
use std::process::ExitCode;

use crate::error::explain::Page;
use crate::error::{Error, Result, Warning};
use crate::fit::advise::Criterion;
use crate::report::export::Format;
use crate::scene::Units;

/// Finds out which muscles moved a face.
///
/// Without a command it runs the problem that is built in: a face with thirty muscles and a recording of its markers.
#[derive(Debug, Parser)]
#[command(name = "risorius", version, about, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    flags: Flags,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Do what a problem file says; without one, the problem that is built in
    Run {
        /// problem.toml
        problem: Option<PathBuf>,
    },
    /// Everything but the solve: all mistakes at once, which effects are on, what it will cost
    Check {
        /// problem.toml
        problem: Option<PathBuf>,
    },
    /// Write a problem to start from
    New {
        /// The folder for its files
        folder: PathBuf,
        /// What it is about
        #[arg(long, value_enum, default_value_t = Template::Face)]
        template: Template,
    },
    /// Go on with a fit after Ctrl-C, a crash or a full disk
    Resume {
        /// The folder of the run
        run: PathBuf,
    },
    /// Which further markers would tell more of the controls
    Advise {
        /// A fit: problem.toml, or the folder of a run
        problem: PathBuf,
        /// How many
        #[arg(long, default_value_t = 3, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=100))]
        markers: u16,
        /// What is to become small
        #[arg(long, value_enum, default_value_t = Optimal::D)]
        criterion: Optimal,
        /// Not nearer than this to another marker
        #[arg(long, default_value_t = scout::APART_MM, value_name = "MM", value_parser = millimetres)]
        apart_mm: f64,
        /// As JSON
        #[arg(long)]
        json: bool,
    },
    /// What is in a recording, an EX file, a file of VTK, an exported file or the folder of a run
    Inspect {
        /// An MCAP, C3D, TRC, CSV, EXF, VTK, VTU, VTP, GLB, STO, OBJ, PLY or Parquet file, or a folder
        file: PathBuf,
        /// As JSON
        #[arg(long)]
        json: bool,
    },
    /// Convert a marker recording, or propose which label is which marker
    Markers {
        #[command(subcommand)]
        command: Markers,
    },
    /// Write a finished run for other programs; nothing is solved again
    Export {
        /// The folder of a run
        run: PathBuf,
        /// Formats, with commas between them
        #[arg(long, value_enum, value_delimiter = ',', required = true)]
        to: Vec<Format>,
        /// The frame for formats of one frame [default: the one that moved most]
        #[arg(long, value_name = "N")]
        frame: Option<usize>,
    },
    /// Write a finished run as one page for a browser: report.html in its folder
    Report {
        /// The folder of a run
        run: PathBuf,
    },
    /// What the code of a message means, and what to do; without one, a list of all
    Explain {
        /// For example S003
        #[arg(value_parser = explain::code)]
        code: Vec<Page>,
    },
    /// A script that completes commands and flags: risorius completions bash > ~/.local/share/bash-completion/completions/risorius
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

#[derive(Debug, Subcommand)]
enum Markers {
    /// Write the markers of an MCAP, C3D, TRC or CSV file as MCAP, in millimetres
    Convert {
        /// What to read
        input: PathBuf,
        /// What to write; --force replaces it
        output: PathBuf,
        /// The unit of the positions in it [default: what the file says]
        #[arg(long, value_parser = unit)]
        units: Option<Units>,
        /// The topic, where an MCAP file has several
        #[arg(long)]
        topic: Option<String>,
    },
    /// Print the [[marker]] tables of a problem with the labels that fit best, by geometry
    Match {
        /// problem.toml
        problem: PathBuf,
    },
}

/// Flags of every command.
#[derive(Debug, Args)]
struct Flags {
    /// Threads [default: all]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Folder for the results [default: runs/<name>-<number>]
    #[arg(long, global = true, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into a folder that is not empty
    #[arg(long, global = true)]
    force: bool,
    /// Set a key of the problem, for example --set solver.step_max=0.02
    #[arg(long, global = true, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Use the cheapest settings of accuracy.toml beside the problem whose error is at most this, for example 0.1mm
    #[arg(long, global = true, value_name = "MM", value_parser = millimetres)]
    accuracy: Option<f64>,
    /// Estimate the error of the mesh, like --set output.estimate=true
    #[arg(long, global = true)]
    estimate: bool,
    /// Stop before the first solve
    #[arg(long, global = true)]
    dry_run: bool,
    /// A warning ends the command with exit code 5
    #[arg(long, global = true)]
    strict: bool,
    /// Only errors and results
    #[arg(short, long, global = true)]
    quiet: bool,
    /// What each stage does and takes
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Colours of messages
    #[arg(long, global = true, value_enum, default_value_t = When::Auto)]
    color: When,
    /// Progress of long work
    #[arg(long, global = true, value_enum, default_value_t = Progress::Auto)]
    progress: Progress,
}

/// What a new problem is about.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Template {
    /// The face with its fifteen pairs of muscles
    Face,
    /// A muscle in a block of tissue: shapes for given activations
    Forward,
    /// A beam with two muscles, and a recording of its markers
    Fit,
    /// A fan-shaped muscle, and measured directions of its fibres
    Fibres,
    /// A bent beam solved in 64 ways: errors against seconds
    Study,
}

/// What further markers are chosen for.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Optimal {
    /// The volume of the error of all controls together
    D,
    /// The sum of their variances
    A,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum When {
    Auto,
    Always,
    Never,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Progress {
    /// A bar on a terminal, else a line per frame
    Auto,
    /// A line per frame
    Plain,
    /// Nothing
    None,
}

impl Flags {
    fn colour(&self) -> bool {
        let when = match self.color {
            When::Auto => Colour::Auto,
            When::Always => Colour::Always,
            When::Never => Colour::Never,
        };
        when.on()
    }

    /// What is set in the problem.
    fn set(&self) -> Vec<String> {
        let estimate = self.estimate.then(|| "output.estimate=true".to_owned());
        self.set.iter().cloned().chain(estimate).collect()
    }

    /// Under `--strict` a warning is an error, which `-q` does not hide.
    fn shows_warnings(&self) -> bool {
        !self.quiet || self.strict
    }

    fn warn(&self, warnings: &[Warning]) {
        if self.shows_warnings() {
            for warning in warnings {
                terminal::tell(&render_warning(warning, self.colour()));
            }
        }
    }
}

/// `0.1mm` or `0.1`.
fn millimetres(text: &str) -> std::result::Result<f64, String> {
    match text.trim_end_matches("mm").trim().parse() {
        Ok(length) if length > 0.0 && f64::is_finite(length) => Ok(length),
        _ => Err("write a length in mm, for example 0.1mm".into()),
    }
}

/// `mm`, `cm` or `m`.
fn unit(text: &str) -> std::result::Result<Units, String> {
    Units::from_name(text).ok_or_else(|| "it can be mm, cm or m".into())
}

/// How a command that did not fail ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ending {
    Ok,
    NotConverged,
    Warned,
    Interrupted,
}

impl Ending {
    fn exit_code(self) -> u8 {
        match self {
            Ending::Ok => 0,
            Ending::NotConverged => 4,
            Ending::Warned => 5,
            Ending::Interrupted => 130,
        }
    }
}

/// Parses the arguments of the process, does what they say, and returns its exit code.
pub fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| with_tip(error).exit());
    let colour = cli.flags.colour();
    match in_threads(cli) {
        Ok(ending) => ExitCode::from(ending.exit_code()),
        Err(error) => {
            terminal::tell(&render_error(&error, colour));
            terminal::tell(&more_about(error.mistakes().iter().map(Error::code)));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Where the pages of codes are.
fn more_about<'c>(codes: impl Iterator<Item = &'c str>) -> String {
    let codes: std::collections::BTreeSet<&str> = codes.collect();
    format!("\nmore: risorius explain {}\n", codes.into_iter().collect::<Vec<_>>().join(" "))
}

/// `risorius problem.toml` lacks a command; the message says which.
fn with_tip(mut error: clap::Error) -> clap::Error {
    if let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand)
        && word.ends_with(".toml")
    {
        let tip = format!("to run a problem file, write: risorius run {word}").into();
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
    }
    error
}

/// Runs a command in a pool of its own, so that `--threads` holds for all parallel work.
fn in_threads(cli: Cli) -> Result<Ending> {
    thread_pool(cli.flags.threads.map_or(0, usize::from))?.install(|| dispatch(&cli))
}

/// So many threads; 0 are as many as there are cores.
fn thread_pool(threads: usize) -> Result<ThreadPool> {
    ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| Error::Io {
        action: "start the threads of",
        path: "risorius".into(),
        source: std::io::Error::other(error),
    })
}

fn dispatch(cli: &Cli) -> Result<Ending> {
    match &cli.command {
        None => run::run(None, &cli.flags),
        Some(Command::Run { problem }) => run::run(problem.as_deref(), &cli.flags),
        Some(Command::Check { problem }) => check::check(problem.as_deref(), &cli.flags),
        Some(Command::New { folder, template }) => new::new(folder, *template),
        Some(Command::Resume { run }) => resume::resume(run, &cli.flags),
        Some(Command::Advise { problem, markers, criterion, apart_mm, json }) => {
            let criterion = match criterion {
                Optimal::D => Criterion::D,
                Optimal::A => Criterion::A,
            };
            let (markers, apart_mm, json) = (usize::from(*markers), *apart_mm, *json);
            advise::run(&advise::Question { path: problem, markers, criterion, apart_mm, json }, &cli.flags)
        }
        Some(Command::Inspect { file, json }) => inspect::inspect(file, *json),
        Some(Command::Markers { command: Markers::Convert { input, output, units, topic } }) => {
            markers::convert(input, output, *units, topic.as_deref(), &cli.flags)
        }
        Some(Command::Markers { command: Markers::Match { problem } }) => markers::match_labels(problem, &cli.flags),
        Some(Command::Export { run, to, frame }) => export::export(run, to, *frame, &cli.flags),
        Some(Command::Report { run }) => report::report(run),
        Some(Command::Explain { code }) => explain::explain(code),
        Some(Command::Completions { shell }) => completions::completions(*shell),
    }
}
