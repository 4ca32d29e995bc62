//! mesh + terms + supports -> energy, residual, tangent, control forces. Immutable, shared by all solves and threads.

mod assembly;
mod bones;
pub mod build;
mod constraints;
mod fibre_turn;
pub mod halved;
mod numbering;
mod signs;
mod state;
pub mod supports;
mod tissue;

pub use assembly::{Evaluation, Tangent, Workspace, WorstPoint};
pub use constraints::Renewal;
pub use numbering::Numbering;
pub use signs::{Descending, OffSurface};
pub use state::State;

use crate::error::Result;
use crate::math::factor::Symbolic;
use crate::math::ordering::Ordering;
use crate::math::sparse::{BlockPattern, SymmetricMatrix};
use crate::mesh::Mesh;
use crate::mesh::face::Face;
use crate::term::bone::{Bone, Wrench};
use crate::term::contact::ContactPoint;
use crate::term::contact::law::Allows;
use crate::term::coupling::{BodyState, Coupling, FacePair};
use crate::term::muscle::Muscle;
use crate::term::pressure::PressureSpace;
use crate::term::{ElementState, Term, Want};
use assembly::{Parts, Plan};
use rayon::prelude::*;
use std::sync::Arc;
use supports::Supports;

/// A quantity that drives the model from outside: an activation, the angle of a hinge in degrees, the way of a slide in mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    /// Its name in problem files and tables.
    pub name: String,
    /// Smallest admissible value.
    pub lower: f64,
    /// Largest admissible value.
    pub upper: f64,
    /// The value at which the response begins to saturate: for an activation the tissue's shear modulus over
    /// sigma_max. Steps of a path are even in ln(value + onset). The response to a bone is about even in its pose itself:
    /// its onset lies far beyond its range.
    pub onset: f64,
}

/// What a model is made of.
pub struct Ingredients {
    /// The host.
    pub mesh: Mesh,
    /// The pressure space of the tissue.
    pub space: &'static dyn PressureSpace,
    /// All effects; the tissue first.
    pub terms: Vec<Box<dyn Term>>,
    /// Prescribed motion.
    pub supports: Supports,
    /// Inputs of the terms, in the order of their control indices.
    pub controls: Vec<Control>,
    /// Shear modulus of the tissue, kPa: with the volume it sets the scale of forces.
    pub shear_modulus: f64,
    /// Reference volume of the tissue, mm3.
    pub volume: f64,
}

/// A computable scene.
pub struct Model {
    ingredients: Ingredients,
    numbering: Numbering,
    pattern: Arc<BlockPattern>,
    symbolic: Arc<Symbolic>,
    plan: Plan,
    /// The bones that carry something, each once.
    bones: Vec<Arc<Bone>>,
    /// The order of elimination, chosen with the faces that are near each other at rest.
    ordering: Ordering,
}

impl Model {
    /// Numbers the unknowns, finds the pattern and the elimination order.
    ///
    /// # Errors
    /// Where the factor would not fit into memory.
    pub fn new(ingredients: Ingredients) -> Result<Model> {
        let Ingredients { mesh, space, terms, supports, .. } = &ingredients;
        let numbering = Numbering::new(mesh, *space, supports);
        let near: Vec<_> =
            terms.iter().filter_map(|t| t.as_coupling()).flat_map(|c| c.neighbours().iter().copied()).collect();
        let ordering = Ordering::new(&pattern(&numbering, mesh, &near), &numbering.pressure_groups());
        let pattern = Arc::new(pattern(&numbering, mesh, &[]));
        let symbolic = Symbolic::new(pattern.clone(), &ordering)?;
        let plan = Plan::new(mesh, *space, terms, &numbering);
        let mut bones: Vec<Arc<Bone>> = Vec::new();
        for bone in supports.bones().chain(terms.iter().filter_map(|term| term.as_carried()?.bone())) {
            if !bones.iter().any(|known| known.name() == bone.name()) {
                bones.push(bone.clone());
            }
        }
        bones.sort_by(|a, b| a.controls().cmp(b.controls()));
        Ok(Model { numbering, pattern, symbolic, plan, bones, ordering, ingredients })
    }

    /// The host.
    pub fn mesh(&self) -> &Mesh {
        &self.ingredients.mesh
    }

    /// All effects, the tissue first.
    pub fn terms(&self) -> &[Box<dyn Term>] {
        &self.ingredients.terms
    }

    /// The muscles among the terms, each with its index in [`Model::terms`].
    pub fn muscles(&self) -> impl Iterator<Item = (usize, &Muscle)> {
        self.terms().iter().enumerate().filter_map(|(index, term)| Some((index, term.as_muscle()?)))
    }

    /// The controls of the muscle of this name: one, or one for every node of its mesh. None if there is no such muscle.
    pub fn muscle_controls(&self, name: &str) -> &[usize] {
        self.terms().iter().find(|t| t.as_muscle().is_some() && t.name() == name).map_or(&[], |t| t.controls())
    }

    /// The controls that go by a name: those of a muscle, or the one control that is called so.
    pub fn controls_of(&self, name: &str) -> Vec<usize> {
        match self.muscle_controls(name) {
            [] => (0..self.controls().len()).filter(|control| self.controls()[*control].name == name).collect(),
            own => own.to_vec(),
        }
    }

    /// The bones that carry something, in the order of their controls.
    pub fn bones(&self) -> &[Arc<Bone>] {
        &self.bones
    }

    /// What a bone exerts on the body at a state, with the forces dPi/du on all parameters there.
    pub fn wrench(&self, bone: &Bone, state: &State, force: &[[f64; 3]]) -> Wrench {
        let mut wrench = self.supports().wrench(self.mesh(), bone.name(), force, &self.current(state));
        for (term, carried) in self.terms().iter().enumerate().filter_map(|(k, t)| Some((k, t.as_carried()?))) {
            if carried.bone().is_some_and(|own| own.name() == bone.name()) {
                for element in (0..self.mesh().elements()).filter(|element| self.terms()[term].acts_on(*element)) {
                    wrench.add(&self.with_own(state, term, element, |at| carried.wrench(at)));
                }
            }
        }
        wrench
    }

    /// What the slidings and contacts among the terms allow, each with its index in [`Model::terms`].
    pub fn contacts(&self) -> impl Iterator<Item = (usize, Allows)> {
        let allows = |term: &dyn Term| match (term.as_contact(), term.as_coupling()) {
            (Some(contact), _) => Some(contact.allows()),
            (_, Some(_)) => Some(Allows::ClosedOrOpen),
            _ => None,
        };
        self.terms().iter().enumerate().filter_map(move |(index, term)| Some((index, allows(term.as_ref())?)))
    }

    /// The narrowest range, mm, over which a contact sets in that may be eased; `None` where none may.
    pub fn eases(&self) -> Option<f64> {
        let ranges = self.terms().iter().filter_map(|term| match (term.as_contact(), term.as_coupling()) {
            (Some(contact), _) => contact.eases(),
            (_, coupling) => coupling?.eases(),
        });
        ranges.min_by(f64::total_cmp)
    }

    /// All quadrature points of a sliding or contact at a state; none for another term.
    pub fn contact_points(&self, state: &State, term: usize) -> Vec<ContactPoint> {
        if let Some(coupling) = self.terms()[term].as_coupling() {
            return self.with_body(state, term, |body| coupling.contact_points(body));
        }
        let Some(contact) = self.terms()[term].as_contact() else { return Vec::new() };
        let in_element = |element| self.with_own(state, term, element, |at| contact.points_at(at).collect());
        let elements: Vec<usize> = contact.elements().collect();
        let all: Vec<Vec<ContactPoint>> = elements.into_par_iter().map(in_element).collect();
        all.concat()
    }

    /// Inputs in their order in [`State::controls`].
    pub fn controls(&self) -> &[Control] {
        &self.ingredients.controls
    }

    /// The controls that are activations, not poses of bones.
    pub fn activations(&self) -> impl Iterator<Item = usize> {
        let pose = |bone: &Arc<Bone>| [bone.hinge().map(|h| h.control), bone.slide().map(|s| s.control)];
        let poses: Vec<usize> = self.bones.iter().flat_map(pose).flatten().collect();
        (0..self.controls().len()).filter(move |control| !poses.contains(control))
    }

    /// Prescribed motion.
    pub fn supports(&self) -> &Supports {
        &self.ingredients.supports
    }

    /// The pressure space.
    pub fn space(&self) -> &'static dyn PressureSpace {
        self.ingredients.space
    }

    /// Which unknown is what.
    pub fn numbering(&self) -> &Numbering {
        &self.numbering
    }

    /// The structure of the factorised tangent while no faces meet.
    pub fn symbolic(&self) -> &Arc<Symbolic> {
        &self.symbolic
    }

    /// A zero tangent, with room for no pair of faces that meet.
    pub fn tangent(&self) -> Tangent {
        Tangent { matrix: SymmetricMatrix::zeros(self.pattern.clone()), pairs: Vec::new() }
    }

    /// The structure of the factor of a tangent.
    ///
    /// # Errors
    /// Where the factor would not fit into memory.
    pub fn symbolic_of(&self, tangent: &Tangent) -> Result<Arc<Symbolic>> {
        if Arc::ptr_eq(&tangent.matrix.pattern, &self.pattern) {
            return Ok(self.symbolic.clone());
        }
        Symbolic::new(tangent.matrix.pattern.clone(), &self.ordering)
    }

    /// Operations of one factorisation, an addition and a multiplication counted as two.
    pub fn factor_flops(&self) -> f64 {
        self.symbolic.flops()
    }

    /// Characteristic element size, mm: the cube root of the mean element volume.
    pub fn element_size(&self) -> f64 {
        (self.ingredients.volume / self.mesh().elements() as f64).cbrt()
    }

    /// Reference volume of the tissue, mm3.
    pub fn volume(&self) -> f64 {
        self.ingredients.volume
    }

    /// Shear modulus of the tissue at rest, kPa.
    pub fn shear_modulus(&self) -> f64 {
        self.ingredients.shear_modulus
    }

    /// mu V^(2/3), mN: the force that strains the whole body by about one.
    pub fn force_scale(&self) -> f64 {
        self.ingredients.shear_modulus * self.ingredients.volume.cbrt().powi(2)
    }

    /// mu / h, mN/mm3: turns a volume residual into a force, so that norms add like with like.
    pub fn volume_scale(&self) -> f64 {
        self.ingredients.shear_modulus / self.element_size()
    }

    /// The reference state: no displacement, no pressure, all controls and loads zero.
    pub fn rest(&self) -> State {
        State {
            u: vec![[0.0; 3]; self.mesh().parameters.len()],
            p: vec![0.0; self.numbering.pressures()],
            controls: vec![0.0; self.controls().len()],
            load: 0.0,
            easing: 0.0,
            multipliers: self
                .terms()
                .iter()
                .map(|t| match (t.as_constraint(), t.as_coupling()) {
                    (Some(constraint), _) => constraint.multipliers(),
                    (_, Some(coupling)) => coupling.multipliers(),
                    _ => 0,
                })
                .map(|count| vec![0.0; count])
                .collect(),
        }
    }

    /// Energy and forces of all terms at a state; with [`Want::Stiffness`] the workspace then holds the element
    /// stiffnesses for [`Model::assemble`]. `gap` is the outstanding motion of prescribed parameters.
    pub fn evaluate(
        &self,
        state: &State,
        want: Want,
        gap: Option<&[[f64; 3]]>,
        workspace: &mut Workspace,
    ) -> Evaluation {
        self.parts().evaluate(state, want, gap, workspace)
    }

    /// The tangent d2Pi/d(unknowns)2 from the last evaluation that wanted it. Where other faces meet than before it takes
    /// another pattern; the pattern depends on the state alone, not on what came before.
    pub fn assemble(&self, workspace: &Workspace, tangent: &mut Tangent) {
        let met = workspace.met();
        if met != tangent.pairs {
            let pattern = match met.as_slice() {
                [] => self.pattern.clone(),
                met => Arc::new(pattern(&self.numbering, self.mesh(), met)),
            };
            *tangent = Tangent { matrix: SymmetricMatrix::zeros(pattern), pairs: met };
        }
        self.parts().assemble(workspace, &mut tangent.matrix);
    }

    /// dr/d(control) for the unknowns, of the terms that depend on it: the force per unit of a control. What faces on bones
    /// add by moving is K times [`Supports::rate`].
    pub fn control_force(&self, state: &State, control: usize) -> Vec<f64> {
        self.force_of(
            state,
            |term| term.controls().contains(&control),
            |term, at, force| {
                term.add_control_force(control, at, force);
            },
        )
    }

    /// dr/d(load) for the unknowns.
    pub fn load_force(&self, state: &State) -> Vec<f64> {
        let mut total = self.force_of(state, |_| true, |term, at, force| term.add_load_force(at, force));
        for (term, coupling) in self.couplings() {
            let pairs = self.with_body(state, term, |body| coupling.load_force(body));
            self.scatter_pairs(&pairs, &mut total);
        }
        total
    }

    fn force_of(
        &self,
        state: &State,
        chosen: impl Fn(&dyn Term) -> bool,
        add: impl Fn(&dyn Term, &ElementState<'_>, &mut [[f64; 64]; 3]),
    ) -> Vec<f64> {
        let terms: Vec<_> = self.terms().iter().map(Box::as_ref).enumerate().filter(|(_, t)| chosen(*t)).collect();
        let mut total = vec![0.0; self.numbering.unknowns()];
        for element in 0..self.mesh().elements() {
            if !terms.iter().any(|(_, t)| t.acts_on(element)) {
                continue;
            }
            let mut force = [[0.0; 64]; 3];
            self.with_local(state, element, |at| {
                for (index, term) in terms.iter().filter(|(_, t)| t.acts_on(element)) {
                    add(*term, &ElementState { multipliers: &state.multipliers[*index], ..*at }, &mut force);
                }
            });
            self.scatter(element, &force, &mut total);
        }
        total
    }

    /// The couplings among the terms, each with its index in [`Model::terms`].
    fn couplings(&self) -> impl Iterator<Item = (usize, &dyn Coupling)> {
        self.terms().iter().enumerate().filter_map(|(index, term)| Some((index, term.as_coupling()?)))
    }

    /// Calls `f` with the body as a coupling sees it.
    fn with_body<R>(&self, state: &State, term: usize, f: impl FnOnce(&BodyState<'_>) -> R) -> R {
        let (x, multipliers) = (self.current(state), &state.multipliers[term]);
        f(&BodyState { mesh: self.mesh(), x: &x, load: state.load, easing: state.easing, multipliers })
    }

    /// Adds the forces of pairs of faces to those on the unknowns.
    fn scatter_pairs(&self, pairs: &[FacePair], total: &mut [f64]) {
        for pair in pairs {
            self.parts().scatter_pair(pair.faces, &pair.force, |parameter, component, value| {
                if let Some(unknown) = self.numbering.displacement_unknown(parameter, component) {
                    total[unknown] += value;
                }
            });
        }
    }

    /// Adds the forces on the local parameters of an element to those on the unknowns.
    fn scatter(&self, element: usize, force: &[[f64; 64]; 3], total: &mut [f64]) {
        for run in self.numbering.runs[element].iter().filter(|r| r.local < 192) {
            for step in 0..run.length {
                let local = run.local + step;
                total[run.unknown + step] += run.scale * force[local / 64][local % 64];
            }
        }
    }

    /// Quadrature points of each term in one evaluation.
    pub fn points(&self) -> impl Iterator<Item = usize> + '_ {
        let active = |t: &dyn Term| (0..self.mesh().elements()).filter(|e| t.acts_on(*e)).map(|e| t.points(e)).sum();
        self.terms().iter().map(move |t| t.as_coupling().map_or_else(|| active(t.as_ref()), Coupling::points))
    }

    /// Calls `f` with the local view of a state in one element, without the multipliers of any term.
    pub fn with_local<R>(&self, state: &State, element: usize, f: impl FnOnce(&ElementState<'_>) -> R) -> R {
        let local = self.parts().local(state, element);
        f(&ElementState {
            element,
            x: &local.x,
            u: &local.u,
            p: &local.p,
            controls: &state.controls,
            load: state.load,
            easing: state.easing,
            multipliers: &[],
        })
    }

    /// Work of loads on the straight way to the displacement of a state, uJ.
    pub fn external_work(&self, state: &State) -> f64 {
        let loads: Vec<_> = self.terms().iter().filter(|t| t.is_load()).collect();
        if loads.is_empty() {
            return 0.0;
        }
        (0..self.mesh().elements())
            .map(|e| self.with_local(state, e, |at| loads.iter().map(|t| t.external_work(at)).sum::<f64>()))
            .sum()
    }

    /// Current parameters x = X + u.
    pub fn current(&self, state: &State) -> Vec<[f64; 3]> {
        assembly::current(self.mesh(), state)
    }

    /// The unknowns of a state in the order of the linear system.
    pub fn unknowns(&self, state: &State) -> Vec<f64> {
        let mut x = vec![0.0; self.numbering.unknowns()];
        for (parameter, u) in state.u.iter().enumerate() {
            for (component, u) in u.iter().enumerate() {
                if let Some(unknown) = self.numbering.displacement_unknown(parameter, component) {
                    x[unknown] = *u;
                }
            }
        }
        for (index, p) in state.p.iter().enumerate() {
            x[self.numbering.pressure_unknown(index)] = *p;
        }
        x
    }

    /// Adds `factor` x `direction` (one entry per unknown) to the unknowns of a state.
    pub fn advance(&self, state: &mut State, direction: &[f64], factor: f64) {
        for (parameter, u) in state.u.iter_mut().enumerate() {
            for (component, u) in u.iter_mut().enumerate() {
                if let Some(unknown) = self.numbering.displacement_unknown(parameter, component) {
                    *u += factor * direction[unknown];
                }
            }
        }
        for (index, p) in state.p.iter_mut().enumerate() {
            *p += factor * direction[self.numbering.pressure_unknown(index)];
        }
    }

    /// du/d(control) on all displacement parameters where the unknowns move along `direction` with that control: faces on
    /// bones move too.
    pub fn displacement_rate(&self, state: &State, control: usize, direction: &[f64]) -> Vec<[f64; 3]> {
        let mut rate = self.displacement_of(direction);
        if let Some(carried) = self.supports().rate(self.mesh(), control, &state.controls) {
            rate.iter_mut().flatten().zip(carried.iter().flatten()).for_each(|(r, c)| *r += c);
        }
        rate
    }

    /// The free displacements of a direction, one triple per global parameter; prescribed entries are zero.
    pub fn displacement_of(&self, direction: &[f64]) -> Vec<[f64; 3]> {
        (0..self.mesh().parameters.len())
            .map(|parameter| {
                std::array::from_fn(|component| {
                    self.numbering.displacement_unknown(parameter, component).map_or(0.0, |k| direction[k])
                })
            })
            .collect()
    }

    /// A force on all displacement parameters as one on the unknowns: the transpose of [`Model::displacement_of`].
    pub fn force_of_unknowns(&self, force: &[[f64; 3]]) -> Vec<f64> {
        let mut of_unknowns = vec![0.0; self.numbering.unknowns()];
        for (parameter, force) in force.iter().enumerate() {
            for (component, f) in force.iter().enumerate() {
                if let Some(unknown) = self.numbering.displacement_unknown(parameter, component) {
                    of_unknowns[unknown] += f;
                }
            }
        }
        of_unknowns
    }

    fn parts(&self) -> Parts<'_> {
        let Ingredients { mesh, terms, .. } = &self.ingredients;
        Parts { mesh, terms, numbering: &self.numbering, plan: &self.plan }
    }
}

/// The pattern of the tangent where these pairs of faces meet.
fn pattern(numbering: &Numbering, mesh: &Mesh, pairs: &[[Face; 2]]) -> BlockPattern {
    let met: Vec<_> = pairs.iter().map(|faces| numbering.of_faces(mesh, *faces).1).collect();
    BlockPattern::new(&numbering.group_start, numbering.cliques.iter().chain(&met).map(Vec::as_slice))
}
