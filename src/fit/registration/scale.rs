//! The scale between a recording and its model, with its interval.

use crate::math::motion::{Allowed, Motion, Pair, centre, least_squares};
use crate::math::tensor::{dot, norm, subtract};

/// How much larger the recording has to be made to be of the model's size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The estimate.
    pub value: f64,
    /// Its 95 % interval, from what the markers miss each other by; infinite at its end where they are too few.
    pub interval: [f64; 2],
}

/// The scale of pairs of (recording, model). `None` where they do not determine it.
///
/// The model's markers x are exact and the recording's z are not: z = f R x + t + noise, whose least squares have
///   f = sum z . R x / sum |x|^2,   variance of f = sd^2 / sum |x|^2,   sd^2 = sum |z - f R x - t|^2 / (3 n - 7)
/// about the centres; the scale is 1 / f.
pub fn scale(pairs: &[Pair]) -> Option<Scale> {
    let back: Vec<Pair> = pairs.iter().map(|(z, x)| (*x, *z)).collect();
    let motion: Motion = least_squares(&back, Allowed::SIMILARITY)?;
    let middle = centre(back.iter().map(|p| p.0));
    let square: f64 = back.iter().map(|(x, _)| subtract(*x, middle)).map(|x| dot(x, x)).sum();
    let missed: f64 = back.iter().map(|(x, z)| norm(subtract(motion.place(*x), *z)).powi(2)).sum();
    let freedom = (3 * pairs.len()).saturating_sub(7);
    let f = motion.scale;
    let half = student(freedom) * (missed / freedom.max(1) as f64 / square).sqrt();
    let upper = if f > half { 1.0 / (f - half) } else { f64::INFINITY };
    Some(Scale { value: 1.0 / f, interval: [1.0 / (f + half), upper] })
}

/// The 97.5 % quantile of Student's distribution (Abramowitz and Stegun 1964, 26.7.5).
fn student(freedom: usize) -> f64 {
    const Z: f64 = 1.959963984540054;
    let n = freedom.max(1) as f64;
    let g = [
        (Z.powi(3) + Z) / 4.0,
        (5.0 * Z.powi(5) + 16.0 * Z.powi(3) + 3.0 * Z) / 96.0,
        (3.0 * Z.powi(7) + 19.0 * Z.powi(5) + 17.0 * Z.powi(3) - 15.0 * Z) / 384.0,
        (79.0 * Z.powi(9) + 776.0 * Z.powi(7) + 1482.0 * Z.powi(5) - 1920.0 * Z.powi(3) - 945.0 * Z) / 92160.0,
    ];
    g.iter().rev().fold(0.0, |sum, g| (sum + g) / n) + Z
}

#[cfg(test)]
mod tests {
    use super::student;

    /// Against a table of the distribution (any textbook, for example Abramowitz and Stegun 1964, table 26.10).
    #[test]
    fn quantiles_agree_with_the_table() {
        for (freedom, table) in [(2, 4.303), (5, 2.571), (10, 2.228), (30, 2.042), (1000, 1.962)] {
            assert!((student(freedom) / table - 1.0).abs() < 0.02, "{freedom}: {}", student(freedom));
        }
    }
}
