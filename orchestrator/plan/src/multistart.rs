//! Many starts around a guess, and the distinct minima they lead to.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use airloop_series::random::Random;
use rayon::prelude::*;

use super::Error;
use super::guess::Rough;
use super::prepare::Prepared;
use super::solve::{Begin, Session, Settings, Solved};
use super::workers::workers;
use airloop_optim::Status;

/// Objectives that differ relatively by less belong to one minimum.
const SAME_OBJECTIVE_TOLERANCE: f64 = 1e-6;

/// Outcome of a start.
#[derive(Debug)]
pub struct Outcome {
    /// Number of the start; 0 is the guess itself.
    pub start: usize,
    /// Result, or the reason why it could not begin.
    pub solved: Result<Solved, Error>,
    /// Number of its minimum, from 1 and in the order of their objectives; none where it found none.
    pub minimum: Option<usize>,
}

/// All starts in their order.
#[derive(Debug)]
pub struct Multistart {
    /// Outcomes.
    pub outcomes: Vec<Outcome>,
    /// Objectives of the distinct minima, the best first.
    pub minima: Vec<f64>,
}

impl Multistart {
    /// The start of the best minimum; where there is none, the guess itself.
    pub fn best(&self) -> usize {
        self.outcomes.iter().position(|outcome| outcome.minimum == Some(1)).unwrap_or(0)
    }
}

/// Solves from the guess and from `count` perturbations of it, on as many threads as the settings say; one seed gives
/// one result for any number of threads. `progress` hears of every start that is done; starts that `stop` prevents are
/// left out.
///
/// # Errors
/// [`Error::Evaluation`] when no FMU can be instantiated again.
pub fn multistart(
    prepared: &Prepared,
    settings: &Settings,
    guess: &Rough,
    (count, seed): (usize, u64),
    stop: &AtomicBool,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Multistart, Error> {
    let threads = settings.threads.clamp(1, count + 1);
    let sessions = (0..threads).map(|_| Session::new(prepared, 1)).collect::<Result<Vec<_>, _>>()?;
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let (setup, next, done) = (&prepared.setup, &next, &done);
    let work = |mut session: Session| {
        let mut found = Vec::new();
        loop {
            let start = next.fetch_add(1, Ordering::Relaxed);
            if start > count || stop.load(Ordering::Relaxed) {
                return found;
            }
            let mut rough = guess.clone();
            if start > 0 {
                let mut random = Random::numbered(seed, start as u64);
                rough.perturb(&setup.task, &mut || random.symmetric());
            }
            let mut monitor = |_: &super::solve::Progress| match stop.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            let solved = session.solve(setup, settings, Begin::From(&rough), &mut monitor);
            found.push(Outcome { start, solved, minimum: None });
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    let mut outcomes: Vec<Outcome> = workers(sessions.len())?
        .install(|| sessions.into_par_iter().with_max_len(1).flat_map_iter(work).collect());
    outcomes.sort_by_key(|outcome| outcome.start);
    let minima = number(&mut outcomes);
    Ok(Multistart { outcomes, minima })
}

/// Numbers the minima; their objectives.
fn number(outcomes: &mut [Outcome]) -> Vec<f64> {
    let objective = |outcome: &Outcome| {
        let solved = outcome.solved.as_ref().ok()?;
        matches!(solved.status(), Status::Solved | Status::Acceptable)
            .then(|| solved.last().solution.objective)
    };
    let mut found: Vec<f64> = outcomes.iter().filter_map(objective).collect();
    found.sort_by(f64::total_cmp);
    let minima = distinct(&found);
    for outcome in outcomes {
        let Some(own) = objective(outcome) else { continue };
        outcome.minimum = minima.iter().position(|one| same(*one, own)).map(|at| at + 1);
    }
    minima
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_OBJECTIVE_TOLERANCE * a.abs().max(b.abs()).max(1e-12)
}

/// The first of every group of increasing values that are the same.
fn distinct(sorted: &[f64]) -> Vec<f64> {
    let mut minima: Vec<f64> = Vec::new();
    for &value in sorted {
        if minima.last().is_none_or(|last| !same(*last, value)) {
            minima.push(value);
        }
    }
    minima
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minima_are_told_apart_by_their_objectives() {
        assert_eq!(distinct(&[1.0, 1.0 + 1e-8, 1.1, 2.0, 2.0]), [1.0, 1.1, 2.0]);
        assert!(distinct(&[]).is_empty());
    }
}
