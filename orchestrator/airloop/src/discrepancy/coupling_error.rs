//! Coupling error of a run: the system again with half and a quarter of the communication step, under its own master
//! and under others, and which of them reaches a goal with the fewest FMU steps.
//!
//! The inputs of the system are held over the communication steps of the run in all of them, so that what is
//! estimated is the exchange between components and not how often a command is sampled.

use std::sync::atomic::{AtomicBool, Ordering};

use super::Error;
use super::richardson::{Estimate, estimate};
use airloop_cosim::master::simulate::{self, End, Run, Stimulus, Watch};
use airloop_cosim::master::{Algorithm, Coupling, Settings};
use airloop_cosim::results::coupling_error::{
    CouplingErrorRecord, MasterErrorRecord, RecommendationRecord, SignalErrorRecord, Standing,
};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{DataType, Source};
use airloop_series::{Interpolation, TimeSeries};

/// Target of a recommendation.
#[derive(Debug, Clone, PartialEq)]
pub struct Goal {
    /// Error relative to the RMS of the signal, e.g. 1e-4.
    pub relative: f64,
    /// Signals that have to reach it.
    pub signals: Vec<String>,
}

/// A signal that is looked at.
#[derive(Debug)]
struct Signal {
    name: String,
    unit: Option<String>,
    kind: &'static str,
    /// Discrete: held over an interval and stamped with its start.
    held: bool,
}

impl Goal {
    /// A goal for these signals; none means all Real outputs of the system, or all signals if it has none.
    ///
    /// # Errors
    /// [`Error::NoSignal`] for a name that is neither a Real output of the system nor a connected Real output.
    pub fn new(graph: &SystemGraph, relative: f64, names: &[String]) -> Result<Goal, Error> {
        let known = signals(graph);
        if let Some(name) = names.iter().find(|name| known.iter().all(|signal| signal.name != **name)) {
            let known = known.into_iter().map(|signal| signal.name).collect::<Vec<_>>().join(", ");
            return Err(Error::NoSignal { name: name.clone(), known });
        }
        let outputs: Vec<&Signal> = known.iter().filter(|signal| signal.kind == "output").collect();
        let all = if outputs.is_empty() { known.iter().collect() } else { outputs };
        let signals = match names {
            [] => all.into_iter().map(|signal| signal.name.clone()).collect(),
            names => names.to_vec(),
        };
        Ok(Goal { relative, signals })
    }
}

/// Real outputs of the system, then connected Real outputs of components that are not such outputs.
fn signals(graph: &SystemGraph) -> Vec<Signal> {
    let mut found = Vec::new();
    let mut sources = Vec::new();
    for output in graph.outputs.iter().filter(|output| output.data_type == DataType::Real) {
        let Source::Output { component, variable } = output.source else { continue };
        sources.push((component, variable));
        let held = graph.is_held(component, variable);
        found.push(Signal { name: output.name.clone(), unit: output.unit.clone(), kind: "output", held });
    }
    for connection in &graph.connections {
        let Source::Output { component, variable } = connection.source else { continue };
        let owner = &graph.components[component];
        let description = &owner.fmu.description.variables[variable];
        if sources.contains(&(component, variable)) || DataType::of(description) != DataType::Real {
            continue;
        }
        sources.push((component, variable));
        found.push(Signal {
            name: owner.path_of(variable),
            unit: airloop_cosim::system::graph::unit_of(description).map(str::to_owned),
            kind: "connection",
            held: graph.is_held(component, variable),
        });
    }
    found
}

/// Repeats a completed `run` with `settings` and estimates its coupling error; `None` if `stop` was set meanwhile.
///
/// # Errors
/// [`Error::NoRefinement`] if the run itself cannot be repeated with half and a quarter of its step.
pub fn investigate(
    graph: &SystemGraph,
    settings: &Settings,
    run: &Run,
    goal: &Goal,
    stop: &AtomicBool,
) -> Result<Option<CouplingErrorRecord>, Error> {
    let signals = signals(graph);
    let held = held_inputs(graph, &run.result)?;
    let study = Study { graph, signals: &signals, stimulus: held.stimulus(), stop };
    let halves = match study.finer(settings) {
        Ok(Some(halves)) => halves,
        Ok(None) => return Ok(None),
        Err(problem) => return Err(Error::NoRefinement { problem }),
    };
    let estimates = study.estimates(&run.result, &halves);
    let fmu_steps = run.effort.fmu_steps.iter().sum();
    let mut masters = vec![judge(settings, fmu_steps, &signals, &estimates, goal)];
    for other in others(graph, settings) {
        match study.all(&other) {
            Ok(Some((fmu_steps, estimates))) => {
                masters.push(judge(&other, fmu_steps, &signals, &estimates, goal));
            }
            Ok(None) => return Ok(None),
            Err(problem) => masters.push(MasterErrorRecord {
                options: options(&other),
                fmu_steps: 0,
                worst_percent: None,
                worst_signal: None,
                trusted: false,
                step_for_goal: None,
                problem: Some(problem),
            }),
        }
    }
    let recommendation = masters
        .iter()
        .filter_map(|master| {
            let step_size = master.step_for_goal?;
            let fmu_steps = (master.fmu_steps as f64 * (settings.step_size / step_size)).round() as u64;
            Some(RecommendationRecord { options: master.options.clone(), step_size, fmu_steps })
        })
        .min_by_key(|found| found.fmu_steps);
    let records = signals.iter().zip(&estimates).map(|(signal, estimate)| SignalErrorRecord {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        kind: signal.kind.into(),
        rms_error: estimate.error,
        relative_percent: estimate.relative.map(|relative| 100.0 * relative),
        order: estimate.order,
        standing: estimate.standing,
    });
    Ok(Some(CouplingErrorRecord {
        step_size: settings.step_size,
        goal_percent: 100.0 * goal.relative,
        goal_signals: goal.signals.clone(),
        signals: records.collect(),
        masters,
        recommendation,
    }))
}

/// Inputs of the system as the run had them.
struct HeldInputs {
    series: TimeSeries,
    links: Vec<(usize, usize, f64, f64)>,
}

impl HeldInputs {
    fn stimulus(&self) -> Stimulus<'_> {
        Stimulus { series: &self.series, links: self.links.clone(), interpolation: Interpolation::Hold }
    }
}

fn held_inputs(graph: &SystemGraph, result: &TimeSeries) -> Result<HeldInputs, Error> {
    let mut series = TimeSeries::new(result.time().to_vec())?;
    let mut links = Vec::new();
    for (index, input) in graph.inputs.iter().enumerate() {
        if let Some(channel) = result.channel(&input.name) {
            links.push((index, series.channels().len(), 1.0, 0.0));
            series.push(input.name.clone(), None, channel.values.clone())?;
        }
    }
    Ok(HeldInputs { series, links })
}

/// Data that all runs have in common.
struct Study<'a> {
    graph: &'a SystemGraph,
    signals: &'a [Signal],
    stimulus: Stimulus<'a>,
    stop: &'a AtomicBool,
}

impl Study<'_> {
    /// One run to its end; `None` if it was interrupted, a text if it failed.
    fn once(&self, settings: &Settings) -> Result<Option<Run>, String> {
        let step = settings.step_size;
        let name = |problem: String| format!("with step {step} s: {problem}");
        let watch = Watch { stop: self.stop, progress: &mut |_, _| {} };
        let run = simulate::run(self.graph, settings, Some(&self.stimulus), watch)
            .map_err(|error| name(error.to_string()))?;
        match run.end {
            End::Completed if !self.stop.load(Ordering::Relaxed) => Ok(Some(run)),
            End::Completed | End::Interrupted => Ok(None),
            End::Failed(error) => Err(name(error.to_string())),
            End::Terminated { component, .. } => {
                Err(name(format!("component {component} ended the simulation")))
            }
        }
    }

    fn finer(&self, settings: &Settings) -> Result<Option<[Run; 2]>, String> {
        let step_size = settings.step_size;
        let half = self.once(&Settings { step_size: step_size / 2.0, ..*settings })?;
        let Some(half) = half else { return Ok(None) };
        let quarter = self.once(&Settings { step_size: step_size / 4.0, ..*settings })?;
        Ok(quarter.map(|quarter| [half, quarter]))
    }

    /// FMU steps at the full step, and the estimates of all signals.
    fn all(&self, settings: &Settings) -> Result<Option<(u64, Vec<Estimate>)>, String> {
        let Some(full) = self.once(settings)? else { return Ok(None) };
        let Some(finer) = self.finer(settings)? else { return Ok(None) };
        let fmu_steps = full.effort.fmu_steps.iter().sum();
        Ok(Some((fmu_steps, self.estimates(&full.result, &finer))))
    }

    fn estimates(&self, full: &TimeSeries, [half, quarter]: &[Run; 2]) -> Vec<Estimate> {
        let estimate = |signal: &Signal| {
            let [y, y_half, y_quarter] =
                [full, &half.result, &quarter.result].map(|series| at(series, signal, full.time()));
            estimate(&y, &y_half, &y_quarter)
        };
        self.signals.iter().map(estimate).collect()
    }
}

/// Values read from the FMU at these times, all of which are communication points up to rounding. Those of a discrete
/// output stand one row earlier, at the start of the interval.
fn at(series: &TimeSeries, signal: &Signal, times: &[f64]) -> Vec<f64> {
    let Some(channel) = series.channel(&signal.name) else { return Vec::new() };
    let mut row = 0;
    let value = |&t: &f64| {
        while row + 1 < series.len() && (series.time()[row + 1] - t).abs() <= (series.time()[row] - t).abs() {
            row += 1;
        }
        channel.values[row.saturating_sub(usize::from(signal.held))]
    };
    times.iter().skip(usize::from(signal.held)).map(value).collect()
}

/// Masters to compare with, none for a system that has nothing to couple.
fn others(graph: &SystemGraph, settings: &Settings) -> Vec<Settings> {
    if graph.components.len() < 2 {
        return Vec::new();
    }
    let candidates = [
        (Algorithm::GaussSeidel, 0),
        (Algorithm::GaussSeidel, 1),
        (Algorithm::Jacobi, 0),
        (Algorithm::InterfaceJacobian, 0),
    ];
    candidates
        .map(|(algorithm, extrapolation)| Settings {
            algorithm,
            extrapolation,
            coupling: Coupling::default(),
            ..*settings
        })
        .into_iter()
        .filter(|other| options(other) != options(settings))
        .collect()
}

/// Settings as options on the command line.
fn options(settings: &Settings) -> String {
    let mut text = format!("--master {}", settings.algorithm);
    if settings.extrapolation > 0 {
        text += &format!(" --extrapolation {}", settings.extrapolation);
    }
    let (coupling, default) = (settings.coupling, Coupling::default());
    if settings.algorithm == Algorithm::InterfaceJacobian {
        match coupling.tolerance {
            Some(tolerance) => text += &format!(" --iterate {tolerance}"),
            None if coupling.corrections != default.corrections => {
                text += &format!(" --corrections {}", coupling.corrections);
            }
            None => {}
        }
        if !coupling.ramped {
            text += " --inputs held";
        }
    }
    text
}

/// Worst signal of a master and the step with which all reach the goal.
fn judge(
    settings: &Settings,
    fmu_steps: u64,
    signals: &[Signal],
    estimates: &[Estimate],
    goal: &Goal,
) -> MasterErrorRecord {
    let wanted = || {
        let pairs = signals.iter().zip(estimates);
        pairs.filter(|(signal, _)| goal.signals.contains(&signal.name))
    };
    let error = |estimate: &Estimate| estimate.relative.unwrap_or(0.0);
    let worst = wanted().max_by(|(_, a), (_, b)| error(a).total_cmp(&error(b)));
    let mut smallest = Some(1.0f64);
    for (_, estimate) in wanted().filter(|(_, estimate)| error(estimate) > goal.relative) {
        let part = estimate
            .order
            .filter(|_| estimate.standing == Standing::Asymptotic)
            .map(|order| (goal.relative / error(estimate)).powf(1.0 / order));
        smallest = smallest.zip(part).map(|(smallest, part)| smallest.min(part));
    }
    MasterErrorRecord {
        options: options(settings),
        fmu_steps,
        worst_percent: worst.map(|(_, estimate)| 100.0 * error(estimate)),
        worst_signal: worst.map(|(signal, _)| signal.name.clone()),
        trusted: wanted().all(|(_, estimate)| estimate.standing != Standing::NotAsymptotic),
        step_for_goal: smallest.map(|part| settings.step_size / divisor(1.0 / part)),
        problem: None,
    }
}

/// Next number of the row 1, 2, 4, 5, 8, 10, 20, 40 ...: parts of a step that are short decimals.
fn divisor(least: f64) -> f64 {
    let mut decade = 1.0;
    loop {
        for digit in [1.0, 2.0, 4.0, 5.0, 8.0] {
            if digit * decade >= least || !least.is_finite() {
                return digit * decade;
            }
        }
        decade *= 10.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_read_at_the_communication_points_of_the_run() {
        let mut series = TimeSeries::new(vec![0.0, 0.5, 1.0 - 1e-16, 1.5, 2.0]).unwrap();
        series.push("y", None, vec![0.0, 1.0, 2.0, 3.0, 4.0]).unwrap();
        let signal = |held| Signal { name: "y".into(), unit: None, kind: "output", held };
        assert_eq!(at(&series, &signal(false), &[0.0, 1.0, 2.0]), [0.0, 2.0, 4.0]);
        assert_eq!(at(&series, &signal(true), &[0.0, 1.0, 2.0]), [1.0, 3.0]);
    }

    #[test]
    fn steps_are_divided_into_short_decimals() {
        for (least, expected) in
            [(1.0, 1.0), (1.1, 2.0), (3.0, 4.0), (8.5, 10.0), (10.1, 20.0), (900.0, 1000.0)]
        {
            assert_eq!(divisor(least), expected);
        }
    }

    #[test]
    fn the_step_for_the_goal_follows_the_order_and_needs_an_estimate_that_holds() {
        let signals = [Signal { name: "x".into(), unit: None, kind: "output", held: false }];
        let goal = Goal { relative: 1e-4, signals: vec!["x".into()] };
        let judged = |relative: f64, order: f64, standing: Standing| {
            let estimate = Estimate { error: 1.0, relative: Some(relative), order: Some(order), standing };
            judge(&Settings::default(), 10, &signals, &[estimate], &goal)
        };
        // 8.3 times too much: a tenth of the step at order 1, at order 2 a third, rounded to a quarter.
        assert_eq!(judged(8.3e-4, 1.0, Standing::Asymptotic).step_for_goal, Some(1e-4));
        assert_eq!(judged(8.3e-4, 2.0, Standing::Asymptotic).step_for_goal, Some(2.5e-4));
        assert_eq!(judged(5e-5, 1.0, Standing::Asymptotic).step_for_goal, Some(1e-3));
        let unknown = judged(8.3e-4, -1.0, Standing::NotAsymptotic);
        assert_eq!((unknown.step_for_goal, unknown.trusted), (None, false));
    }
}
