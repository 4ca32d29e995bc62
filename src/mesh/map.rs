//! Element parameter maps: each local parameter of an element is a sum of scale x global parameter.
//!
//! One idea covers shared nodes of unequal elements (scale factors), reversed or permuted directions, versions,
//! collapsed nodes and hanging nodes. The three components of a field share one map;
//! a field whose components do not is brought into one by [`continuous`](super::continuous::continuous).

/// local parameter (element, a) = sum over its terms of scale x global parameter.
#[derive(Debug, Clone)]
pub struct ElementMap {
    functions: usize,
    /// `starts[e * functions + a]..starts[e * functions + a + 1]` are the terms of local parameter a of element e.
    starts: Vec<u32>,
    terms: Vec<Term>,
}

/// scale x global parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// Index of the global parameter.
    pub global: u32,
    /// Dimensionless factor.
    pub scale: f64,
}

impl ElementMap {
    /// From the terms of every local parameter, element by element; every element has `functions` local parameters.
    pub fn new(functions: usize, locals: impl IntoIterator<Item = Vec<Term>>) -> ElementMap {
        let (mut starts, mut terms) = (vec![0], Vec::new());
        for local in locals {
            terms.extend(local);
            starts.push(terms.len() as u32);
        }
        debug_assert_eq!((starts.len() - 1) % functions, 0);
        ElementMap { functions, starts, terms }
    }

    /// Local parameters of an element.
    pub fn functions(&self) -> usize {
        self.functions
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        (self.starts.len() - 1) / self.functions
    }

    /// The terms of local parameter `a` of `element`; empty means that the parameter is zero.
    pub fn terms(&self, element: usize, a: usize) -> &[Term] {
        let k = element * self.functions + a;
        &self.terms[self.starts[k] as usize..self.starts[k + 1] as usize]
    }

    /// The local parameters of `element`, component by component: `local[i][a]`.
    pub fn gather(&self, element: usize, global: &[[f64; 3]], local: &mut [[f64; 64]; 3]) {
        for a in 0..self.functions {
            let mut sum = [0.0; 3];
            for t in self.terms(element, a) {
                for i in 0..3 {
                    sum[i] += t.scale * global[t.global as usize][i];
                }
            }
            for i in 0..3 {
                local[i][a] = sum[i];
            }
        }
    }
}
