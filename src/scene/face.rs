//! The face: `[mesh] face`, the file with its landmarks and muscles, and `[[muscle]] face`.

use super::cursor::{FINITE, Item, Mistakes, NOT_NEGATIVE, POSITIVE, Range, Table};
use super::references::{References, help_for_name};
use super::spec::{FaceMeshSpec, FaceMuscleSpec, GeometrySpec, MeshSpec};
use super::tree::{Entry, Node, Source, Value};
use crate::error::{Error, Place};
use crate::mesh::facial::{Anchor, BodySide, Course, Facial, Landmark, Sheet};
use std::path::Path;
use std::sync::{Arc, LazyLock};

/// The face that is built in.
pub const FACE: &str = include_str!("../../data/face/face.toml");
/// What messages call it.
const NAME: &str = "face.toml (built in)";

static BUILT_IN: LazyLock<Arc<Facial>> = LazyLock::new(|| {
    let mistakes = Mistakes::default();
    let face = Source::new(NAME, FACE).tree().ok().and_then(|root| facial(&root, None, &mistakes));
    match (face, &mistakes.sorted(NAME)[..]) {
        (Some(face), []) => Arc::new(face),
        (_, mistakes) => panic!("the built-in face has mistakes: {mistakes:?}"),
    }
});

/// The face that is built in.
pub fn built_in_face() -> Arc<Facial> {
    Arc::clone(&BUILT_IN)
}

const DEPTH: Range = Range { allowed: "from 0 (deep) to 1 (skin)", holds: |x| (0.0..=1.0).contains(&x) };

/// `face = { landmarks = "face.toml", layers = 1, halved = false, half = false }`.
pub(super) fn face_mesh(item: &Item, references: &References) -> Option<FaceMeshSpec> {
    item.table(|table| {
        let landmarks = table.optional("landmarks", |item| references.file(&item));
        let layers = table.or("layers", 1, |item| item.whole(1, 8));
        let halved = table.or("halved", false, |item| item.flag());
        let half = table.or("half", false, |item| item.flag());
        let landmarks = landmarks?;
        let face = match &landmarks {
            Some(path) if references.reads_files() => Arc::new(read(path, table)?),
            _ => built_in_face(),
        };
        Some(FaceMeshSpec { landmarks, layers: layers?, halved: halved?, half: half?, face })
    })
}

/// A file with a part of a face; what it does not hold is that of the face that is built in.
fn read(path: &Path, table: &Table) -> Option<Facial> {
    let mistakes = table.mistakes();
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(source) => {
            mistakes.add(Error::Io { action: "read", path: path.into(), source });
            return None;
        }
    };
    match Source::new(&path.display().to_string(), &text).tree() {
        Ok(root) => facial(&root, Some(&BUILT_IN), mistakes),
        Err(errors) => {
            errors.into_iter().for_each(|error| mistakes.add(error));
            None
        }
    }
}

/// A whole face from a file, on top of another one.
fn facial(root: &Node, base: Option<&Facial>, mistakes: &Mistakes) -> Option<Facial> {
    for kind in ["landmark", "muscle", "ligament"] {
        super::references::unique_names(root, kind, mistakes);
    }
    let (landmarks, muscles, ligaments) = Item { node: root, path: String::new(), mistakes }.table(|file| {
        let landmarks = file.tables("landmark", |table| landmark(table, base));
        let muscles = file.tables("muscle", course);
        let ligaments = file.tables("ligament", anchor);
        Some((landmarks?, muscles?, ligaments?))
    })?;
    let landmarks = merged(base.map(|b| &b.landmarks), landmarks, |l| &l.name);
    let muscles = merged(base.map(|b| &b.muscles), muscles, |m| &m.name);
    let ligaments = merged(base.map(|b| &b.ligaments), ligaments, |l| &l.name);
    for (k, one) in landmarks.iter().enumerate() {
        let close = |other: &&Landmark| (other.u - one.u).hypot(other.v - one.v) < CLOSEST;
        if let Some(other) = landmarks[..k].iter().find(close) {
            let place = [&one.name, &other.name].into_iter().find_map(|name| place_of(root, name));
            mistakes.add(Error::OutOfRange {
                key: format!("landmark.{}.sheet_mm", one.name),
                value: format!("[{:?}, {:?}] mm", one.u, one.v).into(),
                allowed: format!("more than {CLOSEST} mm from the landmark `{}` on the sheet", other.name),
                place: place.unwrap_or_else(|| root.place.clone()),
            });
            return None;
        }
    }
    let sheet = Sheet::new(&landmarks);
    if sheet.is_none() {
        let (found, place) = (format!("{} landmarks", landmarks.len()).into(), root.place.clone());
        let expected = "landmarks that are not all on a line of the sheet".into();
        mistakes.add(Error::WrongLength { key: "landmark".into(), found, expected, place });
    }
    Some(Facial { landmarks, sheet: sheet?, muscles, ligaments })
}

/// Two landmarks that are closer on the sheet would tear it, mm.
const CLOSEST: f64 = 0.5;

fn place_of(root: &Node, name: &str) -> Option<Place> {
    let named = root.tables("landmark").iter().find(|node| node.name().is_some_and(|(own, _)| own == name));
    named.map(|node| node.place.clone())
}

/// `own` in place of those of the same name in `base`, and after the rest.
fn merged<T: Clone>(base: Option<&Vec<T>>, own: Vec<T>, name: fn(&T) -> &String) -> Vec<T> {
    let mut all = base.cloned().unwrap_or_default();
    for one in own {
        match all.iter_mut().find(|other| name(other) == name(&one)) {
            Some(other) => *other = one,
            None => all.push(one),
        }
    }
    all
}

/// A landmark; one that the base has takes from there what it does not say.
fn landmark(table: &mut Table, base: Option<&Facial>) -> Option<Landmark> {
    let name = table.required("name", "name = \"pronasale\"", |item| item.name());
    let known = base.and_then(|base| base.landmarks.iter().find(|l| Some(&l.name) == name.as_ref()));
    let sheet = match known {
        Some(known) => table.or("sheet_mm", [known.u, known.v], |item| pair(&item)),
        None => table.required("sheet_mm", "sheet_mm = [12.5, -20.0]", |item| pair(&item)),
    };
    let position = table.required("position_mm", "position_mm = [0.0, 4.1, 130.7]", |item| item.numbers(FINITE));
    let thickness = match known {
        Some(known) => table.or("thickness_mm", known.thickness, |item| item.number(POSITIVE)),
        None => table.required("thickness_mm", "thickness_mm = 8.0", |item| item.number(POSITIVE)),
    };
    table.optional("source", |item| item.name())?;
    let ([u, v], position) = (sheet?, position?);
    if u < 0.0 {
        return table.item("sheet_mm")?.out_of_range(&format!("[{u:?}, {v:?}]"), "on the left half, u >= 0");
    }
    if (u == 0.0) != (position[0] == 0.0) || position[0] < 0.0 {
        let allowed = if u == 0.0 { "x = 0, as it is on the midline (u = 0)" } else { "x > 0, as it is on the left" };
        return table.item("position_mm")?.out_of_range(&format!("{position:?}"), allowed);
    }
    Some(Landmark { name: name?, u, v, position, thickness: thickness? })
}

/// Two numbers.
fn pair(item: &Item) -> Option<[f64; 2]> {
    let entries = item.list("a list of 2 numbers", |entry| entry.number(FINITE))?;
    let count = entries.len();
    entries.try_into().ok().or_else(|| item.wrong_length(&format!("{count} entries"), "2 (u, v)"))
}

fn course(table: &mut Table) -> Option<Course> {
    let name = table.required("name", "name = \"zygomaticus_major\"", |item| item.name());
    let abbreviation = table.or("abbreviation", String::new(), |item| item.name());
    let fma = table.optional("fma", |item| item.whole(1, 10_000_000));
    let path = table.required("path", "path = [[60.0, 18.0, 0.3], [30.0, -33.0, 0.5]]", |item| {
        let path = item.list("a list of points (u, v, w)", |point| {
            let [u, v, w] = point.numbers(FINITE)?;
            if (DEPTH.holds)(w) { Some([u, v, w]) } else { point.out_of_range(&format!("w = {w:?}"), DEPTH.allowed) }
        })?;
        match path.len() {
            0 | 1 => item.wrong_length(&format!("{} points", path.len()), "at least 2"),
            _ => Some(path),
        }
    });
    let points = path.as_ref().map(Vec::len);
    let width = table.required("width_mm", "width_mm = 8.0", |item| at_points(&item, points));
    let thickness = table.required("thickness_mm", "thickness_mm = 2.5", |item| at_points(&item, points));
    let elements = table.required("elements", "elements = [8, 2, 1]", |item| {
        item.triple("a list of 3 whole numbers", |item| item.whole(1, 100))
    });
    let closed = table.or("closed", false, |item| item.flag());
    let focus = table.optional("focus_mm", |item| pair(&item));
    let origin = table.or("origin_mm", Vec::new(), |item| item.list("a list of places [u, v]", |place| pair(&place)));
    table.optional("source", |item| item.name())?;
    let (elements, closed) = (elements?, closed?);
    if closed && elements[0] < 3 {
        return table.item("elements")?.out_of_range(&format!("{elements:?}"), "3 or more along a closed muscle");
    }
    Some(Course {
        name: name?,
        abbreviation: abbreviation?,
        fma: fma?,
        path: path?,
        width: width?,
        thickness: thickness?,
        elements,
        closed,
        focus: focus?,
        origin: origin?,
    })
}

/// One number for all points of a path, or one for each.
fn at_points(item: &Item, points: Option<usize>) -> Option<Vec<f64>> {
    if !matches!(item.node.value, Value::List(_)) {
        let value = item.number(POSITIVE)?;
        return Some(vec![value; points.unwrap_or_default()]);
    }
    let values = item.list("a number, or a list of numbers", |entry| entry.number(POSITIVE))?;
    match points {
        Some(points) if points != values.len() => item
            .wrong_length(&format!("{} entries", values.len()), &format!("{points}, one for each point of the path")),
        _ => Some(values),
    }
}

fn anchor(table: &mut Table) -> Option<Anchor> {
    let name = table.required("name", "name = \"zygomatic\"", |item| item.name());
    let sheet = table.required("sheet_mm", "sheet_mm = [62.0, 14.0]", |item| pair(&item));
    table.optional("source", |item| item.name())?;
    let [u, v] = sheet?;
    if (NOT_NEGATIVE.holds)(u) {
        return Some(Anchor { name: name?, u, v });
    }
    table.item("sheet_mm")?.out_of_range(&format!("[{u:?}, {v:?}]"), "on the left half, u >= 0")
}

/// Makes of every `[[muscle]]` that names muscles of the face one table for each of them and for each side, with their names.
/// Without a side it is both, and the left one of a half face.
pub(super) fn expand_muscles(root: &mut Node) {
    let inner = |node: &Node, key: &str| Some(node.entries()?.iter().find(|entry| entry.key == key)?.node.clone());
    let half = inner(root, "mesh").and_then(|mesh| inner(&inner(&mesh, "face")?, "half"));
    let is_half = half.is_some_and(|half| matches!(half.value, Value::Flag(true)));
    let Value::Table(entries) = &mut root.value else { return };
    let Some(Entry { node: Node { value: Value::List(muscles), .. }, .. }) =
        entries.iter_mut().find(|entry| entry.key == "muscle")
    else {
        return;
    };
    *muscles = muscles.drain(..).flat_map(|muscle| expanded(muscle, is_half)).collect();
}

fn expanded(muscle: Node, is_half: bool) -> Vec<Node> {
    let Value::Table(entries) = &muscle.value else { return vec![muscle] };
    let find = |key: &str| entries.iter().find(|entry| entry.key == key);
    let (Some(face), None) = (find("face"), find("name")) else { return vec![muscle] };
    let faces = match &face.node.value {
        Value::List(names) => names.clone(),
        _ => vec![face.node.clone()],
    };
    let side = find("side").map(|entry| &entry.node.value);
    let sides: Vec<&str> = match side {
        None if is_half => vec!["L"],
        None => vec!["L", "R"],
        Some(Value::Text(side)) if side == "both" => vec!["L", "R"],
        Some(Value::Text(side)) => vec![side],
        // the type is wrong, which reading it tells
        Some(_) => return vec![muscle],
    };
    let mut all = Vec::new();
    for node in &faces {
        let Value::Text(name) = &node.value else { return vec![muscle] };
        for side in &sides {
            let text = |key: &str, value: String, place: &Place| Entry {
                key: key.into(),
                place: place.clone(),
                node: Node { place: place.clone(), value: Value::Text(value) },
            };
            let side_place = find("side").map_or(&node.place, |entry| &entry.node.place);
            let mut own: Vec<Entry> =
                entries.iter().filter(|entry| entry.key != "face" && entry.key != "side").cloned().collect();
            own.push(text("name", format!("{name}.{side}"), &node.place));
            own.push(text("face", name.clone(), &node.place));
            own.push(text("side", (*side).to_owned(), side_place));
            all.push(Node { place: muscle.place.clone(), value: Value::Table(own) });
        }
    }
    all
}

/// `face` and `side` of a muscle; `host` is `None` where the mesh is mistaken.
pub(super) fn muscle(table: &mut Table, host: Option<&MeshSpec>) -> Option<FaceMuscleSpec> {
    let sides = BodySide::ALL.map(|side| (side.letter(), side));
    let side = table.required("side", "side = \"L\"", |item| item.choice(&sides, &[]));
    let face = table.required("face", "face = \"zygomaticus_major\"", |item| {
        let name = item.name()?;
        match host.map(|host| &host.geometry) {
            None => Some((name, built_in_face())),
            Some(GeometrySpec::Face(spec)) => {
                if spec.face.muscle(&name).is_some() {
                    return Some((name, Arc::clone(&spec.face)));
                }
                let known: Vec<String> = spec.face.muscles.iter().map(|course| course.name.clone()).collect();
                unknown(&item, "muscle of the face", name, &known, "muscles of the face")
            }
            Some(_) => {
                item.out_of_range(&format!("{name:?}"), "left out: the mesh is no face; write [mesh] face = {}")
            }
        }
    });
    let ((name, face), side) = (face?, side?);
    if let Some(GeometrySpec::Face(spec)) = host.map(|host| &host.geometry)
        && spec.half
        && side == BodySide::Right
    {
        return table.item("side")?.out_of_range("\"R\"", "\"L\": the mesh is the left half of the face");
    }
    Some(FaceMuscleSpec { name, side, face })
}

/// What of a face an attachment may name.
pub(super) enum Anchors {
    /// `ligament = "zygomatic"`.
    Ligament,
    /// `origin = "zygomaticus_major"`: where a muscle is fixed to bone.
    Origin,
}

/// Where the ligaments or origins are that an attachment names, mm: one name or a list, each with its side, as
/// `"zygomatic.L"`, or without for both (of the left half, the left).
pub(super) fn anchors(item: &Item, host: Option<&MeshSpec>, kind: Anchors) -> Option<Vec<[f64; 3]>> {
    let (face, half) = match host.map(|host| &host.geometry) {
        None => (built_in_face(), false),
        Some(GeometrySpec::Face(spec)) => (Arc::clone(&spec.face), spec.half),
        Some(_) => {
            return item.out_of_range(&item.node.to_toml(), "left out: the mesh is no face; write position_mm");
        }
    };
    let of_name = |item: &Item| -> Option<Vec<[f64; 3]>> {
        let written = item.name()?;
        let suffix = |side: &BodySide| written.strip_suffix(side.letter()).and_then(|name| name.strip_suffix('.'));
        let named = BodySide::ALL.into_iter().find_map(|side| Some((suffix(&side)?, vec![side])));
        let (name, sides) = named.unwrap_or_else(|| (&written, BodySide::ALL.to_vec()));
        let sides: Vec<BodySide> = sides.into_iter().filter(|side| !half || *side == BodySide::Left).collect();
        if sides.is_empty() {
            return item.out_of_range(&format!("{written:?}"), "on the left: the mesh is the left half of the face");
        }
        let on = |side: BodySide| match kind {
            Anchors::Ligament => face.ligament(name, side).map(|at| vec![at]),
            Anchors::Origin => face.origin(name, side).filter(|all| !all.is_empty()),
        };
        if let Some(found) = sides.iter().map(|side| on(*side)).collect::<Option<Vec<_>>>() {
            return Some(found.concat());
        }
        let ([what, kinds], known): (_, Vec<&String>) = match kind {
            Anchors::Ligament => {
                (["ligament of the face", "ligaments of the face"], face.ligaments.iter().map(|a| &a.name).collect())
            }
            Anchors::Origin => (
                ["muscle of the face with an origin at bone", "muscles of the face with an origin at bone"],
                face.muscles.iter().filter(|m| !m.origin.is_empty()).map(|m| &m.name).collect(),
            ),
        };
        let known: Vec<String> = known.into_iter().cloned().collect();
        unknown(item, what, written, &known, kinds)
    };
    match &item.node.value {
        Value::List(_) => Some(item.list("a name or a list of names", |name| of_name(&name))?.concat()),
        _ => of_name(item),
    }
}

fn unknown<T>(item: &Item, kind: &'static str, name: String, known: &[String], kinds: &str) -> Option<T> {
    let help = help_for_name(&name, known, kinds);
    item.mistakes.add(Error::UnknownName { kind, name, help, place: item.node.place.clone() });
    None
}
