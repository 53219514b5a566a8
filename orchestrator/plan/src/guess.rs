//! Initial guess of the search: a line, trajectories given in the problem file, or an earlier result.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use super::Error;
use super::catalog::{Catalog, Kind};
use super::file::guess::{Guess, Others};
use super::file::{Statement, Text};
use super::task::{Limits, Signal, Task};
use airloop_series::names;
use airloop_series::resample::{locate, value_at};
use airloop_series::{Interpolation, TimeSeries, csv};

/// Choice of the initial guess.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// States on lines between the conditions, inputs zero.
    Linear,
    /// A guess of the problem file, by its position there.
    Named(usize),
    /// A trajectory in a file.
    File(PathBuf),
}

impl Choice {
    /// The name for summaries.
    pub fn name(&self, statement: &Statement) -> String {
        match self {
            Choice::Linear => "linear".into(),
            Choice::Named(index) => statement.guesses[*index].0.text.clone(),
            Choice::File(file) => file.display().to_string(),
        }
    }
}

/// The guess to use: a word of the command line, else that of the settings, else the first of the file, else a
/// line.
///
/// # Errors
/// [`Error`] for a name that is none, with those there are.
pub fn choose(statement: &Statement, word: Option<&str>) -> Result<Choice, Error> {
    let named = |name: &str| statement.guesses.iter().position(|(own, _)| own.text == name);
    let of = |name: &str| match name {
        "linear" => Some(Choice::Linear),
        name if Path::new(name).extension().is_some_and(|ending| ending == "csv") => {
            Some(Choice::File(name.into()))
        }
        name => named(name).map(Choice::Named),
    };
    let unknown = |name: &str| {
        let own = statement.guesses.iter().map(|(own, _)| own.text.as_str());
        let meant = names::suggestion(name, own.chain(["linear"]));
        format!("there is no guess `{name}`; {meant}; an earlier trajectory is a .csv file")
    };
    match (word, &statement.settings.guess) {
        (Some(word), _) => {
            of(word).ok_or_else(|| Error::Place { place: format!("--guess {word}"), problem: unknown(word) })
        }
        (None, Some(Text { text, place })) => match of(text) {
            // Next to the problem file.
            Some(Choice::File(file)) => {
                Ok(Choice::File(statement.source.file.parent().unwrap_or(Path::new("")).join(file)))
            }
            Some(choice) => Ok(choice),
            None => Err(statement.source.error_at(*place, unknown(text))),
        },
        (None, None) if statement.guesses.is_empty() => Ok(Choice::Linear),
        (None, None) => Ok(Choice::Named(0)),
    }
}

/// Knots of a trajectory, beyond which they are not moved one by one.
const MOST_KNOTS: usize = 16;

/// A motion to begin with, over the part 0..1 of all phases together.
#[derive(Debug, Clone)]
pub struct Rough {
    /// Trajectories of the states, `[n_x]`.
    states: Vec<Line>,
    /// Trajectories of the inputs, `[n_u]`.
    inputs: Vec<Line>,
    /// Durations of the phases \[s\].
    pub durations: Vec<f64>,
    /// Assumptions.
    pub notes: Vec<String>,
}

/// A piecewise linear trajectory and sines on top of it.
#[derive(Debug, Clone, Default)]
struct Line {
    /// Parts, increasing; empty for zero.
    at: Vec<f64>,
    values: Vec<f64>,
    held: bool,
    /// Amplitudes of `sin(pi i s)`, i = 1, 2, ...
    sines: Vec<f64>,
}

impl Line {
    fn constant(value: f64) -> Line {
        Line { at: vec![0.0], values: vec![value], ..Line::default() }
    }

    fn value(&self, part: f64) -> f64 {
        let how = if self.held { Interpolation::Hold } else { Interpolation::Linear };
        let line =
            if self.at.is_empty() { 0.0 } else { value_at(&self.values, locate(&self.at, part, 0), how) };
        let sines = self.sines.iter().enumerate();
        line + sines.map(|(i, amplitude)| amplitude * (PI * (i + 1) as f64 * part).sin()).sum::<f64>()
    }
}

impl Rough {
    /// States at a part of the whole motion, `[n_x]`.
    pub fn states(&self, part: f64) -> Vec<f64> {
        self.states.iter().map(|line| line.value(part)).collect()
    }

    /// Inputs at a part of the whole motion, `[n_u]`.
    pub fn inputs(&self, part: f64) -> Vec<f64> {
        self.inputs.iter().map(|line| line.value(part)).collect()
    }

    /// Moves knots and values and adds a motion of what no trajectory names, all drawn from `uniform`, which gives
    /// numbers from -1 to 1: knots between the ends by up to 0.05 of the whole, their values by up to 40 %, sines of up
    /// to 40 % of the room that bounds leave.
    pub fn perturb(&mut self, task: &Task, uniform: &mut dyn FnMut() -> f64) {
        for (state, line) in self.states.iter_mut().enumerate() {
            let inner = 1..line.at.len().saturating_sub(1);
            // A trajectory with many knots is an earlier motion: it is bent as a whole.
            if inner.is_empty() || inner.len() > MOST_KNOTS {
                let room = room(task, state);
                line.sines = (0..3).map(|_| 0.4 * room * uniform()).collect();
                continue;
            }
            for k in inner {
                line.at[k] += 0.05 * uniform();
                line.values[k] *= 1.0 + 0.4 * uniform();
            }
            for k in 1..line.at.len() {
                line.at[k] = line.at[k].max(line.at[k - 1] + 1e-6);
            }
        }
    }
}

/// Half of the range between the bounds of a state along the way; 0 where it has none.
fn room(task: &Task, state: usize) -> f64 {
    let bounds = task.phases.iter().flat_map(|phase| &phase.path);
    let own = bounds.filter(|path| path.limit.terms == [(Signal::State(state), 1.0)]);
    let half =
        own.map(|path| 0.5 * (path.limit.limits.1 - path.limit.limits.0)).fold(f64::INFINITY, f64::min);
    if half.is_finite() { half } else { 0.0 }
}

/// The guess of a choice.
///
/// # Errors
/// [`Error`] for variables that are none, and files that cannot be read or do not fit.
pub fn guess(statement: &Statement, catalog: &Catalog, task: &Task, choice: &Choice) -> Result<Rough, Error> {
    let durations: Vec<f64> = task.phases.iter().map(|phase| phase.duration_guess).collect();
    let linear = linear(task, &durations);
    match choice {
        Choice::Linear => Ok(linear),
        Choice::Named(index) => named(statement, catalog, task, &statement.guesses[*index].1, linear),
        Choice::File(file) => of_file(catalog, task, file, linear),
    }
}

/// The value that a condition suggests, if it does.
fn suggested((lower, upper): Limits) -> Option<f64> {
    match (lower.is_finite(), upper.is_finite()) {
        (true, true) => Some(0.5 * (lower + upper)),
        (true, false) => Some(lower.max(0.0)),
        (false, true) => Some(upper.min(0.0)),
        (false, false) => None,
    }
}

fn linear(task: &Task, durations: &[f64]) -> Rough {
    let total: f64 = durations.iter().sum();
    let state = |index: usize| {
        let mut line = Line::default();
        let mut begin = 0.0;
        for (phase, duration) in task.phases.iter().zip(durations) {
            let end = begin + duration / total;
            for (part, limits) in [(begin, phase.initial[index]), (end, phase.terminal[index])] {
                let Some(value) = suggested(limits) else { continue };
                match line.at.last() {
                    Some(last) if part <= *last => {}
                    _ => {
                        line.at.push(part);
                        line.values.push(value);
                    }
                }
            }
            begin = end;
        }
        line
    };
    let input = |index: usize| {
        let bounds = task.phases.iter().flat_map(|phase| &phase.path);
        let own = bounds.filter(|path| path.limit.terms == [(Signal::Input(index), 1.0)]);
        Line::constant(
            own.fold(0.0, |value: f64, path| value.max(path.limit.limits.0).min(path.limit.limits.1)),
        )
    };
    Rough {
        states: (0..task.signals.states.len()).map(state).collect(),
        inputs: (0..task.signals.inputs.len()).map(input).collect(),
        durations: durations.to_vec(),
        notes: Vec::new(),
    }
}

fn named(
    statement: &Statement,
    catalog: &Catalog,
    task: &Task,
    guess: &Guess,
    linear: Rough,
) -> Result<Rough, Error> {
    let mut rough = linear;
    if guess.others == Others::Zero {
        rough.states.fill(Line::default());
    }
    for (variable, trajectory) in &guess.trajectories {
        let found = catalog.want(&statement.source, variable)?;
        let convert = |value: &f64| match &trajectory.unit {
            Some(unit) => catalog.convert(&statement.source, *value, (unit, variable.place), found.0),
            None => Ok(found.1.inverse().apply(*value)),
        };
        let values = trajectory.value.iter().map(convert).collect::<Result<Vec<f64>, Error>>()?;
        let line = Line { at: trajectory.t.to_vec(), values, ..Line::default() };
        match task.signals.of(found.0) {
            Some(Signal::State(state)) => rough.states[state] = line,
            Some(Signal::Input(input)) => rough.inputs[input] = line,
            _ => {
                let problem = format!("`{}` is no state and no input of the problem", variable.text);
                return Err(statement.source.error_at(variable.place, problem));
            }
        }
    }
    Ok(rough)
}

fn of_file(catalog: &Catalog, task: &Task, file: &Path, linear: Rough) -> Result<Rough, Error> {
    let series = csv::read(file)?;
    let wrong = |problem: String| Error::Place { place: file.display().to_string(), problem };
    let (Some(&first), Some(&last)) = (series.time().first(), series.time().last()) else {
        return Err(wrong("there are no rows; a guess needs at least two".into()));
    };
    let span = last - first;
    if series.len() < 2 {
        return Err(wrong("there is one row; a guess needs at least two".into()));
    }
    let mut rough = linear;
    let total: f64 = rough.durations.iter().sum();
    let fixed = task.phases.iter().all(|phase| phase.duration.0 == phase.duration.1);
    if fixed && (span - total).abs() > 1e-6 * total {
        return Err(wrong(format!(
            "it lasts {span} s, the problem {total} s; give a trajectory of that length, or set `duration`"
        )));
    }
    if let [phase] = &task.phases[..] {
        rough.durations = vec![span.clamp(phase.duration.0, phase.duration.1)];
    }
    let at: Vec<f64> = series.time().iter().map(|t| (t - first) / span).collect();
    let missing = fill(catalog, task, &series, &at, &mut rough).map_err(wrong)?;
    if !missing.is_empty() {
        let note = format!("{} has no column {}: on a line, or zero", file.display(), missing.join(", "));
        rough.notes.push(note);
    }
    Ok(rough)
}

/// Puts the columns of a series into a guess; names of states and inputs that it does not have.
fn fill(
    catalog: &Catalog,
    task: &Task,
    series: &TimeSeries,
    at: &[f64],
    rough: &mut Rough,
) -> Result<Vec<String>, String> {
    let mut found = Vec::new();
    for channel in series.channels() {
        let Some((index, conversion)) = catalog.find(&channel.name) else { continue };
        let values = channel.values.iter().map(|value| conversion.inverse().apply(*value)).collect();
        let line = Line { at: at.to_vec(), values, ..Line::default() };
        match task.signals.of(index) {
            Some(Signal::State(state)) => rough.states[state] = line,
            Some(Signal::Input(input)) => rough.inputs[input] = line,
            _ => continue,
        }
        found.push(index);
    }
    let wanted = task.signals.states.iter().chain(&task.signals.inputs);
    let missing: Vec<String> = wanted
        .filter(|index| !found.contains(index))
        .map(|&index| format!("`{}`", catalog.variables()[index].name))
        .collect();
    if !found.iter().any(|&index| catalog.variables()[index].kind == Kind::State) {
        return Err(format!("it has no column of a state; wanted are {}", missing.join(", ")));
    }
    Ok(missing)
}
