//! Checks of a phase before anything is computed from it.

use super::dynamics::Size;
use super::error::Error;
use super::problem::{Duration, Limit, Phase, Quantity, Shooting, Variable};

/// Everything that can be seen without evaluating the dynamics.
pub(super) fn phase(phase: &Phase) -> Result<(), Error> {
    let name = || phase.name.clone();
    let Some(first) = phase.dynamics.first() else { return Err(Error::NoDynamics { phase: name() }) };
    let size = first.size();
    if phase.dynamics.iter().any(|other| other.size() != size) {
        return Err(Error::Instances { phase: name() });
    }
    let limits = phase.paths.iter().map(|path| &path.limit).chain(&phase.start).chain(&phase.end);
    for item in limits {
        limit(&phase.name, item, size)?;
    }
    for cost in phase.integral.iter().chain(&phase.final_cost) {
        quantity(&phase.name, "cost", &cost.quantity, size)?;
        finite(phase, "weight of a cost", cost.weight)?;
        finite(phase, "reference of a cost", cost.reference)?;
    }
    for rate in &phase.rates {
        quantity(&phase.name, &rate.name, &Variable::Input(rate.input).into(), size)?;
        bounds(&phase.name, &rate.name, rate.lower, rate.upper)?;
    }
    for path in &phase.paths {
        let [from, to] = path.window;
        if from.is_nan() || to.is_nan() || from > to {
            let item = format!("window of {}", path.limit.name);
            return Err(Error::Bounds { phase: name(), item, lower: from, upper: to });
        }
    }
    finite(phase, "weight of the duration", phase.duration_weight)?;
    duration(phase)?;
    shooting(phase, size)
}

fn duration(phase: &Phase) -> Result<(), Error> {
    let positive = |item: &str, value: f64| positive(phase, item, value);
    match phase.duration {
        Duration::Fixed(value) => positive("duration", value),
        Duration::Free { lower, upper } => {
            positive("lower bound of the duration", lower)?;
            bounds(&phase.name, "duration", lower, upper)
        }
    }
}

fn shooting(phase: &Phase, size: Size) -> Result<(), Error> {
    match &phase.shooting {
        Shooting::Steps(0) => Err(Error::Value {
            phase: phase.name.clone(),
            item: "Runge-Kutta steps per interval".to_owned(),
            value: 0.0,
            allowed: "at least 1",
        }),
        Shooting::Steps(_) => Ok(()),
        Shooting::Sampled { states, sample_time } => {
            for &state in states {
                quantity(&phase.name, "sampled states", &Variable::State(state).into(), size)?;
            }
            positive(phase, "sample time", *sample_time)
        }
    }
}

fn positive(phase: &Phase, item: &str, value: f64) -> Result<(), Error> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    let (phase, item) = (phase.name.clone(), item.to_owned());
    Err(Error::Value { phase, item, value, allowed: "a positive number" })
}

fn finite(phase: &Phase, item: &str, value: f64) -> Result<(), Error> {
    if value.is_finite() {
        return Ok(());
    }
    let (phase, item) = (phase.name.clone(), item.to_owned());
    Err(Error::Value { phase, item, value, allowed: "a finite number" })
}

/// A limit refers to what exists and leaves room.
pub(super) fn limit(phase: &str, limit: &Limit, size: Size) -> Result<(), Error> {
    quantity(phase, &limit.name, &limit.quantity, size)?;
    bounds(phase, &limit.name, limit.lower, limit.upper)
}

fn bounds(phase: &str, item: &str, lower: f64, upper: f64) -> Result<(), Error> {
    if lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY {
        return Ok(());
    }
    Err(Error::Bounds { phase: phase.to_owned(), item: item.to_owned(), lower, upper })
}

fn quantity(phase: &str, item: &str, quantity: &Quantity, size: Size) -> Result<(), Error> {
    for &(variable, factor) in &quantity.terms {
        let (kind, index, count) = match variable {
            Variable::State(i) => ("state", i, size.states),
            Variable::Input(i) => ("input", i, size.inputs),
            Variable::Output(i) => ("output", i, size.outputs),
        };
        let (phase, item) = (phase.to_owned(), item.to_owned());
        if index >= count {
            return Err(Error::Variable { phase, item, kind, index, count });
        }
        if !factor.is_finite() {
            return Err(Error::Value { phase, item, value: factor, allowed: "a finite factor" });
        }
    }
    Ok(())
}
