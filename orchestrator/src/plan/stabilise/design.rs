//! Names, units and the trajectory's columns become a design.

use std::path::PathBuf;

use super::Settings;
use crate::control::nominal::Knots;
use crate::control::{Controller, Design, Measured, Nominal, Sampled, design};
use crate::plan::Error;
use crate::plan::file::{Quantity, Text};
use crate::plan::prepare::Prepared;
use crate::plan::task::{Signal, Task, seconds};
use crate::series::{Interpolation, TimeSeries};
use crate::transcription::Point;

/// A plan to be stabilised.
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
pub struct Stabilised {
    /// The controller.
    pub controller: Controller,
    /// The trajectory on the samples.
    pub nominal: Nominal,
    /// What was asked of the design, with its defaults.
    pub design: Design,
    /// Names of the states, then of the disturbances, `[n]`.
    pub states: Vec<String>,
    /// Inputs, by index into the catalogue.
    pub inputs: Vec<usize>,
    /// Measured signals, by index into the catalogue.
    pub measured: Vec<usize>,
    /// What was chosen for the user, one sentence each.
    pub notes: Vec<String>,
}

/// Designs a controller for a plan of one phase.
///
/// # Errors
/// Unknown names and units with their place, columns that the trajectory lacks, or what [`crate::control`] says.
pub fn stabilise(prepared: &mut Prepared, plan: Plan<'_>, settings: &Settings) -> Result<Stabilised, Error> {
    let place = |problem: String| Error::Place { place: plan.file.display().to_string(), problem };
    if prepared.dynamics.len() != 1 {
        let problem = format!("the plan has {} phases; one phase can be stabilised", prepared.dynamics.len());
        return Err(place(problem));
    }
    let Prepared { setup: prepared, dynamics, .. } = prepared;
    let source = &settings.source;
    let signals = &prepared.task.signals;
    let catalogue = &prepared.catalogue;
    let mut notes = Vec::new();
    let sample_time = match (&settings.sample_time, &prepared.sampling) {
        (Some(time), _) => seconds(source, time)?,
        (None, Some(sampling)) => sampling.sample_time,
        (None, None) => {
            let problem = "nothing in the system is sampled; give `sample_time`, such as \"1 ms\"";
            return Err(source.error_at(crate::plan::file::Place { line: 1, column: 1 }, problem));
        }
    };
    let columns = |list: &[usize]| -> Result<Vec<&[f64]>, Error> {
        let column = |&index: &usize| {
            let name = &catalogue.variables()[index].name;
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
    let (Some(first), Some(command)) = (states.first(), inputs.first()) else {
        return Err(place("the trajectory has no rows".into()));
    };
    let time = plan.trajectory.time();
    let at = Point { time: time[0], states: first, inputs: command };
    let mut plant = Sampled::new(dynamics[0].as_mut(), &prepared.sampled_states, sample_time, 1, at)?;
    let knots = Knots { time, states: &states, inputs: &inputs, interpolation: plan.interpolation };
    let nominal = Nominal::new(&mut plant, &knots)?;
    if !nominal.rests {
        notes.push(
            "the plan does not end at rest: after its end the last state is aimed at, which no input holds"
                .into(),
        );
    }

    let lookup = |name: &Text| catalogue.want(source, name);
    let value = |(name, quantity): &(Text, Quantity)| -> Result<(usize, f64), Error> {
        let found = lookup(name)?;
        Ok((found.0, catalogue.value(source, quantity, found)?))
    };
    let (mut measured, mut indices, mut noise) = (Vec::new(), Vec::new(), Vec::new());
    for sensor in &settings.sensors {
        let (index, deviation) = value(sensor)?;
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
        let name = &catalogue.variables()[input].name;
        let own = settings
            .limits
            .iter()
            .find(|(text, _)| catalogue.find(&text.text).is_some_and(|(i, _)| i == input));
        limits.push(match own {
            Some((name, [low, high])) => {
                let found = lookup(name)?;
                (catalogue.value(source, low, found)?, catalogue.value(source, high, found)?)
            }
            None => planned_limits(&prepared.task, input),
        });
        if limits[limits.len() - 1] == (f64::NEG_INFINITY, f64::INFINITY) {
            notes.push(format!("`{name}` has no limits; give them in [limits] if it has"));
        }
    }
    let mut wanted = Design::of(&nominal, measured, noise, limits);
    let put = |entries: &[(Text, Quantity)], states: &mut Vec<f64>, inputs: Option<&mut Vec<f64>>| {
        let mut inputs = inputs;
        for entry in entries {
            let (index, value) = value(entry)?;
            match (signals.of(index), &mut inputs) {
                (Some(Signal::State(i)), _) => states[i] = value,
                (Some(Signal::Input(i)), Some(inputs)) => inputs[i] = value,
                _ => {
                    let problem = format!(
                        "`{}` is no state{} of the plan",
                        entry.0.text,
                        if inputs.is_some() { " or input" } else { "" }
                    );
                    return Err(source.error_at(entry.0.place, problem));
                }
            }
        }
        Ok(())
    };
    put(&settings.deviation, &mut wanted.state_deviation, Some(&mut wanted.input_deviation))?;
    put(&settings.drift, &mut wanted.state_drift, Some(&mut wanted.input_drift))?;
    put(&settings.initial, &mut wanted.initial, None)?;
    let controller = design(&mut plant, &nominal, &wanted)?;
    let name = |&index: &usize| catalogue.variables()[index].name.clone();
    let disturbed = signals.inputs.iter().zip(&wanted.input_drift).filter(|(_, drift)| **drift > 0.0);
    let disturbances = disturbed.map(|(index, _)| format!("disturbance of {}", name(index)));
    let states = signals.states.iter().map(name).chain(disturbances).collect();
    Ok(Stabilised {
        controller,
        nominal,
        design: wanted,
        states,
        inputs: signals.inputs.clone(),
        measured: indices,
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
