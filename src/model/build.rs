//! From a scene to a model: every table of the problem file becomes a mesh, a term or a support.

use super::supports::{Conflict, Support, Supports, normal_axis};
use super::tissue::{Host, tissue};
use super::{Control, Ingredients, Model};
use crate::error::{Error, MuscleOutside, Place, Result, Warning};
use crate::material::fibre::Blemker;
use crate::math::tensor::{norm, normalised};
use crate::mesh::block::block;
use crate::mesh::element::{TricubicHermite, Trilinear};
use crate::mesh::face::Face;
use crate::mesh::fibre_angles::FibreAngles;
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::{
    ActivationSpec, BlockSpec, ContactLawSpec, ContactSpec, ElementSpec, FaceSpec, FibresSpec, InitialSpec, LoadKind,
    MuscleSpec, PressureSpec, Scene, SupportKind, SurfaceSpec,
};
use crate::term::Term;
use crate::term::contact::law::{Allows, Augmented, Barrier, ContactLaw, Penalty};
use crate::term::contact::surface::{Capsule, Cylinder, FreeSide, Patches, Plane, RigidSurface, Sphere};
use crate::term::contact::{Contact, Interface};
use crate::term::load::{FollowerPressure, body_force, gravity, nodal_force, traction};
use crate::term::muscle::{Activation, Muscle, NotEmbedded};
use crate::term::pressure::{self, PressureSpace};
use crate::term::spring::{Resists, Springs};

/// A model built from a scene, with the places in it that the scene names.
pub struct Built {
    /// The model; its controls are the activations of the muscles of the scene, one after the other.
    pub model: Model,
    /// Where the probes of the scene are, in its order.
    pub probes: Vec<MaterialPoint>,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

/// Quadrature points that a muscle should have along a host element in each direction.
const POINTS_PER_HOST_ELEMENT: f64 = 2.0;

/// Builds the model of a scene.
///
/// # Errors
/// All geometric mistakes of the scene at once, each with its place: inverted elements, muscles or probes outside the
/// host, supports that contradict each other, points of loads outside,
/// regions that are none.
pub fn build(scene: &Scene) -> Result<Built> {
    let mesh = host(scene);
    let space: &'static dyn PressureSpace = match scene.tissue.pressure {
        PressureSpec::Trilinear => &pressure::Trilinear,
        PressureSpec::DiscontinuousTrilinear => &pressure::DiscontinuousTrilinear,
    };
    let gauss = scene.tissue.gauss;
    // nothing else can be placed in a host that is inverted
    let Host { term: tissue, volume, shear_modulus } = tissue(scene, &mesh, space)?;

    let mut mistakes = Vec::new();
    let mut warnings = Vec::new();
    let mut terms: Vec<Box<dyn Term>> = vec![tissue];
    let mut controls = Vec::new();
    let locator = Locator::new(&mesh);
    for spec in &scene.muscles {
        let (activation, names) = match spec.activation {
            ActivationSpec::Uniform => (Activation::Uniform(controls.len()), vec![spec.name.clone()]),
            ActivationSpec::Field => {
                let names = (0..spec.block.nodes()).map(|node| format!("{}[{node}]", spec.name));
                (Activation::Field(controls.len()), names.collect())
            }
        };
        match embed(spec, &locator, activation) {
            Ok(muscle) => {
                warnings.extend(coarse_rule(spec, &scene.mesh.block));
                terms.push(Box::new(muscle));
            }
            Err(error) => mistakes.push(error),
        }
        let sigma_max = spec.blemker.sigma_max_kpa;
        let onset = if sigma_max > 0.0 { (shear_modulus / sigma_max).min(1.0) } else { 1.0 };
        controls.extend(names.into_iter().map(|name| Control { name, lower: 0.0, upper: 1.0, onset }));
    }
    let point = |position: [f64; 3], what: &'static str, place: &Place| {
        locator.locate(position).map_err(|outside| Error::PointOutside {
            what,
            distance: outside.distance,
            nearest: mesh.position(outside.nearest),
            place: Box::new(place.clone()),
        })
    };
    let slidings = scene.slidings.iter().map(|spec| (spec, Allows::Closed));
    for (spec, allows) in slidings.chain(scene.contacts.iter().map(|spec| (spec, Allows::ClosedOrOpen))) {
        match contact(spec, allows, &mesh) {
            Ok((contact, warning)) => {
                terms.push(Box::new(contact));
                warnings.extend(warning);
            }
            Err(error) => mistakes.push(error),
        }
    }
    for load in &scene.loads {
        terms.push(match &load.kind {
            LoadKind::Traction { face, kpa } => Box::new(traction(&mesh, faces(&mesh, face), *kpa, gauss)),
            LoadKind::Gravity { density_kg_m3, acceleration_m_s2 } => {
                Box::new(gravity(&mesh, *density_kg_m3, *acceleration_m_s2, gauss))
            }
            LoadKind::BodyForce { mn_mm3 } => Box::new(body_force(&mesh, *mn_mm3, gauss)),
            LoadKind::Pressure { face, kpa } => {
                Box::new(FollowerPressure::new(&mesh, faces(&mesh, face), *kpa, gauss))
            }
            LoadKind::NodalForce { position_mm, mn } => match point(*position_mm, "the force", &load.place) {
                Ok(at) => Box::new(nodal_force(&mesh, at, *mn)),
                Err(error) => {
                    mistakes.push(error);
                    continue;
                }
            },
            LoadKind::Spring { face, kpa_per_mm, normal_only } => {
                let resists = if *normal_only { Resists::Normal } else { Resists::All };
                Box::new(Springs::foundation(&mesh, faces(&mesh, face), *kpa_per_mm, resists, gauss))
            }
        });
    }
    let mut ties = Vec::new();
    for attachment in &scene.attachments {
        match point(attachment.position_mm, "the attachment", &attachment.place) {
            Ok(at) => ties.push((at, attachment.stiffness_mn_per_mm)),
            Err(error) => mistakes.push(error),
        }
    }
    if !ties.is_empty() {
        terms.push(Box::new(Springs::attachments(&mesh, &ties)));
    }
    let mut probes = Vec::new();
    for probe in &scene.probes {
        match locator.locate(probe.position_mm) {
            Ok(point) => probes.push(point),
            Err(outside) => mistakes.push(Error::ProbeOutside {
                name: probe.name.as_str().into(),
                distance: outside.distance,
                nearest: mesh.position(outside.nearest),
                place: Box::new(probe.place.clone()),
            }),
        }
    }
    drop(locator);
    let supports = match supports(scene, &mesh) {
        Ok(supports) => supports,
        Err(error) => {
            mistakes.push(error);
            Supports::default()
        }
    };
    if !mistakes.is_empty() {
        return Err(Error::all(mistakes));
    }
    let model = Model::new(Ingredients { mesh, space, terms, supports, controls, shear_modulus, volume })?;
    Ok(Built { model, probes, warnings })
}

/// The mesh of the host at rest.
pub fn host(scene: &Scene) -> Mesh {
    let spec = &scene.mesh.block;
    block(&TricubicHermite, spec.origin_mm, spec.size_mm, spec.elements)
}

fn faces<'m>(mesh: &'m Mesh, spec: &FaceSpec) -> &'m [Face] {
    mesh.named_faces.get(&spec.to_string()).map_or(&[], Vec::as_slice)
}

fn embed(spec: &MuscleSpec, locator: &Locator<'_>, activation: Activation) -> Result<Muscle> {
    let ElementSpec::Trilinear = spec.element;
    let mesh = block(&Trilinear, spec.block.origin_mm, spec.block.size_mm, spec.block.elements);
    let angles = match &spec.fibres {
        FibresSpec::Uniform(degrees) => FibreAngles::uniform(&mesh, degrees.map(f64::to_radians)),
        FibresSpec::Nodes(nodes) => {
            FibreAngles { nodes: nodes.iter().map(|degrees| degrees.map(f64::to_radians)).collect() }
        }
    };
    let b = &spec.blemker;
    let law = Blemker {
        sigma_max: b.sigma_max_kpa,
        lambda_star: b.lambda_star,
        lambda_ofl: b.lambda_ofl,
        p1: b.p1,
        p2: b.p2,
    };
    Muscle::new(&spec.name, locator, &mesh, &angles, spec.gauss, law, activation).map_err(|error| match error {
        NotEmbedded::Outside { count, of, element, position, distance } => {
            Error::MuscleOutside(Box::new(MuscleOutside {
                muscle: spec.name.clone(),
                count,
                of,
                element,
                position,
                distance,
                place: spec.place.clone(),
            }))
        }
        NotEmbedded::Inverted { element, det } => Error::InvertedMuscle {
            muscle: spec.name.as_str().into(),
            element,
            det,
            place: Box::new(spec.place.clone()),
        },
    })
}

/// A reference shape that violates a contact by less is taken as rounding, mm.
const START_TOLERANCE: f64 = 1e-6;

fn contact(spec: &ContactSpec, allows: Allows, mesh: &Mesh) -> Result<(Contact, Option<Warning>)> {
    let free = |inside: bool| if inside { FreeSide::Inside } else { FreeSide::Outside };
    let faces = faces(mesh, &spec.face);
    let surface: Box<dyn RigidSurface> = match spec.surface {
        SurfaceSpec::Plane { through_mm, normal } => {
            Box::new(Plane { through: through_mm, normal: normalised(normal) })
        }
        SurfaceSpec::Sphere { centre_mm, radius_mm, inside } => {
            Box::new(Sphere { centre: centre_mm, radius: radius_mm, free: free(inside) })
        }
        SurfaceSpec::Cylinder { through_mm, axis, radius_mm, inside } => {
            Box::new(Cylinder { through: through_mm, axis: normalised(axis), radius: radius_mm, free: free(inside) })
        }
        SurfaceSpec::Capsule { from_mm, to_mm, radius_mm, inside } => {
            Box::new(Capsule { ends: [from_mm, to_mm], radius: radius_mm, free: free(inside) })
        }
        SurfaceSpec::Reference => Box::new(Patches::new(mesh, faces, FreeSide::Inside)),
    };
    let law: Box<dyn ContactLaw> = match spec.law {
        ContactLawSpec::Penalty { kpa_per_mm } => Box::new(Penalty { stiffness: kpa_per_mm }),
        ContactLawSpec::Augmented { kpa_per_mm, gap_mm } => {
            Box::new(Augmented { stiffness: kpa_per_mm, tolerance: gap_mm })
        }
        ContactLawSpec::Barrier { kpa_per_mm, range_mm } => {
            Box::new(Barrier { stiffness: kpa_per_mm, range: range_mm })
        }
    };
    let relax = spec.initial == InitialSpec::Relax;
    let contact = Contact::new(&spec.name, Interface { allows, surface, law, relax }, mesh, faces, spec.gauss);
    let Some((at, position, gap)) = contact.worst_start(mesh) else { return Ok((contact, None)) };
    let barrier = matches!(spec.law, ContactLawSpec::Barrier { .. });
    let wrong = match allows {
        Allows::Closed => gap.abs() > START_TOLERANCE,
        Allows::ClosedOrOpen => gap < -START_TOLERANCE || (barrier && contact.smallest_start() <= 0.0),
    };
    if !wrong {
        return Ok((contact, None));
    }
    if !relax {
        let (name, place) = (spec.name.as_str().into(), Box::new(spec.place.clone()));
        return Err(Error::StartsInContact { name, gap, position, element: at.element, place });
    }
    let warning = Warning {
        code: "G008",
        message: format!(
            "`{}`: the reference shape has a gap of {gap:.3} mm at ({:.2}, {:.2}, {:.2}) mm, which is relaxed along \
             the load path",
            spec.name, position[0], position[1], position[2]
        ),
        place: Some(spec.place.clone()),
        help: None,
    };
    Ok((contact, Some(warning)))
}

/// Warns where a muscle has so few quadrature points for the host's elements that the answer depends on where they fall.
fn coarse_rule(spec: &MuscleSpec, host: &BlockSpec) -> Option<Warning> {
    let points = |gauss: usize, d: usize| {
        let host_element = host.size_mm[d] / host.elements[d] as f64;
        let muscle_element = spec.block.size_mm[d] / spec.block.elements[d] as f64;
        gauss as f64 * host_element / muscle_element
    };
    let fewest = (0..3).map(|d| points(spec.gauss, d)).fold(f64::INFINITY, f64::min);
    if fewest >= POINTS_PER_HOST_ELEMENT {
        return None;
    }
    let enough = (0..3).map(|d| (POINTS_PER_HOST_ELEMENT / points(1, d)).ceil()).fold(1.0, f64::max);
    Some(Warning {
        code: "G007",
        message: format!(
            "muscle `{}` has only {fewest:.1} quadrature points along a host element: its force depends on where they fall",
            spec.name
        ),
        place: Some(spec.place.clone()),
        help: Some(format!("use gauss = {enough:.0} for this muscle, or more elements in its block")),
    })
}

fn supports(scene: &Scene, mesh: &Mesh) -> Result<Supports> {
    let plane = |face: &FaceSpec, place: &Place| {
        normal_axis(mesh, faces(mesh, face))
            .ok_or_else(|| Error::NotNormalToAxis { face: face.to_string().into(), place: Box::new(place.clone()) })
    };
    let mut all = Vec::new();
    for spec in &scene.supports {
        all.push(match &spec.kind {
            SupportKind::Clamp { face } => Support::Clamp { faces: faces(mesh, face).to_vec() },
            SupportKind::Symmetry { face } => {
                Support::Symmetry { faces: faces(mesh, face).to_vec(), axis: plane(face, &spec.place)? }
            }
            SupportKind::Plate { face, offset_mm } => Support::Plate {
                faces: faces(mesh, face).to_vec(),
                axis: plane(face, &spec.place)?,
                offset: *offset_mm,
            },
            SupportKind::Rotate { face, axis, through_mm, angle_deg } => {
                debug_assert!(norm(*axis) > 0.0, "checked by the scene");
                Support::Rotate {
                    faces: faces(mesh, face).to_vec(),
                    axis: normalised(*axis),
                    through: *through_mm,
                    angle: angle_deg.to_radians(),
                }
            }
        });
    }
    Supports::new(mesh, all).map_err(|Conflict { supports: (first, second), node }| {
        let place = |index: usize| -> Box<Place> { Box::new(scene.supports[index].place.clone()) };
        let parameter = mesh.parameter_node.iter().position(|n| *n == node).unwrap_or(0);
        Error::SupportsDisagree {
            node,
            position: mesh.parameters[parameter],
            other: place(first),
            place: place(second),
        }
    })
}
