//! Interface of the engine to a system: residuals of its records as a function of one parameter vector.

use std::ops::Range;

use super::fit::Free;
use super::noise::Noise;

/// A declared system with candidate effects, and the records made with it.
///
/// Parameters are one flat vector shared by all records; what differs from record to record (initial states) are its
/// local parameters.
pub trait System: Sync {
    /// Number of records.
    fn records(&self) -> usize;
    /// Whether a record may be fitted (otherwise it is for validation).
    fn estimation(&self, record: usize) -> bool;
    /// Local parameters of a record: start value and difference step of each. A step of zero: nothing depends on it, it
    /// is not fitted.
    fn locals(&self, record: usize) -> Vec<(f64, f64)>;
    /// Where the residuals of each signal stand.
    fn signals(&self, record: usize) -> Vec<Span>;
    /// Predicted sensor values without noise, all signals one after the other.
    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64>;
    /// Measured sensor values, laid out as in `predict`.
    fn measured(&self, record: usize) -> Vec<f64>;
    /// (measured - predicted) / noise.
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64>;
    /// The whitened residuals as they would be if `predicted` were true: sensor noise and rounding.
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64>;
    /// Puts zero where a signal of a record was not measured: values laid out as in `predict`.
    fn silence(&self, _record: usize, _values: &mut [f64]) {}
    /// The same records, only this share of them from their beginning; `None` where they cannot be cut.
    fn beginning(&self, _share: f64) -> Option<Box<dyn System + '_>> {
        None
    }
    /// A stage of the search begins: reported to a listener.
    fn stage(&self, _name: &str) {}
    /// Whitened residuals.
    fn residuals(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.whiten(record, &self.predict(record, parameters, locals))
    }
    /// Derivatives of the whitened residuals at `parameters`, `[parameters]`, and `locals`, `[locals]`, that a system
    /// has without a simulation for each; none: it has none.
    fn derivatives(
        &self,
        _record: usize,
        _parameters: &[f64],
        _locals: &[f64],
        _free: &[Free],
    ) -> Option<Derivatives> {
        None
    }
    /// Simulations that cost less together than one by one: so many are given to [`System::residuals_of`] at once.
    fn side_by_side(&self) -> usize {
        1
    }
    /// Whitened residuals of several simulations, which a system may run side by side; each is what
    /// [`System::residuals`] gives, to the last bit.
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        jobs.iter().map(|job| self.residuals(job.record, &job.parameters, &job.locals)).collect()
    }
}

/// Derivatives of the whitened residuals of a record, each laid out as they are.
#[derive(Debug, Clone)]
pub struct Derivatives {
    /// By the free parameters, `[free][samples]`; none: not known.
    pub shared: Vec<Option<Vec<f64>>>,
    /// By all local parameters, `[locals][samples]`; none: not known.
    pub locals: Option<Vec<Vec<f64>>>,
}

/// A simulation that is asked for.
#[derive(Debug, Clone)]
pub struct Job {
    /// Record.
    pub record: usize,
    /// Parameter vector.
    pub parameters: Vec<f64>,
    /// Local parameters of the record.
    pub locals: Vec<f64>,
}

/// Residuals of one signal within those of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Span {
    /// Measured signal.
    pub signal: String,
    /// Its residuals.
    pub range: Range<usize>,
    /// Noise \[unit of the signal\]: a whitened residual times this is the residual.
    pub noise: f64,
}

/// A system for tests: straight lines and parabolas with an offset per record.
#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// `y = offset + p0 t + p1 t^2` plus unit noise, t in [0, 1).
    pub struct Lines {
        pub values: Vec<Vec<f64>>,
    }

    impl Lines {
        pub fn new(slope: f64, square: f64) -> Lines {
            let record = |r: u64| {
                let mut noise = Noise::new(7, r);
                let at = |k: usize| k as f64 / 512.0;
                (0..512)
                    .map(|k| 40.0 * r as f64 + slope * at(k) + square * at(k).powi(2) + noise.normal())
                    .collect()
            };
            Lines { values: (0..3).map(record).collect() }
        }
    }

    impl System for Lines {
        fn records(&self) -> usize {
            3
        }
        fn estimation(&self, record: usize) -> bool {
            record < 2
        }
        fn locals(&self, record: usize) -> Vec<(f64, f64)> {
            vec![(self.values[record][0], 0.01)]
        }
        fn beginning(&self, share: f64) -> Option<Box<dyn System + '_>> {
            let cut = |own: &Vec<f64>| own[..(share * own.len() as f64) as usize].to_vec();
            Some(Box::new(Lines { values: self.values.iter().map(cut).collect() }))
        }
        fn signals(&self, record: usize) -> Vec<Span> {
            vec![Span { signal: "y".into(), range: 0..self.values[record].len(), noise: 1.0 }]
        }
        fn predict(&self, record: usize, p: &[f64], locals: &[f64]) -> Vec<f64> {
            // A third parameter, if given, is a slope as well.
            let slope = p[0] + p.get(2).copied().unwrap_or(0.0);
            let times = (0..self.values[record].len()).map(|k| k as f64 / 512.0);
            times.map(|t| locals[0] + slope * t + p[1] * t * t).collect()
        }
        fn measured(&self, record: usize) -> Vec<f64> {
            self.values[record].clone()
        }
        fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
            self.values[record].iter().zip(predicted).map(|(y, p)| y - p).collect()
        }
        fn redraw(&self, _: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
            predicted.iter().map(|_| noise.normal()).collect()
        }
    }
}
