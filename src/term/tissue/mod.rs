//! Passive tissue: an isochoric law, incompressibility by a pressure, and a volumetric term beside it
//! (Wu et al. 2013, Eqs. 3 and 5; the term with kappa is ours).
//!
//! Pi = sum over points w [ psi(F) - p (J - 1) + U(J) ],  U(J) = kappa/4 (J^2 - 1 - 2 ln J)
//!
//! With H = cof F = dJ/dF, a function N_a of the displacement and psi_c of the pressure:
//! ```text
//! dPi/du_ia     = sum w (P + (U' - p) H)_iJ N_a,J
//! dPi/dp_c      = - sum w psi_c (J - 1)
//! d2Pi/du du    = sum w N_a,J [A + (U' - p) d2J + U'' H (x) H]_iJkL N_b,L
//! d2Pi/du dp    = - sum w psi_c H_iJ N_a,J
//! ```
//! Derivatives by X are pulled back to xi at the points, so that the sums run over the tensor-product basis.

mod kernel;

use super::pressure::PressureSpace;
use super::{Contribution, DetF, ElementState, ElementSystem, MAX_PRESSURES, Term, Want};
use crate::material::mooney_rivlin::second_derivative_of_j;
use crate::material::{Law, PAIRS};
use crate::math::lanes::{Lanes, MatrixLanes, WIDTH, cofactors, dot};
use crate::math::quadrature::GaussRule;
use crate::math::tensor::{determinant, inverse};
use crate::mesh::{Mesh, position_and_jacobian};
use kernel::{Scratch, Tables};
use pulp::{Arch, Simd, WithSimd};

/// A quadrature point of the reference geometry where det(dX/dxi) is not positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inverted {
    /// Element index.
    pub element: usize,
    /// Local coordinates of the worst point.
    pub xi: [f64; 3],
    /// det(dX/dxi) there, mm3.
    pub det: f64,
}

/// The passive tissue of the whole host.
pub struct Tissue<L> {
    /// The law of the whole, then those of parts.
    laws: Vec<L>,
    /// The law of each element.
    law_of: Vec<usize>,
    /// Volumetric modulus kappa beside the pressure, kPa; 0 is the paper's own setting.
    kappa: f64,
    tables: Tables,
    /// psi_c at each point.
    pressure: Vec<[f64; MAX_PRESSURES]>,
    elements: Vec<Reference>,
    arch: Arch,
}

/// Reference geometry at the points of one element, eight points at a time.
struct Reference {
    /// dxi/dX, 1/mm: `[batch][alpha][J]`.
    inverse: Vec<MatrixLanes>,
    /// Gauss weight x det(dX/dxi), mm3; zero in the lanes that only fill up the last batch.
    weight: Vec<Lanes>,
}

impl<L: Law> Tissue<L> {
    /// Tissue of the given law in all elements of a tricubic Hermite mesh, `gauss` points per direction.
    ///
    /// Errors: the worst point of the first element whose reference geometry is inverted.
    pub fn new(
        mesh: &Mesh,
        law: L,
        kappa: f64,
        space: &dyn PressureSpace,
        gauss: usize,
    ) -> Result<Tissue<L>, Inverted> {
        let rule = GaussRule::new(gauss);
        let points: Vec<_> = rule.cube().collect();
        let batches = points.len().div_ceil(WIDTH);
        let mut elements = Vec::with_capacity(mesh.elements());
        for element in 0..mesh.elements() {
            let local = mesh.local(element);
            let mut reference =
                Reference { inverse: vec![[[Lanes::ZERO; 3]; 3]; batches], weight: vec![Lanes::ZERO; batches] };
            let mut worst = Inverted { element, xi: [0.0; 3], det: f64::INFINITY };
            for q in 0..batches * WIDTH {
                // lanes beyond the last point repeat it with weight zero
                let (xi, weight) = points[q.min(points.len() - 1)];
                let (_, jacobian) = position_and_jacobian(mesh.element, &local, xi);
                let det = determinant(&jacobian);
                if det.is_nan() || det < worst.det {
                    worst = Inverted { element, xi, det };
                }
                let inverse = inverse(&jacobian, det);
                let (batch, lane) = (q / WIDTH, q % WIDTH);
                for (target, source) in reference.inverse[batch].iter_mut().flatten().zip(inverse.iter().flatten()) {
                    target.0[lane] = *source;
                }
                reference.weight[batch].0[lane] = if q < points.len() { weight * det } else { 0.0 };
            }
            if worst.det.is_nan() || worst.det <= 0.0 {
                return Err(worst);
            }
            elements.push(reference);
        }
        Ok(Tissue {
            laws: vec![law],
            law_of: vec![0; mesh.elements()],
            kappa,
            tables: Tables::new(&rule.points),
            pressure: points.iter().map(|(xi, _)| space.values(*xi)).collect(),
            elements,
            arch: Arch::new(),
        })
    }

    /// Gives the elements of a part other constants.
    pub fn set_law(&mut self, elements: &[usize], law: L) {
        for element in elements {
            self.law_of[*element] = self.laws.len();
        }
        self.laws.push(law);
    }

    /// The reference volume, mm3.
    pub fn volume(&self) -> f64 {
        self.elements.iter().flat_map(|e| &e.weight).flat_map(|w| w.0).sum()
    }
}

impl<L: Law> Term for Tissue<L> {
    fn name(&self) -> &str {
        "tissue"
    }

    fn acts_on(&self, _element: usize) -> bool {
        true
    }

    fn points(&self, _element: usize) -> usize {
        self.pressure.len()
    }

    fn add(&self, state: &ElementState<'_>, want: Want, system: &mut ElementSystem) -> Contribution {
        self.arch.dispatch(Add { tissue: self, state, want, system })
    }
}

/// [`Term::add`], compiled once per instruction set and chosen at run time.
struct Add<'a, L> {
    tissue: &'a Tissue<L>,
    state: &'a ElementState<'a>,
    want: Want,
    system: &'a mut ElementSystem,
}

impl<L: Law> WithSimd for Add<'_, L> {
    type Output = Contribution;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Contribution {
        // every instruction set beyond the scalar one has a fused multiply-add
        if S::IS_SCALAR {
            add::<L, false>(self.tissue, self.state, self.want, self.system)
        } else {
            add::<L, true>(self.tissue, self.state, self.want, self.system)
        }
    }
}

/// Fields at the points of one element, pulled back to xi and weighted.
struct PointFields {
    /// w (P + (U' - p) H) dxi/dX: `[alpha][q][component]`.
    stress: [Vec<[f64; 4]>; 3],
    /// w H dxi/dX: `[alpha][q][component]`.
    cofactor: [Vec<[f64; 4]>; 3],
    /// w (J - 1).
    volume: Vec<f64>,
    /// The pulled-back tangent of each component pair: `[pair][3 alpha + beta][q]`.
    tangent: [[Vec<f64>; 9]; 6],
}

#[inline(always)]
fn add<L: Law, const FMA: bool>(
    tissue: &Tissue<L>,
    state: &ElementState<'_>,
    want: Want,
    system: &mut ElementSystem,
) -> Contribution {
    let points = tissue.pressure.len();
    let reference = &tissue.elements[state.element];
    let law = &tissue.laws[tissue.law_of[state.element]];
    let padded = reference.weight.len() * WIDTH;

    // dx/dxi at the points; the lanes that fill up the last batch repeat the last point
    let mut local = [[0.0; 4]; 64];
    for (a, local) in local.iter_mut().enumerate() {
        *local = [state.x[0][a], state.x[1][a], state.x[2][a], 0.0];
    }
    let mut gradients: [Vec<[f64; 4]>; 3] = std::array::from_fn(|_| vec![[0.0; 4]; padded]);
    tissue.tables.gradients::<FMA, 4>(&local, &mut gradients);
    for gradient in &mut gradients {
        let last = gradient[points - 1];
        gradient[points..].fill(last);
    }

    let stiffness = want == Want::Stiffness;
    let tangent_length = if stiffness { padded } else { 0 };
    let mut fields = PointFields {
        stress: std::array::from_fn(|_| vec![[0.0; 4]; padded]),
        cofactor: std::array::from_fn(|_| vec![[0.0; 4]; padded]),
        volume: vec![0.0; padded],
        tangent: std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; tangent_length])),
    };
    let mut energy = 0.0;
    let mut det_f = DetF { min: f64::INFINITY, min_point: 0, max: f64::NEG_INFINITY };
    for batch in 0..reference.weight.len() {
        let first = batch * WIDTH;
        let mut pressure = Lanes::ZERO;
        for (lane, p) in pressure.0.iter_mut().enumerate() {
            let psi = &tissue.pressure[(first + lane).min(points - 1)];
            for c in 0..MAX_PRESSURES {
                *p += psi[c] * state.p[c];
            }
        }
        let mut dx = [[Lanes::ZERO; 3]; 3];
        for (alpha, gradient) in gradients.iter().enumerate() {
            for lane in 0..WIDTH {
                for i in 0..3 {
                    dx[i][alpha].0[lane] = gradient[first + lane][i];
                }
            }
        }
        let (inverse, weight) = (&reference.inverse[batch], reference.weight[batch]);
        let j = point_response(
            law,
            tissue.kappa,
            &dx,
            inverse,
            weight,
            pressure,
            first,
            stiffness,
            &mut fields,
            &mut energy,
        );
        for (lane, &j) in j.0.iter().enumerate().take(points - first.min(points)) {
            if j.is_nan() || j < det_f.min {
                (det_f.min, det_f.min_point) = (j, first + lane);
            }
            det_f.max = det_f.max.max(j);
        }
    }

    let mut force = [[0.0; 4]; 64];
    tissue.tables.tested::<FMA, 4>(|alpha, q| fields.stress[alpha][q], &mut force);
    for (a, force) in force.iter().enumerate() {
        for i in 0..3 {
            system.force[i][a] += force[i];
        }
    }
    for (psi, volume) in tissue.pressure.iter().zip(&fields.volume) {
        for c in 0..MAX_PRESSURES {
            system.volume[c] -= psi[c] * volume;
        }
    }
    if stiffness {
        let mut scratch = Scratch::new(tissue.tables.points);
        for (pair, &(i, k)) in PAIRS.iter().enumerate() {
            tissue.tables.stiffness::<FMA>(&fields.tangent[pair], i == k, &mut scratch, &mut system.stiffness[pair]);
        }
        for i in 0..3 {
            let mut coupling = [[0.0; MAX_PRESSURES]; 64];
            let field = |alpha: usize, q: usize| {
                let h: f64 = fields.cofactor[alpha][q][i];
                tissue.pressure[q].map(|psi| psi * h)
            };
            tissue.tables.tested::<FMA, MAX_PRESSURES>(field, &mut coupling);
            for (target, source) in system.coupling[i].iter_mut().zip(&coupling) {
                for c in 0..MAX_PRESSURES {
                    target[c] -= source[c];
                }
            }
        }
    }
    Contribution { energy, det_f: Some(det_f) }
}

/// Evaluates law, pressure and volumetric term at eight points and pulls the results back; returns J.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one call site; the arguments are the loop's own variables
fn point_response<L: Law>(
    law: &L,
    kappa: f64,
    dx: &MatrixLanes,
    inverse: &MatrixLanes,
    weight: Lanes,
    pressure: Lanes,
    first: usize,
    stiffness: bool,
    fields: &mut PointFields,
    energy: &mut f64,
) -> Lanes {
    // F = dx/dxi dxi/dX
    let mut f = [[Lanes::ZERO; 3]; 3];
    for i in 0..3 {
        for p in 0..3 {
            f[i][p] = dx[i][0] * inverse[0][p] + dx[i][1] * inverse[1][p] + dx[i][2] * inverse[2][p];
        }
    }
    let response = law.response(&f);
    let h = cofactors(&f);
    let j = dot(f[0], h[0]);
    let j_inverse = j.recip();
    // U = kappa/4 (J^2 - 1 - 2 ln J), U' = kappa/2 (J - 1/J), U'' = kappa/2 (1 + 1/J^2)
    let u = (0.25 * kappa) * (j * j + Lanes::splat(-1.0) - 2.0 * j.map(f64::ln));
    let slope = (0.5 * kappa) * (j - j_inverse) - pressure;
    let curvature = (0.5 * kappa) * (Lanes::splat(1.0) + j_inverse * j_inverse);
    let excess = j + Lanes::splat(-1.0);
    let density = response.energy + if kappa > 0.0 { u } else { Lanes::ZERO } - pressure * excess;
    let weighted = weight * density;
    for (l, w) in weighted.0.iter().enumerate() {
        // a lane of weight zero only fills up the batch
        if weight.0[l] > 0.0 {
            *energy += w;
        }
    }
    let volume = weight * excess;
    fields.volume[first..first + WIDTH].copy_from_slice(&volume.0);

    for alpha in 0..3 {
        for i in 0..3 {
            let mut stress = Lanes::ZERO;
            let mut cofactor = Lanes::ZERO;
            for p in 0..3 {
                stress += (response.stress[i][p] + slope * h[i][p]) * inverse[alpha][p];
                cofactor += h[i][p] * inverse[alpha][p];
            }
            let (stress, cofactor) = (weight * stress, weight * cofactor);
            for lane in 0..WIDTH {
                fields.stress[alpha][first + lane][i] = stress.0[lane];
                fields.cofactor[alpha][first + lane][i] = cofactor.0[lane];
            }
        }
    }
    if stiffness {
        for (pair, &(i, k)) in PAIRS.iter().enumerate() {
            let mut tangent = response.tangent[pair];
            for p in 0..3 {
                for q in 0..3 {
                    tangent[p][q] += curvature * h[i][p] * h[k][q];
                    if i != k && p != q {
                        tangent[p][q] += slope * second_derivative_of_j(&f, (i, k), (p, q));
                    }
                }
            }
            // inverse A inverse^T, weighted
            let mut half = [[Lanes::ZERO; 3]; 3];
            for alpha in 0..3 {
                for q in 0..3 {
                    half[alpha][q] = weight
                        * (inverse[alpha][0] * tangent[0][q]
                            + inverse[alpha][1] * tangent[1][q]
                            + inverse[alpha][2] * tangent[2][q]);
                }
            }
            for alpha in 0..3 {
                for beta in 0..3 {
                    let value = dot(half[alpha], inverse[beta]);
                    fields.tangent[pair][3 * alpha + beta][first..first + WIDTH].copy_from_slice(&value.0);
                }
            }
        }
    }
    j
}
