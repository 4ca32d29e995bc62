//! The face of a person: a sheet of tissue from the hairline to below the chin and from ear to ear, made from named landmarks.
//!
//! ```text
//! landmarks -> Sheet: (u, v, w) -> X        grid: (s, t) -> (u, v)
//!                 \                            /
//!                  host: the mesh of the tissue        strip: the meshes of the muscles
//! ```
//!
//! Lengths in mm; x to the subject's left, y up, z forwards.

use crate::math::tensor::Vector;

mod grid;
mod host;
mod radial;
mod sheet;
mod strip;

pub use host::{FACES, Options, host};
pub use sheet::{Landmark, Sheet, Spot};
pub use strip::{BodySide, Course};

/// A named point on the deep surface of the left side, where something holds the tissue to the bone.
#[derive(Debug, Clone, PartialEq)]
pub struct Anchor {
    /// Its name.
    pub name: String,
    /// Where it is on the sheet, mm.
    pub u: f64,
    /// The same, upwards.
    pub v: f64,
}

/// A face: its map, and what lies in it.
#[derive(Debug, Clone)]
pub struct Facial {
    /// The landmarks that the map goes through.
    pub landmarks: Vec<Landmark>,
    /// The map.
    pub sheet: Sheet,
    /// Its muscles.
    pub muscles: Vec<Course>,
    /// Its retaining ligaments.
    pub ligaments: Vec<Anchor>,
}

/// Anchors lie this part of the thickness above the deep surface, so that the elements hold them.
const ANCHOR_DEPTH: f64 = 0.05;

impl Facial {
    /// The muscle of this name.
    pub fn muscle(&self, name: &str) -> Option<&Course> {
        self.muscles.iter().find(|course| course.name == name)
    }

    /// Where the ligament of this name is on a side, mm.
    pub fn ligament(&self, name: &str, side: BodySide) -> Option<Vector> {
        let anchor = self.ligaments.iter().find(|anchor| anchor.name == name)?;
        Some(self.anchor(anchor.u, anchor.v, side))
    }

    /// Where the muscle of this name is fixed to bone on a side, mm; empty for one that is not.
    pub fn origin(&self, name: &str, side: BodySide) -> Option<Vec<Vector>> {
        Some(self.muscle(name)?.origin.iter().map(|[u, v]| self.anchor(*u, *v, side)).collect())
    }

    fn anchor(&self, u: f64, v: f64, side: BodySide) -> Vector {
        side.of_left(self.sheet.at(u, v, ANCHOR_DEPTH).position)
    }
}
