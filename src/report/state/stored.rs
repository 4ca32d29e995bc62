//! What of a fit is kept, field by field.

use super::codec::{Bytes, Stored, stored};
use super::{SavedFrame, SavedOutcome};
use crate::fit::Estimate;
use crate::fit::advise::MarkerHelp;
use crate::fit::covariance::Bound;
use crate::fit::estimate::{FitIteration, Memory};
use crate::fit::frame::Directions;
use crate::fit::free_head::FreeHead;
use crate::fit::objective::Past;
use crate::forward::{Equilibrium, Snap, Step, StepKind};
use crate::math::motion::Motion;
use crate::model::{Evaluation, State, WorstPoint};
use crate::report::frame::MeshError;
use crate::report::status::FailedFrame;
use crate::solve::newton::Iteration;

stored!(State { u, p, controls, load, easing, multipliers });
stored!(WorstPoint { min, element, point, max });
stored!(Evaluation { energies, seconds, det_f, force, residual, magnitude, lifted });
stored!(Iteration { residual, required, factor, corrections });
stored!(Step { place, kind, iterations, residual, required });
stored!(Snap { place, modes, distance });
stored!(Equilibrium { state, evaluation, history, snaps, negative_modes });
stored!(FitIteration { cost, step, left, trust, rejected });
stored!(Directions { columns, fresh });
stored!(Past { time_s, a, covariance });
stored!(Memory { last, directions, before, tangent });
stored!(MarkerHelp { place, control, sd });
stored!(Motion { scale, turn, shift });
stored!(FreeHead { motion, sd, correlation, inflation });
stored!(FailedFrame { frame, code, message });
stored!(SavedFrame { estimate, error, unestimated, help });
stored!(Estimate {
    frame,
    time_s,
    equilibrium,
    sd,
    bounds,
    positions_mm,
    measured_mm,
    rms_mm,
    max_mm,
    iterations,
    jacobian,
    residuals,
    weights,
    costs,
    information,
    prior,
    response,
    gradient,
    variance,
    bridged,
    head,
});

impl Stored for StepKind {
    fn put(&self, out: &mut Vec<u8>) {
        let kinds = [StepKind::Walked, StepKind::Snapped, StepKind::Hardened, StepKind::Failed];
        out.extend(kinds.iter().position(|kind| kind == self).map(|at| at as u8));
    }

    fn take(from: &mut Bytes<'_>) -> Option<StepKind> {
        [StepKind::Walked, StepKind::Snapped, StepKind::Hardened, StepKind::Failed]
            .get(usize::from(u8::take(from)?))
            .copied()
    }
}

impl Stored for Bound {
    fn put(&self, out: &mut Vec<u8>) {
        let bounds = [Bound::Free, Bound::Lower, Bound::Upper];
        out.extend(bounds.iter().position(|bound| bound == self).map(|at| at as u8));
    }

    fn take(from: &mut Bytes<'_>) -> Option<Bound> {
        [Bound::Free, Bound::Lower, Bound::Upper].get(usize::from(u8::take(from)?)).copied()
    }
}

impl Stored for MeshError {
    fn put(&self, out: &mut Vec<u8>) {
        // of a fit: the points are markers
        let MeshError { kind: _, largest_mm, points, biases } = self;
        largest_mm.put(out);
        points.put(out);
        biases.put(out);
    }

    fn take(from: &mut Bytes<'_>) -> Option<MeshError> {
        let (largest_mm, points, biases) = (Stored::take(from)?, Stored::take(from)?, Stored::take(from)?);
        Some(MeshError { kind: "marker", largest_mm, points, biases })
    }
}

impl Stored for SavedOutcome {
    fn put(&self, out: &mut Vec<u8>) {
        match self {
            SavedOutcome::Fitted(frame) => {
                true.put(out);
                frame.put(out);
            }
            SavedOutcome::Failed(failed) => {
                false.put(out);
                failed.put(out);
            }
        }
    }

    fn take(from: &mut Bytes<'_>) -> Option<SavedOutcome> {
        Some(match bool::take(from)? {
            true => SavedOutcome::Fitted(Box::new(SavedFrame::take(from)?)),
            false => SavedOutcome::Failed(FailedFrame::take(from)?),
        })
    }
}
