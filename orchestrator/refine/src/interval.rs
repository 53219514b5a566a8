//! 95 % intervals of the parameters of a fit, in the terms of the vocabulary.

use super::answer::Parameter;
use super::engine::candidate::Candidate;
use super::engine::fit::Fit;
use super::rig::physical::quantities;

/// Parameters of one candidate of a fit with intervals by the delta method; a misfit over `samples` residuals that is
/// left widens them.
pub fn parameters(candidate: &Candidate, fit: &Fit, samples: f64) -> Vec<Parameter> {
    let values = quantities(candidate, &fit.parameters);
    let scale = if samples > 1.0 { (fit.chi2 / samples).max(1.0).sqrt() } else { 1.0 };
    let slopes: Vec<Vec<f64>> = fit
        .free
        .iter()
        .enumerate()
        .map(|(a, free)| {
            let step = 0.01 * fit.covariance[(a, a)].max(0.0).sqrt();
            let mut moved = fit.parameters.clone();
            moved[free.index] += step;
            let shifted = quantities(candidate, &moved);
            shifted
                .iter()
                .zip(&values)
                .map(|(s, v)| if step > 0.0 { (s.2 - v.2) / step } else { 0.0 })
                .collect()
        })
        .collect();
    let parameter = |(i, (name, unit, value)): (usize, &(String, String, f64))| {
        let mut variance = 0.0;
        for a in 0..fit.free.len() {
            for b in 0..fit.free.len() {
                variance += slopes[a][i] * fit.covariance[(a, b)] * slopes[b][i];
            }
        }
        let half = 1.96 * scale * variance.max(0.0).sqrt();
        Parameter {
            name: name.clone(),
            unit: unit.clone(),
            value: *value,
            interval: (value - half, value + half),
        }
    };
    values.iter().enumerate().map(parameter).collect()
}
