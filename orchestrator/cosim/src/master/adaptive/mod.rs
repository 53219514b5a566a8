//! Adaptive communication steps for the Gauss-Seidel, Jacobi and interface-Jacobian masters.
//!
//! Under Gauss-Seidel and Jacobi, every step is made with held (or extrapolated) inputs and repeated from the saved
//! states with inputs that run toward the result of the previous pass; the last pass is kept, and its difference to
//! the one before is the estimate of the error. Gauss-Seidel is repeated once, Jacobi as often as there are components
//! (those that share an algebraic loop count as one), so that what a pass hands on arrives everywhere. Under the
//! interface-Jacobian master every step is made once whole and once in two halves; the halves are kept as communication
//! steps, and their difference to the whole is the estimate.
//!
//! From the estimate a PI controller chooses the next step. A step whose error is too large, or that a slave does not
//! make, is taken back and tried shorter. Steps end at samples of components and of the inputs; under the
//! interface-Jacobian master, which lets sampled components take their own steps, they may span whole samples.
//!
//! The steps themselves are those of [`Master`]; FMUs that cannot take a step back are refused.

mod control;
mod estimate;
mod inputs;
mod memory;
mod stops;

use std::sync::atomic::Ordering;
use std::time::Instant;

use super::simulate::{End, REPORT_EVERY, Run, Stimulus, Watch};
use super::{Algorithm, Error, Master, Progress, Settings, Stop, Values};
use crate::results::Recorder;
use crate::results::summary::AdaptiveRecord;
use crate::system::SystemGraph;
use crate::system::graph::Source;
use airloop_fmi::{StepStatus, Variability};
use control::Control;
use estimate::Estimate;
use inputs::Inputs;
use memory::Memory;
use stops::{Pair, Stops};

/// Settings of adaptive communication steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptive {
    /// Error of one step, relative to the largest absolute value of the signal so far (at least a hundredth of its
    /// nominal value); in (0, 1), default 1e-4.
    pub tolerance: f64,
    /// Shortest communication step \[s\]; default: a millionth of [`Settings::step_size`], which is the first step.
    pub min_step: Option<f64>,
    /// Longest communication step \[s\]; default: ten times [`Settings::step_size`].
    pub max_step: Option<f64>,
}

/// Default tolerance.
const TOLERANCE: f64 = 1e-4;
/// Default limits of the step, relative to the first.
const LIMITS: (f64, f64) = (1e-6, 10.0);
/// Rows reserved before the run.
const ROWS: usize = 1 << 14;

impl Default for Adaptive {
    fn default() -> Self {
        Adaptive { tolerance: TOLERANCE, min_step: None, max_step: None }
    }
}

impl Adaptive {
    /// Shortest and longest communication step \[s\] of a run whose first step is `first` \[s\] long.
    ///
    /// # Errors
    /// [`Error::Setting`] names what is out of range.
    pub fn limits(&self, first: f64) -> Result<(f64, f64), Error> {
        let wrong = |name, value, allowed| Err(Error::Setting { name, value, allowed });
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return wrong("step-tolerance", self.tolerance, "between 0 and 1");
        }
        let max = self.max_step.unwrap_or((LIMITS.1 * first).max(self.min_step.unwrap_or(0.0)));
        if !(max.is_finite() && max > 0.0) {
            return wrong("max-step", max, "positive");
        }
        let min = self.min_step.unwrap_or((LIMITS.0 * first).min(max));
        if !(min > 0.0 && min <= max) {
            return wrong("min-step", min, "positive and not above the longest step (--max-step)");
        }
        Ok((min, max))
    }
}

/// Runs a system with adaptive communication steps; see [`super::simulate::run`].
pub(super) fn run(
    graph: &SystemGraph,
    settings: &Settings,
    adaptive: Adaptive,
    stimulus: Option<&Stimulus>,
    watch: Watch,
) -> Result<Run, Error> {
    let began = Instant::now();
    settings.validate()?;
    let (min, max) = adaptive.limits(settings.step_size)?;
    let (start, stop) = (settings.start_time, settings.stop_time);
    refuse(graph)?;
    let spanning = settings.algorithm == Algorithm::InterfaceJacobian;
    let mut inputs = Inputs::new(graph, stimulus, spanning);
    let mut first = Vec::new();
    inputs.at(start, |input, value| first.push((input, value)));
    // The longest whole step: what the master reserves for one has to do for all.
    let longest = if stop > start { (2.0 * max).min(stop - start) } else { 2.0 * max };
    let mut master = Master::new(graph, &Settings { step_size: longest, ..*settings }, &first)?;
    master.nodes.iter_mut().for_each(|node| node.keep_states());
    let samples = sample_times(graph);
    let sampled = |component: usize| samples.iter().any(|&(owner, _)| owner == component);
    let stops = inputs.stops(graph, sampled).iter().copied();
    let stops = Stops::new((start, stop), stops, samples.iter().map(|&(_, time)| time).collect(), spanning);
    // Of the pass that is compared: the whole step, or the last but one, which is at least as good as the first.
    let order = if spanning { 2 } else { 1 };
    let method = match settings.algorithm {
        Algorithm::InterfaceJacobian => Method::Halves,
        Algorithm::Jacobi => Method::Passes(master.blocks() + 1),
        _ => Method::Passes(2),
    };
    let estimate = Estimate::new(graph, &master.wiring, &master.values, order);
    let values = &master.values;
    let width = [values.reals.len(), values.integers.len(), values.booleans.len()];
    let mut recorder = Recorder::new(master.columns(graph), width, ROWS);
    record(&mut recorder, start, values);
    let mut notes = master.notes().to_vec();
    if estimate.is_blind() {
        notes.push("no continuous output is connected: there is no error to control, and steps are as long as --max-step and samples allow".into());
    }
    let initialization = began.elapsed();
    let began = Instant::now();
    let mut stepper = Stepper {
        memory: Memory::new(&master),
        middle: master.values.clone(),
        control: Control::new(settings.step_size, (min, max), order + 1),
        master,
        method,
        inputs,
        stops,
        estimate,
        tolerance: adaptive.tolerance,
        work: AdaptiveRecord::new(adaptive.tolerance, min, max),
    };
    let end = stepper.integrate((start, stop), &mut recorder, watch);
    let stepping = began.elapsed();
    Ok(Run {
        result: recorder.finish()?,
        end,
        steps: stepper.work.accepted,
        effort: stepper.master.effort(),
        initialization,
        stepping,
        notes,
        integration: None,
        adaptive: Some(stepper.work),
        state_events: Vec::new(),
    })
}

/// Refuses FMUs that cannot take a step back or change its length.
fn refuse(graph: &SystemGraph) -> Result<(), Error> {
    for component in &graph.components {
        let interface = component.fmu.description.co_simulation.clone().unwrap_or_default();
        let reason = match () {
            () if !interface.can_get_and_set_fmu_state => {
                "cannot save and restore its state (canGetAndSetFMUstate), so no step can be taken back"
            }
            () if !interface.can_handle_variable_communication_step_size => {
                "cannot handle steps of different length (canHandleVariableCommunicationStepSize)"
            }
            () => continue,
        };
        return Err(Error::NotAdaptive { component: component.name.clone(), reason });
    }
    Ok(())
}

/// Components with connected discrete outputs, and their sample times \[s\] (step size of their default experiment).
fn sample_times(graph: &SystemGraph) -> Vec<(usize, f64)> {
    let mut owners: Vec<usize> = graph
        .connections
        .iter()
        .filter_map(|connection| match connection.source {
            Source::Output { component, variable } => Some((component, variable)),
            Source::Input(_) => None,
        })
        .filter(|&(component, variable)| {
            let description = &graph.components[component].fmu.description;
            description.variables[variable].variability == Variability::Discrete
        })
        .map(|(component, _)| component)
        .collect();
    owners.sort_unstable();
    owners.dedup();
    let time = |owner: usize| graph.components[owner].fmu.description.default_experiment.step_size;
    owners
        .into_iter()
        .filter_map(|owner| time(owner).filter(|time| *time > 0.0).map(|time| (owner, time)))
        .collect()
}

fn record(recorder: &mut Recorder, time: f64, values: &Values) {
    recorder.record(time, &values.reals, &values.integers, &values.booleans);
}

/// Method that makes a step and estimates its error.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Method {
    /// Whole and in two halves.
    Halves,
    /// So many times, each after the first with inputs that run toward the result of the one before.
    Passes(usize),
}

/// The master that steps and the values it remembers.
struct Stepper<'a> {
    master: Master,
    method: Method,
    inputs: Inputs<'a>,
    stops: Stops,
    control: Control,
    estimate: Estimate,
    memory: Memory,
    /// Values in the middle of the step.
    middle: Values,
    tolerance: f64,
    work: AdaptiveRecord,
}

/// A step that was not made, with its time and length \[s\].
struct Trouble {
    stop: Stop,
    time: f64,
    step: f64,
}

impl Stepper<'_> {
    fn integrate(&mut self, (start, stop): (f64, f64), recorder: &mut Recorder, watch: Watch) -> End {
        let mut reported = Instant::now();
        let mut t = start;
        while t < stop {
            let pair = self.next_pair(t);
            match self.try_pair(pair) {
                Ok(true) => {}
                Ok(false) => continue,
                Err(end) => return end,
            }
            t = pair.end;
            if self.method == Method::Halves {
                record(recorder, pair.middle, &self.middle);
            }
            let (master, inputs) = (&mut self.master, &mut self.inputs);
            inputs.at(t, |input, value| master.set_input(input, value));
            record(recorder, t, &self.master.values);
            if watch.stop.load(Ordering::Relaxed) {
                return End::Interrupted;
            }
            if reported.elapsed() > REPORT_EVERY {
                reported = Instant::now();
                let done = self.work.accepted;
                (watch.progress)(done, (done as f64 * (stop - start) / (t - start)) as u64);
            }
        }
        End::Completed
    }

    /// Tries a step; true if it is accepted, false if a shorter one is to be tried, or why the run ends.
    fn try_pair(&mut self, pair: Pair) -> Result<bool, End> {
        let fmu = |error| End::Failed(Error::Fmu(error));
        self.memory.save(&mut self.master).map_err(fmu)?;
        let (h, tried) = match self.method {
            Method::Halves => (pair.half(), self.whole_and_halves(pair)),
            Method::Passes(count) => (pair.end - pair.begin, self.passes(pair, count)),
        };
        let error = match tried {
            Ok(verdict) if verdict.error <= 1.0 => {
                self.control.accept(h, verdict.error);
                self.estimate.accept(&self.master.values);
                match self.method {
                    Method::Halves => {
                        self.work.accept(pair.middle - pair.begin);
                        self.work.accept(pair.end - pair.middle);
                    }
                    Method::Passes(_) => self.work.accept(h),
                }
                return Ok(true);
            }
            Ok(verdict) => Ok(verdict),
            // Errors of an FMU are final: its state cannot be restored any more.
            Err(Trouble { stop: Stop::Fmu(error), .. }) => return Err(End::Failed(Error::Fmu(*error))),
            Err(trouble) => Err(trouble),
        };
        self.work.rejected += 1;
        let relative = error.as_ref().ok().map(|verdict| verdict.error);
        if self.control.reject(h, relative) {
            self.memory.restore(&mut self.master).map_err(fmu)?;
            return Ok(false);
        }
        if let Err(Trouble { stop: Stop::Incomplete { node, status }, .. }) = &error
            && let StepStatus::Discarded { terminated: true, .. } = status
        {
            // The last row is as close to the end that the component wants as the shortest step allows.
            let component = self.master.nodes[*node].name().to_owned();
            return Err(End::Terminated { component, time: Some(pair.begin) });
        }
        Err(End::Failed(match error {
            Ok(verdict) => {
                let (component, variable) = self.estimate.name(verdict.signal);
                let (time, error) = (pair.begin, verdict.error * self.tolerance);
                Error::StepTooShort { component, variable, time, step: h, error }
            }
            Err(Trouble { stop, time, step }) => match self.master.explain(stop, (time, step), time + step) {
                Err(error) => error,
                Ok(Progress::Terminated { component, last_successful_time: time }) => {
                    return Err(End::Terminated { component, time });
                }
                Ok(Progress::Stepped) => return Ok(false),
            },
        }))
    }

    /// The next step to try.
    fn next_pair(&mut self, t: f64) -> Pair {
        let wanted = self.control.wanted;
        self.stops.pair(t, if self.method == Method::Halves { wanted } else { 0.5 * wanted })
    }

    /// The step, repeated.
    fn passes(&mut self, pair: Pair, count: usize) -> Result<estimate::Verdict, Trouble> {
        if let Some(extrapolation) = &mut self.master.extrapolation {
            extrapolation.look_no_further();
        }
        self.step(pair.begin, pair.end)?;
        for _ in 1..count {
            self.estimate.take_whole(&self.master.values);
            if let Some(extrapolation) = &mut self.master.extrapolation {
                extrapolation.look_ahead();
            }
            let restored = self.memory.restore(&mut self.master);
            restored.map_err(|error| Trouble { stop: error.into(), time: pair.begin, step: 0.0 })?;
            self.step(pair.begin, pair.end)?;
        }
        Ok(self.estimate.judge(&self.master.values, self.tolerance))
    }

    /// The whole step, then its halves.
    fn whole_and_halves(&mut self, pair: Pair) -> Result<estimate::Verdict, Trouble> {
        self.step(pair.begin, pair.end)?;
        self.estimate.take_whole(&self.master.values);
        let restored = self.memory.restore(&mut self.master);
        restored.map_err(|error| Trouble { stop: error.into(), time: pair.begin, step: 0.0 })?;
        self.step(pair.begin, pair.middle)?;
        let (master, inputs) = (&mut self.master, &mut self.inputs);
        inputs.at(pair.middle, |input, value| master.set_input(input, value));
        self.middle.copy_from(&self.master.values);
        self.step(pair.middle, pair.end)?;
        Ok(self.estimate.judge(&self.master.values, self.tolerance))
    }

    fn step(&mut self, begin: f64, end: f64) -> Result<(), Trouble> {
        self.inputs.put(&mut self.master, begin, end);
        let step = end - begin;
        self.master.advance(begin, step).map_err(|stop| Trouble { stop, time: begin, step })
    }
}
