//! A start that is moved ahead in time, in place: what was planned for `t + by` now stands at `t`.

use super::error::Error;
use super::part::Part;
use super::problem::Duration;
use super::program::Program;
use airloop_optim::{Multipliers, Start};

/// Values of one kind at increasing fractions of a phase: value `k` is `values[first + k * stride]`.
struct Series<'a> {
    places: &'a dyn Fn(usize) -> f64,
    count: usize,
    first: usize,
    stride: usize,
}

impl Series<'_> {
    /// Moves values ahead by a part of the phase, on straight lines; the last one holds beyond the end.
    fn shift(&self, values: &mut [f64], part: f64) {
        let at = |k: usize| self.first + k * self.stride;
        let mut j = 0;
        for k in 0..self.count {
            let place = (self.places)(k) + part;
            // Values from k on are still those from before.
            j = j.max(k);
            while j + 1 < self.count && (self.places)(j + 1) <= place {
                j += 1;
            }
            values[at(k)] = if j + 1 == self.count {
                values[at(j)]
            } else {
                let (a, b) = ((self.places)(j), (self.places)(j + 1));
                let s = (place - a) / (b - a);
                values[at(j)] + s * (values[at(j + 1)] - values[at(j)])
            };
        }
    }
}

impl Program<'_> {
    /// Moves a start ahead by `by` seconds, variables and multipliers; beyond its end it holds the last values.
    ///
    /// # Errors
    /// [`Error::Request`] where there are several phases or the duration is free, or `by` is no time within the phase.
    pub fn shift(&self, start: &mut Start, by: f64) -> Result<(), Error> {
        let refuse = |reason: &str| Err(Error::Request { request: "shift", reason: reason.to_owned() });
        let [part] = &self.parts[..] else {
            return refuse("the problem has several phases; give a start instead");
        };
        let Duration::Fixed(duration) = part.duration else {
            return refuse("the duration is to be found; give a start instead");
        };
        if !(0.0..=duration).contains(&by) {
            return refuse(&format!("{by} s is not between 0 and the duration of {duration} s"));
        }
        let ahead = by / duration;
        variables(part, &mut start.x, ahead);
        if let Some(Multipliers { constraints, lower, upper }) = &mut start.multipliers {
            variables(part, lower, ahead);
            variables(part, upper, ahead);
            rows(part, constraints, ahead);
        }
        Ok(())
    }
}

fn middle(part: &Part) -> impl Fn(usize) -> f64 {
    |k| 0.5 * (part.fractions[k] + part.fractions[k + 1])
}

fn variables(part: &Part, values: &mut [f64], ahead: f64) {
    let layout = &part.layout;
    let (n, stride) = (layout.intervals, layout.stride());
    let nodes = |k: usize| part.fractions[k];
    for a in 0..layout.node_width() {
        let held = layout.held && a >= layout.free + layout.states;
        let count = if held { n } else { n + 1 };
        Series { places: &nodes, count, first: layout.first + a, stride }.shift(values, ahead);
    }
    for a in layout.node_width()..stride {
        Series { places: &middle(part), count: n, first: layout.first + a, stride }.shift(values, ahead);
    }
}

/// Rows of intervals and nodes that are the same all along the phase.
fn rows(part: &Part, values: &mut [f64], ahead: f64) {
    let n = part.layout.intervals;
    let (intervals, nodes) = (&part.interval_constraints, &part.node_constraints);
    let stride = |firsts: &[usize]| {
        let first = firsts.get(1).map_or(0, |second| second - firsts[0]);
        firsts.windows(2).all(|pair| pair[1] - pair[0] == first).then_some(first)
    };
    let at_nodes = |k: usize| part.fractions[k];
    if let Some(stride) = stride(intervals) {
        for row in 0..part.interval_rows(0) {
            Series { places: &middle(part), count: n, first: intervals[0] + row, stride }
                .shift(values, ahead);
        }
    }
    if let Some(stride) =
        stride(nodes).filter(|_| part.node_rows.iter().all(|rows| *rows == part.node_rows[0]))
    {
        for row in 0..part.node_rows[0].len() {
            Series { places: &at_nodes, count: n + 1, first: nodes[0] + row, stride }.shift(values, ahead);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_on_a_straight_line_stay_on_it_and_the_last_one_holds() {
        let places = [0.0, 0.1, 0.4, 0.7, 1.0];
        let mut values: Vec<f64> = places.iter().flat_map(|s| [9.0, 2.0 * s]).collect();
        Series { places: &|k| places[k], count: 5, first: 1, stride: 2 }.shift(&mut values, 0.25);
        for (k, s) in places.iter().enumerate() {
            assert!((values[2 * k + 1] - 2.0 * (s + 0.25).min(1.0)).abs() < 1e-15);
            assert_eq!(values[2 * k], 9.0);
        }
    }
}
