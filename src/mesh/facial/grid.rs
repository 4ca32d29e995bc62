//! The grid of the face on its sheet: (s, t) -> (u, v), with columns s from 0 on the midline to 14 before the ear, and rows t
//! from 0 under the chin to 20 at the hairline.
//!
//! Everything is a sum of products of functions of s and of t alone that are once continuously differentiable, so that the
//! derivatives by s, by t and by both exist at every node. Row 6 is the line between the lips; row 14 splits between columns
//! 3 and 7, where the lids part: above it v goes up, below it down, by
//!   h (1 - q^2)^2 (1 + 3/2 q^2) fade(t),  q from -1 to 1 between the corners of the eye,
//! whose slope is 0 at both corners: the elements around them still meet with one tangent.

/// Columns of one half.
pub(super) const COLUMNS: usize = 14;
/// Rows.
pub(super) const ROWS: usize = 20;
/// The row of the line between the lips.
pub(super) const MOUTH_ROW: usize = 6;
/// The mouth ends at this column.
pub(super) const MOUTH_END: usize = 3;
/// The height of the wings of the nose in rows.
const NOSE_ROW: f64 = 10.5;
/// The row of the lids.
pub(super) const EYE_ROW: usize = 14;
/// The columns of the inner and outer corner of the eye.
pub(super) const EYE_ENDS: [usize; 2] = [3, 7];

/// u of the columns, mm: narrow around nose, mouth and eye.
const U: [f64; COLUMNS + 1] =
    [0.0, 7.0, 14.0, 21.5, 28.5, 36.0, 43.5, 50.5, 57.5, 64.5, 72.0, 80.0, 88.5, 97.0, 105.5];
/// v of the rows on the midline, mm.
const V: [f64; ROWS + 1] = [
    -93.0, -83.5, -74.0, -64.5, -55.0, -45.5, -36.2, -28.0, -20.5, -13.0, -6.0, 4.0, 14.0, 24.5, 34.0, 43.5, 52.5,
    62.0, 73.0, 86.0, 100.0,
];
/// How much farther out the columns are at the mouth, whose corner is farther out than that of the eye, mm.
const MOUTH_U: f64 = 4.0;
/// How much farther in the columns are at the nose, so that one follows the crest of its wing and the next the crease behind
/// it, mm.
const NOSE_U: f64 = 1.8;
/// How much higher the line between the lips is in its middle than the row of its corners, mm.
const MOUTH_V: f64 = 2.7;
/// How much the lower border rises to the angle of the jaw, and the upper one falls to the temple, mm.
const BORDERS: [f64; 2] = [52.0, 26.0];
/// How far the upper and the lower lid are from the line between the corners, mm.
const LIDS: [f64; 2] = [4.9, 3.9];
/// How much the outer corner of the eye is higher than the inner one, mm per column.
const EYE_SLOPE: f64 = 0.25;
/// How far the margins of the lips roll in, mm, and over how many rows.
const ROLL: (f64, f64) = (1.0, 1.2);
/// How far the edges of the margins of the lips at the back and at the skin are from the line where the margins meet, mm.
const ROUND: [f64; 2] = [2.2, 0.8];
/// How far the margins are from that line where they are nearest, mm.
const APART: f64 = 0.1;

/// A function of s and t: value, by s, by t, by both.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Jet {
    pub value: f64,
    pub s: f64,
    pub t: f64,
    pub st: f64,
}

/// A function of one coordinate: value and slope.
pub(super) type Line = [f64; 2];

impl Jet {
    fn add(&mut self, other: Jet) {
        *self =
            Jet { value: self.value + other.value, s: self.s + other.s, t: self.t + other.t, st: self.st + other.st };
    }
}

/// factor a(s) b(t).
fn product(factor: f64, a: Line, b: Line) -> Jet {
    Jet { value: factor * a[0] * b[0], s: factor * a[1] * b[0], t: factor * a[0] * b[1], st: factor * a[1] * b[1] }
}

const ONE: Line = [1.0, 0.0];

/// From which side a row is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Above,
    Below,
}

/// A monotone cubic through `values` at 0, 1, 2, ...: slopes are harmonic means of the differences on both sides.
fn curve(values: &[f64], x: f64) -> Line {
    let last = values.len() - 1;
    let step = |k: usize| values[k + 1] - values[k];
    let inner = |k: usize| 2.0 * step(k - 1) * step(k) / (step(k - 1) + step(k));
    let slope = |k: usize| match k {
        0 => 1.5 * step(0) - 0.5 * inner(1),
        k if k == last => 1.5 * step(last - 1) - 0.5 * inner(last - 1),
        k => inner(k),
    };
    let k = (x as usize).min(last - 1);
    let q = x - k as f64;
    let p = 1.0 - q;
    let (a, b, m, n) = (values[k], values[k + 1], slope(k), slope(k + 1));
    [
        (1.0 + 2.0 * q) * p * p * a + q * p * p * m + q * q * (3.0 - 2.0 * q) * b - q * q * p * n,
        6.0 * q * p * (b - a) + p * (1.0 - 3.0 * q) * m + q * (3.0 * q - 2.0) * n,
    ]
}

/// 1 up to `from`, 0 beyond `to`, a cubic without slope at both ends between.
fn fade(x: f64, from: f64, to: f64) -> Line {
    let q = ((x - from) / (to - from)).clamp(0.0, 1.0);
    [1.0 - q * q * (3.0 - 2.0 * q), -6.0 * q * (1.0 - q) / (to - from)]
}

/// [`fade`] of the distance of x from `centre`.
fn around(x: f64, centre: f64, to: f64) -> Line {
    let [value, slope] = fade((x - centre).abs(), 0.0, to);
    [value, slope * if x < centre { -1.0 } else { 1.0 }]
}

/// (1 - q^2)^2 (1 + c q^2) with q = (x - centre) / half, 0 outside.
fn bump(x: f64, centre: f64, half: f64, c: f64) -> Line {
    let q = (x - centre) / half;
    let (w, p) = (q * q, 1.0 - q * q);
    if p <= 0.0 {
        return [0.0; 2];
    }
    [p * p * (1.0 + c * w), 2.0 * q * p * (c * p - 2.0 * (1.0 + c * w)) / half]
}

/// Where a point of the grid is on the sheet, for s >= 0.
pub(super) fn place(s: f64, t: f64, side: Side) -> [Jet; 2] {
    let (mouth, eye) = (MOUTH_ROW as f64, EYE_ROW as f64);
    let corner = MOUTH_END as f64;
    let mut u = product(1.0, curve(&U, s), ONE);
    let out = if s < corner {
        let [value, slope] = fade(s, 0.0, corner);
        [1.0 - value, -slope]
    } else {
        fade(s, corner, 10.0)
    };
    u.add(product(MOUTH_U, out, around(t, mouth, 6.0)));
    u.add(product(-NOSE_U, bump(s, 2.6, 2.6, 0.0), around(t, NOSE_ROW, 3.5)));

    let mut v = product(1.0, ONE, curve(&V, t));
    let end = COLUMNS as f64;
    let square = [s * s / (end * end), 2.0 * s / (end * end)];
    v.add(product(BORDERS[0], square, fade(t, 0.0, 13.0)));
    let [value, slope] = fade(ROWS as f64 - t, 0.0, 7.0);
    v.add(product(-BORDERS[1], square, [value, -slope]));
    v.add(product(MOUTH_V, bump(s, 0.0, corner + 0.6, 1.5), around(t, mouth, 3.0)));
    let (middle, half) = (0.5 * (EYE_ENDS[0] + EYE_ENDS[1]) as f64, 0.5 * (EYE_ENDS[1] - EYE_ENDS[0]) as f64);
    // it has to be 0 on the midline, with its slope
    let [b, db] = bump(s, middle, middle, 0.0);
    v.add(product(EYE_SLOPE, [(s - middle) * b, b + (s - middle) * db], around(t, eye, 4.0)));
    let above = if t == eye { side == Side::Above } else { t > eye };
    let lids = if above { LIDS[0] } else { -LIDS[1] };
    v.add(product(lids, bump(s, middle, half, 1.5), around(t, eye, 3.0)));
    [u, v]
}

/// How far the skin is rolled in at the margins of the lips, mm.
pub(super) fn roll(s: f64, t: f64, side: Side) -> Jet {
    let (mouth, (depth, rows)) = (MOUTH_ROW as f64, ROLL);
    let above = if t == mouth { side == Side::Above } else { t > mouth };
    let sign = if above { 1.0 } else { -1.0 };
    let d = (1.0 - sign * (t - mouth) / rows).max(0.0);
    product(depth, bump(s, 0.0, MOUTH_END as f64, 1.5), [d * d * d, -3.0 * d * d * sign / rows])
}

/// How far the margin of a lip is from the line where they meet at the depth w, 0 at the back and 1 at the skin, mm; with its slope. A
/// parabola through [`ROUND`] whose least value is [`APART`]: the margins are round and meet within their thickness.
pub(super) fn margin(w: f64) -> Line {
    let [back, skin] = ROUND.map(|edge| (edge - APART).sqrt());
    let root = back - (back + skin) * w;
    [APART + root * root, -2.0 * root * (back + skin)]
}

/// How much of [`margin`] there is, up or down.
pub(super) fn round(s: f64, t: f64, side: Side) -> Jet {
    let mouth = MOUTH_ROW as f64;
    let above = if t == mouth { side == Side::Above } else { t > mouth };
    product(if above { 1.0 } else { -1.0 }, bump(s, 0.0, MOUTH_END as f64, 1.5), around(t, mouth, 1.0))
}
