//! From a scene to a model: every table of the problem file becomes a mesh, a term or a support.

use super::bones::{attachments, bone, bones};
use super::fibre_turn::turned;
use super::supports::{Conflict, Support, Supports, normal_axis};
use super::tissue::{Host, tissue};
use super::{Control, Ingredients, Model};
use crate::error::{Error, MuscleOutside, Place, Result, Warning};
use crate::material::fibre::Blemker;
use crate::math::tensor::{determinant, norm, normalised};
use crate::mesh::block::block;
use crate::mesh::element::{Element, TricubicHermite, Trilinear};
use crate::mesh::exf::{ExFile, Geometry};
use crate::mesh::face::{Face, boundary_faces};
use crate::mesh::facial;
use crate::mesh::fibre_angles::FibreAngles;
use crate::mesh::join::join;
use crate::mesh::location::{Locator, Outside};
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::{
    ActivationSpec, BlockSpec, ContactLawSpec, ContactSpec, ControlValue, ElementSpec, FaceMeshSpec, FaceMuscleSpec,
    FaceName, FaceSpec, FibresSpec, GeometrySpec, InitialSpec, LoadKind, MeshSpec, MuscleSpec, NamedBlockSpec,
    PressureSpec, Scene, SupportKind, SurfaceSpec,
};
use crate::term::Term;
use crate::term::bone::Bone;
use crate::term::contact::law::{Allows, Augmented, Barrier, ContactLaw, Penalty, Smooth};
use crate::term::contact::mutual::{Between, Manner, Mutual};
use crate::term::contact::surface::{Arch, Capsule, Cylinder, FreeSide, Patches, Plane, RigidSurface, Sphere};
use crate::term::contact::{Contact, Interface};
use crate::term::load::{FollowerPressure, body_force, gravity, nodal_force, traction};
use crate::term::muscle::{Activation, Muscle, NotEmbedded};
use crate::term::muscle_rule::MuscleRule;
use crate::term::pressure::{self, PressureSpace};
use crate::term::spring::{Resists, Springs};
use std::sync::Arc;

/// A model built from a scene, with the places in it that the scene names.
pub struct Built {
    /// The model; its controls are the activations of the muscles of the scene, one after the other, then the hinge and the
    /// slide of every bone.
    pub model: Model,
    /// Where the probes of the scene are, in its order.
    pub probes: Vec<MaterialPoint>,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

/// Quadrature points that a muscle should have along a host element in each direction.
const POINTS_PER_HOST_ELEMENT: f64 = 2.0;
/// Coordinates that are typed, or copied from a message, are rounded: a point that is no farther than this outside, mm, is on the
/// surface.
const ROUNDED: f64 = 1e-3;

/// Builds the model of a scene.
///
/// # Errors
/// All geometric mistakes of the scene at once, each with its place: inverted elements, muscles or probes outside the
/// host, supports that contradict each other, points of loads outside,
/// regions that are none.
pub fn build(scene: &Scene) -> Result<Built> {
    let (mesh, warning) = host_with_warning(&scene.mesh)?;
    let space: &'static dyn PressureSpace = match scene.tissue.pressure {
        PressureSpec::Trilinear => &pressure::Trilinear,
        PressureSpec::DiscontinuousTrilinear => &pressure::DiscontinuousTrilinear,
    };
    let gauss = scene.tissue.gauss;
    // nothing else can be placed in a host that is inverted
    let Host { term: tissue, volume, shear_modulus } = tissue(scene, &mesh, space)?;

    let mut mistakes = Vec::new();
    let mut warnings: Vec<Warning> = warning.into_iter().collect();
    let mut terms: Vec<Box<dyn Term>> = vec![tissue];
    let mut controls = Vec::new();
    let locator = Locator::new(&mesh);
    for spec in &scene.muscles {
        let names = match embed(scene, spec, &locator, controls.len()) {
            Ok((muscle, names, warning)) => {
                warnings.extend(warning);
                let host_element = volume / mesh.elements() as f64;
                warnings.extend(coarse_rule(spec, &scene.mesh.geometry, &muscle, host_element));
                terms.push(Box::new(muscle));
                names
            }
            Err(error) => {
                mistakes.push(error);
                Vec::new()
            }
        };
        let sigma_max = spec.blemker.sigma_max_kpa;
        let onset = if sigma_max > 0.0 { (shear_modulus / sigma_max).min(1.0) } else { 1.0 };
        controls.extend(names.into_iter().map(|name| Control { name, lower: 0.0, upper: 1.0, onset }));
    }
    let bones = bones(scene, &mut controls);
    let point = |position: [f64; 3], what: &'static str, place: &Place| {
        material_point(&locator, position).map_err(|outside| Error::PointOutside {
            what,
            distance: outside.distance,
            nearest: mesh.position(outside.nearest),
            place: Box::new(place.clone()),
        })
    };
    let slidings = scene.slidings.iter().map(|spec| (spec, Allows::Closed));
    for (spec, allows) in slidings.chain(scene.contacts.iter().map(|spec| (spec, Allows::ClosedOrOpen))) {
        match contact(scene, spec, allows, &mesh, bone(&bones, &spec.bone)) {
            Ok((contact, warning)) => {
                terms.push(contact);
                warnings.extend(warning);
            }
            Err(error) => mistakes.push(error),
        }
    }
    for load in &scene.loads {
        match &load.kind {
            LoadKind::Traction { face, kpa } => match faces(scene, &mesh, face, &load.place) {
                Ok(faces) => terms.push(Box::new(traction(&mesh, &faces, *kpa, gauss))),
                Err(error) => mistakes.push(error),
            },
            LoadKind::Gravity { density_kg_m3, acceleration_m_s2 } => {
                terms.push(Box::new(gravity(&mesh, *density_kg_m3, *acceleration_m_s2, gauss)));
            }
            LoadKind::BodyForce { mn_mm3 } => terms.push(Box::new(body_force(&mesh, *mn_mm3, gauss))),
            LoadKind::Pressure { face, kpa } => match faces(scene, &mesh, face, &load.place) {
                Ok(faces) => terms.push(Box::new(FollowerPressure::new(&mesh, &faces, *kpa, gauss))),
                Err(error) => mistakes.push(error),
            },
            LoadKind::NodalForce { position_mm, mn } => match point(*position_mm, "the force", &load.place) {
                Ok(at) => terms.push(Box::new(nodal_force(&mesh, at, *mn))),
                Err(error) => mistakes.push(error),
            },
            LoadKind::Spring { face, kpa_per_mm, normal_only } => match faces(scene, &mesh, face, &load.place) {
                Ok(faces) => {
                    let resists = if *normal_only { Resists::Normal } else { Resists::All };
                    terms.push(Box::new(Springs::foundation(&mesh, &faces, *kpa_per_mm, resists, gauss)));
                }
                Err(error) => mistakes.push(error),
            },
        }
    }
    let mut tied = Vec::new();
    for attachment in &scene.attachments {
        match point(attachment.position_mm, "the attachment", &attachment.place) {
            Ok(at) => tied.push((attachment, at)),
            Err(error) => mistakes.push(error),
        }
    }
    let element_size = (volume / mesh.elements() as f64).cbrt();
    terms.extend(attachments(&mesh, &bones, &tied, element_size, shear_modulus, scene.solver.tolerance));
    let mut probes = Vec::new();
    for probe in &scene.probes {
        match material_point(&locator, probe.position_mm) {
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
    let supports = match supports(scene, &mesh, &bones) {
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
///
/// # Errors
/// An EX file that cannot be read, or that holds no tricubic Hermite mesh.
pub fn host(spec: &MeshSpec) -> Result<Mesh> {
    host_with_warning(spec).map(|(mesh, _)| mesh)
}

/// The same, and the warning where the file holds something that the mesh can only come close to.
fn host_with_warning(spec: &MeshSpec) -> Result<(Mesh, Option<Warning>)> {
    match &spec.geometry {
        GeometrySpec::Block(spec) => Ok((block(&TricubicHermite, spec.origin_mm, spec.size_mm, spec.elements), None)),
        GeometrySpec::Blocks(all) => Ok((blocks(&TricubicHermite, all), None)),
        GeometrySpec::Exf(exf) => {
            let geometry = ExFile::read(&exf.path)?.geometry(exf.field.as_deref())?;
            let warning = geometry.warning(&spec.place);
            let Geometry { mesh, field, .. } = geometry;
            if mesh.element.parameters_per_node() == 8 {
                return Ok((mesh, warning));
            }
            Err(Error::HostNotHermite { field: field.into(), place: Box::new(spec.place.clone()) })
        }
        GeometrySpec::Face(FaceMeshSpec { layers, halved, half, face, landmarks: _ }) => {
            let options = facial::Options { layers: *layers, halved: *halved, half: *half };
            Ok((facial::host(&face.sheet, options), None))
        }
        GeometrySpec::FaceMuscle(_) => unreachable!("no host is read as a muscle"),
    }
}

/// Several boxes as one mesh.
fn blocks(element: &'static dyn Element, all: &[NamedBlockSpec]) -> Mesh {
    let part = |NamedBlockSpec { name, block: spec }: &'_ NamedBlockSpec| {
        (name.clone(), block(element, spec.origin_mm, spec.size_mm, spec.elements))
    };
    let parts: Vec<(String, Mesh)> = all.iter().map(part).collect();
    join(&parts)
}

/// The faces with any of the names, each once, in order.
fn faces(scene: &Scene, mesh: &Mesh, FaceSpec(names): &FaceSpec, place: &Place) -> Result<Vec<Face>> {
    let mut all = Vec::new();
    for name in names {
        let named = match name {
            FaceName::Boundary => boundary_faces(mesh),
            name => mesh.named_faces.get(&name.to_string()).cloned().unwrap_or_default(),
        };
        if named.is_empty() {
            let named = match scene.mesh.geometry {
                GeometrySpec::Block(_) => "the faces of a block are xi1=0 to xi3=1, and boundary for all of them",
                GeometrySpec::Blocks(_) => {
                    "the faces of a block with the name lip are lip:xi1=0 to lip:xi3=1; xi1=0 are those of all blocks, and \
                     boundary is the whole surface"
                }
                GeometrySpec::Exf(_) => {
                    "boundary is all of it, 7:xi1=0 a single face of element 7, xi1=0 all faces on that side of their \
                     element; faces between two elements are not on the boundary"
                }
                GeometrySpec::Face(_) | GeometrySpec::FaceMuscle(_) => {
                    "a face has skin, deep, rim, lip.upper, lip.lower, lid.upper.L, lid.lower.L, deep.nose, deep.perioral, deep.sliding \
                     (of which deep.perioral.jaw, deep.perioral.skull, ... are parts), deep.eye.L, the same with .R unless it is half a face, then midline; and xi1=0 to xi3=1"
                }
            };
            let face = name.to_string().into();
            return Err(Error::NoSuchFace { face, named, place: Box::new(place.clone()) });
        }
        all.extend(named);
    }
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// The mesh of a muscle, the angles of its fibres, and the warning of its mesh.
///
/// # Errors
/// An EX file that cannot be read, or that has no such angles.
pub fn muscle_mesh(spec: &MuscleSpec) -> Result<(Mesh, FibreAngles, Option<Warning>)> {
    let (mesh, file) = match &spec.geometry {
        GeometrySpec::FaceMuscle(FaceMuscleSpec { name, side, face }) => {
            let course = face.muscle(name).unwrap_or_else(|| unreachable!("checked by the scene"));
            let (mesh, angles) = course.mesh(&face.sheet, *side);
            let angles = turned(&mesh, angles, spec.fibre_turn_deg);
            return Ok((mesh, angles, None));
        }
        GeometrySpec::Face(_) => unreachable!("no muscle is read as a face"),
        GeometrySpec::Block(spec) => (block(&Trilinear, spec.origin_mm, spec.size_mm, spec.elements), None),
        GeometrySpec::Blocks(all) => (blocks(&Trilinear, all), None),
        GeometrySpec::Exf(exf) => {
            let file = ExFile::read(&exf.path)?;
            let geometry = file.geometry(exf.field.as_deref())?;
            (geometry.mesh.clone(), Some((file, geometry)))
        }
    };
    let angles = match &spec.fibres {
        FibresSpec::Face => unreachable!("only of a muscle of the face"),
        FibresSpec::Uniform(degrees) => FibreAngles::uniform(&mesh, degrees.map(f64::to_radians)),
        FibresSpec::Nodes(nodes) => {
            FibreAngles::at_nodes(nodes.iter().map(|degrees| degrees.map(f64::to_radians)).collect())
        }
        FibresSpec::Field(field) => match &file {
            Some((file, geometry)) => file.angles(field, geometry)?,
            None => {
                let (wanted, place) = (Some(field.as_str().into()), Box::new(spec.place.clone()));
                return Err(Error::ExField { wanted, found: "".into(), place });
            }
        },
    };
    let warning = file.and_then(|(_, geometry)| geometry.warning(&spec.place));
    let angles = turned(&mesh, angles, spec.fibre_turn_deg);
    Ok((mesh, angles, warning))
}

/// The point of the host at a position of the problem file.
fn material_point(locator: &Locator, position: [f64; 3]) -> std::result::Result<MaterialPoint, Outside> {
    locator.locate(position).or_else(|outside| match outside.distance <= ROUNDED {
        true => Ok(outside.nearest),
        false => Err(outside),
    })
}

/// Embeds a muscle whose first control is `first`; gives the names of its controls and the warning of its mesh too.
fn embed(
    scene: &Scene,
    spec: &MuscleSpec,
    locator: &Locator<'_>,
    first: usize,
) -> Result<(Muscle, Vec<String>, Option<Warning>)> {
    let ElementSpec::Trilinear = spec.element;
    let (mesh, angles, warning) = muscle_mesh(spec)?;
    let (activation, names) = match spec.activation {
        ActivationSpec::Uniform => (Activation::Uniform(first), vec![spec.name.clone()]),
        ActivationSpec::Field => {
            let names = (0..mesh.nodes).map(|node| format!("{}[{node}]", spec.name));
            (Activation::Field(first), names.collect())
        }
    };
    for control in scene.controls.iter().filter(|control| control.name == spec.name) {
        if let ControlValue::Nodes(values) = &control.value
            && values.len() != names.len()
        {
            return Err(Error::WrongLength {
                key: format!("controls.{}", spec.name),
                found: format!("activations for {} nodes", values.len()).into(),
                expected: format!("{}, one for each node of the muscle's mesh", names.len()),
                place: control.place.clone(),
            });
        }
    }
    let b = &spec.blemker;
    let law = Blemker {
        sigma_max: b.sigma_max_kpa,
        lambda_star: b.lambda_star,
        lambda_ofl: b.lambda_ofl,
        p1: b.p1,
        p2: b.p2,
    };
    let rule = match spec.cut {
        true => MuscleRule::cut(&mesh, locator, spec.gauss),
        false => MuscleRule::uniform(&mesh, spec.gauss),
    };
    let muscle = Muscle::with_rule(&spec.name, locator, &mesh, &angles, &rule, law, activation);
    let muscle = muscle.map(|muscle| match spec.taper_mm {
        Some(taper) => muscle.tapered(&Locator::new(&mesh), taper),
        None => muscle,
    });
    muscle.map(|muscle| (muscle, names, warning)).map_err(|error| match error {
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

/// A reference shape that violates a contact by less is taken as rounding, in element sizes.
const START_TOLERANCE: f64 = 1e-7;

fn contact(
    scene: &Scene,
    spec: &ContactSpec,
    allows: Allows,
    mesh: &Mesh,
    bone: Option<Arc<Bone>>,
) -> Result<(Box<dyn Term>, Option<Warning>)> {
    let own = faces(scene, mesh, &spec.face, &spec.place)?;
    let (between, depth) = match &spec.surface {
        SurfaceSpec::Faces { face, depth_mm } => {
            let others = faces(scene, mesh, face, &spec.place)?;
            if let Some(both) = others.iter().find(|face| own.contains(face)) {
                let (contact, element) = (spec.name.as_str().into(), both.element);
                return Err(Error::MeetsItself { contact, element, place: Box::new(spec.place.clone()) });
            }
            (Between::Two(own, others), *depth_mm)
        }
        SurfaceSpec::Itself { depth_mm } => (Between::Itself(own), *depth_mm),
        SurfaceSpec::Reference(Some(face)) | SurfaceSpec::Arch(face) => {
            let before = faces(scene, mesh, face, &spec.place)?;
            return rigid_contact(spec, allows, mesh, [&own, &before], bone);
        }
        _ => return rigid_contact(spec, allows, mesh, [&own, &own], bone),
    };
    let manner = Manner { law: contact_law(&spec.law), relax: spec.initial == InitialSpec::Relax, depth };
    let contact = Mutual::new(&spec.name, manner, mesh, between, spec.gauss);
    let warning = start_of_contact(spec, allows, mesh, contact.worst_start(mesh))?;
    Ok((Box::new(contact), warning))
}

fn contact_law(law: &ContactLawSpec) -> Box<dyn ContactLaw> {
    match *law {
        ContactLawSpec::Penalty { kpa_per_mm } => Box::new(Penalty { stiffness: kpa_per_mm }),
        ContactLawSpec::Smooth { kpa_per_mm, range_mm } => {
            Box::new(Smooth { stiffness: kpa_per_mm, range: range_mm })
        }
        ContactLawSpec::Augmented { kpa_per_mm, gap_mm } => {
            Box::new(Augmented { stiffness: kpa_per_mm, tolerance: gap_mm })
        }
        ContactLawSpec::Barrier { kpa_per_mm, range_mm } => {
            Box::new(Barrier { stiffness: kpa_per_mm, range: range_mm })
        }
    }
}

/// Contact of the first faces with a rigid surface, which may be where the second ones are at rest.
fn rigid_contact(
    spec: &ContactSpec,
    allows: Allows,
    mesh: &Mesh,
    [faces, before]: [&[Face]; 2],
    bone: Option<Arc<Bone>>,
) -> Result<(Box<dyn Term>, Option<Warning>)> {
    let free = |inside: bool| if inside { FreeSide::Inside } else { FreeSide::Outside };
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
        SurfaceSpec::Arch(_) => Box::new(Arch::new(mesh, before)),
        SurfaceSpec::Reference(_) | SurfaceSpec::Faces { .. } | SurfaceSpec::Itself { .. } => {
            Box::new(Patches::new(mesh, before, FreeSide::Inside))
        }
    };
    let relax = spec.initial == InitialSpec::Relax;
    let interface = Interface { allows, surface, law: contact_law(&spec.law), relax };
    let contact = Contact::new(&spec.name, interface, mesh, faces, spec.gauss);
    let warning = start_of_contact(spec, allows, mesh, contact.worst_start(mesh))?;
    let contact = match bone {
        Some(bone) => contact.on(bone),
        None => contact,
    };
    Ok((Box::new(contact), warning))
}

/// A mistake or a warning where the reference shape violates a contact; `worst` is the point that does so most.
fn start_of_contact(
    spec: &ContactSpec,
    allows: Allows,
    mesh: &Mesh,
    worst: Option<(MaterialPoint, [f64; 3], f64)>,
) -> Result<Option<Warning>> {
    let Some((at, position, gap)) = worst else { return Ok(None) };
    let rounding = START_TOLERANCE * determinant(&mesh.jacobian(at)).abs().cbrt();
    let wrong = match allows {
        Allows::Closed => gap.abs() > rounding,
        Allows::ClosedOrOpen if matches!(spec.law, ContactLawSpec::Barrier { .. }) => gap <= 0.0,
        Allows::ClosedOrOpen => gap < -rounding,
    };
    if !wrong {
        return Ok(None);
    }
    if spec.initial == InitialSpec::Refuse {
        let (name, place) = (spec.name.as_str().into(), Box::new(spec.place.clone()));
        return Err(Error::StartsInContact { name, gap, position, element: at.element, place });
    }
    let warning = Warning {
        code: "G023",
        message: format!(
            "`{}`: the reference shape has a gap of {gap:.3} mm at ({:.2}, {:.2}, {:.2}) mm, which is relaxed along \
             the load path",
            spec.name, position[0], position[1], position[2]
        ),
        place: Some(spec.place.clone()),
        help: None,
    };
    Ok(Some(warning))
}

/// Warns where a muscle has so few quadrature points for the host's elements that the answer depends on where they fall.
/// `host_element` is the mean volume of a host element, mm3.
fn coarse_rule(spec: &MuscleSpec, host: &GeometrySpec, muscle: &Muscle, host_element: f64) -> Option<Warning> {
    let fewest = match (&spec.geometry, host) {
        _ if spec.cut => spec.gauss as f64,
        (GeometrySpec::Block(own), GeometrySpec::Block(host)) => {
            let element = |block: &BlockSpec, d: usize| block.size_mm[d] / block.elements[d] as f64;
            let points = |d| spec.gauss as f64 * element(host, d) / element(own, d);
            (0..3).map(points).fold(f64::INFINITY, f64::min)
        }
        // the mean over directions that need not agree
        _ => (muscle.points().len() as f64 * host_element / muscle.volume()).cbrt(),
    };
    if fewest >= POINTS_PER_HOST_ELEMENT {
        return None;
    }
    let enough = (spec.gauss as f64 * POINTS_PER_HOST_ELEMENT / fewest).ceil();
    let help = match spec.cut {
        true => "use gauss = 3 for this muscle".to_owned(),
        false => format!("write cut = true for this muscle, or gauss = {enough:.0}, or more elements in its mesh"),
    };
    Some(Warning {
        code: "G007",
        message: format!(
            "muscle `{}` has only {fewest:.1} quadrature points along a host element: its force depends on where they fall",
            spec.name
        ),
        place: Some(spec.place.clone()),
        help: Some(help),
    })
}

fn supports(scene: &Scene, mesh: &Mesh, bones: &[Arc<Bone>]) -> Result<Supports> {
    let plane = |face: &FaceSpec, place: &Place| {
        normal_axis(mesh, &faces(scene, mesh, face, place)?)
            .ok_or_else(|| Error::NotNormalToAxis { face: face.to_string().into(), place: Box::new(place.clone()) })
    };
    let mut all = Vec::new();
    for spec in &scene.supports {
        all.push(match &spec.kind {
            SupportKind::Clamp { face, bone: name } => {
                let faces = faces(scene, mesh, face, &spec.place)?;
                match bone(bones, name) {
                    Some(bone) => Support::Carried { faces, bone },
                    None => Support::Clamp { faces },
                }
            }
            SupportKind::Symmetry { face } => {
                Support::Symmetry { faces: faces(scene, mesh, face, &spec.place)?, axis: plane(face, &spec.place)? }
            }
            SupportKind::Plate { face, offset_mm } => Support::Plate {
                faces: faces(scene, mesh, face, &spec.place)?,
                axis: plane(face, &spec.place)?,
                offset: *offset_mm,
            },
            SupportKind::Rotate { face, axis, through_mm, angle_deg } => {
                debug_assert!(norm(*axis) > 0.0, "checked by the scene");
                Support::Rotate {
                    faces: faces(scene, mesh, face, &spec.place)?,
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
