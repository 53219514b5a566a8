//! Bounds of the variables: limits on single states and inputs, and durations.

use super::error::Error;
use super::part::Part;
use super::problem::Duration;
use airloop_optim::Bounds;

/// Difference of bounds, relative to their size, that counts as rounding.
const ROUNDING_TOLERANCE: f64 = 1e-9;

pub(super) struct VariableBounds {
    pub bounds: Bounds,
    /// Limit of its part that gave the lower and the upper bound of every variable.
    pub origin: Vec<[Option<usize>; 2]>,
}

impl VariableBounds {
    pub fn new(parts: &[Part], count: usize) -> Result<VariableBounds, Error> {
        let mut all = VariableBounds { bounds: Bounds::free(count), origin: vec![[None; 2]; count] };
        all.set(parts)?;
        Ok(all)
    }

    /// Sets all bounds as the limits of the parts are now.
    pub fn set(&mut self, parts: &[Part]) -> Result<(), Error> {
        self.bounds.lower.fill(f64::NEG_INFINITY);
        self.bounds.upper.fill(f64::INFINITY);
        self.origin.fill([None; 2]);
        parts.iter().try_for_each(|part| self.add(part))
    }

    fn add(&mut self, part: &Part) -> Result<(), Error> {
        for limit in 0..part.limits.len() {
            let Some((argument, factor)) = part.single(limit) else { continue };
            if let Some([nodes, middles]) = part.places.get(limit) {
                for &k in nodes {
                    self.narrow(part, limit, part.layout.point(k, argument), factor)?;
                }
                for variable in middles.iter().filter_map(|&k| part.layout.midpoint(k, argument)) {
                    self.narrow(part, limit, variable, factor)?;
                }
            } else {
                let k = if limit < part.paths + part.starts { 0 } else { part.layout.intervals };
                self.narrow(part, limit, part.layout.point(k, argument), factor)?;
            }
        }
        if let Duration::Free { lower, upper } = part.duration {
            let first = part.layout.first;
            (self.bounds.lower[first], self.bounds.upper[first]) = (lower, upper);
        }
        Ok(())
    }

    fn narrow(&mut self, part: &Part, limit: usize, variable: usize, factor: f64) -> Result<(), Error> {
        let given = &part.limits[limit];
        let (mut lower, mut upper) = (given.lower / factor, given.upper / factor);
        if factor < 0.0 {
            std::mem::swap(&mut lower, &mut upper);
        }
        let (old_lower, old_upper) = (self.bounds.lower[variable], self.bounds.upper[variable]);
        let origin = &mut self.origin[variable];
        let room = ROUNDING_TOLERANCE
            * [lower, upper].iter().fold(1.0, |m, v| if v.is_finite() { v.abs().max(m) } else { m });
        if lower > old_upper + room || upper < old_lower - room {
            let other = origin[usize::from(lower > old_upper)].map(|other| part.limits[other].name.as_str());
            let item = match other {
                Some(other) if other != given.name => format!("{other}` and `{}", given.name),
                _ => given.name.clone(),
            };
            let (lower, upper) = (lower.max(old_lower), upper.min(old_upper));
            return Err(Error::Bounds { phase: part.name.clone(), item, lower, upper });
        }
        if lower > old_lower {
            (self.bounds.lower[variable], origin[0]) = (lower, Some(limit));
        }
        if upper < old_upper {
            (self.bounds.upper[variable], origin[1]) = (upper, Some(limit));
        }
        if self.bounds.lower[variable] > self.bounds.upper[variable] {
            // Apart by rounding only: both take the value of the limit that was given last.
            let value = if lower == self.bounds.lower[variable] { lower } else { upper };
            (self.bounds.lower[variable], self.bounds.upper[variable]) = (value, value);
        }
        Ok(())
    }
}
