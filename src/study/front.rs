//! The front: variants that no other beats in both error and time.

/// Indices of the pairs (error, seconds) that no other pair beats or equals in both, cheapest first. Pairs with a value
/// that is not finite are left out.
pub fn front(pairs: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..pairs.len()).filter(|k| pairs[*k].0.is_finite() && pairs[*k].1.is_finite()).collect();
    order.sort_by(|a, b| pairs[*a].1.total_cmp(&pairs[*b].1).then(pairs[*a].0.total_cmp(&pairs[*b].0)));
    let mut least = f64::INFINITY;
    order.retain(|k| {
        let better = pairs[*k].0 < least;
        least = least.min(pairs[*k].0);
        better
    });
    order
}

/// The cheapest pair whose error is at most `target`; `None` where none is that good.
pub fn cheapest(pairs: &[(f64, f64)], target: f64) -> Option<usize> {
    front(pairs).into_iter().find(|k| pairs[*k].0 <= target)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let pairs = [(1.0, 1.0), (0.5, 2.0), (0.6, 3.0), (0.1, 4.0), (f64::NAN, 0.1), (1.0, 1.5)];
        assert_eq!(front(&pairs), [0, 1, 3]);
        assert_eq!(cheapest(&pairs, 0.5), Some(1));
        assert_eq!(cheapest(&pairs, 0.05), None);
    }
}
