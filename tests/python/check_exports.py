"""Reads what `risorius export RUN` wrote with the libraries that others use, and compares with the tables of the run.

    python tests/python/check_exports.py RUN

Needs numpy, mcap, jsonschema, trimesh, pygltflib, cmlibs.zinc; if pandas and pyarrow are there, the Parquet tables are read too; if `gltf_validator.js` is named by GLTF_VALIDATOR (a folder in which
npm installed gltf-validator) and node is there, the GLB file is validated too.
"""

import base64
import csv
import json
import os
import pathlib
import subprocess
import sys

import jsonschema
import numpy as np
import pygltflib
import trimesh
from cmlibs.zinc.context import Context
from cmlibs.zinc.field import Field
from mcap.reader import make_reader

run = pathlib.Path(sys.argv[1])
out = run / "export"


def table(name):
    with open(run / "tables" / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


activations = table("activations")
controls = [name for name in activations[0] if name not in ("frame", "time_s") and not name.endswith("_sd")]


def check_mcap():
    counts = {}
    with open(out / "result.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        validators = {}
        for schema, channel, message in reader.iter_messages():
            assert channel.message_encoding == "json" and schema.encoding == "jsonschema"
            if schema.id not in validators:
                definition = json.loads(schema.data)
                validators[schema.id] = jsonschema.validators.validator_for(definition)(definition)
            value = json.loads(message.data)
            # base64 and time formats are annotations; types and required fields are checked
            errors = list(validators[schema.id].iter_errors(value))
            assert not errors, (channel.topic, errors[0].message)
            row = counts[channel.topic] = counts.get(channel.topic, -1) + 1
            stamp = value.get("timestamp") or value["entities"][0]["timestamp"]
            assert stamp["sec"] * 10**9 + stamp["nsec"] == message.log_time
            if schema.name == "foxglove.PointCloud":
                points = np.frombuffer(base64.b64decode(value["data"]), dtype="<f4").reshape(-1, 4)
                assert value["point_stride"] == 16 and np.isfinite(points[:, :3]).all()
            if schema.name == "risorius.Activations":
                for control in value["controls"]:
                    assert control["value"] == float(activations[row][control["name"]])
                    if control["lower_95"] is not None:
                        assert control["lower_95"] <= control["value"] <= control["upper_95"]
        attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
    assert attachments["problem.lock.toml"] == (run / "problem.lock.toml").read_bytes()
    print(f"mcap: {len(counts)} topics, {sum(counts.values()) + len(counts)} messages decoded and valid")


def check_glb():
    file = pygltflib.GLTF2().load(str(out / "result.glb"))
    blob = file.binary_blob()

    def accessor(index):
        a = file.accessors[index]
        view = file.bufferViews[a.bufferView]
        width = {"SCALAR": 1, "VEC3": 3}[a.type]
        kind = {5126: "<f4", 5125: "<u4"}[a.componentType]
        return np.frombuffer(blob, dtype=kind, count=a.count * width, offset=view.byteOffset).reshape(a.count, width)

    animation = file.animations[0]
    weights = times = None
    for channel in animation.channels:
        sampler = animation.samplers[channel.sampler]
        node = file.nodes[channel.target.node]
        if channel.target.path == "weights":
            times = accessor(sampler.input)[:, 0]
            weights = accessor(sampler.output).reshape(len(times), -1)
        else:
            name = node.name.removeprefix("activation ")
            values = [float(row[name]) for row in activations]
            assert set(accessor(sampler.output)[:, 0]) <= {np.float32(value) for value in values}
    assert weights.min() >= 0 and weights.max() <= 1
    primitive = file.meshes[0].primitives[0]
    skin = accessor(primitive.attributes.POSITION)[None] + np.tensordot(
        weights, np.array([accessor(target["POSITION"]) for target in primitive.targets]), axes=1
    )
    # the frame that was exported as a mesh too
    mesh_file = next(out.glob("frame_*.ply"))
    frame = mesh_file.stem.split("_")[1]
    row = next(k for k, r in enumerate(activations) if int(r["frame"]) == int(frame))
    at = int(np.argmin(abs(times - float(activations[row]["time_s"]))))
    ply = trimesh.load(mesh_file, process=False)
    error = np.linalg.norm(1e3 * skin[at] - ply.vertices, axis=1).max()
    allowed = file.extras["largest_error_of_modes_mm"] + 1e-4
    assert error <= allowed, (error, allowed)
    obj = trimesh.load(mesh_file.with_suffix(".obj"), process=False)
    scene = trimesh.load(out / "result.glb", process=False)
    assert len(scene.geometry) == len(file.meshes)
    assert len(obj.faces) == sum(len(mesh.faces) for mesh in scene.geometry.values())
    assert np.allclose(obj.vertices[: len(ply.vertices)], ply.vertices, atol=1e-9)
    print(f"glb: {len(file.meshes)} meshes, {weights.shape[1]} targets, frame {frame} within {error:.1e} mm of its ply")


def check_validator():
    where = os.environ.get("GLTF_VALIDATOR")
    if not where:
        print("SKIPPED: GLTF_VALIDATOR is not set, so the glTF validator of Khronos has not read the GLB file")
        return
    script = (
        "require('gltf-validator').validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1])))"
        ".then(report => console.log(JSON.stringify(report.issues)))"
    )
    done = subprocess.run(["node", "-e", script, str(out.resolve() / "result.glb")], cwd=where, capture_output=True, text=True, check=True)
    issues = json.loads(done.stdout)
    assert issues["numErrors"] == 0 and issues["numWarnings"] == 0, issues
    print("glb: the validator finds no error and no warning")


def values(region, time=None):
    """The field `deformed` at all nodes."""
    module = region.getFieldmodule()
    deformed = module.findFieldByName("deformed")
    cache = module.createFieldcache()
    if time is not None:
        cache.setTime(time)
    nodes = module.findNodesetByFieldDomainType(Field.DOMAIN_TYPE_NODES).createNodeiterator()
    found, node = [], nodes.next()
    while node.isValid():
        cache.setNode(node)
        result, position = deformed.evaluateReal(cache, 3)
        assert result == 1
        found.append(position)
        node = nodes.next()
    return np.array(found)


def check_exf():
    """All frames in one region, each at its time, are what each file says alone."""
    times = {int(row["frame"]): float(row["time_s"]) for row in activations}
    region = Context("all").getDefaultRegion()
    information = region.createStreaminformationRegion()
    files = {times[int(file.stem.split("_")[1])]: file for file in sorted(out.glob("result_*.exf"))}
    for time, file in files.items():
        resource = information.createStreamresourceFile(str(file))
        information.setResourceAttributeReal(resource, information.ATTRIBUTE_TIME, time)
    assert region.read(information) == 1
    for time, file in files.items():
        alone = Context("one").getDefaultRegion()
        assert alone.readFile(str(file)) == 1
        assert np.allclose(values(region, time), values(alone), rtol=0, atol=1e-12), file
    print(f"exf: Zinc reads {len(files)} frames into one region, each at its time")


def check_sto():
    lines = (out / "activations.sto").read_text().splitlines()
    head = dict(line.split("=") for line in lines[1 : lines.index("endheader")])
    names = lines[lines.index("endheader") + 1].split("\t")
    rows = [list(map(float, line.split("\t"))) for line in lines[lines.index("endheader") + 2 :]]
    assert int(head["nRows"]) == len(rows) == len(activations) and int(head["nColumns"]) == len(names)
    for row, known in zip(rows, activations):
        assert row[0] == float(known["time_s"])
        for name, value in zip(names[1:], row[1:]):
            assert value == float(known[name])
    print(f"sto: {len(rows)} rows of {len(names) - 1} activations")


def check_parquet():
    """Every table with the names, the order and the bits of its CSV file; an empty cell is a null."""
    try:
        import pandas
        import pyarrow.parquet
    except ImportError as error:
        print(f"SKIPPED: {error.name} is not to be had here, so pandas has not read the Parquet tables")
        return
    rows = 0
    names = sorted(path.stem for path in (run / "tables").glob("*.csv"))
    assert names == sorted(path.stem for path in (out / "tables").glob("*.parquet"))
    for name in names:
        path = out / "tables" / f"{name}.parquet"
        schema = pyarrow.parquet.read_schema(path)
        assert set(map(str, schema.types)) <= {"int64", "double", "string"}, (name, schema)
        read = pandas.read_parquet(path)
        with open(run / "tables" / f"{name}.csv", newline="") as file:
            header, *cells = csv.reader(file)
        assert list(read.columns) == header, (name, header)
        assert len(read) == len(cells), name
        for column, (title, kind) in enumerate(zip(header, map(str, schema.types))):
            for value, row in zip(read[title], cells):
                known = {"int64": float, "double": float, "string": str}[kind](row[column]) if row[column] else None
                assert pandas.isna(value) if known is None else value == known, (name, title, value, known)
        rows += len(read)
    print(f"parquet: pandas reads {rows} rows in {len(names)} tables, all as in their CSV files")


check_mcap()
check_glb()
check_validator()
check_exf()
check_sto()
check_parquet()
