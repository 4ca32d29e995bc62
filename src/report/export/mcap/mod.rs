//! Everything over time as MCAP, on the clock of the recording, in metres: messages in JSON with their schemas, those of
//! Foxglove where there is one. The problem is attached, a layout for Foxglove written beside it.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/tf` | foxglove.FrameTransform | `world` to `head`: the identity, as markers are given in the coordinates of the model |
//! | `/risorius/skin` | foxglove.SceneUpdate | triangles |
//! | `/risorius/skin_points` | foxglove.PointCloud | points with the length of their displacement in mm |
//! | `/risorius/muscles` | foxglove.SceneUpdate | triangles, redder with activation |
//! | `/risorius/markers` | foxglove.SceneUpdate | spheres of model and measurement, lines between them |
//! | `/risorius/markers/model`, `/measured` | foxglove.PointCloud | the same as points with the residual in mm |
//! | `/risorius/activations` | risorius.Activations | values, 95 % intervals, bounds |
//! | `/risorius/solver` | risorius.Solver | residuals of markers, iterations |

mod layout;
mod messages;

use super::Exported;
use crate::error::{Result, Warning};
use crate::fit::recording;
use crate::report::frame::Frame;
use crate::report::playback::Playback;
use crate::report::run_folder::failed;
use crate::scene::Task;
use mcap::records::MessageHeader;
use messages::Stamp;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

/// Official schemas: `@foxglove/schemas` 2.1.0 on npm, MIT licence, copyright Foxglove Technologies Inc.
const SCENE_UPDATE: &str = include_str!("schemas/SceneUpdate.json");
const POINT_CLOUD: &str = include_str!("schemas/PointCloud.json");
const FRAME_TRANSFORM: &str = include_str!("schemas/FrameTransform.json");
/// Our own.
const ACTIVATIONS: &str = include_str!("schemas/Activations.json");
const SOLVER: &str = include_str!("schemas/Solver.json");

/// Writes `result.mcap` and `result.foxglove.json`.
pub fn write(run: &Playback, folder: &Path, done: &mut Exported) -> Result<()> {
    run.shown()?;
    let (stamps, warning) = clock(run);
    done.warnings.extend(warning);
    let path = folder.join("result.mcap");
    let bytes = encode(run, &stamps).map_err(failed("write", &path))?;
    done.write(path, bytes)?;
    done.write(folder.join("result.foxglove.json"), layout::text(run))
}

/// The stamp of every frame, ns: that of the recording, or the time of the run from 0.
fn clock(run: &Playback) -> (Vec<u64>, Option<Warning>) {
    let from_zero = || run.frames.iter().map(|frame| (1e9 * frame.time_s.max(0.0)).round() as u64).collect();
    let cannot = |message: String| Warning {
        code: "O007",
        message: format!(
            "the recording cannot be read again, so that times in the MCAP file count from 0: {message}"
        ),
        place: None,
        help: Some("put it back where the lock file names it, to have its clock".into()),
    };
    if let Some(why) = &run.lost_recording {
        return (from_zero(), Some(cannot(why.clone())));
    }
    let (Task::Fit, Some(fit)) = (run.scene.task, &run.scene.fit) else { return (from_zero(), None) };
    match recording::read(fit) {
        Ok(recording) => {
            let stamp = |frame: &Frame| Some(u64::try_from(recording.frames.get(frame.index)?.stamp_ns).unwrap_or(0));
            match run.frames.iter().map(stamp).collect::<Option<Vec<u64>>>() {
                Some(stamps) => (stamps, None),
                None => (from_zero(), Some(cannot("it has fewer frames than the run".into()))),
            }
        }
        Err(error) => (from_zero(), Some(cannot(error.to_string()))),
    }
}

/// A file that is being written.
struct Recorder {
    writer: mcap::Writer<Cursor<Vec<u8>>>,
    schemas: BTreeMap<&'static str, u16>,
    channels: BTreeMap<&'static str, (u16, u32)>,
}

impl Recorder {
    fn send(
        &mut self,
        topic: &'static str,
        schema: (&'static str, &str),
        time: u64,
        message: &Value,
    ) -> std::io::Result<()> {
        let id = match self.schemas.get(schema.0) {
            Some(id) => *id,
            None => {
                let id = self
                    .writer
                    .add_schema(schema.0, "jsonschema", schema.1.as_bytes())
                    .map_err(std::io::Error::other)?;
                *self.schemas.entry(schema.0).or_insert(id)
            }
        };
        if !self.channels.contains_key(topic) {
            let channel =
                self.writer.add_channel(id, topic, "json", &BTreeMap::new()).map_err(std::io::Error::other)?;
            self.channels.insert(topic, (channel, 0));
        }
        let Some((channel_id, sequence)) = self.channels.get_mut(topic) else { return Ok(()) };
        let header =
            MessageHeader { channel_id: *channel_id, sequence: *sequence, log_time: time, publish_time: time };
        *sequence += 1;
        self.writer.write_to_known_channel(&header, message.to_string().as_bytes()).map_err(std::io::Error::other)
    }
}

fn encode(run: &Playback, stamps: &[u64]) -> std::io::Result<Vec<u8>> {
    const SCENE: (&str, &str) = ("foxglove.SceneUpdate", SCENE_UPDATE);
    const CLOUD: (&str, &str) = ("foxglove.PointCloud", POINT_CLOUD);
    // one thread: the bytes must not depend on the machine
    let writer = mcap::WriteOptions::new()
        .compression(Some(mcap::Compression::Zstd))
        .compression_threads(0)
        .library(concat!("risorius ", env!("CARGO_PKG_VERSION")))
        .create(Cursor::new(Vec::new()))
        .map_err(std::io::Error::other)?;
    let mut out = Recorder { writer, schemas: BTreeMap::new(), channels: BTreeMap::new() };
    let mut shapes = run.shapes.iter().peekable();
    for (row, (frame, time)) in run.frames.iter().zip(stamps).enumerate() {
        let stamp = Stamp(*time);
        out.send("/tf", ("foxglove.FrameTransform", FRAME_TRANSFORM), *time, &messages::transform(stamp))?;
        if let Some(shape) = shapes.next_if(|shape| shape.frame.index == frame.index) {
            out.send("/risorius/skin", SCENE, *time, &messages::skin(run, shape, stamp))?;
            out.send("/risorius/skin_points", CLOUD, *time, &messages::skin_points(run, shape, stamp))?;
            if !run.muscles.is_empty() {
                out.send("/risorius/muscles", SCENE, *time, &messages::muscles(run, shape, row, stamp))?;
            }
        }
        if !run.markers.is_empty() {
            out.send("/risorius/markers", SCENE, *time, &messages::markers(run, row, stamp))?;
            out.send("/risorius/markers/model", CLOUD, *time, &messages::marker_points(run, row, stamp, false))?;
            out.send("/risorius/markers/measured", CLOUD, *time, &messages::marker_points(run, row, stamp, true))?;
        }
        out.send(
            "/risorius/activations",
            ("risorius.Activations", ACTIVATIONS),
            *time,
            &messages::activations(run, row, stamp),
        )?;
        out.send("/risorius/solver", ("risorius.Solver", SOLVER), *time, &messages::solver(run, row, stamp))?;
    }
    let first = stamps.first().copied().unwrap_or(0);
    out.writer
        .attach(&mcap::Attachment {
            log_time: first,
            create_time: first,
            name: "problem.lock.toml".into(),
            media_type: "application/toml".into(),
            data: Cow::Borrowed(run.lock.as_bytes()),
        })
        .map_err(std::io::Error::other)?;
    out.writer.finish().map_err(std::io::Error::other)?;
    Ok(out.writer.into_inner().into_inner())
}
