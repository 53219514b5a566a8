//! Estimated parameters with their uncertainty.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Quantile 0.975 of the normal distribution.
pub const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

/// Parameters, their names and their covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Names, such as `A1[2,1]`: row and column counted from 1.
    pub names: Vec<String>,
    /// Values, shape \[p\].
    pub values: DVector<f64>,
    /// Covariance, shape \[p, p\]; `None` if the data do not determine all parameters.
    pub covariance: Option<DMatrix<f64>>,
}

/// A parameter with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Interval {
    /// Name of the parameter.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; `None` if the data do not determine all parameters.
    pub standard_deviation: Option<f64>,
    /// Ends of the 95 % interval.
    pub interval_95: Option<[f64; 2]>,
}

impl Parameters {
    /// Every parameter with its 95 % interval (normal distribution).
    pub fn intervals(&self) -> Vec<Interval> {
        let deviation = |index: usize| self.covariance.as_ref().map(|p| p[(index, index)].max(0.0).sqrt());
        (0..self.values.len())
            .map(|index| {
                let (value, standard_deviation) = (self.values[index], deviation(index));
                let ends = |sd: f64| [value - TWO_SIDED_95 * sd, value + TWO_SIDED_95 * sd];
                Interval {
                    name: self.names[index].clone(),
                    value,
                    standard_deviation,
                    interval_95: standard_deviation.map(ends),
                }
            })
            .collect()
    }

    /// Changes of the parameters along which their uncertainty is independent, one standard deviation each (columns of
    /// a factor L with `L L^T` the covariance): up to `[parameters]` vectors of shape `[parameters]`, in the units of
    /// the parameters; none without a covariance.
    pub fn deviations(&self) -> Vec<DVector<f64>> {
        let Some(covariance) = &self.covariance else { return Vec::new() };
        // Scaled to correlations: parameters of different size keep their digits.
        let scale = covariance.diagonal().map(|variance| variance.max(f64::MIN_POSITIVE).sqrt());
        let n = scale.len();
        let correlation = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
        let eigen = correlation.symmetric_eigen();
        (0..n)
            .filter(|&k| eigen.eigenvalues[k] > 0.0)
            .map(|k| (eigen.eigenvectors.column(k) * eigen.eigenvalues[k].sqrt()).component_mul(&scale))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_multiply_to_the_covariance() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 1e-4, 1e-4, 1e-8]);
        let parameters = Parameters {
            names: vec!["p".into(), "q".into()],
            values: DVector::zeros(2),
            covariance: Some(covariance.clone()),
        };
        let sum = parameters
            .deviations()
            .iter()
            .fold(DMatrix::zeros(2, 2), |sum: DMatrix<f64>, d| sum + d * d.transpose());
        assert!((&sum - &covariance).amax() < 1e-12, "{sum}");
        assert!((parameters.intervals()[0].interval_95.unwrap()[1] - 2.0 * 1.96).abs() < 1e-3);
    }
}
