//! The longest time of a task.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use airloop_cosim::master::simulate::Watch;

use super::Outcome;
use crate::file::PlanFile;

/// The longest time of a task, if the plan has one.
#[derive(Debug, Clone, Copy)]
pub struct Limit(Option<Duration>);

impl Limit {
    /// `time_limit` of a plan.
    pub fn of(plan: &PlanFile) -> Limit {
        Limit(plan.time_limit.map(Duration::from_secs_f64))
    }

    /// Whether a task that began then lasts too long.
    pub fn is_over(self, began: Instant) -> bool {
        self.0.is_some_and(|limit| began.elapsed() > limit)
    }

    /// Runs a simulation with a watch that stops it when the sweep is interrupted (`stop`) or the time is over.
    pub fn watch<T>(self, stop: &AtomicBool, run: impl FnOnce(Watch) -> T) -> T {
        let (began, own) = (Instant::now(), AtomicBool::new(false));
        let mut look = |_, _| {
            if stop.load(Ordering::Relaxed) || self.is_over(began) {
                own.store(true, Ordering::Relaxed);
            }
        };
        run(Watch { stop: &own, progress: &mut look })
    }

    /// Outcome of a simulation that its watch stopped; none if it was the sweep that was interrupted.
    pub fn stopped(self, stop: &AtomicBool, columns: usize) -> Option<Outcome> {
        (!stop.load(Ordering::Relaxed)).then(|| self.timeout(columns))
    }

    /// Outcome of a task that lasted too long.
    pub fn timeout(self, columns: usize) -> Outcome {
        let cause = format!("longer than {} s", self.0.unwrap_or_default().as_secs_f64());
        Outcome::failed("timeout", columns, cause)
    }
}
