//! What a state shows of why a path is in trouble: faces off their surface, fibres on the descending limb.

use super::Model;
use super::State;
use crate::error::Likely;
use crate::math::tensor::norm;
use crate::mesh::MaterialPoint;
use crate::term::contact::law::Allows;

/// Normalised stretch beyond which an active fibre counts as on the descending limb; f_act ends at 1.6.
const DESCENDING: f64 = 1.4;

/// A point of a face that has left the surface it must stay on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffSurface {
    /// The sliding, as an index in [`Model::terms`].
    pub term: usize,
    /// Where on the host.
    pub at: MaterialPoint,
    /// Current position, mm.
    pub position: [f64; 3],
}

/// Fibres of one muscle that are active and have been stretched to where they lose force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Descending {
    /// The muscle, as an index in [`Model::terms`].
    pub term: usize,
    /// Its quadrature points beyond a normalised stretch of 1.4 that are so active that dT/dlambda < 0 just beyond it: what
    /// the passive force gains there is less than what the active one loses.
    pub points: usize,
    /// All its points.
    pub of: usize,
    /// Current position of the longest of these fibres, mm.
    pub position: [f64; 3],
    /// Its stretch lambda = |F n0|.
    pub stretch: f64,
}

impl Descending {
    /// As messages tell it.
    pub fn told(&self, model: &Model) -> Likely {
        let muscle = model.terms()[self.term].name().to_owned();
        let Descending { points, of, position, stretch, .. } = *self;
        Likely::DescendingLimb { muscle, points, of, position, stretch }
    }
}

impl Model {
    /// The first point of a sliding that has left its surface, with edge and all.
    pub fn off_surface(&self, state: &State) -> Option<OffSurface> {
        self.contacts().filter(|(_, allows)| *allows == Allows::Closed).find_map(|(term, _)| {
            let lost =
                self.contact_points(state, term).into_iter().find(|point| point.gap.is_none_or(f64::is_nan))?;
            Some(OffSurface { term, at: lost.at, position: lost.position })
        })
    }

    /// The muscles that have active fibres on the descending limb of their force-stretch curve.
    pub fn descending_fibres(&self, state: &State) -> Vec<Descending> {
        let x = self.current(state);
        let of_muscle = |(term, muscle): (usize, &crate::term::muscle::Muscle)| {
            let law = muscle.law();
            let mut found: Option<Descending> = None;
            for in_element in muscle.points().chunk_by(|a, b| a.host.element == b.host.element) {
                let local = self.mesh().local_of(in_element[0].host.element, &x);
                for point in in_element {
                    let (stretch, activation) =
                        (norm(point.deformed_fibre(&local)), point.activation(&state.controls));
                    let limb = DESCENDING * law.lambda_ofl;
                    let falls = stretch > limb && law.tension(limb, activation).slope < 0.0;
                    if !falls {
                        continue;
                    }
                    let of = muscle.points().len();
                    let so_far =
                        found.get_or_insert(Descending { term, points: 0, of, position: [0.0; 3], stretch: 0.0 });
                    so_far.points += 1;
                    if stretch > so_far.stretch {
                        so_far.stretch = stretch;
                        so_far.position = self.mesh().interpolate(point.host, &x);
                    }
                }
            }
            found
        };
        self.muscles().filter_map(of_muscle).collect()
    }
}
