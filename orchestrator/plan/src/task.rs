//! A problem with every name looked up and every number in the unit of its variable.

use super::Error;
use super::catalog::{Catalog, Kind};
use super::file::phase::{Bound, Condition, Cost, Duration, FreeDuration, Of, Phase, Range, Rate, Where};
use super::file::{Entries, Place, Placed, Quantity, Source, Statement, Text};

/// A variable of the task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Signal {
    /// Index of a state.
    State(usize),
    /// Index of an input.
    Input(usize),
    /// Index of an output.
    Output(usize),
}

/// States, inputs and outputs of a task, by index into the [`Catalog`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Signals {
    /// States, `[n_x]`.
    pub states: Vec<usize>,
    /// Inputs, `[n_u]`.
    pub inputs: Vec<usize>,
    /// Outputs, `[n_g]`.
    pub outputs: Vec<usize>,
}

impl Signals {
    /// The signal of a variable of the catalog, if it is one of the task.
    pub fn of(&self, variable: usize) -> Option<Signal> {
        let at = |list: &[usize]| list.iter().position(|one| *one == variable);
        let state = at(&self.states).map(Signal::State);
        state
            .or_else(|| at(&self.inputs).map(Signal::Input))
            .or_else(|| at(&self.outputs).map(Signal::Output))
    }
}

/// Smallest and largest value; infinite where there is none, equal where the value is fixed.
pub type Limits = (f64, f64);

/// `lower <= sum of factor * signal <= upper`.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// Name for messages.
    pub name: String,
    /// Unit for messages.
    pub unit: Option<String>,
    /// Signals with factors.
    pub terms: Vec<(Signal, f64)>,
    /// Range.
    pub limits: Limits,
}

/// A limit along the way.
#[derive(Debug, Clone, PartialEq)]
pub struct PathLimit {
    /// Limit that holds.
    pub limit: Limit,
    /// Part of the phase.
    pub at: Where,
    /// Part of the phase, 0 to 1.
    pub during: (f64, f64),
    /// Amount by which it is stricter at the points of the mesh.
    pub margin: f64,
}

impl PathLimit {
    /// Limit at the points of the mesh, margin included.
    pub fn with_margin(&self) -> Limit {
        let (lower, upper) = self.limit.limits;
        Limit { limits: (lower + self.margin, upper - self.margin), ..self.limit.clone() }
    }
}

/// A term of the cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Term {
    /// `weight * integral of (signal - reference)^2`.
    Integral {
        /// Signal.
        signal: Signal,
        /// Reference in its unit.
        reference: f64,
        /// Weight.
        weight: f64,
    },
    /// `weight * (signal - reference)^2` at the end.
    Final {
        /// Signal.
        signal: Signal,
        /// Reference in its unit.
        reference: f64,
        /// Weight.
        weight: f64,
    },
    /// `weight * duration`.
    Duration {
        /// Weight \[1/s\].
        weight: f64,
    },
}

/// A phase in numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct TaskPhase {
    /// Name.
    pub name: String,
    /// Shortest and longest duration \[s\].
    pub duration: Limits,
    /// Duration \[s\] to start from.
    pub duration_guess: f64,
    /// Intervals, where the phase has its own number.
    pub intervals: Option<usize>,
    /// Limits of every state at the start, `[n_x]`.
    pub initial: Vec<Limits>,
    /// Limits of every state at the end, `[n_x]`.
    pub terminal: Vec<Limits>,
    /// Limits of outputs and inputs at the start and the end.
    pub ends: [Vec<Limit>; 2],
    /// Limits along the way.
    pub path: Vec<PathLimit>,
    /// Limits of the rates of inputs: input, range \[unit/s\].
    pub rates: Vec<(usize, Limits)>,
    /// Cost.
    pub cost: Vec<Term>,
}

/// A problem in numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// States, inputs and outputs.
    pub signals: Signals,
    /// Phases.
    pub phases: Vec<TaskPhase>,
    /// Assumptions, one sentence each.
    pub notes: Vec<String>,
}

const NO_LIMITS: Limits = (f64::NEG_INFINITY, f64::INFINITY);

/// The variables that a statement refers to which are neither state nor input, as indices into the catalog.
///
/// # Errors
/// [`Error::File`] for a name that is not known.
pub fn outputs(statement: &Statement, catalog: &Catalog) -> Result<Vec<usize>, Error> {
    let mut found = Vec::new();
    for name in names(statement) {
        let (index, _) = catalog.want(&statement.source, name)?;
        if catalog.variables()[index].kind == Kind::Output && !found.contains(&index) {
            found.push(index);
        }
    }
    Ok(found)
}

/// The inputs that are to be found: those listed, else those with a bound, a rate or a cost.
///
/// # Errors
/// [`Error::File`] when there is none, or a name is not an input.
pub fn inputs(statement: &Statement, catalog: &Catalog) -> Result<Vec<usize>, Error> {
    let source = &statement.source;
    let mut found = Vec::new();
    let listed: Vec<&Text> = match &statement.inputs {
        Some(inputs) => inputs.iter().collect(),
        None => names(statement).collect(),
    };
    for name in listed {
        let (index, _) = catalog.want(source, name)?;
        let variable = &catalog.variables()[index];
        if variable.kind != Kind::Input && statement.inputs.is_some() {
            let problem = format!("`{}` is not an input of the system", name.text);
            return Err(source.error_at(name.place, problem));
        }
        if variable.kind == Kind::Input && !found.contains(&index) {
            found.push(index);
        }
    }
    if found.is_empty() {
        let known = catalog.variables().iter().filter(|one| one.kind == Kind::Input);
        let known: Vec<&str> = known.map(|one| one.name.as_str()).collect();
        let problem = format!(
            "there is nothing to find: name inputs of the system in `inputs`, a bound or a cost; it has: {}",
            known.join(", ")
        );
        return Err(source.error_at(statement.system.place, problem));
    }
    Ok(found)
}

/// All names of conditions, bounds, rates and costs.
fn names(statement: &Statement) -> impl Iterator<Item = &Text> {
    statement.phases.iter().flat_map(|phase| {
        let ends = phase.initial.iter().chain(&phase.terminal).map(|(name, _)| name);
        let bounds = phase.limits().flat_map(|bound| bound.terms.iter().map(|(name, _)| name));
        let rates = phase.rates.iter().map(|(name, _)| name);
        let costs = phase.costs.iter().filter_map(|cost| match &cost.of {
            Of::Integral(name, _) | Of::Final(name, _) => Some(name),
            Of::Duration => None,
        });
        ends.chain(bounds).chain(rates).chain(costs)
    })
}

/// Looks names up and converts units.
///
/// # Errors
/// [`Error::File`] names line, column, value and remedy.
pub fn task(statement: &Statement, catalog: &Catalog, signals: Signals) -> Result<Task, Error> {
    let reader = Reader { source: &statement.source, catalog, signals: &signals };
    let mut notes = Vec::new();
    let mut phases = Vec::new();
    for (number, phase) in statement.phases.iter().enumerate() {
        let begins = number == 0 && statement.cycle.is_none();
        phases.push(reader.phase(phase, begins, &mut notes)?);
    }
    if phases.iter().all(|phase: &TaskPhase| phase.cost.is_empty()) {
        notes.push("there is no cost: any motion that keeps the constraints is a solution".into());
    }
    Ok(Task { signals, phases, notes })
}

/// Looks names up for the signals of a task.
pub(super) struct Reader<'a> {
    pub source: &'a Source,
    pub catalog: &'a Catalog,
    pub signals: &'a Signals,
}

impl Reader<'_> {
    /// `begins`: before it the system stands as it starts.
    fn phase(&self, phase: &Phase, begins: bool, notes: &mut Vec<String>) -> Result<TaskPhase, Error> {
        let (duration, duration_guess) = self.duration(&phase.duration)?;
        let n = self.signals.states.len();
        let (mut initial, mut terminal) = (vec![NO_LIMITS; n], vec![NO_LIMITS; n]);
        if begins {
            self.start_values(&mut initial, &phase.initial, notes)?;
        }
        let ends = [self.ends(&phase.initial, &mut initial)?, self.ends(&phase.terminal, &mut terminal)?];
        let path = phase.limits().map(|bound| self.bound(bound)).collect::<Result<_, Error>>()?;
        let rates =
            phase.rates.iter().map(|(name, rate)| self.rate(name, rate)).collect::<Result<_, Error>>()?;
        let cost = phase.costs.iter().map(|cost| self.cost(cost)).collect::<Result<_, Error>>()?;
        Ok(TaskPhase {
            name: phase.name.clone(),
            duration,
            duration_guess,
            intervals: phase.intervals,
            initial,
            terminal,
            ends,
            path,
            rates,
            cost,
        })
    }

    /// States that the first phase does not name begin at the start values of the system.
    fn start_values(
        &self,
        initial: &mut [Limits],
        named: &Entries<Condition>,
        notes: &mut Vec<String>,
    ) -> Result<(), Error> {
        let mut assumed = Vec::new();
        for (limits, &index) in initial.iter_mut().zip(&self.signals.states) {
            let variable = &self.catalog.variables()[index];
            let said =
                named.iter().any(|(name, _)| self.catalog.find(&name.text).map(|f| f.0) == Some(index));
            if let Some(start) = variable.start.filter(|_| !said) {
                *limits = (start, start);
                assumed.push(format!("{} = {start}", variable.name));
            }
        }
        if !assumed.is_empty() {
            notes.push(format!("initial states from the start values of the system: {}", assumed.join(", ")));
        }
        Ok(())
    }

    fn seconds(&self, quantity: &Quantity) -> Result<f64, Error> {
        seconds(self.source, quantity)
    }

    fn duration(&self, duration: &Duration) -> Result<(Limits, f64), Error> {
        match duration {
            Duration::Quantity(time) => {
                let seconds = positive(self.source, self.seconds(time)?, time.place, "duration")?;
                Ok(((seconds, seconds), seconds))
            }
            Duration::Table(FreeDuration { min, max, guess }) => {
                let low = positive(self.source, self.seconds(min)?, min.place, "duration")?;
                let (high, from) = (self.seconds(max)?, self.seconds(guess)?);
                if high < low {
                    let problem = format!("the longest duration {high} s is below the shortest, {low} s");
                    return Err(self.source.error_at(max.place, problem));
                }
                if !(low..=high).contains(&from) {
                    let problem = format!("the guess {from} s is not within {low} s .. {high} s");
                    return Err(self.source.error_at(guess.place, problem));
                }
                Ok(((low, high), from))
            }
        }
    }

    /// A named variable of the task.
    pub fn signal(
        &self,
        name: &Text,
    ) -> Result<(Signal, (usize, airloop_cosim::system::graph::Conversion)), Error> {
        let found = self.catalog.want(self.source, name)?;
        match self.signals.of(found.0) {
            Some(signal) => Ok((signal, found)),
            None => {
                let kind = match self.catalog.variables()[found.0].kind {
                    Kind::Input => "an input that `inputs` does not list",
                    Kind::State => "a state that does not move, or that `states` does not list",
                    Kind::Output => "no variable that can be read during the motion",
                };
                Err(self.source.error_at(name.place, format!("`{}` is {kind}", name.text)))
            }
        }
    }

    fn limits(&self, name: &Text, range: &Range, place: Place) -> Result<(Signal, usize, Limits), Error> {
        let (signal, found) = self.signal(name)?;
        let value = |quantity: &Option<Quantity>, none: f64| match quantity {
            Some(quantity) => self.catalog.value(self.source, quantity, found),
            None => Ok(none),
        };
        let limits = (value(&range.min, NO_LIMITS.0)?, value(&range.max, NO_LIMITS.1)?);
        if limits.0 > limits.1 {
            let unit = self.catalog.variables()[found.0].unit.as_deref().unwrap_or("");
            let problem = format!(
                "`{}`: the lower bound {} {unit} lies above the upper bound {} {unit}",
                name.text, limits.0, limits.1
            );
            return Err(self.source.error_at(place, problem.replace(" ,", ",")));
        }
        Ok((signal, found.0, limits))
    }

    fn ends(&self, conditions: &Entries<Condition>, states: &mut [Limits]) -> Result<Vec<Limit>, Error> {
        let mut others = Vec::new();
        for (variable, condition) in conditions {
            let range = &condition.range();
            let (signal, index, limits) = self.limits(variable, range, variable.place)?;
            let own = &self.catalog.variables()[index];
            match signal {
                Signal::State(state) => states[state] = limits,
                _ => others.push(Limit {
                    name: own.name.clone(),
                    unit: own.unit.clone(),
                    terms: vec![(signal, 1.0)],
                    limits,
                }),
            }
        }
        Ok(others)
    }

    pub fn bound(&self, bound: &Placed<Bound>) -> Result<PathLimit, Error> {
        let (first, _) = &bound.terms[0];
        let (signal, index, limits) = self.limits(first, &bound.range(), bound.place)?;
        let mut terms = Vec::new();
        for (name, factor) in &bound.terms {
            terms.push((self.signal(name)?.0, *factor));
        }
        let by_kind = match signal {
            Signal::Input(_) if bound.terms.len() == 1 => Where::Everywhere,
            _ => Where::Nodes,
        };
        let own = &self.catalog.variables()[index];
        if limits.0 + bound.margin > limits.1 - bound.margin {
            let problem = format!(
                "`{}`: the margin {} leaves nothing between {} and {}",
                bound.name.as_ref().unwrap_or(&own.name),
                bound.margin,
                limits.0,
                limits.1
            );
            return Err(self.source.error_at(bound.place, problem));
        }
        Ok(PathLimit {
            limit: Limit {
                name: bound.name.clone().unwrap_or_else(|| own.name.clone()),
                unit: own.unit.clone(),
                terms,
                limits,
            },
            at: bound.at.unwrap_or(by_kind),
            during: bound.during.into(),
            margin: bound.margin,
        })
    }

    fn rate(&self, name: &Text, rate: &Rate) -> Result<(usize, Limits), Error> {
        let per_second = |quantity: &Option<Quantity>| -> Option<Quantity> {
            let mut quantity = quantity.clone()?;
            if let Some(unit) = &mut quantity.unit {
                *unit = unit.strip_suffix("/s").map(str::trim).unwrap_or(unit).to_owned();
            }
            Some(quantity)
        };
        let range = rate.range();
        for quantity in [&range.min, &range.max].into_iter().flatten() {
            if quantity.unit.as_ref().is_some_and(|unit| !unit.ends_with("/s")) {
                let problem = format!(
                    "a rate is per second: write {} {}/s",
                    quantity.value,
                    quantity.unit.as_deref().unwrap_or("")
                );
                return Err(self.source.error_at(quantity.place, problem));
            }
        }
        let range = Range { min: per_second(&range.min), max: per_second(&range.max) };
        let (signal, _, limits) = self.limits(name, &range, name.place)?;
        match signal {
            Signal::Input(input) => Ok((input, limits)),
            _ => {
                let problem = format!("`{}` is no input; only inputs have rates", name.text);
                Err(self.source.error_at(name.place, problem))
            }
        }
    }

    fn cost(&self, cost: &Cost) -> Result<Term, Error> {
        let weight = cost.weight;
        let found = |name: &Text, reference: &Option<Quantity>| -> Result<(Signal, f64), Error> {
            let (signal, found) = self.signal(name)?;
            let reference = reference.as_ref().map(|value| self.catalog.value(self.source, value, found));
            Ok((signal, reference.transpose()?.unwrap_or(0.0)))
        };
        match &cost.of {
            Of::Integral(name, reference) => {
                let (signal, reference) = found(name, reference)?;
                Ok(Term::Integral { signal, reference, weight })
            }
            Of::Final(name, reference) => {
                let (signal, reference) = found(name, reference)?;
                Ok(Term::Final { signal, reference, weight })
            }
            Of::Duration => Ok(Term::Duration { weight }),
        }
    }
}

/// A time in seconds.
///
/// # Errors
/// [`Error::File`] for a unit that is none of time.
pub fn seconds(source: &Source, quantity: &Quantity) -> Result<f64, Error> {
    let text = format!("{}{}", quantity.value, quantity.unit.as_deref().unwrap_or("s"));
    airloop_series::units::parse_time(&text)
        .map_err(|error| source.error_at(quantity.place, error.to_string()))
}

/// A time that has to be positive.
pub(super) fn positive(source: &Source, seconds: f64, place: Place, what: &str) -> Result<f64, Error> {
    if seconds > 0.0 {
        return Ok(seconds);
    }
    Err(source.error_at(place, format!("the {what} is {seconds} s; it must be longer than 0 s")))
}
