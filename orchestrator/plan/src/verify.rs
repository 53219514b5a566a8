//! Verification of a plan: its command, rolled out from its initial state through a master.

use std::sync::atomic::AtomicBool;

use super::Error;
use super::catalog::{Catalog, Kind};
use super::prepare::Setup;
use super::sampling;
use airloop_cosim::master::simulate::{self, Curves, End, Stimulus, Watch};
use airloop_cosim::master::{Algorithm, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_series::{Interpolation, TimeSeries};

/// A command over time, as the transcription understands it.
pub struct Command<'a> {
    /// Inputs by index into the catalog.
    pub inputs: &'a [usize],
    /// Times \[s\] between which the inputs are smooth, increasing, from the start to the end.
    pub knots: &'a [f64],
    /// Inputs in the interval that begins at a knot: (interval, time) to values.
    pub values: &'a dyn Fn(usize, f64) -> Vec<f64>,
    /// Whether the inputs are constant between the knots.
    pub held: bool,
}

impl Command<'_> {
    /// The command at times that step from the start to the end, each value held until the next.
    ///
    /// # Errors
    /// [`Error::Series`] when there are no such times; [`Error::Place`] when there are too many.
    pub fn sampled(&self, catalog: &Catalog, step: f64) -> Result<TimeSeries, Error> {
        let (start, end) = (self.knots[0], self.knots[self.knots.len() - 1]);
        super::size::check_samples(end - start, step)?;
        let count = ((end - start) / step * (1.0 + 1e-12) + 1e-9).floor() as usize;
        let mut time: Vec<f64> = (0..=count).map(|k| start + k as f64 * step).collect();
        if end - time[count] > 1e-9 * step {
            time.push(end);
        }
        let mut interval = 0;
        let rows: Vec<Vec<f64>> = time
            .iter()
            .map(|&t| {
                // A knot belongs to the interval that it begins.
                while interval + 2 < self.knots.len() && t >= self.knots[interval + 1] - 1e-9 * step {
                    interval += 1;
                }
                (self.values)(interval, t.clamp(self.knots[interval], self.knots[interval + 1]))
            })
            .collect();
        self.series(catalog, time, &rows)
    }

    /// The command as planned: constant, or the parabola through the ends and the middle of each interval.
    fn curves(&self, graph: &SystemGraph, catalog: &Catalog) -> Curves {
        let place = |&input: &usize| {
            let name = &catalog.variables()[input].name;
            graph.inputs.iter().position(|one| one.name == *name)
        };
        let places: Vec<Option<usize>> = self.inputs.iter().map(place).collect();
        let mut pieces = Vec::with_capacity(self.knots.len());
        for (interval, ends) in self.knots.windows(2).enumerate() {
            let length = ends[1] - ends[0];
            let at = |part: f64| (self.values)(interval, ends[0] + part * length);
            let (first, middle, last) = (at(0.0), at(0.5), at(1.0));
            let piece = |(column, place): (usize, &Option<usize>)| {
                let (a, m, b) = (first[column], middle[column], last[column]);
                let held = self.held || graph.input_is_held((*place)?);
                Some(match held {
                    true => [a, 0.0, 0.0, 0.0],
                    false => {
                        let (slope, square) = (4.0 * m - 3.0 * a - b, 2.0 * (a + b) - 4.0 * m);
                        [a, slope / length, square / (length * length), 0.0]
                    }
                })
            };
            pieces.push(places.iter().enumerate().filter_map(piece).collect());
        }
        Curves { knots: self.knots.to_vec(), inputs: places.into_iter().flatten().collect(), pieces }
    }

    fn series(&self, catalog: &Catalog, time: Vec<f64>, rows: &[Vec<f64>]) -> Result<TimeSeries, Error> {
        let mut series = TimeSeries::new(time)?;
        for (column, &input) in self.inputs.iter().enumerate() {
            let variable = &catalog.variables()[input];
            let values = rows.iter().map(|row| row[column]).collect();
            series.push(variable.name.clone(), variable.unit.clone(), values)?;
        }
        Ok(series)
    }
}

/// Settings of the roll-out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Master of the sampled roll-out; the continuous one is always monolithic.
    pub master: Algorithm,
    /// Communication step and, where nothing is sampled, hold of the command \[s\].
    pub step: f64,
    /// Relative tolerance of the integrators.
    pub tolerance: Option<f64>,
}

/// A roll-out.
#[derive(Debug, Clone, PartialEq)]
pub struct Rollout {
    /// States that can be seen, by their names, at the communication points.
    pub states: TimeSeries,
    /// All outputs at the communication points, by the names of components.
    pub outputs: TimeSeries,
    /// Times \[s\] of the state events; only where all is continuous.
    pub events: Vec<f64>,
    /// Reason why it ended before its time, if it did.
    pub problem: Option<String>,
}

/// Both roll-outs of a plan.
#[derive(Debug)]
pub struct Rollouts {
    /// All components in continuous time.
    pub continuous: Result<Rollout, Error>,
    /// The system as it is, the command held over each step.
    pub sampled: Result<Rollout, Error>,
}

/// Rolls a command out from `initial` (value of each of `states`, by index into the catalog), both ways at once.
///
/// # Errors
/// [`Error::Series`] for a command without times.
pub fn roll_out(
    graph: &SystemGraph,
    catalog: &Catalog,
    (states, initial): (&[usize], &[f64]),
    command: &Command,
    options: Options,
    stop: &AtomicBool,
) -> Result<Rollouts, Error> {
    let place = "the roll-out";
    let mut started = graph.clone();
    for (&state, &value) in states.iter().zip(initial) {
        let variable = &catalog.variables()[state];
        if variable.start != Some(value) {
            started.set_start(&variable.path, &value.to_string(), place)?;
        }
    }
    let smooth = sampling::in_continuous_time(&started);
    let (curves, sampled) = (command.curves(&smooth, catalog), command.sampled(catalog, options.step)?);
    let along = Options { master: Algorithm::Monolithic, ..options };
    let (along, held) = ((Inputs::Along(&curves), along), (Inputs::Held(&sampled), options));
    let one = |graph: &SystemGraph, (inputs, options): &(Inputs, Options)| {
        simulate(graph, catalog, states, inputs, *options, stop)
    };
    let (continuous, sampled) = rayon::join(|| one(&smooth, &along), || one(&started, &held));
    Ok(Rollouts { continuous, sampled })
}

/// The states that can be seen of a system that has been put somewhere, with its events, a moment later; none where it
/// cannot be there.
pub(super) fn moment_later(setup: &Setup, states: &[f64], inputs: &[f64]) -> Option<TimeSeries> {
    let signals = &setup.task.signals;
    let mut graph = setup.graph.clone();
    for (&state, value) in signals.states.iter().zip(states) {
        graph.set_start(&setup.catalog.variables()[state].path, &value.to_string(), "a state").ok()?;
    }
    let graph = sampling::in_continuous_time(&graph);
    let mut series = TimeSeries::new(vec![0.0, RUN_LENGTH]).ok()?;
    for (&input, &value) in signals.inputs.iter().zip(inputs) {
        let variable = &setup.catalog.variables()[input];
        series.push(variable.name.clone(), variable.unit.clone(), vec![value; 2]).ok()?;
    }
    let options = Options { master: Algorithm::Monolithic, step: RUN_LENGTH, tolerance: None };
    let stop = AtomicBool::new(false);
    let later = simulate(&graph, &setup.catalog, &signals.states, &Inputs::Held(&series), options, &stop);
    Some(later.ok()?.states)
}

/// Length of a moment \[s\].
const RUN_LENGTH: f64 = 1e-6;

/// Inputs of a roll-out.
enum Inputs<'a> {
    Along(&'a Curves),
    Held(&'a TimeSeries),
}

fn simulate(
    graph: &SystemGraph,
    catalog: &Catalog,
    states: &[usize],
    inputs: &Inputs,
    options: Options,
    stop: &AtomicBool,
) -> Result<Rollout, Error> {
    let time = match inputs {
        Inputs::Along(curves) => &curves.knots[..],
        Inputs::Held(series) => series.time(),
    };
    let settings = Settings {
        start_time: time[0],
        stop_time: time[time.len() - 1],
        step_size: options.step,
        algorithm: options.master,
        tolerance: options.tolerance,
        ..Settings::default()
    };
    let watch = Watch { stop, progress: &mut |_, _| {} };
    let run = match inputs {
        Inputs::Along(curves) => simulate::run_along(graph, &settings, curves, watch)?,
        Inputs::Held(series) => {
            let input = |name: &str| graph.inputs.iter().position(|input| input.name == name);
            let links = series.channels().iter().enumerate();
            let links =
                links.filter_map(|(channel, one)| Some((input(&one.name)?, channel, 1.0, 0.0))).collect();
            let stimulus = Stimulus { series, links, interpolation: Interpolation::Hold };
            simulate::run(graph, &settings, Some(&stimulus), watch)?
        }
    };
    let mut seen = TimeSeries::new(run.result.time().to_vec())?;
    for &state in states {
        let variable = &catalog.variables()[state];
        if variable.kind != Kind::State {
            continue;
        }
        // A connector may have a unit of its own; the output of the component has not.
        let column = column_of(graph, &variable.path);
        let channel = column.and_then(|column| run.result.channel(&column));
        if let Some(channel) = channel {
            seen.push(variable.name.clone(), variable.unit.clone(), channel.values.clone())?;
        }
    }
    let problem = match run.end {
        End::Completed => None,
        End::Terminated { component, time } => Some(format!(
            "component `{component}` ended the roll-out at t = {:.6} s",
            time.or(run.result.time().last().copied()).unwrap_or_default()
        )),
        End::Interrupted => Some("the roll-out was interrupted".into()),
        End::Failed(error) => Some(format!("the roll-out failed: {error}")),
    };
    Ok(Rollout { states: seen, outputs: run.result, events: run.state_events, problem })
}

/// Column of the result that shows a state: an output of its component with the same value reference.
fn column_of(graph: &SystemGraph, path: &str) -> Option<String> {
    for component in &graph.components {
        let description = &component.fmu.description;
        let named = |index: usize| match graph.single {
            true => description.variables[index].name.clone(),
            false => component.path_of(index),
        };
        let Some(state) = description.continuous_states().find(|&index| named(index) == path) else {
            continue;
        };
        let reference = description.variables[state].value_reference;
        let output = description.outputs.iter().map(|unknown| unknown.variable).find(|&output| {
            let variable = &description.variables[output];
            variable.value_reference == reference
                && matches!(variable.kind, airloop_fmi::VariableKind::Real(_))
        })?;
        return Some(match graph.single {
            true => description.variables[output].name.clone(),
            false => component.path_of(output),
        });
    }
    None
}
