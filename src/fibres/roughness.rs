//! How much angles change along the elements: the integral over the unit cube of |dA/dxi|^2 + |dB/dxi|^2, summed over elements.

use super::pattern::Pattern;
use super::space::{Angles, Space};
use crate::math::quadrature::GaussRule;
use crate::mesh::element::Element;

/// The smoothness of a space: its matrix in an element, and its matrices per angle in the places of a [`Pattern`].
#[derive(Debug, Clone)]
pub struct Roughness {
    cube: Vec<Vec<f64>>,
    /// Per sought angle.
    pub matrices: Vec<Vec<f64>>,
}

/// The integral over the unit cube of grad N_i . grad N_j.
pub fn cube(basis: &dyn Element) -> Vec<Vec<f64>> {
    // four points are exact for products of cubics
    let rule = GaussRule::new(4);
    let integral = |f: &dyn Fn(f64) -> [f64; 4]| -> [[f64; 4]; 4] {
        let mut sums = [[0.0; 4]; 4];
        for (x, weight) in rule.points.iter().zip(&rule.weights) {
            let values = f(*x);
            for i in 0..4 {
                (0..4).for_each(|j| sums[i][j] += weight * values[i] * values[j]);
            }
        }
        sums
    };
    let (mass, stiff) = (integral(&|x| basis.values_1d(x)), integral(&|x| basis.slopes_1d(x)));
    let entry = |i: usize, j: usize| -> f64 {
        let (p, q) = (basis.factors(i), basis.factors(j));
        let factor = |d: usize, along: usize| (if d == along { &stiff } else { &mass })[p[d]][q[d]];
        (0..3).map(|along| (0..3).map(|d| factor(d, along)).product::<f64>()).sum()
    };
    (0..basis.functions()).map(|i| (0..basis.functions()).map(|j| entry(i, j)).collect()).collect()
}

impl Roughness {
    /// Of a space, for so many angles.
    pub fn new(space: &Space, pattern: &Pattern, sought: usize) -> Roughness {
        let cube = cube(space.basis());
        let of_angle = |k: usize| {
            let mut values = pattern.zeros();
            (0..space.elements()).for_each(|e| pattern.scatter(space, e, k, |i, j| cube[i][j], &mut values));
            values
        };
        Roughness { matrices: (0..sought).map(of_angle).collect(), cube }
    }

    /// That of a value alone at a node of eight elements.
    pub fn of_a_node(&self) -> f64 {
        8.0 * self.cube[0][0]
    }

    /// Its value for some angles, and per angle half its gradient per parameter.
    pub fn at(&self, space: &Space, angles: &Angles) -> (f64, Vec<Vec<f64>>) {
        let sought = self.matrices.len();
        let mut value = 0.0;
        let mut gradient = vec![vec![0.0; angles.len()]; sought];
        for e in 0..space.elements() {
            let local = space.local(e, angles);
            for k in 0..sought {
                for (i, row) in self.cube.iter().enumerate() {
                    let force: f64 = row.iter().zip(&local).map(|(c, local)| c * local[k]).sum();
                    value += force * local[i][k];
                    let sign = space.sign(e, i, k);
                    for term in space.map.terms(e, i) {
                        gradient[k][term.global as usize] += sign * term.scale * force;
                    }
                }
            }
        }
        (value, gradient)
    }
}
