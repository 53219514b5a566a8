//! Obstacle of an infeasible task: the limit without which it can be done, and how far it would have to move.

use std::ops::ControlFlow;

use super::Error;
use super::prepare::Prepared;
use super::solve::{Begin, Monitor, Session, Settings, Solved};
use super::task::{Limits, PathLimit, Signal, Task};
use airloop_ocp::transcription::{Trajectory, Violation};
use airloop_optim::Status;

/// Halvings of the range in which the task becomes possible.
const HALVINGS: usize = 5;
/// Iterations of one trial at most: what can be done is usually done in far fewer.
const ITERATIONS: usize = 200;

/// A limit that is too tight.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// Violation of the limit by the best motion that was found.
    pub violation: Violation,
    /// Largest factor on the limit for which no motion was found, smallest for which one was.
    pub factor: (f64, f64),
    /// That motion.
    pub trajectory: Trajectory,
}

impl std::fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} by the nearest motion that was found (not the one that is written): it needs {:.3} times that limit, and with {:.3} times none was found",
            self.violation, self.factor.1, self.factor.0
        )
    }
}

/// Looks for the limit along the path that makes a task infeasible: first the one that `suspect` (the name of a
/// variable or constraint) speaks of, then the others. None where no single limit does, or the caller ends the search.
///
/// # Errors
/// [`Error::Evaluation`] when no FMU can be instantiated again.
pub fn diagnose(
    prepared: &Prepared,
    settings: &Settings,
    begin: Begin,
    suspect: Option<&str>,
    monitor: &mut Monitor,
) -> Result<Option<Diagnosis>, Error> {
    let last = settings.passes.len() - 1;
    let settings = Settings {
        passes: settings.passes[last..].to_vec(),
        max_iterations: ITERATIONS.min(settings.max_iterations),
        ..settings.clone()
    };
    let mut limits: Vec<(usize, usize)> = Vec::new();
    for (number, phase) in prepared.task.phases.iter().enumerate() {
        limits.extend((0..phase.path.len()).map(|limit| (number, limit)));
    }
    // Names of variables begin with that of the signal, names of constraints with that of the limit.
    let suspected = |&(number, limit): &(usize, usize)| {
        let path = &prepared.task.phases[number].path[limit];
        let of_signal = path.limit.terms.first().map(|(signal, _)| name(prepared, *signal));
        suspect.is_some_and(|suspect| {
            suspect.contains(&format!("{} at ", of_signal.unwrap_or_default()))
                || suspect.contains(&path.limit.name)
        })
    };
    limits.sort_by_key(|limit| !suspected(limit));
    for place in limits {
        let Some(free) = trial(prepared, &settings, place, None, begin, monitor)? else {
            return Ok(None);
        };
        if solved(&free) {
            return narrow(prepared, &settings, place, free, monitor);
        }
    }
    Ok(None)
}

fn solved(found: &Solved) -> bool {
    matches!(found.status(), Status::Solved | Status::Acceptable)
}

fn name(prepared: &Prepared, signal: Signal) -> String {
    let signals = &prepared.task.signals;
    let index = match signal {
        Signal::State(i) => signals.states[i],
        Signal::Input(i) => signals.inputs[i],
        Signal::Output(i) => signals.outputs[i],
    };
    prepared.catalog.variables()[index].name.clone()
}

/// Halves the range of factors between the limit as it is and what the motion without it needs.
fn narrow(
    prepared: &Prepared,
    settings: &Settings,
    place: (usize, usize),
    free: Solved,
    monitor: &mut Monitor,
) -> Result<Option<Diagnosis>, Error> {
    let path = &prepared.task.phases[place.0].path[place.1];
    let Some(worst) = worst(path, place.0, free.trajectory()) else { return Ok(None) };
    let (mut low, mut high, mut found) = (1.0, factor(path.limit.limits, worst.value), (free, worst));
    for _ in 0..HALVINGS {
        if !(high.is_finite() && high > low) {
            break;
        }
        let middle = 0.5 * (low + high);
        let begin = Begin::Along(found.0.trajectory());
        let Some(next) = trial(prepared, settings, place, Some(middle), begin, monitor)? else { break };
        let least = worst_of(path, place.0, &next);
        match least {
            Some(worst) => (high, found) = (middle, (next, worst)),
            None => low = middle,
        }
    }
    let (solved, worst) = found;
    let (lower, upper) = path.limit.limits;
    let phases = &prepared.task.phases;
    let violation = Violation {
        phase: (phases.len() > 1).then(|| phases[place.0].name.clone()),
        name: path.limit.name.clone(),
        expression: path.limit.terms.first().map(|(signal, _)| name(prepared, *signal)).unwrap_or_default(),
        unit: path.limit.unit.clone().unwrap_or_default(),
        lower,
        upper,
        time: worst.time,
        amount: (lower - worst.value).max(worst.value - upper),
    };
    Ok(Some(Diagnosis { violation, factor: (low, high), trajectory: solved.outcome.trajectory }))
}

/// The worst point of a trial that was solved and still breaks the limit.
fn worst_of(path: &PathLimit, phase: usize, trial: &Solved) -> Option<Worst> {
    solved(trial).then(|| worst(path, phase, trial.trajectory())).flatten()
}

/// Factor by which the limits have to be multiplied to admit a value.
fn factor((lower, upper): Limits, value: f64) -> f64 {
    let of =
        |limit: f64| if limit.is_finite() && limit * value > 0.0 { value / limit } else { f64::INFINITY };
    if value > upper { of(upper) } else { of(lower) }
}

/// The task with a limit multiplied by a factor, or without it; none when the caller ends the search.
fn trial(
    prepared: &Prepared,
    settings: &Settings,
    (phase, limit): (usize, usize),
    factor: Option<f64>,
    begin: Begin,
    monitor: &mut Monitor,
) -> Result<Option<Solved>, Error> {
    let mut task: Task = prepared.task.clone();
    match factor {
        Some(factor) => {
            let limits = &mut task.phases[phase].path[limit].limit.limits;
            *limits = (factor * limits.0, factor * limits.1);
        }
        None => drop(task.phases[phase].path.remove(limit)),
    }
    let mut ended = false;
    let mut watch = |progress: &super::solve::Progress| {
        let go = monitor(progress);
        ended |= go == ControlFlow::Break(());
        go
    };
    let mut session = Session::with_task(prepared, &task, settings.threads)?;
    let solved = session.solve(&prepared.setup, settings, begin, &mut watch)?;
    Ok((!ended).then_some(solved))
}

/// A value and its time.
struct Worst {
    value: f64,
    time: f64,
}

/// Largest violation of a limit by a motion, at its knots; none where it keeps it, or the limit is about outputs.
fn worst(path: &PathLimit, phase: usize, motion: &Trajectory) -> Option<Worst> {
    let phase = &motion.phases[phase];
    let (lower, upper) = path.limit.limits;
    let value = |k: usize| -> Option<f64> {
        let of = |(signal, factor): &(Signal, f64)| match *signal {
            Signal::State(i) => Some(factor * phase.states[k][i]),
            Signal::Input(i) => Some(factor * phase.inputs[k][i]),
            Signal::Output(i) => phase.outputs.get(k).map(|outputs| factor * outputs[i]),
        };
        path.limit.terms.iter().map(of).sum()
    };
    let broken = |value: f64| (lower - value).max(value - upper);
    let points =
        (0..phase.times.len()).filter_map(|k| Some(Worst { value: value(k)?, time: phase.times[k] }));
    points
        .filter(|point| broken(point.value) > 0.0)
        .max_by(|a, b| broken(a.value).total_cmp(&broken(b.value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_multiplied_until_it_lets_the_value_in() {
        assert_eq!(factor((-2.0, 2.0), 3.0), 1.5);
        assert_eq!(factor((-2.0, 2.0), -5.0), 2.5);
        assert_eq!(factor((0.0, 1.0), -1.0), f64::INFINITY);
    }
}
