//! From elements to the whole: forces and stiffness of all terms, in parallel and with the same bits on any number of
//! threads.
//!
//! Two passes. The first fills one small system per element, independently. The second fills the columns of the matrix
//! group by group: every group adds its elements in ascending order and then the pairs of faces that meet, whoever does
//! it.

use super::numbering::{Numbering, Run};
use super::state::State;
use crate::material::PAIRS;
use crate::math::sparse::{BlockPattern, SymmetricMatrix};
use crate::math::tensor::Vector;
use crate::mesh::Mesh;
use crate::mesh::face::Face;
use crate::term::coupling::{BodyState, FacePair};
use crate::term::pressure::PressureSpace;
use crate::term::{DetF, ElementState, ElementSystem, MAX_PRESSURES, Term, Want};
use rayon::prelude::*;
use std::time::Instant;

/// Local entries of an element: three components of 64 functions, then the pressures.
const LOCAL: usize = 192 + MAX_PRESSURES;

/// Batches into which the columns are divided for the second pass.
const BATCHES: usize = 64;

/// What the assembler needs to know of a model; shared by all threads.
pub(super) struct Plan {
    /// Terms that act on each element, in the order of the model.
    active: Vec<Vec<usize>>,
    /// Global pressure parameters of each element.
    pressures: Vec<Vec<usize>>,
    /// Elements that touch each group, ascending, with the group's position in the element's clique.
    elements_of_group: Vec<Vec<(usize, usize)>>,
}

/// One element's share of an evaluation.
#[derive(Default)]
struct ElementWork {
    system: ElementSystem,
    /// Energy of each active term, uJ.
    energies: Vec<f64>,
    /// Time spent in each active term, s.
    seconds: Vec<f64>,
    det_f: Option<DetF>,
    /// Sum of squares of the forces of each term before they cancel, mN2.
    magnitude: f64,
    /// K_e times the outstanding prescribed motion.
    lifted: Option<Box<[f64; LOCAL]>>,
}

/// Room for evaluations; one per solve, reused for every iteration.
#[derive(Default)]
pub struct Workspace {
    elements: Vec<ElementWork>,
    /// The pairs of faces that met at the last evaluation, of every coupling in turn.
    pairs: Vec<FacePair>,
}

/// A tangent. Its pattern depends on the pairs of faces that meet.
#[derive(Debug, Clone)]
pub struct Tangent {
    /// The matrix, by unknowns.
    pub matrix: SymmetricMatrix,
    /// The pairs of faces that its pattern has room for, ascending.
    pub(super) pairs: Vec<[Face; 2]>,
}

/// det F over the whole body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorstPoint {
    /// Smallest det F.
    pub min: f64,
    /// Its element.
    pub element: usize,
    /// Its quadrature point, first direction fastest.
    pub point: usize,
    /// Largest det F.
    pub max: f64,
}

/// Energy and forces at a state.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// Energy of each term, uJ.
    pub energies: Vec<f64>,
    /// Time that each term took, summed over threads, s.
    pub seconds: Vec<f64>,
    /// Range of det F.
    pub det_f: WorstPoint,
    /// dPi/du on every displacement parameter, prescribed ones too (there it is the reaction), mN.
    pub force: Vec<[f64; 3]>,
    /// dPi/d(unknown).
    pub residual: Vec<f64>,
    /// Size of the element forces before they cancel, mN: what the residual is small against.
    pub magnitude: f64,
    /// K times the outstanding prescribed motion, for the unknowns; zero unless asked for.
    pub lifted: Vec<f64>,
}

/// The parts of a model that an evaluation reads.
pub(super) struct Parts<'a> {
    pub mesh: &'a Mesh,
    pub terms: &'a [Box<dyn Term>],
    pub numbering: &'a Numbering,
    pub plan: &'a Plan,
}

impl Plan {
    pub(super) fn new(
        mesh: &Mesh,
        space: &dyn PressureSpace,
        terms: &[Box<dyn Term>],
        numbering: &Numbering,
    ) -> Plan {
        let active =
            (0..mesh.elements()).map(|e| (0..terms.len()).filter(|t| terms[*t].acts_on(e)).collect()).collect();
        let groups = numbering.group_start.len() - 1;
        let mut elements_of_group = vec![Vec::new(); groups];
        for (element, clique) in numbering.cliques.iter().enumerate() {
            for (position, group) in clique.iter().enumerate() {
                elements_of_group[*group].push((element, position));
            }
        }
        Plan {
            active,
            pressures: (0..mesh.elements()).map(|e| space.parameters(mesh, e)).collect(),
            elements_of_group,
        }
    }
}

/// Ranges of groups with about equal numbers of entries.
fn batches(pattern: &BlockPattern, group_start: &[usize]) -> Vec<std::ops::Range<usize>> {
    let (total, groups) = (pattern.nnz().max(1), group_start.len() - 1);
    let mut batches = Vec::new();
    let mut first = 0;
    for group in 0..groups {
        let done = pattern.col_ptr()[group_start[group + 1]];
        if done * BATCHES >= total * (batches.len() + 1) || group + 1 == groups {
            batches.push(first..group + 1);
            first = group + 1;
        }
    }
    batches
}

/// The local view of a state in one element: current geometry, displacement, pressure.
pub(super) struct Local {
    pub x: [[f64; 64]; 3],
    pub u: [[f64; 64]; 3],
    pub p: [f64; MAX_PRESSURES],
}

impl Parts<'_> {
    pub(super) fn local(&self, state: &State, element: usize) -> Local {
        let mut local =
            Local { x: self.mesh.local(element), u: self.mesh.local_of(element, &state.u), p: [0.0; MAX_PRESSURES] };
        for (x, u) in local.x.iter_mut().flatten().zip(local.u.iter().flatten()) {
            *x += u;
        }
        for (p, index) in local.p.iter_mut().zip(&self.plan.pressures[element]) {
            *p = state.p[*index];
        }
        local
    }

    /// All terms in all elements. `gap` is the outstanding motion of prescribed parameters, if there is any.
    pub(super) fn evaluate(
        &self,
        state: &State,
        want: Want,
        gap: Option<&[[f64; 3]]>,
        workspace: &mut Workspace,
    ) -> Evaluation {
        workspace.elements.resize_with(self.mesh.elements(), ElementWork::default);
        workspace.elements.par_iter_mut().enumerate().for_each(|(element, work)| {
            self.evaluate_element(state, element, want, gap, work);
        });
        let mut evaluation = self.reduce(&workspace.elements);
        workspace.pairs.clear();
        self.couple(state, want, gap, &mut evaluation, &mut workspace.pairs);
        evaluation
    }

    /// Adds what faces exert on each other.
    fn couple(
        &self,
        state: &State,
        want: Want,
        gap: Option<&[[f64; 3]]>,
        evaluation: &mut Evaluation,
        pairs: &mut Vec<FacePair>,
    ) {
        let couplings = self.terms.iter().enumerate().filter_map(|(index, term)| Some((index, term.as_coupling()?)));
        let mut x: Option<Vec<Vector>> = None;
        for (term, coupling) in couplings {
            let start = Instant::now();
            let x = x.get_or_insert_with(|| current(self.mesh, state));
            let (load, easing) = (state.load, state.easing);
            let body = BodyState { mesh: self.mesh, x, load, easing, multipliers: &state.multipliers[term] };
            let coupled = coupling.add(&body, want);
            evaluation.seconds[term] += start.elapsed().as_secs_f64();
            evaluation.energies[term] += coupled.energy;
            let mut square = evaluation.magnitude * evaluation.magnitude;
            for pair in &coupled.pairs {
                square += pair.force.iter().map(|f| f * f).sum::<f64>();
                self.scatter_pair(pair.faces, &pair.force, |parameter, component, value| {
                    evaluation.force[parameter][component] += value;
                    if let Some(unknown) = self.numbering.displacement_unknown(parameter, component) {
                        evaluation.residual[unknown] += value;
                    }
                });
                if let Some(gap) = gap.filter(|_| want == Want::Stiffness) {
                    let moved = pair.times(&self.gather_pair(pair.faces, gap));
                    self.scatter_pair(pair.faces, &moved, |parameter, component, value| {
                        if let Some(unknown) = self.numbering.displacement_unknown(parameter, component) {
                            evaluation.lifted[unknown] += value;
                        }
                    });
                }
            }
            evaluation.magnitude = square.sqrt();
            // a state in which bodies have passed through each other has no residual
            if !coupled.energy.is_finite() {
                evaluation.residual.iter_mut().for_each(|r| *r = f64::NAN);
            }
            pairs.extend(coupled.pairs);
        }
    }

    /// Calls `add` with the share of every global parameter in the local entries of a pair of faces.
    pub(super) fn scatter_pair(&self, faces: [Face; 2], local: &[f64], mut add: impl FnMut(usize, usize, f64)) {
        let mut first = 0;
        for face in faces {
            let functions = face.side.functions(self.mesh.element);
            for (k, &a) in functions.iter().enumerate() {
                for term in self.mesh.map.terms(face.element, a) {
                    for i in 0..3 {
                        add(term.global as usize, i, term.scale * local[first + i * functions.len() + k]);
                    }
                }
            }
            first += 3 * functions.len();
        }
    }

    /// The local entries of a pair of faces in a field of global parameters.
    fn gather_pair(&self, faces: [Face; 2], global: &[[f64; 3]]) -> Vec<f64> {
        let mut all = Vec::new();
        for face in faces {
            let local = self.mesh.local_of(face.element, global);
            let functions = face.side.functions(self.mesh.element);
            all.extend(local.iter().flat_map(|component| functions.iter().map(|a| component[*a])));
        }
        all
    }

    fn evaluate_element(
        &self,
        state: &State,
        element: usize,
        want: Want,
        gap: Option<&[[f64; 3]]>,
        work: &mut ElementWork,
    ) {
        let local = self.local(state, element);
        let at = ElementState {
            element,
            x: &local.x,
            u: &local.u,
            p: &local.p,
            controls: &state.controls,
            load: state.load,
            easing: state.easing,
            multipliers: &[],
        };
        work.system.clear(want);
        work.energies.clear();
        work.seconds.clear();
        work.det_f = None;
        work.magnitude = 0.0;
        let mut before = work.system.force;
        for &term in &self.plan.active[element] {
            let start = Instant::now();
            let own = ElementState { multipliers: &state.multipliers[term], ..at };
            let contribution = self.terms[term].add(&own, want, &mut work.system);
            work.seconds.push(start.elapsed().as_secs_f64());
            work.energies.push(contribution.energy);
            work.det_f = work.det_f.or(contribution.det_f);
            for (now, before) in work.system.force.iter().flatten().zip(before.iter_mut().flatten()) {
                work.magnitude += (now - *before) * (now - *before);
                *before = *now;
            }
        }
        work.lifted = None;
        if let Some(gap) = gap {
            let gap = self.mesh.local_of(element, gap);
            if want == Want::Stiffness && gap.iter().flatten().any(|g| *g != 0.0) {
                work.lifted = Some(Box::new(work.system.times(&gap)));
            }
        }
    }

    /// Sums over the elements in their order.
    fn reduce(&self, elements: &[ElementWork]) -> Evaluation {
        let mut energies = vec![0.0; self.terms.len()];
        let mut seconds = vec![0.0; self.terms.len()];
        let mut det_f = WorstPoint { min: f64::INFINITY, element: 0, point: 0, max: f64::NEG_INFINITY };
        let mut magnitude = 0.0;
        let mut force = vec![[0.0; 3]; self.mesh.parameters.len()];
        let mut residual = vec![0.0; self.numbering.unknowns()];
        let mut lifted = vec![0.0; self.numbering.unknowns()];
        for (element, work) in elements.iter().enumerate() {
            for (k, &term) in self.plan.active[element].iter().enumerate() {
                energies[term] += work.energies[k];
                seconds[term] += work.seconds[k];
            }
            if let Some(range) = work.det_f {
                if range.min.is_nan() || range.min < det_f.min {
                    (det_f.min, det_f.element, det_f.point) = (range.min, element, range.min_point);
                }
                det_f.max = det_f.max.max(range.max);
            }
            magnitude += work.magnitude;
            for a in 0..self.mesh.element.functions() {
                for term in self.mesh.map.terms(element, a) {
                    for i in 0..3 {
                        force[term.global as usize][i] += term.scale * work.system.force[i][a];
                    }
                }
            }
            for run in &self.numbering.runs[element] {
                for step in 0..run.length {
                    let local = run.local + step;
                    let value = match local {
                        0..192 => work.system.force[local / 64][local % 64],
                        _ => work.system.volume[local - 192],
                    };
                    residual[run.unknown + step] += run.scale * value;
                    if let Some(product) = &work.lifted {
                        lifted[run.unknown + step] += run.scale * product[local];
                    }
                }
            }
        }
        Evaluation { energies, seconds, det_f, force, residual, magnitude: magnitude.sqrt(), lifted }
    }

    /// Gathers the stiffnesses of the last evaluation that wanted them into the matrix, whose pattern has room for them.
    pub(super) fn assemble(&self, workspace: &Workspace, matrix: &mut SymmetricMatrix) {
        let pattern = matrix.pattern.clone();
        let batches = batches(&pattern, &self.numbering.group_start);
        let pairs: Vec<_> = workspace.pairs.iter().map(|p| self.numbering.of_faces(self.mesh, p.faces)).collect();
        let mut pairs_of_group = vec![Vec::new(); self.numbering.group_start.len() - 1];
        for (index, (_, clique)) in pairs.iter().enumerate() {
            clique.iter().enumerate().for_each(|(position, group)| pairs_of_group[*group].push((index, position)));
        }
        let mut rest = matrix.values.as_mut_slice();
        let mut pieces = Vec::with_capacity(batches.len());
        let mut taken = 0;
        for batch in &batches {
            let end = pattern.col_ptr()[self.numbering.group_start[batch.end]];
            let (piece, remainder) = rest.split_at_mut(end - taken);
            pieces.push((batch.clone(), taken, piece));
            (rest, taken) = (remainder, end);
        }
        pieces.into_par_iter().for_each(|(groups, start, values)| {
            values.fill(0.0);
            for group in groups {
                for &(element, position) in &self.plan.elements_of_group[group] {
                    let system = &workspace.elements[element].system;
                    let (runs, clique) = (&self.numbering.runs[element], &self.numbering.cliques[element]);
                    let row = |local: usize, out: &mut [f64]| system.row(local, out);
                    self.add_columns((runs, clique), position, LOCAL, row, &pattern, start, values);
                }
                for &(index, position) in &pairs_of_group[group] {
                    let (runs, clique) = &pairs[index];
                    let FacePair { force, stiffness, .. } = &workspace.pairs[index];
                    let n = force.len();
                    let row =
                        |local: usize, out: &mut [f64]| out.copy_from_slice(&stiffness[n * local..n * (local + 1)]);
                    self.add_columns((runs, clique), position, n, row, &pattern, start, values);
                }
            }
        });
    }

    /// Adds the columns of one small system that belong to one of its groups; `row` gives a row of its `size` entries, and
    /// `start` is the index of `values[0]` in the matrix.
    #[allow(clippy::too_many_arguments)] // the inside of one loop
    fn add_columns(
        &self,
        (runs, clique): (&[Run], &[usize]),
        position: usize,
        size: usize,
        give_row: impl Fn(usize, &mut [f64]),
        pattern: &BlockPattern,
        start: usize,
        values: &mut [f64],
    ) {
        let group = clique[position];
        let group_end = self.numbering.group_start[group + 1];
        // where the rows of each later group of the clique stand below the group's own rows
        let offsets: Vec<usize> = clique
            .iter()
            .map(|other| if *other > group { pattern.offset(group, *other).unwrap_or(0) } else { 0 })
            .collect();
        let mut row = [0.0; LOCAL];
        let row = &mut row[..size];
        for column_run in runs.iter().filter(|r| r.group == position) {
            for step in 0..column_run.length {
                let column = column_run.unknown + step;
                give_row(column_run.local + step, row);
                let base = pattern.col_ptr()[column] - start;
                for run in runs {
                    if run.group < position || run.unknown + run.length <= column {
                        continue;
                    }
                    // rows above the diagonal are the transpose of what is stored
                    let skip = column.saturating_sub(run.unknown);
                    let first = run.unknown + skip;
                    let place = if run.group == position {
                        base + first - column
                    } else {
                        let own = group_end - column;
                        base + own + offsets[run.group] + first - self.numbering.group_start[clique[run.group]]
                    };
                    let scale = run.scale * column_run.scale;
                    let source = &row[run.local + skip..run.local + run.length];
                    for (target, value) in values[place..place + source.len()].iter_mut().zip(source) {
                        *target += scale * value;
                    }
                }
            }
        }
    }
}

impl ElementSystem {
    /// One row (or column) of the symmetric element matrix, by local entry.
    fn row(&self, local: usize, out: &mut [f64]) {
        if local < 192 {
            let (i, a) = (local / 64, local % 64);
            for k in 0..3 {
                let target = &mut out[64 * k..64 * k + 64];
                let block = &self.stiffness[pair(i, k)];
                if i <= k {
                    target.copy_from_slice(&block[64 * a..64 * a + 64]);
                } else {
                    for (b, t) in target.iter_mut().enumerate() {
                        *t = block[64 * b + a];
                    }
                }
            }
            out[192..].copy_from_slice(&self.coupling[i][a]);
        } else {
            for k in 0..3 {
                for a in 0..64 {
                    out[64 * k + a] = self.coupling[k][a][local - 192];
                }
            }
            out[192..].fill(0.0);
        }
    }

    /// The element matrix times a displacement.
    fn times(&self, v: &[[f64; 64]; 3]) -> [f64; LOCAL] {
        let mut product = [0.0; LOCAL];
        let mut row = [0.0; LOCAL];
        for (local, sum) in product.iter_mut().enumerate() {
            self.row(local, &mut row);
            *sum = row.iter().zip(v.iter().flatten()).map(|(k, v)| k * v).sum();
        }
        product
    }
}

/// Index of the pair (i, k) or (k, i) in [`PAIRS`].
fn pair(i: usize, k: usize) -> usize {
    const INDEX: [[usize; 3]; 3] = [[0, 3, 4], [3, 1, 5], [4, 5, 2]];
    debug_assert!(PAIRS[INDEX[i][k]] == (i.min(k), i.max(k)));
    INDEX[i][k]
}

impl FacePair {
    /// The stiffness times a displacement.
    fn times(&self, v: &[f64]) -> Vec<f64> {
        let row = |row: &[f64]| row.iter().zip(v).map(|(k, v)| k * v).sum();
        self.stiffness.chunks_exact(self.force.len()).map(row).collect()
    }
}

/// Global parameters x = X + u.
pub(super) fn current(mesh: &Mesh, state: &State) -> Vec<Vector> {
    let add = |(x, u): (&Vector, &Vector)| std::array::from_fn(|i| x[i] + u[i]);
    mesh.parameters.iter().zip(&state.u).map(add).collect()
}

impl Workspace {
    /// The pairs of faces that met at the last evaluation, ascending.
    pub(super) fn met(&self) -> Vec<[Face; 2]> {
        let mut all: Vec<_> = self.pairs.iter().map(|pair| pair.faces).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}
