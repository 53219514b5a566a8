//! Co-Simulation against Model Exchange: both interfaces of an FMU are the same model.
//!
//! The steps of Co-Simulation are compared with Model Exchange under explicit Euler steps of the same length and with
//! much shorter ones; the difference of these two is what a simple integrator inside the FMU may be off by.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::probe::{Advance, Probe, Value};
use super::settings::another;
use super::{Findings, Severity, element};
use crate::description::{Causality, Variability, Variable, VariableKind};
use crate::{Error, Fmu, InterfaceKind};

/// Communication steps that are compared.
const STEPS: usize = 60;

/// Short steps in one communication step.
const SHORT_STEPS: f64 = 16.0;

/// Largest error over that of Euler steps as long as the communication steps.
const MAX_ERROR_OVER_EULER: f64 = 1.5;

/// Largest error over the range in which a variable has moved: tolerance of the solver inside of the FMU.
const MAX_ERROR_OVER_RANGE: f64 = 1e-3;

/// Largest error of Euler steps over the range in which a variable has moved, for a comparison.
const MAX_EULER_ERROR_OVER_RANGE: f64 = 0.25;

/// An error beyond the other limits counts as one where it is also larger than this over the range, and no
/// communication step nearby has the value: coupled units inside of an FMU may lag by a step.
const MAX_LAGGING_ERROR_OVER_RANGE: f64 = 0.02;

/// So many communication steps before and after are nearby.
const LAG: usize = 2;

/// Largest error over the value or the nominal, for rounding.
const ROUNDING: f64 = 1e-9;

/// Change of an input over its size, so that its factors matter.
const INPUT_CHANGE: f64 = 0.3;

/// At the start, Model Exchange has seen the events of that time already, Co-Simulation sees them in its first step.
const FIRST_POINT: usize = 1;

/// Time for all runs; a slow FMU is compared as far as it gets.
const MAX_TIME: Duration = Duration::from_secs(5);

pub(super) fn check(fmu: &Arc<Fmu>, findings: &mut Findings) {
    let inputs = inputs(fmu);
    // Changed values may be more than the model is made for.
    if compare(fmu, &inputs, findings).is_err() && !inputs.is_empty() {
        // What ends a run is a finding of the life-cycle.
        let _ = compare(fmu, &[], findings);
    }
    let all: Vec<_> = inputs.into_iter().chain(parameters(fmu)).collect();
    if findings.0.is_empty() {
        let _ = compare(fmu, &all, findings);
    }
}

/// Real parameters with other values than their start values.
fn parameters(fmu: &Fmu) -> Vec<(usize, f64)> {
    let variables = fmu.description.variables.iter().enumerate();
    let parameters = variables.filter(|(_, variable)| variable.causality == Causality::Parameter);
    parameters
        .filter_map(|(position, variable)| Some((position, another(fmu, variable, true)?.real()?)))
        .collect()
}

/// Continuous inputs with other values than their start values.
fn inputs(fmu: &Fmu) -> Vec<(usize, f64)> {
    let variables = fmu.description.variables.iter().enumerate();
    let inputs = variables.filter(|(_, variable)| variable.causality == Causality::Input);
    let change = |(position, variable): (usize, &Variable)| match &variable.kind {
        VariableKind::Real(real) if variable.variability == Variability::Continuous => {
            let start = real.start.unwrap_or(0.0);
            let size = if start != 0.0 { start.abs() } else { real.nominal.unwrap_or(1.0).abs() };
            let (min, max) = (real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY));
            (min <= max).then(|| (position, (start + INPUT_CHANGE * size).clamp(min, max)))
        }
        _ => None,
    };
    inputs.filter_map(change).collect()
}

/// The values of a run at all communication points, and the number of events before each.
#[derive(Default)]
struct Run {
    values: Vec<Vec<Value>>,
    events: Vec<usize>,
}

/// One point more than the steps that `kind` makes with steps of `step` over the communication steps `h`.
fn run(
    fmu: &Arc<Fmu>,
    kind: InterfaceKind,
    settings: &[(usize, f64)],
    short: f64,
    began: Instant,
) -> Result<Run, Error> {
    let mut probe = Probe::new(fmu, kind)?;
    let (start, h) = (probe.time(), probe.step());
    probe.set_step(h / short);
    for &(position, value) in settings {
        probe.set(&fmu.description.variables[position], &Value::Real(value.to_bits()))?;
    }
    probe.begin()?;
    let mut run = Run::default();
    let mut outcome = probe.finish()?;
    for step in 1..=STEPS + 1 {
        if outcome != Advance::Done || began.elapsed() > MAX_TIME {
            break;
        }
        run.values.push(probe.values()?);
        run.events.push(probe.events());
        outcome = match kind {
            InterfaceKind::CoSimulation => probe.advance(1)?,
            InterfaceKind::ModelExchange => probe.advance_to(start + step as f64 * h)?,
        };
    }
    Ok(run)
}

fn compare(fmu: &Arc<Fmu>, settings: &[(usize, f64)], findings: &mut Findings) -> Result<(), Error> {
    let began = Instant::now();
    let slave = run(fmu, InterfaceKind::CoSimulation, settings, 1.0, began)?;
    let coarse = run(fmu, InterfaceKind::ModelExchange, settings, 1.0, began)?;
    let fine = run(fmu, InterfaceKind::ModelExchange, settings, SHORT_STEPS, began)?;
    let points = slave.values.len().min(coarse.values.len()).min(fine.values.len());
    let h = Probe::new(fmu, InterfaceKind::CoSimulation)?.step();
    // Units that are sampled in every step, and coupled inside, see values of either side of a sample.
    let events = fine.events.last().unwrap_or(&0) - fine.events.first().unwrap_or(&0);
    let is_sampled = 2 * events >= points;
    // Structural and derived values differ by definition where they belong to the interface.
    let compared = |variable: &Variable| {
        !matches!(variable.causality, Causality::Input | Causality::Parameter | Causality::Independent)
            && variable.variability != Variability::Constant
    };
    for (position, variable) in fmu.description.variables.iter().enumerate().filter(|(_, v)| compared(v)) {
        let column =
            |run: &Run| -> Vec<Value> { run.values.iter().map(|values| values[position].clone()).collect() };
        let (slave, model, rough) = (column(&slave), column(&fine), column(&coarse));
        let is_continuous = variable.variability == Variability::Continuous;
        let different = match numbers(&slave).zip(numbers(&model)).zip(numbers(&rough)) {
            Some(((slave, model), rough)) if is_continuous => {
                let nominal = match &variable.kind {
                    VariableKind::Real(real) => real.nominal.unwrap_or(1.0).abs(),
                    _ => 1.0,
                };
                continuous((&slave, &model, &rough), (&fine.events, &coarse.events), points, nominal)
            }
            _ => discrete((&slave, &model, &rough), points),
        };
        if let Some(point) = different {
            let message = format!(
                "it is {} in Co-Simulation after {point} steps of {h} s, and {} in Model Exchange",
                slave[point], model[point]
            );
            // A number of solver steps, say, belongs to one interface.
            let is_still = |values: &[Value]| values.iter().all(|value| *value == values[0]);
            let belongs_to_one = !is_continuous && is_still(&model) && !is_still(&slave);
            let lags = numbers(&slave)
                .zip(numbers(&model))
                .is_some_and(|(slave, model)| is_nearby(&slave[..points], &model[..points]));
            let severity = match (belongs_to_one, lags || is_sampled) {
                (true, _) => Severity::Note,
                (false, true) => Severity::Warning,
                (false, false) => Severity::Error,
            };
            findings.add(severity, "interfaces-differ", element(variable), message);
        }
    }
    Ok(())
}

/// Whether each value lies among those of the communication steps nearby.
fn is_nearby(slave: &[f64], model: &[f64]) -> bool {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    (0..slave.len().saturating_sub(LAG)).all(|point| {
        let near = &model[point.saturating_sub(LAG)..=point + LAG];
        let from = near.iter().copied().fold(f64::INFINITY, f64::min);
        let to = near.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (low, high) = (low.min(from), high.max(to));
        let allowed = MAX_LAGGING_ERROR_OVER_RANGE * (high - low);
        (from - allowed..=to + allowed).contains(&slave[point])
    })
}

fn numbers(values: &[Value]) -> Option<Vec<f64>> {
    values.iter().map(Value::real).collect()
}

/// The first point at which a continuous variable is further away than the error that Euler steps make.
fn continuous(
    (slave, model, rough): (&[f64], &[f64], &[f64]),
    (events, rough_events): (&[usize], &[usize]),
    points: usize,
    nominal: f64,
) -> Option<usize> {
    let (mut error, mut low, mut high) = (0.0_f64, f64::INFINITY, f64::NEG_INFINITY);
    for point in FIRST_POINT..points.saturating_sub(1) {
        let (before, after) = (point.saturating_sub(1), point + 1);
        // Around an event the point itself does not say on which side of it a value is.
        let is_near_event = events[before] != events[after] || rough_events[before] != rough_events[after];
        let near = if is_near_event { before..=after } else { point..=point };
        let hull = |values: &[f64]| {
            let values = &values[near.clone()];
            (
                values.iter().copied().fold(f64::INFINITY, f64::min),
                values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            )
        };
        let ((from, to), (rough_from, rough_to)) = (hull(model), hull(rough));
        error = error.max((model[point] - rough[point]).abs());
        (low, high) = (low.min(from), high.max(to));
        let allowed = MAX_ERROR_OVER_EULER * error
            + MAX_ERROR_OVER_RANGE * (high - low)
            + ROUNDING * from.abs().max(to.abs()).max(nominal);
        if !allowed.is_finite() {
            return None;
        }
        // Where Euler steps are as far off as the variable has moved, they say nothing.
        if error > MAX_EULER_ERROR_OVER_RANGE * (high - low) && error > ROUNDING * nominal {
            continue;
        }
        if slave[point] < from.min(rough_from) - allowed || slave[point] > to.max(rough_to) + allowed {
            return Some(point);
        }
    }
    None
}

/// The first point at which a value that changes by events only is none that Model Exchange has near this point.
fn discrete((slave, model, rough): (&[Value], &[Value], &[Value]), points: usize) -> Option<usize> {
    (FIRST_POINT..points.saturating_sub(1)).find(|&point| {
        let near = point.saturating_sub(1)..=point + 1;
        let known = |value: &Value| match (value.real(), slave[point].real()) {
            (Some(a), Some(b)) => {
                (a - b).abs() <= ROUNDING * a.abs().max(b.abs()) || value.equals(&slave[point])
            }
            _ => value.equals(&slave[point]),
        };
        let between =
            numbers(&model[near.clone()]).zip(slave[point].real()).is_some_and(|(values, value)| {
                values.iter().any(|other| *other <= value) && values.iter().any(|other| *other >= value)
            });
        !between && !model[near.clone()].iter().any(known) && !rough[near].iter().any(known)
    })
}
