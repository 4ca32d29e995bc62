//! From a tree to a scene: which keys there are, what each may hold, and what stands for it when it is absent.

use super::Scene;
use super::bones;
use super::contacts;
use super::cursor::{FINITE, Item, Mistakes, NOT_NEGATIVE, PART, POSITIVE, Reader, Table};
use super::face;
use super::nearest::nearest;
use super::objectives;
use super::outer;
use super::references::References;
use super::registration::{self, MOST_FRAMES};
use super::spec::*;
use super::tree::{Node, Value};
use crate::error::Error;
use crate::math::factor::Precision;
use crate::mesh::facial::FACES;

/// The scene of a whole file; `None` if there is any mistake in a value.
pub(super) fn scene(root: &Node, name: &str, references: &References, mistakes: &Mistakes) -> Option<Scene> {
    Item { node: root, path: String::new(), mistakes }.table(|file| {
        let name = file.or("name", name.to_string(), |item| item.name());
        let task = file.required("task", "[task]\nkind = \"forward\"", |item| item.table(task));
        let fitting = task == Some(Task::Fit);
        let mesh = file.required(
            "mesh",
            "[mesh]\nblock = { origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }",
            |item| item.table(|table| mesh(table, references)),
        );
        let tissue = file.required("tissue", "[tissue]\nmooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }", |item| {
            item.table(tissue)
        });
        let word = tissue.as_ref().map(|tissue| tissue.law.word());
        let regions = file.tables("region", |table| region(table, word));
        let muscles = file.tables("muscle", |table| muscle(table, references, mesh.as_ref()));
        let bones = file.tables("bone", bones::bone);
        let supports = file.tables("support", support);
        let (slidings, contacts) = contacts::both(file, mesh.as_ref());
        let loads = file.tables("load", load);
        let attachments = file.tables("attachment", |table| bones::attachment(table, mesh.as_ref()));
        let controls =
            file.or("controls", Vec::new(), |item| references.controls(&item, muscles.as_deref(), bones.as_deref()));
        let probes = file.tables("probe", probe);
        let fit = if fitting {
            file.required("fit", "[fit]\nmarkers = \"recording.mcap\"\nunits = \"m\"", |item| {
                item.table(|table| fit(table, references)).map(Some)
            })
        } else {
            file.optional("fit", |item| item.table(|table| fit(table, references)))
        };
        let markers = file.tables("marker", marker);
        if fitting {
            file.must_hold("marker", "[[marker]]\nname = \"M01\"\nposition_mm = [30, 10, 20]");
            if !file.has("bone") {
                file.must_hold("muscle", "[[muscle]]\nname = \"slab\"\n...");
            }
        }
        if let (Some(Some(fit)), Some(markers), true) = (&fit, &markers, fitting) {
            objectives::need_deviations(fit, markers, mistakes);
            if let (Some(muscles), Some(regions)) = (&muscles, &regions) {
                outer::check(fit, (muscles, regions), markers, mistakes);
            }
        }
        let solver = file.or("solver", SolverSpec::default(), |item| item.table(solver));
        let output = file.or("output", OutputSpec::default(), |item| item.table(output));
        let scene = Scene {
            name: name?,
            folder: references.folder().to_path_buf(),
            task: task?,
            mesh: mesh?,
            tissue: tissue?,
            regions: regions?,
            muscles: muscles?,
            bones: bones?,
            supports: supports?,
            slidings: slidings?,
            contacts: contacts?,
            loads: loads?,
            attachments: attachments?.concat(),
            controls: controls?,
            probes: probes?,
            fit: fit?,
            markers: markers?,
            solver: solver?,
            output: output?,
            warnings: Vec::new(),
        };
        Some(scene)
    })
}

impl Default for SolverSpec {
    fn default() -> Self {
        SolverSpec {
            tolerance: 1e-8,
            max_iterations: 30,
            step_max: 1.0,
            step_min: 1e-4,
            precision: Precision::Double,
        }
    }
}

impl Default for OutputSpec {
    fn default() -> Self {
        OutputSpec { view: true, every: 1, estimate: false }
    }
}

impl Default for ChunksSpec {
    fn default() -> ChunksSpec {
        ChunksSpec { count: 1, overlap: 5 }
    }
}

impl Default for FramesSpec {
    fn default() -> Self {
        FramesSpec { first: 0, last: None, step: 1 }
    }
}

fn task(table: &mut Table) -> Option<Task> {
    let kinds = [("forward", Task::Forward), ("fit", Task::Fit)];
    table.required("kind", "kind = \"forward\"", |item| item.choice(&kinds, &[]))
}

/// More than this is a slip of the keyboard: no machine factorises it.
const MOST_ELEMENTS: usize = 100_000;

fn block(table: &mut Table) -> Option<BlockSpec> {
    let origin_mm = table.required("origin_mm", "origin_mm = [0, 0, 0]", |item| item.numbers(FINITE));
    let size_mm = table.required("size_mm", "size_mm = [60, 20, 20]", |item| item.numbers(POSITIVE));
    let elements = table.required("elements", "elements = [6, 2, 2]", |item| {
        item.triple("a list of 3 whole numbers", |item| item.whole(1, 1000))
    });
    let elements = elements?;
    if elements.iter().product::<usize>() > MOST_ELEMENTS {
        let [x, y, z] = elements;
        let written = format!("[{x}, {y}, {z}]");
        let allowed = format!("at most {MOST_ELEMENTS} elements in all");
        return table.item("elements")?.out_of_range(&written, &allowed);
    }
    Some(BlockSpec { origin_mm: origin_mm?, size_mm: size_mm?, elements })
}

pub(super) fn mesh(table: &mut Table, references: &References) -> Option<MeshSpec> {
    let example = "block = { origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }";
    const KEYS: [&str; 4] = ["block", "blocks", "exf", "face"];
    let found: Vec<&str> = KEYS.into_iter().filter(|key| table.has(key)).collect();
    if found.len() > 1 {
        KEYS.iter().for_each(|key| drop(table.item(key)));
        return table.not_exactly_one(&KEYS, &found);
    }
    let blocks = table.item("blocks").map(|item| blocks(&item));
    let face = table.item("face").map(|item| face::face_mesh(&item, references));
    let geometry = match (blocks, face) {
        (Some(blocks), _) => blocks.map(GeometrySpec::Blocks),
        (None, Some(face)) => face.map(GeometrySpec::Face),
        (None, None) => geometry(table, references, example),
    };
    Some(MeshSpec { geometry: geometry?, place: table.place() })
}

/// Boxes with names of their own.
fn blocks(item: &Item) -> Option<Vec<NamedBlockSpec>> {
    let mut names: Vec<String> = Vec::new();
    let blocks = item.list("a list of blocks", |entry| {
        entry.table(|table| {
            let name = table.required("name", "name = \"lower\"", |item| {
                let name = item.name()?;
                // the names of faces are made of it
                if name.contains(':') || name.parse::<i64>().is_ok() || names.contains(&name) {
                    let written = format!("{name:?}");
                    return item.out_of_range(&written, "a name of its own, without `:` and not a number");
                }
                names.push(name.clone());
                Some(name)
            });
            let block = block(table);
            Some(NamedBlockSpec { name: name?, block: block? })
        })
    })?;
    if blocks.is_empty() { item.wrong_length("no entry", "at least one block") } else { Some(blocks) }
}

/// `block`, or `exf` with `field`.
fn geometry(table: &mut Table, references: &References, example: &'static str) -> Option<GeometrySpec> {
    let block = table.item("block").map(|item| item.table(block));
    let exf = table.item("exf").map(|item| references.file(&item));
    let field = if exf.is_some() { table.optional("field", |item| item.name()) } else { Some(None) };
    match (block, exf) {
        (Some(block), None) => block.map(GeometrySpec::Block),
        (None, Some(path)) => Some(GeometrySpec::Exf(ExfSpec { path: path?, field: field? })),
        (None, None) => table.required("block", example, |_| None),
        (Some(_), Some(_)) => table.not_exactly_one(&["block", "exf"], &["block", "exf"]),
    }
}

fn tissue(table: &mut Table) -> Option<TissueSpec> {
    let law = law(table, None);
    let pressures =
        [("trilinear", PressureSpec::Trilinear), ("discontinuous-trilinear", PressureSpec::DiscontinuousTrilinear)];
    let later = [("discontinuous-linear", "four pressures per element"), ("constant", "one pressure per element")];
    let pressure = table.or("pressure", PressureSpec::Trilinear, |item| item.choice(&pressures, &later));
    let kappa_kpa = table.or("kappa_kpa", 10.0, |item| item.number(NOT_NEGATIVE));
    let gauss = table.or("gauss", 5, |item| item.whole(3, 8));
    Some(TissueSpec { law: law?, pressure: pressure?, kappa_kpa: kappa_kpa?, gauss: gauss?, place: table.place() })
}

/// The law of a tissue: of all there are, or the one called `only` with other constants.
fn law(table: &mut Table, only: Option<&str>) -> Option<LawSpec> {
    let mooney_rivlin: Reader<LawSpec> = |item| item.table(mooney_rivlin);
    let neo_hookean: Reader<LawSpec> = |item| item.table(neo_hookean);
    let mut laws = vec![
        ("mooney-rivlin", mooney_rivlin),
        ("neo-hookean", neo_hookean),
        ("guccione", |item| item.table(guccione)),
    ];
    laws.retain(|(word, _)| only.is_none_or(|only| only == *word));
    table.one_of(&laws)
}

/// A part of the tissue: the law of the tissue, called `word`, with other constants.
fn region(table: &mut Table, word: Option<&'static str>) -> Option<RegionSpec> {
    let name = table.required("name", "name = \"lip\"", |item| item.name());
    let elements: Reader<PartSpec> = |item| {
        let elements = item.list("a list of indices of elements", |item| item.whole(0, 1_000_000_000))?;
        if elements.is_empty() {
            return item.wrong_length("no entry", "the index of at least one element");
        }
        Some(PartSpec::Elements(elements))
    };
    let corners: Reader<PartSpec> = |item| {
        let corners = item.list("a list of 2 corners", |corner| corner.numbers(FINITE))?;
        let count = corners.len();
        match corners.try_into() {
            Ok(corners) => Some(PartSpec::Box(corners)),
            Err(_) => item.wrong_length(&format!("{count} corners"), "2, the lower and the upper one"),
        }
    };
    let part = table.one_of(&[("elements", elements), ("box_mm", corners)]);
    let law = law(table, word);
    Some(RegionSpec { name: name?, part: part?, law: law?, place: table.place() })
}

fn neo_hookean(table: &mut Table) -> Option<LawSpec> {
    let mu_kpa = table.required("mu_kpa", "mu_kpa = 1.4", |item| item.number(POSITIVE));
    Some(LawSpec::NeoHookean { mu_kpa: mu_kpa? })
}

fn guccione(table: &mut Table) -> Option<LawSpec> {
    let c_kpa = table.required("c_kpa", "c_kpa = 2", |item| item.number(POSITIVE));
    let bf = table.required("bf", "bf = 8", |item| item.number(POSITIVE));
    let bt = table.required("bt", "bt = 2", |item| item.number(POSITIVE));
    let bfs = table.required("bfs", "bfs = 4", |item| item.number(POSITIVE));
    let fibre = table.required("fibre", "fibre = [1, 0, 0]", direction);
    Some(LawSpec::Guccione { c_kpa: c_kpa?, bf: bf?, bt: bt?, bfs: bfs?, fibre: fibre? })
}

/// A vector that is not zero.
pub(super) fn direction(item: Item) -> Option<[f64; 3]> {
    match item.numbers(FINITE)? {
        [0.0, 0.0, 0.0] => item.out_of_range("[0, 0, 0]", "a direction, not all 0"),
        direction => Some(direction),
    }
}

fn mooney_rivlin(table: &mut Table) -> Option<LawSpec> {
    let c1_kpa = table.required("c1_kpa", "c1_kpa = 0.5", |item| item.number(NOT_NEGATIVE));
    let c2_kpa = table.required("c2_kpa", "c2_kpa = 0.2", |item| item.number(NOT_NEGATIVE));
    let (c1_kpa, c2_kpa) = (c1_kpa?, c2_kpa?);
    if c1_kpa + c2_kpa == 0.0 {
        return table.contradiction("c1_kpa", "c2_kpa", c1_kpa, "greater than 0 where c2_kpa is 0");
    }
    Some(LawSpec::MooneyRivlin { c1_kpa, c2_kpa })
}

pub(super) fn muscle(table: &mut Table, references: &References, host: Option<&MeshSpec>) -> Option<MuscleSpec> {
    let name = table.required("name", "name = \"slab\"", |item| item.name());
    let example = "block = { origin_mm = [4.5, 2.0, 14.2], size_mm = [50, 16, 4], elements = [5, 2, 1] }";
    const KEYS: [&str; 3] = ["block", "exf", "face"];
    let found: Vec<&str> = KEYS.into_iter().filter(|key| table.has(key)).collect();
    let in_face = found == ["face"];
    let in_file = table.has("exf");
    let geometry = match &found[..] {
        ["face"] => face::muscle(table, host).map(GeometrySpec::FaceMuscle),
        [_, _, ..] if table.has("face") => {
            KEYS.iter().for_each(|key| drop(table.item(key)));
            table.not_exactly_one(&KEYS, &found)
        }
        _ => geometry(table, references, example),
    };
    let later = [("hermite", "tricubic Hermite muscles")];
    let element = match in_file || in_face {
        // the file or the face says what its elements are
        true => Some(ElementSpec::Trilinear),
        false => table.or("element", ElementSpec::Trilinear, |item| {
            item.choice(&[("trilinear", ElementSpec::Trilinear)], &later)
        }),
    };
    let fibres = match (in_face, in_file) {
        (true, _) => Some(FibresSpec::Face),
        (false, true) => fibres_in_file(table),
        (false, false) => fibres(table, geometry.as_ref()),
    };
    let activations = [("uniform", ActivationSpec::Uniform), ("field", ActivationSpec::Field)];
    let activation = table.or("activation", ActivationSpec::Uniform, |item| item.choice(&activations, &[]));
    let gauss = table.or("gauss", 3, |item| item.whole(1, 8));
    // the meshes of a face are refined while their muscles stay
    let cut = table.or("cut", in_face, |item| item.flag());
    let taper_mm = table.optional("taper_mm", |item| item.number(POSITIVE));
    let fibre_turn_deg = table.or("fibre_turn_deg", [0.0; 4], |item| {
        let angles = item.list("a list of 4 numbers", |entry| entry.number(FINITE))?;
        let count = angles.len();
        let four = angles.try_into().ok();
        four.or_else(|| item.wrong_length(&format!("{count} entries"), "4 (everywhere, along x, along y, along z)"))
    });
    let example = "blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }";
    let blemker = table.required("blemker", example, |item| item.table(blemker));
    Some(MuscleSpec {
        name: name?,
        geometry: geometry?,
        element: element?,
        fibres: fibres?,
        activation: activation?,
        gauss: gauss?,
        cut: cut?,
        taper_mm: taper_mm?,
        fibre_turn_deg: fibre_turn_deg?,
        blemker: blemker?,
        place: table.place(),
    })
}

/// Angles everywhere or at the nodes; a list at the nodes must have one entry for each.
fn fibres(table: &mut Table, geometry: Option<&GeometrySpec>) -> Option<FibresSpec> {
    let block = match geometry {
        Some(GeometrySpec::Block(block)) => Some(block),
        _ => None,
    };
    let uniform = table.item("fibre_angles_deg").map(|item| item.numbers(FINITE));
    let nodes = table.item("fibre_angles_nodes_deg").map(|item| {
        let angles = item.list("a list with the 3 angles of every node", |node| node.numbers(FINITE))?;
        match block.map(BlockSpec::nodes) {
            Some(nodes) if nodes != angles.len() => item.wrong_length(
                &format!("angles for {} nodes", angles.len()),
                &format!("{nodes}, one triple per node of the block, x fastest"),
            ),
            _ => Some(angles),
        }
    });
    match (uniform, nodes) {
        (Some(uniform), None) => uniform.map(FibresSpec::Uniform),
        (None, Some(nodes)) => nodes.map(FibresSpec::Nodes),
        (None, None) => table.required("fibre_angles_deg", "fibre_angles_deg = [36, 0, 0]", |_| None),
        (Some(_), Some(_)) => table.not_exactly_one(
            &["fibre_angles_deg", "fibre_angles_nodes_deg"],
            &["fibre_angles_deg", "fibre_angles_nodes_deg"],
        ),
    }
}

/// Angles everywhere, or a field of the muscle's EX file.
fn fibres_in_file(table: &mut Table) -> Option<FibresSpec> {
    let uniform = table.item("fibre_angles_deg").map(|item| item.numbers(FINITE));
    let field = table.item("angles_field").map(|item| item.name());
    match (uniform, field) {
        (Some(uniform), None) => uniform.map(FibresSpec::Uniform),
        (None, Some(field)) => field.map(FibresSpec::Field),
        (None, None) => table.required("angles_field", "angles_field = \"fibres\"", |_| None),
        (Some(_), Some(_)) => {
            table.not_exactly_one(&["fibre_angles_deg", "angles_field"], &["fibre_angles_deg", "angles_field"])
        }
    }
}

fn blemker(table: &mut Table) -> Option<BlemkerSpec> {
    let sigma_max_kpa = table.required("sigma_max_kpa", "sigma_max_kpa = 300", |item| item.number(POSITIVE));
    let lambda_star = table.required("lambda_star", "lambda_star = 1.4", |item| item.number(POSITIVE));
    let lambda_ofl = table.required("lambda_ofl", "lambda_ofl = 1.0", |item| item.number(POSITIVE));
    let p1 = table.required("p1", "p1 = 0.005", |item| item.number(NOT_NEGATIVE));
    let p2 = table.required("p2", "p2 = 6.6", |item| item.number(POSITIVE));
    let (lambda_star, lambda_ofl) = (lambda_star?, lambda_ofl?);
    if lambda_star <= lambda_ofl {
        let allowed = format!("greater than lambda_ofl = {lambda_ofl:?}");
        return table.contradiction("lambda_star", "lambda_ofl", lambda_star, &allowed);
    }
    Some(BlemkerSpec { sigma_max_kpa: sigma_max_kpa?, lambda_star, lambda_ofl, p1: p1?, p2: p2? })
}

fn support(table: &mut Table) -> Option<SupportSpec> {
    let clamp: Reader<SupportKind> = |item| {
        item.table(|table| {
            let (face, bone) = (face(table), bones::carried(table));
            Some(SupportKind::Clamp { face: face?, bone: bone? })
        })
    };
    let symmetry: Reader<SupportKind> = |item| item.table(|table| Some(SupportKind::Symmetry { face: face(table)? }));
    let kind = table.one_of(&[
        ("clamp", clamp),
        ("symmetry", symmetry),
        ("plate", |item| item.table(plate)),
        ("rotate", |item| item.table(rotate)),
    ]);
    Some(SupportSpec { kind: kind?, place: table.place() })
}

fn plate(table: &mut Table) -> Option<SupportKind> {
    let face = face(table);
    let offset_mm = table.required("offset_mm", "offset_mm = 2", |item| item.number(FINITE));
    Some(SupportKind::Plate { face: face?, offset_mm: offset_mm? })
}

fn rotate(table: &mut Table) -> Option<SupportKind> {
    let face = face(table);
    let axis = table.required("axis", "axis = [1, 0, 0]", direction);
    let through_mm = table.required("through_mm", "through_mm = [0, 5, 5]", |item| item.numbers(FINITE));
    let angle_deg = table.required("angle_deg", "angle_deg = 90", |item| item.number(FINITE));
    Some(SupportKind::Rotate { face: face?, axis: axis?, through_mm: through_mm?, angle_deg: angle_deg? })
}

/// A name of faces, or a list of names.
pub(super) fn face(table: &mut Table) -> Option<FaceSpec> {
    table.required("face", "face = \"xi1=0\"", faces)
}

/// The name of a face, or a list of them.
pub(super) fn faces(item: Item) -> Option<FaceSpec> {
    match item.node.value {
        Value::List(_) => match item.list("a list of faces", |entry| face_name(&entry))? {
            names if names.is_empty() => item.wrong_length("no entry", "the name of at least one face"),
            names => Some(FaceSpec(names)),
        },
        _ => face_name(&item).map(|name| FaceSpec(vec![name])),
    }
}

/// `"boundary"`, `"xi1=0"` to `"xi3=1"`, or with the number of an element `"7:xi1=0"` or the name of a block.
fn face_name(item: &Item) -> Option<FaceName> {
    let sides = [0, 1, 2].iter().flat_map(|&direction| [0, 1].map(|end| FaceName::Side { direction, end }));
    let names: Vec<(String, FaceName)> =
        sides.chain([FaceName::Boundary]).map(|name| (name.to_string(), name)).collect();
    if let Some((part, side)) = item.text()?.split_once(':')
        && let Some((_, FaceName::Side { direction, end })) = names.iter().find(|(word, _)| *word == side.trim())
    {
        let (direction, end) = (*direction, *end);
        return Some(match part.trim().parse() {
            Ok(element) => FaceName::OfElement { element, direction, end },
            Err(_) => FaceName::OfBlock { block: part.trim().to_owned(), direction, end },
        });
    }
    let text = item.text()?;
    if FACES.contains(&text) {
        return Some(FaceName::OfFace(text.to_owned()));
    }
    if let Some(near) = nearest(text, FACES.into_iter()) {
        let (key, value, place) = (item.path.clone(), text.into(), item.node.place.clone());
        let help = format!("did you mean \"{near}\"? a face has {}", FACES.join(", "));
        item.mistakes.add(Error::UnknownChoice { key, value, help, place });
        return None;
    }
    let words: Vec<(&str, usize)> = names.iter().enumerate().map(|(k, (word, _))| (word.as_str(), k)).collect();
    item.choice(&words, &[]).map(|k| names[k].1.clone())
}

fn load(table: &mut Table) -> Option<LoadSpec> {
    let traction: Reader<LoadKind> = |item| item.table(traction);
    let kind = table.one_of(&[
        ("traction", traction),
        ("gravity", |item| item.table(gravity)),
        ("body_force", |item| item.table(body_force)),
        ("pressure", |item| item.table(pressure)),
        ("nodal_force", |item| item.table(nodal_force)),
        ("spring", |item| item.table(spring)),
    ]);
    Some(LoadSpec { kind: kind?, place: table.place() })
}

fn body_force(table: &mut Table) -> Option<LoadKind> {
    let mn_mm3 = table.required("mn_mm3", "mn_mm3 = [0, 0, -0.01]", |item| item.numbers(FINITE));
    Some(LoadKind::BodyForce { mn_mm3: mn_mm3? })
}

fn pressure(table: &mut Table) -> Option<LoadKind> {
    let face = face(table);
    let kpa = table.required("kpa", "kpa = 0.04", |item| item.number(FINITE));
    Some(LoadKind::Pressure { face: face?, kpa: kpa? })
}

fn nodal_force(table: &mut Table) -> Option<LoadKind> {
    let position_mm = table.required("position_mm", "position_mm = [60, 20, 20]", |item| item.numbers(FINITE));
    let mn = table.required("mn", "mn = [0, 0, -5]", |item| item.numbers(FINITE));
    Some(LoadKind::NodalForce { position_mm: position_mm?, mn: mn? })
}

fn spring(table: &mut Table) -> Option<LoadKind> {
    let face = face(table);
    let kpa_per_mm = table.required("kpa_per_mm", "kpa_per_mm = 0.5", |item| item.number(NOT_NEGATIVE));
    let normal_only = table.or("normal_only", false, |item| item.flag());
    Some(LoadKind::Spring { face: face?, kpa_per_mm: kpa_per_mm?, normal_only: normal_only? })
}

fn traction(table: &mut Table) -> Option<LoadKind> {
    let face = face(table);
    let kpa = table.required("kpa", "kpa = [0, 0, -0.04]", |item| item.numbers(FINITE));
    Some(LoadKind::Traction { face: face?, kpa: kpa? })
}

fn gravity(table: &mut Table) -> Option<LoadKind> {
    let density = table.required("density_kg_m3", "density_kg_m3 = 1040", |item| item.number(POSITIVE));
    let acceleration =
        table.required("acceleration_m_s2", "acceleration_m_s2 = [0, 0, -9.81]", |item| item.numbers(FINITE));
    Some(LoadKind::Gravity { density_kg_m3: density?, acceleration_m_s2: acceleration? })
}

fn probe(table: &mut Table) -> Option<ProbeSpec> {
    let name = table.required("name", "name = \"tip\"", |item| item.name());
    let position_mm = table.required("position_mm", "position_mm = [60, 20, 20]", |item| item.numbers(FINITE));
    Some(ProbeSpec { name: name?, position_mm: position_mm?, place: table.place() })
}

fn marker(table: &mut Table) -> Option<MarkerSpec> {
    let name = table.required("name", "name = \"M01\"", |item| item.name());
    let position_mm = table.required("position_mm", "position_mm = [30, 10, 20]", |item| item.numbers(FINITE));
    let sd_mm = table.optional("sd_mm", |item| item.number(POSITIVE));
    let label = table.optional("label", |item| item.name());
    let (name, label) = (name?, label?);
    let label = label.unwrap_or_else(|| name.clone());
    Some(MarkerSpec { name, label, position_mm: position_mm?, sd_mm: sd_mm?, place: table.place() })
}

/// More would be shorter than they are worth, whatever the recording.
const MOST_CHUNKS: usize = 1000;
/// So few sensitivities cost less than the steps that kept ones add (`problems/fit_study`).
const FEW_UNKNOWNS: usize = 12;

fn fit(table: &mut Table, references: &References) -> Option<FitSpec> {
    let markers = table.required("markers", "markers = \"recording.mcap\"", |item| references.file(&item));
    let markers_place = table.place_of("markers");
    let units = table.required("units", "units = \"m\"", registration::units);
    let units_place = table.place_of("units");
    let topic = table.optional("topic", |item| item.name());
    let sensitivities =
        [("tangent", SensitivitySpec::Tangent), ("finite-difference", SensitivitySpec::FiniteDifference)];
    let sensitivity = table.or("sensitivity", SensitivitySpec::Tangent, |item| item.choice(&sensitivities, &[]));
    let reuses = [
        ("fresh", ReuseSpec::Fresh),
        ("frozen", ReuseSpec::Frozen),
        ("broyden", ReuseSpec::Broyden),
        ("adjoint", ReuseSpec::Adjoint),
    ];
    let reuse = table.optional("reuse", |item| item.choice(&reuses, &[]));
    let unknowns = match references.muscles() {
        // which of the bones are sought must be said
        none if none.is_empty() && references.has_bones() => {
            table.required("unknowns", "unknowns = [\"jaw.hinge\"]", |item| references.unknowns(&item))
        }
        muscles => table.or("unknowns", muscles, |item| references.unknowns(&item)),
    };
    let zero_is_missing = table.or("zero_is_missing", true, |item| item.flag());
    let allow_truncated = table.or("allow_truncated", false, |item| item.flag());
    let allow_unchecked = table.or("allow_unchecked", false, |item| item.flag());
    let sd_mm = table.optional("sd_mm", |item| item.number(POSITIVE));
    let objectives = objectives::objectives(table, references, unknowns.as_deref());
    let outer = table.optional("outer", |item| item.table(outer::outer));
    let max_marker_distance_mm = table.or("max_marker_distance_mm", 5.0, |item| item.number(NOT_NEGATIVE));
    let frames = table.or("frames", FramesSpec::default(), |item| item.table(frames));
    let frames_place = table.place_of("frames");
    let chunks = table.or("chunks", ChunksSpec::default(), |item| match item.node.value {
        Value::Table(_) => item.table(chunks),
        _ => item.whole(1, MOST_CHUNKS).map(|count| ChunksSpec { count, ..ChunksSpec::default() }),
    });
    let registration = registration::registration(table, units);
    let tolerance = table.or("tolerance", FitToleranceSpec::Change(1e-6), |item| match item.node.value {
        Value::Table(_) => item
            .table(|table| table.required("sds", "sds = 0.1", |item| item.number(PART)).map(FitToleranceSpec::Sds)),
        _ => item.number(PART).map(FitToleranceSpec::Change),
    });
    let max_iterations = table.or("max_iterations", 50, |item| item.whole(1, 10_000));
    let finite_difference_step = table.or("finite_difference_step", 1e-4, |item| item.number(PART));
    Some(FitSpec {
        markers: markers?,
        units: units?,
        topic: topic?,
        sensitivity: sensitivity?,
        reuse: reuse?.unwrap_or(match unknowns.as_ref()?.len() {
            many if many > FEW_UNKNOWNS => ReuseSpec::Adjoint,
            _ => ReuseSpec::Fresh,
        }),
        unknowns: unknowns?,
        zero_is_missing: zero_is_missing?,
        allow_truncated: allow_truncated?,
        allow_unchecked: allow_unchecked?,
        sd_mm: sd_mm?,
        objectives: objectives?,
        outer: outer?,
        max_marker_distance_mm: max_marker_distance_mm?,
        frames: frames?,
        chunks: chunks?,
        registration: registration?,
        tolerance: tolerance?,
        max_iterations: max_iterations?,
        finite_difference_step: finite_difference_step?,
        place: table.place(),
        markers_place,
        units_place,
        frames_place,
    })
}

fn chunks(table: &mut Table) -> Option<ChunksSpec> {
    let count = table.required("count", "count = 2", |item| item.whole(1, MOST_CHUNKS));
    let overlap = table.or("overlap", ChunksSpec::default().overlap, |item| item.whole(1, MOST_FRAMES));
    Some(ChunksSpec { count: count?, overlap: overlap? })
}

/// `frames`, and `neutral` where it is several.
pub(super) fn frames(table: &mut Table) -> Option<FramesSpec> {
    let first = table.or("first", 0, |item| item.whole(0, MOST_FRAMES));
    let last = table.optional("last", |item| item.whole(0, MOST_FRAMES));
    let step = table.or("step", 1, |item| item.whole(1, MOST_FRAMES));
    let (first, last) = (first?, last?);
    match last {
        Some(last) if last < first => {
            table.contradiction("last", "first", last as f64, &format!("at least first = {first}"))
        }
        _ => Some(FramesSpec { first, last, step: step? }),
    }
}

fn solver(table: &mut Table) -> Option<SolverSpec> {
    let default = SolverSpec::default();
    let tolerance = table.or("tolerance", default.tolerance, |item| item.number(PART));
    let max_iterations = table.or("max_iterations", default.max_iterations, |item| item.whole(1, 10_000));
    let step_max = table.or("step_max", default.step_max, |item| item.number(PART));
    let step_min = table.or("step_min", default.step_min, |item| item.number(PART));
    let precisions = [Precision::Double, Precision::Single].map(|precision| (precision.word(), precision));
    let precision = table.or("precision", default.precision, |item| item.choice(&precisions, &[]));
    let (step_max, step_min) = (step_max?, step_min?);
    if step_min > step_max {
        return table.contradiction("step_min", "step_max", step_min, &format!("at most step_max = {step_max:?}"));
    }
    let (tolerance, max_iterations, precision) = (tolerance?, max_iterations?, precision?);
    Some(SolverSpec { tolerance, max_iterations, step_max, step_min, precision })
}

fn output(table: &mut Table) -> Option<OutputSpec> {
    let default = OutputSpec::default();
    let view = table.or("view", default.view, |item| item.flag());
    let every = table.or("every", default.every, |item| item.whole(1, 1_000_000));
    let estimate = table.or("estimate", default.estimate, |item| item.flag());
    Some(OutputSpec { view: view?, every: every?, estimate: estimate? })
}
