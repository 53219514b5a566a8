//! One problem for a range of durations or of a parameter, each from the solution before.

use std::time::Instant;

use super::file::phase::Duration;
use super::file::{Quantity, StartValue, Statement, Text};
use super::guess::Rough;
use super::prepare::{Prepared, open, prepare_statement};
use super::solve::{Begin, Monitor, Session, Settings, Solved};
use super::{Error, guess};
use airloop_cosim::system::SystemGraph;
use airloop_ocp::transcription::Outcome;
use airloop_optim::Status;

/// Name under which the duration is swept.
pub const DURATION: &str = "T";

/// One value of a sweep.
pub struct Step {
    /// Value.
    pub value: f64,
    /// Problem and plan, or why there is none.
    pub solved: Result<(Prepared, Rough, Solved), Error>,
}

/// `count` values from `from` to `to`, both included, without the rounding of a running sum.
pub fn values(from: f64, to: f64, count: usize) -> Vec<f64> {
    let steps = count.saturating_sub(1).max(1) as f64;
    // To 12 digits: 1.6 + 0.1 is 1.7.
    let tidy = |value: f64| format!("{value:.12e}").parse().unwrap_or(value);
    (0..count).map(|k| tidy(from + (to - from) * k as f64 / steps)).collect()
}

/// Solves for every value in turn until the monitor of a solve ends it.
///
/// # Errors
/// [`Error::Place`] when the problem has no such duration; a value that does not work is a [`Step`].
pub fn sweep(
    statement: &Statement,
    settings: &Settings,
    choice: &guess::Choice,
    (name, values): (&str, &[f64]),
    monitor: &mut Monitor,
) -> Result<Vec<Step>, Error> {
    let mut steps: Vec<Step> = Vec::new();
    let mut earlier: Option<Outcome> = None;
    let graph = (name != DURATION).then(|| open(statement)).transpose()?;
    for &value in values {
        let own = changed(statement, name, value)?;
        let solved = match graph.as_ref().map_or(Ok(()), |graph| check(graph, name, value)) {
            Ok(()) => one(own, settings, choice, earlier.as_ref(), monitor),
            Err(refused) => Err(refused),
        };
        let mut interrupted = false;
        if let Ok((_, _, solved)) = &solved {
            match solved.status() {
                Status::Solved | Status::Acceptable => earlier = Some(solved.outcome.clone()),
                Status::Interrupted => interrupted = true,
                _ => {}
            }
        }
        steps.push(Step { value, solved });
        if interrupted {
            break;
        }
    }
    Ok(steps)
}

/// A parameter that the system does not have, or a value that it cannot have, is told as one of the sweep: no line of
/// the problem file says it.
fn check(graph: &SystemGraph, name: &str, value: f64) -> Result<(), Error> {
    Ok(graph.clone().set_start(name, &value.to_string(), &format!("--sweep {name}: value {value}"))?)
}

fn one(
    statement: Statement,
    settings: &Settings,
    choice: &guess::Choice,
    earlier: Option<&Outcome>,
    monitor: &mut Monitor,
) -> Result<(Prepared, Rough, Solved), Error> {
    let prepared = prepare_statement(statement, Instant::now())?;
    let rough = guess::guess(&prepared.statement, &prepared.catalog, &prepared.task, choice)?;
    let mut session = Session::new(&prepared, settings.threads)?;
    let last = Settings { passes: settings.passes[settings.passes.len() - 1..].to_vec(), ..settings.clone() };
    let (begin, settings) = match earlier {
        Some(outcome) => (Begin::At(outcome), &last),
        None => (Begin::From(&rough), settings),
    };
    let solved = session.solve(&prepared.setup, settings, begin, monitor)?;
    Ok((prepared, rough, solved))
}

/// The statement with another duration or parameter.
fn changed(statement: &Statement, name: &str, value: f64) -> Result<Statement, Error> {
    let mut own = statement.clone();
    if name == DURATION {
        match &mut own.phases[..] {
            [phase] if matches!(phase.duration, Duration::Quantity(_)) => {
                phase.duration = Duration::Quantity(Quantity { value, unit: None, place: phase.place });
            }
            _ => {
                let problem = "only the fixed duration of a problem with one phase can be swept".to_owned();
                return Err(Error::Place { place: format!("--sweep {DURATION}"), problem });
            }
        }
    } else {
        let place = own.system.place;
        own.parameters.0.retain(|(parameter, _)| parameter.text != name);
        own.parameters.0.push((Text { place, text: name.to_owned() }, StartValue::Number(value)));
    }
    Ok(own)
}

#[cfg(test)]
mod tests {
    #[test]
    fn values_are_round_and_meet_both_ends() {
        assert_eq!(super::values(1.6, 2.4, 9), [1.6, 1.7, 1.8, 1.9, 2.0, 2.1, 2.2, 2.3, 2.4]);
        assert_eq!(super::values(2.0, 1.0, 2), [2.0, 1.0]);
    }
}
