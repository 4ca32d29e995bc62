//! The whole fit, from axes to angles with their certainty.

use super::branches::unwrap;
use super::certainty::{at, certainty, errors, held_out};
use super::data::Axis;
use super::descent::Search;
use super::embed::{Outside, Samples, across, angles_of, chart, embed, from_frame, frame, in_frame, recharted};
use super::normal::{Angles, Corners, Pattern, smooth};
use super::smoothness::{Tried, choose};
use super::start::start;
use crate::error::{Error, Result, Warning};
use crate::math::tensor::Vector;
use crate::mesh::block::block;
use crate::mesh::cycled::cycled;
use crate::mesh::element::{Trilinear, ends};
use crate::mesh::exf::ExFile;
use crate::mesh::fibre_angles::{FibreAngles, axes};
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use crate::model::build::host;
use crate::scene::{
    AnglesSpec, ExfSpec, FibreBody, FibreProblem, GeometrySpec, LossSpec, SmoothnessSpec,
};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// The smoothness of the first search where it is chosen afterwards.
const FIRST: f64 = 1e-6;
/// The most steps of a search.
const MOST_STEPS: usize = 60;
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
    /// Standard deviation of the measurement along one direction on the sphere, radians, of an axis of weight 1.
    pub noise: f64,
    /// Gauss-Newton steps of all searches.
    pub steps: usize,
    /// Whether the last search converged.
    pub converged: bool,
    /// What is to be known about it.
    pub warnings: Vec<Warning>,
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

/// The mesh of a problem and the names of its nodes.
///
/// # Errors
/// An EX file that cannot be read.
pub fn mesh(body: &FibreBody) -> Result<(Mesh, Vec<i64>)> {
    let exf = |spec: &ExfSpec| -> Result<(Mesh, Vec<i64>)> {
        let geometry = ExFile::read(&spec.path)?.geometry(spec.field.as_deref())?;
        Ok((geometry.mesh, geometry.nodes))
    };
    let (mesh, names) = match body {
        FibreBody::Mesh(spec) => match &spec.geometry {
            GeometrySpec::Exf(spec) => exf(spec)?,
            GeometrySpec::Block(_) | GeometrySpec::Blocks(_) => (host(spec)?, Vec::new()),
        },
        FibreBody::Muscle(spec) => match &spec.geometry {
            GeometrySpec::Exf(spec) => exf(spec)?,
            GeometrySpec::Block(spec) => {
                (block(&Trilinear, spec.origin_mm, spec.size_mm, spec.elements), Vec::new())
            }
            // a muscle is one block: `blocks` is no key of it
            GeometrySpec::Blocks(_) => (Mesh::new(&Trilinear, Vec::new(), Vec::new()), Vec::new()),
        },
    };
    let names = if names.is_empty() { (0..mesh.nodes as i64).collect() } else { names };
    Ok((mesh, names))
}

/// A corner of an element for each node.
fn corner_of_nodes(mesh: &Mesh) -> Vec<Option<MaterialPoint>> {
    let mut found = vec![None; mesh.nodes];
    for (element, corners) in mesh.corners.iter().enumerate() {
        for (corner, node) in corners.iter().enumerate() {
            found[*node].get_or_insert(MaterialPoint { element, xi: ends(corner).map(|end| end as f64) });
        }
    }
    found
}

/// Fits the angles of a mesh, whose nodes have the names `names`, to axes.
///
/// # Errors
/// [`Error::NoAxes`] where no axis lies in the mesh; a fixed node that is not there; [`Error::FibreSystem`].
pub fn fit(problem: &FibreProblem, mesh: &Mesh, names: &[i64], data: &[Axis]) -> Result<FibreFit> {
    let (as_is, sheets, outside) = embed(&Locator::new(mesh), data, problem.outside);
    if as_is.all.is_empty() {
        let place = Box::new(problem.place.clone());
        return Err(Error::NoAxes { count: outside.count, distance: outside.distance, place });
    }
    // a field without B stays in the surfaces that its user means
    let shift = if problem.angles == AnglesSpec::A { 0 } else { chart(mesh, &as_is) };
    let renamed = cycled(mesh, shift);
    let samples = if shift == 0 { as_is } else { recharted(mesh, &renamed, &as_is, shift) };
    let sheets = if shift == 0 { sheets } else { recharted(mesh, &renamed, &sheets, shift) };
    let fixed = fixed_angles(problem, mesh, &renamed, names)?;
    let sought = problem.angles.count().min(2);

    let pattern = Pattern::new(mesh.nodes, &renamed.corners)?;
    let plain = Corners::plain(&renamed);
    let is_fixed: Vec<bool> = (0..mesh.nodes).map(|node| fixed.contains_key(&node)).collect();
    let pick = |k: [usize; 2]| -> BTreeMap<usize, [f64; 2]> {
        fixed.iter().map(|(node, angles)| (*node, [angles[k[0]], angles[k[1]]])).collect()
    };
    let main = Fitted::new(problem, &pattern, &samples, &plain, &is_fixed, pick([0, 1]), sought)?;
    let search = main.search(&pattern, &samples, &is_fixed, problem.loss);
    let sums = search.sums(&main.angles, |_| true);
    let lambda = search.lambda(main.smoothness);
    let noise = (sums.squares / (sums.count - main.freedom).max(1.0)).sqrt();
    let sure = certainty(&search, &sums, lambda, noise)?;
    let errors = errors(&search, &main.angles);
    let held_out = match problem.folds {
        0 => None,
        folds => Spread::of(&held_out(&search, &main.angles, &sums, lambda, folds)?),
    };

    // sheets: an angle in the plane across the fitted fibre, found in the same way
    let mut sheet = None;
    if problem.angles == AnglesSpec::ABG && !sheets.all.is_empty() {
        let usable = sheets.all.iter().filter(|one| main.corners.turns[one.element as usize].iter().all(|k| k % 2 == 0));
        let turned: Vec<_> = usable
            .filter_map(|one| {
                let [a, b] = at(&search, &main.angles, one);
                across(one, [a, b, 0.0])
            })
            .collect();
        let turned = Samples::new(turned, mesh.elements());
        if !turned.all.is_empty() {
            let plane = Fitted::new(problem, &pattern, &turned, &plain, &is_fixed, pick([2, 2]), 1)?;
            let search = plane.search(&pattern, &turned, &is_fixed, problem.loss);
            let sums = search.sums(&plane.angles, |_| true);
            let noise = (sums.squares / (sums.count - plane.freedom).max(1.0)).sqrt();
            let sure = certainty(&search, &sums, search.lambda(plane.smoothness), noise)?;
            let spread = Spread::of(&super::certainty::errors(&search, &plane.angles));
            sheet = Some((plane, sure, spread));
        }
    }

    let angles = fibre_angles(&main, sheet.as_ref().map(|sheet| &sheet.0));
    let corners = corner_of_nodes(&renamed);
    let nodes: Vec<NodeAngles> = (0..mesh.nodes)
        .map(|n| NodeAngles {
            name: names[n],
            position: corners[n].map_or([f64::NAN; 3], |at| renamed.position(at)),
            angles: angles.nodes[n],
            sd: [
                Some(sure.sd[0][n]),
                sure.sd.get(1).map(|sd| sd[n]),
                sheet.as_ref().map(|(_, sure, _)| sure.sd[0][n]),
            ],
            determined: sure.determined[n] && sheet.as_ref().is_none_or(|(_, sure, _)| sure.determined[n]),
            fixed: is_fixed[n],
        })
        .collect();
    let elements = (0..samples.elements()).filter_map(|element| {
        let spread = Spread::of(&errors[samples.starts[element]..samples.starts[element + 1]])?;
        Some(ElementErrors { element, spread })
    });
    let elements = elements.collect();
    let mut fit = FibreFit {
        chart: shift,
        nodes,
        outside,
        spread: Spread::of(&errors).unwrap_or(Spread { count: 0, rms: 0.0, median: 0.0, p95: 0.0, most: 0.0 }),
        elements,
        errors,
        held_out,
        sheets: sheet.as_ref().and_then(|(_, _, spread)| *spread),
        smoothness: main.smoothness,
        tried: main.tried.clone(),
        freedom: main.freedom,
        unknowns: sought * is_fixed.iter().filter(|fixed| !**fixed).count(),
        noise,
        steps: main.steps,
        converged: main.converged && sheet.as_ref().is_none_or(|(plane, _, _)| plane.converged),
        warnings: Vec::new(),
        mesh: renamed,
        angles,
        samples,
    };
    fit.warnings = warnings(&fit, problem);
    Ok(fit)
}

/// The angles of fixed nodes in the renamed mesh: the same axes.
fn fixed_angles(
    problem: &FibreProblem,
    mesh: &Mesh,
    renamed: &Mesh,
    names: &[i64],
) -> Result<BTreeMap<usize, [f64; 3]>> {
    let (corners, new_corners) = (corner_of_nodes(mesh), corner_of_nodes(renamed));
    let (mut fixed, mut mistakes) = (BTreeMap::new(), Vec::new());
    for spec in &problem.fixed {
        let node = names.iter().position(|name| *name == spec.node);
        let places = node.and_then(|node| Some((node, corners[node]?, new_corners[node]?)));
        let Some((node, old, new)) = places else {
            let (low, high) = (names.iter().min().copied().unwrap_or(0), names.iter().max().copied().unwrap_or(0));
            mistakes.push(Error::UnknownName {
                kind: "node",
                name: spec.node.to_string().into(),
                help: format!("the nodes of the mesh are numbered from {low} to {high}"),
                place: spec.place.clone(),
            });
            continue;
        };
        let given = spec.angles_deg.map(f64::to_radians);
        let angles = if std::ptr::eq(mesh, renamed) || mesh.corners == renamed.corners {
            given
        } else {
            // corners of the same element: the first that holds the node
            let [fibre, sheet, _] = axes(&mesh.jacobian(old), given);
            let frame = frame(&renamed.jacobian(new));
            angles_of(in_frame(&frame, fibre), Some(in_frame(&frame, sheet)))
        };
        fixed.insert(node, angles);
    }
    if mistakes.is_empty() { Ok(fixed) } else { Err(Error::all(mistakes)) }
}

/// A field that was found.
struct Fitted {
    angles: Angles,
    corners: Corners,
    sought: usize,
    smooth: Vec<Vec<f64>>,
    smoothness: f64,
    tried: Vec<Tried>,
    freedom: f64,
    steps: usize,
    converged: bool,
}

impl Fitted {
    fn new(
        problem: &FibreProblem,
        pattern: &Pattern,
        samples: &Samples,
        plain: &Corners,
        is_fixed: &[bool],
        fixed: BTreeMap<usize, [f64; 2]>,
        sought: usize,
    ) -> Result<Fitted> {
        let mut angles = start(pattern, samples, plain, sought)?;
        for (node, given) in &fixed {
            angles[*node] = *given;
        }
        let first = fixed.keys().next().copied().unwrap_or(0);
        let corners = unwrap(samples, plain, &mut angles, first);
        let smooth = smooth(pattern, &corners, sought);
        let (smoothness, chosen) = match problem.smoothness {
            SmoothnessSpec::Weight(weight) => (weight, true),
            SmoothnessSpec::Gcv => (FIRST, false),
        };
        let mut fitted = Fitted {
            angles,
            corners,
            sought,
            smooth,
            smoothness,
            tried: Vec::new(),
            freedom: 0.0,
            steps: 0,
            converged: false,
        };
        let search = fitted.search(pattern, samples, is_fixed, problem.loss);
        let mut angles = fitted.angles.clone();
        let mut end = search.descend(&mut angles, search.lambda(smoothness), MOST_STEPS)?;
        let mut steps = end.steps;
        let (mut smoothness, mut tried) = (smoothness, Vec::new());
        let mut near = None;
        // the choice is made for the problem as it is linear here: twice, as it moves what it depends on
        for _ in 0..if chosen { 0 } else { 2 } {
            let (best, all) = choose(&search, &angles, &end.sums, near)?;
            smoothness = best.smoothness;
            near = Some(smoothness);
            tried.extend(all);
            end = search.descend(&mut angles, search.lambda(smoothness), MOST_STEPS)?;
            steps += end.steps;
        }
        let trace = super::smoothness::Trace::new(&search, &end.sums);
        let freedom = trace.score(&search, &angles, &end.sums, smoothness)?.freedom;
        (fitted.angles, fitted.smoothness, fitted.freedom) = (angles, smoothness, freedom);
        (fitted.tried, fitted.steps, fitted.converged) = (tried, steps, end.converged);
        Ok(fitted)
    }

    fn search<'a>(
        &'a self,
        pattern: &'a Pattern,
        samples: &'a Samples,
        fixed: &'a [bool],
        loss: LossSpec,
    ) -> Search<'a> {
        let (corners, sought, smooth) = (&self.corners, self.sought, self.smooth.clone());
        Search { pattern, samples, corners, loss, sought, fixed, smooth }
    }
}

/// The angles of nodes, and of the elements with half turns of their own: there (A, B, G) is (A + k pi, (-1)^k B, (-1)^k G), and G
/// may have half turns too.
fn fibre_angles(main: &Fitted, sheet: Option<&Fitted>) -> FibreAngles {
    let g = |node: usize| sheet.map_or(0.0, |sheet| sheet.angles[node][0]);
    let nodes = main.angles.iter().enumerate().map(|(node, [a, b])| [*a, *b, g(node)]).collect();
    let mut own = BTreeMap::new();
    for (e, turns) in main.corners.turns.iter().enumerate() {
        let of_sheet = sheet.map_or([0; 8], |sheet| sheet.corners.turns[e]);
        if turns.iter().chain(&of_sheet).any(|k| *k != 0) {
            let local = main.corners.angles(e, &main.angles);
            let corner = |c: usize| {
                let turned = g(main.corners.nodes[e][c]) + PI * f64::from(of_sheet[c]);
                [local[c][0], local[c][1], main.corners.sign(e, c) * turned]
            };
            own.insert(e, std::array::from_fn(corner));
        }
    }
    FibreAngles { nodes, own }
}

fn warnings(fit: &FibreFit, problem: &FibreProblem) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |code, message: String, help: &str| {
        let (place, help) = (Some(problem.place.clone()), Some(help.into()));
        warnings.push(Warning { code, message, place, help });
    };
    if !fit.converged {
        let message = format!("the fit of the fibre angles did not settle in {} steps", fit.steps);
        warn("F006", message, "its last angles are written; a greater smoothness, or a robust loss with a greater scale, settles sooner");
    }
    let Outside { count, projected, distance: [nearest, farthest] } = fit.outside;
    if count > 0 {
        let message = format!(
            "{count} measured axes lie outside the mesh, {nearest:.3} to {farthest:.3} mm from it; {projected} of them are used"
        );
        warn("K006", message, "write outside = { project_mm = .. } in [fibres] to use those that are nearer than that");
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
        let message = format!("at {pole} nodes the fibre runs within 10 degrees of f3, where the angle A means little");
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
pub fn measured(mesh: &Mesh, sample: &super::embed::Sample) -> (Vector, Vector) {
    let at = MaterialPoint { element: sample.element as usize, xi: sample.xi };
    (mesh.position(at), from_frame(&frame(&mesh.jacobian(at)), sample.axis))
}
