//! Seconds of repeated work, told honestly.

/// A run that took longer than the median by this factor was disturbed.
const OUTLIER: f64 = 1.5;

/// Wall times of repetitions, s; what is read or written is not in them.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing {
    seconds: Vec<f64>,
}

impl Timing {
    /// Of at least one repetition.
    pub fn new(mut seconds: Vec<f64>) -> Timing {
        seconds.sort_by(f64::total_cmp);
        Timing { seconds }
    }

    /// The middle one, or the mean of the middle two; NaN without repetitions.
    pub fn median(&self) -> f64 {
        let n = self.seconds.len();
        match n {
            0 => f64::NAN,
            _ if n % 2 == 1 => self.seconds[n / 2],
            _ => 0.5 * (self.seconds[n / 2 - 1] + self.seconds[n / 2]),
        }
    }

    /// The shortest.
    pub fn min(&self) -> f64 {
        self.seconds.first().copied().unwrap_or(f64::NAN)
    }

    /// The longest.
    pub fn max(&self) -> f64 {
        self.seconds.last().copied().unwrap_or(f64::NAN)
    }

    /// How many repetitions took more than 1.5 times the median: the machine did something else meanwhile.
    pub fn outliers(&self) -> usize {
        self.seconds.iter().filter(|s| **s > OUTLIER * self.median()).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_ignores_a_disturbed_run() {
        let timing = Timing::new(vec![1.0, 9.0, 1.2]);
        assert_eq!((timing.median(), timing.min(), timing.max(), timing.outliers()), (1.2, 1.0, 9.0, 1));
        assert_eq!(Timing::new(vec![1.0, 2.0]).median(), 1.5);
    }
}
