//! Reading a tree strictly: every key is asked for by name, and what was not asked for is a mistake.
//!
//! A reading function returns `None` when it has noted a mistake. Callers read all they want before they look at
//! any `None`, so that one mistake never hides another.

use super::nearest::{nearest, same_but_for_unit, unit_of};
use super::tree::{Node, Value};
use crate::error::{Error, Place};
use std::cell::RefCell;

/// The mistakes found so far.
#[derive(Default)]
pub(super) struct Mistakes(RefCell<Vec<Error>>);

impl Mistakes {
    pub fn add(&self, mistake: Error) {
        self.0.borrow_mut().push(mistake);
    }

    /// All mistakes in the order of their lines, those of `file` first.
    pub fn sorted(self, file: &str) -> Vec<Error> {
        let mut mistakes = self.0.into_inner();
        mistakes.sort_by_key(|mistake| mistake.place().map(|place| (&*place.file != file, place.line, place.column)));
        mistakes
    }
}

/// What a number may be.
#[derive(Clone, Copy)]
pub(super) struct Range {
    /// In words that follow "it must be".
    pub allowed: &'static str,
    /// Whether a finite number is allowed.
    pub holds: fn(f64) -> bool,
}

pub(super) const FINITE: Range = Range { allowed: "a finite number", holds: |_| true };
pub(super) const POSITIVE: Range = Range { allowed: "greater than 0", holds: |x| x > 0.0 };
pub(super) const NOT_NEGATIVE: Range = Range { allowed: "0 or more", holds: |x| x >= 0.0 };
pub(super) const ACTIVATION: Range = Range { allowed: "from 0 to 1", holds: |x| (0.0..=1.0).contains(&x) };
pub(super) const PART: Range = Range { allowed: "greater than 0 and at most 1", holds: |x| x > 0.0 && x <= 1.0 };

/// A value on its way to be read.
pub(super) struct Item<'a> {
    pub node: &'a Node,
    /// The keys that lead to it from the root, as `--set` takes them.
    pub path: String,
    pub mistakes: &'a Mistakes,
}

impl<'a> Item<'a> {
    pub fn wrong_type<T>(&self, expected: &str) -> Option<T> {
        self.mistakes.add(Error::WrongType {
            key: self.path.clone(),
            expected: expected.into(),
            found: self.node.describe().into(),
            place: self.node.place.clone(),
        });
        None
    }

    /// Notes that the number here, as written, is not allowed.
    pub fn out_of_range<T>(&self, written: &str, allowed: &str) -> Option<T> {
        let key = self.path.rsplit('.').next().unwrap_or_default();
        let unit = unit_of(key).map(|unit| format!(" {unit}")).unwrap_or_default();
        self.mistakes.add(Error::OutOfRange {
            key: self.path.clone(),
            value: format!("{written}{unit}").into(),
            allowed: allowed.into(),
            place: self.node.place.clone(),
        });
        None
    }

    pub fn number(&self, range: Range) -> Option<f64> {
        match &self.node.value {
            Value::Number { value, .. } if value.is_finite() && (range.holds)(*value) => Some(*value),
            Value::Number { written, value, .. } if value.is_finite() => self.out_of_range(written, range.allowed),
            Value::Number { written, .. } => self.out_of_range(written, FINITE.allowed),
            _ => self.wrong_type("a number"),
        }
    }

    /// A whole number from `least` to `most`.
    pub fn whole(&self, least: usize, most: usize) -> Option<usize> {
        let Value::Number { written, whole, .. } = &self.node.value else {
            return self.wrong_type("a whole number");
        };
        match whole.and_then(|whole| usize::try_from(whole).ok()) {
            Some(whole) if (least..=most).contains(&whole) => Some(whole),
            _ => self.out_of_range(written, &format!("a whole number from {least} to {most}")),
        }
    }

    pub fn flag(&self) -> Option<bool> {
        match self.node.value {
            Value::Flag(flag) => Some(flag),
            _ => self.wrong_type("true or false"),
        }
    }

    pub fn text(&self) -> Option<&'a str> {
        match &self.node.value {
            Value::Text(text) => Some(text),
            _ => self.wrong_type("text"),
        }
    }

    /// Text that is not empty.
    pub fn name(&self) -> Option<String> {
        match self.text()? {
            "" => self.out_of_range("\"\"", "a name"),
            name => Some(name.into()),
        }
    }

    /// One of `words`, or one of the words that a `later` version will know.
    pub fn choice<T: Copy>(&self, words: &[(&str, T)], later: &[(&str, &'static str)]) -> Option<T> {
        let written = self.text()?;
        if let Some((_, choice)) = words.iter().find(|(word, _)| *word == written) {
            return Some(*choice);
        }
        let all = words.iter().map(|(word, _)| format!("\"{word}\"")).collect::<Vec<_>>().join(", ");
        let key = format!("{} = \"{written}\"", self.path);
        let place = self.node.place.clone();
        if let Some((_, what)) = later.iter().find(|(word, _)| *word == written) {
            self.mistakes.add(Error::NotInThisVersion {
                key,
                what,
                instead: format!("this version has {all}"),
                place,
            });
            return None;
        }
        let help = match nearest(written, words.iter().map(|(word, _)| *word)) {
            Some(word) => format!("did you mean \"{word}\"? it can be {all}"),
            None => format!("it can be {all}"),
        };
        self.mistakes.add(Error::UnknownChoice { key: self.path.clone(), value: written.into(), help, place });
        None
    }

    /// The entries of a list, each read by `read`.
    pub fn list<T>(&self, expected: &str, mut read: impl FnMut(Item<'a>) -> Option<T>) -> Option<Vec<T>> {
        let Value::List(nodes) = &self.node.value else {
            return self.wrong_type(expected);
        };
        let item = |(index, node)| Item { node, path: format!("{}[{index}]", self.path), mistakes: self.mistakes };
        // Every entry is read before any failure is looked at.
        let entries: Vec<Option<T>> = nodes.iter().enumerate().map(|entry| read(item(entry))).collect();
        entries.into_iter().collect()
    }

    /// The three entries of a vector.
    pub fn triple<T>(&self, expected: &str, read: impl FnMut(Item<'a>) -> Option<T>) -> Option<[T; 3]> {
        let entries = self.list(expected, read)?;
        let count = entries.len();
        entries.try_into().ok().or_else(|| self.wrong_length(&format!("{count} entries"), "3 (x, y, z)"))
    }

    pub fn numbers(&self, range: Range) -> Option<[f64; 3]> {
        // The unit stands in the key of the list, not in the index.
        self.triple("a list of 3 numbers", |item| item.number(range))
    }

    pub fn wrong_length<T>(&self, found: &str, expected: &str) -> Option<T> {
        self.mistakes.add(Error::WrongLength {
            key: self.path.clone(),
            found: found.into(),
            expected: expected.into(),
            place: self.node.place.clone(),
        });
        None
    }

    /// A table; `read` asks for its keys, and what it does not ask for is a mistake.
    pub fn table<T>(&self, read: impl FnOnce(&mut Table<'a>) -> Option<T>) -> Option<T> {
        if self.node.entries().is_none() {
            return self.wrong_type("a table");
        }
        let mut table = Table {
            node: self.node,
            path: self.path.clone(),
            mistakes: self.mistakes,
            asked: Vec::new(),
            missing: Vec::new(),
        };
        let read = read(&mut table);
        let complete = table.finish();
        read.filter(|_| complete)
    }
}

/// A table being read: remembers which keys were asked for.
pub(super) struct Table<'a> {
    node: &'a Node,
    path: String,
    mistakes: &'a Mistakes,
    asked: Vec<&'static str>,
    /// Required keys that are absent, each with an example of its use.
    missing: Vec<(&'static str, &'static str)>,
}

impl<'a> Table<'a> {
    /// Where mistakes are noted.
    pub fn mistakes(&self) -> &'a Mistakes {
        self.mistakes
    }

    /// The header of the table.
    pub fn place(&self) -> Place {
        self.node.place.clone()
    }

    /// The value under a key, or the header of the table where it is absent.
    pub fn place_of(&self, key: &str) -> Place {
        let entry = self.node.entries().and_then(|entries| entries.iter().find(|entry| entry.key == key));
        entry.map_or_else(|| self.place(), |entry| entry.node.place.clone())
    }

    /// The value of a key, if it is there.
    pub fn item(&mut self, key: &'static str) -> Option<Item<'a>> {
        self.asked.push(key);
        let entry = self.node.entries()?.iter().find(|entry| entry.key == key)?;
        let path = if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) };
        Some(Item { node: &entry.node, path, mistakes: self.mistakes })
    }

    /// A key that must be there; `example` shows how it is written.
    pub fn required<T>(
        &mut self,
        key: &'static str,
        example: &'static str,
        read: impl FnOnce(Item<'a>) -> Option<T>,
    ) -> Option<T> {
        match self.item(key) {
            Some(item) => read(item),
            None => {
                self.missing.push((key, example));
                None
            }
        }
    }

    /// A key that may be absent: `Some(None)` then.
    pub fn optional<T>(&mut self, key: &'static str, read: impl FnOnce(Item<'a>) -> Option<T>) -> Option<Option<T>> {
        match self.item(key) {
            Some(item) => read(item).map(Some),
            None => Some(None),
        }
    }

    /// A key with a default.
    pub fn or<T>(&mut self, key: &'static str, default: T, read: impl FnOnce(Item<'a>) -> Option<T>) -> Option<T> {
        match self.item(key) {
            Some(item) => read(item),
            None => Some(default),
        }
    }

    /// A list of tables, `[[key]]`; none at all is an empty list.
    pub fn tables<T>(
        &mut self,
        key: &'static str,
        mut read: impl FnMut(&mut Table<'a>) -> Option<T>,
    ) -> Option<Vec<T>> {
        let Some(item) = self.item(key) else {
            return Some(Vec::new());
        };
        item.list("a list of tables", |mut element| {
            // A named element is called by its name, as `--set muscle.slab.gauss=4` does.
            if let Some((name, _)) = element.node.name() {
                element.path = format!("{key}.{name}");
            }
            element.table(&mut read)
        })
    }

    /// A list of tables that must not be empty.
    pub fn must_hold(&mut self, key: &'static str, example: &'static str) {
        if self.node.tables(key).is_empty() {
            self.missing.push((key, example));
        }
    }

    /// Notes that a key, which is absent, must be there.
    pub fn require(&mut self, key: &'static str, example: &'static str) {
        self.missing.push((key, example));
    }

    /// Whether a key is there; it still has to be asked for.
    pub fn has(&self, key: &str) -> bool {
        self.entry_key(key).is_some()
    }

    /// The one key of a table that chooses among alternatives.
    pub fn one_of<T>(&mut self, choices: &[(&'static str, Reader<'a, T>)]) -> Option<T> {
        let mut found: Vec<&str> = Vec::new();
        let mut read = None;
        for (key, reader) in choices {
            if let Some(item) = self.item(key) {
                read = reader(item);
                found.push(key);
            }
        }
        if found.len() == 1 {
            return read;
        }
        // A misspelt choice is already told as an unknown key.
        let misspelt = self.unknown().any(|(key, _)| nearest(key, choices.iter().map(|(key, _)| *key)).is_some());
        if !(found.is_empty() && misspelt) {
            let choices: Vec<&str> = choices.iter().map(|(key, _)| *key).collect();
            self.not_exactly_one::<T>(&choices, &found);
        }
        None
    }

    /// Notes that not exactly one of `choices` was `found`.
    pub fn not_exactly_one<T>(&self, choices: &[&str], found: &[&str]) -> Option<T> {
        let quoted = |keys: &[&str]| keys.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
        self.mistakes.add(Error::NotExactlyOne {
            table: self.describe(),
            choices: quoted(choices),
            found: if found.is_empty() { "none".into() } else { quoted(found).into() },
            place: self.place(),
        });
        None
    }

    /// Notes that `key` contradicts the key `other`; points at `key`, or at `other` where `key` has its default `value`.
    pub fn contradiction<T>(&self, key: &str, other: &str, value: f64, allowed: &str) -> Option<T> {
        let entries = self.node.entries().unwrap_or_default();
        let node = |key: &str| entries.iter().find(|entry| entry.key == key).map(|entry| &entry.node);
        let written = match node(key).map(|node| &node.value) {
            Some(Value::Number { written, .. }) => written.clone(),
            _ => format!("{value:?}"),
        };
        let (node, path) = (node(key).or(node(other)).unwrap_or(self.node), format!("{}.{key}", self.path));
        Item { node, path, mistakes: self.mistakes }.out_of_range(&written, allowed)
    }

    fn describe(&self) -> String {
        if self.path.is_empty() { "the problem file".into() } else { format!("`{}`", self.path) }
    }

    fn entry_key(&self, key: &str) -> Option<&'a Place> {
        self.node.entries()?.iter().find(|entry| entry.key == key).map(|entry| &entry.place)
    }

    /// The keys that nobody asked for.
    fn unknown(&self) -> impl Iterator<Item = (&'a str, &'a Place)> {
        let entries = self.node.entries().unwrap_or_default().iter();
        entries
            .filter(|entry| !self.asked.contains(&entry.key.as_str()))
            .map(|entry| (entry.key.as_str(), &entry.place))
    }

    /// Notes every unknown and every missing key; true if there is none.
    fn finish(mut self) -> bool {
        let unknown: Vec<_> = self.unknown().collect();
        let complete = unknown.is_empty() && self.missing.is_empty();
        for (key, place) in unknown {
            let (absent, present): (Vec<&str>, Vec<&str>) =
                self.asked.iter().copied().partition(|known| self.entry_key(known).is_none());
            let near = nearest(key, absent.into_iter());
            let help = match near {
                Some(known) => {
                    // Told once: the misspelt key is the missing one.
                    self.missing.retain(|(missing, _)| *missing != known);
                    let unit = unit_of(known).filter(|_| same_but_for_unit(key, known));
                    let unit = unit.map(|unit| format!(" (the unit is part of the key: a number in {unit})"));
                    format!("did you mean `{known}`?{}", unit.unwrap_or_default())
                }
                None => match nearest(key, present.into_iter()) {
                    Some(known) => format!("did you mean `{known}`? it is there already: remove one"),
                    None => format!("it can hold: {}", self.asked.join(", ")),
                },
            };
            let (key, table) = (key.into(), self.describe());
            self.mistakes.add(Error::UnknownKey { key, table, help, place: place.clone() });
        }
        if !self.missing.is_empty() {
            let keys = self.missing.iter().map(|(key, _)| format!("`{key}`")).collect::<Vec<_>>().join(", ");
            let examples = self.missing.iter().map(|(_, example)| *example).collect::<Vec<_>>().join("\n");
            let help = format!("add, for example:\n{examples}");
            self.mistakes.add(Error::MissingKey {
                table: self.describe(),
                keys: keys.into(),
                help,
                place: self.place(),
            });
        }
        complete
    }
}

/// How the value of one alternative is read.
pub(super) type Reader<'a, T> = fn(Item<'a>) -> Option<T>;
