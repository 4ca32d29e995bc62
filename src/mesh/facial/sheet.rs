//! The map of the face: a plane sheet (u, v) and a depth w to places in mm.
//!
//! X(u, v, w) = O(u, v) - (1 - w) D(u, v):  O is the skin through all landmarks, D the way from the skin to the deep surface,
//! through the thickness of every landmark along its direction inwards. w = 1 is skin, w = 0 is deep.

use super::radial::{Jet, Radial};
use crate::math::tensor::{Vector, add_scaled, cross, normalised};

/// A named point of the skin of the left half or the midline; the right half mirrors it.
#[derive(Debug, Clone, PartialEq)]
pub struct Landmark {
    /// Its name.
    pub name: String,
    /// Where it is on the plane sheet: along the face from the midline to the left, mm; 0 on the midline.
    pub u: f64,
    /// Upwards on the sheet, mm.
    pub v: f64,
    /// Where it is: x to the subject's left, y up, z forwards, mm; x = 0 on the midline.
    pub position: Vector,
    /// From skin to deep surface, mm.
    pub thickness: f64,
}

/// The axis about which the face bends, x = 0, z = this, mm: inwards is halfway between towards it and the mean normal of the
/// skin around. The normal alone would fold the deep surface inside the nose, the axis alone would thin it at its sides.
const AXIS_Z: f64 = 30.0;
/// How far around a landmark the normal is averaged, mm: grooves as narrow as those of the lips do not turn it.
const AROUND: f64 = 7.0;

/// The map.
#[derive(Debug, Clone)]
pub struct Sheet {
    skin: Radial,
    inwards: Radial,
}

/// A place with its derivatives, mm per unit: by u, v and w.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// X.
    pub position: Vector,
    /// dX/d(u, v, w).
    pub along: [Vector; 3],
}

/// A surface at a point of the sheet with derivatives up to the second.
pub(super) type Surface = Jet;

impl Sheet {
    /// Through landmarks of which no two have the same place on the sheet; `None` where they are fewer than three beside
    /// the midline or on it, or on a line.
    pub fn new(landmarks: &[Landmark]) -> Option<Sheet> {
        let centres: Vec<[f64; 2]> = landmarks.iter().map(|l| [l.u, l.v]).collect();
        let positions: Vec<Vector> = landmarks.iter().map(|l| l.position).collect();
        let skin = Radial::new(&centres, &positions)?;
        let ways: Vec<Vector> = landmarks
            .iter()
            .map(|landmark| {
                let around = [[0.0, 0.0], [AROUND, 0.0], [-AROUND, 0.0], [0.0, AROUND], [0.0, -AROUND]];
                let normals = around.map(|[du, dv]| {
                    let at = skin.at(landmark.u + du, landmark.v + dv);
                    normalised(cross(at.u, at.v))
                });
                let mut normal = normalised(normals.iter().fold([0.0; 3], |sum, n| add_scaled(sum, 1.0, *n)));
                if landmark.u == 0.0 {
                    normal[0] = 0.0;
                }
                let [x, _, z] = landmark.position;
                let away = normalised([x, 0.0, z - AXIS_Z]);
                let outwards = normalised(std::array::from_fn(|i| normal[i] + away[i]));
                outwards.map(|o| landmark.thickness * o)
            })
            .collect();
        Some(Sheet { inwards: Radial::new(&centres, &ways)?, skin })
    }

    /// A place and its derivatives, anywhere on the sheet.
    pub fn at(&self, u: f64, v: f64, w: f64) -> Spot {
        let (skin, inwards) = (self.skin.at(u, v), self.inwards.at(u, v));
        let combine = |o: Vector, d: Vector| std::array::from_fn(|i| o[i] - (1.0 - w) * d[i]);
        Spot {
            position: combine(skin.value, inwards.value),
            along: [combine(skin.u, inwards.u), combine(skin.v, inwards.v), inwards.value],
        }
    }

    /// The skin, and the way from the deep surface to it.
    pub(super) fn surfaces(&self, u: f64, v: f64) -> (Surface, Surface) {
        (self.skin.at(u, v), self.inwards.at(u, v))
    }
}
