//! The `ros2msg` schema text of a recording as a tree of types.
//!
//! The text holds the message and, behind lines of `=` and `MSG: package/Type`, every message it uses
//! (<https://mcap.dev/spec/registry#ros2msg>). The language: <https://design.ros2.org/articles/legacy_interface_definition.html>.

use std::collections::BTreeMap;

use crate::error::SchemaFault;

/// Deepest nesting of messages that is accepted.
const DEPTH_LIMIT: usize = 32;

/// All types a message is made of.
#[derive(Debug)]
pub(super) struct Types {
    /// The message itself is the last.
    types: Vec<Vec<Field>>,
}

/// One field of a message.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub name: String,
    pub kind: Kind,
    pub count: Count,
}

/// What a field holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    Bool,
    /// Signed integer of so many bytes.
    Integer(usize),
    /// Unsigned integer of so many bytes.
    Unsigned(usize),
    /// Floating point number of 4 or 8 bytes.
    Float(usize),
    /// UTF-8 text with at most so many bytes.
    Text(Option<usize>),
    /// Another message, by its index.
    Message(usize),
}

/// How many of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Count {
    One,
    Fixed(usize),
    /// A sequence with its own length, at most so many.
    Sequence(Option<usize>),
}

/// A field before the names of types are resolved.
#[derive(Debug, PartialEq)]
struct Declared {
    name: String,
    base: Result<Kind, String>,
    count: Count,
}

impl Types {
    /// Reads the schema text of the message `name`.
    pub fn parse(name: &str, text: &[u8]) -> Result<Types, SchemaFault> {
        let text = std::str::from_utf8(text).map_err(|_| SchemaFault::NotText)?;
        let root = short_name(name);
        let mut declared = BTreeMap::new();
        let (mut current, mut fields) = (root.clone(), Vec::new());
        let mut lines = text.lines().enumerate();
        while let Some((index, line)) = lines.next() {
            let bad = || SchemaFault::Line { line: index + 1, text: line.chars().take(80).collect() };
            let content = line.split('#').next().unwrap_or("").trim();
            if content.is_empty() {
                continue;
            }
            if content.len() >= 3 && content.bytes().all(|byte| byte == b'=') {
                let title = lines.next().and_then(|(_, title)| title.trim().strip_prefix("MSG:"));
                define(&mut declared, std::mem::take(&mut current), std::mem::take(&mut fields))?;
                current = short_name(title.ok_or_else(bad)?.trim());
                continue;
            }
            let (kind, rest) = content.split_once(char::is_whitespace).ok_or_else(bad)?;
            if let Some(field) = declaration(&current, kind, rest.trim()).ok_or_else(bad)? {
                fields.push(field);
            }
        }
        define(&mut declared, current, fields)?;
        let mut resolver = Resolver { declared: &declared, done: BTreeMap::new(), types: Vec::new() };
        resolver.resolve(&root, 0)?;
        Ok(Types { types: resolver.types })
    }

    /// The message itself.
    pub fn root(&self) -> usize {
        self.types.len().saturating_sub(1)
    }

    /// The fields of a message, in the order of the bytes.
    pub fn fields(&self, message: usize) -> &[Field] {
        self.types.get(message).map_or(&[], Vec::as_slice)
    }

    /// Place and declaration of the field `name` of a message.
    pub fn field(&self, message: usize, name: &str) -> Option<(usize, &Field)> {
        self.fields(message).iter().enumerate().find(|(_, field)| field.name == name)
    }
}

/// `package/msg/Type` as `package/Type`.
fn short_name(name: &str) -> String {
    name.replace("/msg/", "/")
}

fn define(
    declared: &mut BTreeMap<String, Vec<Declared>>,
    name: String,
    fields: Vec<Declared>,
) -> Result<(), SchemaFault> {
    match declared.get(&name) {
        Some(known) if *known == fields => Ok(()),
        Some(_) => Err(SchemaFault::Twice { name }),
        None => {
            declared.insert(name, fields);
            Ok(())
        }
    }
}

/// A field, `Some(None)` for a constant, `None` for nonsense. `message` is the full name of the message it is in.
fn declaration(message: &str, kind: &str, rest: &str) -> Option<Option<Declared>> {
    let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len());
    let (name, value) = rest.split_at(end);
    if name.is_empty() {
        return None;
    }
    if value.trim_start().starts_with('=') {
        return Some(None);
    }
    // Behind a field may stand, after a space, its default value.
    if !value.is_empty() && !value.starts_with(char::is_whitespace) {
        return None;
    }
    let (base, count) = match kind.split_once('[') {
        None => (kind, Count::One),
        Some((base, count)) => (base, array(count.strip_suffix(']')?)?),
    };
    Some(Some(Declared { name: name.into(), base: base_kind(message, base)?, count }))
}

fn array(inside: &str) -> Option<Count> {
    match inside.strip_prefix("<=") {
        Some(bound) => Some(Count::Sequence(Some(bound.parse().ok()?))),
        None if inside.is_empty() => Some(Count::Sequence(None)),
        None => inside.parse().ok().filter(|count| *count > 0).map(Count::Fixed),
    }
}

/// A builtin kind, or the full name of a message.
fn base_kind(message: &str, name: &str) -> Option<Result<Kind, String>> {
    Some(Ok(match name {
        "bool" => Kind::Bool,
        "byte" | "char" | "uint8" => Kind::Unsigned(1),
        "uint16" => Kind::Unsigned(2),
        "uint32" => Kind::Unsigned(4),
        "uint64" => Kind::Unsigned(8),
        "int8" => Kind::Integer(1),
        "int16" => Kind::Integer(2),
        "int32" => Kind::Integer(4),
        "int64" => Kind::Integer(8),
        "float32" => Kind::Float(4),
        "float64" => Kind::Float(8),
        "string" => Kind::Text(None),
        "Header" => return Some(Err("std_msgs/Header".into())),
        other => match other.strip_prefix("string<=") {
            Some(bound) => Kind::Text(Some(bound.parse().ok()?)),
            None if other.contains('/') => return Some(Err(short_name(other))),
            None => {
                let package = message.split('/').next().unwrap_or("");
                return Some(Err(format!("{package}/{other}")));
            }
        },
    }))
}

struct Resolver<'a> {
    declared: &'a BTreeMap<String, Vec<Declared>>,
    done: BTreeMap<&'a str, usize>,
    types: Vec<Vec<Field>>,
}

impl<'a> Resolver<'a> {
    /// Resolves what `name` uses, then `name`; a cycle runs into the limit.
    fn resolve(&mut self, name: &str, depth: usize) -> Result<usize, SchemaFault> {
        if let Some(index) = self.done.get(name) {
            return Ok(*index);
        }
        if depth >= DEPTH_LIMIT {
            return Err(SchemaFault::Nesting { name: name.into(), limit: DEPTH_LIMIT });
        }
        let undefined = || SchemaFault::Undefined { name: name.into() };
        let (name, declared) = self.declared.get_key_value(name).ok_or_else(undefined)?;
        let mut fields = Vec::with_capacity(declared.len());
        for field in declared {
            let kind = match &field.base {
                Ok(kind) => kind.clone(),
                Err(message) => Kind::Message(self.resolve(message, depth + 1)?),
            };
            fields.push(Field { name: field.name.clone(), kind, count: field.count.clone() });
        }
        self.types.push(fields);
        self.done.insert(name, self.types.len() - 1);
        Ok(self.types.len() - 1)
    }
}
