//! What a fit of fibre angles found.

use super::embed::{Outside, Sample, Samples, frame, from_frame};
use super::smoothness::Tried;
use crate::error::Warning;
use crate::math::tensor::Vector;
use crate::mesh::fibre_angles::FibreAngles;
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::FibreProblem;
use std::f64::consts::PI;

/// Nodes whose fibre is so near to f3 have no certain angle A: |B| above 80 degrees.
const NEAR_POLE: f64 = 80.0 / 180.0 * PI;

/// A fitted field of fibre angles.
#[derive(Debug, Clone)]
pub struct FibreFit {
    /// The mesh of the angles: that of the problem, its local directions renamed by `chart`.
    pub mesh: Mesh,
    /// Direction d of the mesh is direction (d + chart) mod 3 of the problem's.
    pub chart: usize,
    /// The angles.
    pub angles: FibreAngles,
    /// Per node.
    pub nodes: Vec<NodeAngles>,
    /// What became of points outside the mesh.
    pub outside: Outside,
    /// Per used axis, in the order of `samples`: the angle to the fitted fibre, radians.
    pub errors: Vec<f64>,
    /// The used axes.
    pub samples: Samples,
    /// Their errors.
    pub spread: Spread,
    /// Per element that has data.
    pub elements: Vec<ElementErrors>,
    /// Errors of axes against fits without them.
    pub held_out: Option<Spread>,
    /// Errors of sheet axes, where G was sought.
    pub sheets: Option<Spread>,
    /// The smoothness that was used, as in the problem file.
    pub smoothness: f64,
    /// What was tried, if it was chosen.
    pub tried: Vec<Tried>,
    /// Numbers that the data determine, of `unknowns`.
    pub freedom: f64,
    /// Angles that were sought.
    pub unknowns: usize,
    /// Standard deviation of the measurement along one direction on the sphere, radians, of an axis of weight 1; see
    /// [`super::normal::Sums::noise`] for robust losses.
    pub noise: f64,
    /// Gauss-Newton steps of all searches.
    pub steps: usize,
    /// Whether the last search converged.
    pub converged: bool,
    /// What is to be known about it.
    pub warnings: Vec<Warning>,
    /// What its parts took, s, in their order.
    pub stages: Vec<(&'static str, f64)>,
}

/// The fitted angles of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeAngles {
    /// Its number in the problem: from 0 in a block, the identifier in an EX file.
    pub name: i64,
    /// mm.
    pub position: Vector,
    /// A, B, G, radians.
    pub angles: [f64; 3],
    /// Their standard deviations in the fit with its smoothness, radians; `None` for those that were not sought.
    pub sd: [Option<f64>; 3],
    /// Whether the data determine them.
    pub determined: bool,
    /// Whether they were given.
    pub fixed: bool,
}

/// Angular errors in short, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// Root mean square.
    pub rms: f64,
    /// Half of them are smaller.
    pub median: f64,
    /// 95 of 100 are smaller.
    pub p95: f64,
    /// The greatest.
    pub most: f64,
}

/// The errors in one element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementErrors {
    /// Its index.
    pub element: usize,
    /// The errors there.
    pub spread: Spread,
}

impl Spread {
    /// Of some errors; `None` of none.
    pub fn of(errors: &[f64]) -> Option<Spread> {
        let count = errors.len();
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let part = |part: f64| sorted[((count as f64 * part).ceil() as usize).clamp(1, count) - 1];
        (count > 0).then(|| Spread {
            count,
            rms: (sorted.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt(),
            median: part(0.5),
            p95: part(0.95),
            most: sorted[count - 1],
        })
    }
}

/// What is to be known about a fit.
pub(super) fn warnings(fit: &FibreFit, problem: &FibreProblem) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |code, message: String, help: &str| {
        let (place, help) = (Some(problem.place.clone()), Some(help.into()));
        warnings.push(Warning { code, message, place, help });
    };
    if !fit.converged {
        let message = format!("the fit of the fibre angles did not settle in {} steps", fit.steps);
        warn(
            "F006",
            message,
            "its last angles are written; a greater smoothness, or a robust loss with a greater scale, settles sooner",
        );
    }
    let Outside { count, projected, distance: [nearest, farthest] } = fit.outside;
    if count > 0 {
        let message = format!(
            "{count} measured axes lie outside the mesh, {nearest:.3} to {farthest:.3} mm from it; {projected} of them are used"
        );
        warn(
            "K006",
            message,
            "write outside = { project_mm = .. } in [fibres] to use those that are nearer than that",
        );
    }
    let undetermined = fit.nodes.iter().filter(|node| !node.determined).count();
    if undetermined > 0 {
        let message = format!(
            "the data do not determine the angles of {undetermined} of {} nodes: what stands there continues their neighbours",
            fit.nodes.len()
        );
        warn("F007", message, "see the column `determined` of tables/fibre_angles.csv");
    }
    let pole = fit.nodes.iter().filter(|node| node.determined && node.angles[1].abs() > NEAR_POLE).count();
    if pole > 0 {
        let message =
            format!("at {pole} nodes the fibre runs within 10 degrees of f3, where the angle A means little");
        warn("F008", message, "give the mesh another third direction, or divide it");
    }
    if !fit.angles.own.is_empty() {
        let message = format!(
            "{} elements have angles of their own at some corners: on a way about them the fibre turns by half turns",
            fit.angles.own.len()
        );
        warn("F009", message, "use the EX file: a list of angles per node cannot say this");
    }
    warnings
}

/// A measured axis in space, from its sample.
pub fn measured(mesh: &Mesh, sample: &Sample) -> (Vector, Vector) {
    let at = MaterialPoint { element: sample.element as usize, xi: sample.xi };
    (mesh.position(at), from_frame(&frame(&mesh.jacobian(at)), sample.axis))
}
