//! The bones of a scene, their controls, and the points that are tied to them or to space.

use super::Control;
use crate::math::tensor::normalised;
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::{AttachmentSpec, ControlRange, Scene, TieSpec};
use crate::term::Term;
use crate::term::bone::{Bone, Hinge, Slide};
use crate::term::spring::Springs;
use crate::term::tie::RigidTies;
use std::sync::Arc;

/// The onset of a bone's control in ranges: the response is about even in the pose, and ln(value + onset) is even in it
/// within a tenth.
const ONSET: f64 = 10.0;

/// The stiffness of a rigid tie in relation to mu h, what the tissue around a point resists with: a round of multipliers leaves
/// about 1e-4 of a gap.
const TIE_STIFFNESS: f64 = 1e4;

/// The gap that a rigid tie may have, in sizes of an element, and in relation to the residual that the balance may have:
/// what a residual leaves open is less.
const TIE_TOLERANCE: f64 = 1e-9;
const TIE_RESIDUAL: f64 = 1e-2;

/// All bones of a scene; their controls are added to those that there are.
pub(super) fn bones(scene: &Scene, controls: &mut Vec<Control>) -> Vec<Arc<Bone>> {
    let mut all = Vec::new();
    for spec in &scene.bones {
        let mut next = controls.len();
        let mut control = || {
            next += 1;
            next - 1
        };
        let hinge = spec.hinge.map(|hinge| Hinge {
            axis: normalised(hinge.axis),
            through: hinge.through_mm,
            control: control(),
        });
        let slide = spec.slide.map(|slide| Slide { direction: normalised(slide.direction), control: control() });
        controls.extend(ControlRange::of_bone(spec).into_iter().map(
            |ControlRange { name, lower, upper, .. }| {
                let onset = ONSET * (upper - lower);
                Control { name, lower, upper, onset }
            },
        ));
        all.push(Arc::new(Bone::new(&spec.name, hinge, slide)));
    }
    all
}

/// The bone of a name; the scene has checked that there is one.
pub(super) fn bone(bones: &[Arc<Bone>], name: &Option<String>) -> Option<Arc<Bone>> {
    let name = name.as_ref()?;
    bones.iter().find(|bone| bone.name() == name).cloned()
}

/// The terms of all attachments, each with its material point: springs and rigid ties, to space and to every bone.
/// `element_size` is in mm, the shear modulus of the tissue in kPa; `residual` is the tolerance of the solver.
pub(super) fn attachments(
    mesh: &Mesh,
    bones: &[Arc<Bone>],
    tied: &[(&AttachmentSpec, MaterialPoint)],
    element_size: f64,
    shear_modulus: f64,
    residual: f64,
) -> Vec<Box<dyn Term>> {
    let mut terms: Vec<Box<dyn Term>> = Vec::new();
    for body in std::iter::once(None).chain(bones.iter().map(Some)) {
        let name = body.map(|bone| bone.name());
        let own = || tied.iter().filter(|(spec, _)| spec.bone.as_deref() == name);
        let springs: Vec<(MaterialPoint, f64)> = own()
            .filter_map(|(spec, at)| match spec.tie {
                TieSpec::Spring { stiffness_mn_per_mm } => Some((*at, stiffness_mn_per_mm)),
                TieSpec::Rigid => None,
            })
            .collect();
        if !springs.is_empty() {
            let springs = Springs::attachments(mesh, &springs);
            terms.push(Box::new(match body {
                Some(bone) => springs.on(bone.clone()),
                None => springs,
            }));
        }
        let rigid: Vec<MaterialPoint> =
            own().filter(|(spec, _)| spec.tie == TieSpec::Rigid).map(|(_, at)| *at).collect();
        if !rigid.is_empty() {
            let stiffness = TIE_STIFFNESS * shear_modulus * element_size;
            let tolerance = TIE_TOLERANCE.max(TIE_RESIDUAL * residual) * element_size;
            terms.push(Box::new(RigidTies::new(mesh, &rigid, body.cloned(), stiffness, tolerance)));
        }
    }
    terms
}
