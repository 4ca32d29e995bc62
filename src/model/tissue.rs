//! The tissue term of a scene: its law, and the regions with constants of their own.

use crate::error::{Error, Result};
use crate::material::{Guccione, Law, MooneyRivlin, NeoHookean};
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::{LawSpec, PartSpec, RegionSpec, Scene};
use crate::term::Term;
use crate::term::pressure::PressureSpace;
use crate::term::tissue::Tissue;

/// The tissue of a host and what sets its scales.
pub(super) struct Host {
    pub term: Box<dyn Term>,
    /// mm3.
    pub volume: f64,
    /// Of the law outside the regions, kPa.
    pub shear_modulus: f64,
}

/// # Errors
/// Inverted reference geometry; regions that hold no element, or one that is not there, or one of another region, or
/// that have another law.
pub(super) fn tissue(scene: &Scene, mesh: &Mesh, space: &dyn PressureSpace) -> Result<Host> {
    match scene.tissue.law {
        LawSpec::MooneyRivlin { c1_kpa, c2_kpa } => {
            let law = |c1, c2| MooneyRivlin { c1, c2 };
            of_law(scene, mesh, space, law(c1_kpa, c2_kpa), |other| match *other {
                LawSpec::MooneyRivlin { c1_kpa, c2_kpa } => Some(law(c1_kpa, c2_kpa)),
                _ => None,
            })
        }
        LawSpec::NeoHookean { mu_kpa } => {
            of_law(scene, mesh, space, NeoHookean { mu: mu_kpa }, |other| match *other {
                LawSpec::NeoHookean { mu_kpa } => Some(NeoHookean { mu: mu_kpa }),
                _ => None,
            })
        }
        LawSpec::Guccione { c_kpa, bf, bt, bfs, fibre } => {
            let law = Guccione::new;
            of_law(scene, mesh, space, law(c_kpa, bf, bt, bfs, fibre), |other| match *other {
                LawSpec::Guccione { c_kpa, bf, bt, bfs, fibre } => Some(law(c_kpa, bf, bt, bfs, fibre)),
                _ => None,
            })
        }
    }
}

/// `whole` is the law of the tissue, `same` makes one of the same type, with the constants of a region.
fn of_law<L: Law + 'static>(
    scene: &Scene,
    mesh: &Mesh,
    space: &dyn PressureSpace,
    whole: L,
    same: impl Fn(&LawSpec) -> Option<L>,
) -> Result<Host> {
    let parts = parts(&scene.regions, mesh)?;
    let shear_modulus = whole.shear_modulus();
    let mut tissue = Tissue::new(mesh, whole, scene.tissue.kappa_kpa, space, scene.tissue.gauss).map_err(|at| {
        Error::InvertedMesh { element: at.element, xi: at.xi, det: at.det, place: Box::new(scene.mesh.place.clone()) }
    })?;
    for (elements, region) in parts.iter().zip(&scene.regions) {
        let Some(law) = same(&region.law) else {
            return Err(bad(
                region,
                format!("is {}, the tissue is not", region.law.word()),
                "give it the tissue's law",
            ));
        };
        tissue.set_law(elements, law);
    }
    Ok(Host { volume: tissue.volume(), term: Box::new(tissue), shear_modulus })
}

fn bad(region: &RegionSpec, problem: String, help: &'static str) -> Error {
    let (name, problem) = (region.name.as_str().into(), problem.into());
    Error::BadRegion { region: name, problem, help, place: Box::new(region.place.clone()) }
}

/// The elements of a part of the host.
pub(super) fn elements(part: &PartSpec, mesh: &Mesh) -> Vec<usize> {
    match part {
        PartSpec::Elements(elements) => elements.clone(),
        PartSpec::Box([lower, upper]) => (0..mesh.elements())
            .filter(|element| {
                let centre = mesh.position(MaterialPoint { element: *element, xi: [0.5; 3] });
                (0..3).all(|d| (lower[d]..=upper[d]).contains(&centre[d]))
            })
            .collect(),
    }
}

/// The elements of each region.
fn parts(regions: &[RegionSpec], mesh: &Mesh) -> Result<Vec<Vec<usize>>> {
    let mut mistakes = Vec::new();
    let mut owner: Vec<Option<usize>> = vec![None; mesh.elements()];
    let mut parts = Vec::with_capacity(regions.len());
    for (index, region) in regions.iter().enumerate() {
        let mistake = |problem: String, help: &'static str| bad(region, problem, help);
        let elements = elements(&region.part, mesh);
        if elements.is_empty() {
            let help = "give the lower corner first, and a box that holds the centre of an element";
            mistakes.push(mistake("holds the centre of no element".into(), help));
        }
        for &element in &elements {
            match owner.get_mut(element) {
                None => {
                    let problem = format!("names element {element}, but the host has {}", mesh.elements());
                    mistakes.push(mistake(problem, "elements are counted from 0, x fastest, then y, then z"));
                }
                Some(Some(other)) => {
                    let problem = format!("and region `{}` both hold element {element}", regions[*other].name);
                    mistakes.push(mistake(problem, "give every element to one region at most"));
                    break;
                }
                Some(free) => *free = Some(index),
            }
        }
        parts.push(elements);
    }
    if mistakes.is_empty() { Ok(parts) } else { Err(Error::all(mistakes)) }
}
