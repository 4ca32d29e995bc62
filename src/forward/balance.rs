//! The balance r(u, p; a) = 0 of a model as Newton's method sees it.

use super::{Drive, Work, seconds_since};
use crate::error::{Error, Result};
use crate::math::factor::{self, Factor, Precision, SolveQuality};
use crate::math::sparse::SymmetricMatrix;
use crate::math::tensor::{norm, subtract};
use crate::model::{Evaluation, Model, OffSurface, State, Tangent, Workspace, WorstPoint};
use crate::solve::newton::{Assessment, Equations};
use crate::term::Want;
use std::sync::Arc;
use std::time::Instant;

/// A residual below this part of mu V^(2/3) is rounding.
const ROUNDING: f64 = 1e-13;
/// Relative residual of a Newton step.
const STEP_TOLERANCE: f64 = 1e-10;
/// Of solves with the tangent of an equilibrium.
const TANGENT: Accuracy = Accuracy { required: 1e-9, tolerance: 1e-13 };
/// Of the solve for a gradient, which a search only follows.
const GRADIENT: Accuracy = Accuracy { required: 1e-7, tolerance: 1e-7 };
/// What of B x may remain of the B x without constraint forces, and the iterations for it.
const CONSTRAINT_TOLERANCE: f64 = 1e-9;
const CONSTRAINT_ITERATIONS: usize = 500;
/// Right-hand sides for which a stale factor is worth trying: a sweep for 40 of them takes as long as a factorisation, and a
/// stale factor takes several more sweeps than a new one.
const STALE_COLUMNS: usize = 12;
/// Sweeps after which a stale factor is not worth keeping.
const STALE_SWEEPS: usize = 12;
/// Relative residual of a Newton step by a stale factor and of the corrections that judge it, and the sweeps after which a new
/// factor is cheaper: on two threads a factorisation takes as long as ten solves.
const STALE_STEP: f64 = 2e-2;
const STALE_CORRECTION: f64 = 0.1;
const STALE_STEP_SWEEPS: usize = 8;

/// Relative residual that a solve must reach, and what it strives for.
#[derive(Clone, Copy)]
struct Accuracy {
    required: f64,
    tolerance: f64,
}

/// A model with the memory to solve it.
pub(super) struct Balance<'m> {
    pub model: &'m Model,
    pub tolerance: f64,
    precision: Precision,
    workspace: Workspace,
    tangent: Tangent,
    factor: Factor,
    factored: bool,
    /// Whether Newton's steps may be made with a factor that is older than their tangent.
    pub keeps_factor: bool,
    /// Where the tangent was assembled last, and where the one that is factorised was.
    assembled_at: Option<State>,
    factored_at: Option<State>,
    /// What factors with other patterns have done.
    earlier: factor::Work,
    target: Drive,
    /// Prescribed displacements at the target: (parameter, component, mm).
    prescribed: Vec<(usize, usize, f64)>,
    /// dPi/d(unknown) at the state last assessed, and the prescribed motion outstanding there.
    residual: Vec<f64>,
    gap: Option<Vec<[f64; 3]>>,
    /// The motion that was outstanding when the tangent was made, and K times it.
    lifted_gap: Option<Vec<[f64; 3]>>,
    lifted: Option<Vec<f64>>,
    worst: WorstPoint,
    /// Where a face had left its surface in a state that was not admissible for that; the last since it was cleared.
    pub off_surface: Option<OffSurface>,
    /// Holds the body back while it is let go.
    pub drag: Option<Drag>,
    /// By how much contact is eased, mm.
    pub easing: f64,
    work: Work,
}

/// Forces strength x D (x - from) on the unknowns.
#[derive(Clone)]
pub(super) struct Drag {
    pub strength: f64,
    /// D, mN/mm: the stiffness at rest, without rows and columns of pressures.
    pub stiffness: Arc<SymmetricMatrix>,
    /// The unknowns where it is at rest.
    pub from: Vec<f64>,
}

impl Drag {
    /// D v
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; v.len()];
        self.stiffness.multiply(v, &mut product);
        product
    }
}

/// A Newton step: free unknowns, and the prescribed motion that comes with it.
pub(super) struct Direction {
    unknowns: Vec<f64>,
    gap: Option<Vec<[f64; 3]>>,
}

impl<'m> Balance<'m> {
    pub fn new(model: &'m Model, tolerance: f64, precision: Precision) -> Result<Balance<'m>> {
        let terms = model.terms().len();
        Ok(Balance {
            model,
            tolerance,
            precision,
            workspace: Workspace::default(),
            tangent: model.tangent(),
            factor: Factor::new(model.symbolic().clone(), precision)?,
            factored: false,
            keeps_factor: false,
            assembled_at: None,
            factored_at: None,
            earlier: factor::Work::default(),
            target: Drive { controls: vec![0.0; model.controls().len()], load: 0.0 },
            prescribed: Vec::new(),
            residual: Vec::new(),
            gap: None,
            lifted_gap: None,
            lifted: None,
            worst: WorstPoint { min: 1.0, element: 0, point: 0, max: 1.0 },
            off_surface: None,
            drag: None,
            easing: 0.0,
            work: Work { points: vec![0; terms], term_seconds: vec![0.0; terms], ..Work::default() },
        })
    }

    pub fn set_target(&mut self, target: Drive) {
        self.prescribed = self.model.supports().prescribed(self.model.mesh(), target.load, &target.controls);
        self.target = target;
    }

    /// A state with the controls and the load of the target, contact as it is eased now; prescribed motion may still be outstanding.
    pub fn at_target(&self, state: State) -> State {
        State { controls: self.target.controls.clone(), load: self.target.load, easing: self.easing, ..state }
    }

    /// The same with the faces on bones where they belong. For a guess: far from there it may be inadmissible.
    pub fn carried(&self, mut state: State) -> State {
        self.model.supports().carry(self.model.mesh(), &self.target.controls, &mut state.u);
        state
    }

    pub fn work(&self) -> Work {
        let mut linear = self.earlier;
        linear += self.factor.work();
        Work { linear, ..self.work.clone() }
    }

    pub fn count_cut(&mut self) {
        self.work.cuts += 1;
    }

    pub fn worst_point(&self) -> WorstPoint {
        self.worst
    }

    /// now + ratio (now - before) for all unknowns.
    pub fn extrapolate(&self, before: &State, now: &State, ratio: f64) -> State {
        let along = |a: f64, b: f64| b + ratio * (b - a);
        State {
            u: before.u.iter().zip(&now.u).map(|(a, b)| std::array::from_fn(|i| along(a[i], b[i]))).collect(),
            p: before.p.iter().zip(&now.p).map(|(a, b)| along(*a, *b)).collect(),
            ..now.clone()
        }
    }

    pub fn evaluation_at(&mut self, state: &State) -> Evaluation {
        self.evaluate(state, Want::Force, None)
    }

    /// Whether a tangent and a factor near it are at hand, from the last iteration or the last sensitivities.
    pub fn has_tangent(&self) -> bool {
        self.factored
    }

    /// Negative eigenvalues beyond one per pressure at the last factorisation.
    pub fn negative_modes(&self) -> Option<usize> {
        let pressures = self.model.numbering().pressures();
        self.factored.then(|| self.factor.inertia().negative.saturating_sub(pressures))
    }

    /// d(unknowns)/d(control) at the equilibrium `state`, one control after the other: K_ff du_f = - dr/dq - K_fp du_p/dq,
    /// with the motion u_p of faces on bones.
    pub fn rates(&mut self, state: &State, controls: &[usize]) -> Result<Vec<f64>> {
        let model = self.model;
        let mut rhs = Vec::with_capacity(controls.len() * model.numbering().unknowns());
        for control in controls {
            let mut force = model.control_force(state, *control);
            if let Some(moved) = model.supports().rate(model.mesh(), *control, &state.controls) {
                let lifted = self.evaluate(state, Want::Stiffness, Some(&moved)).lifted;
                force.iter_mut().zip(lifted).for_each(|(f, k)| *f += k);
            }
            rhs.extend(force.iter().map(|f| -f));
        }
        let moved = controls.iter().map(|control| model.constraint_control_rate(state, *control)).collect();
        self.solve_held(state, &mut rhs, moved, TANGENT)?;
        Ok(rhs)
    }

    /// d(b . du)/d(control) at the equilibrium `state` for a force b on all displacement parameters, du/d(control) being that of
    /// [`Balance::rates`]: one solve for all controls. `None` where the factor at hand is too old for it: a new one serves all
    /// the rates.
    ///
    ///   K l + B^T z = b_f,  B l = 0:   b . du/dq = l . (- dr/dq - K_fp du_p/dq) - z . c + b_p . du_p/dq
    pub fn pulled_back(&mut self, state: &State, pull: &[[f64; 3]], controls: &[usize]) -> Result<Option<Vec<f64>>> {
        let model = self.model;
        let mut adjoint = model.force_of_unknowns(pull);
        self.evaluate(state, Want::Stiffness, None);
        self.assemble(state);
        if !self.solve_with_factor_at_hand(&mut adjoint, 1, GRADIENT)? {
            return Ok(None);
        }
        let multipliers = self.hold_constraints(state, &mut adjoint, None, GRADIENT)?;
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let along = |control: &usize| {
            let mut rate = -dot(&adjoint, &model.control_force(state, *control));
            if let Some(moved) = model.supports().rate(model.mesh(), *control, &state.controls) {
                let lifted = self.evaluate(state, Want::Stiffness, Some(&moved)).lifted;
                rate += dot(pull.as_flattened(), moved.as_flattened()) - dot(&adjoint, &lifted);
            }
            if let Some(moved) = model.constraint_control_rate(state, *control) {
                rate -= multipliers.iter().zip(&moved).map(|(z, c)| dot(z, c)).sum::<f64>();
            }
            rate
        };
        Ok(Some(controls.iter().map(along).collect()))
    }

    /// Undamped Newton steps from a state with all prescribed motion done, with constraints as open or closed as they are:
    /// K d + B^T z = - r, B d = 0, until a step is no more than `part` of the whole way. `None` where one does not lower the
    /// residual.
    pub fn corrected(&mut self, from: &State, part: f64, most: usize) -> Result<Option<State>> {
        let mut state = from.clone();
        let mut residual = self.evaluate(&state, Want::Force, None).residual;
        for _ in 0..most {
            let mut step: Vec<f64> = residual.iter().map(|r| -r).collect();
            self.solve_held(&state, &mut step, vec![None], TANGENT)?;
            self.model.advance(&mut state, &step, 1.0);
            self.work.iterations += 1;
            let after = self.evaluate(&state, Want::Force, None);
            let lower = self.norm(&after.residual) <= self.norm(&residual);
            if after.det_f.min <= 0.0 || !lower {
                return Ok(None);
            }
            residual = after.residual;
            if self.largest(&self.model.displacement_of(&step)) <= part * self.largest(&moved(from, &state)) {
                return Ok(Some(state));
            }
        }
        Ok(None)
    }

    /// The longest of the displacements of nodes, mm.
    fn largest(&self, u: &[[f64; 3]]) -> f64 {
        let values =
            u.iter().zip(&self.model.mesh().parameter_derivative).filter(|(_, derivative)| **derivative == 0);
        values.map(|(u, _)| norm(*u)).fold(0.0, f64::max)
    }

    /// Factorises the tangent at a state, to see its negative modes.
    pub fn inspect(&mut self, state: &State) -> Result<()> {
        self.evaluate(state, Want::Stiffness, None);
        self.assemble(state);
        self.refactor()
    }

    /// The states at which the tangent at hand was factorised and assembled: what the next solves depend on beside their own
    /// input. `None` where nothing is factorised, or under a drag.
    pub fn tangent_states(&self) -> Option<[State; 2]> {
        let held = self.drag.is_some() || !self.factored;
        (!held).then(|| Some([self.factored_at.clone()?, self.assembled_at.clone()?]))?
    }

    /// Makes the tangent anew as [`Balance::tangent_states`] told of it, or forgets the one at hand.
    pub fn restore_tangent(&mut self, states: Option<&[State; 2]>) -> Result<()> {
        self.factored = false;
        if let Some([factored, assembled]) = states {
            self.inspect(factored)?;
            self.evaluate(assembled, Want::Stiffness, None);
            self.assemble(assembled);
        }
        Ok(())
    }

    /// The stiffness of the body at rest without its pressures.
    pub fn stiffness_at_rest(&mut self) -> SymmetricMatrix {
        let model = self.model;
        self.evaluate(&model.rest(), Want::Stiffness, None);
        self.assemble(&model.rest());
        self.factored = false;
        let mut matrix = self.tangent.matrix.clone();
        let mut kept = vec![true; model.numbering().unknowns()];
        (0..model.numbering().pressures()).for_each(|k| kept[model.numbering().pressure_unknown(k)] = false);
        matrix.keep(&kept);
        matrix
    }

    /// K x = b with the tangent that is factorised.
    pub fn solve_factored(&mut self, rhs: &mut [f64]) -> Result<()> {
        self.factor.solve(&self.tangent.matrix, rhs, 1, STEP_TOLERANCE).map(|_| ())
    }

    pub fn solve_with_tangent(&mut self, state: &State, rhs: &mut [f64], columns: usize) -> Result<()> {
        self.solve_held(state, rhs, vec![None; columns], TANGENT).map(|_| ())
    }

    /// One column of `rhs` for each entry of `moved`: the rate c of the gaps that comes with it, if there is one.
    /// Gives the forces z of the constraints, for each column; none where nothing is constrained.
    fn solve_held(
        &mut self,
        state: &State,
        rhs: &mut [f64],
        moved: Vec<Option<Vec<Vec<f64>>>>,
        accuracy: Accuracy,
    ) -> Result<Vec<Vec<Vec<f64>>>> {
        self.evaluate(state, Want::Stiffness, None);
        self.assemble(state);
        self.solve_assembled(rhs, moved.len(), accuracy)?;
        let n = self.model.numbering().unknowns();
        let columns = rhs.chunks_exact_mut(n.max(1)).zip(moved);
        columns.into_iter().map(|(x, moved)| self.hold_constraints(state, x, moved, accuracy)).collect()
    }

    /// From K^-1 b to the x of K x + B^T z = b, B x = - c: conjugate gradients on B K^-1 B^T z = B K^-1 b + c. The operator
    /// is positive on the range of B, and K holds the penalty, which gathers its eigenvalues below 1 / penalty. Gives z.
    fn hold_constraints(
        &mut self,
        state: &State,
        x: &mut [f64],
        moved: Option<Vec<Vec<f64>>>,
        accuracy: Accuracy,
    ) -> Result<Vec<Vec<f64>>> {
        if state.multipliers.iter().all(Vec::is_empty) {
            return Ok(Vec::new());
        }
        let model = self.model;
        let product = |a: &[Vec<f64>], b: &[Vec<f64>]| -> f64 {
            a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum()
        };
        let add = |to: &mut [Vec<f64>], scale: f64, from: &[Vec<f64>]| {
            to.iter_mut().flatten().zip(from.iter().flatten()).for_each(|(t, f)| *t += scale * f);
        };
        let mut residual = model.constraint_rate(state, x);
        // the size of the parts before they cancel: what moves with its bone leaves rounding
        let mut first = product(&residual, &residual);
        if let Some(moved) = moved {
            first += product(&moved, &moved);
            add(&mut residual, 1.0, &moved);
        }
        let mut direction = residual.clone();
        let mut forces: Vec<Vec<f64>> = residual.iter().map(|of_term| vec![0.0; of_term.len()]).collect();
        let mut square = product(&residual, &residual);
        for _ in 0..CONSTRAINT_ITERATIONS {
            if square <= CONSTRAINT_TOLERANCE * CONSTRAINT_TOLERANCE * first || first == 0.0 {
                return Ok(forces);
            }
            let mut moved = model.constraint_force(state, &direction);
            self.solve_assembled(&mut moved, 1, accuracy)?;
            let response = model.constraint_rate(state, &moved);
            let along = square / product(&direction, &response);
            x.iter_mut().zip(&moved).for_each(|(x, m)| *x -= along * m);
            add(&mut residual, -along, &response);
            add(&mut forces, along, &direction);
            let next = product(&residual, &residual);
            direction.iter_mut().flatten().for_each(|d| *d *= next / square);
            add(&mut direction, 1.0, &residual);
            square = next;
        }
        Err(Error::InaccurateSolve { residual: (square / first).sqrt(), required: CONSTRAINT_TOLERANCE })
    }

    /// K x = b with the tangent that is assembled; the last factor is kept where it still serves.
    fn solve_assembled(&mut self, rhs: &mut [f64], columns: usize, accuracy: Accuracy) -> Result<()> {
        if self.solve_with_factor_at_hand(rhs, columns, accuracy)? {
            return Ok(());
        }
        self.refactor()?;
        let residual = self.factor.solve(&self.tangent.matrix, rhs, columns, accuracy.tolerance)?.residual;
        let required = accuracy.required;
        if residual <= required { Ok(()) } else { Err(Error::InaccurateSolve { residual, required }) }
    }

    /// The same with the last factor, if there is one and it serves; if not, `rhs` stays as it is.
    fn solve_with_factor_at_hand(&mut self, rhs: &mut [f64], columns: usize, accuracy: Accuracy) -> Result<bool> {
        if !self.factored || columns > STALE_COLUMNS {
            return Ok(false);
        }
        let original = rhs.to_vec();
        let quality =
            self.factor.solve_within(&self.tangent.matrix, rhs, columns, accuracy.tolerance, STALE_SWEEPS)?;
        let serves = quality.residual <= accuracy.required;
        if !serves {
            rhs.copy_from_slice(&original);
        }
        Ok(serves)
    }

    fn evaluate(&mut self, state: &State, want: Want, gap: Option<&[[f64; 3]]>) -> Evaluation {
        let start = Instant::now();
        let mut evaluation = self.model.evaluate(state, want, gap, &mut self.workspace);
        if let Some(drag) = &self.drag {
            let moved: Vec<f64> =
                self.model.unknowns(state).iter().zip(&drag.from).map(|(x, from)| x - from).collect();
            let force = drag.times(&moved);
            evaluation.residual.iter_mut().zip(force).for_each(|(r, f)| *r += drag.strength * f);
        }
        self.work.assembly_seconds += seconds_since(start);
        match want {
            Want::Force => self.work.force_evaluations += 1,
            Want::Stiffness => self.work.assemblies += 1,
        }
        for (total, seconds) in self.work.term_seconds.iter_mut().zip(&evaluation.seconds) {
            *total += seconds;
        }
        for (total, count) in self.work.points.iter_mut().zip(self.model.points()) {
            *total += count;
        }
        evaluation
    }

    /// The tangent of the last evaluation, which was at `state`.
    fn assemble(&mut self, state: &State) {
        let start = Instant::now();
        self.model.assemble(&self.workspace, &mut self.tangent);
        if let Some(drag) = &self.drag {
            self.tangent.matrix.add_scaled(drag.strength, &drag.stiffness);
        }
        self.assembled_at = Some(state.clone());
        self.work.assembly_seconds += seconds_since(start);
    }

    fn refactor(&mut self) -> Result<()> {
        self.factored = false;
        if !self.has_pattern_of_factor() {
            self.earlier += self.factor.work();
            self.factor = Factor::new(self.model.symbolic_of(&self.tangent)?, self.precision)?;
        }
        self.factor.refactor(&self.tangent.matrix)?;
        self.factored_at.clone_from(&self.assembled_at);
        self.factored = true;
        Ok(())
    }

    fn has_pattern_of_factor(&self) -> bool {
        Arc::ptr_eq(&self.tangent.matrix.pattern, self.factor.symbolic().pattern())
    }

    /// K d = - (r + K g) with the motion g that is still outstanding, a part of what it was when K was made; with a factor
    /// older than K to the relative residual `stale`.
    fn solve_step(&mut self, stale: f64) -> Result<(Direction, SolveQuality)> {
        let mut unknowns: Vec<f64> = self.residual.iter().map(|r| -r).collect();
        if let (Some(gap), Some(first), Some(lifted)) = (&self.gap, &self.lifted_gap, &self.lifted) {
            let part = remaining(gap, first);
            unknowns.iter_mut().zip(lifted).for_each(|(d, k)| *d -= part * k);
        }
        let matrix = &self.tangent.matrix;
        let quality = match self.factored_at != self.assembled_at {
            true => self.factor.solve_within(matrix, &mut unknowns, 1, stale, STALE_STEP_SWEEPS)?,
            false => self.factor.solve(matrix, &mut unknowns, 1, STEP_TOLERANCE)?,
        };
        Ok((Direction { unknowns, gap: self.gap.clone() }, quality))
    }

    /// Prescribed motion that a state still lacks, per parameter; `None` when nothing is outstanding.
    fn outstanding(&self, state: &State) -> Option<Vec<[f64; 3]>> {
        let missing = |&(parameter, component, value): &(usize, usize, f64)| value - state.u[parameter][component];
        let scale = 1e-14 * self.model.element_size();
        if self.prescribed.iter().all(|p| missing(p).abs() <= scale) {
            return None;
        }
        let mut gap = vec![[0.0; 3]; state.u.len()];
        for p in &self.prescribed {
            gap[p.0][p.1] = missing(p);
        }
        Some(gap)
    }

    /// sqrt(|r_u|^2 + (mu/h)^2 |r_p|^2), mN.
    fn norm(&self, residual: &[f64]) -> f64 {
        let weight = self.model.volume_scale();
        let mut sum: f64 = residual.iter().map(|r| r * r).sum();
        for index in 0..self.model.numbering().pressures() {
            let r = residual[self.model.numbering().pressure_unknown(index)];
            sum += (weight * weight - 1.0) * r * r;
        }
        // rounding may leave a sum below zero; a NaN stays one
        if sum < 0.0 { 0.0 } else { sum.sqrt() }
    }
}

impl Equations for Balance<'_> {
    type State = State;
    type Step = Direction;

    fn assess(&mut self, state: &State) -> Assessment {
        debug_assert!(state.controls == self.target.controls && state.load == self.target.load);
        debug_assert!(state.easing == self.easing);
        let evaluation = self.evaluate(state, Want::Force, None);
        self.gap = self.outstanding(state);
        self.worst = evaluation.det_f;
        let residual = self.norm(&evaluation.residual);
        self.residual = evaluation.residual;
        let admissible = evaluation.det_f.min > 0.0 && residual.is_finite();
        if !admissible && evaluation.det_f.min > 0.0 {
            self.off_surface = self.model.off_surface(state);
        }
        Assessment {
            residual,
            required: self.tolerance * evaluation.magnitude + ROUNDING * self.model.force_scale(),
            admissible,
            outstanding: self.gap.is_some(),
        }
    }

    fn step(&mut self, state: &State) -> Result<Direction> {
        let gap = self.outstanding(state);
        let evaluation = self.evaluate(state, Want::Stiffness, gap.as_deref());
        self.assemble(state);
        self.residual = evaluation.residual;
        self.lifted = gap.as_ref().map(|_| evaluation.lifted);
        self.lifted_gap = gap.clone();
        self.gap = gap;
        self.work.iterations += 1;
        if self.keeps_factor && self.factored {
            let (step, quality) = self.solve_step(STALE_STEP)?;
            if quality.residual <= STALE_STEP {
                return Ok(step);
            }
        }
        self.refactor()?;
        self.correction()
    }

    fn correction(&mut self) -> Result<Direction> {
        Ok(self.solve_step(if self.keeps_factor { STALE_CORRECTION } else { STALE_STEP })?.0)
    }

    fn advance(&self, state: &State, step: &Direction, factor: f64) -> State {
        let mut next = state.clone();
        self.model.advance(&mut next, &step.unknowns, factor);
        if let Some(gap) = &step.gap {
            for &(parameter, component, value) in &self.prescribed {
                if factor == 1.0 {
                    // exactly, so that nothing is left outstanding by rounding
                    next.u[parameter][component] = value;
                } else {
                    next.u[parameter][component] += factor * gap[parameter][component];
                }
            }
        }
        next
    }

    fn slope(&self, step: &Direction) -> f64 {
        step.unknowns.iter().zip(&self.residual).map(|(d, r)| d * r).sum()
    }

    /// Root mean square of displacements over the element size and of pressures over the shear modulus.
    fn size(&self, a: &Direction, weight: f64, b: &Direction) -> f64 {
        let (displacement, pressure) = (self.model.element_size(), self.model.shear_modulus());
        let sum = |k: usize| a.unknowns[k] + weight * b.unknowns[k];
        let all: f64 = (0..a.unknowns.len()).map(|k| sum(k) * sum(k)).sum();
        let numbering = self.model.numbering();
        let p: f64 =
            (0..numbering.pressures()).map(|index| sum(numbering.pressure_unknown(index))).map(|p| p * p).sum();
        let mut squares = (all - p).max(0.0) / (displacement * displacement) + p / (pressure * pressure);
        if let Some(gap) = &a.gap {
            for (parameter, gap) in gap.iter().enumerate() {
                for (component, gap) in gap.iter().enumerate() {
                    let g = gap + weight * b.gap.as_ref().map_or(0.0, |b| b[parameter][component]);
                    squares += g * g / (displacement * displacement);
                }
            }
        }
        (squares / a.unknowns.len().max(1) as f64).sqrt()
    }
}

/// The displacement from one state to another.
fn moved(from: &State, to: &State) -> Vec<[f64; 3]> {
    from.u.iter().zip(&to.u).map(|(a, b)| subtract(*b, *a)).collect()
}

/// What part of the first gap is still outstanding: gaps shrink in proportion.
fn remaining(gap: &[[f64; 3]], first: &[[f64; 3]]) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for (g, f) in gap.iter().flatten().zip(first.iter().flatten()) {
        product += g * f;
        square += f * f;
    }
    if square > 0.0 { product / square } else { 0.0 }
}
