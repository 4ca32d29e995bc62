//! Bones that move: rigid bodies whose pose is a control of the model.
//!
//! A hinge turns a bone by the angle h about the axis a through c, then a slide shifts it by s along d, its hinge with it:
//! ```text
//! x = c + s d + R(h) (X - c)
//! dx/dh = a x (x - c - s d),  dx/ds = d,  d(R v)/dh = a x R v for a vector v of the bone
//! ```
//! As controls h is in degrees and s in mm; both are 0 in the reference shape. What a bone carries moves with it: faces
//! (a support), the surface of a contact, attachments.

use super::ElementState;
use crate::math::tensor::{
    IDENTITY, Matrix, Vector, add_scaled, apply, apply_transposed, cross, dot, rotation, subtract,
};
use std::sync::Arc;

/// A rigid body with a hinge, a slide, or both.
#[derive(Debug, Clone, PartialEq)]
pub struct Bone {
    name: String,
    hinge: Option<Hinge>,
    slide: Option<Slide>,
    controls: Vec<usize>,
}

/// A rotation about an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hinge {
    /// a, a unit vector; the rotation is by the right-hand rule.
    pub axis: Vector,
    /// c, a point of the axis in the reference shape, mm.
    pub through: Vector,
    /// The control that is the angle h, degrees.
    pub control: usize,
}

/// A translation along a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slide {
    /// d, a unit vector, fixed in space.
    pub direction: Vector,
    /// The control that is the way s, mm.
    pub control: usize,
}

/// Where a bone is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// R.
    rotation: Matrix,
    /// c, mm.
    centre: Vector,
    /// s d, mm.
    shift: Vector,
}

/// How a bone moves with one of its controls, per unit of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// Rate of rotation.
    pub spin: Vector,
    /// A point of the axis of rotation where it is now, mm.
    pub through: Vector,
    /// Velocity of that point.
    pub shift: Vector,
}

/// Forces of a bone on the body, added up.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wrench {
    /// Their sum, mN.
    pub force: Vector,
    /// Their moment about the origin, mN mm.
    pub moment: Vector,
}

/// What a bone may carry.
pub trait Carried {
    /// The bone that carries it, if one does.
    fn bone(&self) -> Option<&Arc<Bone>>;

    /// What the bone exerts on the body through it in one element. Its power along the twist of a control is dPi/d(control).
    fn wrench(&self, state: &ElementState<'_>) -> Wrench;
}

impl Bone {
    /// A bone by its name, with at least one way to move.
    pub fn new(name: &str, hinge: Option<Hinge>, slide: Option<Slide>) -> Bone {
        let controls = hinge.iter().map(|h| h.control).chain(slide.iter().map(|s| s.control)).collect();
        Bone { name: name.to_owned(), hinge, slide, controls }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it turns.
    pub fn hinge(&self) -> Option<&Hinge> {
        self.hinge.as_ref()
    }

    /// How it shifts.
    pub fn slide(&self) -> Option<&Slide> {
        self.slide.as_ref()
    }

    /// The controls that move it: hinge, then slide.
    pub fn controls(&self) -> &[usize] {
        &self.controls
    }

    /// Its angle, radians.
    pub fn angle(&self, controls: &[f64]) -> f64 {
        self.hinge.map_or(0.0, |hinge| controls[hinge.control].to_radians())
    }

    /// Its way, mm.
    pub fn way(&self, controls: &[f64]) -> f64 {
        self.slide.map_or(0.0, |slide| controls[slide.control])
    }

    /// Where it is for the controls of a model.
    pub fn pose(&self, controls: &[f64]) -> Pose {
        let way = self.way(controls);
        Pose {
            rotation: self.hinge.map_or(IDENTITY, |hinge| rotation(hinge.axis, self.angle(controls))),
            centre: self.hinge.map_or([0.0; 3], |hinge| hinge.through),
            shift: self.slide.map_or([0.0; 3], |slide| slide.direction.map(|d| way * d)),
        }
    }

    /// How it moves with one control, per degree or per mm; `None` for a control that does not move it.
    pub fn twist(&self, control: usize, controls: &[f64]) -> Option<Twist> {
        let way = self.way(controls);
        if let Some(hinge) = self.hinge.filter(|hinge| hinge.control == control) {
            let shifted = self.slide.map_or(hinge.through, |slide| add_scaled(hinge.through, way, slide.direction));
            return Some(Twist { spin: hinge.axis.map(f64::to_radians), through: shifted, shift: [0.0; 3] });
        }
        let slide = self.slide.filter(|slide| slide.control == control)?;
        Some(Twist { spin: [0.0; 3], through: [0.0; 3], shift: slide.direction })
    }
}

impl Pose {
    /// x - X of the point that was at X, mm; exactly zero at rest.
    pub fn motion(&self, reference: Vector) -> Vector {
        add_scaled(self.turning(subtract(reference, self.centre)), 1.0, self.shift)
    }

    /// (R - I) v of a vector v of the bone.
    pub fn turning(&self, v: Vector) -> Vector {
        let turn: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| self.rotation[i][j] - IDENTITY[i][j]));
        apply(&turn, v)
    }

    /// x of the point that was at X, mm.
    pub fn place(&self, reference: Vector) -> Vector {
        add_scaled(reference, 1.0, self.motion(reference))
    }

    /// X of the point of the bone that is at x, mm.
    pub fn reference(&self, place: Vector) -> Vector {
        let arm = subtract(subtract(place, self.centre), self.shift);
        add_scaled(self.centre, 1.0, apply_transposed(&self.rotation, arm))
    }

    /// R v
    pub fn turn(&self, v: Vector) -> Vector {
        apply(&self.rotation, v)
    }

    /// R m R^T
    pub fn turn_both(&self, m: &Matrix) -> Matrix {
        // rows of (R m)^T are columns of R m
        let half: [Vector; 3] = std::array::from_fn(|j| self.turn(std::array::from_fn(|i| m[i][j])));
        let rows: [Vector; 3] = std::array::from_fn(|i| std::array::from_fn(|j| half[j][i]));
        rows.map(|row| self.turn(row))
    }
}

impl Twist {
    /// dx of the point of the bone that is at x, mm.
    pub fn velocity(&self, place: Vector) -> Vector {
        add_scaled(self.shift, 1.0, self.turning(subtract(place, self.through)))
    }

    /// dv of a vector of the bone that is v now.
    pub fn turning(&self, v: Vector) -> Vector {
        cross(self.spin, v)
    }
}

impl Wrench {
    /// Adds a force (mN) at a point (mm).
    pub fn add_force(&mut self, force: Vector, at: Vector) {
        self.force = add_scaled(self.force, 1.0, force);
        self.moment = add_scaled(self.moment, 1.0, cross(at, force));
    }

    /// Adds a force on a derivative of the geometry, which turns with the bone and does not shift: a moment alone.
    pub fn add_moment(&mut self, force: Vector, derivative: Vector) {
        self.moment = add_scaled(self.moment, 1.0, cross(derivative, force));
    }

    /// Adds another.
    pub fn add(&mut self, other: &Wrench) {
        self.force = add_scaled(self.force, 1.0, other.force);
        self.moment = add_scaled(self.moment, 1.0, other.moment);
    }

    /// Work per unit of a control, uJ.
    pub fn power(&self, twist: &Twist) -> f64 {
        let about = subtract(self.moment, cross(twist.through, self.force));
        dot(twist.spin, about) + dot(twist.shift, self.force)
    }
}
