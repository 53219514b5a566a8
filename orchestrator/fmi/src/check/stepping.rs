//! Communication steps of Co-Simulation: time goes on, declared abilities are there, steps that are none are refused.

use std::sync::Arc;

use super::probe::{Advance, Probe, Value};
use super::settings::another;
use super::{Findings, element};
use crate::description::{Causality, Dependency, Unknown, Variability, VariableKind};
use crate::{Error, Fmu, InterfaceKind, StepStatus};

const PLACE: &str = "interface Co-Simulation";

/// Steps of a run.
const STEPS: usize = 20;

/// An FMU may make steps inside that are so many times as long.
const MAX_STEPS_TO_MEET: usize = 200;

/// Largest difference of two ways to the same time, over the step: steps inside that do not divide it add up.
const MAX_TIME_DIFFERENCE: f64 = 0.01;

/// Largest difference of an output derivative and a difference of outputs, over their size: both are of different
/// times.
const MAX_DERIVATIVE_DIFFERENCE: f64 = 0.5;

/// Outputs are as exact as this, over their size or nominal.
const MAX_OUTPUT_ROUNDING: f64 = 1e-12;

/// Differences of outputs in successive steps tell a derivative where they change less than by this, over their size.
const MAX_CURVATURE: f64 = 0.1;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    if kind != InterfaceKind::CoSimulation {
        return;
    }
    type Part = fn(&Arc<Fmu>, &mut Findings) -> Result<(), Error>;
    let parts: [(&str, Part); 7] = [
        ("time", clock),
        ("stands-still", response),
        ("step", progress),
        ("output-derivatives", output_derivatives),
        ("input-derivatives", input_derivatives),
        ("step-size", other_sizes),
        ("step-size", no_step),
    ];
    for (rule, part) in parts {
        if let Err(error) = part(fmu, findings) {
            findings.error(rule, PLACE, error.to_string());
        }
    }
}

/// Time and states move.
fn progress(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    let variables = &fmu.description.variables;
    let mut probe = Probe::new(fmu, InterfaceKind::CoSimulation)?;
    probe.initialize()?;
    let mut runs = vec![probe.values()?];
    for _ in 0..STEPS {
        if probe.advance(1)? != Advance::Done {
            return Ok(());
        }
        runs.push(probe.values()?);
    }
    for (position, variable) in variables.iter().enumerate() {
        let VariableKind::Real(real) = &variable.kind else { continue };
        let Some(state) = real.derivative else { continue };
        let moves = |values: &Vec<Value>| values[position].real().is_some_and(|rate| rate != 0.0);
        let is_still = runs.iter().all(|values| values[state] == runs[0][state]);
        // A rate that is lost in the digits of its state moves nothing.
        let size = runs[0][state].real().unwrap_or(0.0).abs();
        let rate = runs[0][position].real().unwrap_or(0.0).abs();
        if is_still && runs.iter().all(moves) && rate * probe.step() > f64::EPSILON * size {
            let message = format!("it stands still over {STEPS} steps, while {} is {rate}", variable.name);
            findings.error("stands-still", element(&variables[state]), message);
        }
    }
    Ok(())
}

/// Where outputs depend on inputs, something changes with the steps when inputs do.
fn response(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    let description = &fmu.description;
    let variables = &description.variables;
    let inputs: Vec<_> = variables.iter().filter(|v| v.causality == Causality::Input).collect();
    let dependent = |unknown: &&Unknown| {
        let on_input = |dependency: &Dependency| variables[dependency.variable].causality == Causality::Input;
        unknown.dependencies.iter().flatten().any(on_input)
    };
    let outputs: Vec<_> =
        description.outputs.iter().filter(dependent).map(|unknown| &variables[unknown.variable]).collect();
    if outputs.is_empty() {
        return Ok(());
    }
    let mut probe = Probe::new(fmu, InterfaceKind::CoSimulation)?;
    probe.initialize()?;
    let mut first = None;
    for number in 0..STEPS.max(inputs.len() + 1) {
        // One input after the other, since changes of several may cancel.
        let input = number.checked_sub(1).and_then(|number| inputs.get(number));
        if let Some((input, value)) = input.and_then(|input| Some((input, another(fmu, input, true)?))) {
            // A value that the FMU does not accept is a finding of the settings.
            let _ = probe.set(input, &value);
        }
        if probe.advance(1)? != Advance::Done {
            return Ok(());
        }
        let values = outputs.iter().map(|output| probe.value(output)).collect::<Result<Vec<_>, _>>()?;
        if first.get_or_insert_with(|| values.clone()) != &values {
            return Ok(());
        }
    }
    let names: Vec<_> = outputs.iter().map(|output| output.name.as_str()).collect();
    let message = format!(
        "no value of {} changes with the steps, while all inputs change on which the dependencies of ModelStructure say that \
         they depend",
        names.join(", ")
    );
    findings.warning("stands-still", PLACE, message);
    Ok(())
}

/// The independent variable is the time that the steps have reached, where the FMU makes longer steps inside now and
/// then.
fn clock(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    let variables = &fmu.description.variables;
    let Some(clock) = variables.iter().find(|variable| variable.causality == Causality::Independent) else {
        return Ok(());
    };
    let mut probe = Probe::new(fmu, InterfaceKind::CoSimulation)?;
    probe.initialize()?;
    for _ in 0..MAX_STEPS_TO_MEET {
        if probe.advance(1)? != Advance::Done {
            return Ok(());
        }
        let time = probe.value(clock)?.real().unwrap_or(f64::NAN);
        if (time - probe.time()).abs() <= MAX_TIME_DIFFERENCE * probe.step() {
            return Ok(());
        }
    }
    let message = format!(
        "it is {} after fmi2DoStep to {} s, and was never the time that the last {MAX_STEPS_TO_MEET} steps had reached",
        probe.value(clock)?,
        probe.time()
    );
    findings.error("time", element(clock), message);
    Ok(())
}

/// `maxOutputDerivativeOrder`: all orders are there, and the first is how the output changes.
fn output_derivatives(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    let claimed = fmu.description.co_simulation.as_ref().map_or(0, |slave| slave.max_output_derivative_order);
    let outputs = fmu.description.variables.iter().filter(|variable| {
        variable.causality == Causality::Output
            && variable.variability == Variability::Continuous
            && matches!(variable.kind, VariableKind::Real(_))
    });
    let outputs: Vec<_> = outputs.collect();
    if claimed == 0 || outputs.is_empty() {
        return Ok(());
    }
    let mut probe = Probe::new(fmu, InterfaceKind::CoSimulation)?;
    probe.initialize()?;
    let mut path = Vec::new();
    for _ in 0..STEPS {
        if probe.advance(1)? != Advance::Done {
            return Ok(());
        }
        path.push(outputs.iter().map(|output| probe.value(output)).collect::<Result<Vec<_>, _>>()?);
    }
    let step = probe.step();
    for (index, output) in outputs.iter().enumerate() {
        let at = |back: usize| path[STEPS - 1 - back][index].real().unwrap_or(0.0);
        let (last, before) = ((at(0) - at(1)) / step, (at(1) - at(2)) / step);
        for order in 1..=claimed {
            let mut value = [0.0];
            let Some(slave) = probe.slave() else { return Ok(()) };
            let asked = slave.get_real_output_derivatives(
                &[output.value_reference],
                &[i32::try_from(order).unwrap_or(i32::MAX)],
                &mut value,
            );
            if let Err(error) = asked {
                let message = format!(
                    "maxOutputDerivativeOrder=\"{claimed}\", but order {order} is not there: {error}"
                );
                findings.error("output-derivatives", element(output), message);
                return Ok(());
            }
            if !value[0].is_finite() {
                let message = format!("its derivative of order {order} is {}", value[0]);
                findings.error("output-derivatives", element(output), message);
                return Ok(());
            }
            let is_straight = (last - before).abs() <= MAX_CURVATURE * last.abs().min(before.abs());
            let nominal = match &output.kind {
                VariableKind::Real(real) => real.nominal.unwrap_or(1.0).abs(),
                _ => 1.0,
            };
            let rounding = MAX_OUTPUT_ROUNDING * at(0).abs().max(nominal) / step;
            let apart = (value[0] - last).abs() - rounding;
            if order == 1 && is_straight && apart > MAX_DERIVATIVE_DIFFERENCE * value[0].abs().max(last.abs())
            {
                let message = format!(
                    "its derivative is {} by fmi2GetRealOutputDerivatives, {last} by the last steps",
                    value[0]
                );
                findings.error("output-derivatives", element(output), message);
            }
        }
    }
    Ok(())
}

/// `canInterpolateInputs`: a derivative of an input is accepted.
fn input_derivatives(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    if fmu.description.is_fmi3()
        || !fmu.description.co_simulation.as_ref().is_some_and(|s| s.can_interpolate_inputs)
    {
        return Ok(());
    }
    let inputs = fmu.description.variables.iter().filter(|variable| {
        variable.causality == Causality::Input
            && variable.variability == Variability::Continuous
            && matches!(variable.kind, VariableKind::Real(_))
    });
    let mut probe = Probe::new(fmu, InterfaceKind::CoSimulation)?;
    probe.initialize()?;
    for input in inputs {
        let Some(slave) = probe.slave() else { return Ok(()) };
        if let Err(error) = slave.set_real_input_derivatives(&[input.value_reference], &[1], &[0.0]) {
            let message = format!("canInterpolateInputs=\"true\", but its derivative cannot be set: {error}");
            findings.error("input-derivatives", element(input), message);
            return Ok(());
        }
    }
    Ok(())
}

/// `canHandleVariableCommunicationStepSize`: steps of other lengths.
fn other_sizes(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    let slave = fmu.description.co_simulation.as_ref();
    if !slave.is_some_and(|slave| slave.can_handle_variable_communication_step_size) {
        return Ok(());
    }
    let mut probe = Probe::new(fmu, InterfaceKind::CoSimulation)?;
    probe.initialize()?;
    if probe.advance(1)? != Advance::Done {
        return Ok(());
    }
    let step = probe.step();
    for factor in [0.5, 1.5] {
        probe.set_step(factor * step);
        let outcome = probe.advance(1);
        if !matches!(outcome, Ok(Advance::Done)) {
            let why = outcome.err().map_or_else(String::new, |error| format!(": {error}"));
            let message = format!(
                "canHandleVariableCommunicationStepSize=\"true\", but a step of {} s after one of {step} s is refused{why}",
                factor * step
            );
            findings.error("step-size", PLACE, message);
            return Ok(());
        }
    }
    Ok(())
}

/// A step has a length above zero (FMI 2.0.5 section 4.2.1).
fn no_step(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    for factor in [0.0, -1.0] {
        let mut probe = Probe::new(fmu, InterfaceKind::CoSimulation)?;
        probe.initialize()?;
        if probe.advance(1)? != Advance::Done {
            return Ok(());
        }
        let (time, step) = (probe.time(), factor * probe.step());
        let Some(slave) = probe.slave() else { return Ok(()) };
        if matches!(slave.do_step(time, step, false), Ok(StepStatus::Complete)) {
            let message = format!("fmi2DoStep accepts a step of {step} s; a step must be longer than 0 s");
            findings.error("step-size", PLACE, message);
        }
    }
    Ok(())
}
