//! The pose of a head from a topic of its own.
//!
//! `geometry_msgs/msg/PoseStamped`, `PoseWithCovarianceStamped`, `TransformStamped`, `nav_msgs/msg/Odometry`,
//! `foxglove.PoseInFrame` and `foxglove.FrameTransform`, in any encoding: known by the name of the schema.

use std::path::Path;

use super::container::{Container, Message};
use super::fields::SchemaRecord;
use super::format::DecodeFault;
use super::health::Clock;
use super::message::{Payload, Placed, Tree, aligned, payload};
use super::read::{ReadOptions, load, nearest_topic};
use super::topic::readers;
use crate::error::{Error, Fault, Result, Topic, Unreadable};
use crate::math::motion::Motion;

/// A message that holds a pose: the end of its schema's name, and where position, orientation and stamp are.
const KINDS: [(&str, [&str; 3]); 6] = [
    ("PoseStamped", ["pose.position", "pose.orientation", "header.stamp"]),
    ("PoseWithCovarianceStamped", ["pose.pose.position", "pose.pose.orientation", "header.stamp"]),
    ("Odometry", ["pose.pose.position", "pose.pose.orientation", "header.stamp"]),
    ("TransformStamped", ["transform.translation", "transform.rotation", "header.stamp"]),
    ("PoseInFrame", ["pose.position", "pose.orientation", "timestamp"]),
    ("FrameTransform", ["translation", "rotation", "timestamp"]),
];

/// Two poses farther apart than this many median intervals have nothing known between them.
const GAP: f64 = 1.5;

/// The poses of a body over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Poses {
    /// Stamp of each, nanoseconds, increasing.
    stamps: Vec<i64>,
    poses: Vec<Placed>,
    /// Longest interval that is interpolated, nanoseconds.
    longest: f64,
}

impl Poses {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.stamps.len()
    }

    /// The motion that takes the body from its own axes to where it is at a time (ns), positions in mm; between two poses on
    /// the shortest way. `None` before the first, after the last, and in gaps of more than 1.5 median intervals.
    pub fn at(&self, stamp_ns: i64) -> Option<Motion> {
        let after = self.stamps.partition_point(|stamp| *stamp < stamp_ns);
        if self.stamps.get(after) == Some(&stamp_ns) {
            return Some(motion(&self.poses[after]));
        }
        let before = after.checked_sub(1)?;
        let (from, to) = (*self.stamps.get(before)?, *self.stamps.get(after)?);
        let length = to.checked_sub(from)? as f64;
        if length > self.longest {
            return None;
        }
        let part = (stamp_ns - from) as f64 / length;
        Some(motion(&between(&self.poses[before], &self.poses[after], part)))
    }
}

fn motion(pose: &Placed) -> Motion {
    let origin = Placed { position: [0.0; 3], ..*pose };
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| origin.place(axis));
    let turn = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
    Motion { scale: 1.0, turn, shift: pose.position }
}

/// Linear in position, at constant angular speed in orientation (Shoemake 1985).
fn between(a: &Placed, b: &Placed, part: f64) -> Placed {
    let position = std::array::from_fn(|i| a.position[i] + part * (b.position[i] - a.position[i]));
    let sign = if aligned(a.orientation, b.orientation) { 1.0 } else { -1.0 };
    let cosine: f64 = sign * a.orientation.iter().zip(b.orientation).map(|(a, b)| a * b).sum::<f64>();
    let angle = cosine.clamp(-1.0, 1.0).acos();
    let [wa, wb] = match angle {
        small if small < 1e-6 => [1.0 - part, part],
        angle => [((1.0 - part) * angle).sin() / angle.sin(), (part * angle).sin() / angle.sin()],
    };
    let orientation: [f64; 4] = std::array::from_fn(|i| wa * a.orientation[i] + sign * wb * b.orientation[i]);
    let length = orientation.iter().map(|q| q * q).sum::<f64>().sqrt();
    Placed { position, orientation: orientation.map(|q| q / length) }
}

/// Reads the poses of a topic, on the clock of the markers they go with. `options` are those of the markers.
///
/// Errors: M001 to M004, M007 to M009, M011, M012, O001; see [`crate::Error`].
pub fn read_poses(path: &Path, topic: &str, clock: Clock, options: &ReadOptions) -> Result<Poses> {
    read_poses_bytes(path, &load(path)?, topic, clock, options)
}

/// [`read_poses`] for a file that is already in memory; `path` names it in messages.
pub fn read_poses_bytes(
    path: &Path,
    bytes: &[u8],
    topic: &str,
    clock: Clock,
    options: &ReadOptions,
) -> Result<Poses> {
    let container = Container::read(path, bytes, &|channel, _| channel.topic == topic)?;
    super::read::admit(path, &container, options)?;
    let topics = || -> Vec<Topic> { readers(&container).into_values().map(|reader| reader.topic).collect() };
    let channels: Vec<_> = container.channels.iter().filter(|(_, channel)| channel.topic == topic).collect();
    if channels.is_empty() {
        let topics = topics();
        let nearest = nearest_topic(&topics, topic);
        return Err(Error::TopicNotFound { path: path.into(), topic: topic.into(), nearest, topics });
    }
    let mut found = Vec::new();
    for (id, channel) in channels {
        let schema = container.schemas.get(&channel.schema).ok_or(Unreadable::NoSchema);
        let decoder = schema.and_then(|schema| PoseDecoder::new(schema, &channel.encoding)).map_err(|reason| {
            Error::TopicNotReadable { path: path.into(), topic: topic.into(), reason, topics: topics() }
        })?;
        for message in container.messages.iter().filter(|message| message.channel == *id) {
            let pose = decoder.decode(&message.payload, message, clock);
            let (stamp, mut pose) = pose.map_err(|fault| super::read::undecodable(path, topic, message, fault))?;
            pose.position = pose.position.map(|x| x * options.units.mm());
            found.push((stamp, pose));
        }
    }
    if found.is_empty() {
        return Err(Error::EmptyTopic { path: path.into(), topic: topic.into() });
    }
    found.sort_by_key(|(stamp, _)| *stamp);
    found.dedup_by_key(|(stamp, _)| *stamp);
    let (stamps, poses): (Vec<i64>, Vec<Placed>) = found.into_iter().unzip();
    let mut intervals: Vec<f64> = stamps.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
    intervals.sort_by(f64::total_cmp);
    let longest = intervals.get(intervals.len() / 2).map_or(0.0, |median| GAP * median);
    Ok(Poses { stamps, poses, longest })
}

struct PoseDecoder {
    payload: Box<dyn Payload>,
    names: [&'static str; 3],
}

impl PoseDecoder {
    fn new(schema: &SchemaRecord, encoding: &str) -> std::result::Result<PoseDecoder, Unreadable> {
        let name = schema.name.rsplit(['/', '.']).next().unwrap_or_default();
        let (_, names) = KINDS.into_iter().find(|(kind, _)| *kind == name).ok_or(Unreadable::Layout {
            expected: "a pose: it is none of PoseStamped, PoseWithCovarianceStamped, Odometry, TransformStamped, PoseInFrame, \
                       FrameTransform",
        })?;
        Ok(PoseDecoder { payload: payload(schema, encoding)?, names })
    }

    /// Stamp and pose, in the unit of the file.
    fn decode(
        &self,
        payload: &[u8],
        message: &Message,
        clock: Clock,
    ) -> std::result::Result<(i64, Placed), DecodeFault> {
        let tree: Tree = self.payload.tree(payload)?;
        let whole = |fault| DecodeFault { byte: 0, fault };
        let [position, orientation, stamp] = self.names;
        let placed = tree.placed(position, orientation).map_err(whole)?;
        let time = |time: u64| i64::try_from(time).unwrap_or(i64::MAX);
        let stamp = match clock {
            Clock::Header | Clock::File => tree.stamp(stamp).map_err(whole)?.ok_or(whole(Fault::Shape))?,
            Clock::Publish => time(message.publish_time),
            Clock::Log => time(message.log_time),
        };
        Ok((stamp, placed))
    }
}
