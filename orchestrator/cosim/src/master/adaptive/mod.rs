//! Adaptive communication steps for the Gauss-Seidel, Jacobi and interface-Jacobian masters.
//!
//! Under Gauss-Seidel and Jacobi, every step is made with held (or extrapolated) inputs and repeated from the saved
//! states with inputs that run toward what the pass before has come to; the last pass is kept, and its difference to
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

use super::driver::{End, Run, Simulation};
use super::stepping::Scheme;
use super::stimulus::Stimulus;
use super::stop::Stop;
use super::{Adaptive, Algorithm, Error, Master, Settings, Values};
use crate::results::Recorder;
use crate::results::summary::AdaptiveRecord;
use crate::system::SystemGraph;
use crate::system::graph::Source;
use airloop_fmi::Variability;
use control::Control;
use estimate::Estimate;
use inputs::Inputs;
use memory::Memory;
use stops::{Pair, Stops};

/// Steps for whose rows memory is reserved before the run.
const RESERVED_STEPS: u64 = 1 << 14;

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

/// Method that makes a step and estimates its error.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Method {
    /// Whole and in two halves.
    Halves,
    /// So many times, each after the first with inputs that run toward the result of the one before.
    Passes(usize),
}

/// The master that steps and the values it remembers.
pub(super) struct AdaptiveSteps<'a> {
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
    /// Start, present and stop time \[s\].
    start: f64,
    time: f64,
    stop: f64,
}

/// A step that was not made, with its time and length \[s\].
struct Trouble {
    stop: Stop,
    time: f64,
    step: f64,
}

impl<'a> Simulation<'a> for AdaptiveSteps<'a> {
    type Inputs = (Adaptive, Option<&'a Stimulus<'a>>);

    fn initialize(
        graph: &'a SystemGraph,
        settings: &Settings,
        (adaptive, stimulus): Self::Inputs,
    ) -> Result<Self, Error> {
        settings.validate()?;
        let (min, max) = adaptive.limits(settings.step_size)?;
        let (start, stop) = (settings.start_time, settings.stop_time);
        refuse(graph)?;
        let spanning = settings.algorithm == Algorithm::InterfaceJacobian;
        let mut inputs = Inputs::new(graph, stimulus, spanning);
        // The longest whole step: what the master reserves for one has to do for all.
        let longest = if stop > start { (2.0 * max).min(stop - start) } else { 2.0 * max };
        let first = inputs.samples.list(start);
        let mut master = Master::new(graph, &Settings { step_size: longest, ..*settings }, &first)?;
        master.nodes.iter_mut().for_each(|node| node.keep_states());
        let samples = sample_times(graph);
        let sampled = |component: usize| samples.iter().any(|&(owner, _)| owner == component);
        let stops = inputs.stops(graph, sampled).iter().copied();
        let stops =
            Stops::new((start, stop), stops, samples.iter().map(|&(_, time)| time).collect(), spanning);
        // Of the pass that is compared: the whole step, or the last but one, which is at least as good as the first.
        let order = if spanning { 2 } else { 1 };
        let method = match settings.algorithm {
            Algorithm::InterfaceJacobian => Method::Halves,
            Algorithm::Jacobi => Method::Passes(master.blocks() + 1),
            _ => Method::Passes(2),
        };
        Ok(AdaptiveSteps {
            estimate: Estimate::new(graph, &master.wiring, &master.values, order),
            memory: Memory::new(&master),
            middle: master.values.clone(),
            control: Control::new(settings.step_size, (min, max), order + 1),
            tolerance: adaptive.tolerance,
            work: AdaptiveRecord::new(adaptive.tolerance, min, max),
            master,
            method,
            inputs,
            stops,
            start,
            time: start,
            stop,
        })
    }

    fn set_up(&mut self, graph: &SystemGraph) -> Result<Recorder, Error> {
        let mut rows = self.master.values.recorder(self.master.columns(graph), RESERVED_STEPS);
        self.master.values.record(&mut rows, self.start);
        Ok(rows)
    }

    fn step(&mut self, rows: &mut Recorder) -> Result<(), End> {
        let mut pair = self.next_pair();
        while !self.try_pair(pair)? {
            pair = self.next_pair();
        }
        self.time = pair.end;
        if self.method == Method::Halves {
            self.middle.record(rows, pair.middle);
        }
        self.set_inputs(pair.end);
        self.master.values.record(rows, pair.end);
        Ok(())
    }

    fn is_finished(&self) -> bool {
        self.time >= self.stop
    }

    fn progress(&self) -> (u64, u64) {
        let done = self.work.accepted;
        (done, (done as f64 * (self.stop - self.start) / (self.time - self.start)) as u64)
    }

    fn account(self, run: &mut Run) {
        run.effort = self.master.effort();
        run.notes = self.master.notes().to_vec();
        if self.estimate.is_blind() {
            run.notes.push("no continuous output is connected: there is no error to control, and steps are as long as --max-step and samples allow".into());
        }
        run.adaptive = Some(self.work);
    }
}

impl AdaptiveSteps<'_> {
    /// Sets the inputs of the system to their values at `t` \[s\].
    fn set_inputs(&mut self, t: f64) {
        let master = &mut self.master;
        self.inputs.samples.at(t, |input, value| master.set_input(input, value));
    }

    /// Tries a step; true if it is accepted, false if a shorter one is to be tried, or why the run ends.
    fn try_pair(&mut self, pair: Pair) -> Result<bool, End> {
        self.memory.save(&mut self.master).map_err(Error::Fmu)?;
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
            Err(Trouble { stop: Stop::Fmu(error), .. }) => return Err(Error::Fmu(*error).into()),
            Err(trouble) => Err(trouble),
        };
        self.work.rejected += 1;
        let relative = error.as_ref().ok().map(|verdict| verdict.error);
        if self.control.reject(h, relative) {
            self.memory.restore(&mut self.master).map_err(Error::Fmu)?;
            return Ok(false);
        }
        Err(match error {
            Ok(verdict) => {
                let (component, variable) = self.estimate.name(verdict.signal);
                let (time, error) = (pair.begin, verdict.error * self.tolerance);
                Error::StepTooShort { component, variable, time, step: h, error }.into()
            }
            // The last row is as close to the end that the component wants as the shortest step allows.
            Err(Trouble { stop: Stop::Incomplete { node, terminated: true, .. }, .. }) => {
                let component = self.master.nodes[node].name().to_owned();
                End::Terminated { component, time: Some(pair.begin) }
            }
            Err(Trouble { stop, time, step }) => {
                let (component, time) = self.master.explain(stop, (time, step), time + step)?;
                End::Terminated { component, time }
            }
        })
    }

    /// The next step to try.
    fn next_pair(&mut self) -> Pair {
        let wanted = self.control.wanted;
        self.stops.pair(self.time, if self.method == Method::Halves { wanted } else { 0.5 * wanted })
    }

    /// The step, repeated.
    fn passes(&mut self, pair: Pair, count: usize) -> Result<estimate::Verdict, Trouble> {
        if let Scheme::Extrapolated(extrapolation) = &mut self.master.scheme {
            extrapolation.look_no_further();
        }
        self.advance(pair.begin, pair.end)?;
        for _ in 1..count {
            self.estimate.take_whole(&self.master.values);
            if let Scheme::Extrapolated(extrapolation) = &mut self.master.scheme {
                extrapolation.look_ahead();
            }
            self.return_to(pair.begin)?;
            self.advance(pair.begin, pair.end)?;
        }
        Ok(self.estimate.judge(&self.master.values, self.tolerance))
    }

    /// The whole step, then its halves.
    fn whole_and_halves(&mut self, pair: Pair) -> Result<estimate::Verdict, Trouble> {
        self.advance(pair.begin, pair.end)?;
        self.estimate.take_whole(&self.master.values);
        self.return_to(pair.begin)?;
        self.advance(pair.begin, pair.middle)?;
        self.set_inputs(pair.middle);
        self.middle.copy_from(&self.master.values);
        self.advance(pair.middle, pair.end)?;
        Ok(self.estimate.judge(&self.master.values, self.tolerance))
    }

    /// Returns to the saved point at `begin` \[s\].
    fn return_to(&mut self, begin: f64) -> Result<(), Trouble> {
        let restored = self.memory.restore(&mut self.master);
        restored.map_err(|error| Trouble { stop: error.into(), time: begin, step: 0.0 })
    }

    fn advance(&mut self, begin: f64, end: f64) -> Result<(), Trouble> {
        self.inputs.put(&mut self.master, begin, end);
        let step = end - begin;
        self.master.advance(begin, step).map_err(|stop| Trouble { stop, time: begin, step })
    }
}
