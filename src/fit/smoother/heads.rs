//! What an error of the head takes from the frames of a clip that is smoothed.

use super::{Chain, Node};
use crate::fit::Fit;
use crate::fit::covariance::Bound;
use crate::fit::head_error::{HeadError, Seen, taken};
use crate::markers::Recording;
use crate::math::block_tridiagonal::BlockTridiagonal;
use nalgebra::DMatrix;

impl Fit<'_> {
    /// What is known of every frame where the head was found from bone markers: their noise in a frame takes from that frame, that
    /// of the neutral frame is the same error in all of them. `None` inside where no head was; outside where a block is not
    /// positive.
    #[allow(clippy::type_complexity)] // none or all
    pub(super) fn head_errors(
        &self,
        recording: &Recording,
        nodes: &[Node],
        (chain, hessian): (&Chain, &BlockTridiagonal),
        free: &[bool],
        sizes: &[f64],
    ) -> Option<Option<Vec<DMatrix<f64>>>> {
        let n = chain.controls;
        let bounds = |t: usize| -> Vec<Bound> {
            free[t * n..(t + 1) * n].iter().map(|free| if *free { Bound::Free } else { Bound::Lower }).collect()
        };
        let across = |node: &Node| {
            let (error, at) = (HeadError::of(recording, node.frame)?, node.at.as_ref()?);
            let seen = Seen { residuals: &at.residuals, jacobian: &at.jacobian };
            let mut across = error.across(self.objectives.loss, seen, &node.measured);
            across.row_iter_mut().zip(sizes).for_each(|(mut row, size)| row *= *size);
            Some((error, across))
        };
        let errors: Vec<_> = nodes.iter().map(across).collect();
        let Some(common) = errors.iter().flatten().map(|(error, _)| error.common).next() else {
            return Some(None);
        };
        let mut noisy = hessian.clone();
        for (t, (error, across)) in errors.iter().enumerate().filter_map(|(t, error)| Some((t, error.as_ref()?))) {
            // what the frame itself knows, so that no more than that is taken
            let at = nodes[t].at.as_ref()?;
            let known = self.objectives.loss.model(&at.residuals, &at.jacobian).1;
            let known = DMatrix::from_fn(n, n, |a, b| known[(a, b)] * sizes[a] * sizes[b]);
            let (block, offset) = chain.place(t);
            let mut own = noisy.diagonal[block].view_mut((offset, offset), (n, n));
            own -= taken(&known, across, &error.own, &bounds(t));
        }
        // how all frames answer to one error of the neutral frame
        let mut answers = vec![DMatrix::zeros(n, 6); nodes.len()];
        for h in 0..6 {
            let right = |error: &Option<(HeadError, DMatrix<f64>)>| match error {
                Some((_, across)) => across.column(h).iter().copied().collect(),
                None => vec![0.0; n],
            };
            let answer = hessian.solve(free, &errors.iter().flat_map(right).collect::<Vec<f64>>())?;
            for (t, own) in answers.iter_mut().enumerate() {
                own.column_mut(h).copy_from_slice(&answer[t * n..(t + 1) * n]);
            }
        }
        let marginals = noisy.marginals(free)?;
        let all = answers.iter().enumerate().map(|(t, answer)| {
            let known = chain.marginal(t, &marginals, free)?;
            // as if it had come through the information of the frame: A^-1 G = answer
            let across = &known * answer;
            Some(&known - taken(&known, &across, &common, &bounds(t)))
        });
        all.collect::<Option<Vec<_>>>().map(Some)
    }
}
