//! The search of one field of angles: start, descent, choice of the smoothness.

use super::branches::unwrap;
use super::descent::{Descent, Search};
use super::embed::Samples;
use super::pattern::Pattern;
use super::roughness::Roughness;
use super::smoothness::{Trace, Tried, choose};
use super::space::{Angles, Space};
use super::start::start;
use crate::error::{Error, Result};
use crate::mesh::Mesh;
use crate::scene::{FibreProblem, FieldSpec, SmoothnessSpec};
use std::collections::BTreeMap;

/// The smoothness of the first search where it is chosen afterwards.
const FIRST: f64 = 1e-3;
/// The smoothness of the tensors of the start, and of the second start where data are sparse.
const STARTS: [f64; 2] = [1e-3, 1e-1];
/// The searches before the first where data are sparse.
const SMOOTHER: [f64; 2] = [1e-2, 1e-4];
/// Fewer axes per element than this are sparse.
const SPARSE: usize = 30;
/// The most steps of a search.
const MOST_STEPS: usize = 60;

/// What the searches in one mesh share.
pub(super) struct Ground<'a> {
    pub problem: &'a FibreProblem,
    /// Where the start is sought: trilinear.
    nodal: (Space, Pattern),
    /// Where angles are sought, without half turns.
    space: Space,
    pub pattern: Pattern,
    /// Parameters that do not change.
    pub fixed: Vec<bool>,
}

impl<'a> Ground<'a> {
    /// Of a mesh in which the nodes that `is_fixed` tells keep their values.
    pub fn new(problem: &'a FibreProblem, mesh: &Mesh, is_fixed: &[bool]) -> Result<Ground<'a>> {
        let nodal = Space::new(FieldSpec::Trilinear, mesh, &problem.place)?;
        let space = Space::new(problem.field, mesh, &problem.place)?;
        let pattern = Pattern::new(&space)?;
        let mut fixed = vec![false; space.parameters];
        space.values.iter().zip(is_fixed).for_each(|(value, is_fixed)| fixed[*value] = *is_fixed);
        Ok(Ground { problem, nodal: (nodal.clone(), Pattern::new(&nodal)?), space, pattern, fixed })
    }
}

/// A field that was found.
pub(super) struct Fitted {
    pub angles: Angles,
    pub space: Space,
    pub sought: usize,
    roughness: Roughness,
    pub smoothness: f64,
    pub tried: Vec<Tried>,
    pub freedom: f64,
    pub steps: usize,
    pub converged: bool,
}

impl Fitted {
    /// Of the first `sought` angles; nodes in `fixed` have these values.
    pub fn new(
        ground: &Ground,
        samples: &Samples,
        fixed: &BTreeMap<usize, [f64; 2]>,
        sought: usize,
    ) -> Result<Fitted> {
        let (smoothness, chosen) = match ground.problem.smoothness {
            SmoothnessSpec::Weight(weight) => (weight, true),
            SmoothnessSpec::Gcv => (FIRST, false),
        };
        let first = fixed.keys().next().copied().unwrap_or(0);
        let (nodal, pattern) = &ground.nodal;
        let begun = |smoothness: f64, unwraps: bool| -> Result<(Angles, Vec<[i32; 8]>)> {
            let mut angles = start(pattern, samples, nodal, sought, smoothness)?;
            fixed.iter().for_each(|(node, given)| angles[*node] = *given);
            let turns = if unwraps { unwrap(samples, &nodal.nodes, &mut angles, first) } else { nodal.turns.clone() };
            Ok((angles, turns))
        };
        let mut starts = vec![begun(STARTS[0], true)?];
        let mut smoothnesses = vec![smoothness];
        if samples.all.len() < SPARSE * samples.elements() {
            // few data leave several valleys: go down from the smooth end, and from several places
            smoothnesses = SMOOTHER.into_iter().filter(|smoother| *smoother > smoothness).collect();
            smoothnesses.push(smoothness);
            starts.push(begun(STARTS[0], false)?);
            starts.push(begun(STARTS[1], true)?);
            starts.push(begun(STARTS[1], false)?);
            starts.dedup();
        }
        let mut best: Option<(f64, Fitted, Descent)> = None;
        for (nodes, turns) in starts {
            let space = ground.space.turned(turns);
            let roughness = Roughness::new(&space, &ground.pattern, sought);
            let mut angles = space.lifted(&nodes);
            let mut fitted = Fitted {
                angles: Vec::new(),
                space,
                sought,
                roughness,
                smoothness,
                tried: Vec::new(),
                freedom: 0.0,
                steps: 0,
                converged: false,
            };
            let search = fitted.search(ground, samples);
            let (mut steps, mut end) = (0, None);
            for smoothness in &smoothnesses {
                let descent = search.descend(&mut angles, search.lambda(*smoothness), MOST_STEPS)?;
                steps += descent.steps;
                end = Some(descent);
            }
            let Some(end) = end else { continue };
            let value = search.value(&angles, &end.sums, search.lambda(smoothness));
            (fitted.angles, fitted.steps) = (angles, steps);
            if best.as_ref().is_none_or(|(least, _, _)| value < *least) {
                best = Some((value, fitted, end));
            }
        }
        let Some((_, mut fitted, mut end)) = best else {
            return Err(Error::FibreSystem { message: "a value is not a number".into() });
        };
        let mut angles = std::mem::take(&mut fitted.angles);
        let search = fitted.search(ground, samples);
        let mut steps = fitted.steps;
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
        let trace = Trace::new(&search, &end.sums);
        let freedom = trace.score(&search, &angles, &end.sums, smoothness)?.freedom;
        (fitted.angles, fitted.smoothness, fitted.freedom) = (angles, smoothness, freedom);
        (fitted.tried, fitted.steps, fitted.converged) = (tried, steps, end.converged);
        Ok(fitted)
    }

    /// The search that found it.
    pub fn search<'f>(&'f self, ground: &'f Ground, samples: &'f Samples) -> Search<'f> {
        Search {
            pattern: &ground.pattern,
            samples,
            space: &self.space,
            loss: ground.problem.loss,
            sought: self.sought,
            fixed: &ground.fixed,
            roughness: &self.roughness,
        }
    }
}
