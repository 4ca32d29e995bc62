//! An EX text line by line, with the place of every line for messages.

use crate::error::{Error, Place, Result};
use std::str::FromStr;
use std::sync::Arc;

/// The lines that are left of a text. Blank lines and comments are passed over; `!#` directives are no comments.
pub(super) struct Lines<'a> {
    pub file: Arc<str>,
    lines: Vec<&'a str>,
    next: usize,
}

impl<'a> Lines<'a> {
    pub fn new(file: &str, text: &'a str) -> Lines<'a> {
        Lines { file: file.into(), lines: text.lines().collect(), next: 0 }
    }

    /// The next line without the blanks around it.
    pub fn peek(&mut self) -> Option<&'a str> {
        while let Some(line) = self.lines.get(self.next) {
            let line = line.trim();
            let comment = line.starts_with('!') && !line.starts_with("!#nodeset") && !line.starts_with("!#mesh");
            if !line.is_empty() && !comment {
                return Some(line);
            }
            self.next += 1;
        }
        None
    }

    /// Takes the next line.
    pub fn take(&mut self) -> Option<&'a str> {
        let line = self.peek();
        self.next += usize::from(line.is_some());
        line
    }

    /// Takes the next line if it starts with `keyword`; what follows the keyword.
    pub fn take_after(&mut self, keyword: &str) -> Option<&'a str> {
        let rest = self.peek()?.strip_prefix(keyword)?;
        self.next += 1;
        Some(rest.trim_start_matches([' ', '\t', ':']))
    }

    /// The line taken last.
    pub fn place(&self) -> Place {
        self.place_of(self.next.saturating_sub(1))
    }

    fn place_of(&self, index: usize) -> Place {
        match self.lines.get(index) {
            Some(line) => {
                let start = line.len() - line.trim_start().len();
                Place::on_line(&self.file, index + 1, line, start..line.trim_end().len().max(start))
            }
            None => Place::whole(&self.file),
        }
    }

    /// The error that the line taken last is not what was expected.
    pub fn wrong(&self, expected: impl Into<String>) -> Error {
        Error::ExSyntax { expected: expected.into(), place: Box::new(self.place()) }
    }

    /// The error that the next line is not what was expected.
    pub fn wrong_next(&mut self, expected: impl Into<String>) -> Error {
        self.peek();
        Error::ExSyntax { expected: expected.into(), place: Box::new(self.place_of(self.next)) }
    }

    /// Exactly `count` values, from `rest` (the end of the line taken last) and from as many lines as they fill.
    pub fn values<T: FromStr>(&mut self, rest: &str, count: usize, what: &str) -> Result<Vec<T>> {
        let mut values = Vec::new();
        self.extend(&mut values, rest, what)?;
        while values.len() < count {
            let Some(line) = self.take() else {
                return Err(self.wrong_next(format!("{count} {what}; the file ends after {}", values.len())));
            };
            self.extend(&mut values, line, what)?;
        }
        if values.len() > count {
            return Err(self.wrong(format!("{count} {what}, not {}", values.len())));
        }
        Ok(values)
    }

    fn extend<T: FromStr>(&self, values: &mut Vec<T>, line: &str, what: &str) -> Result<()> {
        for word in line.split_whitespace() {
            values.push(word.parse().map_err(|_| self.wrong(format!("{what}, not `{word}`")))?);
        }
        Ok(())
    }

    /// Passes over lines until one for which `stop` holds.
    pub fn skip_until(&mut self, stop: impl Fn(&str) -> bool) {
        while self.peek().is_some_and(|line| !stop(line)) {
            self.next += 1;
        }
    }
}

/// Whether a line starts a new thing in a file, so that whatever was passed over ends before it.
pub(super) fn starts_something(line: &str) -> bool {
    const WORDS: [&str; 14] = [
        "Node:",
        "Node :",
        "Element:",
        "Element :",
        "!#",
        "Region",
        "Group name",
        "Define ",
        "Node template",
        "Element template",
        "Shape",
        "#Fields",
        "#Scale factor sets",
        "EX Version",
    ];
    WORDS.iter().any(|word| line.starts_with(word))
        || line.starts_with("Node group")
        || line.starts_with("Element group")
}

/// The number after `key =` in a line.
pub(super) fn number_after(line: &str, key: &str) -> Option<usize> {
    let rest = line[line.find(key)? + key.len()..].trim_start().strip_prefix('=')?.trim_start();
    let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    rest[..digits].parse().ok()
}
