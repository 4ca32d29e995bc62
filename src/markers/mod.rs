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
mod fields;
mod files;
mod format;
mod health;
mod inspect;
mod json;
mod message;
mod named;
mod pose;
mod protobuf;
mod read;
mod recording;
mod ros2;
mod topic;
mod write;

pub use crate::error::{Damage, Fault, Missing, SchemaFault, Topic, Unguarded, Unreadable};
pub use crate::scene::Units;
pub use health::{Clock, Gap, Health, LabelHealth, Warning};
pub use inspect::{Contents, Extent, Inspection, MarkerTopic, inspect, inspect_bytes};
pub use pose::{Poses, read_poses, read_poses_bytes};
pub use read::{ReadOptions, read, read_bytes};
pub use recording::{BoneNoise, Frame, Recording, Source};
pub use write::{Compression, WriteOptions, write_json};
