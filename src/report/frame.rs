//! What the rows and files of a frame are made from: its number and time, points that are followed, markers with their
//! measurement, muscles with their stretch.

use crate::math::tensor::{Vector, add_scaled, norm, subtract};
use crate::mesh::MaterialPoint;
use crate::model::{Evaluation, Model, State};
use crate::term::contact::ContactPoint;
use crate::term::contact::law::Allows;

/// A frame of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Its number, from 0; of a fit, its number in the recording.
    pub index: usize,
    /// Its time, s.
    pub time_s: f64,
}

/// A material point that is followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// Its name.
    pub name: String,
    /// Where it lies in the host.
    pub at: MaterialPoint,
}

/// A probe at a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeState<'a> {
    /// Its name.
    pub name: &'a str,
    /// Current position, mm.
    pub position: Vector,
    /// Displacement, mm.
    pub displacement: Vector,
}

/// A marker of the model beside its measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerPair<'a> {
    /// Its name.
    pub name: &'a str,
    /// Where the model has it, mm.
    pub model: Vector,
    /// Where it was measured, mm, in the coordinates of the model; `None` where it was lost.
    pub measured: Option<Vector>,
}

impl MarkerPair<'_> {
    /// Measured minus model, mm.
    pub fn residual(&self) -> Option<Vector> {
        self.measured.map(|measured| subtract(measured, self.model))
    }

    /// Length of the residual, mm.
    pub fn distance(&self) -> Option<f64> {
        self.residual().map(norm)
    }
}

/// A marker that a robust loss sets aside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its distance from the model, mm.
    pub distance_mm: f64,
    /// The same in its standard deviations.
    pub distance_sds: f64,
    /// How much it still counts in relation to a marker nearby.
    pub weight: f64,
}

/// Estimated errors of the mesh in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshError {
    /// What the points are: `probe` or `marker`.
    pub kind: &'static str,
    /// The largest error at a corner of a halved element, mm.
    pub largest_mm: f64,
    /// Of every point its name and error, mm.
    pub points: Vec<(String, f64)>,
    /// Of every control that was fitted its name and what it is too great by: see [`bias`](crate::fit::bias::bias).
    pub biases: Vec<(String, Option<f64>)>,
}

/// A muscle at a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MuscleState<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its activation.
    pub activation: f64,
    /// Mean fibre stretch lambda = |F n0|, weighted by reference volume.
    pub mean_stretch: f64,
    /// Smallest stretch at a quadrature point.
    pub min_stretch: f64,
    /// Largest stretch at a quadrature point.
    pub max_stretch: f64,
    /// Quadrature points on the descending limb: see [`Model::descending_fibres`].
    pub descending_points: usize,
    /// Energy, uJ.
    pub energy: f64,
}

/// A bone at a state. Forces are those of the bone on the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoneState<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its angle, degrees; `None` without a hinge.
    pub hinge_deg: Option<f64>,
    /// Its way, mm; `None` without a slide.
    pub slide_mm: Option<f64>,
    /// Torque about the hinge where it is now, mN mm: the work per radian.
    pub torque: Option<f64>,
    /// Force along the slide, mN: the work per mm.
    pub slide_force: Option<f64>,
    /// The whole force, mN.
    pub force: Vector,
}

/// A sliding or contact at a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactState<'a> {
    /// Its name.
    pub name: &'a str,
    /// Reference area that is pressed or held, mm2; of two faces that meet, of the first.
    pub area: f64,
    /// Mean pressure over that area, kPa per reference area; negative where the face is held back. 0 without contact.
    pub mean_pressure: f64,
    /// Largest pressure, kPa.
    pub max_pressure: f64,
    /// Largest penetration, of a sliding the largest gap to either side, mm.
    pub penetration: f64,
    /// Force of the surface on the body, mN; of two faces that meet, of the second on the first.
    pub force: Vector,
}

/// Probes at a state, in their order.
pub fn probe_states<'a>(probes: &'a [Probe], model: &Model, state: &State) -> Vec<ProbeState<'a>> {
    let x = model.current(state);
    let at = |probe: &'a Probe| ProbeState {
        name: &probe.name,
        position: model.mesh().interpolate(probe.at, &x),
        displacement: model.mesh().interpolate(probe.at, &state.u),
    };
    probes.iter().map(at).collect()
}

/// All muscles of a model at a state, in the order of its terms.
pub fn muscle_states<'m>(model: &'m Model, state: &State, evaluation: &Evaluation) -> Vec<MuscleState<'m>> {
    let x = model.current(state);
    let descending = model.descending_fibres(state);
    let muscle_state = |(term, muscle): (usize, &'m crate::term::muscle::Muscle)| {
        let (mut sum, mut min, mut max) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
        for in_element in muscle.points().chunk_by(|a, b| a.host.element == b.host.element) {
            let local = model.mesh().local_of(in_element[0].host.element, &x);
            for point in in_element {
                let stretch = norm(point.deformed_fibre(&local));
                sum += point.weight * stretch;
                min = stretch.min(min);
                max = stretch.max(max);
            }
        }
        MuscleState {
            name: model.terms()[term].name(),
            activation: muscle.mean_activation(&state.controls),
            mean_stretch: sum / muscle.volume(),
            min_stretch: min,
            max_stretch: max,
            descending_points: descending.iter().find(|found| found.term == term).map_or(0, |found| found.points),
            energy: evaluation.energies[term],
        }
    };
    model.muscles().map(muscle_state).collect()
}

/// The bones of a model at a state, in the order of their controls.
pub fn bone_states<'m>(model: &'m Model, state: &State, evaluation: &Evaluation) -> Vec<BoneState<'m>> {
    let controls = &state.controls;
    let bone_state = |bone: &'m std::sync::Arc<crate::term::bone::Bone>| {
        let wrench = model.wrench(bone, state, &evaluation.force);
        let power = |control: usize| bone.twist(control, controls).map(|twist| wrench.power(&twist));
        BoneState {
            name: bone.name(),
            hinge_deg: bone.hinge().map(|hinge| controls[hinge.control]),
            slide_mm: bone.slide().map(|slide| controls[slide.control]),
            // per degree to per radian
            torque: bone.hinge().and_then(|hinge| power(hinge.control)).map(f64::to_degrees),
            slide_force: bone.slide().and_then(|slide| power(slide.control)),
            force: wrench.force,
        }
    };
    model.bones().iter().map(bone_state).collect()
}

/// The quadrature points of all slidings and contacts of a model at a state, in the order of its terms.
pub fn contact_points(model: &Model, state: &State) -> Vec<Vec<ContactPoint>> {
    model.contacts().map(|(term, _)| model.contact_points(state, term)).collect()
}

/// All slidings and contacts of a model at a state, in the order of its terms.
pub fn contact_states<'m>(model: &'m Model, state: &State) -> Vec<ContactState<'m>> {
    contact_sums(model, &contact_points(model, state))
}

/// The same from their points, which take longer to find than to add up.
pub fn contact_sums<'m>(model: &'m Model, points: &[Vec<ContactPoint>]) -> Vec<ContactState<'m>> {
    let contact_state = |((term, allows), points): ((usize, Allows), &Vec<ContactPoint>)| {
        let mut sum = ContactState {
            name: model.terms()[term].name(),
            area: 0.0,
            mean_pressure: 0.0,
            max_pressure: 0.0,
            penetration: 0.0,
            force: [0.0; 3],
        };
        for point in points {
            let gap = point.gap.unwrap_or(0.0);
            let wrong = if allows == Allows::Closed { gap.abs() } else { -gap };
            sum.penetration = sum.penetration.max(wrong);
            if !point.counted {
                continue;
            }
            if point.pressure != 0.0 {
                sum.area += point.area;
            }
            sum.mean_pressure += point.pressure * point.area;
            sum.max_pressure = sum.max_pressure.max(point.pressure);
            sum.force = add_scaled(sum.force, point.pressure * point.area, point.normal);
        }
        // per area in contact
        sum.mean_pressure /= if sum.area > 0.0 { sum.area } else { 1.0 };
        sum
    };
    model.contacts().zip(points).map(contact_state).collect()
}
