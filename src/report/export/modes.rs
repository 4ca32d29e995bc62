//! What moves, as a few shapes that are mixed: the singular value decomposition of the displacements over the frames.
//!
//! With D the displacements of all points (rows) in all frames (columns), D = sum_k s_k m_k v_k^T. Programs clamp the weight
//! of a shape to [0, 1], so every mode is a pair: a plus target m_k s_k max_t v_k+ and a minus target -m_k s_k max_t v_k-,
//! of which at most one has a weight in a frame.

use crate::math::tensor::{Vector, add_scaled, norm, subtract};
use crate::report::playback::Playback;
use nalgebra::DMatrix;

/// Modes at most.
const MOST: usize = 24;
/// The part of the sum of squared displacements that may be left out.
const LEFT_OUT: f64 = 1e-6;

/// Shapes and their weights.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Modes {
    /// Displacements at weight 1 of the skin, then of every muscle, mm.
    pub targets: Vec<Target>,
    /// Of every frame with a shape, the weight of every target, in [0, 1].
    pub weights: Vec<Vec<f64>>,
    /// The largest distance between a point of a frame and what the modes make of it, mm.
    pub largest_error_mm: f64,
}

/// One side of a mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// `mode_1_plus`, `mode_1_minus`, ...
    pub name: String,
    /// Displacement of the points of the skin, then of every muscle, mm.
    pub bodies: Vec<Vec<Vector>>,
}

/// The modes of a run.
pub fn modes(run: &Playback) -> Modes {
    let rest: Vec<&[Vector]> =
        std::iter::once(&run.skin).chain(&run.muscles).map(|body| body.rest.as_slice()).collect();
    let columns: Vec<Vec<Vector>> = run
        .shapes
        .iter()
        .map(|shape| {
            let bodies = std::iter::once(&shape.skin).chain(&shape.muscles).zip(&rest);
            bodies.flat_map(|(now, rest)| now.iter().zip(*rest).map(|(x, r)| subtract(*x, *r))).collect()
        })
        .collect();
    let frames = columns.len();
    let inner =
        |a: &[Vector], b: &[Vector]| a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum::<f64>();
    // D^T D = V S^2 V^T is small: a row and a column per frame
    let gram = DMatrix::from_fn(frames, frames, |a, b| inner(&columns[a], &columns[b]));
    let all = gram.trace();
    let eigen = gram.symmetric_eigen();
    let mut order: Vec<usize> = (0..frames).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let mut modes = Modes { weights: vec![Vec::new(); frames], ..Modes::default() };
    let mut left = columns.clone();
    let mut remaining = all;
    for (number, k) in order.into_iter().take(MOST).enumerate() {
        if remaining <= LEFT_OUT * all || eigen.eigenvalues[k] <= 0.0 {
            break;
        }
        remaining -= eigen.eigenvalues[k];
        let mut v: Vec<f64> = eigen.eigenvectors.column(k).iter().copied().collect();
        // the sign of an eigenvector is arbitrary: the larger side is plus
        let ends = |v: &[f64]| v.iter().fold([0.0_f64; 2], |[low, high], c| [low.min(*c), high.max(*c)]);
        if let [low, high] = ends(&v)
            && -low > high
        {
            v.iter_mut().for_each(|c| *c = -*c);
        }
        let mut mode = vec![[0.0; 3]; columns[0].len()];
        for (column, c) in columns.iter().zip(&v) {
            mode.iter_mut().zip(column).for_each(|(m, d)| *m = add_scaled(*m, *c, *d));
        }
        for (left, c) in left.iter_mut().zip(&v) {
            left.iter_mut().zip(&mode).for_each(|(d, m)| *d = add_scaled(*d, -c, *m));
        }
        let [low, high] = ends(&v);
        for (side, end) in [("plus", high), ("minus", low)] {
            // a side that no frame takes, but for roundings, is left out
            if end.abs() <= 1e-6 * high {
                continue;
            }
            let mut points = mode.iter().map(|m| m.map(|c| end * c));
            let bodies = rest.iter().map(|rest| points.by_ref().take(rest.len()).collect()).collect();
            modes.targets.push(Target { name: format!("mode_{}_{side}", number + 1), bodies });
            modes.weights.iter_mut().zip(&v).for_each(|(weights, c)| weights.push((c / end).clamp(0.0, 1.0)));
        }
    }
    modes.largest_error_mm = left.iter().flatten().map(|d| norm(*d)).fold(0.0, f64::max);
    modes
}
