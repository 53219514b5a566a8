//! Model predictive control of a stabilized plan: settings become numbers, named parameters become members of the
//! model.

use super::Stabilized;
use super::settings::{NmpcSettings, Settings};
use crate::Error;
use crate::file::{Place, Quantity};
use crate::prepare::Prepared;
use crate::task::{Signal, seconds};
use crate::trials::perturbation;
use airloop_cosim::coupled::{Options, System};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::Start;
use airloop_dynamics::Dynamics;
use airloop_ocp::control::nmpc::{Plant, Settings as Choices};
use airloop_ocp::transcription::Point;

/// Default length of the horizon \[s\].
const HORIZON: f64 = 0.5;
/// Default step, in samples, and period, in steps.
const SAMPLES_PER_STEP: f64 = 5.0;
const STEPS_PER_PERIOD: f64 = 4.0;
/// Default number of iterations.
const ITERATIONS: u32 = 2;
/// Default margin of bounds, as a part of their range.
const MARGIN: f64 = 0.025;
/// Standard deviation of a learned parameter at first, and of its drift in a second, in widths.
const PARAMETER: (f64, f64) = (0.5, 0.05);
/// Points of the plan at which the rates are looked at.
const POINTS: usize = 20;
/// Curvature, relative to the rates, that is rounding.
const ROUNDING: f64 = 1e-9;

/// A parameter that the controller learns.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    /// Names, for messages and outputs.
    pub name: String,
    /// `component.variable`, with its values one width above and below the declared one.
    pub variables: Vec<(String, f64, f64)>,
    /// Whether the rates are linear in it.
    pub linear: bool,
}

/// A model predictive controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictive {
    /// Paths of states, inputs and outputs of the model.
    pub paths: [Vec<String>; 3],
    /// Names of what is estimated: states, disturbances of the inputs, parameters.
    pub estimates: Vec<String>,
    /// Parameters that it learns.
    pub parameters: Vec<Learned>,
    /// Numbers.
    pub plant: Plant,
    /// Choices, one sentence each.
    pub notes: Vec<String>,
}

/// Makes the controller for a plan with its regulator.
///
/// # Errors
/// A plan with phases, times that do not fit each other, or parameters that are unknown or leave their range, with
/// their place.
pub fn predictive(
    prepared: &Prepared,
    stabilized: &Stabilized,
    settings: &Settings,
) -> Result<Predictive, Error> {
    let source = &settings.source;
    let none = NmpcSettings::default();
    let own = settings.nmpc.as_ref().map_or(&none, |own| own);
    let place = settings.nmpc.as_ref().map_or(Place(0), |own| own.place);
    let signals = &prepared.task.signals;
    if prepared.task.phases.len() != 1 || stabilized.repeated.is_some() {
        let problem = "model predictive control is for plans with one phase that end; leave --nmpc out";
        return Err(source.error_at(place, problem));
    }
    let time = |quantity: &Option<Quantity>, default: f64| {
        quantity.as_ref().map_or(Ok(default), |quantity| seconds(source, quantity))
    };
    let step = time(&own.step, SAMPLES_PER_STEP * stabilized.nominal.sample_time)?;
    let period = time(&own.period, STEPS_PER_PERIOD * step)?;
    let margin = own.margin.unwrap_or(MARGIN);
    let mut notes = Vec::new();
    let mut bounds = Vec::new();
    for path in &prepared.task.phases[0].path {
        let (low, high) = path.limit.limits;
        if let [(Signal::State(state), 1.0)] = path.limit.terms[..]
            && (low.is_finite() || high.is_finite())
        {
            let range = if low.is_finite() && high.is_finite() {
                high - low
            } else {
                stabilized.nominal.spans().0[state]
            };
            bounds.push((state, (low, high), margin * range));
            let variable = &prepared.catalog.variables()[signals.states[state]];
            notes.push(format!(
                "predictions keep `{}` by {} {} inside of its bounds",
                variable.name,
                margin * range,
                variable.unit.as_deref().unwrap_or_default()
            ));
        }
    }
    let path = |&index: &usize| prepared.catalog.variables()[index].path.clone();
    let paths = [&signals.states, &signals.inputs, &signals.outputs];
    let paths = paths.map(|list| list.iter().map(path).collect::<Vec<String>>());
    let parameters = learned(prepared, stabilized, settings, (own, &paths))?;
    let count = parameters.len();
    let choices = Choices {
        horizon: time(&own.horizon, HORIZON)?,
        step,
        period,
        iterations: own.iterations.unwrap_or(ITERATIONS) as usize,
        time_budget: time(&own.time_budget, f64::INFINITY)?,
        bounds,
        parameter_deviation: vec![PARAMETER.0; count],
        parameter_drift: vec![PARAMETER.1; count],
    };
    let plant = Plant::new(&stabilized.nominal, &stabilized.design, &stabilized.controller, &choices);
    let plant = plant.map_err(|error| source.error_at(place, error.to_string()))?;
    let name = |&index: &usize| prepared.catalog.variables()[index].name.clone();
    let estimates = signals.states.iter().map(name);
    let disturbances = signals.inputs.iter().map(|index| format!("disturbance of {}", name(index)));
    let learned = parameters.iter().map(|parameter| format!("{}, in widths from its value", parameter.name));
    Ok(Predictive {
        paths: paths.clone(),
        estimates: estimates.chain(disturbances).chain(learned).collect(),
        parameters,
        plant,
        notes,
    })
}

/// The parameters with their values above and below; a straight line where the rates along the plan show one.
fn learned(
    prepared: &Prepared,
    stabilized: &Stabilized,
    settings: &Settings,
    (own, paths): (&NmpcSettings, &[Vec<String>; 3]),
) -> Result<Vec<Learned>, Error> {
    let graph = &prepared.graph;
    let options = Options {
        states: Some(paths[0].clone()),
        inputs: Some(paths[1].clone()),
        outputs: paths[2].clone(),
        time: 0.0,
    };
    let rates = |graph: &SystemGraph| -> Result<Vec<f64>, Error> {
        let mut system = System::open(graph, &options)?;
        let (nominal, n) = (&stabilized.nominal, paths[0].len());
        let mut values = vec![0.0; system.size().values()];
        let mut all = Vec::new();
        for k in (0..nominal.samples()).step_by((nominal.samples() / POINTS).max(1)) {
            let (states, inputs) = (&nominal.states[k][..], &nominal.inputs[k][..]);
            let at = Point { time: nominal.time(k), states, inputs };
            system.evaluate(at, &mut values).map_err(|error| Error::Place {
                place: "model of the controller".into(),
                problem: error.to_string(),
            })?;
            all.extend_from_slice(&values[..n]);
        }
        Ok(all)
    };
    let declared = rates(graph)?;
    let mut all = Vec::new();
    for one in &own.parameters {
        let found = perturbation(settings, graph, one)?;
        let moved = |part: f64| -> Result<Vec<f64>, Error> {
            if !found.allows(part) {
                let problem = format!(
                    "{} would leave the range that its FMU declares at one width from its value; make the width smaller",
                    found.name
                );
                return Err(settings.source.error_at(one.variables[0].place, problem));
            }
            let mut graph = graph.clone();
            for place in &found.places {
                let start = Start::Real(place.perturbed(part));
                graph.components[place.component].set_start(place.variable, start);
            }
            rates(&graph)
        };
        let (high, low) = (moved(1.0)?, moved(-1.0)?);
        if high == declared && low == declared {
            let problem = format!("{} does not move the system; learn something that does", found.name);
            return Err(settings.source.error_at(one.variables[0].place, problem));
        }
        let linear = high.iter().zip(&low).zip(&declared).all(|((high, low), declared)| {
            let size = high.abs().max(low.abs()).max(declared.abs()).max(1.0);
            (high + low - 2.0 * declared).abs() <= ROUNDING * size
        });
        let variables = one.variables.iter().zip(&found.places);
        let variables = variables
            .map(|(name, place)| (name.text.clone(), place.perturbed(1.0), place.perturbed(-1.0)))
            .collect();
        all.push(Learned { name: found.name.clone(), variables, linear });
    }
    Ok(all)
}
