//! FAMILY of loads, scaled by the load factor: dead loads, which are constant forces on the reference body, and a
//! pressure that follows the surface.
//!
//! Dead: Pi = - load f . u, so that dPi/du = - load f. To add one: a file here that computes f, and its line in the model.

pub mod gravity;
pub mod nodal_force;
pub mod pressure;
pub mod traction;

pub use gravity::{body_force, gravity};
pub use nodal_force::nodal_force;
pub use pressure::FollowerPressure;
pub use traction::traction;

use super::{Contribution, ElementState, ElementSystem, Term, Want};

/// Constant forces f on the local parameters of elements.
pub struct DeadLoad {
    name: &'static str,
    /// One entry per element of the host, `None` where nothing acts: `[component][function]`, mN.
    forces: Vec<Option<[[f64; 64]; 3]>>,
    /// Quadrature points per element that made them.
    points: usize,
}

impl DeadLoad {
    /// f . u in one element, uJ.
    fn work(&self, state: &ElementState<'_>) -> f64 {
        let Some(force) = &self.forces[state.element] else { return 0.0 };
        (0..3).map(|i| force[i].iter().zip(&state.u[i]).map(|(f, u)| f * u).sum::<f64>()).sum()
    }

    /// target -= scale f.
    fn subtract(&self, element: usize, scale: f64, target: &mut [[f64; 64]; 3]) {
        let Some(force) = &self.forces[element] else { return };
        for i in 0..3 {
            for (t, f) in target[i].iter_mut().zip(&force[i]) {
                *t -= scale * f;
            }
        }
    }
}

impl Term for DeadLoad {
    fn name(&self) -> &str {
        self.name
    }

    fn acts_on(&self, element: usize) -> bool {
        self.forces[element].is_some()
    }

    fn add(&self, state: &ElementState<'_>, _want: Want, system: &mut ElementSystem) -> Contribution {
        self.subtract(state.element, state.load, &mut system.force);
        Contribution { energy: -state.load * self.work(state), det_f: None }
    }

    fn add_load_force(&self, state: &ElementState<'_>, force: &mut [[f64; 64]; 3]) {
        self.subtract(state.element, 1.0, force);
    }

    fn external_work(&self, state: &ElementState<'_>) -> f64 {
        state.load * self.work(state)
    }

    fn is_load(&self) -> bool {
        true
    }

    fn points(&self, _element: usize) -> usize {
        self.points
    }
}
