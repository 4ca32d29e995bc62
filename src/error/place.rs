//! Where in a text something was said, and what does not stop a run.

use std::ops::Range;
use std::sync::Arc;

/// A place in a text that was read: what a message points at.
///
/// Everything built from a problem file keeps the place it came from, so that a mistake found much later (a muscle
/// outside its host) can still show the line to edit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it, or `command line`.
    pub file: Arc<str>,
    /// The whole line, without its end.
    pub text: Arc<str>,
    /// The line, counted from 1; 0 means the file as a whole.
    pub line: u32,
    /// The column of the first character, counted from 1 in characters.
    pub column: u32,
    /// The number of characters meant, at least 1.
    pub length: u32,
}

impl Place {
    /// A file as a whole: something is missing from it.
    pub fn whole(file: &str) -> Place {
        Place { file: file.into(), text: "".into(), line: 0, column: 0, length: 1 }
    }

    /// The bytes `span` of the line `text`, which is number `line` (from 1) of `file`. A span that leaves the line,
    /// or that cuts a character, is narrowed to the line.
    pub fn on_line(file: &Arc<str>, line: usize, text: &str, span: Range<usize>) -> Place {
        let start = text.floor_char_boundary(span.start);
        let end = text.floor_char_boundary(span.end).max(start);
        let count = |part: &str| u32::try_from(part.chars().count()).unwrap_or(u32::MAX);
        Place {
            file: Arc::clone(file),
            line: u32::try_from(line).unwrap_or(u32::MAX),
            column: count(&text[..start]).saturating_add(1),
            length: count(&text[start..end]).max(1),
            text: text.into(),
        }
    }

    /// From the start of this place to the end of `other`, if that is on the same line; otherwise `other`.
    pub fn until(&self, other: &Place) -> Place {
        if (&self.file, self.line) != (&other.file, other.line) || other.column < self.column {
            return other.clone();
        }
        Place { length: other.column - self.column + other.length, ..self.clone() }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            0 => write!(out, "{}", self.file),
            line => write!(out, "{}:{line}:{}", self.file, self.column),
        }
    }
}

/// Something that does not stop a run, and that its reader must know. Under `--strict` it ends the run.
///
/// Codes share the letters and the numbers of [`Error::code`](super::Error::code).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// The stable code.
    pub code: &'static str,
    /// What was noticed, with its number and unit.
    pub message: String,
    /// Where, if it comes from a text.
    pub place: Option<Place>,
    /// What to do about it, where something is to be done.
    pub help: Option<String>,
}
