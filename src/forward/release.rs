//! What is tried where a path turns back, or where it comes to a saddle: the body is let go, and held back by a drag.
//!
//!   r(x) + s D (u - u_before) = 0,  s -> 0
//! is an implicit step of length 1/s of the motion D du/dt = - r, which runs downhill in energy until it ends in a stable
//! equilibrium (pseudo-transient continuation: Kelley and Keyes 1998). Where K has negative modes K + s D has none for an s
//! that is large enough, and only then a step is believed. A body that rests on a saddle is pushed off along a negative mode.

use super::balance::Drag;
use super::{DAMPING, Solver, Step, StepKind, step};
use crate::error::Result;
use crate::math::tensor::{norm, subtract};
use crate::model::State;
use crate::solve::newton::{Assessment, Equations, Iteration, Limits, Test, newton};
use std::sync::Arc;

/// The body lost its balance on a path and came to the stable equilibrium beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snap {
    /// Where on the path, 0 to 1.
    pub place: f64,
    /// Negative modes of the equilibrium that it left; 0 where the path had ended at a limit point.
    pub modes: usize,
    /// How far the farthest node moved, mm.
    pub distance: f64,
}

/// Times that a body may snap on one path.
const MOST_SNAPS: usize = 8;
/// Steps of the motion, failed ones included.
const MOST_STEPS: usize = 100;
/// Times that it is pushed off a saddle.
const MOST_PUSHES: usize = 4;
/// Strength of the drag to start with: that of the tissue over an element.
const FIRST_DRAG: f64 = 1.0;
/// A drag beyond this holds everything.
const STRONGEST_DRAG: f64 = 1e6;
/// The weakest drag with which a negative mode is sought.
const WEAKEST_DRAG: f64 = 1e-8;
/// A push moves no parameter by more than this part of an element.
const PUSH: f64 = 0.02;
/// Iterations for the direction of a negative mode.
const MODE_ITERATIONS: usize = 30;

/// Where a body came to that was let go.
pub(super) struct Released {
    pub state: State,
    last: Assessment,
    iterations: Vec<Iteration>,
}

impl Released {
    pub fn snap(&self, place: f64, modes: usize, before: &State) -> Snap {
        let moved = self.state.u.iter().zip(&before.u).step_by(8).map(|(a, b)| norm(subtract(*a, *b)));
        Snap { place, modes, distance: moved.fold(0.0, f64::max) }
    }

    pub fn step(&self, place: f64) -> Step {
        step(place, StepKind::Snapped, self.last, self.iterations.clone())
    }
}

impl Solver<'_> {
    /// Lets the body go at the target: from `start`, which need not be in balance, to a stable equilibrium. A push off a
    /// saddle leads towards `last` where it can. `None` if there is no such equilibrium, or if the body snapped too often.
    pub(super) fn release(&mut self, before: &[super::Snap], start: &State, last: &State) -> Option<Released> {
        if before.len() >= MOST_SNAPS {
            return None;
        }
        let released = self.descend(start, last);
        self.balance.drag = None;
        // a tangent that cannot be factorised ends the attempt, not the run: the failure that led here is told
        released.unwrap_or(None)
    }

    fn descend(&mut self, start: &State, last: &State) -> Result<Option<Released>> {
        let model = self.balance.model;
        let weights = Arc::new(model.drag());
        let limits = Limits { iterations: self.settings.max_iterations, damping: DAMPING, test: Test::Monotone };
        let mut state = self.balance.at_target(start.clone());
        let mut strength = FIRST_DRAG;
        let mut iterations = Vec::new();
        let mut pushes = 0;
        for _ in 0..MOST_STEPS {
            self.balance.drag = Some(Drag { strength, weights: weights.clone(), from: model.unknowns(&state) });
            let outcome = newton(&mut self.balance, state.clone(), limits);
            let Ok(outcome) = outcome else {
                strength *= 10.0;
                continue;
            };
            let taken = outcome.iterations.len();
            if std::env::var("TRACE").is_ok() {
                eprintln!("  s {strength:.1e} its {taken} stop {:?} modes {:?} res {:.1e} req {:.1e} last factor {:?} detF {:?}", outcome.stop, self.balance.negative_modes(), outcome.last.residual, outcome.last.required, outcome.iterations.last().map(|i| i.factor), self.balance.worst_point().min);
            }
            let downhill = taken == 0 || self.balance.negative_modes() == Some(0);
            iterations.extend(outcome.iterations);
            if outcome.stop.is_some() || !downhill {
                strength *= 10.0;
                if strength > STRONGEST_DRAG {
                    return Ok(None);
                }
                continue;
            }
            state = outcome.state;
            self.balance.drag = None;
            let free = self.balance.assess(&state);
            if !free.converged() {
                strength *= match taken {
                    0..=3 => 0.1,
                    4..=6 => 0.3,
                    _ => 1.0,
                };
                continue;
            }
            self.balance.inspect(&state)?;
            if self.balance.negative_modes() == Some(0) {
                return Ok(Some(Released { state, last: free, iterations }));
            }
            if pushes == MOST_PUSHES {
                return Ok(None);
            }
            pushes += 1;
            let Some((pushed, enough)) = self.pushed(&state, last, &weights)? else { return Ok(None) };
            (state, strength) = (pushed, enough);
        }
        Ok(None)
    }

    /// A saddle pushed along a negative mode v of K v = m D v, and the drag that holds that mode back.
    fn pushed(&mut self, saddle: &State, last: &State, weights: &Arc<Vec<f64>>) -> Result<Option<(State, f64)>> {
        let model = self.balance.model;
        let mut strength = WEAKEST_DRAG;
        loop {
            self.balance.drag =
                Some(Drag { strength, weights: weights.clone(), from: model.unknowns(saddle) });
            self.balance.inspect(saddle)?;
            if self.balance.negative_modes() == Some(0) {
                break;
            }
            strength *= 10.0;
            if strength > STRONGEST_DRAG {
                return Ok(None);
            }
        }
        let product = |a: &[f64], b: &[f64]| -> f64 {
            weights.iter().zip(a).zip(b).map(|((w, a), b)| w * a * b).sum()
        };
        // inverse iteration v <- (K + s D)^-1 D v from a direction that no symmetry singles out
        let mut mode: Vec<f64> = (0..weights.len()).map(|k| ((k * k + k) as f64 * 0.7 + 0.3).sin()).collect();
        let mut negative = false;
        for _ in 0..MODE_ITERATIONS {
            let size = product(&mode, &mode).sqrt();
            mode.iter_mut().for_each(|v| *v /= size);
            let mut next: Vec<f64> = mode.iter().zip(weights.iter()).map(|(v, w)| v * w).collect();
            self.balance.solve_factored(&mut next)?;
            // of (K + s D)^-1 D; s is more than the mode's own value
            let value = 1.0 / product(&mode, &next) - strength;
            mode = next;
            if negative {
                break;
            }
            negative = value < 0.0;
        }
        if !negative {
            return Ok(None);
        }
        let displacement = |(v, w): (&f64, &f64)| if *w > 0.0 { *v } else { 0.0 };
        let mut push: Vec<f64> = mode.iter().zip(weights.iter()).map(displacement).collect();
        let largest = push.iter().copied().fold(0.0, |most: f64, v| if v.abs() > most.abs() { v } else { most });
        let back: Vec<f64> =
            model.unknowns(last).iter().zip(model.unknowns(saddle)).map(|(to, from)| to - from).collect();
        let towards = product(&push, &back);
        let size = product(&push, &push).sqrt() * product(&back, &back).sqrt();
        let sign = if towards.abs() > 1e-3 * size { towards.signum() } else { largest.signum() };
        let length = sign * PUSH * model.element_size() / largest.abs();
        push.iter_mut().for_each(|v| *v *= length);
        self.balance.drag = None;
        let mut part = 1.0;
        while part > 1e-3 {
            let mut pushed = saddle.clone();
            model.advance(&mut pushed, &push, part);
            if self.balance.assess(&pushed).admissible {
                return Ok(Some((pushed, strength)));
            }
            part *= 0.5;
        }
        Ok(None)
    }
}
