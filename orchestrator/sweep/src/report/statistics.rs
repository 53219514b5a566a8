//! Numbers about columns; values that are not finite are left out.

/// Summary of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statistics {
    /// Values.
    pub count: usize,
    /// Least.
    pub min: f64,
    /// Half of the values are below.
    pub median: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
    /// Standard deviation of the sample.
    pub deviation: f64,
}

impl Statistics {
    /// Summary of some values; NaN where there are none.
    pub fn of(values: &[f64]) -> Statistics {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let count = sorted.len();
        let mean = sorted.iter().sum::<f64>() / count as f64;
        let squares: f64 = sorted.iter().map(|value| (value - mean).powi(2)).sum();
        let at = |index: usize| sorted.get(index).copied().unwrap_or(f64::NAN);
        Statistics {
            count,
            min: at(0),
            median: 0.5 * (at(count.saturating_sub(1) / 2) + at(count / 2)),
            mean,
            max: at(count.wrapping_sub(1)),
            deviation: (squares / (count as f64 - 1.0)).sqrt(),
        }
    }
}

/// Spearman's rank correlation of two columns; none where one of them does not vary.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let both = a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite());
    let (a, b): (Vec<f64>, Vec<f64>) = both.map(|(a, b)| (*a, *b)).unzip();
    let (a, b) = (ranks(&a), ranks(&b));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let product =
        |x: &[f64], y: &[f64]| -> f64 { x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum() };
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    (scale > 0.0).then(|| product(&a, &b) / scale)
}

/// Rank of every value from 0; equal values share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_unstable_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut begin = 0;
    for equal in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let rank = begin as f64 + (equal.len() as f64 - 1.0) / 2.0;
        equal.iter().for_each(|index| ranks[*index] = rank);
        begin += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_are_those_of_the_definition() {
        let all = Statistics::of(&[4.0, f64::NAN, 1.0, 2.0, 3.0]);
        assert_eq!((all.count, all.min, all.median, all.mean, all.max), (4, 1.0, 2.5, 2.5, 4.0));
        assert!((all.deviation - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!(Statistics::of(&[]).max.is_nan());
    }

    #[test]
    fn rank_correlations_are_those_of_scipy() {
        // scipy.stats.spearmanr([1, 2, 2, 4, 5], [3, 1, 4, 4, 9])
        let found = rank_correlation(&[1.0, 2.0, 2.0, 4.0, 5.0], &[3.0, 1.0, 4.0, 4.0, 9.0]).unwrap();
        assert!((found - SCIPY).abs() < 1e-15, "{found}");
        let rising: Vec<f64> = (0..50).map(f64::from).collect();
        let cubes: Vec<f64> = rising.iter().map(|x| -x.powi(3)).collect();
        assert_eq!(rank_correlation(&rising, &cubes), Some(-1.0));
        assert_eq!(rank_correlation(&[1.0, 1.0], &[1.0, 2.0]), None);
    }

    const SCIPY: f64 = 0.7631578947368421;
}
