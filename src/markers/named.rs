//! Messages of other programs that are known by the name of their schema, in any encoding.
//!
//! | schema | a marker is | its label |
//! |---|---|---|
//! | `visualization_msgs/msg/MarkerArray` | a marker, or a point of one that holds a list of them | `namespace/id`, or `id`; of points, `/k` behind it |
//! | `geometry_msgs/msg/PoseArray` | a pose | its number, from 0 |
//! | `foxglove.PointCloud` | a point | its number, or its field `id` |
//! | `foxglove.SceneUpdate` | a sphere or cube of an entity | the entity's id; where it has several, `/k` behind it |
//!
//! Each message is a frame; what it does not hold is lost in it. All of a message stands in one coordinate frame, or the
//! message is refused.

use super::fields::SchemaRecord;
use super::format::{DecodeFault, Decoder, Format, Observation, Sample};
use super::message::{Payload, Placed, Tree, payload};
use crate::error::{Fault, Unreadable};

/// A message by its name.
pub(super) struct Named {
    /// In messages and reports.
    name: &'static str,
    /// Of the schema, without `msg/`.
    schemas: &'static [&'static str],
    observe: fn(&Tree) -> Result<Observation, Fault>,
}

/// `visualization_msgs/msg/MarkerArray`
pub(super) const MARKER_ARRAY: Named =
    Named { name: "marker array", schemas: &["visualization_msgs/MarkerArray"], observe: marker_array };

/// `geometry_msgs/msg/PoseArray`
pub(super) const POSE_ARRAY: Named =
    Named { name: "pose array", schemas: &["geometry_msgs/PoseArray"], observe: pose_array };

/// `foxglove.PointCloud`
pub(super) const POINT_CLOUD: Named = Named {
    name: "point cloud",
    schemas: &["foxglove.PointCloud", "foxglove_msgs/PointCloud"],
    observe: point_cloud,
};

/// `foxglove.SceneUpdate`
pub(super) const SCENE_UPDATE: Named = Named {
    name: "scene update",
    schemas: &["foxglove.SceneUpdate", "foxglove_msgs/SceneUpdate"],
    observe: scene_update,
};

impl Format for Named {
    fn name(&self) -> &'static str {
        self.name
    }

    fn decoder(&self, schema: &SchemaRecord, encoding: &str) -> Result<Box<dyn Decoder>, Unreadable> {
        if !self.schemas.contains(&schema.name.replace("/msg/", "/").as_str()) {
            return Err(Unreadable::Encoding);
        }
        Ok(Box::new(NamedDecoder { payload: payload(schema, encoding)?, observe: self.observe }))
    }
}

struct NamedDecoder {
    payload: Box<dyn Payload>,
    observe: fn(&Tree) -> Result<Observation, Fault>,
}

impl Decoder for NamedDecoder {
    fn decode(&self, payload: &[u8]) -> Result<Observation, DecodeFault> {
        let tree = self.payload.tree(payload)?;
        (self.observe)(&tree).map_err(|fault| DecodeFault { byte: 0, fault })
    }
}

/// `action` of a marker that is taken away, and of all of them.
const DELETE: [i64; 2] = [2, 3];
/// `type` of markers that are lists of points: cubes, spheres, points.
const LISTS: [i64; 3] = [6, 7, 8];

fn marker_array(message: &Tree) -> Result<Observation, Fault> {
    let mut seen = Seen::default();
    for marker in message.elements("markers")? {
        let namespace = marker.field("ns")?.text().ok_or(Fault::Shape)?;
        let id = marker.whole("id")?;
        let label = if namespace.is_empty() { id.to_string() } else { format!("{namespace}/{id}") };
        if DELETE.contains(&marker.whole("action")?) {
            continue;
        }
        seen.frame(marker.field("header.frame_id")?, marker.stamp("header.stamp")?)?;
        if LISTS.contains(&marker.whole("type")?) {
            let placed = marker.placed("pose.position", "pose.orientation")?;
            for (k, point) in marker.elements("points")?.iter().enumerate() {
                seen.samples.push((format!("{label}/{k}"), moved(&placed, point.position()?)));
            }
        } else {
            seen.samples.push((label, marker.field("pose.position")?.position()?));
        }
    }
    Ok(seen.observation())
}

fn pose_array(message: &Tree) -> Result<Observation, Fault> {
    let mut seen = Seen { stamp_ns: message.stamp("header.stamp")?, ..Seen::default() };
    for (k, pose) in message.elements("poses")?.iter().enumerate() {
        seen.samples.push((k.to_string(), pose.field("position")?.position()?));
    }
    Ok(seen.observation())
}

fn scene_update(message: &Tree) -> Result<Observation, Fault> {
    let mut seen = Seen::default();
    for entity in message.elements("entities")? {
        seen.frame(entity.field("frame_id")?, entity.stamp("timestamp")?)?;
        let id = entity.field("id")?.text().ok_or(Fault::Shape)?;
        let mut places = Vec::new();
        for kind in ["spheres", "cubes"] {
            // JSON leaves out what is empty
            let shapes = entity.get(kind).and_then(Tree::list).unwrap_or(&[]);
            for shape in shapes {
                places.push(match shape.field("pose")? {
                    Tree::Nothing => Sample::Absent,
                    pose => pose.field("position")?.position()?,
                });
            }
        }
        let one = places.len() == 1;
        let label = |k: usize| if one { id.to_owned() } else { format!("{id}/{k}") };
        seen.samples.extend(places.into_iter().enumerate().map(|(k, place)| (label(k), place)));
    }
    Ok(seen.observation())
}

/// A column of a point cloud: where it starts in a point, and how it is written.
#[derive(Clone, Copy)]
struct Column {
    offset: usize,
    kind: i64,
}

impl Column {
    /// Of the field `name`; the numbers of kinds are those of `foxglove.NumericType`.
    fn find(fields: &[Tree], name: &str, stride: usize) -> Result<Option<Column>, Fault> {
        let is = |field: &&Tree| field.get("name").and_then(Tree::text) == Some(name);
        let Some(field) = fields.iter().find(is) else { return Ok(None) };
        let offset = usize::try_from(field.whole("offset")?).map_err(|_| Fault::Shape)?;
        let column = Column { offset, kind: field.whole("type")? };
        let fits = column.bytes().is_some_and(|bytes| offset.checked_add(bytes).is_some_and(|end| end <= stride));
        if fits { Ok(Some(column)) } else { Err(Fault::Shape) }
    }

    fn bytes(self) -> Option<usize> {
        Some(match self.kind {
            1 | 2 => 1,
            3 | 4 => 2,
            5..=7 => 4,
            8 => 8,
            _ => return None,
        })
    }

    /// The number in a point, little-endian.
    fn read(self, point: &[u8]) -> Option<f64> {
        let bytes = point.get(self.offset..self.offset + self.bytes()?)?;
        Some(match (self.kind, bytes) {
            (1, [a]) => f64::from(*a),
            (2, [a]) => f64::from(*a as i8),
            (3, _) => f64::from(u16::from_le_bytes(bytes.try_into().ok()?)),
            (4, _) => f64::from(i16::from_le_bytes(bytes.try_into().ok()?)),
            (5, _) => f64::from(u32::from_le_bytes(bytes.try_into().ok()?)),
            (6, _) => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)),
            (7, _) => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
            (8, _) => f64::from_le_bytes(bytes.try_into().ok()?),
            _ => return None,
        })
    }
}

fn point_cloud(message: &Tree) -> Result<Observation, Fault> {
    let stride = usize::try_from(message.whole("point_stride")?).ok().filter(|stride| *stride > 0);
    let stride = stride.ok_or(Fault::Shape)?;
    let fields = message.elements("fields")?;
    let column = |name: &str| Column::find(fields, name, stride);
    let (Some(x), Some(y), Some(z)) = (column("x")?, column("y")?, column("z")?) else { return Err(Fault::Shape) };
    let id = column("id")?.filter(|id| id.kind < 7);
    let placed = match message.field("pose")? {
        Tree::Nothing => Placed { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] },
        pose => pose.placed("position", "orientation")?,
    };
    let data = message.field("data")?.bytes().ok_or(Fault::Shape)?;
    if !data.len().is_multiple_of(stride) {
        return Err(Fault::Left { bytes: data.len() % stride });
    }
    let mut seen = Seen { stamp_ns: message.stamp("timestamp")?, ..Seen::default() };
    for (k, point) in data.chunks_exact(stride).enumerate() {
        let read = |column: Column| column.read(point).ok_or(Fault::Shape);
        let position = [read(x)?, read(y)?, read(z)?];
        let label = match id {
            Some(id) => read(id)?.to_string(),
            None => k.to_string(),
        };
        // a lost point at the origin of the cloud stays one, whatever the pose of the cloud
        let sample = if position == [0.0; 3] { position } else { placed.place(position) };
        seen.samples.push((label, Sample::Position(sample)));
    }
    Ok(seen.observation())
}

/// A point of a frame that is itself placed; lost ones at its origin stay at (0, 0, 0).
fn moved(placed: &Placed, sample: Sample) -> Sample {
    match sample {
        Sample::Position(position) if position != [0.0; 3] => Sample::Position(placed.place(position)),
        lost => lost,
    }
}

/// What a message has shown so far.
#[derive(Default)]
struct Seen {
    stamp_ns: Option<i64>,
    frame: Option<String>,
    samples: Vec<(String, Sample)>,
}

impl Seen {
    /// Notes the coordinate frame and the stamp of a part; the stamp of the first part is that of the message.
    fn frame(&mut self, frame: &Tree, stamp_ns: Option<i64>) -> Result<(), Fault> {
        let frame = frame.text().ok_or(Fault::Shape)?;
        match &self.frame {
            Some(known) if known != frame => return Err(Fault::Frames { a: known.clone(), b: frame.to_owned() }),
            Some(_) => {}
            None => (self.frame, self.stamp_ns) = (Some(frame.to_owned()), stamp_ns),
        }
        Ok(())
    }

    fn observation(self) -> Observation {
        Observation { stamp_ns: self.stamp_ns, unit: None, samples: self.samples }
    }
}
