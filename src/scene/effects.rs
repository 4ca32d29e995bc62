//! Every effect that a problem file can name, and how often this one does.

use super::{ContactSpec, LoadKind, Scene, SupportKind, SurfaceSpec};

/// The effects beside the passive tissue, in the order of the README.
const EFFECTS: [&str; 19] = [
    "region",
    "muscle",
    "activation field",
    "bone",
    "clamp",
    "symmetry",
    "plate",
    "rotate",
    "traction",
    "gravity",
    "body_force",
    "nodal_force",
    "pressure",
    "spring",
    "attachment",
    "sliding",
    "contact with a rigid surface",
    "contact with other faces",
    "contact with itself",
];

impl Scene {
    /// Every effect with the number of tables that name it; none is an effect that is absent.
    pub fn effects(&self) -> Vec<(&'static str, usize)> {
        // a new kind of table must be sorted in here before this compiles
        let Scene {
            regions,
            muscles,
            bones,
            supports,
            slidings,
            contacts,
            loads,
            attachments,
            name: _,
            folder: _,
            task: _,
            mesh: _,
            tissue: _,
            controls: _,
            probes: _,
            fit: _,
            markers: _,
            solver: _,
            output: _,
            warnings: _,
        } = self;
        let many = |word: &'static str, count: usize| std::iter::repeat_n(word, count);
        let supports = supports.iter().map(|support| match support.kind {
            SupportKind::Clamp { .. } => "clamp",
            SupportKind::Symmetry { .. } => "symmetry",
            SupportKind::Plate { .. } => "plate",
            SupportKind::Rotate { .. } => "rotate",
        });
        let loads = loads.iter().map(|load| match load.kind {
            LoadKind::Traction { .. } => "traction",
            LoadKind::Gravity { .. } => "gravity",
            LoadKind::BodyForce { .. } => "body_force",
            LoadKind::Pressure { .. } => "pressure",
            LoadKind::NodalForce { .. } => "nodal_force",
            LoadKind::Spring { .. } => "spring",
        });
        let contacts = contacts.iter().map(|ContactSpec { surface, .. }| match surface {
            SurfaceSpec::Plane { .. }
            | SurfaceSpec::Sphere { .. }
            | SurfaceSpec::Cylinder { .. }
            | SurfaceSpec::Capsule { .. }
            | SurfaceSpec::Reference(_)
            | SurfaceSpec::Arch(_) => "contact with a rigid surface",
            SurfaceSpec::Faces { .. } => "contact with other faces",
            SurfaceSpec::Itself { .. } => "contact with itself",
        });
        let fields = muscles.iter().filter(|muscle| muscle.activation == super::ActivationSpec::Field).count();
        let named: Vec<&str> = supports
            .chain(loads)
            .chain(contacts)
            .chain(many("region", regions.len()))
            .chain(many("muscle", muscles.len()))
            .chain(many("activation field", fields))
            .chain(many("bone", bones.len()))
            .chain(many("sliding", slidings.len()))
            .chain(many("attachment", attachments.len()))
            .collect();
        EFFECTS.iter().map(|effect| (*effect, named.iter().filter(|name| *name == effect).count())).collect()
    }
}
