//! What is not known of a head that was found from bone markers, and what that takes from the controls.
//!
//! The head was taken out of the recording with a motion that is off by a small turn and shift h. h has the covariance
//!   C = C_t + C_0,   C = s^2 (H_b^T H_b)^-1
//! of the bone markers in the frame, and C_0 of the mean of the neutral frames (the mean of theirs over their number), the same for all
//! frames; s is the standard
//! deviation of one of their coordinates, H_b = d(position)/dh. Controls that are fitted with the information A have, with H of
//! the skin markers and G = J^T W H, the covariance
//!   A^-1 + A^-1 G C G^T A^-1 = (A - G K G^T)^-1,   K = (C^-1 + G^T A^-1 G)^-1

use super::covariance::{Bound, SymmetricInverse};
use super::estimate::Optimum;
use super::frame::Measured;
use super::head::middle;
use super::objective::loss::Loss;
use super::placement::Marker;
use super::recording::chosen_frames;
use crate::error::Warning;
use crate::markers::{BoneNoise, Recording};
use crate::math::tensor::subtract;
use crate::scene::{FitSpec, HeadSpec};
use nalgebra::{DMatrix, Matrix6};

/// A smaller variance of bone markers is rounding, mm2.
const ROUNDING: f64 = 1e-12;
/// A marker that the head leaves open by more than so many standard deviations of a bone marker is told of.
const OPEN: f64 = 3.0;

/// The error of the head in a frame, about the centre of the bone markers: turn, rad, and shift, mm.
pub(super) struct HeadError {
    /// C_t.
    pub own: Matrix6<f64>,
    /// C_0.
    pub common: Matrix6<f64>,
    centre: [f64; 3],
}

impl HeadError {
    /// Of a frame; `None` where the head was not found from bone markers, or without noise.
    pub fn of(recording: &Recording, frame: usize) -> Option<HeadError> {
        let BoneNoise { variance_mm2, neutral_mm, neutral, shown } = recording.bones.as_ref()?;
        if *variance_mm2 < ROUNDING {
            return None;
        }
        let centre = middle(neutral_mm);
        let covariance = |frame: usize| {
            let mut information = Matrix6::zeros();
            for h in shown.get(frame)?.iter().filter_map(|bone| Some(by_head(neutral_mm[*bone]?, centre))) {
                information += h.transpose() * h;
            }
            Some(information.cholesky()?.inverse() * *variance_mm2)
        };
        let all: Matrix6<f64> = neutral.iter().map(|frame| covariance(*frame)).sum::<Option<_>>()?;
        let common = all / (neutral.len() * neutral.len()) as f64;
        Some(HeadError { own: covariance(frame)?, common, centre })
    }

    /// The standard deviation that the head of this frame gives a place, along the direction where it is greatest, mm.
    pub fn at(&self, place: [f64; 3]) -> f64 {
        let h = by_head(place, self.centre);
        (h * self.own * h.transpose()).symmetric_eigenvalues().max().sqrt()
    }

    /// G of a frame: a row for every control that is sought.
    pub fn across(&self, loss: Loss, optimum: Seen<'_>, measured: &[Measured]) -> DMatrix<f64> {
        let Seen { residuals, jacobian } = optimum;
        let n = jacobian.ncols();
        let mut both = DMatrix::zeros(jacobian.nrows(), n + 6);
        both.columns_mut(0, n).copy_from(jacobian);
        for (k, m) in measured.iter().enumerate() {
            let h = by_head(m.position, self.centre) * m.weight;
            both.view_mut((3 * k, n), (3, 6)).copy_from(&h);
        }
        loss.model(residuals, &both).1.view((0, n), (n, 6)).into_owned()
    }
}

/// K018, with where the markers are `at_rest`: chosen frames whose bone markers leave a marker open, being few, in a heap or far from it.
pub(super) fn open(
    fit: &FitSpec,
    recording: &Recording,
    at_rest: &[Option<[f64; 3]>],
    markers: &[Marker],
) -> Option<Warning> {
    let (HeadSpec::BoneMarkers(labels), Some(bones)) = (&fit.registration.head, &recording.bones) else {
        return None;
    };
    let place = |m: &Marker| Some((m.name.clone(), at_rest[m.column]?));
    let places: Vec<(String, [f64; 3])> = markers.iter().filter_map(place).collect();
    let noise = bones.variance_mm2.sqrt();
    // the marker that is worst in a frame, where it is bad
    let worst = |frame: usize| {
        let error = HeadError::of(recording, frame)?;
        let sds = places.iter().map(|(name, place)| (error.at(*place), name));
        let (sd, name) = sds.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (sd > OPEN * noise).then_some((sd, name, frame))
    };
    let chosen = chosen_frames(fit, recording).ok()?;
    let frames: Vec<_> = chosen.iter().filter_map(|frame| worst(*frame)).collect();
    let (sd, name, frame) = *frames.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let counted: Vec<String> = bones.shown[frame].iter().map(|bone| format!("`{}`", labels[*bone])).collect();
    Some(Warning {
        code: "K018",
        message: format!(
            "the bone markers say poorly where the head is in {} of {} frames: in frame {frame} those that count, {}, leave `{name}` \
             open by {sd:.2} mm (standard deviation; a bone marker has {noise:.2} mm)",
            frames.len(),
            chosen.len(),
            counted.join(", "),
        ),
        place: Some(fit.registration.head_place.clone()),
        help: Some(
            "name more bone markers, all around the head; until then the intervals of these frames allow for it"
                .into(),
        ),
    })
}

/// Residuals of a frame with their derivative.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub residuals: &'a [f64],
    pub jacobian: &'a DMatrix<f64>,
}

impl<'a> From<&'a Optimum> for Seen<'a> {
    fn from(optimum: &'a Optimum) -> Seen<'a> {
        Seen { residuals: &optimum.residuals, jacobian: &optimum.jacobian }
    }
}

/// d(position)/dh at a place: by a turn about `centre`, then by a shift.
fn by_head(place: [f64; 3], centre: [f64; 3]) -> nalgebra::Matrix3x6<f64> {
    let [x, y, z] = subtract(place, centre);
    nalgebra::Matrix3x6::from_row_slice(&[
        0.0, z, -y, 1.0, 0.0, 0.0, //
        -z, 0.0, x, 0.0, 1.0, 0.0, //
        y, -x, 0.0, 0.0, 0.0, 1.0,
    ])
}

/// G K G^T: what an error of the head with the covariance `error`, in units of that of a weighted residual, takes from the
/// information `whole` on controls of which some are free.
pub(super) fn taken(
    whole: &DMatrix<f64>,
    across: &DMatrix<f64>,
    error: &Matrix6<f64>,
    bounds: &[Bound],
) -> DMatrix<f64> {
    let free: Vec<usize> = (0..bounds.len()).filter(|k| bounds[*k] == Bound::Free).collect();
    let inverse = SymmetricInverse::new(&whole.select_rows(&free).select_columns(&free)).matrix();
    let own = across.select_rows(&free);
    let Some(error) = error.cholesky().map(|factor| factor.inverse()) else {
        return DMatrix::zeros(bounds.len(), bounds.len());
    };
    let known = own.transpose() * inverse * own + DMatrix::from_fn(6, 6, |a, b| error[(a, b)]);
    let k = SymmetricInverse::new(&known).matrix();
    across * k * across.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_leaves_the_covariance_of_both_errors() {
        let entry = |a: usize, b: usize| ((3 * a + 5 * b + a * b) as f64).sin();
        let whole = DMatrix::from_fn(3, 3, |a, b| if a == b { 30.0 } else { 4.0 * entry(a.min(b), a.max(b)) });
        let across = DMatrix::from_fn(3, 6, |a, b| 20.0 * entry(a, b + 2));
        let root = Matrix6::from_fn(|a, b| if a == b { 0.2 } else { 0.02 * entry(a, b) });
        let error = root * root.transpose();
        let left = &whole - taken(&whole, &across, &error, &[Bound::Free; 3]);
        let inverse = whole.try_inverse().expect("regular");
        let dynamic = DMatrix::from_fn(6, 6, |a, b| error[(a, b)]);
        let expected = &inverse + &inverse * &across * dynamic * across.transpose() * &inverse;
        assert!((left.try_inverse().expect("regular") - &expected).amax() < 1e-10 * expected.amax());
    }
}
