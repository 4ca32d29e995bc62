//! What is tried where a path turns back, or where it comes to a saddle: the body is let go, and held back by a drag.
//!
//!   r(x) + s D (u - u_before) = 0,  s -> 0
//! is an implicit step of length 1/s of the motion D du/dt = - r, which runs downhill in energy until it ends in a stable
//! equilibrium (pseudo-transient continuation: Kelley and Keyes 1998). D is the stiffness at rest, as of a viscous body, so
//! that slender parts and small ones are held back alike. Where K has negative modes K + s D has none for an s that is large
//! enough, and only then a step is believed. A body that rests on a saddle is pushed off along a negative mode.

use super::balance::Drag;
use super::{LIMITS, Solver, Step, StepKind, step};
use crate::error::Result;
use crate::math::tensor::{norm, subtract};
use crate::model::State;
use crate::solve::newton::{Assessment, Equations, Iteration, Limits};
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
const MOST_STEPS: usize = 200;
/// Newton iterations of all steps.
const MOST_ITERATIONS: usize = 400;
/// Newton iterations of one step.
const STEP_ITERATIONS: usize = 15;
/// Steps after one that failed in which the drag does not become weaker.
const CAUTIOUS_STEPS: usize = 3;
/// Times that it is pushed off a saddle.
const MOST_PUSHES: usize = 4;
/// Strength of the drag to start with: as much again as the stiffness at rest.
const FIRST_DRAG: f64 = 1.0;
/// A drag beyond this holds everything.
const STRONGEST_DRAG: f64 = 1e5;
/// The weakest drag with which a negative mode is sought.
const WEAKEST_DRAG: f64 = 1e-6;
/// A step is predicted from the one before no farther than so many times that.
const FARTHEST: f64 = 3.0;
/// The smallest part of a Newton step: with a drag there is no shorter step of a path to be had.
const RELEASE_DAMPING: f64 = 0.02;
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
    pub(super) fn release(&mut self, before: &[Snap], start: &State, last: &State) -> Option<Released> {
        if !self.settings.release || before.len() >= MOST_SNAPS {
            return None;
        }
        let released = self.descend(start, last);
        self.balance.drag = None;
        // a tangent that cannot be factorised ends the attempt, not the run: the failure that led here is told
        released.unwrap_or(None)
    }

    fn descend(&mut self, start: &State, last: &State) -> Result<Option<Released>> {
        let model = self.balance.model;
        let iterations = self.settings.max_iterations.min(STEP_ITERATIONS);
        let limits = Limits { iterations, damping: RELEASE_DAMPING, ..LIMITS };
        let mut state = self.balance.at_target(start.clone());
        let stiffness = Arc::new(self.balance.stiffness_at_rest());
        let mut drag = Drag { strength: FIRST_DRAG, stiffness, from: model.unknowns(&state) };
        // the state before, and the drag on the way from there
        let mut before: Option<(State, f64)> = None;
        let mut iterations = Vec::new();
        let mut pushes = 0;
        let mut cautious = 0;
        for _ in 0..MOST_STEPS {
            if iterations.len() >= MOST_ITERATIONS || drag.strength > STRONGEST_DRAG {
                return Ok(None);
            }
            drag.from = model.unknowns(&state);
            self.balance.drag = Some(drag.clone());
            // the velocity stays about the same: distances are as 1/s
            let guess = before.as_ref().map_or_else(
                || state.clone(),
                |(earlier, then)| self.balance.extrapolate(earlier, &state, (then / drag.strength).min(FARTHEST)),
            );
            let outcome = self.attempt(guess, &state, limits);
            let Ok(outcome) = outcome else {
                (drag.strength, cautious) = (3.0 * drag.strength, CAUTIOUS_STEPS);
                continue;
            };
            let taken = outcome.iterations.len();
            let downhill = taken == 0 || self.balance.negative_modes() == Some(0);
            iterations.extend(outcome.iterations);
            if outcome.stop.is_some() || !downhill {
                (drag.strength, cautious) = (3.0 * drag.strength, CAUTIOUS_STEPS);
                continue;
            }
            before = Some((std::mem::replace(&mut state, outcome.state), drag.strength));
            self.balance.drag = None;
            let free = self.balance.assess(&state);
            if !free.converged() {
                cautious = cautious.saturating_sub(1);
                drag.strength *= match taken {
                    _ if cautious > 0 => 1.0,
                    0..=2 => 0.2,
                    3..=4 => 0.4,
                    5..=8 => 0.7,
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
            let Some(pushed) = self.pushed(&state, last, &mut drag)? else { return Ok(None) };
            (state, before) = (pushed, None);
        }
        Ok(None)
    }

    /// A saddle pushed along a negative mode v of K v = m D v; the drag then holds that mode back.
    fn pushed(&mut self, saddle: &State, last: &State, drag: &mut Drag) -> Result<Option<State>> {
        let model = self.balance.model;
        drag.strength = WEAKEST_DRAG;
        loop {
            self.balance.drag = Some(drag.clone());
            self.balance.inspect(saddle)?;
            if self.balance.negative_modes() == Some(0) {
                break;
            }
            drag.strength *= 10.0;
            if drag.strength > STRONGEST_DRAG {
                return Ok(None);
            }
        }
        let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        // inverse iteration v <- (K + s D)^-1 D v from a direction that no symmetry singles out
        let mut mode: Vec<f64> = (0..drag.from.len()).map(|k| ((k * k + k) as f64 * 0.7 + 0.3).sin()).collect();
        let mut negative = false;
        for _ in 0..MODE_ITERATIONS {
            let mut next = drag.times(&mode);
            let size = product(&mode, &next).sqrt();
            next.iter_mut().chain(&mut mode).for_each(|v| *v /= size);
            let right = next.clone();
            self.balance.solve_factored(&mut next)?;
            // m + s of K v = m D v, from <v, D (K + s D)^-1 D v>
            let value = 1.0 / product(&right, &next) - drag.strength;
            mode = next;
            if negative {
                break;
            }
            negative = value < 0.0;
        }
        if !negative {
            return Ok(None);
        }
        let push = model.displacement_of(&mode);
        let largest = push.iter().flatten().fold(0.0, |most: f64, v| if v.abs() > most.abs() { *v } else { most });
        // to the side from which the body came, if it did from one
        let back: Vec<f64> = model.unknowns(last).iter().zip(&drag.from).map(|(to, from)| to - from).collect();
        let pull = drag.times(&back);
        let towards = product(&mode, &pull);
        let size = product(&back, &pull).sqrt() * product(&mode, &drag.times(&mode)).sqrt();
        let sign = if towards.abs() > 1e-3 * size { towards.signum() } else { largest.signum() };
        let length = sign * PUSH * model.element_size() / largest.abs();
        self.balance.drag = None;
        let mut part = 1.0;
        while part > 1e-3 {
            let mut pushed = saddle.clone();
            for (u, v) in pushed.u.iter_mut().flatten().zip(push.iter().flatten()) {
                *u += part * length * v;
            }
            if self.balance.assess(&pushed).admissible {
                return Ok(Some(pushed));
            }
            part *= 0.5;
        }
        Ok(None)
    }
}
