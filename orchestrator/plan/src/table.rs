//! A trajectory as tables: the plan at its knots, and the command.

use super::Error;
use super::prepare::Prepared;
use super::record::SignalRecord;
use super::task::Signal;
use super::verify::Command;
use airloop_ocp::transcription::{Interpolation, IntervalErrors, PhaseTrajectory, Point, Trajectory};
use airloop_optim::EvaluationError;
use airloop_series::TimeSeries;

/// Delay \[s\] of the first row of a phase: a table has one row per time.
const FIRST_ROW_DELAY: f64 = 1e-9;

/// Row of a table: interval, part of it.
fn rows(phase: &PhaseTrajectory) -> Vec<(usize, f64)> {
    let n = phase.intervals();
    let halves = phase.interpolation == Interpolation::Quadratic;
    let of = |k: usize| {
        let middle = halves.then_some((k, 0.5));
        [Some((k, 0.0)), middle].into_iter().flatten()
    };
    (0..n).flat_map(of).chain([(n - 1, 1.0)]).collect()
}

/// The plan: states, inputs, outputs and costates at the knots; with quadratic inputs also in the middle of the
/// intervals. Held inputs and costates stand where their interval begins, the last row repeats them. Several phases
/// have a column `phase`, and later ones begin 1 ns late.
///
/// # Errors
/// [`Error`] when an output cannot be evaluated.
pub fn trajectory(prepared: &Prepared, plan: &Trajectory) -> Result<TimeSeries, Error> {
    let signals = records(prepared, plan);
    let mut time = Vec::new();
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); signals.len()];
    for (number, phase) in plan.phases.iter().enumerate() {
        let outputs = outputs(prepared, number, phase)?;
        for (row, (k, s)) in rows(phase).into_iter().enumerate() {
            let (a, b) = (phase.times[k], phase.times[k + 1]);
            let at = if s == 1.0 { b } else { a + s * (b - a) };
            time.push(if number > 0 && row == 0 { at + FIRST_ROW_DELAY } else { at });
            let states = match s {
                0.0 => phase.states[k].clone(),
                1.0 => phase.states[k + 1].clone(),
                s => phase.states_in(k, s),
            };
            let inputs = phase.inputs_in(k, s);
            let costates = phase.costates.get(k).cloned().unwrap_or_default();
            let number = (plan.phases.len() > 1).then_some(number as f64 + 1.0);
            let values =
                states.into_iter().chain(inputs).chain(outputs[row].clone()).chain(costates).chain(number);
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        }
    }
    let mut series = TimeSeries::new(time)?;
    for (signal, values) in signals.into_iter().zip(columns) {
        series.push(signal.name, signal.unit, values)?;
    }
    Ok(series)
}

/// Outputs in the rows of a phase.
fn outputs(
    prepared: &Prepared,
    number: usize,
    phase: &PhaseTrajectory,
) -> Result<Vec<Vec<f64>>, EvaluationError> {
    let rows = rows(phase);
    if prepared.task.signals.outputs.is_empty() {
        return Ok(vec![Vec::new(); rows.len()]);
    }
    let mut dynamics = prepared.dynamics[number].duplicate()?;
    let size = dynamics.size();
    let mut values = vec![0.0; size.values()];
    let mut all = Vec::with_capacity(rows.len());
    for (k, s) in rows {
        let time = phase.times[k] + s * (phase.times[k + 1] - phase.times[k]);
        let (states, inputs) = (phase.states_in(k, s), phase.inputs_in(k, s));
        dynamics.evaluate(Point { time, states: &states, inputs: &inputs }, &mut values)?;
        all.push(values[size.states..].to_vec());
    }
    Ok(all)
}

/// The columns of [`trajectory`], with the bounds that hold everywhere.
pub fn records(prepared: &Prepared, plan: &Trajectory) -> Vec<SignalRecord> {
    let (signals, variables) = (&prepared.task.signals, prepared.catalog.variables());
    let held = plan.phases.iter().any(|phase| phase.interpolation == Interpolation::Held);
    let bound = |signal: Signal, upper: bool| {
        let of_phase = |phase: &super::task::TaskPhase| {
            let own = phase.path.iter().filter(|path| path.limit.terms == [(signal, 1.0)]);
            let ends = own.map(|path| if upper { path.limit.limits.1 } else { path.limit.limits.0 });
            ends.filter(|end| end.is_finite()).reduce(if upper { f64::min } else { f64::max })
        };
        let ends: Option<Vec<f64>> = prepared.task.phases.iter().map(of_phase).collect();
        // The widest over the phases, where all have one.
        ends?.into_iter().reduce(if upper { f64::max } else { f64::min })
    };
    let record = |(signal, index): (Signal, usize), kind: &str| SignalRecord {
        name: variables[index].name.clone(),
        kind: kind.into(),
        unit: variables[index].unit.clone(),
        min: bound(signal, false),
        max: bound(signal, true),
        held: held && kind == "input",
    };
    let of = |list: &[usize], make: fn(usize) -> Signal| -> Vec<(Signal, usize)> {
        list.iter().enumerate().map(|(position, index)| (make(position), *index)).collect()
    };
    let states = of(&signals.states, Signal::State).into_iter().map(|one| record(one, "state"));
    let inputs = of(&signals.inputs, Signal::Input).into_iter().map(|one| record(one, "input"));
    let outputs = of(&signals.outputs, Signal::Output).into_iter().map(|one| record(one, "output"));
    let with_costates = plan.phases.iter().all(|phase| !phase.costates.is_empty());
    let costates = signals.states.iter().filter(|_| with_costates).map(|&index| SignalRecord {
        name: format!("costate.{}", variables[index].name),
        kind: "multiplier".into(),
        unit: None,
        min: None,
        max: None,
        held: true,
    });
    let phase = (plan.phases.len() > 1).then(|| SignalRecord {
        name: "phase".into(),
        kind: "phase".into(),
        unit: None,
        min: None,
        max: None,
        held: true,
    });
    states.chain(inputs).chain(outputs).chain(costates).chain(phase).collect()
}

/// Knots of the whole motion, and (phase, interval) of what lies between them.
pub struct Knots {
    /// Times \[s\].
    pub times: Vec<f64>,
    /// Phase and interval between a knot and the next.
    pub intervals: Vec<(usize, usize)>,
}

/// The knots of a plan.
pub fn knots(plan: &Trajectory) -> Knots {
    let mut knots = Knots { times: vec![plan.phases[0].begin()], intervals: Vec::new() };
    for (number, phase) in plan.phases.iter().enumerate() {
        knots.times.extend(&phase.times[1..]);
        knots.intervals.extend((0..phase.intervals()).map(|k| (number, k)));
    }
    knots
}

/// Estimated error of every state over every interval, in units of the state, in the row of the time at which the
/// interval begins; then, as `relative`, the largest of them relative to the size of its state.
///
/// # Errors
/// [`Error::Series`] when times repeat.
pub fn defects(
    prepared: &Prepared,
    plan: &Trajectory,
    errors: &[IntervalErrors],
) -> Result<TimeSeries, Error> {
    let times = plan.phases.iter().flat_map(|phase| &phase.times[..phase.intervals()]).copied().collect();
    let mut series = TimeSeries::new(times)?;
    let of = |state: usize| {
        errors.iter().flat_map(|phase| phase.absolute.iter().map(move |row| row[state])).collect::<Vec<f64>>()
    };
    for (state, &index) in prepared.task.signals.states.iter().enumerate() {
        let variable = &prepared.catalog.variables()[index];
        series.push(variable.name.clone(), variable.unit.clone(), of(state))?;
    }
    let relative = errors.iter().flat_map(|phase| phase.relative.iter().copied()).collect();
    series.push("relative", None, relative)?;
    Ok(series)
}

/// Calls `then` with the command of a plan.
pub fn with_command<T>(prepared: &Prepared, plan: &Trajectory, then: impl FnOnce(&Command) -> T) -> T {
    let knots = knots(plan);
    let values = |interval: usize, time: f64| {
        let (number, k) = knots.intervals[interval];
        let phase = &plan.phases[number];
        let (a, b) = (phase.times[k], phase.times[k + 1]);
        phase.inputs_in(k, ((time - a) / (b - a)).clamp(0.0, 1.0))
    };
    let held = plan.phases.iter().all(|phase| phase.interpolation == Interpolation::Held);
    then(&Command { inputs: &prepared.task.signals.inputs, knots: &knots.times, values: &values, held })
}
