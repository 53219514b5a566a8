//! Motions that repeat themselves: the map from the end of a turn to the begin of the next, and how well it closes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Error;
use super::catalog::Catalog;
use super::file::cycle::Cycle;
use super::file::{Entries, Placed, Statement, Text};
use super::prepare::Prepared;
use super::reset::Jump;
use super::task::{Reader, Signal, Signals};
use super::verify::Rollout;
use airloop_ocp::transcription::{Link, Relabeled, Relabeling, Reset, StateLink, Trajectory};
use airloop_optim::EvaluationError;

/// From the end of a turn to the begin of the next.
pub struct Return {
    /// Jump of the states in their old places; none: they are continuous.
    pub(super) jump: Option<Jump>,
    /// New places of the states, `[n_x]`.
    pub states: Relabeling,
    /// New places of the inputs, `[n_u]`.
    pub inputs: Relabeling,
    /// States that need not return.
    pub free: Vec<usize>,
}

impl Return {
    /// Looks up what a problem file says.
    ///
    /// # Errors
    /// [`Error::File`] names line, column and remedy.
    pub(super) fn of(
        statement: &Statement,
        (catalog, signals): (&Catalog, &Signals),
        cycle: &Placed<Cycle>,
        jump: Option<Jump>,
    ) -> Result<Return, Error> {
        let reader = Reader { source: &statement.source, catalog, signals };
        let states = places(&reader, &cycle.states, signals.states.len(), "state")?;
        let inputs = places(&reader, &cycle.inputs, signals.inputs.len(), "input")?;
        for (what, places) in [("states", &states), ("inputs", &inputs)] {
            let twice = (0..places.len()).find(|i| places.iter().filter(|(from, _)| from == i).count() > 1);
            if twice.is_some() {
                let problem = format!(
                    "two {what} of the next turn are the same one of this turn; {what} exchange their places"
                );
                return Err(statement.source.error_at(cycle.place, problem));
            }
        }
        let mut free = Vec::new();
        for name in &cycle.free {
            match reader.signal(name)?.0 {
                Signal::State(state) if states[state] == (state, 1.0) => free.push(state),
                Signal::State(_) => {
                    let problem = format!("`{}` is free and has a new place; take it out of one", name.text);
                    return Err(statement.source.error_at(name.place, problem));
                }
                _ => {
                    let problem = format!("`{}` is not a state; only states return", name.text);
                    return Err(statement.source.error_at(name.place, problem));
                }
            }
        }
        Ok(Return { jump, states, inputs, free })
    }

    /// The map, with an instance of its own.
    ///
    /// # Errors
    /// When no further instance can be made.
    pub fn reset(&self) -> Result<Relabeled, EvaluationError> {
        Ok(Relabeled::new(self.jump.as_ref().map(Jump::reset).transpose()?, self.states.clone()))
    }

    /// The link of the last phase to the first, with an instance of its own.
    ///
    /// # Errors
    /// When no further instance can be made.
    pub fn link(&self) -> Result<Link, EvaluationError> {
        let limits = self.jump.as_ref().map(Jump::limits).unwrap_or_default();
        let states = StateLink::Reset(Box::new(self.reset()?), limits);
        Ok(Link { states, inputs: Vec::new(), free: self.free.clone() })
    }
}

/// Places of states or inputs of the next turn in this one.
fn places(reader: &Reader, named: &Entries<Text>, count: usize, kind: &str) -> Result<Relabeling, Error> {
    let mut places: Relabeling = (0..count).map(|i| (i, 1.0)).collect();
    for (after, before) in named {
        let negative = before.text.strip_prefix('-');
        let text = negative.unwrap_or(&before.text).trim().to_owned();
        let before = Text { text, ..before.clone() };
        let index = |name: &Text| match (reader.signal(name)?.0, kind) {
            (Signal::State(i), "state") | (Signal::Input(i), "input") => Ok(i),
            _ => {
                let problem = format!("`{}` is no {kind}; here {kind}s get the places of others", name.text);
                Err(reader.source.error_at(name.place, problem))
            }
        };
        let factor = if negative.is_some() { -1.0 } else { 1.0 };
        places[index(after)?] = (index(&before)?, factor);
    }
    Ok(places)
}

/// Distance of the end of a turn from the begin of the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Closure {
    /// Largest difference of a state that returns between the begin of the plan and its end, mapped to the next turn.
    pub plan: f64,
    /// The same of the continuous roll-out from the begin of the plan, by state; states that no output shows are those
    /// of the plan.
    pub rollout: Option<BTreeMap<String, f64>>,
    /// Change of every state that need not return, over the turn.
    pub advance: BTreeMap<String, f64>,
}

/// How a plan closes, and its roll-out, if it has a cycle.
///
/// # Errors
/// [`Error::Evaluation`] when the jump has no value at the end.
pub fn closure(
    prepared: &Prepared,
    plan: &Trajectory,
    rollout: Option<&Rollout>,
) -> Result<Option<Closure>, Error> {
    let (Some(cycle), Some(first), Some(last)) = (&prepared.cycle, plan.phases.first(), plan.phases.last())
    else {
        return Ok(None);
    };
    let (begin, end) = (&first.states[0], &last.states[last.states.len() - 1]);
    let names: Vec<&str> =
        prepared.task.signals.states.iter().map(|&i| prepared.catalog.variables()[i].name.as_str()).collect();
    let mut reset = cycle.reset()?;
    let mut differences = |end: &[f64]| -> Result<BTreeMap<String, f64>, Error> {
        let size = reset.size();
        let mut after = vec![0.0; size.after + size.outputs];
        reset.evaluate(end, &mut after)?;
        let returning = (0..size.after).filter(|state| !cycle.free.contains(state));
        Ok(returning.map(|state| (names[state].to_owned(), after[state] - begin[state])).collect())
    };
    let plan = differences(end)?.values().fold(0.0, |most: f64, one| most.max(one.abs()));
    let rolled = rollout.filter(|rollout| rollout.problem.is_none()).map(|rollout| {
        let value = |(name, planned): (&&str, &f64)| {
            let shown = rollout.states.channel(name).and_then(|channel| channel.values.last());
            shown.copied().unwrap_or(*planned)
        };
        differences(&names.iter().zip(end).map(value).collect::<Vec<f64>>())
    });
    let advance = cycle.free.iter().map(|&state| (names[state].to_owned(), end[state] - begin[state]));
    Ok(Some(Closure { plan, rollout: rolled.transpose()?, advance: advance.collect() }))
}
