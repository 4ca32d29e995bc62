//! What a problem file says, as plain checked data.
//!
//! Every number here is finite and within its range, every name that refers to a muscle refers to one, every path is
//! absolute. What needs geometry (is the muscle inside its host?) is asked later, and points back through `place`.

use super::objectives::ObjectivesSpec;
use super::outer::OuterSpec;
use super::units::Units;
use crate::error::Place;
use crate::math::factor::Precision;
use crate::mesh::facial::{BodySide, Facial};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// What to do with the problem: `[task] kind`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Task {
    /// Given loads and activations, find the shape.
    Forward,
    /// Given marker positions, find the activations.
    Fit,
}

/// The host body: `[mesh]`.
#[derive(Debug, Clone, Serialize)]
pub struct MeshSpec {
    /// Where the body lies before anything moves: a block of tricubic Hermite elements, or the mesh of an EX file.
    #[serde(flatten)]
    pub geometry: GeometrySpec,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// Where a mesh comes from.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GeometrySpec {
    /// A box.
    Block(BlockSpec),
    /// Several boxes that share no node: bodies that may touch. Only of the host.
    Blocks(Vec<NamedBlockSpec>),
    /// An EX file: `exf = "face.exf"`, and which of its fields holds the coordinates.
    Exf(ExfSpec),
    /// A face. Only of the host.
    Face(FaceMeshSpec),
    /// A muscle of the face. Only of a muscle.
    FaceMuscle(FaceMuscleSpec),
}

/// The face of a person: `[mesh] face`.
#[derive(Debug, Clone, Serialize)]
pub struct FaceMeshSpec {
    /// A file with landmarks and muscles in place of those that are built in.
    pub landmarks: Option<PathBuf>,
    /// Elements through the thickness, 1 to 8.
    pub layers: usize,
    /// Whether each element is cut in four along the surface.
    pub halved: bool,
    /// Whether it is the left half only.
    pub half: bool,
    /// What the file says, on top of what is built in.
    #[serde(skip)]
    pub face: Arc<Facial>,
}

/// A muscle of the face: `[[muscle]] face`.
#[derive(Debug, Clone, Serialize)]
pub struct FaceMuscleSpec {
    /// Its name in the face, for example `zygomaticus_major`.
    pub name: String,
    /// On which side.
    #[serde(serialize_with = "side_letter")]
    pub side: BodySide,
    /// The face.
    #[serde(skip)]
    pub face: Arc<Facial>,
}

fn side_letter<S: serde::Serializer>(side: &BodySide, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(side.letter())
}

/// A mesh in an EX file, in mm.
#[derive(Debug, Clone, Serialize)]
pub struct ExfSpec {
    /// The file.
    pub path: PathBuf,
    /// The field of coordinates: `field`; without it `coordinates`, or the only one there is.
    pub field: Option<String>,
}

/// A box along the axes, cut into equal elements; xi1, xi2, xi3 run along x, y, z.
#[derive(Debug, Clone, Serialize)]
pub struct BlockSpec {
    /// The corner with the smallest coordinates, mm.
    pub origin_mm: [f64; 3],
    /// The lengths of the edges, mm; greater than 0.
    pub size_mm: [f64; 3],
    /// The number of elements along each edge, at least 1.
    pub elements: [usize; 3],
}

/// One of several boxes.
#[derive(Debug, Clone, Serialize)]
pub struct NamedBlockSpec {
    /// Its name, unique among the boxes; its faces are called `<name>:xi1=0`.
    pub name: String,
    /// The box.
    #[serde(flatten)]
    pub block: BlockSpec,
}

impl BlockSpec {
    /// The number of nodes of a mesh with one node per element corner.
    pub fn nodes(&self) -> usize {
        self.elements.iter().map(|elements| elements + 1).product()
    }
}

/// The passive tissue of the host: `[tissue]`.
#[derive(Debug, Clone, Serialize)]
pub struct TissueSpec {
    /// The material law.
    pub law: LawSpec,
    /// The space of the pressure that keeps the volume.
    pub pressure: PressureSpec,
    /// The modulus of the volume energy beside the pressure, kPa; 0 leaves it out.
    pub kappa_kpa: f64,
    /// Gauss points per direction and element, 3 to 8.
    pub gauss: usize,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// A part of the tissue with constants of its own: `[[region]]`.
#[derive(Debug, Clone, Serialize)]
pub struct RegionSpec {
    /// Its name, unique among regions.
    pub name: String,
    /// The elements in it.
    pub part: PartSpec,
    /// The law of the tissue with other constants.
    pub law: LawSpec,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// A set of elements of the host.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PartSpec {
    /// `elements`: their indices, counted from 0; at least one.
    Elements(Vec<usize>),
    /// `box_mm`: those whose centre lies between the lower and the upper corner before anything moves, mm.
    Box([[f64; 3]; 2]),
}

/// A material law with its constants.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawSpec {
    /// psi = c1 (I1 - 3) + c2 (I2 - 3), invariants of the isochoric part.
    MooneyRivlin {
        /// c1, kPa, not negative; c1 + c2 is positive.
        c1_kpa: f64,
        /// c2, kPa, not negative.
        c2_kpa: f64,
    },
    /// psi = mu/2 (I1 - 3), invariant of the isochoric part.
    NeoHookean {
        /// The shear modulus, kPa.
        mu_kpa: f64,
    },
    /// psi = c/2 (exp Q - 1), Q a sum of squares of the strains in the axes of the fibres.
    Guccione {
        /// The scale of the stress, kPa.
        c_kpa: f64,
        /// The exponent along the fibres.
        bf: f64,
        /// The exponent across them.
        bt: f64,
        /// The exponent of shear along them.
        bfs: f64,
        /// The direction of the fibres; any length but 0.
        fibre: [f64; 3],
    },
}

impl LawSpec {
    /// The key in the problem file.
    pub fn word(&self) -> &'static str {
        match self {
            LawSpec::MooneyRivlin { .. } => "mooney-rivlin",
            LawSpec::NeoHookean { .. } => "neo-hookean",
            LawSpec::Guccione { .. } => "guccione",
        }
    }
}

/// A space of pressures: `[tissue] pressure`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PressureSpec {
    /// One value per element corner, continuous from element to element.
    Trilinear,
    /// Eight values per element, independent of its neighbours.
    DiscontinuousTrilinear,
}

/// A muscle embedded in the host: `[[muscle]]`.
#[derive(Debug, Clone, Serialize)]
pub struct MuscleSpec {
    /// Its name, unique among muscles; its control carries the same name.
    pub name: String,
    /// Where the muscle lies before anything moves.
    #[serde(flatten)]
    pub geometry: GeometrySpec,
    /// The elements of the muscle's own mesh, if it is a block; an EX file brings its own.
    pub element: ElementSpec,
    /// The direction of its fibres.
    pub fibres: FibresSpec,
    /// Whether it has one activation or a field of them.
    pub activation: ActivationSpec,
    /// Gauss points per direction in every element, or in every part of one if the rule is cut, 1 to 8.
    pub gauss: usize,
    /// Whether elements are divided for the rule where they pass into another element of the host.
    pub cut: bool,
    /// The length over which fibres end one after the other, mm.
    pub taper_mm: Option<f64>,
    /// Degrees that are added to the fibre angle A: the same everywhere, then from minus to plus so many along x, y and z from
    /// one side to the other of the box around the mesh.
    pub fibre_turn_deg: [f64; 4],
    /// The constants of its force-stretch law.
    pub blemker: BlemkerSpec,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// The elements of a muscle mesh: `[[muscle]] element`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ElementSpec {
    /// Eight corners, trilinear between them.
    Trilinear,
}

/// How a muscle is activated: `[[muscle]] activation`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ActivationSpec {
    /// One control, called like the muscle.
    Uniform,
    /// A control for every node of the muscle's block, called `<muscle>[n]`, trilinear between them.
    Field,
}

/// Fibre, imbrication and sheet angle, degrees, relative to the axes of the muscle elements.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FibresSpec {
    /// `fibre_angles_deg`: the same angles everywhere.
    Uniform([f64; 3]),
    /// `fibre_angles_nodes_deg`: angles at the nodes of the block, x fastest, then y, then z.
    Nodes(Vec<[f64; 3]>),
    /// `angles_field`: a field of the muscle's EX file, in radians there.
    Field(String),
    /// Those of a muscle of the face.
    Face,
}

/// The constants of the fibre law of Blemker et al. 2005.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct BlemkerSpec {
    /// The greatest isometric stress, kPa.
    pub sigma_max_kpa: f64,
    /// The stretch at which the passive force becomes linear; greater than `lambda_ofl`.
    pub lambda_star: f64,
    /// The stretch of optimal fibre length.
    pub lambda_ofl: f64,
    /// The factor of the passive exponential.
    pub p1: f64,
    /// The rate of the passive exponential.
    pub p2: f64,
}

/// Something that holds or moves a part of the surface: `[[support]]`.
#[derive(Debug, Clone, Serialize)]
pub struct SupportSpec {
    /// What it does.
    pub kind: SupportKind,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// The kinds of support.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SupportKind {
    /// The face does not move, or moves as a part of a bone.
    Clamp {
        /// The face.
        face: FaceSpec,
        /// The bone that it is grown to; without one it is held in space.
        bone: Option<String>,
    },
    /// The face does not move along its normal.
    Symmetry {
        /// The face.
        face: FaceSpec,
    },
    /// The face, normal to an axis, moves along it as a smooth plate does that pulls or presses it.
    Plate {
        /// The face.
        face: FaceSpec,
        /// The motion along the axis at full load, mm.
        offset_mm: f64,
    },
    /// The face turns as a rigid plate.
    Rotate {
        /// The face.
        face: FaceSpec,
        /// The axis of rotation; any length but 0.
        axis: [f64; 3],
        /// A point of the axis, mm.
        through_mm: [f64; 3],
        /// The angle at full load, degrees, by the right-hand rule.
        angle_deg: f64,
    },
}

/// A part of the host's surface: all faces with any of these names; at least one name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct FaceSpec(pub Vec<FaceName>);

/// How faces of the host are named.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaceName {
    /// `"boundary"`: the whole surface.
    Boundary,
    /// `"xi1=0"` is direction 0, end 0: a whole side of a block, and of any mesh all boundary faces that are this side
    /// of their element.
    Side {
        /// 0, 1, 2 for xi1, xi2, xi3.
        direction: usize,
        /// 0 or 1: where that coordinate is smallest or greatest.
        end: usize,
    },
    /// `"lip.upper"`: a part of a face; one of [`FACES`](crate::mesh::facial::FACES).
    OfFace(String),
    /// `"lip:xi1=0"`: a side of one of several blocks.
    OfBlock {
        /// The name of the block.
        block: String,
        /// 0, 1, 2 for xi1, xi2, xi3.
        direction: usize,
        /// 0 or 1.
        end: usize,
    },
    /// `"7:xi1=0"`: one face of a mesh from an EX file.
    OfElement {
        /// The identifier of the element in the file.
        element: i64,
        /// 0, 1, 2 for xi1, xi2, xi3.
        direction: usize,
        /// 0 or 1.
        end: usize,
    },
}

impl std::fmt::Display for FaceName {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            FaceName::Boundary => write!(out, "boundary"),
            FaceName::OfFace(name) => write!(out, "{name}"),
            FaceName::Side { direction, end } => write!(out, "xi{}={end}", direction + 1),
            FaceName::OfBlock { block, direction, end } => write!(out, "{block}:xi{}={end}", direction + 1),
            FaceName::OfElement { element, direction, end } => write!(out, "{element}:xi{}={end}", direction + 1),
        }
    }
}

impl std::fmt::Display for FaceSpec {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<String> = self.0.iter().map(FaceName::to_string).collect();
        write!(out, "{}", names.join(", "))
    }
}

/// Contact of a face with a surface, without friction: `[[sliding]]` or `[[contact]]`.
#[derive(Debug, Clone, Serialize)]
pub struct ContactSpec {
    /// Its name in tables, unique; by default its kind and number.
    pub name: String,
    /// The face.
    pub face: FaceSpec,
    /// What it meets.
    pub surface: SurfaceSpec,
    /// The bone that carries the surface; without one it stays where it is.
    pub bone: Option<String>,
    /// What keeps the gap.
    pub law: ContactLawSpec,
    /// What becomes of a reference shape that violates it.
    pub initial: InitialSpec,
    /// Gauss points per direction and element face, 2 to 12.
    pub gauss: usize,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// What a face meets: `surface` of a contact.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceSpec {
    /// A plane.
    Plane {
        /// A point of it, mm.
        through_mm: [f64; 3],
        /// Towards the free side; any length but 0.
        normal: [f64; 3],
    },
    /// A sphere.
    Sphere {
        /// Its centre, mm.
        centre_mm: [f64; 3],
        /// Its radius, mm.
        radius_mm: f64,
        /// Whether the body is inside.
        inside: bool,
    },
    /// A cylinder without ends.
    Cylinder {
        /// A point of the axis, mm.
        through_mm: [f64; 3],
        /// Along the axis; any length but 0.
        axis: [f64; 3],
        /// Its radius, mm.
        radius_mm: f64,
        /// Whether the body is inside.
        inside: bool,
    },
    /// A cylinder between two points, with half spheres as its ends.
    Capsule {
        /// One end of the axis, mm.
        from_mm: [f64; 3],
        /// The other end, mm.
        to_mm: [f64; 3],
        /// Its radius, mm.
        radius_mm: f64,
        /// Whether the body is inside.
        inside: bool,
    },
    /// A face of the host where it was before anything moved; the body is on its own side of it. `None`: the face that
    /// meets it.
    Reference(Option<FaceSpec>),
    /// A smooth surface behind faces of the host: teeth and jaws. The body is in front of it.
    Arch(FaceSpec),
    /// Other faces of the host, which yield; not for sliding.
    Faces {
        /// The faces.
        face: FaceSpec,
        /// Penetration that still counts as contact, mm; `None`: half of the thickness of the elements.
        depth_mm: Option<f64>,
    },
    /// The face itself as it is: folds that touch; not for sliding.
    Itself {
        /// Penetration that still counts as contact, mm; `None`: half of the thickness of the elements.
        depth_mm: Option<f64>,
    },
}

/// A law of contact: `law` of a contact.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactLawSpec {
    /// A spring per area.
    Penalty {
        /// Its stiffness.
        kpa_per_mm: f64,
    },
    /// A spring per area about multipliers that close the gap.
    Augmented {
        /// Its stiffness.
        kpa_per_mm: f64,
        /// The gap that may remain, mm.
        gap_mm: f64,
    },
    /// A spring per area that sets in over a range of depth; not for sliding.
    Smooth {
        /// Its stiffness beyond the range.
        kpa_per_mm: f64,
        /// The depth at which it has its full stiffness, mm.
        range_mm: f64,
    },
    /// A barrier that is never passed; not for sliding.
    Barrier {
        /// Its stiffness.
        kpa_per_mm: f64,
        /// The gap at which it begins, mm.
        range_mm: f64,
    },
}

/// What becomes of a reference shape that violates a contact: `initial` of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum InitialSpec {
    /// It is a mistake.
    Refuse,
    /// The violation is taken away along the load path.
    Relax,
}

/// A force on the body: `[[load]]`.
#[derive(Debug, Clone, Serialize)]
pub struct LoadSpec {
    /// What it is.
    pub kind: LoadKind,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// The kinds of load.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LoadKind {
    /// A dead force per reference area of a face.
    Traction {
        /// The face.
        face: FaceSpec,
        /// Force per reference area, kPa, in fixed directions.
        kpa: [f64; 3],
    },
    /// The weight of the tissue.
    Gravity {
        /// Density, kg/m3.
        density_kg_m3: f64,
        /// Acceleration, m/s2.
        acceleration_m_s2: [f64; 3],
    },
    /// A dead force per reference volume on the whole body.
    BodyForce {
        /// mN/mm3.
        mn_mm3: [f64; 3],
    },
    /// A pressure that follows a face.
    Pressure {
        /// The face.
        face: FaceSpec,
        /// Force per current area, kPa; positive pushes into the body.
        kpa: f64,
    },
    /// A dead force on a material point.
    NodalForce {
        /// Where the point is before anything moves, mm.
        position_mm: [f64; 3],
        /// mN.
        mn: [f64; 3],
    },
    /// Springs under a face, from where it was before anything moved; they do not grow with the load.
    Spring {
        /// The face.
        face: FaceSpec,
        /// Force per reference area and motion, kPa/mm.
        kpa_per_mm: f64,
        /// Whether they resist only motion along the reference normal.
        normal_only: bool,
    },
}

/// A material point tied to a bone, or to where it was before anything moved: `[[attachment]]`.
#[derive(Debug, Clone, Serialize)]
pub struct AttachmentSpec {
    /// Where the point is before anything moves, mm.
    pub position_mm: [f64; 3],
    /// How it is tied.
    pub tie: TieSpec,
    /// The bone; without one it is tied to space.
    pub bone: Option<String>,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// How a point is tied.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TieSpec {
    /// By a spring.
    Spring {
        /// Force per elongation, mN/mm.
        stiffness_mn_per_mm: f64,
    },
    /// `rigid = true`: it does not move against what it is tied to.
    Rigid,
}

/// A rigid body that moves: `[[bone]]`. It has a hinge, a slide or both: it turns, then it slides, its hinge with it.
#[derive(Debug, Clone, Serialize)]
pub struct BoneSpec {
    /// Its name, unique among bones; its controls are `<name>.hinge` and `<name>.slide`.
    pub name: String,
    /// How it turns.
    pub hinge: Option<HingeSpec>,
    /// How it slides.
    pub slide: Option<SlideSpec>,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// A rotation about an axis, by the right-hand rule: `hinge` of a bone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HingeSpec {
    /// The axis; any length but 0.
    pub axis: [f64; 3],
    /// A point of the axis before anything moves, mm.
    pub through_mm: [f64; 3],
    /// The smallest and the greatest angle, degrees; 0 is between them.
    pub bounds_deg: [f64; 2],
}

/// A translation along a line: `slide` of a bone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SlideSpec {
    /// The direction, fixed in space; any length but 0.
    pub direction: [f64; 3],
    /// The smallest and the greatest way, mm; 0 is between them.
    pub bounds_mm: [f64; 2],
}

/// What a control may be.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlRange {
    /// Its name: that of a muscle, or `<bone>.hinge`, `<bone>.slide`.
    pub name: String,
    /// What it is.
    pub kind: ControlKind,
    /// Smallest value.
    pub lower: f64,
    /// Greatest value.
    pub upper: f64,
}

/// What a control is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlKind {
    /// An activation, without a unit.
    Activation,
    /// The angle of a hinge, degrees.
    Hinge,
    /// The way of a slide, mm.
    Slide,
}

impl ControlRange {
    /// The range of the activation of a muscle, from 0 to 1.
    pub fn activation(name: &str) -> ControlRange {
        ControlRange { name: name.to_owned(), kind: ControlKind::Activation, lower: 0.0, upper: 1.0 }
    }

    /// The ranges of the controls of a bone: hinge, then slide.
    pub fn of_bone(bone: &BoneSpec) -> Vec<ControlRange> {
        let range = |way: &str, kind, [lower, upper]: [f64; 2]| {
            let name = format!("{}.{way}", bone.name);
            ControlRange { name, kind, lower, upper }
        };
        let hinge = bone.hinge.map(|hinge| range("hinge", ControlKind::Hinge, hinge.bounds_deg));
        let slide = bone.slide.map(|slide| range("slide", ControlKind::Slide, slide.bounds_mm));
        hinge.into_iter().chain(slide).collect()
    }

    /// Whether a value is in it.
    pub fn holds(&self, value: f64) -> bool {
        (self.lower..=self.upper).contains(&value)
    }

    /// The range in words that follow "it must be".
    pub fn allowed(&self) -> String {
        match self.kind {
            ControlKind::Activation => "an activation from 0 to 1".into(),
            ControlKind::Hinge | ControlKind::Slide => {
                format!("from {:?} to {:?} {}, the bounds of its bone", self.lower, self.upper, self.kind.unit())
            }
        }
    }
}

impl ControlKind {
    /// The unit of its values: none, `deg` or `mm`.
    pub fn unit(self) -> &'static str {
        match self {
            ControlKind::Activation => "",
            ControlKind::Hinge => "deg",
            ControlKind::Slide => "mm",
        }
    }
}

/// The activation of a muscle, or the pose of a bone: one line of `[controls]`. What has none rests at 0.
///
/// In a fit, a control that is not among the unknowns holds; that of an unknown is found, not read.
#[derive(Debug, Clone, Serialize)]
pub struct ControlSpec {
    /// The muscle, or `<bone>.hinge`, `<bone>.slide`.
    pub name: String,
    /// How much.
    pub value: ControlValue,
    /// The line in the file.
    #[serde(skip)]
    pub place: Place,
}

/// An activation, from 0 (at rest) to 1 (all it can), an angle in degrees, or a way in mm.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ControlValue {
    /// The same at all times, and in all nodes of a field.
    Constant(f64),
    /// The same at all times, one for every node of a field: x fastest, then y, then z.
    Nodes(Vec<f64>),
    /// The column with the name of the control in a table over time, see [`Curves`](super::Curves).
    Csv(PathBuf),
}

impl ControlValue {
    /// The values of so many controls of one name, unless they change over time.
    pub fn constants(&self, controls: usize) -> Option<Vec<f64>> {
        match self {
            ControlValue::Constant(value) => Some(vec![*value; controls]),
            ControlValue::Nodes(values) => Some(values.clone()),
            ControlValue::Csv(_) => None,
        }
    }
}

/// A material point whose motion is written to a table: `[[probe]]`.
#[derive(Debug, Clone, Serialize)]
pub struct ProbeSpec {
    /// Its name, unique among probes.
    pub name: String,
    /// Where it is before anything moves, mm.
    pub position_mm: [f64; 3],
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// A marker glued to the surface: `[[marker]]`.
#[derive(Debug, Clone, Serialize)]
pub struct MarkerSpec {
    /// Its name, unique among markers.
    pub name: String,
    /// Its label in the recording; its name if the file does not say.
    pub label: String,
    /// Where it is before anything moves, mm.
    pub position_mm: [f64; 3],
    /// The standard deviation of its measurement, mm, if it differs from that of the fit.
    pub sd_mm: Option<f64>,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
}

/// How activations are found from markers: `[fit]`.
#[derive(Debug, Clone, Serialize)]
pub struct FitSpec {
    /// The recording.
    pub markers: PathBuf,
    /// The unit of length in the recording; `None` where it is to be estimated.
    pub units: Option<Units>,
    /// The topic of the markers, where the recording has several.
    pub topic: Option<String>,
    /// How the derivative of marker positions by activations is found.
    pub sensitivity: SensitivitySpec,
    /// What becomes of it after a step.
    pub reuse: ReuseSpec,
    /// The controls that are sought: muscles, `<bone>.hinge`, `<bone>.slide`; by default all muscles and no bone.
    pub unknowns: Vec<String>,
    /// Whether a sample at exactly (0, 0, 0) is a lost marker.
    pub zero_is_missing: bool,
    /// Whether the intact part of a recording that is cut short will do.
    pub allow_truncated: bool,
    /// Whether a recording will do in which damage would go unseen, because its writer computed no checksums.
    pub allow_unchecked: bool,
    /// The standard deviation of the measurement per coordinate, mm, if it is known.
    pub sd_mm: Option<f64>,
    /// What is minimised.
    pub objectives: ObjectivesSpec,
    /// What all frames share and is found too: `[fit.outer]`.
    pub outer: Option<OuterSpec>,
    /// A marker further than this from the surface of the model is a mistake, mm.
    pub max_marker_distance_mm: f64,
    /// Which frames of the recording are fitted.
    pub frames: FramesSpec,
    /// In how many parts they are fitted, side by side.
    pub chunks: ChunksSpec,
    /// How the recording is brought to the model.
    pub registration: RegistrationSpec,
    /// Where the search ends; the step that shows it is still taken.
    pub tolerance: FitToleranceSpec,
    /// The most Gauss-Newton steps per frame.
    pub max_iterations: usize,
    /// The step of finite differences in relation to (activation + onset), the onset being the shear modulus of the
    /// tissue over sigma_max; of a bone, in relation to ten times its range.
    pub finite_difference_step: f64,
    /// The table in the file.
    #[serde(skip)]
    pub place: Place,
    /// The name of the recording.
    #[serde(skip)]
    pub markers_place: Place,
    /// Its unit of length.
    #[serde(skip)]
    pub units_place: Place,
    /// Its choice of frames; the table where it has none.
    #[serde(skip)]
    pub frames_place: Place,
}

/// How a recording is brought to the model: `[fit] register`, `neutral` and `axes`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegistrationSpec {
    /// By which motion.
    pub register: RegisterSpec,
    /// The frames in which the face is at rest, often one; by default the first of those that show the most markers.
    pub neutral: Option<FramesSpec>,
    /// How far markers sit from where the model has them on the skin, standard deviation per coordinate, mm: the neutral frames
    /// then tell each of these offsets. `None`: not at all.
    pub offset_sd_mm: Option<f64>,
    /// The axes of the recording that are x, y and z of the model, before that motion.
    pub axes: [AxisSpec; 3],
    /// From what the motion of the head is known.
    pub head: HeadSpec,
    /// The table `[fit.head]`; that of the fit where there is none.
    #[serde(skip)]
    pub head_place: Place,
    /// The word of `register`; the table where there is none.
    #[serde(skip)]
    pub register_place: Place,
    /// The choice of neutral frames; the table where there is none.
    #[serde(skip)]
    pub neutral_place: Place,
}

/// The motion that brings a recording to the model: `[fit] register`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RegisterSpec {
    /// It stands where the model does.
    None,
    /// A turn and a shift.
    Rigid,
    /// A turn, a shift and a scale.
    Similarity,
}

impl RegisterSpec {
    /// The word in the problem file.
    pub fn word(self) -> &'static str {
        match self {
            RegisterSpec::None => "none",
            RegisterSpec::Rigid => "rigid",
            RegisterSpec::Similarity => "similarity",
        }
    }
}

/// From what the motion of the head in a recording is known: `[fit.head]`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HeadSpec {
    /// It does not move.
    None,
    /// From markers that sit on bone, by their labels in the recording.
    BoneMarkers(Vec<String>),
    /// From poses in another topic of the recording.
    PoseTopic(String),
    /// It is estimated in every frame together with the controls.
    Estimate,
}

/// An axis of a recording, or its opposite: `"x"`, `"-x"`, ...
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct AxisSpec(usize);

impl AxisSpec {
    /// x, y, z, -x, -y, -z.
    pub const ALL: [AxisSpec; 6] = [AxisSpec(0), AxisSpec(1), AxisSpec(2), AxisSpec(3), AxisSpec(4), AxisSpec(5)];

    /// Which coordinate it is, 0 to 2.
    pub fn index(self) -> usize {
        self.0 % 3
    }

    /// 1, or -1 for the opposite.
    pub fn sign(self) -> f64 {
        if self.0 < 3 { 1.0 } else { -1.0 }
    }

    /// The opposite.
    pub fn reversed(self) -> AxisSpec {
        AxisSpec((self.0 + 3) % 6)
    }

    /// The word in the problem file.
    pub fn word(self) -> &'static str {
        ["x", "y", "z", "-x", "-y", "-z"][self.0]
    }
}

/// How the derivative of the shape by the activations is found: `[fit] sensitivity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SensitivitySpec {
    /// From the tangent at equilibrium (implicit function theorem).
    Tangent,
    /// From whole solves at activations a little apart.
    FiniteDifference,
}

/// Where the search for a frame ends: `[fit] tolerance`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FitToleranceSpec {
    /// With a step that changes a control by no more than this, as a part of its range.
    Change(f64),
    /// Where the answer is so many standard deviations from the optimum, as the steps tell, all controls together.
    Sds(f64),
}

/// What becomes of sensitivities after a step of a fit: `[fit] reuse`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReuseSpec {
    /// They are found anew.
    Fresh,
    /// They are kept until the end of the search is near.
    Frozen,
    /// They are kept but for what the step shows.
    Broyden,
    /// They are kept, with an exact gradient at every step.
    Adjoint,
}

/// Frames `first`, `first + step`, ... up to and including `last` (or the end of the recording); counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct FramesSpec {
    /// The first frame.
    pub first: usize,
    /// The last frame, not before the first.
    pub last: Option<usize>,
    /// The distance between frames, at least 1.
    pub step: usize,
}

impl FramesSpec {
    /// One frame.
    pub fn one(frame: usize) -> FramesSpec {
        FramesSpec { first: frame, last: Some(frame), step: 1 }
    }

    /// These frames of a recording that has `count`.
    ///
    /// # Errors
    /// The first or the last of them, where the recording does not have it.
    pub fn within(self, count: usize) -> std::result::Result<Vec<usize>, usize> {
        let FramesSpec { first, last, step } = self;
        let last = last.unwrap_or(count.saturating_sub(1));
        match [first, last].into_iter().find(|frame| *frame >= count) {
            Some(beyond) => Err(beyond),
            None => Ok((first..=last).step_by(step).collect()),
        }
    }
}

/// Chunks of a clip that are fitted side by side: `[fit] chunks`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ChunksSpec {
    /// So many at most; 1 is the whole clip, one frame after the other.
    pub count: usize,
    /// So many frames early each begins but the first.
    pub overlap: usize,
}

/// How equilibrium is found: `[solver]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SolverSpec {
    /// The relative residual at which a state counts as equilibrium.
    pub tolerance: f64,
    /// The most Newton iterations of one solve.
    pub max_iterations: usize,
    /// The greatest part of the load path taken at once; 1 is the whole path.
    pub step_max: f64,
    /// The smallest part of the load path before the solver gives up; not above `step_max`.
    pub step_min: f64,
    /// In which numbers the tangent is factorised; solutions are refined in double precision.
    pub precision: Precision,
}

/// What is written beside the tables: `[output]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct OutputSpec {
    /// Whether the folder `view` with the shapes is written.
    pub view: bool,
    /// Every how many frames a shape is written, at least 1.
    pub every: usize,
    /// Whether the discretisation error is estimated: of the last frame of a forward run, of every frame of a fit.
    pub estimate: bool,
}
