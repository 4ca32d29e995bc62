//! Numbering: which unknown of the linear system belongs to which free parameter.
//!
//! Unknowns come in groups, one per node and, for pressures that live inside elements, one per element. Within a node
//! the free displacement parameters stand component by component, then the pressure.

use super::supports::Supports;
use crate::mesh::Mesh;
use crate::mesh::face::Face;
use crate::term::MAX_PRESSURES;
use crate::term::pressure::{PressurePlace, PressureSpace};

/// Marks a parameter that is prescribed.
const PRESCRIBED: u32 = u32::MAX;

/// The unknowns of a model.
#[derive(Debug, Clone)]
pub struct Numbering {
    /// `group_start[g]..group_start[g + 1]` are the unknowns of group g: nodes first, then elements with pressures of
    /// their own.
    pub group_start: Vec<usize>,
    /// Unknown of component i of global displacement parameter k at `[k][i]`.
    displacement: Vec<[u32; 3]>,
    /// Unknown of each pressure parameter.
    pressure: Vec<u32>,
    /// Per element, runs of consecutive local entries that are consecutive unknowns.
    pub runs: Vec<Vec<Run>>,
    /// Per element, the groups that it couples, ascending.
    pub cliques: Vec<Vec<usize>>,
}

/// Consecutive local entries of an element that are consecutive unknowns of one group, with one scale.
///
/// Local entry 64 i + a is component i of displacement function a; entry 192 + c is pressure c.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// First local entry.
    pub local: usize,
    /// First unknown.
    pub unknown: usize,
    /// How many.
    pub length: usize,
    /// local parameter = scale x unknown.
    pub scale: f64,
    /// Position of the group in the element's clique.
    pub group: usize,
}

impl Numbering {
    /// Of a mesh with the given pressures and supports.
    pub fn new(mesh: &Mesh, space: &dyn PressureSpace, supports: &Supports) -> Numbering {
        let mut of_node: Vec<Vec<usize>> = vec![Vec::new(); mesh.nodes];
        for (parameter, node) in mesh.parameter_node.iter().enumerate() {
            of_node[*node].push(parameter);
        }
        let count = space.count(mesh);
        let mut node_pressures: Vec<Vec<usize>> = vec![Vec::new(); mesh.nodes];
        let mut element_pressures: Vec<Vec<usize>> = vec![Vec::new(); mesh.elements()];
        for index in 0..count {
            match space.place(index) {
                PressurePlace::Node(node) => node_pressures[node].push(index),
                PressurePlace::Element(element) => element_pressures[element].push(index),
            }
        }

        let mut displacement = vec![[PRESCRIBED; 3]; mesh.parameters.len()];
        let mut pressure = vec![PRESCRIBED; count];
        let mut group_start = vec![0];
        let mut next = 0u32;
        for node in 0..mesh.nodes {
            for component in 0..3 {
                for &parameter in &of_node[node] {
                    if !supports.fixes(parameter, component) {
                        displacement[parameter][component] = next;
                        next += 1;
                    }
                }
            }
            for &index in &node_pressures[node] {
                pressure[index] = next;
                next += 1;
            }
            group_start.push(next as usize);
        }
        let own_groups = element_pressures.iter().any(|p| !p.is_empty());
        if own_groups {
            for indices in &element_pressures {
                for &index in indices {
                    pressure[index] = next;
                    next += 1;
                }
                group_start.push(next as usize);
            }
        }

        let mut numbering = Numbering { group_start, displacement, pressure, runs: Vec::new(), cliques: Vec::new() };
        for element in 0..mesh.elements() {
            numbering.add_element(mesh, space, element);
        }
        numbering
    }

    fn add_element(&mut self, mesh: &Mesh, space: &dyn PressureSpace, element: usize) {
        let mut entries: Vec<(usize, usize, f64)> = Vec::new();
        for a in 0..mesh.element.functions() {
            for term in mesh.map.terms(element, a) {
                for component in 0..3 {
                    let unknown = self.displacement[term.global as usize][component];
                    if unknown != PRESCRIBED {
                        entries.push((64 * component + a, unknown as usize, term.scale));
                    }
                }
            }
        }
        for (c, index) in space.parameters(mesh, element).into_iter().enumerate() {
            debug_assert!(c < MAX_PRESSURES);
            entries.push((192 + c, self.pressure[index] as usize, 1.0));
        }
        let (runs, clique) = self.join(entries);
        self.runs.push(runs);
        self.cliques.push(clique);
    }

    /// Runs and groups of a system between two faces, whose local entries are those of [`FacePair`].
    ///
    /// [`FacePair`]: crate::term::coupling::FacePair
    pub fn of_faces(&self, mesh: &Mesh, faces: [Face; 2]) -> (Vec<Run>, Vec<usize>) {
        let mut entries: Vec<(usize, usize, f64)> = Vec::new();
        let mut first = 0;
        for face in faces {
            let functions = face.side.functions(mesh.element);
            for (k, &a) in functions.iter().enumerate() {
                for term in mesh.map.terms(face.element, a) {
                    for component in 0..3 {
                        let unknown = self.displacement[term.global as usize][component];
                        if unknown != PRESCRIBED {
                            entries.push((first + component * functions.len() + k, unknown as usize, term.scale));
                        }
                    }
                }
            }
            first += 3 * functions.len();
        }
        self.join(entries)
    }

    /// Joins single entries (local, unknown, scale) to runs; gives the groups they belong to, ascending.
    fn join(&self, mut entries: Vec<(usize, usize, f64)>) -> (Vec<Run>, Vec<usize>) {
        entries.sort_by_key(|(local, unknown, _)| (*unknown, *local));
        let group_of = |unknown: usize| self.group_start.partition_point(|start| *start <= unknown) - 1;
        let mut clique: Vec<usize> = entries.iter().map(|(_, unknown, _)| group_of(*unknown)).collect();
        clique.dedup();
        let mut runs: Vec<Run> = Vec::new();
        for (local, unknown, scale) in entries {
            let group = clique.partition_point(|g| *g < group_of(unknown));
            match runs.last_mut() {
                Some(run)
                    if run.group == group
                        && run.scale == scale
                        && run.local + run.length == local
                        && run.unknown + run.length == unknown =>
                {
                    run.length += 1;
                }
                _ => runs.push(Run { local, unknown, length: 1, scale, group }),
            }
        }
        (runs, clique)
    }

    /// The number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.group_start.last().copied().unwrap_or(0)
    }

    /// The number of free displacement parameters.
    pub fn displacements(&self) -> usize {
        self.displacement.iter().flatten().filter(|u| **u != PRESCRIBED).count()
    }

    /// Groups that hold pressures and no displacement: they have no pivots of their own.
    pub fn pressure_groups(&self) -> Vec<usize> {
        let groups = self.group_start.len() - 1;
        let mut has_displacement = vec![false; groups];
        for unknown in self.displacement.iter().flatten().filter(|u| **u != PRESCRIBED) {
            has_displacement[self.group_start.partition_point(|start| *start <= *unknown as usize) - 1] = true;
        }
        let size = |g: &usize| self.group_start[g + 1] - self.group_start[*g];
        (0..groups).filter(|g| size(g) > 0 && !has_displacement[*g]).collect()
    }

    /// The number of pressures.
    pub fn pressures(&self) -> usize {
        self.pressure.len()
    }

    /// The unknown of a component of a displacement parameter, `None` where it is prescribed.
    pub fn displacement_unknown(&self, parameter: usize, component: usize) -> Option<usize> {
        let unknown = self.displacement[parameter][component];
        (unknown != PRESCRIBED).then_some(unknown as usize)
    }

    /// The unknown of a pressure parameter.
    pub fn pressure_unknown(&self, index: usize) -> usize {
        self.pressure[index] as usize
    }
}
