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
mod integrate;

use std::sync::atomic::Ordering;
use std::time::Instant;

use super::propagation::LoopFailure;
use super::simulate::{Curves, End, REPORT_EVERY, Run, Stimulus, Watch};
use super::{Effort, Error, Settings};
use crate::results::Recorder;
use crate::results::summary::Integration;
use crate::system::SystemGraph;
use airloop_series::Interpolation;
use airloop_series::resample::{locate, value_at};
use coupled::{Coupled, Event, Ramp};
use integrate::{Failure, Integrator, Reached};

/// Relative tolerance where nothing else is said.
pub const DEFAULT_TOLERANCE: f64 = 1e-10;
/// The integrator keeps to no smaller one: rounding would decide.
const SMALLEST_TOLERANCE: f64 = 1e-13;
/// Absolute tolerance of a state as a part of tolerance times nominal value.
const ABSOLUTE_PER_RELATIVE_TOLERANCE: f64 = 1e-2;
/// Events in one communication interval (time events that move on aside), beyond which they count as chattering.
const MOST_EVENTS: u64 = 10_000;
/// Times closer than this, relative to the larger of time and step, are one.
const SAME_TIME: f64 = 1e-12;

/// Runs a system; see [`super::simulate::run`].
pub(super) fn run(
    graph: &SystemGraph,
    settings: &Settings,
    stimulus: Option<&Stimulus>,
    watch: Watch,
) -> Result<Run, Error> {
    let interpolations = stimulus.map_or_else(Vec::new, |stimulus| stimulus.interpolations(graph));
    run_with(graph, settings, Inputs { stimulus, curves: None, interpolations, next: None, guess: 0 }, watch)
}

/// Runs a system; see [`super::simulate::run_along`].
pub(super) fn run_along(
    graph: &SystemGraph,
    settings: &Settings,
    curves: &Curves,
    watch: Watch,
) -> Result<Run, Error> {
    let inputs =
        Inputs { stimulus: None, curves: Some(curves), interpolations: Vec::new(), next: None, guess: 0 };
    run_with(graph, settings, inputs, watch)
}

/// A polynomial in the time that begins later.
fn shifted([a, b, c, d]: &[f64; 4], late: f64) -> [f64; 4] {
    [a + ((d * late + c) * late + b) * late, b + (3.0 * d * late + 2.0 * c) * late, c + 3.0 * d * late, *d]
}

fn run_with(graph: &SystemGraph, settings: &Settings, inputs: Inputs, watch: Watch) -> Result<Run, Error> {
    let began = Instant::now();
    let grid = settings.validate()?;
    let mut monolith = Monolith::start(graph, settings, inputs)?;
    let total = grid.steps();
    let values = &monolith.coupled.values;
    let width = [values.reals.len(), values.integers.len(), values.booleans.len()];
    let rows = usize::try_from(total).unwrap_or(usize::MAX).saturating_add(1);
    let mut recorder = Recorder::new(monolith.coupled.columns(graph), width, rows);
    let initialization = began.elapsed();
    let began = Instant::now();
    let mut reported = began;
    let (mut end, mut steps) = (End::Completed, 0);
    if let Some(component) = monolith.ended.take() {
        end = End::Terminated { component, time: None };
    }
    monolith.record(&mut recorder, grid.start())?;
    while steps < total && matches!(end, End::Completed) {
        let point = grid.time(steps + 1);
        let outcome = monolith.interval(point).and_then(|ended| {
            let last = recorder.last_time().unwrap_or(grid.start());
            match ended {
                None => monolith.record(&mut recorder, point)?,
                // The row of the end itself, unless it is there already.
                Some(_) if monolith.time > last => monolith.record(&mut recorder, monolith.time)?,
                Some(_) => {}
            }
            Ok(ended)
        });
        match outcome {
            Ok(None) => steps += 1,
            Ok(Some(component)) => end = End::Terminated { component, time: None },
            Err(error) => end = End::Failed(error),
        }
        if matches!(end, End::Completed) && watch.stop.load(Ordering::Relaxed) && steps < total {
            end = End::Interrupted;
        }
        if reported.elapsed() > REPORT_EVERY {
            reported = Instant::now();
            (watch.progress)(steps, total);
        }
    }
    let integration = Some(monolith.summary());
    Ok(Run {
        result: recorder.finish()?,
        end,
        steps,
        effort: Effort::default(),
        initialization,
        stepping: began.elapsed(),
        notes: monolith.coupled.notes(),
        integration,
        adaptive: None,
        state_events: monolith.state_events,
    })
}

/// System inputs from a series or from curves, as ramps between samples or knots.
#[derive(Debug)]
struct Inputs<'a> {
    stimulus: Option<&'a Stimulus<'a>>,
    curves: Option<&'a Curves>,
    /// Of each link of the stimulus.
    interpolations: Vec<Interpolation>,
    /// Time \[s\] of the next sample.
    next: Option<f64>,
    guess: usize,
}

impl Inputs<'_> {
    /// Values and slopes from `time` \[s\] on, up to the next sample.
    fn ramps(&mut self, time: f64) -> Vec<Ramp> {
        if let Some(curves) = self.curves {
            let (piece, next) = curves.piece_at(time);
            self.next = next;
            let of = |(&input, coefficients): (&usize, &[f64; 4])| {
                let late = (time - curves.knots[piece]).clamp(0.0, curves.length(piece));
                let ends = next.is_none() || time < curves.knots[0];
                let coefficients = shifted(coefficients, late);
                let held = [coefficients[0], 0.0, 0.0, 0.0];
                Ramp { input, coefficients: if ends { held } else { coefficients } }
            };
            return curves.inputs.iter().zip(&curves.pieces[piece]).map(of).collect();
        }
        let Some(stimulus) = self.stimulus else { return Vec::new() };
        let samples = stimulus.series.time();
        let position = locate(samples, time, self.guess);
        self.guess = position.index;
        let index = position.index;
        // Before the first sample its value holds.
        let early =
            samples.first().is_some_and(|&first| time < first) && index == 0 && position.fraction == 0.0;
        self.next = if early { samples.first() } else { samples.get(index + 1) }.copied();
        let ramp = |(&(input, channel, factor, offset), &interpolation): (
            &(usize, usize, f64, f64),
            &Interpolation,
        )| {
            let values = &stimulus.series.channels()[channel].values;
            let value = factor * value_at(values, position, interpolation) + offset;
            let linear = interpolation == Interpolation::Linear && !early && index + 1 < samples.len();
            let slope = match linear {
                true => factor * (values[index + 1] - values[index]) / (samples[index + 1] - samples[index]),
                false => 0.0,
            };
            Ramp { input, coefficients: [value, slope, 0.0, 0.0] }
        };
        stimulus.links.iter().zip(&self.interpolations).map(ramp).collect()
    }
}

/// The system on its way through time.
#[derive(Debug)]
struct Monolith<'a> {
    graph: &'a SystemGraph,
    inputs: Inputs<'a>,
    coupled: Coupled,
    integrator: Integrator,
    relative: f64,
    time: f64,
    x: Vec<f64>,
    /// Communication step size \[s\].
    step: f64,
    /// Reason why an event is to be handled at the present time.
    pending: Option<Reached>,
    /// The component that ended the simulation at an event: what it last gave is then not read again.
    ended: Option<String>,
    time_events: u64,
    /// Times \[s\] of the state events.
    state_events: Vec<f64>,
    input_events: u64,
}

impl<'a> Monolith<'a> {
    fn start(
        graph: &'a SystemGraph,
        settings: &Settings,
        mut inputs: Inputs<'a>,
    ) -> Result<Monolith<'a>, Error> {
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
            step: settings.step_size,
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

    /// After initialization and events: tolerances, right-hand side and indicators at the present point.
    fn restart(&mut self) -> Result<(), Error> {
        self.coupled.nominals(&mut self.integrator.absolute)?;
        for absolute in &mut self.integrator.absolute {
            *absolute = ABSOLUTE_PER_RELATIVE_TOLERANCE
                * self.relative
                * absolute.abs().max(f64::MIN_POSITIVE / SMALLEST_TOLERANCE);
        }
        let time = self.time;
        self.integrator.restart(&mut self.coupled, time, &self.x).map_err(|failure| failure.at(time))
    }

    /// Adds a row at `time` \[s\].
    fn record(&mut self, recorder: &mut Recorder, time: f64) -> Result<(), Error> {
        if self.ended.is_none() {
            self.coupled.read_results(self.graph, time)?;
        }
        // The sample that belongs to this time, although it takes effect in the interval that follows.
        if self.inputs.next.is_some_and(|next| self.is_due(next)) {
            let guess = self.inputs.guess;
            let next = self.inputs.next;
            for ramp in self.inputs.ramps(time) {
                self.coupled.show_input(ramp.input, ramp.at(0.0));
            }
            (self.inputs.guess, self.inputs.next) = (guess, next);
        }
        let values = &self.coupled.values;
        recorder.record(time, &values.reals, &values.integers, &values.booleans);
        Ok(())
    }

    /// Whether a time \[s\] has come.
    fn is_due(&self, time: f64) -> bool {
        time <= self.time + SAME_TIME * self.time.abs().max(self.step)
    }

    /// From the present time to the communication point `end` \[s\]; the component that ended the simulation.
    fn interval(&mut self, end: f64) -> Result<Option<String>, Error> {
        let mut events = 0;
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
                if self.pending.is_some() || self.time <= last_event {
                    events += 1;
                }
                if events > MOST_EVENTS {
                    return Err(self.chattering(due.map(|(_, model)| model), events));
                }
                self.time_events += u64::from(due.is_some());
                if self.pending.is_some() {
                    self.state_events.push(self.time);
                }
                self.input_events += u64::from(jump);
                last_event = self.time;
                if let Event::Terminated { component } = self.event()? {
                    self.ended = Some(component.clone());
                    return Ok(Some(component));
                }
                continue;
            }
            let target = self.target(end);
            let reached = self.integrator.advance(&mut self.coupled, &mut self.time, &mut self.x, target);
            let reached = reached.map_err(|failure| self.explain(failure))?;
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
        let near = SAME_TIME * end.abs().max(self.step);
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

    fn explain(&self, failure: Failure<LoopFailure>) -> Error {
        let time = self.time;
        match failure {
            Failure::Problem(failure) => failure.at(time),
            Failure::Underflow { state, step } => {
                let (component, variable) = self.coupled.state_name(state);
                Error::StepUnderflow { component, variable, time, step }
            }
            Failure::TooManySteps { state, steps } => {
                let (component, variable) = self.coupled.state_name(state);
                Error::Stiff { component, variable, time, steps }
            }
        }
    }

    fn chattering(&self, time_event: Option<usize>, events: u64) -> Error {
        let cause = match (self.pending, time_event) {
            (Some(Reached::Indicator(indicator)), _) => self.coupled.indicator_name(indicator),
            (_, Some(model)) => {
                format!(
                    "a time event of component `{}` that does not move on",
                    self.coupled.models[model].name()
                )
            }
            _ => match self.coupled.wants_event {
                Some(model) => {
                    format!(
                        "component `{}`, which wants one after every step",
                        self.coupled.models[model].name()
                    )
                }
                None => "a jump of an input".to_owned(),
            },
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
