//! Likeness of left and right: sum over pairs `<name>.L`, `<name>.R` of (a_L - a_R)^2 / (2 sd^2).

use super::{Instant, Objective, Sum};
use crate::model::Model;

/// The difference of pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Similarity {
    sd: f64,
    /// Indices among the unknowns: left, right.
    pairs: Vec<[usize; 2]>,
}

impl Similarity {
    /// Of the pairs among the controls `unknowns`, fields node by node.
    pub fn new(sd: f64, model: &Model, unknowns: &[usize]) -> Similarity {
        let name = |k: usize| model.controls()[unknowns[k]].name.as_str();
        let other = |left: usize| {
            // `zygomaticus.L`, or `zygomaticus.L[3]` of a field
            let (stem, node) = name(left).split_once(".L")?;
            if !(node.is_empty() || node.starts_with('[')) {
                return None;
            }
            let right = format!("{stem}.R{node}");
            (0..unknowns.len()).find(|k| name(*k) == right).map(|right| [left, right])
        };
        Similarity { sd, pairs: (0..unknowns.len()).filter_map(other).collect() }
    }
}

impl Objective for Similarity {
    fn name(&self) -> &'static str {
        "similarity"
    }

    fn words(&self) -> String {
        format!("likeness of {} pairs, left and right (sd {})", self.pairs.len(), self.sd)
    }

    fn add(&self, at: &Instant<'_>, sum: &mut Sum) {
        let weight = 1.0 / (self.sd * self.sd);
        for [l, r] in &self.pairs {
            let difference = at.a[*l] - at.a[*r];
            sum.value += 0.5 * weight * difference * difference;
            for (k, sign) in [(*l, 1.0), (*r, -1.0)] {
                sum.gradient[k] += sign * weight * difference;
                sum.hessian[(k, k)] += weight;
            }
            sum.hessian[(*l, *r)] -= weight;
            sum.hessian[(*r, *l)] -= weight;
        }
    }
}
