//! Orders of convergence, and what a sequence of refinements converges to.
//!
//!   e = C h^p:  p = ln(e1 / e2) / ln(h1 / h2);     value f(h) = f* + C h^p (Richardson 1911)
//!   uncertainty of the finest value: 1.25 |f1 - f2| / ((h2 / h1)^p - 1)  (Roache's grid convergence index)

/// The observed order between two errors at two sizes; `None` where they tell nothing.
pub fn observed((coarse_h, coarse): (f64, f64), (fine_h, fine): (f64, f64)) -> Option<f64> {
    let order = (coarse / fine).ln() / (coarse_h / fine_h).ln();
    (coarse_h > fine_h && order.is_finite()).then_some(order)
}

/// What three values at three sizes converge to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extrapolation {
    /// Observed order.
    pub order: f64,
    /// The value at h = 0.
    pub value: f64,
    /// How far the finest of the three values may be from it.
    pub uncertainty: f64,
}

/// Orders that are sought.
const LEAST_ORDER: f64 = 0.2;
const GREATEST_ORDER: f64 = 12.0;
/// Roache's factor of safety for three sizes.
const SAFETY: f64 = 1.25;

/// From (h, value), coarsest first. `None` where the values do not approach each other from one side.
pub fn extrapolate(three: [(f64, f64); 3]) -> Option<Extrapolation> {
    let [(h3, f3), (h2, f2), (h1, f1)] = three;
    let ratio = (f3 - f2) / (f2 - f1);
    // falls from above to below zero where the order passes that of the values
    let excess = |p: f64| ratio - (h3.powf(p) - h2.powf(p)) / (h2.powf(p) - h1.powf(p));
    let (mut low, mut high) = (LEAST_ORDER, GREATEST_ORDER);
    if !(h3 > h2 && h2 > h1 && excess(low) >= 0.0 && excess(high) <= 0.0) {
        return None;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if excess(middle) >= 0.0 { low = middle } else { high = middle }
    }
    let order = 0.5 * (low + high);
    let left = (f1 - f2) / ((h2 / h1).powf(order) - 1.0);
    Some(Extrapolation { order, value: f1 + left, uncertainty: SAFETY * left.abs() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_found_with_its_limit() {
        let value = |h: f64| 2.0 - 0.7 * h.powf(2.5);
        let found = extrapolate([0.5, 0.3, 0.2].map(|h| (h, value(h)))).expect("it converges");
        assert!((found.order - 2.5).abs() < 1e-9 && (found.value - 2.0).abs() < 1e-12, "{found:?}");
        assert!((found.uncertainty - 1.25 * (2.0 - value(0.2))).abs() < 1e-12);
        assert_eq!(extrapolate([(0.5, 1.0), (0.3, 2.0), (0.2, 1.5)]), None);
        let order = observed((0.4, 0.16), (0.2, 0.04)).expect("an order");
        assert!((order - 2.0).abs() < 1e-12);
        assert_eq!(observed((0.4, 0.1), (0.2, 0.0)), None);
    }
}
