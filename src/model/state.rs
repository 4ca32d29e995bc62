//! The only thing that changes: displacement, pressure, controls, load; on the way to an equilibrium also contact.

/// Unknowns and inputs at an instant.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Displacement, one triple per global parameter, mm (per unit xi for derivatives).
    pub u: Vec<[f64; 3]>,
    /// Pressure parameters, kPa.
    pub p: Vec<f64>,
    /// Controls in the order of the model, for example activations in [0, 1].
    pub controls: Vec<f64>,
    /// Factor on loads and prescribed motions.
    pub load: f64,
    /// By how much contact sets in more slowly than its laws say, mm; 0 but on the way to an equilibrium.
    pub easing: f64,
    /// Multipliers of each term in the order of the model, kPa; empty for a term that has none.
    pub multipliers: Vec<Vec<f64>>,
}
