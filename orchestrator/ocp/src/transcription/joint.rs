//! A link between two phases as constraints of the program.

use super::check;
use super::dynamics::Size;
use super::error::Error;
use super::link::{Link, Reset, ResetSize, StateLink};
use super::part::Part;
use super::problem::{Limit, Variable};
use airloop_optim::{Bounds, EvaluationError};

/// Map of the states at a link, borrowed or owned.
pub(super) enum States<'p> {
    Continuous,
    Pairs(Vec<(usize, usize)>),
    Reset(Box<dyn Reset + 'p>, Vec<Limit>),
}

impl<'p> States<'p> {
    fn borrowed(states: &'p mut StateLink) -> States<'p> {
        match states {
            StateLink::Continuous => States::Continuous,
            StateLink::Pairs(pairs) => States::Pairs(pairs.clone()),
            StateLink::Reset(reset, limits) => States::Reset(Box::new(reset.as_mut()), limits.clone()),
        }
    }

    fn owned(states: StateLink) -> States<'static> {
        match states {
            StateLink::Continuous => States::Continuous,
            StateLink::Pairs(pairs) => States::Pairs(pairs),
            StateLink::Reset(reset, limits) => States::Reset(reset, limits),
        }
    }
}

/// Pairs of inputs that are continuous, and states after a reset that are free.
pub(super) struct Rest {
    pub inputs: Vec<(usize, usize)>,
    pub free: Vec<usize>,
}

/// A link, borrowed or owned.
pub(super) type Linked<'p> = (States<'p>, Rest);

impl<'p> States<'p> {
    /// A link of a problem that stays where it is.
    pub fn of(link: &'p mut Link) -> Linked<'p> {
        let rest = Rest { inputs: link.inputs.clone(), free: link.free.clone() };
        (States::borrowed(&mut link.states), rest)
    }

    /// A link of a problem that becomes part of the program.
    pub fn from(link: Link) -> Linked<'static> {
        (States::owned(link.states), Rest { inputs: link.inputs, free: link.free })
    }
}

/// A reset map with what was computed at the last point.
struct Map<'p> {
    reset: Box<dyn Reset + 'p>,
    size: ResetSize,
    limits: Vec<Limit>,
    /// States before, and the values there.
    at: Vec<f64>,
    values: Vec<f64>,
    jacobian: Vec<f64>,
    hessian: Vec<f64>,
    weights: Vec<f64>,
}

pub(super) struct Joint<'p> {
    map: Option<Map<'p>>,
    /// Pairs of variables that are equal, with the names of those before.
    pairs: Vec<(usize, usize)>,
    names: Vec<String>,
    /// States at the end of the phase before.
    before: Vec<usize>,
    /// Values of the map, and the states at the start of the phase after that are equal to them.
    after: Vec<(usize, usize)>,
    /// Whether it leads from the last phase back to the first.
    closes: bool,
    /// First constraint.
    pub first: usize,
    pub stage: usize,
}

impl<'p> Joint<'p> {
    /// A link between two phases; it `closes` a cycle where the second is the first of all.
    pub fn new(
        (link, Rest { inputs, free }): Linked<'p>,
        sides: [&Part; 2],
        first: usize,
        closes: bool,
    ) -> Result<Joint<'p>, Error> {
        let [a, b] = sides;
        let wrong = |reason: String| Error::Link { before: a.name.clone(), after: b.name.clone(), reason };
        let n = a.layout.intervals;
        let states = |part: &Part, k: usize| -> Vec<usize> {
            (0..part.layout.states).map(|i| part.layout.point(k, part.layout.free + i)).collect()
        };
        let (before, after) = (states(a, n), states(b, 0));
        let chosen: Vec<(usize, usize)> = match &link {
            States::Continuous if before.len() != after.len() => {
                let reason = format!(
                    "the phases have {} and {} states; say which pairs are continuous",
                    before.len(),
                    after.len()
                );
                return Err(wrong(reason));
            }
            States::Continuous => (0..before.len()).map(|i| (i, i)).collect(),
            States::Pairs(pairs) => pairs.clone(),
            States::Reset(..) => Vec::new(),
        };
        let map = match link {
            States::Reset(reset, limits) => {
                let size = reset.size();
                if size.before != before.len() || size.after != after.len() {
                    return Err(wrong(format!(
                        "the reset maps {} states to {}, but the phases have {} and {}",
                        size.before,
                        size.after,
                        before.len(),
                        after.len()
                    )));
                }
                for limit in &limits {
                    let outputs = Size { states: 0, inputs: 0, outputs: size.outputs };
                    check::limit(&a.name, limit, outputs)?;
                }
                let values = size.after + size.outputs;
                Some(Map {
                    reset,
                    size,
                    limits,
                    at: vec![0.0; size.before],
                    values: vec![0.0; values],
                    jacobian: vec![0.0; values * size.before],
                    hessian: vec![0.0; size.before * size.before],
                    weights: vec![0.0; values],
                })
            }
            _ => None,
        };
        let (mut pairs, mut names) = (Vec::new(), Vec::new());
        if let Some(&state) = free.iter().find(|&&state| state >= after.len() || map.is_none()) {
            let reason =
                format!("state {state} after a reset is free, but there is no such state, or no reset");
            return Err(wrong(reason));
        }
        let after: Vec<(usize, usize)> =
            after.into_iter().enumerate().filter(|(i, _)| !free.contains(i)).collect();
        let inputs = inputs.iter().map(|pair| (pair, a.layout.states, b.layout.states, "input"));
        let all = chosen.iter().map(|pair| (pair, 0, 0, "state")).chain(inputs);
        for (&(i, j), offset_a, offset_b, kind) in all {
            let count = |part: &Part| if kind == "state" { part.layout.states } else { part.layout.inputs };
            if i >= count(a) || j >= count(b) {
                return Err(wrong(format!("there is no pair of {kind}s ({i}, {j})")));
            }
            let of = |part: &Part, k: usize, i: usize| part.layout.point(k, part.layout.free + i);
            pairs.push((of(a, n, offset_a + i), of(b, 0, offset_b + j)));
            names.push(a.names[offset_a + i].clone());
        }
        if map.is_some() {
            names.splice(0..0, after.iter().map(|&(i, _)| b.names[i].clone()));
        }
        let stage = a.stage + a.layout.node_stage(n);
        Ok(Joint { map, pairs, names, before, after, closes, first, stage })
    }

    pub fn constraints(&self) -> usize {
        self.pairs.len() + self.map.as_ref().map_or(0, |map| self.after.len() + map.limits.len())
    }

    /// Sets the bounds of its constraints: states of the reset, equal pairs, outputs of the reset.
    pub fn set_bounds(&self, bounds: &mut Bounds) {
        let Some(map) = &self.map else { return };
        let first = self.first + self.after.len() + self.pairs.len();
        for (i, limit) in map.limits.iter().enumerate() {
            (bounds.lower[first + i], bounds.upper[first + i]) = (limit.lower, limit.upper);
        }
    }

    /// Name of constraint `row` of the joint, and the limit where it is one.
    pub fn name(&self, row: usize) -> (String, Option<&Limit>) {
        match (&self.map, row.checked_sub(self.names.len())) {
            (Some(map), Some(limit)) => (map.limits[limit].name.clone(), Some(&map.limits[limit])),
            (Some(_), None) if row < self.after.len() => {
                let what = if self.closes { "return" } else { "reset" };
                (format!("{what} of {}", self.names[row]), None)
            }
            _ => (format!("continuity of {}", self.names[row.min(self.names.len() - 1)]), None),
        }
    }

    /// The map at `x`.
    pub fn evaluate(&mut self, x: &[f64], derivatives: bool) -> Result<(), EvaluationError> {
        let Some(map) = &mut self.map else { return Ok(()) };
        map.at.iter_mut().zip(&self.before).for_each(|(value, &i)| *value = x[i]);
        if derivatives {
            map.reset.jacobian(&map.at, &mut map.values, &mut map.jacobian)
        } else {
            map.reset.evaluate(&map.at, &mut map.values)
        }
    }

    pub fn values(&self, x: &[f64], values: &mut [f64]) {
        let mut next = 0;
        let mut put = |value: f64| {
            values[next] = value;
            next += 1;
        };
        if let Some(map) = &self.map {
            self.after.iter().for_each(|&(i, j)| put(x[j] - map.values[i]));
        }
        self.pairs.iter().for_each(|&(i, j)| put(x[j] - x[i]));
        if let Some(map) = &self.map {
            for limit in &map.limits {
                put(outputs(limit).map(|(i, c)| c * map.values[map.size.after + i]).sum());
            }
        }
    }

    pub fn jacobian_places(&self, places: &mut Vec<(usize, usize)>) {
        let mut row = self.first;
        if self.map.is_some() {
            for &(_, j) in &self.after {
                places.push((row, j));
                places.extend(self.before.iter().map(|&i| (row, i)));
                row += 1;
            }
        }
        for &(i, j) in &self.pairs {
            places.extend([(row, j), (row, i)]);
            row += 1;
        }
        for _ in self.map.iter().flat_map(|map| &map.limits) {
            places.extend(self.before.iter().map(|&i| (row, i)));
            row += 1;
        }
    }

    pub fn jacobian_values(&self, values: &mut [f64]) -> usize {
        let mut next = 0;
        let mut put = |value: f64| {
            values[next] = value;
            next += 1;
        };
        let n = self.before.len();
        if let Some(map) = &self.map {
            for &(i, _) in &self.after {
                put(1.0);
                map.jacobian[i * n..][..n].iter().for_each(|value| put(-value));
            }
        }
        self.pairs.iter().for_each(|_| [1.0, -1.0].into_iter().for_each(&mut put));
        if let Some(map) = &self.map {
            for limit in &map.limits {
                for a in 0..n {
                    put(outputs(limit).map(|(i, c)| c * map.jacobian[(map.size.after + i) * n + a]).sum());
                }
            }
        }
        next
    }

    pub fn hessian_places(&self, places: &mut Vec<(usize, usize)>) {
        if self.map.is_some() {
            let n = self.before.len();
            places.extend(
                (0..n)
                    .flat_map(|a| (0..=a).map(move |b| (a, b)))
                    .map(|(a, b)| (self.before[a], self.before[b])),
            );
        }
    }

    /// Entries of the Hessian at the point of the last evaluation, as many as returned; `multipliers` of the whole
    /// problem.
    pub fn hessian_values(
        &mut self,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<usize, EvaluationError> {
        let (own, others) = (&multipliers[self.first..], self.after.len() + self.pairs.len());
        let Some(map) = &mut self.map else { return Ok(0) };
        map.weights.fill(0.0);
        self.after.iter().zip(own).for_each(|(&(i, _), m)| map.weights[i] = -m);
        for (limit, m) in map.limits.iter().zip(&own[others..]) {
            outputs(limit).for_each(|(i, c)| map.weights[map.size.after + i] += m * c);
        }
        map.reset.hessian(&map.at, &map.weights, &mut map.hessian)?;
        let n = map.at.len();
        let lower = (0..n).flat_map(|a| (0..=a).map(move |b| a * n + b));
        let count = n * (n + 1) / 2;
        values.iter_mut().zip(lower).for_each(|(value, i)| *value = map.hessian[i]);
        Ok(count)
    }
}

/// Terms of a limit by index of the output.
fn outputs(limit: &Limit) -> impl Iterator<Item = (usize, f64)> + '_ {
    limit.quantity.terms.iter().filter_map(|&(variable, factor)| match variable {
        Variable::Output(i) => Some((i, factor)),
        _ => None,
    })
}
