//! `log.jsonl`: a line of JSON for everything a run says, also what `-q` hides on the terminal.

use super::run_folder::RunFolder;
use super::status::Status;
use crate::error::{Error, Warning};
use serde::Serialize;
use serde_json::{Map, Value};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::sync::Mutex;
use std::time::Instant;

/// How much a line matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// What a stage of the run took.
    Stage,
    /// How a frame or a step went.
    Info,
    /// It is perhaps not what was meant.
    Warn,
    /// It failed.
    Error,
}

/// A line.
#[derive(Debug, Serialize)]
struct Entry<'a> {
    /// Since the run began, s.
    time_s: f64,
    level: Level,
    /// The stable code of a warning or an error.
    #[serde(skip_serializing_if = "Option::is_none")]
    code: Option<&'a str>,
    /// As on the terminal.
    text: &'a str,
    /// The numbers of the text by name; units stand in the names.
    #[serde(skip_serializing_if = "Map::is_empty")]
    numbers: Map<String, Value>,
}

/// Where lines go: they wait until the run has a folder.
#[derive(Debug)]
enum Lines {
    Waiting(String),
    Kept {
        file: File,
        length: u64,
    },
    /// The file cannot be written: what it would say, other files say too.
    Lost,
}

/// The log of a run.
#[derive(Debug)]
pub struct Log {
    start: Instant,
    lines: Mutex<Lines>,
}

impl Default for Log {
    fn default() -> Self {
        Log { start: Instant::now(), lines: Mutex::new(Lines::Waiting(String::new())) }
    }
}

impl Log {
    /// Goes on in the folder of a run: behind what is there if the run was begun before.
    pub fn keep_in(&self, run: &RunFolder) {
        let Ok(mut lines) = self.lines.lock() else { return };
        let Lines::Waiting(waiting) = &*lines else { return };
        let opened = OpenOptions::new().create(true).append(true).open(run.path().join("log.jsonl"));
        let waiting = waiting.clone();
        *lines = match opened.and_then(|file| Ok((file.metadata()?.len(), file))) {
            Ok((length, file)) => Lines::Kept { file, length },
            Err(_) => Lines::Lost,
        };
        lines.write(&waiting);
    }

    /// Adds a line. A disk that is full ends the log, not the run.
    pub fn add(&self, level: Level, code: Option<&str>, text: &str, numbers: &[(&str, f64)]) {
        // what is not finite is null
        let numbers = numbers.iter().map(|(name, number)| ((*name).to_owned(), Value::from(*number))).collect();
        let entry = Entry { time_s: self.start.elapsed().as_secs_f64(), level, code, text: text.trim_end(), numbers };
        if let (Ok(line), Ok(mut lines)) = (serde_json::to_string(&entry), self.lines.lock()) {
            lines.write(&(line + "\n"));
        }
    }

    /// Adds a warning.
    pub fn warn(&self, Warning { code, message, .. }: &Warning) {
        self.add(Level::Warn, Some(code), message, &[]);
    }

    /// Adds an error: a line for each of its mistakes.
    pub fn error(&self, error: &Error) {
        error
            .mistakes()
            .iter()
            .for_each(|mistake| self.add(Level::Error, Some(mistake.code()), &mistake.to_string(), &[]));
    }

    /// Adds how a run ended.
    pub fn ended(&self, status: &Status) {
        let text = match serde_json::to_value(status.status) {
            Ok(Value::String(word)) => word,
            _ => String::new(),
        };
        let (ok, failed) = (status.frames_ok as f64, status.frames_failed.len() as f64);
        self.add(Level::Info, None, &text, &[("frames_ok", ok), ("frames_failed", failed)]);
    }
}

impl Lines {
    fn write(&mut self, text: &str) {
        match self {
            Lines::Waiting(waiting) => waiting.push_str(text),
            Lines::Lost => {}
            Lines::Kept { file, length } => match file.write_all(text.as_bytes()) {
                Ok(()) => *length += text.len() as u64,
                Err(_) => {
                    // no half line stays
                    let _ = file.set_len(*length);
                    *self = Lines::Lost;
                }
            },
        }
    }
}
