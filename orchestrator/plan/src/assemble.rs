//! From a task to the problem that the transcription takes.

use super::Error;
use super::catalog::Catalog;
use super::file::Statement;
use super::file::phase::Where;
use super::sampling::{Sampling, whole_samples};
use super::task::{Limit, Limits, Signal, Task, TaskPhase, Term};
use airloop_ocp::transcription::{
    self, Cost, Duration, Dynamics, Link, Path, Phase, Place, Problem, Quantity, RateLimit, Shooting,
    Transcription, Variable,
};

fn variable(signal: Signal) -> Variable {
    match signal {
        Signal::State(index) => Variable::State(index),
        Signal::Input(index) => Variable::Input(index),
        Signal::Output(index) => Variable::Output(index),
    }
}

pub(super) fn limit(limit: &Limit) -> transcription::Limit {
    let terms: Vec<(Variable, f64)> =
        limit.terms.iter().map(|(signal, factor)| (variable(*signal), *factor)).collect();
    let (lower, upper) = limit.limits;
    let unit = limit.unit.as_deref().unwrap_or("");
    transcription::Limit::between(&limit.name, unit, Quantity::from(terms), lower, upper)
}

/// Conditions of states at an end of a phase.
fn conditions(
    task: &Task,
    catalog: &Catalog,
    states: &[Limits],
    others: &[Limit],
    end: &str,
) -> Vec<transcription::Limit> {
    let mut found = Vec::new();
    for (state, &(lower, upper)) in states.iter().enumerate() {
        if lower.is_finite() || upper.is_finite() {
            let own = &catalog.variables()[task.signals.states[state]];
            let unit = own.unit.as_deref().unwrap_or("");
            let name = format!("{end} {}", own.name);
            found.push(transcription::Limit::between(&name, unit, Variable::State(state), lower, upper));
        }
    }
    found.extend(others.iter().map(limit));
    found
}

/// The problem of a task; `dynamics` has the instances of every phase, `links` what happens between them.
pub fn problem(
    task: &Task,
    catalog: &Catalog,
    dynamics: Vec<Vec<Box<dyn Dynamics>>>,
    links: Vec<Link>,
    sampled: (&[usize], Option<&Sampling>),
) -> Problem {
    let phases: Vec<Phase> = task
        .phases
        .iter()
        .zip(dynamics)
        .map(|(phase, dynamics)| one(task, phase, catalog, dynamics, sampled))
        .collect();
    Problem { phases, links, cycle: None }
}

fn one(
    task: &Task,
    of: &TaskPhase,
    catalog: &Catalog,
    dynamics: Vec<Box<dyn Dynamics>>,
    (sampled, sampling): (&[usize], Option<&Sampling>),
) -> Phase {
    let (lower, upper) = of.duration;
    let duration = if lower == upper { Duration::Fixed(lower) } else { Duration::Free { lower, upper } };
    let mut phase = Phase::new(&of.name, dynamics, duration);
    if let Some(sampling) = sampling {
        // Those of the sampled components that are linear and driven by inputs alone.
        let states =
            phase.dynamics.first().map(|one| one.structure().linear_states(sampled)).unwrap_or_default();
        if !states.is_empty() {
            phase.shooting = Shooting::Sampled { states, sample_time: sampling.sample_time };
        }
    }
    let place = |at: Where| match at {
        Where::Nodes => Place::Nodes,
        Where::Midpoints => Place::Midpoints,
        Where::Everywhere => Place::Everywhere,
    };
    let path = |one: &super::task::PathLimit| Path {
        limit: limit(&one.with_margin()),
        place: place(one.at),
        window: [one.during.0, one.during.1],
    };
    phase.paths = of.path.iter().map(path).collect();
    phase.start = conditions(task, catalog, &of.initial, &of.ends[0], "initial");
    phase.end = conditions(task, catalog, &of.terminal, &of.ends[1], "final");
    for &(input, (lower, upper)) in &of.rates {
        let own = &catalog.variables()[task.signals.inputs[input]];
        let unit = format!("{}/s", own.unit.as_deref().unwrap_or("1"));
        phase.rates.push(RateLimit { name: format!("rate of {}", own.name), unit, input, lower, upper });
    }
    for term in &of.cost {
        match *term {
            Term::Integral { signal, reference, weight } => {
                phase.integral.push(Cost { quantity: variable(signal).into(), reference, weight });
            }
            Term::Final { signal, reference, weight } => {
                phase.final_cost.push(Cost { quantity: variable(signal).into(), reference, weight });
            }
            Term::Duration { weight } => phase.duration_weight += weight,
        }
    }
    phase
}

/// Whether intervals are made of whole samples, where the transcription needs it.
///
/// # Errors
/// [`Error::File`] names duration, intervals and sample time, and numbers of intervals that fit.
pub fn check_samples(
    statement: &Statement,
    task: &Task,
    sampling: Option<&Sampling>,
    transcription: Transcription,
    intervals: &[usize],
) -> Result<(), Error> {
    let Some(sampling) = sampling.filter(|_| transcription == Transcription::MultipleShooting) else {
        return Ok(());
    };
    for (phase, &count) in task.phases.iter().zip(intervals) {
        let (lower, upper) = phase.duration;
        let at = |problem| Err(statement.source.error_at(statement.phases[0].place, problem));
        if lower != upper {
            return at(format!(
                "phase `{}`: multiple shooting of a sampled component needs a fixed duration; choose another transcription",
                phase.name
            ));
        }
        let sample = sampling.sample_time;
        let Some(samples) = whole_samples(lower, sample) else {
            let below = (lower / sample).floor() * sample;
            return at(format!(
                "the duration {lower} s is not a whole number of samples of {sample} s, which multiple shooting needs; \
                 choose {:.9} s or {:.9} s, or another transcription",
                below,
                below + sample
            ));
        };
        if samples % count != 0 {
            let fitting: Vec<usize> = (1..=samples).filter(|n| samples % n == 0).collect();
            let near = fitting.partition_point(|n| *n < count);
            let near: Vec<String> = fitting[near.saturating_sub(2)..(near + 2).min(fitting.len())]
                .iter()
                .map(usize::to_string)
                .collect();
            return at(format!(
                "{samples} samples of {sample} s do not divide into {count} intervals, which multiple shooting needs; \
                 choose {} intervals, or another transcription",
                near.join(", ")
            ));
        }
    }
    Ok(())
}
