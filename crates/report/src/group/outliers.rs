//! Values that lie far from the rest of their group.
//!
//! **Input** the values of one measure. **Output** median, spread, and the values outside of their limits.
//! **Steps** 1. The median m and the scaled median absolute deviation s = 1.4826 · median |x − m|, which is the standard
//! deviation where values are normal. 2. If more than half of the values are equal, s is 0: then s = 1.2533 · mean
//! |x − m| takes its place. 3. Outliers lie outside of m ± 3.5 s.
//! **Guarantees** values that differ only by rounding are no outliers; fewer than [`LEAST_RUNS`] values have none.
//! **Source** [Iglewicz1993], chapter 3: the limit of 3.5, both factors.

/// With fewer values nothing is called an outlier: two of four may be.
pub(super) const LEAST_RUNS: usize = 5;
/// The limit, in units of the spread.
pub(super) const LIMIT: f64 = 3.5;
const MAD_FACTOR: f64 = 1.4826;
const MEAN_FACTOR: f64 = 1.2533;
/// Differences below this share of the median are roundings.
const ROUNDING: f64 = 1e-6;

/// What a group has of one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    /// How many runs have a value.
    pub(super) n: usize,
    /// The median; `NaN` for none.
    pub(super) median: f64,
    /// The scaled spread; `NaN` for none.
    pub(super) spread: f64,
    /// The least and the largest value.
    pub(super) range: [f64; 2],
    /// Differences up to this say nothing.
    noise: f64,
}

impl Spread {
    pub(super) fn of(values: &[f64], noise: f64) -> Self {
        let known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        let middle = median(&known);
        let off: Vec<f64> = known.iter().map(|value| (value - middle).abs()).collect();
        let scaled = MAD_FACTOR * median(&off);
        let mean = off.iter().sum::<f64>() / known.len() as f64;
        Self {
            noise,
            n: known.len(),
            median: middle,
            spread: if scaled > 0.0 { scaled } else { MEAN_FACTOR * mean },
            range: [
                known.iter().copied().fold(f64::INFINITY, f64::min),
                known.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ],
        }
    }

    /// What lies between these is no outlier.
    pub(super) fn limits(&self) -> [f64; 2] {
        let reach = (LIMIT * self.spread).max(self.noise);
        [self.median - reach, self.median + reach]
    }

    /// Whether all values are the same, as far as that says anything.
    pub(super) fn is_even(&self) -> bool {
        self.range[1] - self.range[0] <= self.noise
    }

    /// By how many spreads a value is off, if that is too many.
    pub(super) fn excess(&self, value: f64) -> Option<f64> {
        let off = value - self.median;
        let least = (ROUNDING * self.median.abs()).max(self.noise);
        let is_told = self.n >= LEAST_RUNS && self.spread > 0.0 && off.abs() > least;
        Some(off / self.spread).filter(|excess| is_told && excess.abs() > LIMIT)
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match (sorted.len(), sorted.len() / 2) {
        (0, _) => f64::NAN,
        (n, half) if n.is_multiple_of(2) => 0.5 * (sorted[half - 1] + sorted[half]),
        (_, half) => sorted[half],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outliers(values: &[f64]) -> Vec<usize> {
        let spread = Spread::of(values, 0.0);
        (0..values.len()).filter(|&i| spread.excess(values[i]).is_some()).collect()
    }

    #[test]
    fn known_groups() {
        let group = Spread::of(&[1.0, 2.0, 3.0, 4.0, 100.0, f64::NAN], 0.0);
        assert_eq!((group.n, group.median, group.range), (5, 3.0, [1.0, 100.0]));
        assert!((group.spread - 1.4826).abs() < 1e-12);
        assert_eq!(outliers(&[1.0, 2.0, 3.0, 4.0, 100.0]), [4]);
        assert_eq!(outliers(&[1.0, 2.0, 3.0, 4.0, 8.1]), [] as [usize; 0], "3.44 spreads");
        assert_eq!(outliers(&[1.0, 2.0, 3.0, 4.0, 8.3]), [4], "3.57 spreads");
        // More than half are equal: by the mean deviation.
        assert_eq!(outliers(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0]), [7]);
        assert_eq!(outliers(&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0 + 1e-9]), [] as [usize; 0], "a rounding");
        assert_eq!(outliers(&[1.0, 1.0, 1.0, 1e9]), [] as [usize; 0], "too few");
        let tiny = Spread::of(&[1e-11, 2e-11, 3e-11, 4e-11, 9e-5, 2e-4], 1e-4);
        assert_eq!((tiny.excess(9e-5), tiny.excess(2e-4).is_some(), tiny.is_even()), (None, true, false));
        assert_eq!(outliers(&[2.0; 7]), [] as [usize; 0]);
        assert_eq!(outliers(&[]), [] as [usize; 0]);
    }
}
