//! ROS 2 markers: `mocap4r2_msgs/msg/Markers` in CDR, in every layout its schema text describes.
//!
//! At least two incompatible layouts carry the same name: with and without a `std_msgs/Header` in each marker.
//! So the layout is what the schema in the file says, and the fields are found by name: a sequence `markers` of
//! messages with `marker_name` or `marker_index` (or both, then `id_type` tells which counts) and `translation`
//! with `x`, `y`, `z`; `header.stamp` where there is one.

mod cdr;
mod schema;

use self::cdr::Value;
use self::schema::{Count, Field, Kind, Types};
use super::fields::SchemaRecord;
use super::format::{DecodeFault, Decoder, Format, Observation, Sample, stamp_ns};
use super::message::{Payload, Tree};
use crate::error::{Fault, Unreadable};

/// `mocap4r2_msgs/msg/Markers`.
pub(super) struct Ros2;

/// Value of `id_type` for markers that are known by their name only.
const USE_NAME: i64 = 0;

/// Value of `id_type` for markers that are known by their index only.
const USE_INDEX: i64 = 1;

impl Format for Ros2 {
    fn name(&self) -> &'static str {
        "ros2 markers"
    }

    fn decoder(&self, schema: &SchemaRecord, encoding: &str) -> Result<Box<dyn Decoder>, Unreadable> {
        if schema.encoding != "ros2msg" || encoding != "cdr" {
            return Err(Unreadable::Encoding);
        }
        let types = Types::parse(&schema.name, &schema.text)?;
        let layout = Layout::find(&types).ok_or(Unreadable::Layout {
            expected: "`markers[]` with `marker_name` or `marker_index` and `translation` (x, y, z)",
        })?;
        Ok(Box::new(Markers { types, layout }))
    }
}

/// Where the fields are, as places within their message.
struct Layout {
    /// Header, stamp, seconds, nanoseconds.
    stamp: Option<[usize; 4]>,
    markers: usize,
    id_type: Option<usize>,
    index: Option<usize>,
    name: Option<usize>,
    translation: usize,
    xyz: [usize; 3],
}

impl Layout {
    fn find(types: &Types) -> Option<Layout> {
        let root = types.root();
        let (markers, declared) = types.field(root, "markers")?;
        let (Kind::Message(marker), Count::Sequence(_) | Count::Fixed(_)) = (&declared.kind, &declared.count) else {
            return None;
        };
        let single = |message: usize, name: &str, fits: &dyn Fn(&Kind) -> bool| {
            let fit = |field: &Field| field.count == Count::One && fits(&field.kind);
            types.field(message, name).filter(|(_, field)| fit(field)).map(|(at, _)| at)
        };
        let inner = |message: usize, name: &str| match types.field(message, name)? {
            (at, Field { kind: Kind::Message(index), count: Count::One, .. }) => Some((at, *index)),
            _ => None,
        };
        let integer = |kind: &Kind| matches!(kind, Kind::Integer(_) | Kind::Unsigned(_));
        let float = |kind: &Kind| matches!(kind, Kind::Float(_));
        let text = |kind: &Kind| matches!(kind, Kind::Text(_));
        let (translation, point) = inner(*marker, "translation")?;
        let layout = Layout {
            stamp: inner(root, "header").and_then(|(header, of)| {
                let (stamp, of) = inner(of, "stamp")?;
                Some([header, stamp, single(of, "sec", &integer)?, single(of, "nanosec", &integer)?])
            }),
            markers,
            id_type: single(*marker, "id_type", &integer),
            index: single(*marker, "marker_index", &integer),
            name: single(*marker, "marker_name", &text),
            translation,
            xyz: [single(point, "x", &float)?, single(point, "y", &float)?, single(point, "z", &float)?],
        };
        (layout.name.is_some() || layout.index.is_some()).then_some(layout)
    }
}

/// Any message in CDR.
pub(super) struct Cdr(Types);

impl Cdr {
    pub fn new(schema: &SchemaRecord) -> Result<Cdr, Unreadable> {
        Ok(Cdr(Types::parse(&schema.name, &schema.text)?))
    }

    /// A field with the names of its parts.
    fn named(&self, kind: &Kind, value: Value) -> Tree {
        match (value, kind) {
            (Value::Bool(flag), _) => Tree::Flag(flag),
            (Value::Integer(number), _) => Tree::Integer(number),
            (Value::Unsigned(number), _) => i64::try_from(number).map_or(Tree::Number(number as f64), Tree::Integer),
            (Value::Float(number), _) => Tree::Number(number),
            (Value::Text(text), _) => Tree::Text(text),
            (Value::List(list), _) => Tree::List(list.into_iter().map(|value| self.named(kind, value)).collect()),
            (Value::Message(values), Kind::Message(index)) => {
                let fields = self.0.fields(*index).iter().zip(values);
                Tree::Fields(fields.map(|(f, value)| (f.name.clone(), self.named(&f.kind, value))).collect())
            }
            (Value::Message(_), _) => Tree::Nothing,
        }
    }
}

impl Payload for Cdr {
    fn tree(&self, payload: &[u8]) -> Result<Tree, DecodeFault> {
        let message = cdr::decode(&self.0, payload)?;
        Ok(self.named(&Kind::Message(self.0.root()), message))
    }
}

struct Markers {
    types: Types,
    layout: Layout,
}

impl Decoder for Markers {
    fn decode(&self, payload: &[u8]) -> Result<Observation, DecodeFault> {
        let message = cdr::decode(&self.types, payload)?;
        // The layout was found in the same types, so a field that is not there is a mistake in this file.
        let whole = |fault| DecodeFault { byte: 0, fault };
        let stamp_ns = match self.layout.stamp {
            None => None,
            Some([header, stamp, sec, nanosec]) => {
                let stamp = field(&message, header).and_then(|header| field(header, stamp));
                let part = |place| stamp.and_then(|stamp| field(stamp, place)).and_then(integer);
                let (Some(sec), Some(nanosec)) = (part(sec), part(nanosec)) else {
                    return Err(whole(Fault::Shape));
                };
                Some(stamp_ns(sec, nanosec).map_err(whole)?)
            }
        };
        let Some(Value::List(markers)) = field(&message, self.layout.markers) else {
            return Err(whole(Fault::Shape));
        };
        let samples = markers.iter().map(|marker| self.sample(marker).ok_or(whole(Fault::Shape)));
        Ok(Observation { stamp_ns, unit: None, samples: samples.collect::<Result<_, _>>()? })
    }
}

impl Markers {
    fn sample(&self, marker: &Value) -> Option<(String, Sample)> {
        let layout = &self.layout;
        let at = |place: Option<usize>| place.and_then(|place| field(marker, place));
        let name = match at(layout.name) {
            Some(Value::Text(name)) => name.as_str(),
            _ => "",
        };
        let index = at(layout.index).and_then(integer);
        let by_index = match at(layout.id_type).and_then(integer) {
            _ if layout.name.is_none() => true,
            Some(USE_INDEX) => true,
            Some(USE_NAME) => false,
            _ => name.is_empty(),
        };
        let label = match index {
            Some(index) if by_index => index.to_string(),
            _ => name.to_string(),
        };
        let translation = field(marker, layout.translation)?;
        let coordinate = |place| match field(translation, place) {
            Some(Value::Float(value)) => Some(*value),
            _ => None,
        };
        let [x, y, z] = layout.xyz.map(coordinate);
        Some((label, Sample::Position([x?, y?, z?])))
    }
}

fn field(message: &Value, place: usize) -> Option<&Value> {
    match message {
        Value::Message(fields) => fields.get(place),
        _ => None,
    }
}

fn integer(value: &Value) -> Option<i64> {
    match *value {
        Value::Integer(value) => Some(value),
        Value::Unsigned(value) => i64::try_from(value).ok(),
        _ => None,
    }
}
