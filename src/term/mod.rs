//! Contributions to the balance r(u, p; a) = 0, one file each. A scene that does not name an effect builds no term for it.
//!
//! Almost all terms are sums over the elements of the host: a term adds its energy, its force r = dPi/d(u, p) and its
//! stiffness K = dr/d(u, p) to the small system of one element, which the model then assembles. What acts between
//! elements is a [`coupling`].

pub mod bone;
pub mod constraint;
pub mod contact;
pub mod coupling;
pub mod load;
pub mod muscle;
pub mod muscle_rule;
pub mod pressure;
pub mod spring;
pub mod taper;
pub mod tie;
pub mod tissue;

use crate::material::PAIRS;

/// The most pressure parameters that an element may have.
pub const MAX_PRESSURES: usize = 8;

/// What a term is told about one element.
#[derive(Debug, Clone, Copy)]
pub struct ElementState<'a> {
    /// Element index in the host mesh.
    pub element: usize,
    /// Local parameters of the current geometry x = X + u, `x[component][function]`, mm.
    pub x: &'a [[f64; 64]; 3],
    /// Local parameters of the displacement u, mm.
    pub u: &'a [[f64; 64]; 3],
    /// Local pressure parameters, kPa; unused ones are zero.
    pub p: &'a [f64; MAX_PRESSURES],
    /// All controls of the model: activations, poses of bones.
    pub controls: &'a [f64],
    /// Factor on loads, 0 to 1 along the load path.
    pub load: f64,
    /// By how much contact sets in more slowly than its law says, mm.
    pub easing: f64,
    /// The multipliers of the term that is asked, over all elements; empty for a term that has none.
    pub multipliers: &'a [f64],
}

/// How much a term is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// Energy and force.
    Force,
    /// Energy, force and stiffness.
    Stiffness,
}

/// The small system of one element, to which terms add. Displacement entries are indexed by component and local
/// function; forces are in mN (per unit parameter), energies in uJ.
#[derive(Debug, Clone)]
pub struct ElementSystem {
    /// dPi/du, `force[component][function]`.
    pub force: [[f64; 64]; 3],
    /// dPi/dp.
    pub volume: [f64; MAX_PRESSURES],
    /// d2Pi/du du for the component pairs (i, k) of [`PAIRS`]: `stiffness[pair][64 a + b]` is row (i, a), column (k, b).
    pub stiffness: Vec<[f64; 4096]>,
    /// d2Pi/du dp: `coupling[component][function][pressure]`.
    pub coupling: [[[f64; MAX_PRESSURES]; 64]; 3],
}

impl Default for ElementSystem {
    fn default() -> Self {
        ElementSystem {
            force: [[0.0; 64]; 3],
            volume: [0.0; MAX_PRESSURES],
            stiffness: vec![[0.0; 4096]; PAIRS.len()],
            coupling: [[[0.0; MAX_PRESSURES]; 64]; 3],
        }
    }
}

impl ElementSystem {
    /// Sets everything to zero; the stiffness only if it will be wanted.
    pub fn clear(&mut self, want: Want) {
        self.force = [[0.0; 64]; 3];
        self.volume = [0.0; MAX_PRESSURES];
        if want == Want::Stiffness {
            for block in &mut self.stiffness {
                block.fill(0.0);
            }
            self.coupling = [[[0.0; MAX_PRESSURES]; 64]; 3];
        }
    }
}

/// What a term found while it added to an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contribution {
    /// Its energy in the element, uJ.
    pub energy: f64,
    /// Smallest and largest det F at its points, where it looks at them.
    pub det_f: Option<DetF>,
}

/// The range of det F over the quadrature points of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetF {
    /// Smallest value.
    pub min: f64,
    /// Quadrature point of the smallest value.
    pub min_point: usize,
    /// Largest value.
    pub max: f64,
}

/// One effect.
pub trait Term: Send + Sync {
    /// The name in tables: `tissue`, the muscle's own name, `traction`, ...
    fn name(&self) -> &str;

    /// Whether the term has anything to add in this element.
    fn acts_on(&self, element: usize) -> bool;

    /// Adds energy, force and, if wanted, stiffness of this term in one element.
    ///
    /// The caller sees from [`Contribution::det_f`] whether the state is admissible; where det F <= 0 the numbers added
    /// are meaningless.
    fn add(&self, state: &ElementState<'_>, want: Want, system: &mut ElementSystem) -> Contribution;

    /// The controls that this term depends on.
    fn controls(&self) -> &[usize] {
        &[]
    }

    /// Adds dr/d(control), the force per unit of a control (for an activation: mN, for a hinge: mN per degree), in one element.
    fn add_control_force(&self, _control: usize, _state: &ElementState<'_>, _force: &mut [[f64; 64]; 3]) {}

    /// Adds dr/d(load) in one element. Zero for a term that does not depend on the load factor.
    fn add_load_force(&self, _state: &ElementState<'_>, _force: &mut [[f64; 64]; 3]) {}

    /// Work of a load on the straight way to the current displacement, uJ; zero for everything that is not one.
    fn external_work(&self, _state: &ElementState<'_>) -> f64 {
        0.0
    }

    /// Whether the term is a load, scaled by the load factor.
    fn is_load(&self) -> bool {
        false
    }

    /// Quadrature points of the term in an element: a count of work.
    fn points(&self, element: usize) -> usize;

    /// The term as a muscle, if it is one: its fibres are shown in results.
    fn as_muscle(&self) -> Option<&muscle::Muscle> {
        None
    }

    /// The term as a contact, if it is one: its pressure is shown in results.
    fn as_contact(&self) -> Option<&contact::Contact> {
        None
    }

    /// The term as a coupling, if it acts between elements and not within them.
    fn as_coupling(&self) -> Option<&dyn coupling::Coupling> {
        None
    }

    /// The term as something that a bone may carry.
    fn as_carried(&self) -> Option<&dyn bone::Carried> {
        None
    }

    /// The term as a constraint, if it has multipliers.
    fn as_constraint(&self) -> Option<&dyn constraint::Constraint> {
        None
    }
}
