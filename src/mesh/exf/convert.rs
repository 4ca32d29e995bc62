//! Tricubic Hermite meshes in x, y, z from fields that are not one: curvilinear, or with a map per component.

use super::coordinates::Coordinates;
use super::geometry::{Geometry, NodalMesh};
use super::jet::Jet;
use super::sums::Key;
use crate::error::{Place, Warning};
use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::continuous::{continuous, size};
use crate::mesh::element::Element;
use crate::mesh::{MaterialPoint, Mesh};
use std::collections::{BTreeMap, HashMap};

/// Points per direction where a mesh is compared with its field.
const SAMPLES: usize = 5;

/// Lengths that differ by less than this part of the body's size are the same.
const SAME: f64 = 1e-9;

/// How far a mesh is from the field that it was converted from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// The largest distance found, at 5 x 5 x 5 points of every element, mm.
    pub difference: f64,
    /// The identifier of the element where it was found.
    pub element: i64,
    /// And where in it.
    pub xi: [f64; 3],
}

impl Geometry {
    /// The warning that the mesh is not everywhere the field of the file; `place` is where the file is named.
    pub fn warning(&self, place: &Place) -> Option<Warning> {
        let Conversion { difference, element, xi: [a, b, c] } = self.conversion?;
        let difference = if difference < 0.001 { format!("{difference:.1e}") } else { format!("{difference:.3}") };
        Some(Warning {
            code: "G025",
            message: format!(
                "field `{}` is no tricubic Hermite in x, y and z: the mesh has its values and derivatives at the corners of \
                 every element and differs from it by up to {difference} mm between them (element {element}, xi {a} {b} \
                 {c})",
                self.field
            ),
            place: Some(place.clone()),
            help: Some("if that is too much, write the file with smaller elements".into()),
        })
    }
}

/// The mesh of a field, the identifier of each of its nodes, and what it lacks.
///
/// The parameters of an element are the values and derivatives of the field at its corners. Where a `nodal` mesh makes the
/// same of the converted nodal parameters, it keeps the field's smoothness across elements. Otherwise elements
/// share what keeps them continuous.
pub(super) fn convert(
    field: &Coordinates,
    nodal: Option<NodalMesh>,
    basis: &'static dyn Element,
    corners: &[[i64; 8]],
) -> (Mesh, Vec<i64>, Option<Conversion>) {
    let per_node = basis.parameters_per_node();
    let locals = (0..corners.len()).map(|element| {
        let hermite = field.hermite(element);
        let mut local = [[0.0; 64]; 3];
        for (local, hermite) in local.iter_mut().zip(hermite) {
            (0..basis.functions()).for_each(|a| local[a] = hermite[8 * (a / per_node) + a % per_node]);
        }
        local
    });
    let locals: Vec<[[f64; 64]; 3]> = locals.collect();
    let tolerance = SAME * size(&locals, per_node);
    let smooth = nodal.and_then(|nodal| on_nodes(field, nodal, &locals, tolerance));
    let (mesh, nodes) = smooth.unwrap_or_else(|| {
        let (corners, nodes) = nodes(corners, &locals, per_node, tolerance);
        (continuous(basis, corners, &locals), nodes)
    });
    let worst = largest_difference(field, &mesh);
    let conversion = worst.filter(|worst| worst.difference > tolerance);
    (mesh, nodes, conversion)
}

/// A nodal mesh with its parameters converted, if it has the parameters `locals` in every element.
///
/// A nodal derivative in x, y, z follows by the chain rule from the derivatives of lower order at the node, those of
/// the same version or else of the first.
fn on_nodes(
    field: &Coordinates,
    nodal: NodalMesh,
    locals: &[[[f64; 64]; 3]],
    tolerance: f64,
) -> Option<(Mesh, Vec<i64>)> {
    let NodalMesh { mut mesh, nodes, keys } = nodal;
    let known: HashMap<Key, Vector> = keys.iter().copied().zip(mesh.parameters.iter().copied()).collect();
    for (&(node, version, label), parameter) in keys.iter().zip(&mut mesh.parameters) {
        let part = |m: u8| known.get(&(node, version, m)).or_else(|| known.get(&(node, 1, m)));
        let jet = |c: usize| Jet(std::array::from_fn(|m| part(m as u8).map_or(0.0, |values| values[c])));
        *parameter = field.cartesian([jet(0), jet(1), jet(2)]).map(|x| x.0[usize::from(label)]);
    }
    // versions of an angle on the axis are one point, so they must not be several nodes
    let mut apart: BTreeMap<i64, Vec<Vector>> = BTreeMap::new();
    for (key, parameter) in keys.iter().zip(&mesh.parameters).filter(|(key, _)| key.2 == 0) {
        let others = apart.entry(key.0).or_default();
        if others.iter().any(|other| norm(subtract(*other, *parameter)) <= tolerance) {
            return None;
        }
        others.push(*parameter);
    }
    let same = locals.iter().enumerate().all(|(element, expected)| {
        let found = mesh.local(element);
        found.as_flattened().iter().zip(expected.as_flattened()).all(|(a, b)| (a - b).abs() <= tolerance)
    });
    same.then_some((mesh, nodes))
}

/// The mesh's node at every corner, and the identifier of each: nodes of one identifier at several places are several.
fn nodes(
    corners: &[[i64; 8]],
    locals: &[[[f64; 64]; 3]],
    per_node: usize,
    tolerance: f64,
) -> (Vec<[usize; 8]>, Vec<i64>) {
    let mut places: BTreeMap<i64, Vec<Vector>> = BTreeMap::new();
    let mut version = Vec::with_capacity(corners.len());
    for (corners, local) in corners.iter().zip(locals) {
        version.push(std::array::from_fn::<usize, 8, _>(|k| {
            let position: Vector = std::array::from_fn(|i| local[i][k * per_node]);
            let known = places.entry(corners[k]).or_default();
            known.iter().position(|other| norm(subtract(*other, position)) <= tolerance).unwrap_or_else(|| {
                known.push(position);
                known.len() - 1
            })
        }));
    }
    let (mut first, mut identifiers) = (BTreeMap::new(), Vec::new());
    for (node, places) in &places {
        first.insert(*node, identifiers.len());
        identifiers.extend(std::iter::repeat_n(*node, places.len()));
    }
    let node =
        |(corners, version): (&[i64; 8], &[usize; 8])| std::array::from_fn(|k| first[&corners[k]] + version[k]);
    (corners.iter().zip(&version).map(node).collect(), identifiers)
}

fn largest_difference(field: &Coordinates, mesh: &Mesh) -> Option<Conversion> {
    let at = |k: usize| k as f64 / (SAMPLES - 1) as f64;
    let points = (0..SAMPLES.pow(3)).map(|k| [at(k % SAMPLES), at(k / SAMPLES % SAMPLES), at(k / SAMPLES / SAMPLES)]);
    let points: Vec<[f64; 3]> = points.collect();
    let all = (0..mesh.elements()).flat_map(|element| {
        points.iter().map(move |xi| {
            let position = mesh.position(MaterialPoint { element, xi: *xi });
            let difference = norm(subtract(position, field.position(element, *xi)));
            Conversion { difference, element: field.elements[element], xi: *xi }
        })
    });
    all.max_by(|a, b| a.difference.total_cmp(&b.difference))
}
