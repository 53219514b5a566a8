//! Continuous states of Model Exchange: their order, what is set, derivatives, nominals, event indicators and time.

use std::sync::Arc;

use super::Findings;
use super::probe::{Advance, Probe};
use crate::description::{Causality, ModelDescription, VariableKind};
use crate::{Error, Fmu, InterfaceKind};

/// Steps after which everything is looked at again.
const STEPS: usize = 10;

/// Differences of states over their size that tell each state from the others.
const SPREAD: f64 = 1e-3;

/// Two ways to the same number may differ by rounding.
const ROUNDING: f64 = 1e-9;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    if kind != InterfaceKind::ModelExchange {
        return;
    }
    if let Err(error) = run(fmu, findings) {
        findings.error("continuous-states", format!("interface {kind}"), error.to_string());
    }
}

fn run(fmu: &Arc<Fmu>, findings: &mut Findings) -> Result<(), Error> {
    let mut probe = Probe::new(fmu, InterfaceKind::ModelExchange)?;
    if probe.initialize()? != Advance::Done {
        return Ok(());
    }
    if let Some(model) = probe.model() {
        let described = [model.state_count(), fmu.description.number_of_event_indicators];
        for ((what, described), counted) in
            ["states", "event indicators"].iter().zip(described).zip(model.counts())
        {
            if let Some(counted) = counted.filter(|counted| *counted != described) {
                let message = format!("the library has {counted} {what}, ModelStructure lists {described}");
                findings.error("continuous-states", "interface Model Exchange", message);
            }
        }
    }
    judge(&mut probe, fmu, "after initialization", findings)?;
    if !findings.0.is_empty() || probe.advance(STEPS)? != Advance::Done {
        return Ok(());
    }
    judge(&mut probe, fmu, "after some steps", findings)?;
    if findings.0.is_empty() {
        judge_time(&mut probe, fmu, findings)?;
    }
    Ok(())
}

/// Positions of states and derivatives in the order of the description.
fn pairs(description: &ModelDescription) -> Vec<(usize, usize)> {
    let pair = |derivative: usize| match &description.variables[derivative].kind {
        VariableKind::Real(real) => real.derivative.map(|state| (state, derivative)),
        _ => None,
    };
    description.derivatives.iter().filter_map(|unknown| pair(unknown.variable)).collect()
}

fn judge(probe: &mut Probe, fmu: &Fmu, when: &str, findings: &mut Findings) -> Result<(), Error> {
    const PLACE: &str = "interface Model Exchange";
    let description = &fmu.description;
    let name = |position: usize| description.variables[position].name.as_str();
    let pairs = pairs(description);
    let references = |of: fn(&(usize, usize)) -> usize| -> Vec<u32> {
        pairs.iter().map(|pair| description.variables[of(pair)].value_reference).collect()
    };
    let (states, derivatives) = (references(|pair| pair.0), references(|pair| pair.1));
    if let Some(index) = probe.indicators().iter().position(|indicator| !indicator.is_finite()) {
        let message = format!("event indicator {} is {} {when}", index + 1, probe.indicators()[index]);
        findings.error("non-finite", PLACE, message);
    }
    let Some(model) = probe.model() else { return Ok(()) };
    let count = model.state_count();
    if count == 0 || count != pairs.len() {
        return Ok(());
    }
    let mut nominals = vec![0.0; count];
    model.get_nominals(&mut nominals)?;
    for (nominal, &(state, _)) in nominals.iter().zip(&pairs) {
        if !nominal.is_finite() || *nominal <= 0.0 {
            let message = format!(
                "fmi2GetNominalsOfContinuousStates gives {nominal} for {}, where a positive number is needed",
                name(state)
            );
            findings.error("nominal", PLACE, message);
        }
    }
    let mut original = vec![0.0; count];
    model.get_continuous_states(&mut original)?;
    // Differing amounts, so that no two states have the same value.
    let set: Vec<f64> = original
        .iter()
        .enumerate()
        .map(|(index, state)| state + SPREAD * (1.0 + index as f64 / count as f64) * state.abs().max(SPREAD))
        .collect();
    for values in [&original, &set] {
        model.set_continuous_states(values)?;
        let mut kept = vec![0.0; count];
        model.get_continuous_states(&mut kept)?;
        let mut read = vec![0.0; count];
        model.get_real(&states, &mut read)?;
        let mut rates = vec![0.0; count];
        model.get_derivatives(&mut rates)?;
        let mut read_rates = vec![0.0; count];
        model.get_real(&derivatives, &mut read_rates)?;
        for (index, &(state, derivative)) in pairs.iter().enumerate() {
            if kept[index] != values[index] {
                let message = format!(
                    "fmi2SetContinuousStates sets {} to {}, fmi2GetContinuousStates gives {}",
                    name(state),
                    values[index],
                    kept[index]
                );
                findings.error("state-order", PLACE, message);
            } else if !same(read[index], kept[index]) {
                let message = format!(
                    "continuous state {} is {}, and {} = {} by fmi2GetReal: states have the order of ModelStructure/Derivatives",
                    index + 1,
                    kept[index],
                    name(state),
                    read[index]
                );
                findings.error("state-order", PLACE, message);
            } else if !same(read_rates[index], rates[index]) {
                let message = format!(
                    "derivative {} is {} by fmi2GetDerivatives, and {} = {} by fmi2GetReal",
                    index + 1,
                    rates[index],
                    name(derivative),
                    read_rates[index]
                );
                findings.error("state-order", PLACE, message);
            }
            if !rates[index].is_finite() {
                let message = format!("the derivative {} is {} {when}", name(derivative), rates[index]);
                findings.error("non-finite", PLACE, message);
            }
            if !findings.0.is_empty() {
                model.set_continuous_states(&original)?;
                return Ok(());
            }
        }
    }
    // The first point again: what is computed must not depend on where the model was before.
    let mut here = vec![0.0; count];
    model.set_continuous_states(&original)?;
    model.get_derivatives(&mut here)?;
    let mut elsewhere = here.clone();
    model.set_continuous_states(&set)?;
    model.get_derivatives(&mut elsewhere)?;
    let mut again = here.clone();
    model.set_continuous_states(&original)?;
    model.get_derivatives(&mut again)?;
    if let Some(index) = (0..count).find(|&index| here[index].to_bits() != again[index].to_bits()) {
        let message = format!(
            "{} is {} and {} at the same states, before and after it was computed at others",
            name(pairs[index].1),
            here[index],
            again[index]
        );
        findings.error("evaluation", PLACE, message);
    }
    Ok(())
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// The independent variable is the time that was set.
fn judge_time(probe: &mut Probe, fmu: &Fmu, findings: &mut Findings) -> Result<(), Error> {
    let independent = fmu.description.variables.iter().find(|v| v.causality == Causality::Independent);
    let Some(variable) = independent else { return Ok(()) };
    let now = probe.time();
    let ahead = now + SPREAD * probe.step();
    for time in [ahead, now] {
        let Some(model) = probe.model() else { return Ok(()) };
        model.set_time(time)?;
        let mut value = [0.0];
        model.get_real(&[variable.value_reference], &mut value)?;
        if !same(value[0], time) {
            let message = format!("after fmi2SetTime({time}) it is {}", value[0]);
            findings.error("time", super::element(variable), message);
            return Ok(());
        }
    }
    Ok(())
}
