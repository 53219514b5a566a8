//! Progress of a search: a system that counts the simulations and draws asked of it and reports them to a listener.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::engine::noise::Noise;
use super::engine::system::Job;
use super::engine::{Span, System};

/// Event of a search.
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
    inner: Inner<'a>,
    listener: Listener<'a>,
    /// Counted together for the whole and the beginnings of its records.
    simulations: Arc<AtomicU64>,
    draws: AtomicU64,
}

/// System that is watched.
enum Inner<'a> {
    Whole(&'a dyn System),
    Beginning(Box<dyn System + 'a>),
}

impl<'a> Deref for Inner<'a> {
    type Target = dyn System + 'a;

    fn deref(&self) -> &Self::Target {
        match self {
            Inner::Whole(system) => *system,
            Inner::Beginning(system) => system.as_ref(),
        }
    }
}

impl<'a> Watched<'a> {
    /// Watches `inner`.
    pub fn new(inner: &'a dyn System, listener: Listener<'a>) -> Watched<'a> {
        Watched {
            inner: Inner::Whole(inner),
            listener,
            simulations: Arc::default(),
            draws: AtomicU64::new(0),
        }
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
    fn silence(&self, record: usize, values: &mut [f64]) {
        self.inner.silence(record, values);
    }
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.inner.whiten(record, predicted)
    }
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        // The null of a beginning is small and not the one that is waited for.
        if let Inner::Whole(_) = self.inner {
            (self.listener)(Event::Draws(self.draws.fetch_add(1, Ordering::Relaxed) + 1));
        }
        self.inner.redraw(record, predicted, noise)
    }
    fn residuals(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.simulated(1);
        self.inner.residuals(record, parameters, locals)
    }
    fn side_by_side(&self) -> usize {
        self.inner.side_by_side()
    }
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        self.simulated(jobs.len() as u64);
        self.inner.residuals_of(jobs)
    }
    fn stage(&self, name: &str) {
        (self.listener)(Event::Stage(name));
    }
    fn beginning(&self, share: f64) -> Option<Box<dyn System + '_>> {
        let inner = Inner::Beginning(self.inner.beginning(share)?);
        let simulations = Arc::clone(&self.simulations);
        Some(Box::new(Watched { inner, listener: self.listener, simulations, draws: AtomicU64::new(0) }))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::engine::system::testing::Lines;

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
