//! Gauss-Legendre rules on [0, 1] and their tensor products on the unit cube and square.

/// A Gauss-Legendre rule on [0, 1]: n points integrate polynomials of degree 2 n - 1 exactly.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussRule {
    /// Abscissae in (0, 1), ascending.
    pub points: Vec<f64>,
    /// Weights; they sum to one.
    pub weights: Vec<f64>,
}

impl GaussRule {
    /// The rule with `n` >= 1 points, each found by Newton's method on the Legendre polynomial P_n.
    pub fn new(n: usize) -> GaussRule {
        let (mut points, mut weights) = (vec![0.0; n], vec![0.0; n]);
        for k in 0..n {
            let mut x = -(std::f64::consts::PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (value, derivative) = legendre(n, x);
                slope = derivative;
                let step = value / derivative;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            points[k] = 0.5 * (1.0 + x);
            // on [-1, 1] the weight is 2 / ((1 - x^2) P_n'(x)^2); half of that on [0, 1]
            weights[k] = 1.0 / ((1.0 - x * x) * slope * slope);
        }
        GaussRule { points, weights }
    }

    /// The number of points in one direction.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// A rule always has a point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// This rule in every part of [0, 1] between `cuts`, which lie in (0, 1) and ascend.
    pub fn composite(&self, cuts: &[f64]) -> GaussRule {
        let (mut points, mut weights) = (Vec::new(), Vec::new());
        let mut low = 0.0;
        for high in cuts.iter().copied().chain([1.0]) {
            let length = high - low;
            points.extend(self.points.iter().map(|x| low + length * x));
            weights.extend(self.weights.iter().map(|w| length * w));
            low = high;
        }
        GaussRule { points, weights }
    }

    /// Points and weights on the unit cube, first direction fastest.
    pub fn cube(&self) -> impl Iterator<Item = ([f64; 3], f64)> + '_ {
        GaussRule::product([self; 3])
    }

    /// Points and weights on the unit cube with a rule for each direction, first direction fastest.
    pub fn product(rules: [&GaussRule; 3]) -> impl Iterator<Item = ([f64; 3], f64)> + '_ {
        let [a, b, c] = rules;
        let (n, m) = (a.len(), b.len());
        (0..n * m * c.len()).map(move |q| {
            let (i, j, k) = (q % n, q / n % m, q / (n * m));
            ([a.points[i], b.points[j], c.points[k]], a.weights[i] * b.weights[j] * c.weights[k])
        })
    }

    /// Points and weights on the unit square, first direction fastest.
    pub fn square(&self) -> impl Iterator<Item = ([f64; 2], f64)> + '_ {
        let n = self.len();
        (0..n * n).map(move |q| {
            let (i, j) = (q % n, q / n);
            ([self.points[i], self.points[j]], self.weights[i] * self.weights[j])
        })
    }
}

/// P_n(x) and P_n'(x) by the three-term recurrence (k+1) P_(k+1) = (2k+1) x P_k - k P_(k-1).
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    for k in 1..n {
        let k = k as f64;
        (previous, current) = (current, ((2.0 * k + 1.0) * x * current - k * previous) / (k + 1.0));
    }
    let n = n as f64;
    (current, n * (x * current - previous) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_polynomials_up_to_degree_2n_minus_1() {
        for n in 1..=12 {
            let rule = GaussRule::new(n);
            for degree in 0..2 * n {
                let sum: f64 = rule.points.iter().zip(&rule.weights).map(|(x, w)| w * x.powi(degree as i32)).sum();
                assert!((sum - 1.0 / (degree as f64 + 1.0)).abs() < 1e-15, "n {n} degree {degree}: {sum}");
            }
            let degree = 2 * n as i32;
            let sum: f64 = rule.points.iter().zip(&rule.weights).map(|(x, w)| w * x.powi(degree)).sum();
            assert!((sum - 1.0 / (degree as f64 + 1.0)).abs() > 1e-14 || n > 10, "n {n} is exact beyond 2n-1");
        }
    }
}
