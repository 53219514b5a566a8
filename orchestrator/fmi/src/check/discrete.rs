//! Declared dependencies of and on variables that are no continuous Reals, at events and at initialization.
//!
//! Two new instances go the same way, but for one known that is set to another value in one of them; an unknown that
//! differs depends on it. (Continuous Reals are left to `dependencies.rs`, which looks at them without new instances.)

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Findings;
use super::probe::{Advance, Probe, Value};
use super::settings::another;
use crate::description::{Causality, Initial, Unknown, Variability, Variable, VariableKind};
use crate::{Error, Fmu, InterfaceKind};

/// Time for all instances.
const MAX_TIME: Duration = Duration::from_secs(5);

/// A larger change of a number, over its size, than the one that [`another`] makes.
const LARGE_CHANGE: f64 = 0.75;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    let description = &fmu.description;
    let at_events: Vec<&Unknown> = description.outputs.iter().chain(&description.derivatives).collect();
    let initial: Vec<&Unknown> = description.initial_unknowns.iter().collect();
    let mut moments = vec![(Moment::Initialization, initial)];
    if kind == InterfaceKind::ModelExchange {
        moments.push((Moment::Event, at_events));
    }
    let began = Instant::now();
    for (moment, unknowns) in moments {
        // Whatever ends a run is a finding of the life-cycle.
        let _ = compare(fmu, kind, moment, &unknowns, began, findings);
    }
}

/// When a known is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Moment {
    Initialization,
    Event,
}

impl Moment {
    fn name(self) -> &'static str {
        match self {
            Moment::Initialization => "initialization",
            Moment::Event => "events",
        }
    }
}

fn is_continuous(variable: &Variable) -> bool {
    variable.variability == Variability::Continuous && matches!(variable.kind, VariableKind::Real(_))
}

fn compare(
    fmu: &Arc<Fmu>,
    kind: InterfaceKind,
    moment: Moment,
    unknowns: &[&Unknown],
    began: Instant,
    findings: &mut Findings,
) -> Result<(), Error> {
    let variables = &fmu.description.variables;
    let unknowns: Vec<&Unknown> = unknowns.iter().copied().filter(|u| u.dependencies.is_some()).collect();
    if unknowns.is_empty() {
        return Ok(());
    }
    let Some(usual) = observe(fmu, kind, moment, &unknowns, None)? else { return Ok(()) };
    for (known, variable) in variables.iter().enumerate().filter(|&(known, _)| is_known(fmu, moment, known)) {
        // Continuous Reals of each other are judged elsewhere, but for what is set at initialization only.
        let elsewhere =
            is_continuous(variable) && (moment == Moment::Event || variable.causality == Causality::Input);
        if elsewhere && unknowns.iter().all(|unknown| is_continuous(&variables[unknown.variable])) {
            continue;
        }
        let mut depends = vec![false; usual.len()];
        for value in values(fmu, known) {
            if began.elapsed() > MAX_TIME {
                return Ok(());
            }
            // A value may lie outside of what the FMU accepts; that says nothing about dependencies.
            let Ok(Some(changed)) = observe(fmu, kind, moment, &unknowns, Some((known, &value))) else {
                continue;
            };
            for (depends, (usual, changed)) in depends.iter_mut().zip(usual.iter().zip(&changed)) {
                *depends |= usual != changed;
            }
        }
        // Values at once, and behind them those after the event.
        let (at_once, after) = depends.split_at(unknowns.len());
        for (index, unknown) in unknowns.iter().enumerate() {
            let is_after_only = !at_once[index] && after.get(index).is_some_and(|depends| *depends);
            let depends = at_once[index] || is_after_only;
            let dependent = &variables[unknown.variable];
            let declared =
                unknown.dependencies.iter().flatten().any(|dependency| dependency.variable == known);
            let is_alias = dependent.value_reference == variable.value_reference
                && dependent.kind.name() == variable.kind.name();
            if !depends || declared || is_alias || (elsewhere && is_continuous(dependent)) {
                continue;
            }
            let place = format!("interface {kind}, {} by {}", dependent.name, variable.name);
            let message = format!(
                "at {} the value depends on it, but the dependencies of ModelStructure do not say so",
                moment.name()
            );
            // Parameters do not take part in the order in which connected units are initialized; after an event, values
            // may have gone through a memory.
            if variable.causality == Causality::Parameter || is_after_only {
                findings.warning("dependency-undeclared", place, message);
            } else {
                findings.error("dependency-undeclared", place, message);
            }
        }
    }
    Ok(())
}

/// Whether the variable at this position is a known of the unknowns (FMI 2.0.4 section 2.2.8).
fn is_known(fmu: &Fmu, moment: Moment, position: usize) -> bool {
    let description = &fmu.description;
    let variable = &description.variables[position];
    if variable.causality == Causality::Input {
        return true;
    }
    match moment {
        Moment::Event => description.continuous_states().any(|state| state == position),
        Moment::Initialization => {
            variable.initial == Some(Initial::Exact)
                && variable.variability != Variability::Constant
                && !description.is_structural(position)
        }
    }
}

/// Other values of a known.
fn values(fmu: &Fmu, known: usize) -> Vec<Value> {
    let variable = &fmu.description.variables[known];
    let near = another(fmu, variable, fmu.description.is_single(known));
    let far = match &variable.kind {
        VariableKind::Real(real) => real.start.and_then(|start| {
            let size = if start != 0.0 { start.abs() } else { real.nominal.unwrap_or(1.0).abs() };
            let (min, max) = (real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY));
            let far = [start + LARGE_CHANGE * size, start - LARGE_CHANGE * size];
            far.into_iter().find(|far| (min..=max).contains(far)).map(|far| Value::Real(far.to_bits()))
        }),
        _ => None,
    };
    near.into_iter().chain(far).collect()
}

/// The unknowns after a known was set, and at an event once more after it; `None` if the FMU ended by itself.
fn observe(
    fmu: &Arc<Fmu>,
    kind: InterfaceKind,
    moment: Moment,
    unknowns: &[&Unknown],
    set: Option<(usize, &Value)>,
) -> Result<Option<Vec<Value>>, Error> {
    let variables = &fmu.description.variables;
    let mut probe = Probe::new(fmu, kind)?;
    match moment {
        Moment::Initialization => probe.begin()?,
        Moment::Event => {
            if probe.initialize()? != Advance::Done {
                return Ok(None);
            }
        }
    }
    let state =
        set.and_then(|(known, _)| fmu.description.continuous_states().position(|state| state == known));
    let Some(model) = probe.model().filter(|_| moment == Moment::Event) else {
        if let Some((known, value)) = set {
            probe.set(&variables[known], value)?;
        }
        return read(&mut probe, fmu, unknowns).map(Some);
    };
    if let (Some(state), Some(value)) = (state, set.and_then(|(_, value)| value.real())) {
        let mut states = vec![0.0; model.state_count()];
        model.get_continuous_states(&mut states)?;
        states[state] = value;
        model.set_continuous_states(&states)?;
        model.enter_event_mode()?;
    } else {
        model.enter_event_mode()?;
        if let Some((known, value)) = set {
            probe.set(&variables[known], value)?;
        }
    }
    let mut values = read(&mut probe, fmu, unknowns)?;
    if probe.handle_events()? != Advance::Done {
        return Ok(None);
    }
    values.extend(read(&mut probe, fmu, unknowns)?);
    Ok(Some(values))
}

fn read(probe: &mut Probe, fmu: &Fmu, unknowns: &[&Unknown]) -> Result<Vec<Value>, Error> {
    unknowns.iter().map(|unknown| probe.value(&fmu.description.variables[unknown.variable])).collect()
}
