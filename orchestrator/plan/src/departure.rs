//! Whether the system goes through the phases of a plan by itself.
//!
//! A phase of a plan has parameters that pin what the system does there, such as a mode of contact; nothing in the
//! program asks whether its events would lead there. The roll-out has the events: this module looks in which phase it
//! departs from the dynamics of the plan, or from its jump at the start of a phase. A roll-out that has drifted away
//! from its plan for other reasons, such as a coarse mesh, is not judged.

use super::catalog::Kind;
use super::prepare::Prepared;
use super::verify::{self, Rollout};
use airloop_ocp::transcription::{Dynamics, PhaseTrajectory, Point, Trajectory};

/// Largest distance from the plan, relative to the span of a state, at which a roll-out is still judged.
const MAX_DISTANCE_TO_JUDGE: f64 = 0.02;
/// Smallest distance, relative to the span, after a jump that is not the planned one.
const MIN_DISTANCE_AFTER_OTHER_JUMP: f64 = 0.1;
/// Error of the rates, relative to the largest one, above which they differ.
const MIN_ERROR_OF_OTHER_RATES: f64 = 0.1;
/// The same, below which they agree.
const MAX_ERROR_OF_EQUAL_RATES: f64 = 1e-3;
/// Largest shift in time \[s\] of events where the roll-out is on its plan; larger where it is off its plan.
const MAX_TIME_SHIFT_OF_EVENTS: f64 = 2e-3;

/// A phase in which a system departs from its plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Departure {
    /// Phase.
    pub phase: String,
    /// Time \[s\].
    pub time: f64,
    /// Difference from the plan.
    pub what: Difference,
}

/// Kinds of differences between a system and its plan.
#[derive(Debug, Clone, PartialEq)]
pub enum Difference {
    /// Another jump: state, its planned and its own value.
    Jump(String, f64, f64),
    /// Another motion: state, its planned and its own rate.
    Rate(String, f64, f64),
    /// An early end, and its reason.
    End(String),
}

impl std::fmt::Display for Departure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "phase `{}`: the system itself does something else at t = {:.4} s: ",
            self.phase, self.time
        )?;
        match &self.what {
            Difference::Jump(state, planned, found) => write!(
                f,
                "`{state}` is {found:.4}, planned {planned:.4}, after an event that the plan does not have, or whose `reset` \
                 is another map"
            ),
            Difference::Rate(state, planned, found) => write!(
                f,
                "`{state}` changes at a rate of {found:.4}, planned {planned:.4}; its events do not lead to what the \
                 `parameters` of this phase pin"
            ),
            Difference::End(reason) => f.write_str(reason),
        }
    }
}

/// The first phase in which a roll-out in continuous time departs from its plan, of plans with several phases.
pub fn departure(prepared: &Prepared, plan: &Trajectory, rollout: &Rollout) -> Option<Departure> {
    if plan.phases.len() < 2 || rollout.states.len() < 3 {
        return None;
    }
    let comparison = Comparison::new(prepared, plan, rollout);
    let mut near = 0.0;
    let departure = plan.phases[1..].iter().find_map(|phase| comparison.start(prepared, phase));
    if departure.is_some() {
        return departure;
    }
    for (phase, dynamics) in plan.phases.iter().zip(&prepared.dynamics) {
        let mut dynamics = dynamics.duplicate().ok()?;
        match comparison.along(phase, dynamics.as_mut(), &mut near) {
            Verdict::Kept => {}
            Verdict::Unknown => return None,
            Verdict::Departs(departure) => return Some(departure),
        }
    }
    let end = *rollout.states.time().last()?;
    let phase = plan.phases.iter().find(|phase| end < phase.end())?;
    let reason = rollout
        .problem
        .clone()
        .filter(|_| end + MAX_TIME_SHIFT_OF_EVENTS < plan.phases.last().map_or(end, PhaseTrajectory::end))?;
    Some(Departure { phase: phase.name.clone(), time: end, what: Difference::End(reason) })
}

/// Verdict on a phase of a roll-out.
enum Verdict {
    /// As planned.
    Kept,
    /// Away from its plan, for whatever reason.
    Unknown,
    /// Something else.
    Departs(Departure),
}

/// A roll-out and its plan.
struct Comparison<'a> {
    times: &'a [f64],
    /// Values of the states that the roll-out shows; those that it does not show follow the command alone.
    shown: Vec<Option<&'a [f64]>>,
    names: Vec<String>,
    spans: Vec<f64>,
}

impl<'a> Comparison<'a> {
    fn new(prepared: &Prepared, plan: &Trajectory, rollout: &'a Rollout) -> Comparison<'a> {
        let variables = prepared.catalog.variables();
        let states = prepared.task.signals.states.iter().map(|&index| &variables[index]);
        let shown = states.clone().map(|state| {
            let channel = rollout.states.channel(&state.name).filter(|_| state.kind == Kind::State)?;
            Some(&channel.values[..])
        });
        let rows = || plan.phases.iter().flat_map(|phase| &phase.states);
        let span = |i: usize| {
            let ends = rows().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), row| {
                (low.min(row[i]), high.max(row[i]))
            });
            (ends.1 - ends.0).max(1e-6)
        };
        let shown: Vec<_> = shown.collect();
        Comparison {
            times: rollout.states.time(),
            spans: (0..shown.len()).map(span).collect(),
            shown,
            names: states.map(|state| state.name.clone()).collect(),
        }
    }

    /// Rows after a time and before another.
    fn rows(&self, from: f64, to: f64) -> std::ops::Range<usize> {
        let first = self.times.partition_point(|time| *time <= from + 1e-9);
        first..self.times.partition_point(|time| *time < to - 1e-9).max(first)
    }

    fn states(&self, phase: &PhaseTrajectory, row: usize) -> Vec<f64> {
        let planned = phase.states_at(self.times[row]);
        planned.iter().zip(&self.shown).map(|(planned, own)| own.map_or(*planned, |own| own[row])).collect()
    }

    /// Distance from the plan relative to the spans, and the state that is farthest off.
    fn distance(&self, phase: &PhaseTrajectory, row: usize) -> (f64, usize) {
        let (planned, found) = (phase.states_at(self.times[row]), self.states(phase, row));
        let off = (0..planned.len()).map(|i| ((found[i] - planned[i]).abs() / self.spans[i], i));
        off.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    }

    /// Immediate reaction of a system that is put where a phase begins: nothing, if that is one of its modes.
    fn start(&self, prepared: &Prepared, phase: &PhaseTrajectory) -> Option<Departure> {
        let planned = &phase.states[0];
        let later = verify::moment_later(&prepared.setup, planned, &phase.inputs_in(0, 0.0))?;
        let jumps = self.names.iter().enumerate().filter_map(|(i, name)| {
            let own = *later.channel(name)?.values.last()?;
            Some(((own - planned[i]).abs() / self.spans[i], i, own))
        });
        let (_, state, own) =
            jumps.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|jump| jump.0 > MIN_DISTANCE_AFTER_OTHER_JUMP)?;
        let what = Difference::Jump(self.names[state].clone(), planned[state], own);
        Some(Departure { phase: phase.name.clone(), time: phase.begin(), what })
    }

    /// Goes along a phase; `near` is the last distance from the plan that has nothing to do with events.
    fn along(&self, phase: &PhaseTrajectory, dynamics: &mut dyn Dynamics, near: &mut f64) -> Verdict {
        let rows = self.rows(phase.begin(), phase.end());
        let Some(rates) = self.rates(phase, dynamics, rows.clone()) else { return Verdict::Unknown };
        let (mut other, mut far): (Option<Departure>, Option<Departure>) = (None, None);
        let (mut before, mut jumped) = (*near, false);
        for row in rows.start..rows.end.saturating_sub(2) {
            let time = self.times[row];
            let allowed = MAX_TIME_SHIFT_OF_EVENTS + *near * (phase.end() - phase.begin());
            let found = self.other(phase, &rates[row - rows.start..], row);
            let (distance, state) = self.distance(phase, row);
            other = found.map(|found| other.take().unwrap_or(found));
            if let Some(other) = other.take_if(|other| time - other.time > allowed) {
                return Verdict::Departs(other);
            }
            jumped |= distance > before + MIN_DISTANCE_AFTER_OTHER_JUMP;
            before = distance;
            if distance <= MAX_DISTANCE_TO_JUDGE {
                (far, jumped) = (None, false);
                *near = if other.is_none() { distance } else { *near };
                continue;
            }
            let (planned, own) = (phase.states_at(time)[state], self.states(phase, row)[state]);
            let what = Difference::Jump(self.names[state].clone(), planned, own);
            let since = far.get_or_insert(Departure { phase: phase.name.clone(), time, what });
            if time - since.time > allowed && other.is_none() {
                return if jumped { Verdict::Departs(since.clone()) } else { Verdict::Unknown };
            }
        }
        Verdict::Kept
    }

    /// Rates of the dynamics of a phase at the rows; none where they have no value.
    fn rates(
        &self,
        phase: &PhaseTrajectory,
        dynamics: &mut dyn Dynamics,
        rows: std::ops::Range<usize>,
    ) -> Option<Vec<Vec<f64>>> {
        let size = dynamics.size();
        let mut values = vec![0.0; size.values()];
        let mut at = |row: usize| {
            let time = self.times[row];
            let (states, inputs) = (self.states(phase, row), phase.inputs_at(time));
            dynamics.evaluate(Point { time, states: &states, inputs: &inputs }, &mut values).ok()?;
            Some(values[..size.states].to_vec())
        };
        rows.map(&mut at).collect()
    }

    /// State that changes otherwise between a row and the next but one than the rates of the dynamics say (Simpson's
    /// rule).
    fn other(&self, phase: &PhaseTrajectory, rates: &[Vec<f64>], row: usize) -> Option<Departure> {
        let steps = [self.times[row + 1] - self.times[row], self.times[row + 2] - self.times[row + 1]];
        if (steps[0] - steps[1]).abs() > 1e-6 * steps[0] {
            return None;
        }
        let (first, last) = (self.states(phase, row), self.states(phase, row + 2));
        let mean = |i: usize| (rates[0][i] + 4.0 * rates[1][i] + rates[2][i]) / 6.0;
        let found = |i: usize| (last[i] - first[i]) / (steps[0] + steps[1]);
        let largest = |i: usize| rates[..3].iter().map(|rates| rates[i].abs()).fold(0.0, f64::max);
        let off = |i: usize| (found(i) - mean(i)).abs() / (largest(i) + self.spans[i]);
        // The plan's trajectory of a state that the roll-out does not show is good only where it is one of its
        // dynamics.
        let hidden = |i: &usize| self.shown[*i].is_none();
        if (0..first.len()).filter(hidden).any(|i| off(i) > MAX_ERROR_OF_EQUAL_RATES) {
            return None;
        }
        let seen = (0..first.len()).filter(|i| !hidden(i)).map(|i| (off(i), i));
        let worst = seen.max_by(|a, b| a.0.total_cmp(&b.0));
        let (_, state) = worst.filter(|(error, _)| *error > MIN_ERROR_OF_OTHER_RATES)?;
        let what = Difference::Rate(self.names[state].clone(), mean(state), found(state));
        Some(Departure { phase: phase.name.clone(), time: self.times[row], what })
    }
}
