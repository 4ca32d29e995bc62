//! Recordings of surface markers: MCAP files in, one [`Recording`] out.
//!
//! ```text
//! file -> container (records, checksums) -> topic (which one) -> format (what its schema says) -> Recording
//! ```
//!
//! A file is read with distrust: a damaged byte is an error, never a wrong position. Missing samples are `None` and
//! counted by kind; time is never resampled; units are what the caller declares.
//!
//! [`read`] gives the recording of one topic, [`inspect`] says what is in a file, [`write_json`] writes our own format.

mod container;
mod damage;
mod fields;
mod format;
mod health;
mod inspect;
mod json;
mod read;
mod recording;
mod ros2;
mod topic;
mod write;

pub use damage::{Damage, Unguarded};
pub use format::{Fault, Unreadable};
pub use health::{Clock, Gap, Health, LabelHealth, Missing, Warning};
pub use inspect::{Contents, Extent, Inspection, MarkerTopic, inspect, inspect_bytes};
pub use read::{ReadOptions, read, read_bytes};
pub use recording::{Frame, Recording, Source, Units};
pub use ros2::SchemaFault;
pub use topic::Topic;
pub(crate) use topic::list as list_topics;
pub use write::{Compression, WriteOptions, write_json};
