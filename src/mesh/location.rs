//! Point location: which element holds a point, by inverse interpolation with a tree of element boxes.

use super::bezier::bounding_box;
use super::{MaterialPoint, Mesh, position_and_jacobian};
use crate::math::tensor::{Matrix, Vector, apply, apply_transposed, determinant, inverse, norm, subtract};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, PointDistance, RTree};

/// How far outside [0, 1] a local coordinate may come out of the inversion and still count as inside.
const XI_TOLERANCE: f64 = 1e-9;

type ElementBox = GeomWithData<Rectangle<[f64; 3]>, usize>;

/// Finds material points of the reference geometry of a mesh.
pub struct Locator<'m> {
    mesh: &'m Mesh,
    tree: RTree<ElementBox>,
    locals: Vec<[[f64; 64]; 3]>,
    /// Longest diagonal of an element box, mm.
    scale: f64,
}

/// The answer for a point that no element holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    /// The nearest material point that was found.
    pub nearest: MaterialPoint,
    /// Distance to it, mm.
    pub distance: f64,
}

impl<'m> Locator<'m> {
    /// A tree over the boxes of all elements of `mesh`.
    pub fn new(mesh: &'m Mesh) -> Locator<'m> {
        let locals: Vec<_> = (0..mesh.elements()).map(|e| mesh.local(e)).collect();
        let mut scale: f64 = 0.0;
        let boxes = locals
            .iter()
            .enumerate()
            .map(|(element, local)| {
                let (low, high) = bounding_box(mesh.element, local);
                scale = scale.max(norm(subtract(high, low)));
                GeomWithData::new(Rectangle::from_corners(low, high), element)
            })
            .collect();
        Locator { mesh, tree: RTree::bulk_load(boxes), locals, scale }
    }

    /// The mesh whose points are found.
    pub fn mesh(&self) -> &'m Mesh {
        self.mesh
    }

    /// The material point at reference position `x` (mm). On a shared face the lowest element index wins.
    ///
    /// Errors: [`Outside`] with the nearest point when no element holds it.
    pub fn locate(&self, x: Vector) -> Result<MaterialPoint, Outside> {
        self.holder(x).ok_or_else(|| self.nearest(x))
    }

    /// The same without a search for the nearest point where no element holds it.
    pub fn holder(&self, x: Vector) -> Option<MaterialPoint> {
        let margin = 1e-9 * self.scale;
        let around = AABB::from_corners(x.map(|c| c - margin), x.map(|c| c + margin));
        let mut candidates: Vec<usize> = self.tree.locate_in_envelope_intersecting(around).map(|b| b.data).collect();
        candidates.sort_unstable();
        // from the middle of each, which nearly always does; from elsewhere only where no element holds it then
        let middle = || std::iter::once([0.5; 3]);
        let elsewhere =
            || (0..27).filter(|k| *k != 13).map(|k| [k % 3, k / 3 % 3, k / 9].map(|i| [0.1, 0.5, 0.9][i]));
        let from_middle = candidates.iter().find_map(|element| Some((*element, self.invert(*element, x, middle())?)));
        let found = from_middle.or_else(|| {
            candidates.iter().find_map(|element| Some((*element, self.invert(*element, x, elsewhere())?)))
        });
        found.map(|(element, xi)| MaterialPoint { element, xi })
    }

    /// dX/dxi at a material point, mm, as [`Mesh::jacobian`]: the parameters of elements are at hand here.
    pub fn jacobian(&self, at: MaterialPoint) -> Matrix {
        position_and_jacobian(self.mesh.element, &self.locals[at.element], at.xi).1
    }

    /// Newton's method on x(xi) = x from some places in turn.
    fn invert(&self, element: usize, x: Vector, starts: impl Iterator<Item = [f64; 3]>) -> Option<[f64; 3]> {
        for start in starts {
            let mut xi = start;
            for _ in 0..30 {
                let (position, jacobian) = position_and_jacobian(self.mesh.element, &self.locals[element], xi);
                let residual = subtract(x, position);
                let det = determinant(&jacobian);
                if det == 0.0 {
                    break;
                }
                let step = apply(&inverse(&jacobian, det), residual);
                // a step of more than an element is not trusted
                let length = norm(step);
                let factor = if length > 1.0 { 1.0 / length } else { 1.0 };
                for d in 0..3 {
                    xi[d] = (xi[d] + factor * step[d]).clamp(-0.5, 1.5);
                }
                if length < 1e-14 || (length < 1e-11 && norm(residual) <= 1e-15 * self.scale) {
                    break;
                }
            }
            let inside = xi.iter().all(|c| (-XI_TOLERANCE..=1.0 + XI_TOLERANCE).contains(c));
            if inside {
                let xi = xi.map(|c| c.clamp(0.0, 1.0));
                let (position, _) = position_and_jacobian(self.mesh.element, &self.locals[element], xi);
                if norm(subtract(x, position)) <= 4.0 * XI_TOLERANCE * self.scale {
                    return Some(xi);
                }
            }
        }
        None
    }

    /// The nearest point of the mesh: over the elements in order of the distance of their boxes, until no box can be
    /// nearer than what was found.
    fn nearest(&self, x: Vector) -> Outside {
        let mut best = Outside { nearest: MaterialPoint { element: 0, xi: [0.5; 3] }, distance: f64::INFINITY };
        for candidate in self.tree.nearest_neighbor_iter(x) {
            if candidate.geom().distance_2(&x).sqrt() >= best.distance {
                break;
            }
            let (xi, distance) = self.closest_in(candidate.data, x);
            if distance < best.distance {
                best = Outside { nearest: MaterialPoint { element: candidate.data, xi }, distance };
            }
        }
        best
    }

    /// Minimises |x(xi) - x| over the cube by projected Gauss-Newton steps from the best of 27 starts.
    fn closest_in(&self, element: usize, x: Vector) -> ([f64; 3], f64) {
        let at = |xi| position_and_jacobian(self.mesh.element, &self.locals[element], xi);
        let distance = |xi| norm(subtract(at(xi).0, x));
        let grid = (0..27).map(|k| [k % 3, k / 3 % 3, k / 9].map(|i| i as f64 / 2.0));
        let mut xi = grid.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or([0.5; 3]);
        let mut best = distance(xi);
        for _ in 0..50 {
            let (position, jacobian) = at(xi);
            let gradient = apply_transposed(&jacobian, subtract(position, x));
            // Newton direction of the Gauss-Newton model on the coordinates that may move
            let free: [bool; 3] = std::array::from_fn(|d| {
                !((xi[d] <= 0.0 && gradient[d] > 0.0) || (xi[d] >= 1.0 && gradient[d] < 0.0))
            });
            let mut normal = [[0.0; 3]; 3];
            for a in 0..3 {
                for b in 0..3 {
                    let product: f64 = (0..3).map(|i| jacobian[i][a] * jacobian[i][b]).sum();
                    normal[a][b] = if free[a] && free[b] { product } else { f64::from(u8::from(a == b)) };
                }
                normal[a][a] += 1e-12 * self.scale * self.scale;
            }
            let right = std::array::from_fn(|d| if free[d] { -gradient[d] } else { 0.0 });
            let step = apply(&inverse(&normal, determinant(&normal)), right);
            let mut factor = 1.0;
            let mut moved = false;
            for _ in 0..20 {
                let trial = std::array::from_fn(|d| (xi[d] + factor * step[d]).clamp(0.0, 1.0));
                let value = distance(trial);
                if value < best {
                    (xi, best, moved) = (trial, value, true);
                    break;
                }
                factor *= 0.5;
            }
            if !moved {
                break;
            }
        }
        (xi, best)
    }
}
