//! How an equilibrium moves with the controls: dx/dq, one direction in the unknowns per control.

use crate::error::Result;
use crate::forward::{Drive, Equilibrium, Settings, Solver};
use crate::mesh::MaterialPoint;
use crate::model::{Model, State};
use nalgebra::DMatrix;

/// A way to find sensitivities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sensitivity {
    /// By the implicit function theorem: K dx/dq = - dr/dq. One right-hand side per control with the factor of Newton's
    /// last iteration.
    Tangent,
    /// By differences of whole equilibria: a check, and a choice where a tangent is not trusted.
    FiniteDifference {
        /// Change of a control in relation to (its value + its onset).
        step: f64,
    },
}

/// What becomes of sensitivities after a step of a fit. The step that ends a fit is always made with fresh ones: with stale
/// ones the iteration would come to rest where the residuals are not stationary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reuse {
    /// They are found anew after every step.
    Fresh,
    /// They are kept until no step is made with them.
    Frozen,
    /// They are kept but for what the step shows: D + (dx - D dq) dq^T / |dq|^2 (Broyden 1965).
    Broyden,
    /// They are kept as a response keeps them that is even in t = ln(1 + (q - lower) / onset), and the gradient is exact at
    /// every step: by one solve with the transposed tangent. Only with [`Sensitivity::Tangent`].
    Adjoint,
}

/// How much tighter than a fit's own equilibria those of finite differences are solved.
const TIGHTER: f64 = 1e-4;

/// dx/dq at an equilibrium for the controls `unknowns`, in their order.
///
/// # Errors
/// Where the tangent cannot be factorised, or a neighbouring equilibrium is not found.
pub fn sensitivities(
    how: Sensitivity,
    solver: &mut Solver<'_>,
    at: &Equilibrium,
    unknowns: &[usize],
) -> Result<Vec<Vec<f64>>> {
    match how {
        Sensitivity::Tangent => solver.rates(&at.state, unknowns),
        Sensitivity::FiniteDifference { step } => {
            let settings = solver.settings();
            // a neighbour must be one: on the same branch, stable or not
            let tolerance = TIGHTER * settings.tolerance;
            solver.set_settings(Settings { tolerance, release: false, ..settings });
            let found = unknowns.iter().map(|control| difference(solver, at, *control, step)).collect();
            solver.set_settings(settings);
            found
        }
    }
}

/// How material points move with the controls `unknowns` at a state: mm per unit of a control, three rows and a column for
/// each, from the direction that belongs to it.
pub fn rates_at(
    model: &Model,
    state: &State,
    unknowns: &[usize],
    directions: &[Vec<f64>],
    points: &[MaterialPoint],
) -> Vec<DMatrix<f64>> {
    let mut rates = vec![DMatrix::zeros(3, unknowns.len()); points.len()];
    for (column, (control, direction)) in unknowns.iter().zip(directions).enumerate() {
        let du = model.displacement_rate(state, *control, direction);
        for (rate, point) in rates.iter_mut().zip(points) {
            rate.column_mut(column).copy_from_slice(&model.mesh().interpolate(*point, &du));
        }
    }
    rates
}

/// (x(q + h) - x(q - h)) / 2h, or (4 x(q + h) - x(q + 2h) - 3 x(q)) / 2h where q - h is out of bounds, or its mirror image
/// at the upper bound.
fn difference(solver: &mut Solver<'_>, at: &Equilibrium, control: usize, step: f64) -> Result<Vec<f64>> {
    let model: &Model = solver.model();
    let bounds = &model.controls()[control];
    let q = at.state.controls[control];
    let h = step * (q - bounds.lower + bounds.onset);
    let mut moved = |by: f64| -> Result<Vec<f64>> {
        let mut controls = at.state.controls.clone();
        controls[control] += by;
        let to = Drive { controls, load: at.state.load };
        let found = solver.equilibrium_near(&at.state, &at.state, &to)?;
        Ok(model.unknowns(&found.state))
    };
    let combine = |terms: &[(f64, Vec<f64>)]| -> Vec<f64> {
        (0..model.numbering().unknowns()).map(|k| terms.iter().map(|(w, x)| w * x[k]).sum()).collect()
    };
    let inverse = 1.0 / (2.0 * h);
    if q - h >= bounds.lower && q + h <= bounds.upper {
        return Ok(combine(&[(inverse, moved(h)?), (-inverse, moved(-h)?)]));
    }
    let side = if q - h < bounds.lower { 1.0 } else { -1.0 };
    let scale = side * inverse;
    Ok(combine(&[(4.0 * scale, moved(side * h)?), (-scale, moved(2.0 * side * h)?), (-3.0 * scale, moved(0.0)?)]))
}
