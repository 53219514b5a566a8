//! A system under error control whose steps somebody else commands: Model Exchange components as one slave.

use super::integrate::{Integrator, Reached};
use super::models::Models;
use super::{
    DEFAULT_TOLERANCE, MOST_EVENTS, MOST_EVENTS_IN_ALL, SAME_TIME, SMALLEST_TOLERANCE, explain, restart,
};
use crate::master::{Error, Progress, Settings};
use crate::system::SystemGraph;

/// Model Exchange instances with an integrator of their own. Inputs are held over a step.
#[derive(Debug)]
pub struct Integrated {
    models: Models,
    integrator: Integrator,
    relative: f64,
    /// Reason for an event where the next step begins: the start, an input that jumps, or a state event.
    pending: bool,
}

impl Integrated {
    /// Instantiates and initializes all components; see [`Models::new`].
    ///
    /// # Errors
    /// Same as [`Models::new`].
    pub fn new(
        graph: &SystemGraph,
        settings: &Settings,
        inputs: &[(usize, f64)],
    ) -> Result<Integrated, Error> {
        let models = Models::new(graph, settings, inputs)?;
        let relative = settings.tolerance.unwrap_or(DEFAULT_TOLERANCE).max(SMALLEST_TOLERANCE);
        let integrator = Integrator::new(models.state_count(), models.indicator_count(), relative);
        Ok(Integrated { models, integrator, relative, pending: true })
    }

    /// The instances, to read and to save.
    pub fn models(&mut self) -> &mut Models {
        &mut self.models
    }

    /// Sets a system input from now on.
    pub fn set_input(&mut self, input: usize, value: f64) {
        self.pending |= self.models.inputs[input].to_bits() != value.to_bits();
        self.models.set_input(input, value);
    }

    /// Returns to a state of [`Models::save`]; `false` for bytes of another system.
    ///
    /// # Errors
    /// An FMU refuses its state.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<bool, Error> {
        self.pending = true;
        self.models.restore(bytes)
    }

    /// From `t` to `t + h` \[s\]. The integrator keeps nothing from one step to the next, so that a step that is taken
    /// again gives the same bits.
    ///
    /// # Errors
    /// An FMU refuses, an event iteration does not end, or the integrator gets nowhere.
    pub fn step(&mut self, graph: &SystemGraph, t: f64, h: f64) -> Result<Progress, Error> {
        let (mut time, end) = (t, t + h);
        let near = SAME_TIME * end.abs().max(h);
        let (mut ready, mut events, mut all) = (false, 0, 0);
        let mut last_event = f64::NEG_INFINITY;
        self.models.set_time(t);
        self.integrator.forget();
        while time < end {
            let next = self.models.coupled.next_event.map(|(next, _)| next);
            let due = next.filter(|next| *next <= time + near);
            if self.pending || due.is_some() {
                time = due.map_or(time, |due| time.max(due));
                self.models.set_time(time);
                // Time events that move on are the samples of a component.
                all += 1;
                events += u64::from(self.pending || time <= last_event + near);
                last_event = time;
                if events > MOST_EVENTS || all > MOST_EVENTS_IN_ALL {
                    let cause = "an event that comes again at once".to_owned();
                    return Err(Error::Chattering { cause, time, events: all });
                }
                if let Some(component) = self.models.event(graph)?.terminated {
                    return Ok(Progress::Terminated { component, last_successful_time: Some(time) });
                }
                (self.pending, ready) = (false, false);
                continue;
            }
            let (coupled, x) = (&mut self.models.coupled, &mut self.models.x);
            if !ready {
                restart(coupled, &mut self.integrator, self.relative, (time, x))?;
                ready = true;
            }
            let target = next.filter(|next| *next < end - near).unwrap_or(end);
            let reached = self.integrator.advance(coupled, &mut time, x, target);
            let reached = reached.map_err(|failure| explain(coupled, failure, time))?;
            let wants_end = coupled.wants_end.map(|model| coupled.models[model].name().to_owned());
            self.models.set_time(time);
            if let Some(component) = wants_end {
                return Ok(Progress::Terminated { component, last_successful_time: Some(time) });
            }
            self.pending = reached != Reached::End;
        }
        Ok(Progress::Stepped)
    }
}
