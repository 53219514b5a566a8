//! The values of a task, from its number alone: grids, Latin hypercubes and Sobol' points over factors.

mod permutation;
pub(crate) mod saltelli;
mod sobol;

use airloop_series::random::Random;

use crate::Error;
use crate::file::{Method, Scale};
use permutation::Permutation;

/// A value of a factor.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Number.
    Number(f64),
    /// Text: a file, a master, a truth value.
    Text(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Number(number) => write!(f, "{number}"),
            Value::Text(text) => f.write_str(text),
        }
    }
}

/// Values that a factor takes.
#[derive(Debug, Clone, PartialEq)]
pub enum Range {
    /// These.
    Listed(Vec<Value>),
    /// Between two numbers.
    Between {
        /// Limits.
        limits: (f64, f64),
        /// Spacing.
        scale: Scale,
        /// Number of values in a grid.
        levels: u64,
    },
}

impl Range {
    fn levels(&self) -> u64 {
        match self {
            Range::Listed(values) => values.len() as u64,
            Range::Between { levels, .. } => *levels,
        }
    }

    /// The value at a place between 0 and 1.
    fn at(&self, place: f64) -> Value {
        match self {
            Range::Listed(values) => {
                let index = (place * values.len() as f64) as usize;
                values[index.min(values.len() - 1)].clone()
            }
            Range::Between { limits: (from, to), scale, .. } => Value::Number(match scale {
                _ if place <= 0.0 => *from,
                _ if place >= 1.0 => *to,
                Scale::Linear => from + place * (to - from),
                Scale::Log => from * (to / from).powf(place),
            }),
        }
    }
}

/// Points of all tasks.
#[derive(Debug, Clone)]
pub struct Design {
    ranges: Vec<Range>,
    method: Method,
    count: u64,
    seed: u64,
    orders: Vec<Permutation>,
}

impl Design {
    /// A design of `count` tasks; a grid has as many as its levels make, each `count` times.
    ///
    /// # Errors
    /// More factors than a Sobol' sequence has dimensions, no task, or more tasks than can be numbered.
    pub fn new(ranges: Vec<Range>, method: Method, count: u64, seed: u64) -> Result<Design, Error> {
        let most = match method {
            Method::Sobol => sobol::MAX_DIMENSIONS,
            Method::Saltelli => sobol::MAX_DIMENSIONS / 2,
            _ => usize::MAX,
        };
        if ranges.len() > most {
            let problem = format!("{} factors; this method has at most {most}", ranges.len());
            return Err(Error::Plan { place: "[sample] method".into(), problem });
        }
        let mut levels = ranges.iter().map(Range::levels);
        let tasks = match method {
            Method::Grid => levels.try_fold(count, u64::checked_mul),
            Method::Saltelli => count.checked_mul(saltelli::tasks_per_point(ranges.len())),
            _ => Some(count),
        };
        let tasks = tasks.filter(|tasks| *tasks <= 1 << 32).ok_or_else(|| Error::Plan {
            place: "[sample]".into(),
            problem: "more than 2^32 tasks; take fewer levels, or a Sobol' sample".into(),
        })?;
        if tasks == 0 {
            let problem = "a sample of no tasks; give a count of at least 1".into();
            return Err(Error::Plan { place: "[sample] count".into(), problem });
        }
        let stream = |dimension: usize| Random::numbered(seed, dimension as u64).bits();
        let orders = (0..ranges.len()).map(|one| Permutation::new(tasks, stream(one))).collect();
        Ok(Design { ranges, method, count: tasks, seed, orders })
    }

    /// Number of tasks.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Whether the values of a factor are texts.
    pub fn is_text(&self, factor: usize) -> bool {
        matches!(&self.ranges[factor], Range::Listed(values) if values.iter().any(|one| matches!(one, Value::Text(_))))
    }

    /// Values of a task, one per factor.
    pub fn point(&self, task: u64) -> Vec<Value> {
        match self.method {
            Method::Grid => self.grid(task),
            Method::Sobol => self.at(|dimension| sobol::coordinate(task, dimension)),
            Method::Saltelli => {
                let factors = self.ranges.len();
                let points = self.count / saltelli::tasks_per_point(factors);
                self.at(|dimension| saltelli::coordinate(task, dimension, factors, points))
            }
            Method::LatinHypercube => {
                let mut random = Random::numbered(self.seed, task);
                let cells = self.count as f64;
                self.at(|dimension| (self.orders[dimension].at(task) as f64 + random.uniform()) / cells)
            }
        }
    }

    fn at(&self, mut place: impl FnMut(usize) -> f64) -> Vec<Value> {
        self.ranges.iter().enumerate().map(|(dimension, range)| range.at(place(dimension))).collect()
    }

    /// The last factor runs fastest.
    fn grid(&self, task: u64) -> Vec<Value> {
        let mut left = task;
        let mut values: Vec<Value> = self
            .ranges
            .iter()
            .rev()
            .map(|range| {
                let (levels, level) = (range.levels(), left % range.levels());
                left /= levels;
                match range {
                    Range::Listed(values) => values[level as usize].clone(),
                    Range::Between { .. } => range.at(level as f64 / (levels - 1).max(1) as f64),
                }
            })
            .collect();
        values.reverse();
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn between(from: f64, to: f64, scale: Scale, levels: u64) -> Range {
        Range::Between { limits: (from, to), scale, levels }
    }

    fn numbers(design: &Design, factor: usize) -> Vec<f64> {
        let number = |task| match design.point(task)[factor] {
            Value::Number(number) => number,
            Value::Text(_) => f64::NAN,
        };
        (0..design.count()).map(number).collect()
    }

    #[test]
    fn a_grid_has_every_combination_and_both_limits() {
        let ranges = vec![between(1.0, 100.0, Scale::Log, 3), between(0.0, 1.0, Scale::Linear, 2)];
        let design = Design::new(ranges, Method::Grid, 1, 0).unwrap();
        assert_eq!(numbers(&design, 0), [1.0, 1.0, 10.0, 10.0, 100.0, 100.0]);
        assert_eq!(numbers(&design, 1), [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn a_sample_of_no_tasks_is_refused() {
        for method in [Method::Grid, Method::LatinHypercube, Method::Sobol, Method::Saltelli] {
            let refused = Design::new(vec![between(0.0, 1.0, Scale::Linear, 2)], method, 0, 0).unwrap_err();
            assert!(refused.to_string().contains("at least 1"), "{refused}");
        }
    }

    #[test]
    fn a_latin_hypercube_has_one_value_in_every_cell_of_every_factor() {
        let ranges = vec![between(0.0, 50.0, Scale::Linear, 1), between(0.0, 50.0, Scale::Linear, 1)];
        let design = Design::new(ranges, Method::LatinHypercube, 50, 3).unwrap();
        for factor in 0..2 {
            let mut cells: Vec<u64> = numbers(&design, factor).iter().map(|value| *value as u64).collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..50).collect::<Vec<_>>());
        }
        assert_ne!(numbers(&design, 0), numbers(&design, 1));
    }
}
