//! From a scene to a model: every table of the problem file becomes a mesh, a term or a support.

use super::supports::{Conflict, Support, Supports, normal_axis};
use super::{Control, Ingredients, Model};
use crate::error::{Error, MuscleOutside, Place, Result, Warning};
use crate::material::fibre::Blemker;
use crate::material::{Law, MooneyRivlin};
use crate::math::tensor::{norm, normalised};
use crate::mesh::block::block;
use crate::mesh::element::{TricubicHermite, Trilinear};
use crate::mesh::exf::{ExFile, Geometry};
use crate::mesh::face::{Face, boundary_faces};
use crate::mesh::fibre_angles::FibreAngles;
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::{
    BlockSpec, ElementSpec, FaceName, FaceSpec, FibresSpec, GeometrySpec, LawSpec, LoadKind, MeshSpec, MuscleSpec,
    PressureSpec, Scene, SupportKind,
};
use crate::term::Term;
use crate::term::load::{gravity, traction};
use crate::term::muscle::{Muscle, NotEmbedded};
use crate::term::pressure::{self, PressureSpace};
use crate::term::tissue::Tissue;

/// A model built from a scene, with the places in it that the scene names.
pub struct Built {
    /// The model; control k is the activation of the k-th muscle of the scene.
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
/// host, supports that contradict each other.
pub fn build(scene: &Scene) -> Result<Built> {
    let mesh = host(&scene.mesh)?;
    let space: &'static dyn PressureSpace = match scene.tissue.pressure {
        PressureSpec::Trilinear => &pressure::Trilinear,
        PressureSpec::DiscontinuousTrilinear => &pressure::DiscontinuousTrilinear,
    };
    let gauss = scene.tissue.gauss;
    let LawSpec::MooneyRivlin { c1_kpa, c2_kpa } = scene.tissue.law;
    let law = MooneyRivlin { c1: c1_kpa, c2: c2_kpa };
    let shear_modulus = law.shear_modulus();
    // nothing else can be placed in a host that is inverted
    let tissue = Tissue::new(&mesh, law, scene.tissue.kappa_kpa, space, gauss).map_err(|at| Error::InvertedMesh {
        element: at.element,
        xi: at.xi,
        det: at.det,
        place: Box::new(scene.mesh.place.clone()),
    })?;
    let volume = tissue.volume();

    let mut mistakes = Vec::new();
    let mut warnings = Vec::new();
    let mut terms: Vec<Box<dyn Term>> = vec![Box::new(tissue)];
    let mut controls = Vec::new();
    let locator = Locator::new(&mesh);
    for (index, spec) in scene.muscles.iter().enumerate() {
        match embed(spec, &locator, index) {
            Ok(muscle) => {
                let host_element = volume / mesh.elements() as f64;
                warnings.extend(coarse_rule(spec, &scene.mesh.geometry, &muscle, host_element));
                terms.push(Box::new(muscle));
            }
            Err(error) => mistakes.push(error),
        }
        let sigma_max = spec.blemker.sigma_max_kpa;
        controls.push(Control {
            name: spec.name.clone(),
            lower: 0.0,
            upper: 1.0,
            onset: if sigma_max > 0.0 { (shear_modulus / sigma_max).min(1.0) } else { 1.0 },
        });
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
        }
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

fn host(spec: &MeshSpec) -> Result<Mesh> {
    match &spec.geometry {
        GeometrySpec::Block(spec) => Ok(block(&TricubicHermite, spec.origin_mm, spec.size_mm, spec.elements)),
        GeometrySpec::Exf(exf) => {
            let Geometry { mesh, field, .. } = ExFile::read(&exf.path)?.geometry(exf.field.as_deref())?;
            if mesh.element.parameters_per_node() == 8 {
                return Ok(mesh);
            }
            Err(Error::HostNotHermite { field: field.into(), place: Box::new(spec.place.clone()) })
        }
    }
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
                GeometrySpec::Exf(_) => {
                    "boundary is all of it, 7:xi1=0 a single face of element 7, xi1=0 all faces on that side of their \
                     element; faces between two elements are not on the boundary"
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

/// The mesh of a muscle and the angles of its fibres.
fn muscle_mesh(spec: &MuscleSpec) -> Result<(Mesh, FibreAngles)> {
    let (mesh, file) = match &spec.geometry {
        GeometrySpec::Block(spec) => (block(&Trilinear, spec.origin_mm, spec.size_mm, spec.elements), None),
        GeometrySpec::Exf(exf) => {
            let file = ExFile::read(&exf.path)?;
            let geometry = file.geometry(exf.field.as_deref())?;
            (geometry.mesh.clone(), Some((file, geometry)))
        }
    };
    let angles = match &spec.fibres {
        FibresSpec::Uniform(degrees) => FibreAngles::uniform(&mesh, degrees.map(f64::to_radians)),
        FibresSpec::Nodes(nodes) => {
            FibreAngles { nodes: nodes.iter().map(|degrees| degrees.map(f64::to_radians)).collect() }
        }
        FibresSpec::Field(field) => match &file {
            Some((file, geometry)) => file.angles(field, geometry)?,
            None => {
                let (wanted, place) = (Some(field.as_str().into()), Box::new(spec.place.clone()));
                return Err(Error::ExField { wanted, found: "".into(), place });
            }
        },
    };
    Ok((mesh, angles))
}

fn embed(spec: &MuscleSpec, locator: &Locator<'_>, control: usize) -> Result<Muscle> {
    let ElementSpec::Trilinear = spec.element;
    let (mesh, angles) = muscle_mesh(spec)?;
    let b = &spec.blemker;
    let law = Blemker {
        sigma_max: b.sigma_max_kpa,
        lambda_star: b.lambda_star,
        lambda_ofl: b.lambda_ofl,
        p1: b.p1,
        p2: b.p2,
    };
    Muscle::new(&spec.name, locator, &mesh, &angles, spec.gauss, law, control).map_err(|error| match error {
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

/// Warns where a muscle has so few quadrature points for the host's elements that the answer depends on where they fall.
/// `host_element` is the mean volume of a host element, mm3.
fn coarse_rule(spec: &MuscleSpec, host: &GeometrySpec, muscle: &Muscle, host_element: f64) -> Option<Warning> {
    let fewest = match (&spec.geometry, host) {
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
    Some(Warning {
        code: "G007",
        message: format!(
            "muscle `{}` has only {fewest:.1} quadrature points along a host element: its force depends on where they fall",
            spec.name
        ),
        place: Some(spec.place.clone()),
        help: Some(format!("use gauss = {enough:.0} for this muscle, or more elements in its mesh")),
    })
}

fn supports(scene: &Scene, mesh: &Mesh) -> Result<Supports> {
    let mut all = Vec::new();
    for spec in &scene.supports {
        all.push(match &spec.kind {
            SupportKind::Clamp { face } => Support::Clamp { faces: faces(scene, mesh, face, &spec.place)? },
            SupportKind::Symmetry { face } => {
                let faces = faces(scene, mesh, face, &spec.place)?;
                let Some(axis) = normal_axis(mesh, &faces) else {
                    return Err(Error::NotNormalToAxis {
                        face: face.to_string().into(),
                        place: Box::new(spec.place.clone()),
                    });
                };
                Support::Symmetry { faces, axis }
            }
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
