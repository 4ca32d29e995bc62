//! Normal equations of angles: one sparse symmetric system per angle, the size of the mesh.

use super::embed::{Sample, Samples};
use super::misfit::{loss, misfit};
use super::moments::{self, Moments, Products, legendre};
use super::pattern::Pattern;
use super::space::{Angles, Local, Space};
use crate::mesh::element::{Element, TricubicHermite, Trilinear};
use crate::scene::{FieldSpec, LossSpec};
use rayon::prelude::*;

/// Elements whose sums are held at a time.
const AT_ONCE: usize = 512;

/// Sums over the data at some angles.
#[derive(Debug, Clone)]
pub struct Sums {
    /// Sum of w rho(theta).
    pub cost: f64,
    /// Sum of weighted squares of what the sought angles can mend, radians squared.
    pub squares: f64,
    /// Sum of weights w omega, times the number of sought angles.
    pub count: f64,
    /// Sum of w (omega r)^2: how much the forces on the angles scatter.
    pub scatter: f64,
    /// Sum of w d(omega r)/dr: how stiff these forces are.
    pub stiffness: f64,
    /// For each sought angle the matrix in the places of the [`Pattern`].
    pub normal: Vec<Vec<f64>>,
    /// For each sought angle the right side, per parameter.
    pub gradient: Vec<Vec<f64>>,
}

impl Sums {
    /// The standard deviation that, over the weighted normal equations, gives that of the angles, radians: of the measurement
    /// along one direction where the loss is quadratic; of a robust loss scatter x count / stiffness^2 is the variance of an
    /// M-estimator (Huber 1981, section 7.6) brought to the weights w omega. `freedom`: numbers that the data determine.
    pub fn noise(&self, freedom: f64) -> f64 {
        let free = self.count / (self.count - freedom).max(1.0);
        (free * self.scatter * self.count).sqrt() / self.stiffness.max(f64::MIN_POSITIVE)
    }

    /// Adds `factor` times other sums.
    pub fn add(&mut self, factor: f64, other: &Sums) {
        self.cost += factor * other.cost;
        self.squares += factor * other.squares;
        self.count += factor * other.count;
        self.scatter += factor * other.scatter;
        self.stiffness += factor * other.stiffness;
        let pairs = self.normal.iter_mut().zip(&other.normal).chain(self.gradient.iter_mut().zip(&other.gradient));
        pairs.for_each(|(to, from)| to.iter_mut().zip(from).for_each(|(to, from)| *to += factor * from));
    }
}

/// The sums of one element with N functions.
struct ElementSums<const N: usize> {
    /// cost, squares, count, scatter, stiffness
    scalars: [f64; 5],
    /// The lower triangle of each matrix.
    normal: Vec<[[f64; N]; N]>,
    gradient: Vec<[f64; N]>,
}

/// The data of one element, without the signs of its corners; its matrices by moments where there are products.
fn of_element<const N: usize>(
    basis: &impl Element,
    samples: &[Sample],
    local: &Local,
    loss_spec: LossSpec,
    sought: usize,
    products: Option<&Products>,
    take: impl Fn(&Sample) -> bool,
) -> ElementSums<N> {
    let mut sums =
        ElementSums { scalars: [0.0; 5], normal: vec![[[0.0; N]; N]; sought], gradient: vec![[0.0; N]; sought] };
    let mut moments: Vec<Moments> = vec![Moments::default(); if products.is_some() { sought } else { 0 }];
    for sample in samples.iter().filter(|sample| take(sample)) {
        let psi = basis.values(sample.xi);
        let mut at = [0.0; 2];
        for a in 0..N {
            at[0] += psi[a] * local[a][0];
            at[1] += psi[a] * local[a][1];
        }
        let found = misfit(at, sample.axis);
        let [rho, part, bend] = loss(loss_spec, found.theta);
        let weight = sample.weight * part;
        sums.scalars[0] += sample.weight * rho;
        sums.scalars[2] += weight * sought as f64;
        let rates = [found.cosine, 1.0];
        let stiffness = rates.map(|rate| weight * rate * rate);
        for k in 0..sought {
            let square = found.along[k] * found.along[k];
            sums.scalars[1] += weight * square;
            sums.scalars[3] += weight * part * square;
            sums.scalars[4] += sample.weight * (part + bend * square);
            let force = weight * rates[k] * found.along[k];
            (0..N).for_each(|i| sums.gradient[k][i] += force * psi[i]);
        }
        if products.is_some() {
            moments::add(&mut moments, &sample.xi.map(legendre), &stiffness);
            continue;
        }
        for (normal, stiffness) in sums.normal.iter_mut().zip(stiffness) {
            for i in 0..N {
                let row = stiffness * psi[i];
                for j in 0..=i {
                    normal[i][j] += row * psi[j];
                }
            }
        }
    }
    if let Some(products) = products {
        let matrices = sums.normal.iter_mut().zip(&moments);
        matrices.for_each(|(normal, moments)| products.fill(basis, moments, normal));
    }
    sums
}

/// The sums over the samples that `take` takes, at some angles of which the first `sought` are sought; the same bits for any
/// number of threads.
pub fn sums(
    pattern: &Pattern,
    samples: &Samples,
    space: &Space,
    angles: &Angles,
    loss: LossSpec,
    sought: usize,
    take: impl Fn(&Sample) -> bool + Sync,
) -> Sums {
    let zeros = Sums {
        cost: 0.0,
        squares: 0.0,
        count: 0.0,
        scatter: 0.0,
        stiffness: 0.0,
        normal: vec![pattern.zeros(); sought],
        gradient: vec![vec![0.0; pattern.parameters()]; sought],
    };
    let local = |e: usize| space.local(e, angles);
    match space.field {
        FieldSpec::Trilinear => summed(zeros, pattern, samples, space, |e| {
            of_element::<8>(&Trilinear, samples.of(e), &local(e), loss, sought, None, &take)
        }),
        FieldSpec::Tricubic => {
            let products = Products::new(&TricubicHermite);
            summed(zeros, pattern, samples, space, |e| {
                of_element::<64>(&TricubicHermite, samples.of(e), &local(e), loss, sought, Some(&products), &take)
            })
        }
    }
}

/// The sums of all elements with data, added in their order.
fn summed<const N: usize>(
    mut sums: Sums,
    pattern: &Pattern,
    samples: &Samples,
    space: &Space,
    of_element: impl Fn(usize) -> ElementSums<N> + Sync,
) -> Sums {
    let elements: Vec<usize> = (0..samples.elements()).filter(|e| !samples.of(*e).is_empty()).collect();
    for chunk in elements.chunks(AT_ONCE) {
        let parts: Vec<ElementSums<N>> = chunk.par_iter().map(|&e| of_element(e)).collect();
        for (&e, part) in chunk.iter().zip(&parts) {
            sums.cost += part.scalars[0];
            sums.squares += part.scalars[1];
            sums.count += part.scalars[2];
            sums.scatter += part.scalars[3];
            sums.stiffness += part.scalars[4];
            for (k, (normal, gradient)) in part.normal.iter().zip(&part.gradient).enumerate() {
                pattern.scatter(space, e, k, |i, j| normal[i.max(j)][i.min(j)], &mut sums.normal[k]);
                for i in 0..N {
                    let force = space.sign(e, i, k) * gradient[i];
                    for term in space.map.terms(e, i) {
                        sums.gradient[k][term.global as usize] += term.scale * force;
                    }
                }
            }
        }
    }
    sums
}
