//! Normal equations of nodal angles: one sparse symmetric system per angle, the size of the mesh.

use super::embed::{Sample, Samples};
use crate::error::{Error, Result};
use crate::mesh::Mesh;
use crate::mesh::element::{Element, Trilinear, ends};
use crate::scene::LossSpec;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Mat, Side};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Nodal angles A and B, radians.
pub type Angles = Vec<[f64; 2]>;

/// What the corners of an element make of the angles of its nodes: k half turns take (A, B) to (A + k pi, (-1)^k B), which is
/// the same axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Corners {
    /// The nodes at the corners.
    pub nodes: Vec<[usize; 8]>,
    /// Half turns at the corners.
    pub turns: Vec<[i32; 8]>,
}

impl Corners {
    /// Without half turns.
    pub fn plain(mesh: &Mesh) -> Corners {
        Corners { nodes: mesh.corners.clone(), turns: vec![[0; 8]; mesh.elements()] }
    }

    /// The sign of B at a corner.
    pub fn sign(&self, element: usize, corner: usize) -> f64 {
        if self.turns[element][corner] % 2 == 0 { 1.0 } else { -1.0 }
    }

    /// A and B at the corners of an element.
    pub fn angles(&self, element: usize, angles: &Angles) -> [[f64; 2]; 8] {
        std::array::from_fn(|c| {
            let [a, b] = angles[self.nodes[element][c]];
            [a + PI * f64::from(self.turns[element][c]), self.sign(element, c) * b]
        })
    }
}

/// The error of a fitted axis against a measured one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// The angle between the lines, from 0 to pi/2.
    pub theta: f64,
    /// The way from the fitted to the measured axis along the directions of growing A and B, radians.
    pub along: [f64; 2],
    /// The length of dn/dA, cos B.
    pub cosine: f64,
}

/// n = (cos B cos A, cos B sin A, -sin B) in the frame; dn/dA = cos B (-sin A, cos A, 0); dn/dB = (-sin B cos A, -sin B sin A,
/// -cos B), at right angles to it. The way is the logarithm on the sphere, with the sign of m that is nearer.
pub fn misfit([a, b]: [f64; 2], m: [f64; 3]) -> Misfit {
    let ((sa, ca), (sb, cb)) = (a.sin_cos(), b.sin_cos());
    let in_plane = ca * m[0] + sa * m[1];
    let dot = cb * in_plane - sb * m[2];
    let side = if dot < 0.0 { -1.0 } else { 1.0 };
    let u = side * (ca * m[1] - sa * m[0]);
    let v = -side * (sb * in_plane + cb * m[2]);
    let sine = u.hypot(v);
    let theta = sine.atan2(dot.abs());
    let scale = if sine > 1e-12 { theta / sine } else { 1.0 };
    Misfit { theta, along: [u * scale, v * scale], cosine: cb }
}

/// rho(theta), its weight omega = rho'(theta) / (2 theta), and omega'(theta) / theta.
pub fn loss(spec: LossSpec, theta: f64) -> [f64; 3] {
    match spec {
        LossSpec::Quadratic => [theta * theta, 1.0, 0.0],
        LossSpec::HuberDeg(scale) => {
            let k = scale.to_radians();
            if theta <= k {
                [theta * theta, 1.0, 0.0]
            } else {
                [2.0 * k * theta - k * k, k / theta, -k / theta.powi(3)]
            }
        }
        LossSpec::CauchyDeg(scale) => {
            let k2 = scale.to_radians().powi(2);
            let omega = 1.0 / (1.0 + theta * theta / k2);
            [k2 * (theta * theta / k2).ln_1p(), omega, -2.0 * omega * omega / k2]
        }
    }
}

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
    /// For each sought angle the right side, per node.
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

/// The sums of one element.
#[derive(Clone, Copy)]
struct ElementSums {
    /// cost, squares, count, scatter, stiffness
    scalars: [f64; 5],
    normal: [[[f64; 8]; 8]; 2],
    gradient: [[f64; 8]; 2],
}

/// Where the pairs of nodes of every element stand in the lower triangle of a sparse matrix.
pub struct Pattern {
    nodes: usize,
    symbolic: SymbolicSparseColMat<usize>,
    factor: SymbolicLlt<usize>,
    /// For each element and pair of corners (row, column) with row >= column as nodes.
    places: Vec<[[u32; 8]; 8]>,
    diagonal: Vec<usize>,
}

impl Pattern {
    /// The pattern of a mesh.
    ///
    /// # Errors
    /// [`Error::FibreSystem`] where there is no memory for it.
    pub fn new(nodes: usize, corners: &[[usize; 8]]) -> Result<Pattern> {
        let mut below: Vec<Vec<usize>> = (0..nodes).map(|node| vec![node]).collect();
        for element in corners {
            for &p in element {
                below[p].extend(element.iter().copied().filter(|q| *q > p));
            }
        }
        let mut starts = vec![0];
        for rows in &mut below {
            rows.sort_unstable();
            rows.dedup();
            starts.push(starts[starts.len() - 1] + rows.len());
        }
        let place = |p: usize, q: usize| {
            let (column, row) = (p.min(q), p.max(q));
            (starts[column] + below[column].binary_search(&row).unwrap_or_default()) as u32
        };
        let places = corners.iter().map(|c| std::array::from_fn(|i| std::array::from_fn(|j| place(c[i], c[j]))));
        let (places, diagonal) = (places.collect(), starts[..nodes].to_vec());
        let symbolic = SymbolicSparseColMat::new_checked(nodes, nodes, starts, None, below.concat());
        let factor = SymbolicLlt::try_new(symbolic.as_ref(), Side::Lower)
            .map_err(|error| Error::FibreSystem { message: format!("{error:?}").into() })?;
        Ok(Pattern { nodes, symbolic, factor, places, diagonal })
    }

    /// The number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Numbers in a matrix.
    pub fn len(&self) -> usize {
        self.symbolic.row_idx().len()
    }

    /// Whether a matrix holds no number.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The place of a pair of corners of an element.
    pub fn place(&self, element: usize, row: usize, column: usize) -> usize {
        self.places[element][row][column] as usize
    }

    /// The trace of a matrix.
    pub fn trace(&self, values: &[f64]) -> f64 {
        self.diagonal.iter().map(|place| values[*place]).sum()
    }

    /// y = M x for a symmetric matrix.
    pub fn apply(&self, values: &[f64], x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.nodes];
        let (starts, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        for column in 0..self.nodes {
            for place in starts[column]..starts[column + 1] {
                let row = rows[place];
                y[row] += values[place] * x[column];
                if row != column {
                    y[column] += values[place] * x[row];
                }
            }
        }
        y
    }

    /// The factors of H + lambda K, in which the rows and columns of fixed nodes are those of the identity.
    ///
    /// # Errors
    /// [`Error::FibreSystem`] where it is not positive definite: a value is not finite.
    pub fn factor(&self, data: &[f64], lambda: f64, smooth: &[f64], fixed: &[bool]) -> Result<Llt<usize, f64>> {
        let mut values: Vec<f64> = data.iter().zip(smooth).map(|(h, k)| h + lambda * k).collect();
        // what nothing determines, not even its neighbours, stays where it is
        let ridge = 1e-14 * (self.trace(&values) / self.nodes as f64).max(f64::MIN_POSITIVE);
        let (starts, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        for column in 0..self.nodes {
            for place in starts[column]..starts[column + 1] {
                if fixed[column] || fixed[rows[place]] {
                    values[place] = if rows[place] == column { 1.0 } else { 0.0 };
                }
            }
            values[starts[column]] += ridge;
        }
        let matrix = SparseColMatRef::new(self.symbolic.as_ref(), &values);
        Llt::try_new_with_symbolic(self.factor.clone(), matrix, Side::Lower)
            .map_err(|error| Error::FibreSystem { message: format!("{error:?}").into() })
    }
}

/// Solves for one right side.
pub fn solve(factor: &Llt<usize, f64>, right: &[f64]) -> Vec<f64> {
    let mut x = Mat::from_fn(right.len(), 1, |i, _| right[i]);
    factor.solve_in_place(x.as_mut());
    (0..right.len()).map(|i| x[(i, 0)]).collect()
}

/// The data of one element.
fn of_element(
    samples: &[Sample],
    corners: &[[f64; 2]; 8],
    signs: &[f64; 8],
    loss_spec: LossSpec,
    sought: usize,
    take: impl Fn(&Sample) -> bool,
) -> ElementSums {
    let mut sums = ElementSums { scalars: [0.0; 5], normal: [[[0.0; 8]; 8]; 2], gradient: [[0.0; 8]; 2] };
    for sample in samples.iter().filter(|sample| take(sample)) {
        let psi = Trilinear.values(sample.xi);
        let mut at = [0.0; 2];
        for c in 0..8 {
            at[0] += psi[c] * corners[c][0];
            at[1] += psi[c] * corners[c][1];
        }
        let found = misfit(at, sample.axis);
        let [rho, part, bend] = loss(loss_spec, found.theta);
        let weight = sample.weight * part;
        sums.scalars[0] += sample.weight * rho;
        sums.scalars[2] += weight * sought as f64;
        let rates = [found.cosine, 1.0];
        for k in 0..sought {
            let square = found.along[k] * found.along[k];
            sums.scalars[1] += weight * square;
            sums.scalars[3] += weight * part * square;
            sums.scalars[4] += sample.weight * (part + bend * square);
            let (force, stiffness) = (weight * rates[k] * found.along[k], weight * rates[k] * rates[k]);
            for i in 0..8 {
                sums.gradient[k][i] += force * psi[i];
                let row = stiffness * psi[i];
                for j in 0..8 {
                    sums.normal[k][i][j] += row * psi[j];
                }
            }
        }
    }
    if sought == 2 {
        for i in 0..8 {
            sums.gradient[1][i] *= signs[i];
            for j in 0..8 {
                sums.normal[1][i][j] *= signs[i] * signs[j];
            }
        }
    }
    sums
}

/// The sums over the samples that `take` takes, at some angles of which the first `sought` are sought; the same bits for any
/// number of threads.
pub fn sums(
    pattern: &Pattern,
    samples: &Samples,
    corners: &Corners,
    angles: &Angles,
    loss: LossSpec,
    sought: usize,
    take: impl Fn(&Sample) -> bool + Sync,
) -> Sums {
    let mut sums = Sums {
        cost: 0.0,
        squares: 0.0,
        count: 0.0,
        scatter: 0.0,
        stiffness: 0.0,
        normal: vec![vec![0.0; pattern.len()]; sought],
        gradient: vec![vec![0.0; pattern.nodes()]; sought],
    };
    let elements: Vec<usize> = (0..samples.elements()).filter(|e| !samples.of(*e).is_empty()).collect();
    for chunk in elements.chunks(512) {
        let parts: Vec<ElementSums> = chunk
            .par_iter()
            .map(|&e| {
                let signs = std::array::from_fn(|c| corners.sign(e, c));
                of_element(samples.of(e), &corners.angles(e, angles), &signs, loss, sought, &take)
            })
            .collect();
        for (&e, part) in chunk.iter().zip(&parts) {
            sums.cost += part.scalars[0];
            sums.squares += part.scalars[1];
            sums.count += part.scalars[2];
            sums.scatter += part.scalars[3];
            sums.stiffness += part.scalars[4];
            for k in 0..sought {
                for i in 0..8 {
                    sums.gradient[k][corners.nodes[e][i]] += part.gradient[k][i];
                    for j in 0..8 {
                        // once per pair of corners; a collapsed pair of corners is one node and counts both ways
                        let (p, q) = (corners.nodes[e][i], corners.nodes[e][j]);
                        if p >= q {
                            sums.normal[k][pattern.place(e, i, j)] += part.normal[k][i][j];
                        }
                    }
                }
            }
        }
    }
    sums
}

/// The integral over the unit cube of grad psi_i . grad psi_j.
pub fn cube() -> [[f64; 8]; 8] {
    let (stiff, mass) = ([[1.0, -1.0], [-1.0, 1.0]], [[1.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 3.0]]);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (p, q) = (ends(i), ends(j));
            let factor = |d: usize, along: usize| (if d == along { stiff } else { mass })[p[d]][q[d]];
            (0..3).map(|along| (0..3).map(|d| factor(d, along)).product::<f64>()).sum()
        })
    })
}

/// The smoothness of some angles: its value, and per angle half its gradient per node.
pub fn roughness(corners: &Corners, angles: &Angles, sought: usize) -> (f64, Vec<Vec<f64>>) {
    let cube = cube();
    let mut value = 0.0;
    let mut gradient = vec![vec![0.0; angles.len()]; sought];
    for e in 0..corners.nodes.len() {
        let local = corners.angles(e, angles);
        for k in 0..sought {
            for i in 0..8 {
                let force: f64 = (0..8).map(|j| cube[i][j] * local[j][k]).sum();
                value += force * local[i][k];
                let sign = if k == 1 { corners.sign(e, i) } else { 1.0 };
                gradient[k][corners.nodes[e][i]] += sign * force;
            }
        }
    }
    (value, gradient)
}

/// The matrices of [`roughness`], per angle.
pub fn smooth(pattern: &Pattern, corners: &Corners, sought: usize) -> Vec<Vec<f64>> {
    let cube = cube();
    let of_angle = |k: usize| {
        let mut values = vec![0.0; pattern.len()];
        for e in 0..corners.nodes.len() {
            for i in 0..8 {
                for j in 0..8 {
                    if corners.nodes[e][i] >= corners.nodes[e][j] {
                        let sign = if k == 1 { corners.sign(e, i) * corners.sign(e, j) } else { 1.0 };
                        values[pattern.place(e, i, j)] += sign * cube[i][j];
                    }
                }
            }
        }
        values
    };
    (0..sought).map(of_angle).collect()
}
