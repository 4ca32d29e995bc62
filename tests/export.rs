//! Does what is exported hold what the run found?

use assert_cmd::Command;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use risorius::report::export::modes::modes;
use risorius::report::playback::{Playback, Sheet};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// Exit code, standard output and standard error of `risorius <arguments>`.
fn risorius(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("risorius").unwrap().args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// The fit of a beam that is shipped.
const BEAM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/problems/beam/problem.toml");

/// Four frames of the beam with everything that can be exported, made once.
fn run() -> &'static Path {
    static RUN: OnceLock<TempDir> = OnceLock::new();
    let folder = RUN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run").display().to_string();
        let (exit, _, stderr) =
            risorius(&["run", BEAM, "--set", "fit.frames={first=0,last=30,step=10}", "--out", &run]);
        assert_eq!(exit, 0, "{stderr}");
        let (exit, stdout, stderr) = risorius(&["export", &run, "--to", "glb,mcap,sto,exf,obj,ply,parquet,vtu"]);
        assert!(exit == 0 && stderr.is_empty() && stdout.contains("result.glb ("), "{stdout}{stderr}");
        folder
    });
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| folder.path().join("run"))
}

fn export(name: &str) -> PathBuf {
    run().join("export").join(name)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn a_run_read_back_is_where_its_own_markers_are() {
    let run = Playback::read(run()).unwrap();
    assert_eq!(run.shapes.len(), 4);
    assert_eq!(run.muscles.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["top", "bottom"]);
    // marker B00 sits on the corner of an element, which is a point of the skin
    let marker = run.markers.iter().find(|marker| marker.name == "B00").unwrap();
    let at = run.skin.rest.iter().position(|p| distance(*p, [20.0, 10.0, 20.0]) < 1e-9).unwrap();
    for (shape, sample) in run.shapes.iter().zip(&marker.samples) {
        assert!(distance(shape.skin[at], sample.model) < 1e-9, "{:?} {:?}", shape.skin[at], sample.model);
    }
    assert!(distance(run.shapes[2].skin[at], run.skin.rest[at]) > 0.5, "the beam moves");
    // the skin is closed: every edge belongs to two quadrilaterals, and is walked once each way
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for quad in &run.skin.quads {
        for k in 0..4 {
            let (a, b) = (quad[k], quad[(k + 1) % 4]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|sum| *sum == 0));
    // anticlockwise from outside: the volume is that of the block
    let volume: f64 = run
        .skin
        .triangles()
        .map(|t| {
            let [a, b, c] = t.map(|point| run.skin.rest[point as usize]);
            (a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0]))
                / 6.0
        })
        .sum();
    assert!((volume - 24000.0).abs() < 1e-6, "{volume}");
    let deviations = Sheet::find(&run.folder.join("tables"), "activations").unwrap().unwrap();
    assert_eq!(run.controls.len(), 2, "deviations are no controls: {:?}", deviations.columns());
    assert!(run.controls.iter().all(|c| c.intervals.iter().flatten().all(|[low, high]| *low >= 0.0 && *high <= 1.0)));
}

#[test]
fn modes_in_plus_and_minus_pairs_give_every_frame_back() {
    let run = Playback::read(run()).unwrap();
    let modes = modes(&run);
    assert!(modes.targets.len() >= 2 && modes.largest_error_mm < 0.05, "{}", modes.largest_error_mm);
    assert!(modes.weights.iter().flatten().all(|weight| (0.0..=1.0).contains(weight)));
    for (shape, weights) in run.shapes.iter().zip(&modes.weights) {
        for (k, point) in shape.skin.iter().enumerate() {
            let mut x = run.skin.rest[k];
            for (target, weight) in modes.targets.iter().zip(weights) {
                (0..3).for_each(|d| x[d] += weight * target.bodies[0][k][d]);
            }
            assert!(distance(x, *point) <= modes.largest_error_mm + 1e-9);
        }
    }
    // one side at a time
    for weights in &modes.weights {
        for (k, target) in modes.targets.iter().enumerate().filter(|(_, t)| t.name.ends_with("_minus")) {
            let plus = target.name.replace("_minus", "_plus");
            let other = modes.targets.iter().position(|t| t.name == plus).unwrap();
            assert!(weights[k] * weights[other] == 0.0);
        }
    }
}

#[test]
fn the_glb_holds_metres_names_and_curves() {
    let bytes = fs::read(export("result.glb")).unwrap();
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], number(4), number(8)), (&b"glTF"[..], 2, bytes.len()));
    let json: Value = serde_json::from_slice(&bytes[20..20 + number(12)]).unwrap();
    let binary = &bytes[20 + number(12) + 8..];
    assert_eq!(json["buffers"][0]["byteLength"], binary.len());
    let names: Vec<&str> = json["meshes"].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["skin", "top", "bottom"]);
    let targets = json["meshes"][0]["extras"]["targetNames"].as_array().unwrap();
    assert_eq!(targets[0], "mode_1_plus");
    assert_eq!(targets.len(), json["meshes"][1]["primitives"][0]["targets"].as_array().unwrap().len());
    let position =
        &json["accessors"][json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize];
    assert_eq!(position["max"][0].as_f64().unwrap() as f32, 0.06);
    // the curve of an activation is the translation of a node of its name
    let node = json["nodes"].as_array().unwrap().iter().position(|n| n["name"] == "activation bottom").unwrap();
    let animation = &json["animations"][0];
    let channel = animation["channels"].as_array().unwrap().iter().find(|c| c["target"]["node"] == node).unwrap();
    let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
    let view = &json["bufferViews"]
        [json["accessors"][sampler["output"].as_u64().unwrap() as usize]["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let run = Playback::read(run()).unwrap();
    for (k, value) in run.activation_of("bottom").unwrap().values.iter().enumerate() {
        let at = start + 12 * k;
        assert_eq!(f32::from_le_bytes(binary[at..at + 4].try_into().unwrap()), *value as f32);
    }
    assert_eq!(json["extras"]["activations"]["top"].as_array().unwrap().len(), 4);
}

#[test]
fn the_mcap_stands_on_the_clock_of_the_recording() {
    let bytes = fs::read(export("result.mcap")).unwrap();
    let mut topics: BTreeMap<String, Vec<(u64, Value)>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert_eq!(message.channel.message_encoding, "json");
        let schema = message.channel.schema.clone().unwrap();
        assert_eq!(serde_json::from_slice::<Value>(&schema.data).unwrap()["title"], schema.name.as_str());
        let value = serde_json::from_slice(&message.data).unwrap();
        topics.entry(message.channel.topic.clone()).or_default().push((message.log_time, value));
    }
    let names: Vec<&str> = topics.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "/risorius/activations",
            "/risorius/markers",
            "/risorius/markers/measured",
            "/risorius/markers/model",
            "/risorius/muscles",
            "/risorius/skin",
            "/risorius/skin_points",
            "/risorius/solver",
            "/tf",
        ]
    );
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/beam.mcap");
    let (_, page, _) = risorius(&["inspect", "--json", &recording.display().to_string()]);
    let first = serde_json::from_str::<Value>(&page).unwrap()["topics"][0]["log_time_ns"][0].as_u64().unwrap();
    assert!(first > 1_000_000_000_000_000_000, "the recording has a real clock");
    let run = Playback::read(run()).unwrap();
    for (topic, messages) in &topics {
        assert_eq!(messages.len(), 4, "{topic}");
        for ((time, _), frame) in messages.iter().zip(&run.frames) {
            assert!((*time as f64 - first as f64 - 1e9 * frame.time_s).abs() < 1e3, "{topic} {time}");
        }
    }
    let (_, skin) = &topics["/risorius/skin"][1];
    let point = &skin["entities"][0]["triangles"][0]["points"][7];
    let own = run.shapes[1].skin[7];
    for (d, axis) in ["x", "y", "z"].into_iter().enumerate() {
        assert!((point[axis].as_f64().unwrap() - 1e-3 * own[d]).abs() < 1e-7);
    }
    let (_, activations) = &topics["/risorius/activations"][2];
    assert_eq!(activations["frame"], 20);
    assert_eq!(activations["controls"][1]["value"], run.controls[1].values[2]);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.attachment_indexes[0].name, "problem.lock.toml");
    let layout: Value = serde_json::from_str(&fs::read_to_string(export("result.foxglove.json")).unwrap()).unwrap();
    let path = layout["configById"]["Plot!activations"]["paths"][0]["value"].as_str().unwrap();
    assert_eq!(path, "/risorius/activations.controls[:]{name==\"top\"}.value");
}

#[test]
fn a_recording_that_is_gone_costs_its_clock_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run").display().to_string();
    let (exit, _, stderr) = risorius(&["run", "--set", "fit.frames={first=0,last=0}", "--out", &out]);
    assert_eq!(exit, 0, "{stderr}");
    fs::remove_file(folder.path().join("run/recording.mcap")).unwrap();
    let (exit, stdout, stderr) = risorius(&["export", &out, "--to", "mcap"]);
    assert!(exit == 0 && stderr.contains("warn[O007]") && stdout.contains("result.mcap"), "{stdout}{stderr}");
    assert_eq!(risorius(&["export", &out, "--to", "mcap", "--strict"]).0, 5);
}

#[test]
fn tables_and_meshes_have_one_row_per_frame_and_point() {
    let run = Playback::read(run()).unwrap();
    let sto = fs::read_to_string(export("activations.sto")).unwrap();
    let lines: Vec<&str> = sto.lines().collect();
    let end = lines.iter().position(|line| *line == "endheader").unwrap();
    assert!(lines[..end].contains(&"nRows=4") && lines[..end].contains(&"nColumns=3"), "{sto}");
    assert_eq!(lines[end + 1], "time\ttop\tbottom");
    assert_eq!(lines.len(), end + 2 + 4);
    let last: Vec<f64> = lines[end + 5].split('\t').map(|cell| cell.parse().unwrap()).collect();
    assert_eq!(last, [run.frames[3].time_s, run.controls[0].values[3], run.controls[1].values[3]]);

    let shape = run.farthest().unwrap();
    let name = format!("frame_{:04}", shape.frame.index);
    let obj = fs::read_to_string(export(&format!("{name}.obj"))).unwrap();
    let count = |start: &str| obj.lines().filter(|line| line.starts_with(start)).count();
    let bodies = || std::iter::once(&run.skin).chain(&run.muscles);
    assert_eq!(count("o "), 3);
    assert_eq!(count("v "), bodies().map(|body| body.rest.len()).sum::<usize>());
    assert_eq!(count("f "), bodies().map(|body| body.quads.len()).sum::<usize>());
    let ply = fs::read(export(&format!("{name}.ply"))).unwrap();
    let head = ply.windows(11).position(|bytes| bytes == b"end_header\n").unwrap() + 11;
    assert_eq!(ply.len() - head, 28 * run.skin.rest.len() + 17 * run.skin.quads.len());
    assert_eq!(f64::from_le_bytes(ply[head..head + 8].try_into().unwrap()), shape.skin[0][0]);
    for shape in &run.shapes {
        let name = format!("result_{:04}.exf", shape.frame.index);
        assert_eq!(fs::read(export(&name)).unwrap(), fs::read(run.folder.join("view").join(&name)).unwrap());
    }
    for name in
        ["result.pvd", "result.vtu.series", "linear/result.pvd", "linear/result_0020.vtu", "residuals_0030.vtu"]
    {
        assert_eq!(fs::read(export(name)).unwrap(), fs::read(run.folder.join("view").join(name)).unwrap());
    }
}

/// A cell of a CSV table as the field of a Parquet table that it must be.
fn field(cell: &str, kind: &str) -> Field {
    match kind {
        _ if cell.is_empty() => Field::Null,
        "INT64" => Field::Long(cell.parse().unwrap()),
        "DOUBLE" => Field::Double(cell.parse().unwrap()),
        _ => Field::Str(cell.to_owned()),
    }
}

/// Compares `<name>.parquet` with its CSV table, cell by cell and to the last bit; returns the names and types of its columns.
fn same_table(folder: &Path, exported: &Path, name: &str) -> Vec<(String, String)> {
    let sheet = Sheet::find(&folder.join("tables"), name).unwrap().unwrap();
    let path = exported.join(format!("tables/{name}.parquet"));
    let file = SerializedFileReader::try_from(path.as_path()).unwrap();
    let columns = file.metadata().file_metadata().schema_descr().columns().to_vec();
    let kinds: Vec<(String, String)> =
        columns.iter().map(|c| (c.name().to_owned(), c.physical_type().to_string())).collect();
    assert!(kinds.iter().map(|(name, _)| name).eq(sheet.columns()), "{name}: {kinds:?}");
    let rows: Vec<_> = file.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(rows.len(), sheet.len(), "{name}");
    for (at, row) in rows.into_iter().enumerate() {
        for (column, ((title, value), (_, kind))) in row.into_columns().into_iter().zip(&kinds).enumerate() {
            assert_eq!(value, field(sheet.text(at, column), kind), "{name}, row {at}, {title}");
        }
    }
    kinds
}

#[test]
fn parquet_tables_hold_what_the_csv_tables_hold() {
    let names: Vec<String> = fs::read_dir(run().join("tables"))
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().to_str()?.strip_suffix(".csv").map(str::to_owned))
        .collect();
    assert!(names.len() > 10, "{names:?}");
    let mut found = BTreeMap::new();
    for name in &names {
        found.insert(name.as_str(), same_table(run(), &run().join("export"), name));
    }
    assert_eq!(fs::read_dir(export("tables")).unwrap().count(), names.len());
    let kind = |table: &str, column: &str| {
        found[table].iter().find(|(name, _)| name == column).map(|(_, kind)| kind.as_str()).unwrap()
    };
    // 0.0 is a number also where every value happens to be whole, and what is always empty is one too
    for (table, column, expected) in [
        ("activations", "frame", "INT64"),
        ("activations", "time_s", "DOUBLE"),
        ("activations", "top", "DOUBLE"),
        ("markers", "name", "BYTE_ARRAY"),
        ("markers", "measured_x_mm", "DOUBLE"),
        ("convergence", "kind", "BYTE_ARRAY"),
        ("identifiability", "prior_dominated", "INT64"),
        ("identifiability", "bias", "DOUBLE"),
    ] {
        assert_eq!(kind(table, column), expected, "{table}, {column}");
    }
}

/// Names that look like numbers stay names, commas and quotes stay in their cells, and a table may have no row.
#[test]
fn parquet_keeps_names_that_look_like_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables");
    fs::create_dir(&tables).unwrap();
    fs::copy(run().join("status.json"), folder.path().join("status.json")).unwrap();
    let write = |name: &str, text: &str| fs::write(tables.join(name), text).unwrap();
    write("markers.csv", "frame,time_s,name,x_mm\n0,0.0,7,1.0\n1,0.5,007,\n2,1.0,\"a, \"\"b\"\"\",-inf\n");
    write("activations.csv", "frame,time_s,a\n0,0.0,0.25\n");
    write("outliers.csv", "frame,time_s,marker,weight\n");
    write("labels.csv", "label,count\n007,9007199254740993\n8,-1\n");
    let (path, out) = (folder.path().display().to_string(), folder.path().join("out"));
    let (exit, stdout, stderr) = risorius(&["export", &path, "--to", "parquet", "--out", &out.display().to_string()]);
    assert!(exit == 0 && stdout.lines().count() == 4, "{stdout}{stderr}");
    let kinds = |name: &str| -> Vec<String> {
        same_table(folder.path(), &out, name).into_iter().map(|(_, kind)| kind).collect()
    };
    assert_eq!(kinds("markers"), ["INT64", "DOUBLE", "BYTE_ARRAY", "DOUBLE"]);
    assert_eq!(kinds("activations"), ["INT64", "DOUBLE", "DOUBLE"]);
    assert_eq!(kinds("outliers"), ["DOUBLE", "DOUBLE", "BYTE_ARRAY", "DOUBLE"]);
    // 007 is a number, though no count
    assert_eq!(kinds("labels"), ["DOUBLE", "INT64"]);
    write("labels.csv", "label,count\n007\n");
    let (exit, _, stderr) = risorius(&["export", &path, "--to", "parquet"]);
    assert!(exit == 6 && stderr.contains("error[O005]") && stderr.contains("row 2 has 1 cells"), "{stderr}");
}

/// Tables are there for every task, shapes are not.
#[test]
fn tables_of_fibres_are_exported_too() {
    let folder = tempfile::tempdir().unwrap();
    let fan = folder.path().join("fan");
    let (path, problem) =
        (fan.display().to_string(), concat!(env!("CARGO_MANIFEST_DIR"), "/problems/fibres/problem.toml"));
    assert_eq!(risorius(&["run", problem, "-q", "--out", &path]).0, 0);
    let (exit, stdout, stderr) = risorius(&["export", &path, "--to", "parquet"]);
    assert!(exit == 0 && stdout.contains("fibre_angles.parquet"), "{stdout}{stderr}");
    same_table(&fan, &fan.join("export"), "fibre_angles");
    let (exit, _, stderr) = risorius(&["export", &path, "--to", "glb"]);
    assert!(exit == 6 && stderr.contains("error[O003]"), "{stderr}");
}

#[test]
fn inspect_tells_what_an_exported_file_holds() {
    let run = Playback::read(run()).unwrap();
    let frame = run.farthest().unwrap().frame.index;
    let points = format!("points {}", run.skin.rest.len());
    for (name, words) in [
        ("result.glb", vec!["scene `beam`, modes within", &points, "activation bottom", "keys 4"]),
        ("activations.sto", vec!["storage, 4 rows, 3 columns", "top", "range 0.0 to"]),
        (&format!("frame_{frame:04}.obj"), vec!["beam, frame", &points, "bottom"]),
        (&format!("frame_{frame:04}.ply"), vec!["beam, frame", "skin", &points]),
        (
            "tables/markers.parquet",
            vec!["table, 48 rows, 13 columns", "distance_mm", "type DOUBLE", "type BYTE_ARRAY"],
        ),
        ("result.mcap", vec!["/risorius/skin"]),
        ("result_0030.exf", vec!["deformed"]),
    ] {
        let path = export(name).display().to_string();
        let (exit, page, stderr) = risorius(&["inspect", &path]);
        assert_eq!(exit, 0, "{stderr}");
        for words in words {
            assert!(page.contains(words), "`{words}` is not in\n{page}");
        }
        let (_, page, _) = risorius(&["inspect", &path, "--json"]);
        assert!(serde_json::from_str::<Value>(&page).is_ok(), "{page}");
        // half of it says that it is not whole, or what is left
        let half = tempfile::tempdir().unwrap();
        let cut = half.path().join(Path::new(name).file_name().unwrap());
        let bytes = fs::read(export(name)).unwrap();
        fs::write(&cut, &bytes[..bytes.len() / 7]).unwrap();
        let (exit, _, stderr) = risorius(&["inspect", &cut.display().to_string()]);
        assert!(exit == 0 || ((exit == 6 || exit == 3) && stderr.starts_with("error[")), "{name}: {exit} {stderr}");
    }
    let table = export("tables/markers.parquet").display().to_string();
    let (_, page, _) = risorius(&["inspect", &table, "--json"]);
    let columns = serde_json::from_str::<Value>(&page).unwrap();
    let lost =
        run.markers.iter().flat_map(|marker| &marker.samples).filter(|sample| sample.measured.is_none()).count();
    assert_eq!(
        (&columns["parts"][12]["name"], &columns["parts"][12]["holds"]["empty"]),
        (&"distance_mm".into(), &lost.into())
    );
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let again = folder.path().display().to_string();
    let (exit, ..) = risorius(&[
        "export",
        &run().display().to_string(),
        "--to",
        "glb,mcap,parquet",
        "--out",
        &again,
        "--threads",
        "1",
    ]);
    assert_eq!(exit, 0);
    for name in ["result.glb", "result.mcap", "tables/markers.parquet"] {
        assert!(fs::read(folder.path().join(name)).unwrap() == fs::read(export(name)).unwrap(), "{name}");
    }
}

#[test]
fn inspect_tells_what_a_run_holds() {
    let folder = run().display().to_string();
    let (exit, page, _) = risorius(&["inspect", &folder]);
    for words in ["converged, 4 frames", "bottom", "B07", "markers (48)", "shapes: 4 frames", "--to glb,mcap,sto"] {
        assert!(page.contains(words), "`{words}` is not in\n{page}");
    }
    assert!(page.contains("model: 24 elements, 63 nodes, ") && page.contains(" unknowns, 2 muscles\n"), "{page}");
    assert_eq!(exit, 0);
    let (_, page, _) = risorius(&["inspect", &folder, "--json"]);
    let value: Value = serde_json::from_str(&page).unwrap();
    assert_eq!((&value["status"], &value["controls"]["bottom"]["frame"]), (&"converged".into(), &30.into()));
}

/// What is made from tables reads no shape, and what is copied takes it as it is.
#[test]
fn what_needs_no_shapes_does_not_read_them() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("run");
    for part in ["tables", "view", "view/linear"] {
        fs::create_dir_all(copy.join(part)).unwrap();
        for entry in
            fs::read_dir(run().join(part)).unwrap().map(Result::unwrap).filter(|entry| entry.path().is_file())
        {
            fs::copy(entry.path(), copy.join(part).join(entry.file_name())).unwrap();
        }
    }
    for name in ["status.json", "problem.lock.toml"] {
        fs::copy(run().join(name), copy.join(name)).unwrap();
    }
    for frame in ["0000", "0010", "0020", "0030"] {
        fs::write(copy.join(format!("view/result_{frame}.exf")), "no shape").unwrap();
    }
    let path = copy.display().to_string();
    let (exit, _, stderr) = risorius(&["export", &path, "--to", "glb"]);
    assert!(exit != 0 && stderr.contains("result_0000.exf"), "{stderr}");
    let (exit, _, stderr) = risorius(&["export", &path, "--to", "sto,parquet,exf,vtu"]);
    assert_eq!(exit, 0, "{stderr}");
    for name in ["activations.sto", "tables/activations.parquet", "result.pvd", "result.com"] {
        assert!(fs::read(copy.join("export").join(name)).unwrap() == fs::read(export(name)).unwrap(), "{name}");
    }
    assert_eq!(fs::read(copy.join("export/result_0020.exf")).unwrap(), b"no shape");
}

#[test]
fn what_cannot_be_exported_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().display().to_string();
    for command in [&["export", &here, "--to", "glb"][..], &["inspect", &here]] {
        let (exit, _, stderr) = risorius(command);
        assert!(exit == 6 && stderr.contains("error[O003]") && stderr.contains("lacks status.json"), "{stderr}");
    }
    let whole = run().display().to_string();
    let (exit, _, stderr) = risorius(&["export", &whole, "--to", "obj", "--frame", "7"]);
    assert!(exit == 6 && stderr.contains("error[O006]") && stderr.contains("0, 10, 20, 30"), "{stderr}");
    let (exit, _, stderr) = risorius(&["export", &whole, "--to", "fbx"]);
    assert!(exit == 2 && stderr.contains("glb, mcap, sto") && stderr.contains("parquet"), "{stderr}");
    let out = folder.path().join("blind").display().to_string();
    let blind = ["run", BEAM, "--set", "fit.frames={first=0,last=0}", "--set", "output.view=false", "--out", &out];
    assert_eq!(risorius(&blind).0, 0);
    let (exit, _, stderr) = risorius(&["export", &out, "--to", "glb"]);
    assert!(exit == 6 && stderr.contains("error[O004]") && stderr.contains("view = true"), "{stderr}");
    assert_eq!(risorius(&["export", &out, "--to", "sto"]).0, 0, "activations need no shapes");
    // a mesh that is not that of the problem
    let lock = folder.path().join("blind/problem.lock.toml");
    let longer = fs::read_to_string(&lock).unwrap().replacen("[60.0, 20.0, 20.0]", "[61.0, 20.0, 20.0]", 1);
    let changed = folder.path().join("changed");
    fs::create_dir_all(changed.join("view")).unwrap();
    fs::create_dir_all(changed.join("tables")).unwrap();
    fs::write(changed.join("problem.lock.toml"), longer).unwrap();
    for name in ["status.json", "view/result_0000.exf", "tables/activations.csv", "tables/markers.csv"] {
        fs::copy(run().join(name), changed.join(name)).unwrap();
    }
    let (exit, _, stderr) = risorius(&["export", &changed.display().to_string(), "--to", "glb"]);
    assert!(
        exit == 6 && stderr.contains("error[O005]") && stderr.contains("not on the mesh of the problem"),
        "{stderr}"
    );
    let markers = folder.path().join("blind/tables/markers.csv");
    fs::write(&markers, fs::read_to_string(&markers).unwrap().replacen("x_mm", "x_cm", 1)).unwrap();
    let (exit, _, stderr) = risorius(&["export", &out, "--to", "glb"]);
    assert!(exit == 6 && stderr.contains("error[O005]") && stderr.contains("no column `x_mm`"), "{stderr}");
}
