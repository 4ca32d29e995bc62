//! The topics of a file, and which of them carries markers.

use std::collections::BTreeMap;

use super::container::{Container, Traffic};
use super::format::{self, Decoder};
use crate::error::{Topic, Unreadable};

/// A topic with what reads its messages.
pub(super) struct Reader {
    pub topic: Topic,
    /// One per channel of the topic; every one must be readable for the topic to be.
    pub decoders: BTreeMap<u16, Box<dyn Decoder>>,
    /// Units in the metadata of its channels.
    pub units: Vec<String>,
    /// Why the topic is not readable.
    pub fault: Option<Unreadable>,
}

/// All topics of a file by name.
pub(super) fn readers(container: &Container) -> BTreeMap<String, Reader> {
    let mut readers: BTreeMap<String, Reader> = BTreeMap::new();
    for (id, channel) in &container.channels {
        let schema = container.schemas.get(&channel.schema);
        let (name, encoding) = schema.map_or(("", ""), |schema| (&schema.name, &schema.encoding));
        let reader = readers.entry(channel.topic.clone()).or_insert_with(|| Reader {
            topic: Topic {
                name: channel.topic.clone(),
                schema: name.into(),
                schema_encoding: encoding.into(),
                message_encoding: channel.encoding.clone(),
                messages: 0,
                log_time_ns: None,
                markers: Ok(String::new()),
            },
            decoders: BTreeMap::new(),
            units: Vec::new(),
            fault: None,
        });
        if let Some(Traffic { messages, first, last }) = container.traffic.get(id).copied() {
            let [start, end] = reader.topic.log_time_ns.unwrap_or([first, last]);
            reader.topic.log_time_ns = Some([start.min(first), end.max(last)]);
            reader.topic.messages += messages;
        }
        let units = ["unit", "units"].into_iter().filter_map(|key| channel.metadata.get(key));
        reader.units.extend(units.cloned());
        match format::decoder(schema, &channel.encoding) {
            Ok((format, decoder)) => {
                reader.decoders.insert(*id, decoder);
                reader.topic.markers = reader.topic.markers.clone().map(|_| format.into());
            }
            Err(fault) => {
                reader.topic.markers = Err(fault.to_string());
                reader.fault = Some(fault);
            }
        }
    }
    readers
}
