//! Supports: parameters of the displacement that are prescribed.
//!
//! On a face xi_d = const the values and the in-plane derivatives of the tricubic Hermite basis depend only on the
//! face's own parameters without a derivative along d. Prescribing these prescribes the whole face exactly and leaves
//! the derivatives through it free.
//!
//! What is prescribed at a load factor l, with R(axis, angle) by the right-hand rule:
//!
//! ```text
//! clamp     x = X,  or where a bone carries the face  x = c + s d + R(h) (X - c)
//! symmetry  n . x = n . X
//! plate     n . x = n . X + l offset
//! rotate    x = c + R(axis, l angle) (X - c)
//! ```

use crate::math::tensor::{IDENTITY, Matrix, Vector, add_scaled, apply, cross, dot, normalised, rotation, subtract};
use crate::mesh::Mesh;
use crate::mesh::face::Face;
use crate::term::bone::{Bone, Wrench};
use std::sync::Arc;

/// A prescribed motion of a set of faces.
#[derive(Debug, Clone)]
pub enum Support {
    /// No motion.
    Clamp {
        /// The faces.
        faces: Vec<Face>,
    },
    /// No motion along one axis: the faces lie in a plane normal to it.
    Symmetry {
        /// The faces.
        faces: Vec<Face>,
        /// The axis, 0 to 2.
        axis: usize,
    },
    /// The faces lie in a plane normal to an axis and stay in it while it moves: a smooth plate pulls or presses.
    Plate {
        /// The faces.
        faces: Vec<Face>,
        /// The axis, 0 to 2.
        axis: usize,
        /// Motion of the plane along the axis at full load, mm.
        offset: f64,
    },
    /// A rigid rotation about an axis, in proportion to the load factor.
    Rotate {
        /// The faces.
        faces: Vec<Face>,
        /// Unit vector.
        axis: Vector,
        /// A point on the axis, mm.
        through: Vector,
        /// Angle at full load, radians.
        angle: f64,
    },
    /// An affine motion u = load (gradient X + offset): a face is pulled, pushed or sheared.
    Affine {
        /// The faces.
        faces: Vec<Face>,
        /// du/dX at full load: `gradient[i][J]`, dimensionless.
        gradient: Matrix,
        /// Displacement of the origin at full load, mm.
        offset: Vector,
    },
    /// The motion of a bone, whatever the load.
    Carried {
        /// The faces.
        faces: Vec<Face>,
        /// The bone that they are grown to.
        bone: Arc<Bone>,
    },
}

/// All supports of a model: which parameters are prescribed, and to what.
#[derive(Debug, Clone, Default)]
pub struct Supports {
    supports: Vec<Support>,
    /// Per support, the global parameters that it prescribes, ascending.
    parameters: Vec<Vec<usize>>,
    /// Per global parameter and component, the support that prescribes it.
    owner: Vec<[Option<usize>; 3]>,
}

/// Two supports that prescribe the same parameter to different values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conflict {
    /// Indices of the two supports.
    pub supports: (usize, usize),
    /// The node where they meet.
    pub node: usize,
}

impl Supports {
    /// Of a mesh. Supports may overlap only where they agree.
    pub fn new(mesh: &Mesh, supports: Vec<Support>) -> Result<Supports, Conflict> {
        let mut owner: Vec<[Option<usize>; 3]> = vec![[None; 3]; mesh.parameters.len()];
        let posed = a_pose(&supports);
        let mut parameters = Vec::with_capacity(supports.len());
        for (index, support) in supports.iter().enumerate() {
            let (faces, components) = support.reach();
            let own = face_parameters(mesh, faces);
            for &parameter in &own {
                for component in components.clone() {
                    let slot = &mut owner[parameter][component];
                    match *slot {
                        Some(other) if !agree(mesh, [&supports[other], support], parameter, component, &posed) => {
                            let node = mesh.parameter_node[parameter];
                            return Err(Conflict { supports: (other, index), node });
                        }
                        Some(_) => {}
                        None => *slot = Some(index),
                    }
                }
            }
            parameters.push(own);
        }
        Ok(Supports { supports, parameters, owner })
    }

    /// Whether a component of a global parameter is prescribed.
    pub fn fixes(&self, parameter: usize, component: usize) -> bool {
        self.owner[parameter][component].is_some()
    }

    /// The supports in the order given.
    pub fn iter(&self) -> impl Iterator<Item = &Support> {
        self.supports.iter()
    }

    /// The largest angle by which a support rotates at full load, radians.
    pub fn largest_rotation(&self) -> f64 {
        let angle = |s: &Support| if let Support::Rotate { angle, .. } = s { angle.abs() } else { 0.0 };
        self.supports.iter().map(angle).fold(0.0, f64::max)
    }

    /// The prescribed displacements at a load factor and for the controls of a model: (parameter, component, mm).
    pub fn prescribed(&self, mesh: &Mesh, load: f64, controls: &[f64]) -> Vec<(usize, usize, f64)> {
        let mut all = Vec::new();
        for (parameter, owners) in self.owner.iter().enumerate() {
            for (component, owner) in owners.iter().enumerate() {
                if let Some(owner) = owner {
                    let u = self.supports[*owner].displacement(mesh, parameter, load, controls);
                    all.push((parameter, component, u[component]));
                }
            }
        }
        all
    }

    /// The bones that carry faces.
    pub fn bones(&self) -> impl Iterator<Item = &Arc<Bone>> {
        self.supports.iter().filter_map(|support| match support {
            Support::Carried { bone, .. } => Some(bone),
            _ => None,
        })
    }

    /// Moves the faces on bones to where their bones are.
    pub fn carry(&self, mesh: &Mesh, controls: &[f64], u: &mut [Vector]) {
        for (parameter, component, support) in self.carried() {
            u[parameter][component] = support.displacement(mesh, parameter, 0.0, controls)[component];
        }
    }

    /// du/d(control) of the faces on bones, one triple per global parameter; `None` for a control that moves none.
    pub fn rate(&self, mesh: &Mesh, control: usize, controls: &[f64]) -> Option<Vec<Vector>> {
        if !self.bones().any(|bone| bone.controls().contains(&control)) {
            return None;
        }
        let mut rate = vec![[0.0; 3]; mesh.parameters.len()];
        for (parameter, component, support) in self.carried() {
            let Support::Carried { bone, .. } = support else { continue };
            let Some(twist) = bone.twist(control, controls) else { continue };
            let (pose, x) = (bone.pose(controls), mesh.parameters[parameter]);
            let value = mesh.parameter_derivative[parameter] == 0;
            let moved = if value { twist.velocity(pose.place(x)) } else { twist.turning(pose.turn(x)) };
            rate[parameter][component] = moved[component];
        }
        Some(rate)
    }

    /// What a bone exerts on the body through its faces, from the forces dPi/du on all parameters and the current
    /// parameters of x.
    pub fn wrench(&self, mesh: &Mesh, name: &str, force: &[Vector], x: &[Vector]) -> Wrench {
        let mut wrench = Wrench::default();
        for (parameter, component, support) in self.carried() {
            if !matches!(support, Support::Carried { bone, .. } if bone.name() == name) {
                continue;
            }
            let own = std::array::from_fn(|i| if i == component { force[parameter][i] } else { 0.0 });
            match mesh.parameter_derivative[parameter] {
                0 => wrench.add_force(own, x[parameter]),
                _ => wrench.add_moment(own, x[parameter]),
            }
        }
        wrench
    }

    /// What bones prescribe: (parameter, component, support).
    fn carried(&self) -> impl Iterator<Item = (usize, usize, &Support)> {
        let all = self.owner.iter().enumerate().filter(|_| self.bones().next().is_some());
        all.flat_map(|(parameter, owners)| (0..3).map(move |component| (parameter, component, owners[component])))
            .filter_map(|(parameter, component, owner)| Some((parameter, component, &self.supports[owner?])))
            .filter(|(.., support)| matches!(support, Support::Carried { .. }))
    }

    /// For every rotation in turn: (torque about its axis in mN mm, force along it in mN) that the support exerts on
    /// the body, from the forces dPi/du on all parameters and the current parameters of x.
    pub fn rotation_reactions(&self, mesh: &Mesh, force: &[Vector], x: &[Vector]) -> Vec<(f64, f64)> {
        let mut reactions = Vec::new();
        for (support, parameters) in self.supports.iter().zip(&self.parameters) {
            let Support::Rotate { axis, through, .. } = support else { continue };
            let (mut torque, mut axial) = (0.0, 0.0);
            for &parameter in parameters {
                // the virtual rotation of the face turns derivatives as vectors and values about the axis
                let arm = if mesh.parameter_derivative[parameter] == 0 {
                    axial += dot(force[parameter], *axis);
                    subtract(x[parameter], *through)
                } else {
                    x[parameter]
                };
                torque += dot(force[parameter], cross(*axis, arm));
            }
            reactions.push((torque, axial));
        }
        reactions
    }
}

impl Support {
    fn reach(&self) -> (&[Face], std::ops::Range<usize>) {
        match self {
            Support::Clamp { faces }
            | Support::Rotate { faces, .. }
            | Support::Affine { faces, .. }
            | Support::Carried { faces, .. } => (faces, 0..3),
            Support::Symmetry { faces, axis } | Support::Plate { faces, axis, .. } => (faces, *axis..*axis + 1),
        }
    }

    /// Displacement of a global parameter: u = (R - I)(X - c) for values, (R - I) X for derivatives; likewise for an
    /// affine motion and for a bone.
    fn displacement(&self, mesh: &Mesh, parameter: usize, load: f64, controls: &[f64]) -> Vector {
        match self {
            Support::Clamp { .. } | Support::Symmetry { .. } => [0.0; 3],
            // of the component along the axis, the only one that is prescribed
            Support::Plate { offset, .. } => {
                let value = mesh.parameter_derivative[parameter] == 0;
                [if value { load * offset } else { 0.0 }; 3]
            }
            Support::Rotate { axis, through, angle, .. } => {
                let r = rotation(*axis, load * angle);
                let turn: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| r[i][j] - IDENTITY[i][j]));
                let x = mesh.parameters[parameter];
                let value = mesh.parameter_derivative[parameter] == 0;
                apply(&turn, if value { subtract(x, *through) } else { x })
            }
            Support::Affine { gradient, offset, .. } => {
                let x = mesh.parameters[parameter];
                let value = f64::from(u8::from(mesh.parameter_derivative[parameter] == 0));
                add_scaled(apply(gradient, x), value, *offset).map(|u| load * u)
            }
            Support::Carried { bone, .. } => {
                let (pose, x) = (bone.pose(controls), mesh.parameters[parameter]);
                let value = mesh.parameter_derivative[parameter] == 0;
                if value { pose.motion(x) } else { pose.turning(x) }
            }
        }
    }
}

/// Controls at which no two bones move alike: what agrees here agrees everywhere.
fn a_pose(supports: &[Support]) -> Vec<f64> {
    let bones = supports.iter().filter_map(|s| if let Support::Carried { bone, .. } = s { Some(bone) } else { None });
    let last = bones.flat_map(|bone| bone.controls()).max();
    (0..last.map_or(0, |last| last + 1)).map(|control| 7.3 + 1.1 * control as f64).collect()
}

fn agree(mesh: &Mesh, [a, b]: [&Support; 2], parameter: usize, component: usize, controls: &[f64]) -> bool {
    let (u, v) = (a.displacement(mesh, parameter, 1.0, controls), b.displacement(mesh, parameter, 1.0, controls));
    (u[component] - v[component]).abs() <= 1e-12 * (1.0 + u[component].abs())
}

/// The global parameters on which the field on these faces depends: those at the face's nodes without a derivative
/// through the face. Ascending, without repetition.
pub fn face_parameters(mesh: &Mesh, faces: &[Face]) -> Vec<usize> {
    let mut all = Vec::new();
    let per_node = mesh.element.parameters_per_node();
    for face in faces {
        for node in face.side.nodes() {
            for derivative in 0..per_node {
                if derivative >> face.side.direction & 1 == 1 {
                    continue;
                }
                let terms = mesh.map.terms(face.element, node * per_node + derivative);
                all.extend(terms.iter().map(|t| t.global as usize));
            }
        }
    }
    all.sort_unstable();
    all.dedup();
    all
}

/// The axis that a set of faces is normal to, or `None` where they are not all in planes normal to one axis.
pub fn normal_axis(mesh: &Mesh, faces: &[Face]) -> Option<usize> {
    let samples = [[0.1, 0.2], [0.9, 0.1], [0.5, 0.5], [0.2, 0.9], [0.8, 0.8]];
    let normals = faces.iter().flat_map(|face| {
        let local = mesh.local(face.element);
        samples.map(|st| {
            let (_, jacobian) = crate::mesh::position_and_jacobian(mesh.element, &local, face.side.lift(st));
            normalised(face.side.area_vector(&jacobian))
        })
    });
    let normals: Vec<Vector> = normals.collect();
    (0..3).find(|&axis| !normals.is_empty() && normals.iter().all(|n| n[axis].abs() > 1.0 - 1e-12))
}
