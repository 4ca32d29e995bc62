//! Tails of the normal distribution, also where they are too small to be computed as one minus the rest.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Half the width of a two-sided 95 % interval, in standard deviations.
pub const TWO_SIDED_95: f64 = 1.959963984540054;

/// ln Q(z), Q(z) the probability that a standard normal variable is greater than z.
///
/// With x = z / sqrt 2, Q = erfc(x) / 2: for small x by the series erf x = 2 / sqrt pi exp(-x^2) sum 2^n x^(2n+1) / (2n+1)!!,
/// beyond by the continued fraction of Laplace (Abramowitz and Stegun 1964, 7.1.6 and 7.1.14).
pub fn ln_upper_tail(z: f64) -> f64 {
    if z < 0.0 {
        return (-ln_upper_tail(-z).exp()).ln_1p();
    }
    let x = z * FRAC_1_SQRT_2;
    if x < 2.0 {
        let (mut term, mut sum) = (x, x);
        for n in 1..80 {
            term *= 2.0 * x * x / (2 * n + 1) as f64;
            sum += term;
        }
        let erf = 2.0 / PI.sqrt() * (-x * x).exp() * sum;
        return (0.5 * (1.0 - erf)).ln();
    }
    let mut fraction = x;
    for n in (1..=60).rev() {
        fraction = x + 0.5 * n as f64 / fraction;
    }
    -x * x - (2.0 * PI.sqrt() * fraction).ln()
}

/// The u below which 95 % of the density exp(- slope u - u^2 / 2), u >= 0, lies; `slope` not negative.
pub fn one_sided_95(slope: f64) -> f64 {
    let whole = ln_upper_tail(slope);
    let (mut low, mut high) = (0.0, TWO_SIDED_95);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if ln_upper_tail(slope + middle) - whole > 0.05_f64.ln() { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tails to 12 digits: Abramowitz and Stegun 1964, tables 26.1 and 26.2 (Q(5), and -log10 Q(50)).
    #[test]
    fn tails_are_those_of_the_tables() {
        assert!((ln_upper_tail(0.0) - 0.5_f64.ln()).abs() < 1e-15);
        assert!((ln_upper_tail(TWO_SIDED_95).exp() - 0.025).abs() < 1e-14);
        assert!((ln_upper_tail(-TWO_SIDED_95).exp() - 0.975).abs() < 1e-14);
        assert!((ln_upper_tail(5.0).exp() / 2.86651_57188e-7 - 1.0).abs() < 1e-9);
        assert!((ln_upper_tail(50.0) / 10.0_f64.ln() + 544.96634).abs() < 1e-5);
        // both branches meet
        let join = 2.0 / FRAC_1_SQRT_2;
        assert!((ln_upper_tail(join - 1e-9) - ln_upper_tail(join + 1e-9)).abs() < 1e-7);
    }

    #[test]
    fn one_side_is_half_a_normal_or_an_exponential() {
        assert!((one_sided_95(0.0) - TWO_SIDED_95).abs() < 1e-12);
        // exp(- s u) for a steep slope
        assert!((one_sided_95(1e4) * 1e4 / 20.0_f64.ln() - 1.0).abs() < 1e-6);
    }
}
