//! Similarity motions y = s R x + t, and the one that brings points nearest to others.
//!
//! Least squares over pairs (x_k, y_k), by the singular value decomposition of their covariance
//! (Umeyama 1991, IEEE Trans. Pattern Anal. Mach. Intell. 13(4), 376-380, eqs. 34 to 43):
//!
//! ```text
//! sum (y_k - y_mean)(x_k - x_mean)^T = U D V^T,   S = diag(1, 1, +-1) with det(U S V^T) = 1 (or -1: a reflection)
//! R = U S V^T,   s = tr(D S) / sum |x_k - x_mean|^2,   t = y_mean - s R x_mean
//! ```
//!
//! Where a few pairs are wrong, [`robust`] finds the motion that most agree on: the least sum of the smaller two thirds of
//! the squared distances (least trimmed squares, Rousseeuw and Van Driessen 2006), searched from triples of pairs.

use super::tensor::{IDENTITY, Matrix, Vector, add_scaled, apply, apply_transposed, norm, subtract};
use nalgebra::Matrix3;

/// A point and where it should come to.
pub type Pair = (Vector, Vector);

/// y = s R x + t
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// s, positive.
    pub scale: f64,
    /// R, orthogonal; a reflection where its determinant is -1.
    pub turn: Matrix,
    /// t, in the unit of the points.
    pub shift: Vector,
}

/// Which motions are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allowed {
    /// Whether the scale is free; 1 otherwise.
    pub scale: bool,
    /// Whether the motion reflects; it turns otherwise.
    pub mirrored: bool,
}

impl Allowed {
    /// Turns and shifts.
    pub const RIGID: Allowed = Allowed { scale: false, mirrored: false };
    /// Turns, shifts and a scale.
    pub const SIMILARITY: Allowed = Allowed { scale: true, mirrored: false };

    /// The same with a reflection.
    pub fn mirrored(self) -> Allowed {
        Allowed { mirrored: true, ..self }
    }
}

impl Motion {
    /// Everything stays where it is.
    pub const REST: Motion = Motion { scale: 1.0, turn: IDENTITY, shift: [0.0; 3] };

    /// Where a point comes to.
    pub fn place(&self, x: Vector) -> Vector {
        add_scaled(self.shift, self.scale, apply(&self.turn, x))
    }

    /// The motion back.
    pub fn inverse(&self) -> Motion {
        let turn = std::array::from_fn(|i| std::array::from_fn(|j| self.turn[j][i]));
        let scale = 1.0 / self.scale;
        Motion { scale, turn, shift: apply_transposed(&self.turn, self.shift).map(|t| -scale * t) }
    }

    /// This motion, then another.
    pub fn then(&self, next: &Motion) -> Motion {
        let turn = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| next.turn[i][k] * self.turn[k][j]).sum::<f64>())
        });
        Motion { scale: self.scale * next.scale, turn, shift: next.place(self.shift) }
    }

    /// The rigid motion nearest to several of them: its turn has the least squared distance from theirs (the chordal mean), and
    /// it takes the point `about` to the mean of where they take it. `None` of none.
    pub fn mean(motions: &[Motion], about: Vector) -> Option<Motion> {
        if let [one] = motions {
            return Some(*one);
        }
        // points around `about` whose second moment is the same in all directions
        let around = (0..6).map(|k| {
            let mut point = about;
            point[k / 2] += if k % 2 == 0 { 1.0 } else { -1.0 };
            point
        });
        let pairs: Vec<Pair> =
            motions.iter().flat_map(|motion| around.clone().map(|x| (x, motion.place(x)))).collect();
        least_squares(&pairs, Allowed::RIGID)
    }

    /// Rotation vector of the turn: its axis times its angle (radians, 0 to pi).
    pub fn rotation_vector(&self) -> Vector {
        let r = &self.turn;
        // 2 sin(angle) axis and 2 cos(angle): the arc tangent is exact near 0, where the arc cosine is not
        let twice = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
        let (sine, cosine) = (norm(twice), r[0][0] + r[1][1] + r[2][2] - 1.0);
        let angle = sine.atan2(cosine);
        if sine > 1e-6 {
            return twice.map(|c| c * angle / sine);
        }
        if cosine > 0.0 {
            return twice.map(|c| 0.5 * c);
        }
        // half a turn: R + I = 2 axis axis^T, of which the longest column is taken
        let column = |j: usize| -> Vector { std::array::from_fn(|i| r[i][j] + IDENTITY[i][j]) };
        let axis = (0..3).map(column).max_by(|a, b| norm(*a).total_cmp(&norm(*b))).unwrap_or([1.0, 0.0, 0.0]);
        axis.map(|c| c * angle / norm(axis))
    }

    /// Angle of the turn, radians, 0 to pi.
    pub fn angle(&self) -> f64 {
        norm(self.rotation_vector())
    }

    /// |s R x + t - y| of each pair.
    pub fn distances(&self, pairs: &[Pair]) -> Vec<f64> {
        pairs.iter().map(|(x, y)| norm(subtract(self.place(*x), *y))).collect()
    }

    /// Root mean square of the distances.
    pub fn rms(&self, pairs: &[Pair]) -> f64 {
        rms(&self.distances(pairs))
    }
}

/// Root mean square; 0 of nothing.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// The mean of some points.
pub fn centre(points: impl ExactSizeIterator<Item = Vector>) -> Vector {
    let count = points.len() as f64;
    points.fold([0.0; 3], |sum, p| add_scaled(sum, 1.0 / count, p))
}

/// Root mean square distance of points from their mean.
pub fn spread(points: &[Vector]) -> f64 {
    let middle = centre(points.iter().copied());
    rms(&points.iter().map(|p| norm(subtract(*p, middle))).collect::<Vec<_>>())
}

/// The motion with the least sum of squared distances. `None` below three pairs, and where either side lies on a line, so
/// that a turn about it is not determined.
pub fn least_squares(pairs: &[Pair], allowed: Allowed) -> Option<Motion> {
    weighted(pairs, |_| 1.0, allowed)
}

/// As [`least_squares`], of squared distances times the `weight` of each pair.
pub fn weighted(pairs: &[Pair], weight: impl Fn(usize) -> f64, allowed: Allowed) -> Option<Motion> {
    if pairs.len() < 3 {
        return None;
    }
    let total: f64 = (0..pairs.len()).map(&weight).sum();
    let mean = |of: fn(&Pair) -> Vector| {
        pairs.iter().enumerate().fold([0.0; 3], |sum, (k, pair)| add_scaled(sum, weight(k) / total, of(pair)))
    };
    let (from, to) = (mean(|p| p.0), mean(|p| p.1));
    let mut covariance = Matrix3::zeros();
    let mut square = 0.0;
    for (k, (x, y)) in pairs.iter().enumerate() {
        let (x, y) = (subtract(*x, from), subtract(*y, to));
        let w = weight(k);
        covariance += Matrix3::from_fn(|i, j| w * y[i] * x[j]);
        square += w * x.iter().map(|x| x * x).sum::<f64>();
    }
    let svd = covariance.svd(true, true);
    let (u, v, d) = (svd.u?, svd.v_t?, svd.singular_values);
    if d[1] <= 1e-9 * d[0] || d[1].is_nan() {
        return None;
    }
    let proper = u.determinant() * v.determinant() > 0.0;
    let last = if proper != allowed.mirrored { 1.0 } else { -1.0 };
    let r = u * Matrix3::from_diagonal(&[1.0, 1.0, last].into()) * v;
    let turn: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]));
    let scale = if allowed.scale { (d[0] + d[1] + last * d[2]) / square } else { 1.0 };
    let shift = add_scaled(to, -scale, apply(&turn, from));
    (scale > 0.0 && scale.is_finite()).then_some(Motion { scale, turn, shift })
}

/// A motion that most pairs agree on.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreed {
    /// The least-squares motion of the pairs that agree.
    pub motion: Motion,
    /// Distance of each pair under it.
    pub distances: Vec<f64>,
    /// Whether each pair is off: farther than four standard deviations of those that agree, and than `least`.
    pub off: Vec<bool>,
    /// Root mean square distance of the pairs that are not off.
    pub rms: f64,
}

/// Most triples from which the search starts.
const TRIPLES: usize = 600;
/// A distance of so many standard deviations of a coordinate is off.
const OFF: f64 = 4.0;
/// sqrt of the median of chi-square with three degrees of freedom: median distance over the standard deviation of a coordinate.
const MEDIAN_DISTANCE: f64 = 1.538;

/// The motion that at least two thirds of the pairs agree on; no pair nearer than `least` counts as off. `None` as for
/// [`least_squares`].
pub fn robust(pairs: &[Pair], allowed: Allowed, least: f64) -> Option<Agreed> {
    let n = pairs.len();
    let all = least_squares(pairs, allowed)?;
    // what must agree: all of three, three of four, four of five, ...
    let most = (n - n / 3).max(3);
    let trimmed = |motion: &Motion| -> (f64, Vec<usize>) {
        let distances = motion.distances(pairs);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| distances[*a].total_cmp(&distances[*b]));
        order.truncate(most);
        (order.iter().map(|k| distances[*k] * distances[*k]).sum(), order)
    };
    // a step of concentration: the motion of those that agree best now
    let concentrated = |start: Motion, steps: usize| -> (f64, Motion) {
        let (mut motion, (mut cost, mut best)) = (start, trimmed(&start));
        for _ in 0..steps {
            let chosen: Vec<Pair> = best.iter().map(|k| pairs[*k]).collect();
            let Some(next) = least_squares(&chosen, allowed) else { break };
            let (lower, order) = trimmed(&next);
            if lower >= cost {
                break;
            }
            (motion, cost, best) = (next, lower, order);
        }
        (cost, motion)
    };
    let mut found = concentrated(all, 20);
    if most < n {
        for triple in triples(n) {
            let Some(start) = least_squares(&triple.map(|k| pairs[k]), allowed) else { continue };
            let next = concentrated(start, 2);
            if next.0 < found.0 {
                found = next;
            }
        }
        found = concentrated(found.1, 20);
    }
    let mut motion = found.1;
    let mut off = vec![false; n];
    // the trimmed motion names those that are off; the rest decides, all of it
    for _ in 0..5 {
        let distances = motion.distances(pairs);
        let mut sorted = distances.clone();
        sorted.sort_by(f64::total_cmp);
        // with few pairs the motion bends to them: Rousseeuw and Leroy 1987, p. 202
        let sd = sorted[(n - 1) / 2] / MEDIAN_DISTANCE * (1.0 + 5.0 / n.saturating_sub(2).max(1) as f64);
        let limit = (OFF * sd).max(least);
        let next: Vec<bool> = distances.iter().map(|d| *d > limit).collect();
        let rest: Vec<Pair> = pairs.iter().zip(&next).filter(|(_, off)| !**off).map(|(p, _)| *p).collect();
        let Some(better) = least_squares(&rest, allowed) else { break };
        motion = better;
        if next == off {
            break;
        }
        off = next;
    }
    let distances = motion.distances(pairs);
    let rest: Vec<f64> = distances.iter().zip(&off).filter(|(_, off)| !**off).map(|(d, _)| *d).collect();
    Some(Agreed { motion, rms: rms(&rest), distances, off })
}

/// Triples of different indices below n: all, or evenly many of them.
fn triples(n: usize) -> impl Iterator<Item = [usize; 3]> {
    let all = n * (n - 1) * (n - 2) / 6;
    let stride = all.div_ceil(TRIPLES);
    let every = (0..n).flat_map(move |i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])));
    every.enumerate().filter(move |(place, _)| place % stride == 0).map(|(_, triple)| triple)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::tensor::{cross, determinant, normalised, rotation};

    /// Turns about one axis have the mean of their angles, and the place that is asked for goes to the mean of where they take it.
    #[test]
    fn the_mean_of_turns_about_an_axis_is_in_the_middle() {
        let (axis, about) = (normalised([1.0, -2.0, 0.5]), [70.0, -20.0, 30.0]);
        let at = |angle: f64| Motion { scale: 1.0, turn: rotation(axis, angle), shift: [3.0 * angle, 1.0, -angle] };
        let all = [0.1, 0.4, 0.7].map(at);
        let mean = Motion::mean(&all, about).unwrap();
        assert!((mean.rotation_vector()[0] - 0.4 * axis[0]).abs() < 1e-12, "{mean:?}");
        let place = centre(all.iter().map(|motion| motion.place(about)));
        assert!(norm(subtract(mean.place(about), place)) < 1e-12, "{mean:?}");
        assert_eq!((Motion::mean(&all[..1], about), Motion::mean(&[], about)), (Some(all[0]), None));
    }

    fn points(n: usize) -> Vec<Vector> {
        (0..n).map(|k| [0, 1, 2].map(|i| 40.0 * ((3 * k + 7 * i + k * k * i) as f64 * 0.7).sin())).collect()
    }

    fn moved() -> Motion {
        Motion { scale: 1.3, turn: rotation(normalised([1.0, -2.0, 0.5]), 2.1), shift: [5.0, -80.0, 12.0] }
    }

    #[test]
    fn a_motion_is_found_again_and_undone() {
        for n in [3, 4, 20] {
            let motion = moved();
            let pairs: Vec<Pair> = points(n).into_iter().map(|x| (x, motion.place(x))).collect();
            let found = least_squares(&pairs, Allowed::SIMILARITY).expect("determined");
            assert!((found.scale - 1.3).abs() < 1e-12 && found.rms(&pairs) < 1e-11, "{found:?}");
            let back = found.then(&found.inverse());
            assert!((back.scale - 1.0).abs() < 1e-14 && back.angle() < 1e-14 && norm(back.shift) < 1e-12);
            assert!((found.angle() - 2.1).abs() < 1e-12);
        }
        let mirror = Motion { turn: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], ..Motion::REST };
        let pairs: Vec<Pair> = points(9).into_iter().map(|x| (x, mirror.then(&moved()).place(x))).collect();
        let found = least_squares(&pairs, Allowed::SIMILARITY.mirrored()).expect("determined");
        assert!(found.rms(&pairs) < 1e-11 && determinant(&found.turn) < 0.0);
        assert!(least_squares(&pairs, Allowed::SIMILARITY).expect("determined").rms(&pairs) > 10.0);
    }

    #[test]
    fn rotation_vectors_come_back_at_every_angle() {
        let axis = normalised([0.3, -0.5, 0.8]);
        for angle in [0.0, 1e-12, 1e-7, 0.3, 3.0, std::f64::consts::PI - 1e-9, std::f64::consts::PI] {
            let motion = Motion { turn: rotation(axis, angle), ..Motion::REST };
            let again = motion.rotation_vector();
            let length = norm(again);
            assert!((length - angle).abs() < 1e-8, "{length} instead of {angle}");
            if angle > 0.0 {
                assert!(norm(cross(again, axis)) < 1e-6 * length.max(1e-6), "{angle}: {again:?}");
            }
        }
    }

    #[test]
    fn a_line_and_two_points_do_not_say_how_to_turn() {
        let line: Vec<Pair> = (0..5).map(|k| ([k as f64, 0.0, 0.0], [0.0, k as f64, 1.0])).collect();
        assert_eq!(least_squares(&line, Allowed::RIGID), None);
        assert_eq!(robust(&line, Allowed::RIGID, 0.1), None);
        assert_eq!(least_squares(&line[..2], Allowed::RIGID), None);
    }

    /// One of four, two of seven and seven of twenty-one pairs are moved by 20 mm and more: they are named, and the rest
    /// decides to rounding.
    #[test]
    fn those_that_are_off_are_named_and_do_not_count() {
        let motion = Motion { scale: 1.0, ..moved() };
        for (n, wrong) in [(4, 1), (5, 1), (7, 2), (21, 7)] {
            let mut pairs: Vec<Pair> = points(n).into_iter().map(|x| (x, motion.place(x))).collect();
            for (k, (_, y)) in pairs.iter_mut().enumerate().take(wrong) {
                *y = add_scaled(*y, 20.0 + k as f64, normalised([1.0, k as f64, -1.0]));
            }
            let found = robust(&pairs, Allowed::RIGID, 0.5).expect("determined");
            assert_eq!(found.off, (0..n).map(|k| k < wrong).collect::<Vec<_>>(), "{n}");
            assert!(found.rms < 1e-10, "{n}: {}", found.rms);
        }
    }

    /// With nothing but noise all pairs count: the robust motion is the one of least squares.
    #[test]
    fn noise_alone_changes_nothing() {
        let mut pairs: Vec<Pair> = points(30).into_iter().map(|x| (x, moved().place(x))).collect();
        for (k, (_, y)) in pairs.iter_mut().enumerate() {
            *y = add_scaled(*y, 0.3, [0, 1, 2].map(|i| ((11 * k + 5 * i) as f64).sin()));
        }
        let found = robust(&pairs, Allowed::SIMILARITY, 0.0).expect("determined");
        assert!(found.off.iter().all(|off| !off));
        assert_eq!(found.motion, least_squares(&pairs, Allowed::SIMILARITY).expect("determined"));
    }
}
