//! Names, units and the trajectory's columns become a design.

use std::path::PathBuf;

use super::Settings;
use super::following::{Following, Plant, sections};
use super::settings::InputLimits;
use crate::Error;
use crate::cycle::Return;
use crate::file::{Quantity, Text};
use crate::prepare::Prepared;
use crate::task::{Signal, Task, seconds};
use airloop_ocp::control::controller::Row;
use airloop_ocp::control::nominal::Knots;
use airloop_ocp::control::{Controller, Design, Leg, Measured, Monodromy, Nominal, Sampled, Turn, design};
use airloop_ocp::transcription::Point;
use airloop_series::{Interpolation, TimeSeries};

/// A plan to be stabilized.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// States and inputs by name.
    pub trajectory: &'a TimeSeries,
    /// Its file, for messages.
    pub file: &'a PathBuf,
    /// Inputs between the rows.
    pub interpolation: Interpolation,
}

/// A plan with its controller.
#[derive(Debug, Clone)]
pub struct Stabilized {
    /// The controller.
    pub controller: Controller,
    /// Its rows at the samples of `nominal`; of a plan that repeats itself up to where it begins again.
    pub rows: Vec<Row>,
    /// The trajectory on the samples.
    pub nominal: Nominal,
    /// Requirements on the design, with defaults filled in.
    pub design: Design,
    /// Names of the states, then of the disturbances, `[n]`.
    pub states: Vec<String>,
    /// Inputs, by index into the catalog.
    pub inputs: Vec<usize>,
    /// Measured signals, by index into the catalog.
    pub measured: Vec<usize>,
    /// Component and output that tell the phase.
    pub mode: Option<(usize, usize)>,
    /// Multipliers of a plan that repeats itself.
    pub repeated: Option<Repeated>,
    /// Choices made for the user, one sentence each.
    pub notes: Vec<String>,
}

/// A plan that repeats itself.
#[derive(Debug, Clone)]
pub struct Repeated {
    /// Turns that `nominal` covers.
    pub turns: usize,
    /// Under its own inputs.
    pub open_loop: Monodromy,
    /// Under the regulator.
    pub closed_loop: Monodromy,
    /// Turns after which the gains repeat themselves.
    pub turns_to_periodic_gains: usize,
}

/// Turns of a cycle where the settings say nothing.
const TURNS: u32 = 20;

/// Designs a controller for a plan.
///
/// # Errors
/// Unknown names and units with their place, columns that the trajectory lacks, phases without a table `[phases]`, or
/// what [`airloop_ocp::control`] says.
pub fn stabilize(prepared: &mut Prepared, plan: Plan<'_>, settings: &Settings) -> Result<Stabilized, Error> {
    let place = |problem: String| Error::Place { place: plan.file.display().to_string(), problem };
    let Prepared { setup: prepared, dynamics, resets, cycle } = prepared;
    let source = &settings.source;
    let signals = &prepared.task.signals;
    let catalog = &prepared.catalog;
    let mut notes = Vec::new();
    let sample_time = match (&settings.sample_time, &prepared.sampling) {
        (Some(time), _) => seconds(source, time)?,
        (None, Some(sampling)) => sampling.sample_time,
        (None, None) => {
            let problem = "nothing in the system is sampled; give `sample_time`, such as \"1 ms\"";
            return Err(source.error_at(crate::file::Place(0), problem));
        }
    };
    let columns = |list: &[usize]| -> Result<Vec<&[f64]>, Error> {
        let column = |&index: &usize| {
            let name = &catalog.variables()[index].name;
            let channel = plan.trajectory.channel(name);
            channel.map(|channel| channel.values.as_slice()).ok_or_else(|| {
                place(format!(
                    "there is no column `{name}`; a trajectory has all states and inputs of its problem"
                ))
            })
        };
        list.iter().map(column).collect()
    };
    let rows = |columns: Vec<&[f64]>| -> Vec<Vec<f64>> {
        (0..plan.trajectory.len()).map(|row| columns.iter().map(|column| column[row]).collect()).collect()
    };
    let (states, inputs) = (rows(columns(&signals.states)?), rows(columns(&signals.inputs)?));
    if states.is_empty() {
        return Err(place("the trajectory has no rows".into()));
    }
    let (time, sampled) = (plan.trajectory.time(), &prepared.sampled_states[..]);
    let sections = sections(plan, dynamics.len())?;
    let mut legs = Vec::new();
    for (own, (rows, phase)) in dynamics.iter_mut().zip(sections.into_iter().zip(&prepared.task.phases)) {
        let (time, states, inputs) = (&time[rows.clone()], &states[rows.clone()], &inputs[rows]);
        let at = Point { time: time[0], states: &states[0], inputs: &inputs[0] };
        let plant = Sampled::new(own.as_mut(), sampled, sample_time, 1, at)?;
        legs.push(Leg {
            plant,
            knots: Knots { time, states, inputs, interpolation: plan.interpolation },
            name: &phase.name,
        });
    }
    let mut plant = Plant::new(legs, cycle.is_some())?;
    let mut nominal = plant.nominal().clone();
    if !nominal.rests && cycle.is_none() {
        notes.push(
            "the plan does not end at rest: after its end the last state is aimed at, which no input holds"
                .into(),
        );
    }

    let lookup = |name: &Text| catalog.want(source, name);
    let value = |(name, quantity): &(Text, Quantity)| -> Result<(usize, f64), Error> {
        let found = lookup(name)?;
        Ok((found.0, catalog.value(source, quantity, found)?))
    };
    let not_negative = |name: &Text, value: f64, zero: bool| {
        if value > 0.0 || zero && value == 0.0 {
            return Ok(());
        }
        let allowed = if zero { "zero or a positive number" } else { "a positive number" };
        Err(source.error_at(name.place, format!("`{}` is {value} here; give {allowed}", name.text)))
    };
    let (mut measured, mut indices, mut noise) = (Vec::new(), Vec::new(), Vec::new());
    for sensor in &settings.sensors {
        let (index, deviation) = value(sensor)?;
        not_negative(&sensor.0, deviation, false)?;
        measured.push(match signals.of(index) {
            Some(Signal::State(i)) => Measured::State(i),
            Some(Signal::Output(i)) => Measured::Output(i),
            _ => {
                let problem = format!(
                    "`{}` is neither a state nor an output that the problem names; measure one of those",
                    sensor.0.text
                );
                return Err(source.error_at(sensor.0.place, problem));
            }
        });
        indices.push(index);
        noise.push(deviation);
    }
    let mut limits = Vec::new();
    for &input in &signals.inputs {
        let name = &catalog.variables()[input].name;
        let own = settings
            .limits
            .iter()
            .find(|(text, _)| catalog.find(&text.text).is_some_and(|(i, _)| i == input));
        limits.push(match own {
            Some((name, InputLimits { min, max })) => {
                let found = lookup(name)?;
                (catalog.value(source, min, found)?, catalog.value(source, max, found)?)
            }
            None => planned_limits(&prepared.task, input),
        });
        if limits[limits.len() - 1] == (f64::NEG_INFINITY, f64::INFINITY) {
            notes.push(format!("`{name}` has no limits; give them in [limits] if it has"));
        }
    }
    let mut wanted = Design::of(&nominal, measured, noise, limits);
    let turn = cycle.as_ref().map(|cycle| {
        let Return { states, inputs, free, .. } = cycle;
        let count = settings.phases.as_ref().and_then(|own| own.turns).unwrap_or(TURNS) as usize;
        Turn { states: states.clone(), inputs: inputs.clone(), free: free.clone(), count }
    });
    turn.iter().for_each(|turn| turn.share(&mut wanted));
    let put =
        |entries: &[(Text, Quantity)], zero: bool, states: &mut Vec<f64>, inputs: Option<&mut Vec<f64>>| {
            let mut inputs = inputs;
            for entry in entries {
                let (index, value) = value(entry)?;
                not_negative(&entry.0, value, zero)?;
                match (signals.of(index), &mut inputs) {
                    (Some(Signal::State(i)), _) => states[i] = value,
                    (Some(Signal::Input(i)), Some(inputs)) => inputs[i] = value,
                    _ => {
                        let problem = format!(
                            "`{}` is not a state{} of the plan",
                            entry.0.text,
                            if inputs.is_some() { " or input" } else { "" }
                        );
                        return Err(source.error_at(entry.0.place, problem));
                    }
                }
            }
            Ok(())
        };
    put(&settings.deviation, false, &mut wanted.state_deviation, Some(&mut wanted.input_deviation))?;
    put(&settings.drift, true, &mut wanted.state_drift, Some(&mut wanted.input_drift))?;
    put(&settings.initial, true, &mut wanted.initial, None)?;
    let mut repeated = None;
    let (controller, rows, mode) = match &mut plant {
        Plant::One(leg, nominal) => {
            let controller = design(&mut leg.plant, nominal, &wanted)?;
            let rows = controller.rows.clone();
            (controller, rows, None)
        }
        Plant::Several(phases) => {
            let Following { how, events, mode } = Following::of(prepared, settings, resets, cycle.as_ref())?;
            let (controller, rows) = match turn {
                None => phases.design(events, &how, &wanted)?,
                Some(turn) => {
                    let made = phases.design_cycle(events, &how, &wanted, &turn)?;
                    repeated = Some(Repeated {
                        turns: turn.count,
                        open_loop: made.open_loop,
                        closed_loop: made.closed_loop,
                        turns_to_periodic_gains: made.turns_to_periodic_gains,
                    });
                    nominal = phases.nominal.clone();
                    (made.controller, made.rows)
                }
            };
            (controller, rows, mode)
        }
    };
    let name = |&index: &usize| catalog.variables()[index].name.clone();
    let disturbed = signals.inputs.iter().zip(&wanted.input_drift).filter(|(_, drift)| **drift > 0.0);
    let disturbances = disturbed.map(|(index, _)| format!("disturbance of {}", name(index)));
    let states = signals.states.iter().map(name).chain(disturbances).collect();
    Ok(Stabilized {
        controller,
        rows,
        nominal,
        design: wanted,
        states,
        inputs: signals.inputs.clone(),
        measured: indices,
        mode,
        repeated,
        notes,
    })
}

/// Limits that the problem sets on an input along the whole way.
fn planned_limits(task: &Task, input: usize) -> (f64, f64) {
    let signal = task.signals.of(input);
    let own = task.phases[0]
        .path
        .iter()
        .filter(|path| signal.is_some_and(|signal| path.limit.terms == [(signal, 1.0)]));
    own.fold((f64::NEG_INFINITY, f64::INFINITY), |(low, high), path| {
        (low.max(path.limit.limits.0), high.min(path.limit.limits.1))
    })
}
