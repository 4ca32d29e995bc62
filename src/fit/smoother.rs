//! A clip as a whole: all its frames at once, tied by the smoothness of the controls.
//!
//!   minimise over all q_t:  sum over t of the objective of frame t + sum over links w/2 |sum c a_t|^2
//!
//! Gauss-Newton with bounds and a trust region. The second derivative is a chain of blocks, one per frame (of two frames where
//! the second difference counts): each sweep is one sparse quadratic program in a box and one equilibrium with sensitivities
//! per frame. Elimination of the chain from both ends gives what all frames together say of each ([`BlockTridiagonal`]).
//! A frame that has failed has no markers here: smoothness bridges it.

mod heads;

use super::bounded_step::bounded_step_in_chain;
use super::covariance::{Bound, standard_deviations};
use super::estimate::{Estimate, FitIteration, Optimum};
use super::frame::{Aims, FrameProblem, Measured};
use super::gauss_newton::Length;
use super::objective::Sum;
use super::objective::smoothness::Link;
use super::observed::own_error;
use super::sensitivity::Reuse;
use super::sequence::{Fit, held_at};
use crate::error::{Error, Result};
use crate::forward::{Drive, Equilibrium};
use crate::markers::Recording;
use crate::math::block_tridiagonal::BlockTridiagonal;
use argmin::core::{Jacobian, Operator};
use nalgebra::DMatrix;

/// First trust region: change of a control in parts of (its value + its onset).
const FIRST_TRUST: f64 = 1.0;
/// A step must bring at least this part of what the model promises.
const SUFFICIENT: f64 = 1e-4;
/// The trust region is not shrunk below this.
const SMALLEST_TRUST: f64 = 1e-8;
/// Part of the largest curvature that holds controls still which nothing sees.
const STILL: f64 = 1e-11;

/// A clip that was smoothed.
pub struct Smoothed {
    /// Of every frame its estimate; an error where a frame that had failed has no equilibrium at the controls that bridge it.
    pub frames: Vec<Result<Estimate>>,
    /// Gauss-Newton sweeps over the clip.
    pub sweeps: Vec<FitIteration>,
}

/// A frame on the way.
struct Node {
    frame: usize,
    time_s: f64,
    /// Controls in parts of their ranges.
    a: Vec<f64>,
    measured: Vec<Measured>,
    measured_mm: Vec<Option<[f64; 3]>>,
    /// The equilibrium, residuals and their derivative by the controls in their units; `None` for a frame that is bridged.
    at: Option<At>,
}

struct At {
    equilibrium: Equilibrium,
    residuals: Vec<f64>,
    jacobian: DMatrix<f64>,
    /// The derivative with the head held, where that is free.
    held_head: Option<DMatrix<f64>>,
}

impl<'m> Fit<'m> {
    /// Smooths a clip that was fitted frame by frame; `None` in `fitted` for a frame that failed. `stop` is asked between
    /// sweeps: `None` comes back where it says so.
    ///
    /// # Errors
    /// [`Error::FitNotConverged`]; [`Error::NoMarkersInFrame`] where no frame was fitted.
    pub fn smooth(
        &mut self,
        recording: &Recording,
        frames: &[usize],
        fitted: &[Option<Estimate>],
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Smoothed>> {
        let mut nodes = self.nodes(recording, frames, fitted)?;
        let times: Vec<f64> = nodes.iter().map(|node| node.time_s).collect();
        let links = self.objectives.smoothness.as_ref().map_or_else(Vec::new, |smoothness| smoothness.links(&times));
        let per_block = if links.iter().any(|link| link.frames.len() > 2) { 2 } else { 1 };
        let chain = Chain { frames: nodes.len(), controls: self.unknowns.len(), per_block };
        let onsets: Vec<f64> = {
            let sizes = self.objectives.sizes();
            self.unknowns.iter().zip(sizes).map(|(k, size)| self.controls()[*k].onset / size).collect()
        };
        let mut cost = self.cost(&nodes, &links);
        let (mut trust, mut rejected, mut sweeps, mut before) = (FIRST_TRUST, 0_u64, Vec::new(), None);
        let (mut gradient, mut hessian) = self.model(&nodes, &links, &chain);
        loop {
            if stop() {
                return Ok(None);
            }
            let a: Vec<f64> = nodes.iter().flat_map(|node| node.a.clone()).collect();
            let radius = |i: usize| trust * (a[i] + onsets[i % chain.controls]);
            let lower: Vec<f64> = (0..a.len()).map(|i| (-a[i]).max(-radius(i))).collect();
            let upper: Vec<f64> = (0..a.len()).map(|i| (1.0 - a[i]).min(radius(i))).collect();
            let d = bounded_step_in_chain(&hessian, &gradient, &lower, &upper)?;
            let step = d.iter().map(|d| d.abs()).fold(0.0, f64::max);
            let curved: f64 = hessian.times(&d).iter().zip(&d).map(|(h, d)| h * d).sum();
            let residuals: usize = nodes.iter().filter_map(|node| Some(node.at.as_ref()?.residuals.len())).sum();
            let promised = -(gradient.iter().zip(&d).map(|(g, d)| g * d).sum::<f64>() + 0.5 * curved);
            let (surplus, cut) =
                (residuals.saturating_sub(a.len()), (0..d.len()).any(|i| d[i].abs() > 0.99 * radius(i)));
            let length = Length { change: step, promised, cost, surplus, cut };
            let (left, sds) = self.tolerance.left(length, before);
            let last = left <= self.tolerance.size();
            let trial: Vec<f64> = (0..a.len())
                .map(|i| match d[i] {
                    // on a bound, not near it
                    d if d <= -a[i] => 0.0,
                    d if d >= 1.0 - a[i] => 1.0,
                    d => a[i] + d,
                })
                .collect();
            let moved = self.moved(&nodes, &trial);
            let (mut next, after) = match moved {
                Ok(next) => {
                    let after = self.cost(&next, &links);
                    (Some(next), after)
                }
                Err(error) if !last && error.is_not_converged() => (None, f64::INFINITY),
                Err(error) => return Err(error),
            };
            let ratio = (cost - after) / promised.max(f64::MIN_POSITIVE);
            if last || ratio > SUFFICIENT {
                if let Some(next) = next.as_mut() {
                    self.derive(next)?;
                }
                nodes = next.unwrap_or(nodes);
                (gradient, hessian) = self.model(&nodes, &links, &chain);
                cost = after;
                let at_the_edge = (0..d.len()).any(|i| d[i].abs() > 0.9 * radius(i));
                match ratio {
                    ratio if ratio > 0.75 && at_the_edge => trust *= 3.0,
                    ratio if ratio < 0.25 => trust *= 0.5,
                    _ => {}
                }
                before = Some(sds);
                sweeps.push(FitIteration { cost, step, left, trust, rejected });
                rejected = 0;
                if last {
                    break;
                }
            } else {
                rejected += 1;
                trust *= 0.3;
            }
            if trust < SMALLEST_TRUST || sweeps.len() + rejected as usize > self.max_iterations {
                let worst = (0..d.len()).max_by(|i, j| d[*i].abs().total_cmp(&d[*j].abs())).unwrap_or(0);
                return Err(Error::FitNotConverged {
                    frame: nodes[worst / chain.controls.max(1)].frame,
                    iterations: sweeps.len(),
                    reason: "the sweeps over the clip were used up",
                    left,
                    required: self.tolerance.size(),
                });
            }
        }
        self.estimates(recording, nodes, (&links, &chain), (&gradient, &hessian), fitted, sweeps).map(Some)
    }

    /// The frames as they were fitted; between them, straight lines.
    fn nodes(&self, recording: &Recording, frames: &[usize], fitted: &[Option<Estimate>]) -> Result<Vec<Node>> {
        let q = |estimate: &Estimate| -> Vec<f64> {
            self.unknowns.iter().map(|k| estimate.equilibrium.state.controls[*k]).collect()
        };
        let known: Vec<(usize, Vec<f64>)> = fitted
            .iter()
            .enumerate()
            .filter_map(|(at, estimate)| Some((at, self.objectives.parts_of(&q(estimate.as_ref()?)))))
            .collect();
        let time = |at: usize| recording.frames[frames[at]].time_s;
        let (Some(first), Some(end)) = (known.first(), known.last()) else {
            let frame = frames.first().copied().unwrap_or(0);
            return Err(Error::NoMarkersInFrame { frame, time_s: frames.first().map_or(0.0, |_| time(0)) });
        };
        let between = |at: usize| -> Vec<f64> {
            let before = known.iter().rfind(|(k, _)| *k <= at).unwrap_or(first);
            let after = known.iter().find(|(k, _)| *k >= at).unwrap_or(end);
            let span = time(after.0) - time(before.0);
            let part = if span > 0.0 { ((time(at) - time(before.0)) / span).clamp(0.0, 1.0) } else { 0.0 };
            before.1.iter().zip(&after.1).map(|(a, b)| a + part * (b - a)).collect()
        };
        let node = |(at, frame): (usize, &usize)| {
            let (measured_mm, measured) = self.measured(recording, *frame);
            let at_equilibrium = fitted[at].as_ref().map(|estimate| At {
                equilibrium: estimate.equilibrium.clone(),
                residuals: estimate.residuals.clone(),
                jacobian: estimate.jacobian.clone(),
                held_head: None,
            });
            Node { frame: *frame, time_s: time(at), a: between(at), measured, measured_mm, at: at_equilibrium }
        };
        Ok(frames.iter().enumerate().map(node).collect())
    }

    fn aims(&self, time_s: f64) -> Aims<'_> {
        Aims { objectives: &self.objectives, time_s, before: &[] }
    }

    /// The objective of the whole clip.
    fn cost(&self, nodes: &[Node], links: &[Link]) -> f64 {
        let own = |node: &Node| {
            let markers = node.at.as_ref().map_or(0.0, |at| self.objectives.loss.cost(&at.residuals));
            markers + self.rest(node).value
        };
        let tied = |link: &Link| 0.5 * link.weight * stretch(link, nodes).iter().map(|v| v * v).sum::<f64>();
        nodes.iter().map(own).sum::<f64>() + links.iter().map(tied).sum::<f64>()
    }

    /// All of a frame's own objective but its markers.
    fn rest(&self, node: &Node) -> Sum {
        self.aims(node.time_s).rest(&self.objectives.values_of(&node.a))
    }

    /// Gradient and second derivative by all controls in parts of their ranges.
    fn model(&self, nodes: &[Node], links: &[Link], chain: &Chain) -> (Vec<f64>, BlockTridiagonal) {
        let n = chain.controls;
        let sizes: Vec<f64> = self.objectives.sizes().collect();
        let mut gradient = Vec::with_capacity(n * nodes.len());
        let mut hessian = BlockTridiagonal::zeros(&chain.sizes());
        for (t, node) in nodes.iter().enumerate() {
            let mut sum = self.rest(node);
            if let Some(at) = &node.at {
                let (g, h) = self.objectives.loss.model(&at.residuals, &at.jacobian);
                for k in 0..n {
                    sum.gradient[k] += g[k] * sizes[k];
                    (0..n).for_each(|l| sum.hessian[(k, l)] += h[(k, l)] * sizes[k] * sizes[l]);
                }
            }
            gradient.extend(sum.gradient);
            let (block, offset) = chain.place(t);
            let mut own = hessian.diagonal[block].view_mut((offset, offset), (n, n));
            own += sum.hessian;
        }
        for link in links {
            let pull = stretch(link, nodes);
            for (t, c) in &link.frames {
                (0..n).for_each(|k| gradient[t * n + k] += link.weight * c * pull[k]);
                for (s, d) in &link.frames {
                    let ((row, i), (column, j)) = (chain.place(*t), chain.place(*s));
                    let block = match column as isize - row as isize {
                        0 => &mut hessian.diagonal[row],
                        1 => &mut hessian.next[row],
                        _ => continue,
                    };
                    (0..n).for_each(|k| block[(i + k, j + k)] += link.weight * c * d);
                }
            }
        }
        let still = STILL * hessian.largest();
        for block in &mut hessian.diagonal {
            (0..block.nrows()).for_each(|k| block[(k, k)] += still);
        }
        (gradient, hessian)
    }

    /// The frames with other controls, without derivatives.
    fn moved(&mut self, nodes: &[Node], a: &[f64]) -> Result<Vec<Node>> {
        let n = self.unknowns.len();
        let mut all = Vec::with_capacity(nodes.len());
        for (node, a) in nodes.iter().zip(a.chunks_exact(n.max(1))) {
            let at = match &node.at {
                Some(at) => Some(self.visit(node, a, &at.equilibrium, false)?),
                None => None,
            };
            let (measured, measured_mm) = (node.measured.clone(), node.measured_mm.clone());
            all.push(Node { a: a.to_vec(), at, measured, measured_mm, ..*node });
        }
        Ok(all)
    }

    /// Takes the derivatives where the frames are.
    fn derive(&mut self, nodes: &mut [Node]) -> Result<()> {
        for node in nodes {
            if let Some(at) = &node.at {
                node.at = Some(self.visit(node, &node.a, &at.equilibrium, true)?);
            }
        }
        Ok(())
    }

    /// The equilibrium of a frame at controls, sought from another one, with its residuals and if asked for their derivative.
    fn visit(&mut self, node: &Node, a: &[f64], from: &Equilibrium, derive: bool) -> Result<At> {
        let q = self.objectives.values_of(a);
        let drive = Drive { controls: held_at(&self.held, &self.held_curves, node.time_s), load: 1.0 };
        let aims = Aims { objectives: &self.objectives, time_s: node.time_s, before: &[] };
        let problem = FrameProblem::new(
            &mut self.solver,
            &self.markers,
            node.measured.clone(),
            &self.unknowns,
            (self.sensitivity, Reuse::Fresh),
            (drive, aims),
            from.clone(),
            None,
        )
        .with_free_head(self.free_head);
        let residuals = problem.apply(&q).map_err(own_error)?;
        let jacobian = match derive {
            true => problem.jacobian(&q).map_err(own_error)?,
            false => DMatrix::zeros(0, 0),
        };
        let held_head = problem.take_held_head();
        let equilibrium = problem.into_found().0;
        Ok(At { equilibrium, residuals, jacobian, held_head })
    }

    /// What is known of every frame at the end.
    fn estimates(
        &mut self,
        recording: &Recording,
        nodes: Vec<Node>,
        (links, chain): (&[Link], &Chain),
        (gradient, hessian): (&[f64], &BlockTridiagonal),
        fitted: &[Option<Estimate>],
        sweeps: Vec<FitIteration>,
    ) -> Result<Smoothed> {
        let n = chain.controls;
        let sizes: Vec<f64> = self.objectives.sizes().collect();
        let free: Vec<bool> = nodes.iter().flat_map(|node| node.a.iter().map(|a| *a > 0.0 && *a < 1.0)).collect();
        let marginals = hessian.marginals(&free).ok_or(Error::StepNotSolved { status: "NotPositive" })?;
        let heads = self.head_errors(recording, &nodes, (chain, hessian), &free, &sizes);
        let heads = heads.ok_or(Error::StepNotSolved { status: "NotPositive" })?;
        let tied: Vec<f64> = nodes.iter().enumerate().map(|(t, _)| own_share(links, &nodes, t)).collect();
        let mut frames = Vec::with_capacity(nodes.len());
        let mut near: Option<Equilibrium> = fitted.iter().flatten().next().map(|first| first.equilibrium.clone());
        for (t, node) in nodes.into_iter().enumerate() {
            let bridged = node.at.is_none();
            let found = match node.at {
                Some(at) => Ok(at),
                None => {
                    let from =
                        near.clone().ok_or(Error::NoMarkersInFrame { frame: node.frame, time_s: node.time_s })?;
                    let empty = Node {
                        at: None,
                        a: node.a.clone(),
                        measured_mm: Vec::new(),
                        measured: node.measured.clone(),
                        ..node
                    };
                    self.visit(&empty, &node.a, &from, true)
                }
            };
            let at = match found {
                Ok(at) => at,
                Err(error) => {
                    frames.push(Err(error));
                    continue;
                }
            };
            near = Some(at.equilibrium.clone());
            let own = &free[t * n..(t + 1) * n];
            let marginal = match &heads {
                Some(heads) => heads[t].clone(),
                None => chain.marginal(t, &marginals, &free).ok_or(Error::StepNotSolved { status: "NotPositive" })?,
            };
            let marginal = DMatrix::from_fn(n, n, |a, b| marginal[(a, b)] / (sizes[a] * sizes[b]));
            let iterations = fitted[t].as_ref().map_or_else(Vec::new, |estimate| estimate.iterations.clone());
            let cost = 0.5 * at.residuals.iter().map(|r| r * r).sum::<f64>();
            let At { equilibrium, residuals, jacobian, held_head } = at;
            let optimum = Optimum { equilibrium, directions: None, jacobian, held_head, residuals, cost, iterations };
            let mut estimate = self.estimate(recording, node.frame, (node.measured_mm, node.measured), optimum);
            if bridged {
                // its markers have not been used
                estimate.weights.fill(0.0);
                estimate.information.fill(0.0);
                estimate.variance = Some(1.0);
            }
            estimate.prior = &marginal - &estimate.information;
            estimate.gradient = (0..n).map(|k| gradient[t * n + k] / sizes[k]).collect();
            let bounds: Vec<Bound> = self.unknowns.iter().map(|k| estimate.bounds[*k]).collect();
            debug_assert!(bounds.iter().zip(own).all(|(bound, free)| (*bound == Bound::Free) == *free));
            for (k, sd) in self.unknowns.iter().zip(standard_deviations(&marginal, &bounds)) {
                estimate.sd[*k] = sd;
            }
            estimate.bridged = bridged;
            estimate.costs.iter_mut().filter(|(name, _)| name == "smoothness").for_each(|(_, cost)| *cost = tied[t]);
            frames.push(Ok(estimate));
        }
        Ok(Smoothed { frames, sweeps })
    }
}

/// sum of c a over the frames of a link.
fn stretch(link: &Link, nodes: &[Node]) -> Vec<f64> {
    let n = nodes.first().map_or(0, |node| node.a.len());
    (0..n).map(|k| link.frames.iter().map(|(t, c)| c * nodes[*t].a[k]).sum()).collect()
}

/// The cost of the links that end at a frame.
fn own_share(links: &[Link], nodes: &[Node], frame: usize) -> f64 {
    let own = links.iter().filter(|link| link.frames.last().is_some_and(|(t, _)| *t == frame));
    own.map(|link| 0.5 * link.weight * stretch(link, nodes).iter().map(|v| v * v).sum::<f64>()).sum()
}

/// Where frames stand in the chain of blocks.
struct Chain {
    frames: usize,
    controls: usize,
    /// Frames in a block: so many that only neighbouring blocks are tied.
    per_block: usize,
}

impl Chain {
    fn sizes(&self) -> Vec<usize> {
        let frames: Vec<usize> = (0..self.frames).collect();
        frames.chunks(self.per_block).map(|block| block.len() * self.controls).collect()
    }

    /// Block of a frame, and where it begins there.
    fn place(&self, frame: usize) -> (usize, usize) {
        (frame / self.per_block, frame % self.per_block * self.controls)
    }

    /// What is known of one frame with all others eliminated, from that of its block.
    fn marginal(&self, frame: usize, marginals: &[DMatrix<f64>], free: &[bool]) -> Option<DMatrix<f64>> {
        let (block, offset) = self.place(frame);
        let (n, whole) = (self.controls, &marginals[block]);
        let start = block * self.per_block * n;
        let own: Vec<usize> = (offset..offset + n).collect();
        let others: Vec<usize> = (0..whole.nrows()).filter(|i| !own.contains(i) && free[start + i]).collect();
        let mine = whole.select_rows(&own).select_columns(&own);
        if others.is_empty() {
            return Some(mine);
        }
        let across = whole.select_rows(&own).select_columns(&others);
        let inner = whole.select_rows(&others).select_columns(&others).cholesky()?;
        Some(mine - &across * inner.solve(&across.transpose()))
    }
}
