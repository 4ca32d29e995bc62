//! The whole fit, from axes to angles with their certainty.

use super::certainty::{certainty, errors, held_out};
use super::data::Axis;
use super::embed::{Outside, Samples, across, angles_of, chart, embed, frame, in_frame, recharted};
use super::fitted::{Fitted, Ground};
use super::outcome::{ElementErrors, FibreFit, NodeAngles, Spread, warnings};
use crate::error::{Error, Result, Warning};
use crate::mesh::cycled::cycled;
use crate::mesh::element::ends;
use crate::mesh::exf::ExFile;
use crate::mesh::fibre_angles::{FibreAngles, axes};
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use crate::model::build::{host, muscle_mesh};
use crate::scene::{AnglesSpec, FibreBody, FibreProblem, FieldSpec, GeometrySpec};
use std::collections::BTreeMap;
use std::time::Instant;

/// The mesh of a problem, the names of its nodes, and the warning where the mesh can only come close to what its file
/// holds.
///
/// # Errors
/// An EX file that cannot be read.
pub fn mesh(body: &FibreBody) -> Result<(Mesh, Vec<i64>, Option<Warning>)> {
    let (geometry, place) = match body {
        FibreBody::Mesh(spec) => (&spec.geometry, &spec.place),
        FibreBody::Muscle { muscle, .. } => (&muscle.geometry, &muscle.place),
    };
    let (mesh, names, warning) = match (geometry, body) {
        // of any element, with the names of its nodes
        (GeometrySpec::Exf(spec), _) => {
            let geometry = ExFile::read(&spec.path)?.geometry(spec.field.as_deref())?;
            let warning = geometry.warning(place);
            (geometry.mesh, geometry.nodes, warning)
        }
        (_, FibreBody::Mesh(spec)) => (host(spec)?, Vec::new(), None),
        (_, FibreBody::Muscle { muscle, .. }) => (muscle_mesh(muscle)?.0, Vec::new(), None),
    };
    let names = if names.is_empty() { (0..mesh.nodes as i64).collect() } else { names };
    Ok((mesh, names, warning))
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

/// Where the axes lie in a mesh: in the first list the fibres, in the second the sheets.
///
/// # Errors
/// [`Error::NoAxes`] where none lies in the mesh.
pub fn place(problem: &FibreProblem, mesh: &Mesh, data: &[Axis]) -> Result<(Samples, Samples, Outside)> {
    let placed = embed(&Locator::new(mesh), data, problem.outside);
    if placed.0.all.is_empty() {
        let Outside { count, distance, .. } = placed.2;
        return Err(Error::NoAxes { count, distance, place: Box::new(problem.place.clone()) });
    }
    Ok(placed)
}

/// Fits the angles of a mesh, whose nodes have the names `names`, to axes.
///
/// # Errors
/// [`Error::NoAxes`] where no axis lies in the mesh; a fixed node that is not there; [`Error::FibreSystem`].
pub fn fit(problem: &FibreProblem, mesh: &Mesh, names: &[i64], data: &[Axis]) -> Result<FibreFit> {
    let mut clock = Clock::start();
    let (as_is, sheets, outside) = place(problem, mesh, data)?;
    // a field without B stays in the surfaces that its user means
    let shift = if problem.angles == AnglesSpec::A { 0 } else { chart(mesh, &as_is) };
    let renamed = cycled(mesh, shift);
    let samples = if shift == 0 { as_is } else { recharted(mesh, &renamed, &as_is, shift) };
    let sheets = if shift == 0 { sheets } else { recharted(mesh, &renamed, &sheets, shift) };
    let fixed = fixed_angles(problem, mesh, &renamed, names)?;
    let sought = problem.angles.count().min(2);

    let is_fixed: Vec<bool> = (0..mesh.nodes).map(|node| fixed.contains_key(&node)).collect();
    let pick = |k: [usize; 2]| -> BTreeMap<usize, [f64; 2]> {
        fixed.iter().map(|(node, angles)| (*node, [angles[k[0]], angles[k[1]]])).collect()
    };
    clock.lap("find the axes in the mesh");
    let ground = Ground::new(problem, &renamed, &is_fixed)?;
    let main = Fitted::new(&ground, &samples, &pick([0, 1]), sought)?;
    clock.lap("search the angles and the smoothness");
    let search = main.search(&ground, &samples);
    let sums = search.sums(&main.angles, |_| true);
    let lambda = search.lambda(main.smoothness);
    let noise = sums.noise(main.freedom);
    let sure = certainty(&search, &sums, lambda, noise)?;
    let errors = errors(&search, &main.angles, |_| true);
    clock.lap("standard deviations and errors");
    let held_out = match problem.folds {
        0 => None,
        folds => Spread::of(&held_out(&search, &main.angles, &sums, lambda, folds)?),
    };

    clock.lap("errors of what is held out");

    // sheets: an angle in the plane across the fitted fibre, found in the same way
    let mut sheet = None;
    if problem.angles == AnglesSpec::ABG && !sheets.all.is_empty() {
        let usable =
            sheets.all.iter().filter(|one| main.space.turns[one.element as usize].iter().all(|k| k % 2 == 0));
        let turned: Vec<_> = usable
            .filter_map(|one| {
                let local = main.space.local(one.element as usize, &main.angles);
                let [a, b] = main.space.at(&local, one.xi);
                across(one, [a, b, 0.0])
            })
            .collect();
        let turned = Samples::new(turned, mesh.elements());
        if !turned.all.is_empty() {
            let plane = Fitted::new(&ground, &turned, &pick([2, 2]), 1)?;
            let search = plane.search(&ground, &turned);
            let sums = search.sums(&plane.angles, |_| true);
            let noise = sums.noise(plane.freedom);
            let sure = certainty(&search, &sums, search.lambda(plane.smoothness), noise)?;
            let spread = Spread::of(&super::certainty::errors(&search, &plane.angles, |_| true));
            sheet = Some((plane, sure, spread));
        }
        clock.lap("sheets");
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
        unknowns: sought * ground.fixed.iter().filter(|fixed| !**fixed).count(),
        noise,
        steps: main.steps,
        converged: main.converged && sheet.as_ref().is_none_or(|(plane, _, _)| plane.converged),
        warnings: Vec::new(),
        stages: clock.laps,
        mesh: renamed,
        angles,
        samples,
    };
    fit.warnings = warnings(&fit, problem);
    Ok(fit)
}

/// What the parts of a fit take.
struct Clock {
    last: Instant,
    laps: Vec<(&'static str, f64)>,
}

impl Clock {
    fn start() -> Clock {
        Clock { last: Instant::now(), laps: Vec::new() }
    }

    /// A part is done.
    fn lap(&mut self, what: &'static str) {
        self.laps.push((what, self.last.elapsed().as_secs_f64()));
        self.last = Instant::now();
    }
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
        // a node with several versions of its position is several nodes of the mesh
        let named = (0..names.len()).filter(|node| names[*node] == spec.node);
        let places: Vec<_> = named.filter_map(|node| Some((node, corners[node]?, new_corners[node]?))).collect();
        if places.is_empty() {
            let (low, high) = (names.iter().min().copied().unwrap_or(0), names.iter().max().copied().unwrap_or(0));
            mistakes.push(Error::UnknownName {
                kind: "node",
                name: spec.node.to_string(),
                help: format!("the nodes of the mesh are numbered from {low} to {high}"),
                place: spec.place.clone(),
            });
            continue;
        }
        let given = spec.angles_deg.map(f64::to_radians);
        for (node, old, new) in places {
            let angles = if mesh.corners == renamed.corners {
                given
            } else {
                // corners of the same element: the first that holds the node
                let [fibre, sheet, _] = axes(&mesh.jacobian(old), given);
                let frame = frame(&renamed.jacobian(new));
                angles_of(in_frame(&frame, fibre), Some(in_frame(&frame, sheet)))
            };
            fixed.insert(node, angles);
        }
    }
    if mistakes.is_empty() { Ok(fixed) } else { Err(Error::all(mistakes)) }
}

/// The angles of nodes and elements. Where corners have half turns of their own (A, B, G) is (A + k pi, (-1)^k B, (-1)^k G), and G
/// may have half turns too.
fn fibre_angles(main: &Fitted, sheet: Option<&Fitted>) -> FibreAngles {
    let space = &main.space;
    let g = |parameter: usize| sheet.map_or(0.0, |sheet| sheet.angles[parameter][0]);
    let triple = |parameter: &usize| {
        let [a, b] = main.angles[*parameter];
        [a, b, g(*parameter)]
    };
    let local = |e: usize| -> [[f64; 3]; 64] {
        let (fibre, plane) = (space.local(e, &main.angles), sheet.map(|sheet| sheet.space.local(e, &sheet.angles)));
        std::array::from_fn(|a| {
            let g = plane.map_or(0.0, |plane| plane[a][0]);
            [fibre[a][0], fibre[a][1], if a < space.functions() { space.sign(e, a, 1) * g } else { 0.0 }]
        })
    };
    let per_node = space.functions() / 8;
    let mut own = BTreeMap::new();
    for (e, turns) in space.turns.iter().enumerate() {
        let of_sheet = sheet.map_or([0; 8], |sheet| sheet.space.turns[e]);
        if turns.iter().chain(&of_sheet).any(|k| *k != 0) {
            let local = local(e);
            own.insert(e, std::array::from_fn(|corner| local[per_node * corner]));
        }
    }
    let tricubic = (space.field == FieldSpec::Tricubic).then(|| (0..space.elements()).map(local).collect());
    FibreAngles { nodes: space.values.iter().map(triple).collect(), own, tricubic }
}
