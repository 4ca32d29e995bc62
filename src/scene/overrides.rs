//! `--set key=value`: values of the command line, merged into the tree of a file before it is checked.

use super::references::help_for_name;
use super::tree::{Entry, Node, Source, Value};
use crate::error::{Error, Place, Result};
use std::ops::Range;

const EXAMPLE: &str = "write it like --set solver.step_max=0.02 or --set muscle.slab.gauss=4";
const WITHOUT: &str = "write it like without = [\"muscle.slab\"] or without = [\"load[0]\"]";
const PREFIX: &str = "--set ";

/// Merges `argument` (`key=value`), the `number`th of the command line (from 1), into the tree.
pub(super) fn apply(root: &mut Node, argument: &str, number: usize) -> Result<()> {
    let line = Line { text: format!("{PREFIX}{argument}"), number };
    let steps = line.steps()?;
    let value = line.value()?;
    put(root, &steps, "", value, &line)
}

/// Takes away what `path` names, for example `contact.table` or `load[0]`.
pub(super) fn remove(root: &mut Node, path: &str) -> Result<()> {
    let line = Line { text: format!("{PREFIX}{path}="), number: 1 };
    let steps = line.steps()?;
    let nothing = || {
        line.mistake(
            PREFIX.len()..PREFIX.len() + path.len(),
            format!("there is no `{path}` to take away"),
            WITHOUT.into(),
        )
    };
    let (last, before) = steps.split_last().ok_or_else(nothing)?;
    let mut node = root;
    for step in before {
        node = step.within(node).ok_or_else(nothing)?;
    }
    let found = match (last, &mut node.value) {
        (Step::Key(key, _), Value::Table(entries)) => {
            let count = entries.len();
            entries.retain(|entry| entry.key != *key);
            entries.len() < count
        }
        (Step::Key(name, _), Value::List(list)) => {
            let count = list.len();
            list.retain(|node| node.name().is_none_or(|(named, _)| named != name));
            list.len() < count
        }
        (Step::Index(index, _), Value::List(list)) if *index < list.len() => {
            list.remove(*index);
            true
        }
        _ => false,
    };
    if found { Ok(()) } else { Err(nothing()) }
}

/// A part of the path to a value.
enum Step {
    Key(String, Range<usize>),
    Index(usize, Range<usize>),
}

/// An argument as the line a message shows.
struct Line {
    text: String,
    number: usize,
}

impl Step {
    /// What this step leads to.
    fn within<'n>(&self, node: &'n mut Node) -> Option<&'n mut Node> {
        match (self, &mut node.value) {
            (Step::Key(key, _), Value::Table(entries)) => {
                entries.iter_mut().find(|entry| entry.key == *key).map(|entry| &mut entry.node)
            }
            (Step::Key(name, _), Value::List(list)) => {
                list.iter_mut().find(|node| node.name().is_some_and(|(named, _)| named == name))
            }
            (Step::Index(index, _), Value::List(list)) => list.get_mut(*index),
            (Step::Index(..), _) | (Step::Key(..), _) => None,
        }
    }
}

impl Line {
    fn place(&self, span: Range<usize>) -> Place {
        Place::on_line(&"command line".into(), self.number, &self.text, span)
    }

    fn mistake(&self, span: Range<usize>, message: String, help: String) -> Error {
        Error::BadOverride { message, help, place: self.place(span) }
    }

    /// Where the `=` stands that ends the path: the first outside quotes.
    fn equals(&self) -> Result<usize> {
        let mut quoted = false;
        for (at, character) in self.text.char_indices() {
            match character {
                '"' => quoted = !quoted,
                '=' if !quoted => return Ok(at),
                _ => {}
            }
        }
        let span = PREFIX.len()..self.text.len();
        Err(self.mistake(span, "this is not `key=value`".into(), EXAMPLE.into()))
    }

    /// The path: keys between dots, quoted where they contain one, and `[0]` for an entry of a list.
    fn steps(&self) -> Result<Vec<Step>> {
        let end = self.equals()?;
        let mut steps = Vec::new();
        let mut at = PREFIX.len();
        loop {
            let rest = &self.text[at..end];
            let (key, length) = match rest.strip_prefix('"').and_then(|quoted| quoted.split_once('"')) {
                Some((key, _)) => (key, key.len() + 2),
                None => {
                    let length = rest.find(['.', '[']).unwrap_or(rest.len());
                    (rest[..length].trim(), length)
                }
            };
            if key.is_empty() {
                return Err(self.mistake(at..at + length, "a key is missing".into(), EXAMPLE.into()));
            }
            steps.push(Step::Key(key.into(), at..at + length));
            at += length;
            while let Some(index) = self.text[at..end].strip_prefix('[') {
                let digits = index.find(']').map(|close| &index[..close]);
                let Some((index, digits)) = digits.and_then(|digits| Some((digits.trim().parse().ok()?, digits)))
                else {
                    let help = "write it like --set muscle[0].gauss=4".into();
                    return Err(self.mistake(at..end, "this is not an index".into(), help));
                };
                steps.push(Step::Index(index, at..at + digits.len() + 2));
                at += digits.len() + 2;
            }
            match self.text[at..end].strip_prefix('.') {
                Some(_) => at += 1,
                None if self.text[at..end].trim().is_empty() => return Ok(steps),
                None => {
                    let message = format!("`{}` is not understood", &self.text[at..end]);
                    return Err(self.mistake(at..end, message, EXAMPLE.into()));
                }
            }
        }
    }

    /// The value, which is TOML; a shell eats quotes, so that a bare word is text.
    fn value(&self) -> Result<Node> {
        let start = self.equals()? + 1;
        let text = self.text[start..].trim();
        let place = self.place(start..self.text.len());
        let value = match Source::new("", text).value() {
            Ok(node) => node.moved(&place).value,
            Err(_) if text.starts_with(|first: char| first.is_alphabetic() || "./~_".contains(first)) => {
                Value::Text(text.into())
            }
            Err(_) => {
                let help = "write a number, true, false, a word, or a TOML list: [1, 2, 3]".into();
                return Err(self.mistake(start..self.text.len(), format!("\"{text}\" is not a value"), help));
            }
        };
        Ok(Node { place, value })
    }
}

impl Node {
    /// The same value at another place.
    fn moved(self, place: &Place) -> Node {
        let value = match self.value {
            Value::List(list) => Value::List(list.into_iter().map(|node| node.moved(place)).collect()),
            Value::Table(entries) => Value::Table(
                entries
                    .into_iter()
                    .map(|entry| Entry { key: entry.key, place: place.clone(), node: entry.node.moved(place) })
                    .collect(),
            ),
            plain => plain,
        };
        Node { place: place.clone(), value }
    }
}

/// Puts `value` where `steps` lead from `node`, which is called `path`; tables on the way are made as needed.
fn put(node: &mut Node, steps: &[Step], path: &str, value: Node, line: &Line) -> Result<()> {
    let Some(step) = steps.first() else {
        *node = value;
        return Ok(());
    };
    let description = node.describe();
    match (step, &mut node.value) {
        (Step::Key(key, span), Value::Table(entries)) => {
            // A key with dots in it may be meant: the longest one that exists.
            let long = |taken: &usize| joined(steps, *taken).filter(|key| entries.iter().any(|e| e.key == *key));
            let taken = (1..=steps.len()).rev().find(|taken| long(taken).is_some()).unwrap_or(1);
            let key = joined(steps, taken).unwrap_or_else(|| key.clone());
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            let index = entries.iter().position(|entry| entry.key == key).unwrap_or_else(|| {
                let place = line.place(span.clone());
                let node = Node { place: place.clone(), value: Value::Table(Vec::new()) };
                entries.push(Entry { key, place, node });
                entries.len() - 1
            });
            put(&mut entries[index].node, &steps[taken..], &path, value, line)
        }
        (Step::Index(index, span), Value::List(list)) => {
            let count = list.len();
            match list.get_mut(*index) {
                Some(node) => put(node, &steps[1..], &format!("{path}[{index}]"), value, line),
                None => {
                    let message = format!("`{path}` has no entry {index}: it has {count}");
                    Err(line.mistake(span.clone(), message, "entries are counted from 0".into()))
                }
            }
        }
        (Step::Key(key, span), Value::List(list)) => {
            let names: Vec<String> = list.iter().filter_map(|node| Some(node.name()?.0.to_string())).collect();
            let found = (1..=steps.len()).rev().find_map(|taken| {
                let name = joined(steps, taken)?;
                let index = list.iter().position(|node| node.name().is_some_and(|(named, _)| named == name))?;
                Some((taken, index, name))
            });
            match found {
                Some((taken, index, name)) => {
                    put(&mut list[index], &steps[taken..], &format!("{path}.{name}"), value, line)
                }
                None => {
                    let help = format!(
                        "{} An entry can also be counted, from 0: {path}[0]",
                        help_for_name(key, &names, "names")
                    );
                    Err(line.mistake(span.clone(), format!("no `{path}` is called `{key}`"), help))
                }
            }
        }
        (Step::Key(_, span) | Step::Index(_, span), _) => {
            let message = format!("`{path}` holds nothing to set: it is {description}");
            Err(line.mistake(span.clone(), message, format!("write --set {path}=...")))
        }
    }
}

/// The first `count` steps as one key with dots, if they are all keys.
fn joined(steps: &[Step], count: usize) -> Option<String> {
    let keys = steps[..count].iter().map(|step| match step {
        Step::Key(key, _) => Some(key.as_str()),
        Step::Index(..) => None,
    });
    Some(keys.collect::<Option<Vec<_>>>()?.join("."))
}
