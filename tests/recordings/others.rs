//! Writes messages of other programs: poses, marker and pose arrays in CDR, point clouds and scene updates in JSON and protobuf.
#![allow(dead_code)] // each test uses a part

use super::writer::{Cdr, Message, Topic};
use prost_reflect::prost::Message as _;
use prost_reflect::prost_types::field_descriptor_proto::{Label, Type};
use prost_reflect::prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use prost_reflect::{DescriptorPool, DynamicMessage, Value};

/// A `Message` that was logged at its stamp.
pub fn message(stamp: i64, payload: Vec<u8>) -> Message {
    Message { log_time: stamp as u64, publish_time: stamp as u64, payload }
}

const PARTS: &str = "================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
";

fn pose(cdr: &mut Cdr, position: [f64; 3], orientation: [f64; 4]) {
    position.iter().chain(&orientation).for_each(|x| cdr.f64(*x));
}

/// `geometry_msgs/msg/PoseStamped`, one message per stamp (ns), position and quaternion (x, y, z, w).
pub fn poses(name: &'static str, poses: &[(i64, [f64; 3], [f64; 4])]) -> Topic {
    let schema = format!("std_msgs/Header header\nPose pose\n{PARTS}");
    let payload = |(stamp, position, orientation): &(i64, [f64; 3], [f64; 4])| {
        let mut cdr = Cdr::new();
        cdr.header(*stamp);
        pose(&mut cdr, *position, *orientation);
        message(*stamp, cdr.message())
    };
    let schema = ("geometry_msgs/msg/PoseStamped", "ros2msg", schema.into_bytes());
    Topic { name, schema, encoding: "cdr", unit: None, messages: poses.iter().map(payload).collect() }
}

/// `geometry_msgs/msg/PoseArray`.
pub fn pose_array(frames: &[(i64, Vec<[f64; 3]>)]) -> Topic {
    let schema = format!("std_msgs/Header header\nPose[] poses\n{PARTS}");
    let payload = |(stamp, positions): &(i64, Vec<[f64; 3]>)| {
        let mut cdr = Cdr::new();
        cdr.header(*stamp);
        cdr.u32(positions.len() as u32);
        positions.iter().for_each(|p| pose(&mut cdr, *p, [0.0; 4]));
        message(*stamp, cdr.message())
    };
    let schema = ("geometry_msgs/msg/PoseArray", "ros2msg", schema.into_bytes());
    Topic { name: "/poses", schema, encoding: "cdr", unit: None, messages: frames.iter().map(payload).collect() }
}

/// One marker of a `MarkerArray`.
pub struct Shown {
    pub frame: &'static str,
    pub namespace: &'static str,
    pub id: i32,
    pub kind: i32,
    pub action: i32,
    pub position: [f64; 3],
    pub orientation: [f64; 4],
    pub points: Vec<[f64; 3]>,
}

impl Shown {
    /// A sphere.
    pub fn sphere(namespace: &'static str, id: i32, position: [f64; 3]) -> Shown {
        let orientation = [0.0, 0.0, 0.0, 1.0];
        Shown { frame: "lab", namespace, id, kind: 2, action: 0, position, orientation, points: Vec::new() }
    }
}

/// `visualization_msgs/msg/MarkerArray`, as of ROS 2 Humble but for its textures and meshes.
pub fn marker_array(frames: &[(i64, Vec<Shown>)]) -> Topic {
    let line = "=".repeat(80);
    let schema = format!(
        "Marker[] markers\n{line}\nMSG: visualization_msgs/Marker\nint32 ARROW=0\nint32 SPHERE=2\nint32 DELETE=2\n\
         std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
         geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\nbool frame_locked\n\
         geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring text\n{line}\nMSG: std_msgs/ColorRGBA\n\
         float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n{PARTS}"
    );
    let payload = |(stamp, markers): &(i64, Vec<Shown>)| {
        let mut cdr = Cdr::new();
        cdr.u32(markers.len() as u32);
        for marker in markers {
            cdr.stamp(*stamp);
            cdr.text(marker.frame);
            cdr.text(marker.namespace);
            cdr.u32(marker.id as u32);
            cdr.u32(marker.kind as u32);
            cdr.u32(marker.action as u32);
            pose(&mut cdr, marker.position, marker.orientation);
            (0..3).for_each(|_| cdr.f64(0.01));
            (0..4).for_each(|_| cdr.u32(1.0_f32.to_bits()));
            cdr.u32(0);
            cdr.u32(0);
            cdr.byte(0);
            cdr.u32(marker.points.len() as u32);
            marker.points.iter().flatten().for_each(|x| cdr.f64(*x));
            cdr.u32(0);
            cdr.text("");
        }
        message(*stamp, cdr.message())
    };
    let schema = ("visualization_msgs/msg/MarkerArray", "ros2msg", schema.into_bytes());
    Topic { name: "/viz", schema, encoding: "cdr", unit: None, messages: frames.iter().map(payload).collect() }
}

/// A point of a cloud: three f64, then a u32 `id`.
const STRIDE: usize = 28;
const COLUMNS: [(&str, usize, i64); 4] = [("x", 0, 8), ("y", 8, 8), ("z", 16, 8), ("id", 24, 5)];

fn cloud_data(points: &[[f64; 3]]) -> Vec<u8> {
    let point = |(k, p): (usize, &[f64; 3])| {
        let mut bytes: Vec<u8> = p.iter().flat_map(|x| x.to_le_bytes()).collect();
        bytes.extend(100_u32.wrapping_add(k as u32).to_le_bytes());
        bytes
    };
    points.iter().enumerate().flat_map(point).collect()
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |group: &[u8]| {
        let bits = group.iter().fold(0_u32, |bits, b| bits << 8 | u32::from(*b)) << (8 * (3 - group.len()));
        let digit = |k: usize| {
            if k > group.len() { '=' } else { DIGITS[(bits >> (18 - 6 * k)) as usize & 63] as char }
        };
        (0..4).map(digit).collect::<String>()
    };
    bytes.chunks(3).map(group).collect()
}

fn stamp_json(stamp: i64) -> String {
    format!(r#"{{"sec": {}, "nsec": {}}}"#, stamp / 1_000_000_000, stamp % 1_000_000_000)
}

/// `foxglove.PointCloud` in JSON; the cloud itself is placed by position and quaternion.
pub fn cloud_json(frames: &[(i64, Vec<[f64; 3]>)], [px, py, pz]: [f64; 3], [x, y, z, w]: [f64; 4]) -> Topic {
    let columns =
        COLUMNS.map(|(name, offset, kind)| format!(r#"{{"name": "{name}", "offset": {offset}, "type": {kind}}}"#));
    let payload = |(stamp, points): &(i64, Vec<[f64; 3]>)| {
        let text = format!(
            r#"{{"timestamp": {}, "frame_id": "lab", "pose": {{"position": {{"x": {px:?}, "y": {py:?}, "z": {pz:?}}},
            "orientation": {{"x": {x:?}, "y": {y:?}, "z": {z:?}, "w": {w:?}}}}}, "point_stride": {STRIDE}, "fields": [{}],
            "data": "{}"}}"#,
            stamp_json(*stamp),
            columns.join(", "),
            base64(&cloud_data(points))
        );
        message(*stamp, text.into_bytes())
    };
    let schema = ("foxglove.PointCloud", "jsonschema", br#"{"type": "object"}"#.to_vec());
    Topic { name: "/cloud", schema, encoding: "json", unit: None, messages: frames.iter().map(payload).collect() }
}

/// Stamp (ns), and id and place of each entity.
pub type Entities = (i64, Vec<(String, [f64; 3])>);

/// `foxglove.SceneUpdate` in JSON: a sphere per entity, `null` where the place is not finite.
pub fn scene_json(frames: &[Entities]) -> Topic {
    let entity = |stamp: i64, (id, p): &(String, [f64; 3])| {
        let [x, y, z] = p.map(|x| if x.is_finite() { format!("{x:?}") } else { "null".into() });
        format!(
            r#"{{"timestamp": {}, "frame_id": "lab", "id": "{id}", "lifetime": {{"sec": 0, "nsec": 0}}, "frame_locked": false,
            "spheres": [{{"pose": {{"position": {{"x": {x}, "y": {y}, "z": {z}}}, "orientation": {{"x": 0, "y": 0, "z": 0,
            "w": 1}}}}, "size": {{"x": 5, "y": 5, "z": 5}}}}]}}"#,
            stamp_json(stamp)
        )
    };
    let payload = |(stamp, entities): &Entities| {
        let entities: Vec<String> = entities.iter().map(|e| entity(*stamp, e)).collect();
        message(*stamp, format!(r#"{{"deletions": [], "entities": [{}]}}"#, entities.join(", ")).into_bytes())
    };
    let schema = ("foxglove.SceneUpdate", "jsonschema", br#"{"type": "object"}"#.to_vec());
    Topic { name: "/scene", schema, encoding: "json", unit: None, messages: frames.iter().map(payload).collect() }
}

/// Name, kind, and whether it is repeated, of each field.
type Fields = &'static [(&'static str, &'static str, bool)];

/// The messages of Foxglove that hold markers, and what they are made of: name, then fields as name, kind, repeated.
const FOXGLOVE: [(&str, Fields); 9] = [
    ("Vector3", &[("x", "double", false), ("y", "double", false), ("z", "double", false)]),
    ("Quaternion", &[("x", "double", false), ("y", "double", false), ("z", "double", false), ("w", "double", false)]),
    ("Pose", &[("position", ".foxglove.Vector3", false), ("orientation", ".foxglove.Quaternion", false)]),
    ("Timestamp", &[("seconds", "int64", false), ("nanos", "int32", false)]),
    ("PackedElementField", &[("name", "string", false), ("offset", "fixed32", false), ("type", "int32", false)]),
    (
        "PointCloud",
        &[
            ("timestamp", ".foxglove.Timestamp", false),
            ("frame_id", "string", false),
            ("pose", ".foxglove.Pose", false),
            ("point_stride", "fixed32", false),
            ("fields", ".foxglove.PackedElementField", true),
            ("data", "bytes", false),
        ],
    ),
    ("SpherePrimitive", &[("pose", ".foxglove.Pose", false), ("size", ".foxglove.Vector3", false)]),
    (
        "SceneEntity",
        &[
            ("timestamp", ".foxglove.Timestamp", false),
            ("frame_id", "string", false),
            ("id", "string", false),
            ("spheres", ".foxglove.SpherePrimitive", true),
        ],
    ),
    ("SceneUpdate", &[("entities", ".foxglove.SceneEntity", true)]),
];

/// Their descriptors, as a recorder stores them.
pub fn descriptors() -> Vec<u8> {
    let field = |(number, (name, kind, repeated)): (usize, &(&str, &str, bool))| {
        let scalar = match *kind {
            "double" => Type::Double,
            "int64" => Type::Int64,
            "int32" => Type::Int32,
            "fixed32" => Type::Fixed32,
            "string" => Type::String,
            "bytes" => Type::Bytes,
            _ => Type::Message,
        };
        FieldDescriptorProto {
            name: Some(name.to_string()),
            number: Some(number as i32 + 1),
            label: Some(if *repeated { Label::Repeated } else { Label::Optional } as i32),
            r#type: Some(scalar as i32),
            type_name: (scalar == Type::Message).then(|| kind.to_string()),
            ..FieldDescriptorProto::default()
        }
    };
    let message = |(name, fields): &(&str, Fields)| DescriptorProto {
        name: Some(name.to_string()),
        field: fields.iter().enumerate().map(field).collect(),
        ..DescriptorProto::default()
    };
    let file = FileDescriptorProto {
        name: Some("foxglove.proto".into()),
        package: Some("foxglove".into()),
        syntax: Some("proto3".into()),
        message_type: FOXGLOVE.iter().map(message).collect(),
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

/// Fields of a message by name.
fn built(pool: &DescriptorPool, name: &str, fields: Vec<(&str, Value)>) -> DynamicMessage {
    let mut message = DynamicMessage::new(pool.get_message_by_name(&format!("foxglove.{name}")).unwrap());
    fields.into_iter().for_each(|(name, value)| message.set_field_by_name(name, value));
    message
}

fn stamp(pool: &DescriptorPool, stamp: i64) -> Value {
    let parts =
        vec![("seconds", Value::I64(stamp / 1_000_000_000)), ("nanos", Value::I32((stamp % 1_000_000_000) as i32))];
    Value::Message(built(pool, "Timestamp", parts))
}

fn vector(pool: &DescriptorPool, [x, y, z]: [f64; 3]) -> Value {
    let parts = vec![("x", Value::F64(x)), ("y", Value::F64(y)), ("z", Value::F64(z))];
    Value::Message(built(pool, "Vector3", parts))
}

/// `foxglove.PointCloud` in protobuf, not placed.
pub fn cloud_protobuf(frames: &[(i64, Vec<[f64; 3]>)]) -> Topic {
    let pool = DescriptorPool::decode(descriptors().as_slice()).unwrap();
    let column = |(name, offset, kind): (&str, usize, i64)| {
        let parts = vec![
            ("name", Value::String(name.into())),
            ("offset", Value::U32(offset as u32)),
            ("type", Value::I32(kind as i32)),
        ];
        Value::Message(built(&pool, "PackedElementField", parts))
    };
    let payload = |(time, points): &(i64, Vec<[f64; 3]>)| {
        let parts = vec![
            ("timestamp", stamp(&pool, *time)),
            ("frame_id", Value::String("lab".into())),
            ("point_stride", Value::U32(STRIDE as u32)),
            ("fields", Value::List(COLUMNS.map(column).to_vec())),
            ("data", Value::Bytes(cloud_data(points).into())),
        ];
        message(*time, built(&pool, "PointCloud", parts).encode_to_vec())
    };
    let schema = ("foxglove.PointCloud", "protobuf", descriptors());
    Topic { name: "/cloud", schema, encoding: "protobuf", unit: None, messages: frames.iter().map(payload).collect() }
}

/// `foxglove.SceneUpdate` in protobuf: a sphere per entity, without a pose where the place is not finite.
pub fn scene_protobuf(frames: &[Entities]) -> Topic {
    let pool = DescriptorPool::decode(descriptors().as_slice()).unwrap();
    let entity = |time: i64, (id, p): &(String, [f64; 3])| {
        let mut sphere = built(&pool, "SpherePrimitive", vec![("size", vector(&pool, [5.0; 3]))]);
        if p.iter().all(|x| x.is_finite()) {
            let pose = built(&pool, "Pose", vec![("position", vector(&pool, *p))]);
            sphere.set_field_by_name("pose", Value::Message(pose));
        }
        let parts = vec![
            ("timestamp", stamp(&pool, time)),
            ("frame_id", Value::String("lab".into())),
            ("id", Value::String(id.clone())),
            ("spheres", Value::List(vec![Value::Message(sphere)])),
        ];
        Value::Message(built(&pool, "SceneEntity", parts))
    };
    let payload = |(time, entities): &Entities| {
        let entities = entities.iter().map(|e| entity(*time, e)).collect();
        message(*time, built(&pool, "SceneUpdate", vec![("entities", Value::List(entities))]).encode_to_vec())
    };
    let schema = ("foxglove.SceneUpdate", "protobuf", descriptors());
    Topic { name: "/scene", schema, encoding: "protobuf", unit: None, messages: frames.iter().map(payload).collect() }
}
