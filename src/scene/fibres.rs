//! `[task] kind = "fibres"`: fibre angles fitted to measured directions.

use super::cursor::{FINITE, Item, Mistakes, NOT_NEGATIVE, POSITIVE, Reader, Table};
use super::interpret::{mesh, muscle};
use super::references::References;
use super::spec::{MeshSpec, MuscleSpec};
use super::tree::{Node, Value};
use super::units::Units;
use crate::error::{Error, Place};
use serde::Serialize;
use std::path::PathBuf;

/// A fit of fibre angles as its file has it.
#[derive(Debug, Clone, Serialize)]
pub struct FibreProblem {
    /// What it is called: the key `name`, or else the name of its folder or file.
    pub name: String,
    /// The mesh whose angles are sought.
    pub body: FibreBody,
    /// Which angles are sought; the others are 0.
    pub angles: AnglesSpec,
    /// How they are interpolated.
    pub field: FieldSpec,
    /// The measurements, at least one file.
    pub data: Vec<FibreDataSpec>,
    /// What becomes of points outside the mesh.
    pub outside: OutsideSpec,
    /// The weight of the smoothness.
    pub smoothness: SmoothnessSpec,
    /// How an angular error counts.
    pub loss: LossSpec,
    /// Parts of the data that are held out in turn; 0 for none.
    pub folds: usize,
    /// Nodes whose angles are known.
    pub fixed: Vec<FixedNodeSpec>,
    /// The table `[fibres]` in the file.
    #[serde(skip)]
    pub place: Place,
}

/// The mesh whose angles are sought.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FibreBody {
    /// `[mesh]`.
    Mesh(MeshSpec),
    /// A `[[muscle]]`.
    Muscle {
        /// That which `[fibres] muscle` names; its own angles are not used.
        muscle: Box<MuscleSpec>,
        /// `[mesh]`, where the file has it: a muscle of the face is made in it.
        host: Option<MeshSpec>,
    },
}

/// Which angles are sought: `[fibres] angles`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum AnglesSpec {
    /// `["A"]`: fibres in the surfaces xi3 = const.
    A,
    /// `["A", "B"]`.
    AB,
    /// `["A", "B", "G"]`: sheets too.
    ABG,
}

/// How angles are interpolated: `[fibres] field`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FieldSpec {
    /// Between values at the nodes.
    Trilinear,
    /// By values and derivatives at the nodes: C1.
    Tricubic,
}

/// A file of measurements: `[[fibres.data]]`.
#[derive(Debug, Clone, Serialize)]
pub struct FibreDataSpec {
    /// The file: `.csv`, `.vtk`, `.vtu`, `.vtp` or `.exf`.
    pub file: PathBuf,
    /// The unit of its positions.
    pub units: Units,
    /// The field of directions or of diffusion tensors, in the formats that name fields; by default the only one.
    pub field: Option<String>,
    /// A factor to all weights of the file.
    pub weight: f64,
    /// The key `file`.
    #[serde(skip)]
    pub place: Place,
}

/// What becomes of a point outside the mesh: `[fibres] outside`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutsideSpec {
    /// It is not used.
    Drop,
    /// It is used at the nearest point of the mesh if that is at most so far, mm.
    ProjectMm(f64),
}

/// The weight of the smoothness in relation to the data: `[fibres] smoothness`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SmoothnessSpec {
    /// By generalised cross-validation.
    Gcv,
    /// Given, without a unit: the weight of the squared change of an angle from end to end of an element against the
    /// squared errors of all data of one element.
    Weight(f64),
}

/// How an angular error counts: `[fibres] loss`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LossSpec {
    /// By its square.
    Quadratic,
    /// By its square up to so many degrees, then linearly.
    HuberDeg(f64),
    /// By the logarithm of 1 + its square over that of so many degrees.
    CauchyDeg(f64),
}

/// A node whose angles are known: `[[fibres.fixed]]`.
#[derive(Debug, Clone, Serialize)]
pub struct FixedNodeSpec {
    /// Its number: from 0 in a block, x fastest; in an EX file the identifier there.
    pub node: i64,
    /// Its angles A, B, G, degrees.
    pub angles_deg: [f64; 3],
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

impl FieldSpec {
    /// All, with the word of each.
    pub const ALL: [(&str, FieldSpec); 2] = [("trilinear", FieldSpec::Trilinear), ("tricubic", FieldSpec::Tricubic)];

    /// Its word.
    pub fn word(self) -> &'static str {
        match self {
            FieldSpec::Trilinear => "trilinear",
            FieldSpec::Tricubic => "tricubic",
        }
    }
}

impl AnglesSpec {
    /// All, with the letters of each.
    pub const ALL: [(AnglesSpec, &str); 3] = [(AnglesSpec::A, "A"), (AnglesSpec::AB, "AB"), (AnglesSpec::ABG, "ABG")];

    /// How many angles: A, then B, then G.
    pub fn count(self) -> usize {
        match self {
            AnglesSpec::A => 1,
            AnglesSpec::AB => 2,
            AnglesSpec::ABG => 3,
        }
    }
}

/// The value of a key of a table.
fn entry<'n>(node: &'n Node, key: &str) -> Option<&'n Node> {
    Some(&node.entries()?.iter().find(|entry| entry.key == key)?.node)
}

/// Whether a tree is a fit of fibres.
pub(super) fn is_fibres(root: &Node) -> bool {
    let kind = entry(root, "task").and_then(|task| entry(task, "kind"));
    kind.is_some_and(|kind| matches!(&kind.value, Value::Text(kind) if kind == "fibres"))
}

/// The muscle that `[fibres]` names, and where.
fn muscle_of(root: &Node) -> Option<(String, Place)> {
    let node = entry(entry(root, "fibres")?, "muscle")?;
    match &node.value {
        Value::Text(name) => Some((name.clone(), node.place.clone())),
        _ => None,
    }
}

/// Reads a fit of fibres.
pub(super) fn fibres(
    root: &Node,
    default_name: &str,
    references: &References,
    mistakes: &Mistakes,
) -> Option<FibreProblem> {
    Item { node: root, path: String::new(), mistakes }.table(|file| {
        let name = file.or("name", default_name.to_owned(), |item| item.name());
        file.required("task", "[task]\nkind = \"fibres\"", |item| {
            item.table(|task| task.required("kind", "kind = \"fibres\"", |item| item.text().map(drop)))
        });
        let example = "[fibres]\n[[fibres.data]]\nfile = \"axes.csv\"\nunits = \"mm\"";
        let settings = file.required("fibres", example, |item| item.table(|table| settings(table, references)));
        // as it stands in the file, even where the rest of its table is mistaken
        let wanted = muscle_of(root);
        let mesh_example = "[mesh]\nblock = { origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }";
        let read = |item: Item| item.table(|table| mesh(table, references));
        let host = match &wanted {
            // only a muscle of the face needs its host to be fitted
            Some(_) => file.optional("mesh", read).flatten(),
            None => file.required("mesh", mesh_example, read),
        };
        let muscles = file.tables("muscle", |table| muscle(table, references, host.as_ref()));
        let body = match wanted {
            Some((name, place)) => {
                named(muscles?, name, place, mistakes).map(|muscle| FibreBody::Muscle { muscle, host })
            }
            None => host.map(FibreBody::Mesh),
        };
        let Settings { angles, field, data, outside, smoothness, loss, folds, fixed, place } = settings?;
        let (name, body) = (name?, body?);
        Some(FibreProblem { name, body, angles, field, data, outside, smoothness, loss, folds, fixed, place })
    })
}

fn named(muscles: Vec<MuscleSpec>, name: String, place: Place, mistakes: &Mistakes) -> Option<Box<MuscleSpec>> {
    let known: Vec<String> = muscles.iter().map(|muscle| muscle.name.clone()).collect();
    let found = muscles.into_iter().find(|muscle| muscle.name == name);
    if found.is_none() {
        let help = super::references::help_for_name(&name, &known, "muscles");
        mistakes.add(Error::UnknownName { kind: "muscle", name, help, place });
    }
    found.map(Box::new)
}

/// What the table `[fibres]` says besides the muscle.
struct Settings {
    angles: AnglesSpec,
    field: FieldSpec,
    data: Vec<FibreDataSpec>,
    outside: OutsideSpec,
    smoothness: SmoothnessSpec,
    loss: LossSpec,
    folds: usize,
    fixed: Vec<FixedNodeSpec>,
    place: Place,
}

/// The table `[fibres]`.
fn settings(table: &mut Table, references: &References) -> Option<Settings> {
    let muscle = table.optional("muscle", |item| item.name());
    let angles = table.or("angles", AnglesSpec::AB, |item| {
        let words = [("A", "A"), ("B", "B"), ("G", "G")];
        let letters = item.list("a list of angles", |entry| entry.choice(&words, &[]))?.concat();
        let found = AnglesSpec::ALL.iter().find(|(_, all)| *all == letters);
        let allowed = "[\"A\"], [\"A\", \"B\"] or [\"A\", \"B\", \"G\"]";
        found.map(|(spec, _)| *spec).or_else(|| item.out_of_range(&format!("{letters:?}"), allowed))
    });
    let field = table.or("field", FieldSpec::Trilinear, |item| item.choice(&FieldSpec::ALL, &[]));
    let data = table.tables("data", |table| data(table, references));
    table.must_hold("data", "[[fibres.data]]\nfile = \"axes.csv\"\nunits = \"mm\"");
    let outside = table.or("outside", OutsideSpec::Drop, |item| match item.node.value {
        Value::Text(_) => item.choice(&[("drop", OutsideSpec::Drop)], &[]),
        _ => item.table(|table| {
            let limit =
                table.required("project_mm", "outside = { project_mm = 1 }", |item| item.number(NOT_NEGATIVE));
            limit.map(OutsideSpec::ProjectMm)
        }),
    });
    let smoothness = table.or("smoothness", SmoothnessSpec::Gcv, |item| match item.node.value {
        Value::Text(_) => item.choice(&[("gcv", SmoothnessSpec::Gcv)], &[]),
        _ => item.number(POSITIVE).map(SmoothnessSpec::Weight),
    });
    let loss = table.or("loss", LossSpec::Quadratic, |item| match item.node.value {
        Value::Text(_) => item.choice(&[("quadratic", LossSpec::Quadratic)], &[]),
        _ => item.table(|table| {
            let huber: Reader<LossSpec> = |item| item.number(POSITIVE).map(LossSpec::HuberDeg);
            table.one_of(&[
                ("huber_deg", huber),
                ("cauchy_deg", |item| item.number(POSITIVE).map(LossSpec::CauchyDeg)),
            ])
        }),
    });
    let folds = table.or("folds", 5, |item| match item.whole(0, 100)? {
        1 => item.out_of_range("1", "0, or from 2 to 100"),
        folds => Some(folds),
    });
    let fixed = table.tables("fixed", |table| {
        let node = table.required("node", "node = 0", |item| item.whole(0, 1_000_000_000));
        let angles_deg = table.required("angles_deg", "angles_deg = [36, 0, 0]", |item| item.numbers(FINITE));
        Some(FixedNodeSpec { node: node? as i64, angles_deg: angles_deg?, place: table.place() })
    });
    let settings = Settings {
        angles: angles?,
        field: field?,
        data: data?,
        outside: outside?,
        smoothness: smoothness?,
        loss: loss?,
        folds: folds?,
        fixed: fixed?,
        place: table.place(),
    };
    muscle.map(|_| settings)
}

fn data(table: &mut Table, references: &References) -> Option<FibreDataSpec> {
    let file = table.required("file", "file = \"axes.csv\"", |item| {
        let path = references.file(&item)?;
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("csv" | "vtk" | "vtu" | "vtp" | "exf") => Some(path),
            _ => item
                .out_of_range(&format!("{:?}", path.display().to_string()), "a .csv, .vtk, .vtu, .vtp or .exf file"),
        }
    });
    let place = table.place_of("file");
    let units = Units::ALL.map(|units| (units.name(), units));
    let units = table.required("units", "units = \"mm\"", |item| item.choice(&units, &[]));
    let field = table.optional("field", |item| item.name());
    let weight = table.or("weight", 1.0, |item| item.number(POSITIVE));
    Some(FibreDataSpec { file: file?, units: units?, field: field?, weight: weight?, place })
}
