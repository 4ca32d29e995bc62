//! A TOML file as a tree in which every key and every value knows its place.
//!
//! The spans of the `toml` crate are byte ranges of one text. Here they become [`Place`]s, so that values of the
//! command line can be merged into a file and a message still points at whichever of the two was wrong.

use crate::error::{Error, Place};
use std::ops::Range;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and where it stands.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub place: Place,
    pub value: Value,
}

/// The kinds of value TOML knows.
#[derive(Debug, Clone)]
pub(super) enum Value {
    Text(String),
    /// A number, with its digits as written (without underscores).
    Number {
        written: String,
        value: f64,
        whole: Option<i64>,
    },
    Flag(bool),
    Date,
    List(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key of a table, in the order of the file.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub key: String,
    pub place: Place,
    pub node: Node,
}

impl Node {
    /// What stands here, in words.
    pub fn describe(&self) -> String {
        match &self.value {
            Value::Text(text) => format!("text \"{text}\""),
            Value::Number { written, .. } => format!("the number {written}"),
            Value::Flag(flag) => flag.to_string(),
            Value::Date => "a date".into(),
            Value::List(list) if !list.is_empty() && list.iter().all(|node| node.entries().is_some()) => {
                "a list of tables".into()
            }
            Value::List(_) => "a list".into(),
            Value::Table(_) => "a table".into(),
        }
    }

    /// The value as TOML on one line.
    pub fn to_toml(&self) -> String {
        let key = |key: &str| match key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
            true if !key.is_empty() => key.to_owned(),
            _ => format!("{key:?}"),
        };
        match &self.value {
            Value::Text(text) => format!("{text:?}"),
            Value::Number { written, .. } => written.clone(),
            Value::Flag(flag) => flag.to_string(),
            Value::Date => "\"a date\"".into(),
            Value::List(list) => format!("[{}]", list.iter().map(Node::to_toml).collect::<Vec<_>>().join(", ")),
            Value::Table(entries) => {
                let entry = |e: &Entry| format!("{} = {}", key(&e.key), e.node.to_toml());
                format!("{{ {} }}", entries.iter().map(entry).collect::<Vec<_>>().join(", "))
            }
        }
    }

    /// The entries, if this is a table.
    pub fn entries(&self) -> Option<&[Entry]> {
        match &self.value {
            Value::Table(entries) => Some(entries),
            _ => None,
        }
    }

    /// The value under `name` in this table: what an element of a list of tables is called.
    pub fn name(&self) -> Option<(&str, &Place)> {
        let entry = self.entries()?.iter().find(|entry| entry.key == "name")?;
        match &entry.node.value {
            Value::Text(name) => Some((name, &entry.node.place)),
            _ => None,
        }
    }

    /// The elements of the list of tables under `key`, if this is a table that has one.
    pub fn tables(&self, key: &str) -> &[Node] {
        let entry = self.entries().and_then(|entries| entries.iter().find(|entry| entry.key == key));
        match entry.map(|entry| &entry.node.value) {
            Some(Value::List(list)) => list,
            // [muscle] for [[muscle]]: a mistake that is told elsewhere; what the table says still counts.
            Some(Value::Table(_)) => entry.map(|entry| std::slice::from_ref(&entry.node)).unwrap_or_default(),
            _ => &[],
        }
    }
}

/// A text with the offsets of its lines.
pub(super) struct Source<'a> {
    file: Arc<str>,
    text: &'a str,
    line_starts: Vec<usize>,
}

impl<'a> Source<'a> {
    pub fn new(file: &str, text: &'a str) -> Source<'a> {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
        Source { file: file.into(), text, line_starts: std::iter::once(0).chain(ends).collect() }
    }

    /// The first line of the byte range `span`.
    pub fn place(&self, span: Range<usize>) -> Place {
        let line = self.line_starts.partition_point(|&start| start <= span.start).max(1);
        let start = self.line_starts[line - 1];
        let end = self.line_starts.get(line).copied().unwrap_or(self.text.len());
        let text = self.text[start..end].trim_end_matches(['\r', '\n']);
        Place::on_line(&self.file, line, text, span.start - start..span.end.max(span.start) - start)
    }

    /// The tree of the whole text, or every syntax error in it.
    pub fn tree(&self) -> Result<Node, Vec<Error>> {
        let (table, errors) = DeTable::parse_recoverable(self.text);
        if errors.is_empty() {
            Ok(Node { place: Place::whole(&self.file), value: Value::Table(self.entries(table.get_ref())) })
        } else {
            Err(self.syntax_errors(&errors))
        }
    }

    /// The tree of a text that is a single value.
    pub fn value(&self) -> Result<Node, Vec<Error>> {
        let (value, errors) = DeValue::parse_recoverable(self.text);
        if errors.is_empty() { Ok(self.node(&value)) } else { Err(self.syntax_errors(&errors)) }
    }

    /// The errors of the parser without those that follow from others: of a line only the first, and none after a
    /// list or table that is not closed. A key given twice confuses nothing and is always told.
    fn syntax_errors(&self, errors: &[toml::de::Error]) -> Vec<Error> {
        let mut errors: Vec<_> = errors
            .iter()
            .map(|error| (error.message(), self.place(error.span().unwrap_or(self.text.len()..self.text.len()))))
            .collect();
        errors.sort_by_key(|(_, place)| (place.line, place.column));
        let (mut last_line, mut open) = (0, false);
        errors.retain(|(message, place)| {
            let follows = *message != "duplicate key" && (open || place.line == last_line);
            last_line = place.line;
            open |= ["array", "key-value", "unclosed", "multi-line"].iter().any(|word| message.contains(word));
            !follows
        });
        let syntax = |(message, place): (&str, Place)| Error::Syntax {
            message: message.replace(", expected nothing", ""),
            place,
        };
        errors.into_iter().map(syntax).collect()
    }

    fn node(&self, spanned: &Spanned<DeValue<'_>>) -> Node {
        let value = match spanned.get_ref() {
            DeValue::String(text) => Value::Text(text.to_string()),
            DeValue::Integer(integer) => {
                let whole = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
                // Read from its digits, a decimal number beyond 64 bits is still a good number.
                let decimal = integer.as_str().parse().ok().filter(|_| integer.radix() == 10);
                let value = decimal.or(whole.map(|whole| whole as f64)).unwrap_or(f64::NAN);
                Value::Number { written: integer.to_string(), value, whole }
            }
            DeValue::Float(float) => {
                let value = float.as_str().parse().unwrap_or(f64::NAN);
                Value::Number { written: float.as_str().into(), value, whole: None }
            }
            DeValue::Boolean(flag) => Value::Flag(*flag),
            DeValue::Datetime(_) => Value::Date,
            DeValue::Array(list) => Value::List(list.iter().map(|node| self.node(node)).collect()),
            DeValue::Table(table) => Value::Table(self.entries(table)),
        };
        Node { place: self.place(spanned.span()), value }
    }

    /// The entries of a table in the order of the text.
    fn entries(&self, table: &DeTable<'_>) -> Vec<Entry> {
        let mut entries: Vec<_> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        entries
            .into_iter()
            .map(|(key, node)| Entry {
                key: key.get_ref().to_string(),
                place: self.place(key.span()),
                node: self.node(node),
            })
            .collect()
    }
}
