//! Where a muscle's quadrature points lie in its own elements.
//!
//! The strain of the host is smooth inside a host element and has kinks at its borders, so a Gauss rule that runs across
//! them converges slowly, and one with few points per host element does not resist what happens between its points. A cut
//! rule is divided where the muscle passes into another host element, and has its points in every part.

use crate::math::quadrature::GaussRule;
use crate::mesh::location::Locator;
use crate::mesh::{Mesh, position_and_jacobian};

/// Rules on [0, 1] along the three directions of every element of a muscle's mesh.
pub struct MuscleRule(Vec<[GaussRule; 3]>);

impl MuscleRule {
    /// `gauss` points per direction in every element.
    pub fn uniform(mesh: &Mesh, gauss: usize) -> MuscleRule {
        let rule = GaussRule::new(gauss);
        MuscleRule(vec![std::array::from_fn(|_| rule.clone()); mesh.elements()])
    }

    /// `gauss` points per direction in every part of an element. The parts end where a line through the element along
    /// that direction passes into another element of the host: exact for boxes in boxes with parallel sides, close to it
    /// where the two meshes are curved.
    pub fn cut(mesh: &Mesh, locator: &Locator<'_>, gauss: usize) -> MuscleRule {
        let rule = GaussRule::new(gauss);
        let of_element = |element| std::array::from_fn(|d| rule.composite(&cuts(mesh, locator, element, d)));
        MuscleRule((0..mesh.elements()).map(of_element).collect())
    }

    /// Element, local coordinates and weight of every point, element by element, first direction fastest.
    pub fn points(&self) -> impl Iterator<Item = (usize, [f64; 3], f64)> + '_ {
        self.0.iter().enumerate().flat_map(|(element, rules)| {
            GaussRule::product(rules.each_ref()).map(move |(eta, weight)| (element, eta, weight))
        })
    }
}

/// Other coordinates of the line along which cuts are sought: not the middle, where a host likes to have a face too.
const LINE: f64 = 0.4837;

/// Pieces of the line whose ends are looked at first.
const PIECES: usize = 32;

/// Cuts are found to this part of the element; parts that are not longer are left out.
const CUT_TOLERANCE: f64 = 1e-9;

/// Coordinates in (0, 1) at which a line along `direction` leaves one host element for another, ascending.
fn cuts(mesh: &Mesh, locator: &Locator<'_>, element: usize, direction: usize) -> Vec<f64> {
    let local = mesh.local(element);
    // outside the host no element holds the point, which is told when the points are embedded
    let holder = |at: f64| {
        let eta = std::array::from_fn(|d| if d == direction { at } else { LINE });
        locator.holder(position_and_jacobian(mesh.element, &local, eta).0).map(|point| point.element)
    };
    let mut found = Vec::new();
    let ends: Vec<f64> = (0..=PIECES).map(|k| k as f64 / PIECES as f64).collect();
    let holders: Vec<_> = ends.iter().map(|at| holder(*at)).collect();
    for k in 0..PIECES {
        bisect(&holder, (ends[k], holders[k]), (ends[k + 1], holders[k + 1]), &mut found);
    }
    let mut last = 0.0;
    found.retain(|cut| {
        let apart = cut - last > 2.0 * CUT_TOLERANCE && 1.0 - cut > 2.0 * CUT_TOLERANCE;
        if apart {
            last = *cut;
        }
        apart
    });
    found
}

/// All places between two points at which the holder changes.
fn bisect<H: PartialEq + Copy>(holder: &dyn Fn(f64) -> H, low: (f64, H), high: (f64, H), found: &mut Vec<f64>) {
    if low.1 == high.1 {
        return;
    }
    let middle = 0.5 * (low.0 + high.0);
    if high.0 - low.0 < CUT_TOLERANCE {
        found.push(middle);
        return;
    }
    let middle = (middle, holder(middle));
    bisect(holder, low, middle, found);
    bisect(holder, middle, high, found);
}
