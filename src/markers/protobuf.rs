//! Protobuf messages, by the descriptors that come with the recording (<https://mcap.dev/spec/registry#protobuf>).

use prost_reflect::{DescriptorPool, DynamicMessage, Kind, MessageDescriptor, ReflectMessage, Value};

use super::fields::SchemaRecord;
use super::format::DecodeFault;
use super::message::{Payload, Tree};
use crate::error::{Fault, Unreadable};

/// Deepest nesting of messages that is looked into.
const DEPTH: usize = 32;

/// Messages of one type.
pub(super) struct Protobuf(MessageDescriptor);

impl Protobuf {
    pub fn new(schema: &SchemaRecord) -> Result<Protobuf, Unreadable> {
        let pool = DescriptorPool::decode(schema.text.as_slice())
            .map_err(|error| Unreadable::Descriptors { message: error.to_string() })?;
        let message = pool.get_message_by_name(&schema.name);
        message
            .map(Protobuf)
            .ok_or_else(|| Unreadable::Descriptors { message: format!("no `{}` in them", schema.name) })
    }
}

impl Payload for Protobuf {
    fn tree(&self, payload: &[u8]) -> Result<Tree, DecodeFault> {
        let message = DynamicMessage::decode(self.0.clone(), payload)
            .map_err(|error| DecodeFault { byte: 0, fault: Fault::Protobuf { message: error.to_string() } })?;
        // bytes of fields that the descriptor does not have: another message than it says
        if message.unknown_fields().next().is_some() {
            return Err(DecodeFault { byte: 0, fault: Fault::Shape });
        }
        Ok(fields(&message, 0))
    }
}

/// Every field of the type: numbers that are not set are 0, messages that are not set nothing.
fn fields(message: &DynamicMessage, depth: usize) -> Tree {
    if depth == DEPTH {
        return Tree::Nothing;
    }
    let descriptor = message.descriptor();
    let field = |field: prost_reflect::FieldDescriptor| {
        let unset = matches!(field.kind(), Kind::Message(_)) && !field.is_list() && !message.has_field(&field);
        let value = if unset { Tree::Nothing } else { value(&message.get_field(&field), depth) };
        (field.name().to_owned(), value)
    };
    Tree::Fields(descriptor.fields().map(field).collect())
}

fn value(of: &Value, depth: usize) -> Tree {
    match of {
        Value::Bool(flag) => Tree::Flag(*flag),
        Value::I32(number) | Value::EnumNumber(number) => Tree::Integer((*number).into()),
        Value::I64(number) => Tree::Integer(*number),
        Value::U32(number) => Tree::Integer((*number).into()),
        Value::U64(number) => i64::try_from(*number).map_or(Tree::Number(*number as f64), Tree::Integer),
        Value::F32(number) => Tree::Number((*number).into()),
        Value::F64(number) => Tree::Number(*number),
        Value::String(text) => Tree::Text(text.clone()),
        Value::Bytes(bytes) => Tree::Bytes(bytes.to_vec()),
        Value::Message(message) => fields(message, depth + 1),
        Value::List(list) => Tree::List(list.iter().map(|entry| value(entry, depth)).collect()),
        // no marker message has one
        Value::Map(_) => Tree::Nothing,
    }
}
