//! `[[sliding]]` and `[[contact]]`: a face, what it meets, and the law between them.

use super::cursor::{FINITE, Item, POSITIVE, Reader, Table};
use super::interpret::{direction, face, faces};
use super::spec::*;
use super::tree::Value;

type Contacts = Option<Vec<ContactSpec>>;

/// All slidings and all contacts of a file.
pub(super) fn both(file: &mut Table) -> (Contacts, Contacts) {
    let slidings = numbered(file, "sliding", &[("penalty", penalty), ("augmented", augmented)]);
    let contacts = numbered(
        file,
        "contact",
        &[("penalty", penalty), ("smooth", smooth), ("augmented", augmented), ("barrier", barrier)],
    );
    (slidings, contacts)
}

type LawReader<'a> = (&'static str, Reader<'a, ContactLawSpec>);

/// The tables `[[kind]]` of contacts; one without a name is called by its kind and number.
fn numbered<'a>(file: &mut Table<'a>, kind: &'static str, laws: &[LawReader<'a>]) -> Option<Vec<ContactSpec>> {
    let mut number = 0;
    file.tables(kind, |table| {
        number += 1;
        contact(table, kind, &format!("{kind}-{number}"), laws)
    })
}

fn contact<'a>(table: &mut Table<'a>, kind: &str, default_name: &str, laws: &[LawReader<'a>]) -> Option<ContactSpec> {
    let name = table.or("name", default_name.to_owned(), |item| item.name());
    let face = face(table);
    let surface =
        table.required("surface", "surface = { plane = { through_mm = [0, 0, 0], normal = [0, 0, 1] } }", |item| {
            match item.table(surface)? {
                SurfaceSpec::Faces { .. } | SurfaceSpec::Itself { .. } if kind == "sliding" => {
                    item.out_of_range("a face that yields", "a rigid surface for sliding; [[contact]] can meet faces")
                }
                surface => Some(surface),
            }
        });
    let bone = table.optional("bone", |item| match surface {
        Some(SurfaceSpec::Faces { .. } | SurfaceSpec::Itself { .. }) => item.out_of_range(
            "a bone",
            "left out: faces move with the body; clamp them to the bone if they belong to it",
        ),
        _ => item.name(),
    });
    let law = table
        .required("law", "law = { penalty = { kpa_per_mm = 10 } }", |item| item.table(|table| table.one_of(laws)));
    let initials = [("refuse", InitialSpec::Refuse), ("relax", InitialSpec::Relax)];
    let initial = table.or("initial", InitialSpec::Refuse, |item| match item.choice(&initials, &[])? {
        InitialSpec::Relax if matches!(law, Some(ContactLawSpec::Barrier { .. })) => {
            item.out_of_range("\"relax\"", "\"refuse\" with a barrier, behind which nothing can start")
        }
        initial => Some(initial),
    });
    let gauss = table.or("gauss", 5, |item| item.whole(2, 12));
    Some(ContactSpec {
        name: name?,
        face: face?,
        surface: surface?,
        bone: bone?,
        law: law?,
        initial: initial?,
        gauss: gauss?,
        place: table.place(),
    })
}

fn surface(table: &mut Table) -> Option<SurfaceSpec> {
    let reference: Reader<SurfaceSpec> = |item| match item.node.value {
        Value::Flag(true) => Some(SurfaceSpec::Reference(None)),
        Value::Flag(false) => item.out_of_range("false", "true, faces, or another surface"),
        _ => faces(item).map(|face| SurfaceSpec::Reference(Some(face))),
    };
    table.one_of(&[
        ("plane", |item| item.table(plane)),
        ("sphere", |item| item.table(sphere)),
        ("cylinder", |item| item.table(cylinder)),
        ("capsule", |item| item.table(capsule)),
        ("reference", reference),
        ("arch", |item| faces(item).map(SurfaceSpec::Arch)),
        ("faces", |item| item.table(other_faces)),
        ("itself", |item| item.table(|table| Some(SurfaceSpec::Itself { depth_mm: depth(table)? }))),
    ])
}

fn other_faces(table: &mut Table) -> Option<SurfaceSpec> {
    let face = table.required("face", "face = \"lower:xi3=1\"", faces);
    let depth_mm = depth(table);
    Some(SurfaceSpec::Faces { face: face?, depth_mm: depth_mm? })
}

fn depth(table: &mut Table) -> Option<Option<f64>> {
    table.optional("depth_mm", |item| item.number(POSITIVE))
}

fn plane(table: &mut Table) -> Option<SurfaceSpec> {
    let through_mm = table.required("through_mm", "through_mm = [0, 0, 0]", |item| item.numbers(FINITE));
    let normal = table.required("normal", "normal = [0, 0, 1]", direction);
    Some(SurfaceSpec::Plane { through_mm: through_mm?, normal: normal? })
}

fn sphere(table: &mut Table) -> Option<SurfaceSpec> {
    let centre_mm = table.required("centre_mm", "centre_mm = [0, 0, 0]", |item| item.numbers(FINITE));
    let (radius_mm, inside) = round(table);
    Some(SurfaceSpec::Sphere { centre_mm: centre_mm?, radius_mm: radius_mm?, inside: inside? })
}

fn cylinder(table: &mut Table) -> Option<SurfaceSpec> {
    let through_mm = table.required("through_mm", "through_mm = [0, 0, 0]", |item| item.numbers(FINITE));
    let axis = table.required("axis", "axis = [1, 0, 0]", direction);
    let (radius_mm, inside) = round(table);
    Some(SurfaceSpec::Cylinder { through_mm: through_mm?, axis: axis?, radius_mm: radius_mm?, inside: inside? })
}

fn capsule(table: &mut Table) -> Option<SurfaceSpec> {
    let from_mm = table.required("from_mm", "from_mm = [0, 0, 0]", |item| item.numbers(FINITE));
    let to_mm = table.required("to_mm", "to_mm = [10, 0, 0]", |item| match item.numbers(FINITE)? {
        to if Some(to) == from_mm => item.out_of_range(&format!("{to:?}"), "another point than from_mm"),
        to => Some(to),
    });
    let (radius_mm, inside) = round(table);
    Some(SurfaceSpec::Capsule { from_mm: from_mm?, to_mm: to_mm?, radius_mm: radius_mm?, inside: inside? })
}

/// What all round surfaces have.
fn round(table: &mut Table) -> (Option<f64>, Option<bool>) {
    let radius_mm = table.required("radius_mm", "radius_mm = 20", |item| item.number(POSITIVE));
    (radius_mm, table.or("inside", false, |item| item.flag()))
}

fn stiffness(table: &mut Table) -> Option<f64> {
    table.required("kpa_per_mm", "kpa_per_mm = 10", |item| item.number(POSITIVE))
}

fn penalty(item: Item) -> Option<ContactLawSpec> {
    item.table(|table| Some(ContactLawSpec::Penalty { kpa_per_mm: stiffness(table)? }))
}

fn augmented(item: Item) -> Option<ContactLawSpec> {
    item.table(|table| {
        let kpa_per_mm = stiffness(table);
        let gap_mm = table.required("gap_mm", "gap_mm = 1e-3", |item| item.number(POSITIVE));
        Some(ContactLawSpec::Augmented { kpa_per_mm: kpa_per_mm?, gap_mm: gap_mm? })
    })
}

fn smooth(item: Item) -> Option<ContactLawSpec> {
    let (kpa_per_mm, range_mm) = item.table(ranged)?;
    Some(ContactLawSpec::Smooth { kpa_per_mm, range_mm })
}

fn barrier(item: Item) -> Option<ContactLawSpec> {
    let (kpa_per_mm, range_mm) = item.table(ranged)?;
    Some(ContactLawSpec::Barrier { kpa_per_mm, range_mm })
}

/// Stiffness and range of a law.
fn ranged(table: &mut Table) -> Option<(f64, f64)> {
    let kpa_per_mm = stiffness(table);
    let range_mm = table.required("range_mm", "range_mm = 0.1", |item| item.number(POSITIVE));
    Some((kpa_per_mm?, range_mm?))
}
