//! Telling how far a search is: a system that counts what is asked of it.

use std::sync::atomic::{AtomicU64, Ordering};

use super::engine::noise::Noise;
use super::engine::system::Job;
use super::engine::{Span, System};

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event<'a> {
    /// A stage began.
    Stage(&'a str),
    /// This many draws of the simulated noise are done, each one record.
    Draws(u64),
    /// This many records were simulated.
    Simulations(u64),
}

/// A listener; called from several threads.
pub type Listener<'a> = &'a (dyn Fn(Event) + Sync);

/// A system that tells a listener what is asked of it and is the same otherwise.
pub struct Watched<'a> {
    inner: &'a dyn System,
    listener: Listener<'a>,
    simulations: AtomicU64,
    draws: AtomicU64,
}

impl<'a> Watched<'a> {
    /// Watches `inner`.
    pub fn new(inner: &'a dyn System, listener: Listener<'a>) -> Watched<'a> {
        Watched { inner, listener, simulations: AtomicU64::new(0), draws: AtomicU64::new(0) }
    }

    fn simulated(&self, count: u64) {
        let before = self.simulations.fetch_add(count, Ordering::Relaxed);
        (self.listener)(Event::Simulations(before + count));
    }
}

impl System for Watched<'_> {
    fn records(&self) -> usize {
        self.inner.records()
    }
    fn estimation(&self, record: usize) -> bool {
        self.inner.estimation(record)
    }
    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        self.inner.locals(record)
    }
    fn signals(&self, record: usize) -> Vec<Span> {
        self.inner.signals(record)
    }
    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.simulated(1);
        self.inner.predict(record, parameters, locals)
    }
    fn measured(&self, record: usize) -> Vec<f64> {
        self.inner.measured(record)
    }
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.inner.whiten(record, predicted)
    }
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        (self.listener)(Event::Draws(self.draws.fetch_add(1, Ordering::Relaxed) + 1));
        self.inner.redraw(record, predicted, noise)
    }
    fn residuals(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.simulated(1);
        self.inner.residuals(record, parameters, locals)
    }
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        self.simulated(jobs.len() as u64);
        self.inner.residuals_of(jobs)
    }
    fn stage(&self, name: &str) {
        (self.listener)(Event::Stage(name));
    }
    fn beginning(&self, share: f64) -> Option<Box<dyn System + '_>> {
        let inner = self.inner.beginning(share)?;
        Some(Box::new(Beginning { inner, whole: self }))
    }
}

/// The beginning of the records of a watched system: its simulations count as well.
struct Beginning<'a> {
    inner: Box<dyn System + 'a>,
    whole: &'a Watched<'a>,
}

impl System for Beginning<'_> {
    fn records(&self) -> usize {
        self.inner.records()
    }
    fn estimation(&self, record: usize) -> bool {
        self.inner.estimation(record)
    }
    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        self.inner.locals(record)
    }
    fn signals(&self, record: usize) -> Vec<Span> {
        self.inner.signals(record)
    }
    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.inner.predict(record, parameters, locals)
    }
    fn measured(&self, record: usize) -> Vec<f64> {
        self.inner.measured(record)
    }
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.inner.whiten(record, predicted)
    }
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        self.inner.redraw(record, predicted, noise)
    }
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        self.whole.simulated(jobs.len() as u64);
        self.inner.residuals_of(jobs)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::refine::engine::system::testing::Lines;

    #[test]
    fn a_watched_system_gives_the_same_and_is_counted() {
        let lines = Lines::new(1.0, 0.0);
        let seen = Mutex::new(Vec::new());
        let listener = |event: Event| seen.lock().unwrap().push(format!("{event:?}"));
        let watched = Watched::new(&lines, &listener);
        watched.stage("single effects");
        assert_eq!(watched.residuals(0, &[1.0, 0.0], &[0.0]), lines.residuals(0, &[1.0, 0.0], &[0.0]));
        assert_eq!(watched.predict(1, &[1.0, 0.0], &[0.0]), lines.predict(1, &[1.0, 0.0], &[0.0]));
        assert_eq!(*seen.lock().unwrap(), ["Stage(\"single effects\")", "Simulations(1)", "Simulations(2)"]);
    }
}
