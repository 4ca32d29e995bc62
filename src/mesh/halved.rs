//! Blocks whose elements are halved in each direction. The space of the halved block contains that of the block, so that
//! every field of it has the same values there: a parameter of a halved element is a derivative of the field where its
//! corner lies in the parent, times 1/2 for every direction that is differentiated.

use super::element::Element;
use super::{MaterialPoint, Mesh};
use crate::math::tensor::Vector;

/// How the elements of halved blocks lie in those of the blocks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Halving {
    /// Of every halved element.
    parents: Vec<Parent>,
    /// Of every element, its eight parts, by [`part`].
    parts: Vec<[usize; 8]>,
}

/// Where a halved element lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parent {
    /// The element that holds it.
    pub element: usize,
    /// Which half of it in each direction, 0 or 1.
    pub half: [usize; 3],
}

/// The index of a part among the eight of its parent.
fn part(half: [usize; 3]) -> usize {
    half[0] + 2 * half[1] + 4 * half[2]
}

impl Halving {
    /// Of blocks of these numbers of elements, one after the other, each numbered as by [`block`](super::block::block).
    pub fn new(blocks: &[[usize; 3]]) -> Halving {
        let mut halving = Halving { parents: Vec::new(), parts: Vec::new() };
        for &[n1, n2, n3] in blocks {
            let first = halving.parts.len();
            halving.parts.resize(first + n1 * n2 * n3, [0; 8]);
            for k in 0..2 * n3 {
                for j in 0..2 * n2 {
                    for i in 0..2 * n1 {
                        let element = first + i / 2 + n1 * (j / 2 + n2 * (k / 2));
                        let half = [i % 2, j % 2, k % 2];
                        halving.parts[element][part(half)] = halving.parents.len();
                        halving.parents.push(Parent { element, half });
                    }
                }
            }
        }
        halving
    }

    /// The parent of every halved element.
    pub fn parents(&self) -> &[Parent] {
        &self.parents
    }

    /// The eight parts of an element.
    pub fn parts(&self, element: usize) -> [usize; 8] {
        self.parts[element]
    }

    /// The same material point among the halved elements.
    pub fn point(&self, MaterialPoint { element, xi }: MaterialPoint) -> MaterialPoint {
        let half = xi.map(|x| usize::from(x > 0.5));
        let xi = std::array::from_fn(|d| 2.0 * xi[d] - half[d] as f64);
        MaterialPoint { element: self.parts[element][part(half)], xi }
    }

    /// The local coordinates in the parent of a point of a halved element.
    pub fn in_parent(&self, element: usize, xi: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|d| 0.5 * (self.parents[element].half[d] as f64 + xi[d]))
    }

    /// The global parameters on the halved mesh `fine` of a field with the parameters `field` on `coarse`.
    ///
    /// # Panics
    /// Where an element of `fine` does not use its parameters as they are, as those of a block do.
    pub fn carry(&self, coarse: &Mesh, fine: &Mesh, field: &[Vector]) -> Vec<Vector> {
        let element = coarse.element;
        let of_half = [0, 1].map(|half| halves(element, half));
        let mut carried = vec![[0.0; 3]; fine.parameters.len()];
        for (e, Parent { element: parent, half }) in self.parents.iter().enumerate() {
            let local = coarse.local_of(*parent, field);
            let rows = half.map(|half| &of_half[half]);
            for a in 0..element.functions() {
                let [term] = fine.map.terms(e, a) else { panic!("a parameter of its own") };
                assert!(term.scale == 1.0, "a parameter as it is");
                let row = element.factors(a);
                let mut sum = [0.0; 3];
                for b in 0..element.functions() {
                    let column = element.factors(b);
                    let weight: f64 = (0..3).map(|d| rows[d][row[d]][column[d]]).product();
                    (0..3).for_each(|i| sum[i] += weight * local[i][b]);
                }
                carried[term.global as usize] = sum;
            }
        }
        carried
    }
}

/// The 1-D parameters of a half of an element from those of the whole: `[parameter of the half][parameter of the whole]`.
fn halves(element: &dyn Element, half: usize) -> [[f64; 4]; 4] {
    let per_end = if element.parameters_per_node() == 8 { 2 } else { 1 };
    let mut rows = [[0.0; 4]; 4];
    for end in 0..2 {
        let x = 0.5 * (half + end) as f64;
        rows[per_end * end] = element.values_1d(x);
        if per_end == 2 {
            rows[per_end * end + 1] = element.slopes_1d(x).map(|slope| 0.5 * slope);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::block::block;
    use crate::mesh::element::ELEMENTS;

    #[test]
    fn a_field_has_the_same_values_on_halved_blocks() {
        for element in ELEMENTS {
            let mesh = |n: [usize; 3]| block(element, [1.0, 2.0, 3.0], [9.0, 4.0, 5.0], n);
            let (coarse, fine) = (mesh([3, 1, 2]), mesh([6, 2, 4]));
            let halving = Halving::new(&[[3, 1, 2]]);
            // any numbers will do; each node has its own
            let wild = |k: usize, i: usize| ((k * 37 + i * 101 + 11) % 97) as f64 / 97.0 - 0.5;
            let field: Vec<Vector> =
                (0..coarse.parameters.len()).map(|k| std::array::from_fn(|i| wild(k, i))).collect();
            let carried = halving.carry(&coarse, &fine, &field);
            let shape = halving.carry(&coarse, &fine, &coarse.parameters);
            for (a, b) in shape.iter().flatten().zip(fine.parameters.iter().flatten()) {
                assert!((a - b).abs() < 1e-13, "{}: {a} is not {b}", element.name());
            }
            for element in 0..coarse.elements() {
                for xi in [[0.1, 0.7, 0.3], [0.5, 0.5, 0.5], [1.0, 0.0, 0.9]] {
                    let at = MaterialPoint { element, xi };
                    let there = halving.point(at);
                    assert_eq!(halving.parents()[there.element].element, element);
                    assert!(halving.parts(element).contains(&there.element));
                    assert_eq!(halving.in_parent(there.element, there.xi), xi);
                    let (ours, theirs) = (fine.interpolate(there, &carried), coarse.interpolate(at, &field));
                    (0..3).for_each(|i| assert!((ours[i] - theirs[i]).abs() < 1e-13, "{ours:?} is not {theirs:?}"));
                }
            }
        }
    }

    #[test]
    fn several_blocks_follow_each_other() {
        let halving = Halving::new(&[[1, 1, 1], [2, 1, 1]]);
        assert_eq!(halving.parts(0), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(halving.parts(2), [10, 11, 14, 15, 18, 19, 22, 23]);
    }
}
