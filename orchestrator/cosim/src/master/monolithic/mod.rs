//! The monolithic master: Model Exchange instances as one differential equation, integrated with error control.
//!
//! No value is held over a communication step: inputs are passed on in the order of direct feed-through at every
//! evaluation of the right-hand side, algebraic loops are solved there, events are found and iterated over the whole
//! system. So it has no coupling error, and the error of the other masters is measured against it.
//!
//! Steps of the integrator end at communication points, at samples of the inputs and at time events. A row of the
//! result holds the values just before the events of its time; those events belong to the interval that follows.

mod coupled;
mod dop853;
mod inputs;
mod integrate;
mod integrated;
mod models;

use super::driver::{End, Run, Simulation};
use super::propagation::LoopFailure;
use super::{Error, Grid, Settings};
use crate::results::Recorder;
use crate::results::summary::Integration;
use crate::system::SystemGraph;
use coupled::{Coupled, Event};
pub(super) use inputs::Inputs;
use integrate::{Failure, Integrator, Reached};
pub use integrated::Integrated;
pub use models::{EventReport, Models, Tangent};

/// Relative tolerance where nothing else is said.
pub const DEFAULT_TOLERANCE: f64 = 1e-10;
/// The integrator keeps to no smaller one: rounding would decide.
const SMALLEST_TOLERANCE: f64 = 1e-13;
/// Absolute tolerance of a state as a part of tolerance times nominal value.
const ABSOLUTE_PER_RELATIVE_TOLERANCE: f64 = 1e-2;
/// Events in one communication interval (time events that move on aside), beyond which they count as chattering.
const MOST_EVENTS: u64 = 10_000;
/// Events of all kinds in one communication interval, beyond which it would not end in a time that anybody waits.
const MOST_EVENTS_IN_ALL: u64 = 1_000_000;
/// Times closer than this, relative to the larger of time and step, are one.
const SAME_TIME: f64 = 1e-12;

/// The system on its way through time.
#[derive(Debug)]
pub(super) struct Monolith<'a> {
    graph: &'a SystemGraph,
    inputs: Inputs<'a>,
    coupled: Coupled,
    integrator: Integrator,
    relative: f64,
    time: f64,
    x: Vec<f64>,
    grid: Grid,
    /// Communication intervals done.
    done: u64,
    /// Reason why an event is to be handled at the present time.
    pending: Option<Reached>,
    /// The component that ended the simulation at an event: what it last gave is then not read again.
    ended: Option<String>,
    time_events: u64,
    /// Times \[s\] of the state events.
    state_events: Vec<f64>,
    input_events: u64,
}

impl<'a> Simulation<'a> for Monolith<'a> {
    type Inputs = Inputs<'a>;

    fn initialize(
        graph: &'a SystemGraph,
        settings: &Settings,
        mut inputs: Inputs<'a>,
    ) -> Result<Self, Error> {
        let grid = settings.validate()?;
        let time = settings.start_time;
        let mut coupled = Coupled::new(graph, settings, inputs.ramps(time))?;
        let mut x = vec![0.0; coupled.state_count()];
        let ended = match coupled.iterate(graph, time, &mut x)? {
            Event::Done => None,
            Event::Terminated { component } => Some(component),
        };
        let relative = settings.tolerance.unwrap_or(DEFAULT_TOLERANCE).max(SMALLEST_TOLERANCE);
        let integrator = Integrator::new(x.len(), coupled.indicator_count(), relative);
        let mut monolith = Monolith {
            graph,
            inputs,
            coupled,
            integrator,
            relative,
            time,
            x,
            grid,
            done: 0,
            pending: None,
            ended,
            time_events: 0,
            state_events: Vec::new(),
            input_events: 0,
        };
        if monolith.ended.is_none() {
            monolith.restart()?;
        }
        Ok(monolith)
    }

    fn set_up(&mut self, graph: &SystemGraph) -> Result<Recorder, Error> {
        let mut rows = self.coupled.values.recorder(self.coupled.columns(graph), self.grid.steps());
        // A component that ended the simulation in its initialization can still be read.
        let ended = self.ended.take();
        self.record(&mut rows, self.time)?;
        self.ended = ended;
        Ok(rows)
    }

    fn step(&mut self, rows: &mut Recorder) -> Result<(), End> {
        let point = self.grid.time(self.done + 1);
        let ended = match self.ended.take() {
            None => self.interval(point)?,
            ended => ended,
        };
        if let Some(component) = ended {
            // The row of the end itself, unless it is there already.
            if rows.ends_before(self.time) {
                self.record(rows, self.time)?;
            }
            // No interval follows in which a value could stand that the last event has set. It may be refused.
            if self.coupled.read_results(self.graph, self.time).is_ok() {
                self.coupled.values.close(rows);
            }
            return Err(End::Terminated { component, time: None });
        }
        self.record(rows, point)?;
        self.done += 1;
        Ok(())
    }

    fn is_finished(&self) -> bool {
        self.ended.is_none() && self.done >= self.grid.steps()
    }

    fn progress(&self) -> (u64, u64) {
        (self.done, self.grid.steps())
    }

    fn account(self, run: &mut Run) {
        run.integration = Some(self.summary());
        run.notes = self.coupled.notes();
        run.state_events = self.state_events;
    }
}

impl Monolith<'_> {
    /// After initialization and events: tolerances, right-hand side and indicators at the present point.
    fn restart(&mut self) -> Result<(), Error> {
        restart(&mut self.coupled, &mut self.integrator, self.relative, (self.time, &self.x))
    }

    /// Adds a row at `time` \[s\].
    fn record(&mut self, recorder: &mut Recorder, time: f64) -> Result<(), Error> {
        if self.ended.is_none() {
            self.coupled.read_results(self.graph, time)?;
        }
        // The sample that belongs to this time, although it takes effect in the interval that follows.
        if let Some(next) = self.inputs.next.filter(|&next| self.is_due(next)) {
            for ramp in self.inputs.ramps(time) {
                self.coupled.show_input(ramp.input, ramp.at(0.0));
            }
            self.inputs.next = Some(next);
        }
        self.coupled.values.record(recorder, time);
        Ok(())
    }

    /// Whether a time \[s\] has come.
    fn is_due(&self, time: f64) -> bool {
        time <= self.time + SAME_TIME * self.time.abs().max(self.grid.step())
    }

    /// From the present time to the communication point `end` \[s\]; the component that ended the simulation.
    fn interval(&mut self, end: f64) -> Result<Option<String>, Error> {
        let (mut events, mut all) = (0, 0);
        let mut last_event = f64::NEG_INFINITY;
        while self.time < end {
            let mut jump = false;
            if let Some(next) = self.inputs.next.filter(|&next| self.is_due(next)) {
                self.time = self.time.max(next);
                let ramps = self.inputs.ramps(self.time);
                jump = self.coupled.set_ramps(ramps, self.time);
            }
            let due = self.coupled.next_event.filter(|&(next, _)| self.is_due(next));
            if jump || due.is_some() || self.pending.is_some() {
                self.time = due.map_or(self.time, |(next, _)| self.time.max(next));
                all += 1;
                let moved = self.time > last_event + SAME_TIME * self.time.abs().max(self.grid.step());
                if self.pending.is_some() || !moved {
                    events += 1;
                }
                if events > MOST_EVENTS || all > MOST_EVENTS_IN_ALL {
                    let events = if events > MOST_EVENTS { events } else { all };
                    return Err(self.chattering(due.map(|(_, model)| model), moved, events));
                }
                self.time_events += u64::from(due.is_some());
                if self.pending.is_some() {
                    self.state_events.push(self.time);
                }
                self.input_events += u64::from(jump);
                if moved {
                    last_event = self.time;
                }
                if let Event::Terminated { component } = self.event()? {
                    self.ended = Some(component.clone());
                    return Ok(Some(component));
                }
                continue;
            }
            let target = self.target(end);
            let reached = self.integrator.advance(&mut self.coupled, &mut self.time, &mut self.x, target);
            let reached = reached.map_err(|failure| explain(&self.coupled, failure, self.time))?;
            if let Some(model) = self.coupled.wants_end {
                return Ok(Some(self.coupled.models[model].name().to_owned()));
            }
            if reached != Reached::End {
                self.pending = Some(reached);
            }
        }
        Ok(None)
    }

    fn event(&mut self) -> Result<Event, Error> {
        let event = self.coupled.event(self.graph, self.time, &mut self.x)?;
        self.pending = None;
        if event == Event::Done {
            self.restart()?;
        }
        Ok(event)
    }

    /// Time at which the integrator has to stop at the latest: `end`, the next sample of the inputs, or the next time
    /// event.
    fn target(&self, end: f64) -> f64 {
        let near = SAME_TIME * end.abs().max(self.grid.step());
        let candidates = [self.inputs.next, self.coupled.next_event.map(|(time, _)| time)];
        let first = candidates.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        if first >= end - near {
            return end;
        }
        // Times that differ by rounding only are one.
        candidates
            .iter()
            .flatten()
            .copied()
            .filter(|&time| time <= first + near)
            .fold(first, f64::max)
            .min(end)
    }

    /// Too many events; `moved`: the time did between the last two.
    fn chattering(&self, time_event: Option<usize>, moved: bool, events: u64) -> Error {
        let name = |model: usize| self.coupled.models[model].name();
        let cause = match (self.pending, time_event, self.coupled.wants_event) {
            (Some(Reached::Indicator(indicator)), ..) => self.coupled.indicator_name(indicator),
            (_, Some(model), _) if moved => format!("a time event of component `{}`", name(model)),
            (_, Some(model), _) => {
                format!("a time event of component `{}` that does not move on", name(model))
            }
            (_, None, Some(model)) => {
                format!("component `{}`, which wants one after every step", name(model))
            }
            (_, None, None) => "a jump of an input".to_owned(),
        };
        Error::Chattering { cause, time: self.time, events }
    }

    fn summary(&self) -> Integration {
        let work = self.integrator.work;
        Integration {
            method: "DOP853".into(),
            relative_tolerance: self.relative,
            steps: work.accepted,
            rejected_steps: work.rejected,
            evaluations: work.evaluations,
            time_events: self.time_events,
            state_events: self.state_events.len() as u64,
            input_events: self.input_events,
        }
    }
}

/// After initialization and events: tolerances, right-hand side and indicators at a time \[s\] and states, `[n]`.
fn restart(
    coupled: &mut Coupled,
    integrator: &mut Integrator,
    relative: f64,
    (time, x): (f64, &[f64]),
) -> Result<(), Error> {
    coupled.nominals(&mut integrator.absolute)?;
    for absolute in &mut integrator.absolute {
        *absolute = ABSOLUTE_PER_RELATIVE_TOLERANCE
            * relative
            * absolute.abs().max(f64::MIN_POSITIVE / SMALLEST_TOLERANCE);
    }
    integrator.restart(coupled, time, x).map_err(|failure| failure.at(time))
}

/// Why an integration stopped at `time` \[s\].
fn explain(coupled: &Coupled, failure: Failure<LoopFailure>, time: f64) -> Error {
    match failure {
        Failure::Problem(failure) => failure.at(time),
        Failure::Underflow { state, step } => {
            let (component, variable) = coupled.state_name(state);
            Error::StepUnderflow { component, variable, time, step }
        }
        Failure::TooManySteps { state, steps } => {
            let (component, variable) = coupled.state_name(state);
            Error::Stiff { component, variable, time, steps }
        }
    }
}
