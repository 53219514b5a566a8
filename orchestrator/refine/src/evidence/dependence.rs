//! Residuals against the variables that they depend on.

use super::{Record, Signal};
use crate::order::{ascending, descending};

/// Bins of equal count.
const BINS: usize = 24;
/// Variables shown per signal, and the share that a second one has to tell.
const MAX_VARIABLES_PER_SIGNAL: usize = 2;
const MIN_SHARE_OF_SECOND_VARIABLE: f64 = 0.02;

/// Mean residual of a signal over a variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Dependence {
    /// Signal.
    pub signal: String,
    /// Unit of the signal.
    pub unit: String,
    /// Variable and its unit.
    pub variable: (String, String),
    /// Share of the variance of the residual before that the bins tell.
    pub share: f64,
    /// Per bin: mean of the variable, mean residual before and after.
    pub bins: Vec<(f64, f64, f64)>,
    /// Standard deviation of the mean of a bin under the noise of the sensor.
    pub noise: f64,
}

/// The variables on which the residual of each signal depends most under the declared model.
pub fn of(signals: &[Signal], records: &[Record]) -> Vec<Dependence> {
    let mut found = Vec::new();
    for (index, signal) in signals.iter().enumerate() {
        let mut own: Vec<Dependence> = variables(records)
            .into_iter()
            .map(|(name, unit)| one(index, signal, records, name, unit))
            .filter(|dependence| !dependence.bins.is_empty())
            .collect();
        descending(&mut own, |own| own.share);
        own.truncate(MAX_VARIABLES_PER_SIGNAL);
        let second = own.get(1).is_some_and(|dependence| dependence.share < MIN_SHARE_OF_SECOND_VARIABLE);
        own.truncate(if second { 1 } else { MAX_VARIABLES_PER_SIGNAL });
        found.append(&mut own);
    }
    found
}

fn variables(records: &[Record]) -> Vec<(&str, &str)> {
    let first = records.first();
    let own = first.iter().flat_map(|r| r.variables.iter()).map(|v| (v.name.as_str(), v.unit.as_str()));
    std::iter::once(("time", "s")).chain(own).collect()
}

fn one(index: usize, signal: &Signal, records: &[Record], name: &str, unit: &str) -> Dependence {
    let mut rows: Vec<(f64, f64, f64)> = Vec::new();
    for record in records {
        let Some(residual) = record.residuals.iter().find(|r| r.signal == index) else { continue };
        let own = record.variables.iter().find(|v| v.name == name).map(|v| v.values.as_slice());
        if own.is_none() && name != "time" {
            continue;
        }
        let [before, after] = &residual.values;
        for (k, (b, a)) in before.iter().zip(after).enumerate() {
            rows.push((own.map_or(k as f64 * record.sample_time, |own| own[k]), *b, *a));
        }
    }
    ascending(&mut rows, |own| own.0);
    let size = (rows.len() / BINS).max(1);
    let mean = |rows: &[(f64, f64, f64)]| {
        let n = rows.len() as f64;
        let sum = rows.iter().fold((0.0, 0.0, 0.0), |s, r| (s.0 + r.0, s.1 + r.1, s.2 + r.2));
        (sum.0 / n, sum.1 / n, sum.2 / n)
    };
    let bins: Vec<_> = rows.chunks_exact(size).map(mean).collect();
    let level = rows.iter().map(|r| r.1).sum::<f64>() / rows.len().max(1) as f64;
    let total: f64 = rows.iter().map(|r| (r.1 - level).powi(2)).sum();
    let told: f64 = bins.iter().map(|bin| size as f64 * (bin.1 - level).powi(2)).sum();
    Dependence {
        signal: signal.name.clone(),
        unit: signal.unit.clone(),
        variable: (name.to_owned(), unit.to_owned()),
        share: if total > 0.0 { told / total } else { 0.0 },
        bins,
        noise: signal.noise / (size as f64).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{Residual, Variable};

    #[test]
    fn the_variable_that_makes_the_residual_comes_first() {
        let n = 2400;
        let x: Vec<f64> = (0..n).map(|k| (0.7 * k as f64).sin()).collect();
        let v: Vec<f64> = (0..n).map(|k| (1.3 * k as f64 + 1.0).cos()).collect();
        let before: Vec<f64> = x.iter().map(|x| 3.0 * x * x).collect();
        let record = Record {
            name: String::new(),
            group: String::new(),
            sample_time: 1e-3,
            residuals: vec![Residual { signal: 0, measured: before.clone(), values: [before, vec![0.0; n]] }],
            variables: [("x", x), ("xdot", v)]
                .map(|(name, values)| Variable { name: name.into(), unit: "m".into(), values })
                .into(),
        };
        let signal = Signal { name: "F_p".into(), unit: "N".into(), noise: 0.1 };
        let found = of(&[signal], &[record]);
        // Speed and time tell nothing of it, so that they are not shown.
        assert_eq!((found.len(), found[0].variable.0.as_str()), (1, "x"));
        assert!(found[0].share > 0.95, "{}", found[0].share);
        // The outermost bin holds the largest of x^2, and nothing is left after.
        assert!(found[0].bins[0].1 > 2.9 && found[0].bins[0].2 == 0.0);
    }
}
