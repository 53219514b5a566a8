//! Backtracking along a Newton step until the filter accepts, with second-order corrections of the first trial.

use super::Run;
use crate::filter::{Acceptance, Current, Measure};
use crate::outcome::{Iteration, Note};

const CORRECTIONS: usize = 4;
/// Decrease of the violation that a correction has to bring for another one.
const CORRECTION_DECREASE: f64 = 0.99;

pub(super) enum Search {
    Accepted,
    /// No acceptable point along the step; what the functions said where they had no value at the last trial.
    Failed(Option<String>),
}

/// Functions at the end of a trial step.
#[derive(Debug, Default)]
pub(in crate::interior_point) struct Trial {
    measure: Measure,
    objective: f64,
    rows: Vec<f64>,
    x: Vec<f64>,
}

impl Run<'_, '_, '_> {
    /// Goes along the step to an acceptable point and evaluates the derivatives there.
    pub(super) fn search(&mut self) -> Search {
        let current = self.current();
        let largest = self.largest_step();
        self.last = Iteration { step: largest, regularization: self.kkt.shift, ..Iteration::default() };
        if self.is_tiny() {
            return self.take_tiny(current);
        }
        let shortest = self.filter.shortest(current);
        let mut length = self.step.longest;
        let mut failure = None;
        let mut first = true;
        while length >= shortest || first {
            match self.try_length(length) {
                Ok(()) => {
                    failure = None;
                    if let Some(acceptance) = self.filter.accepts(current, length, self.trial.measure) {
                        match self.take(current, acceptance, length, Note::None) {
                            Ok(()) => return Search::Accepted,
                            Err(reason) => failure = Some(reason),
                        }
                    } else if first
                        && self.trial.measure.theta >= current.at.theta
                        && let Some(found) = self.correct(current, length)
                    {
                        return found;
                    }
                }
                Err(reason) => failure = Some(reason),
            }
            first = false;
            length *= 0.5;
        }
        Search::Failed(failure)
    }

    /// Evaluates the point at this part of the step; the reason where it has no values.
    fn try_length(&mut self, length: f64) -> Result<(), String> {
        let mut trial = std::mem::take(&mut self.trial);
        trial.x.clear();
        trial.x.extend(self.at.x.iter().zip(&self.step.x).map(|(x, d)| x + length * d));
        trial.rows.resize(self.form.m, 0.0);
        let evaluated = self.form.functions(&trial.x, &mut trial.rows);
        if let Ok(objective) = evaluated {
            // The barrier terms read the trial through the iterate.
            std::mem::swap(&mut self.at.x, &mut trial.x);
            let terms = self.at.barrier_terms(self.form, self.form.total());
            std::mem::swap(&mut self.at.x, &mut trial.x);
            let theta = trial.rows.iter().map(|c| c.abs()).sum();
            trial.measure = Measure { theta, phi: objective + self.barrier * terms };
            trial.objective = objective;
        }
        self.trial = trial;
        evaluated.map(|_| ()).map_err(|error| error.to_string())
    }

    /// Second-order corrections: the step is solved again with the rows it led to. None: none was accepted, and the
    /// step is the one before.
    fn correct(&mut self, current: Current, length: f64) -> Option<Search> {
        std::mem::swap(&mut self.step, &mut self.kept);
        let mut rows = std::mem::take(&mut self.corrected);
        rows.clear();
        rows.extend_from_slice(&self.point.rows);
        let (mut length, mut before) = (length, current.at.theta);
        let mut found = None;
        for attempt in 0..CORRECTIONS {
            let theta = self.trial.measure.theta;
            if attempt > 0 && theta > CORRECTION_DECREASE * before {
                break;
            }
            before = if attempt > 0 { theta } else { before };
            rows.iter_mut().zip(&self.trial.rows).for_each(|(sum, c)| *sum = length * *sum + c);
            if !self.solve(Some(&rows)) {
                break;
            }
            length = self.step.longest;
            if self.try_length(length).is_err() {
                break;
            }
            if let Some(acceptance) = self.filter.accepts(current, self.kept.longest, self.trial.measure) {
                // The multipliers go with the corrected step.
                if self.take(current, acceptance, length, Note::SecondOrderCorrection).is_ok() {
                    found = Some(Search::Accepted);
                }
                break;
            }
        }
        self.corrected = rows;
        if found.is_none() {
            std::mem::swap(&mut self.step, &mut self.kept);
        }
        found
    }

    /// Moves to the trial point, with derivatives there; the reason when those have no value.
    fn take(
        &mut self,
        current: Current,
        acceptance: Acceptance,
        length: f64,
        note: Note,
    ) -> Result<(), String> {
        let trial = &self.trial;
        self.form
            .derivatives(&trial.x, &mut self.point.gradient, &mut self.point.jacobian)
            .map_err(|error| error.to_string())?;
        if acceptance == Acceptance::Filter {
            self.filter.add(current.at);
        }
        self.at.x.copy_from_slice(&trial.x);
        self.point.objective = trial.objective;
        self.point.rows.copy_from_slice(&trial.rows);
        self.at.y.iter_mut().zip(&self.step.y).for_each(|(y, d)| *y += length * d);
        let part = self.step.longest_multipliers;
        let [lower, upper] = &self.step.bounds;
        self.at.lower.iter_mut().zip(lower).for_each(|(z, d)| *z += part * d);
        self.at.upper.iter_mut().zip(upper).for_each(|(z, d)| *z += part * d);
        self.at.bound_multipliers(self.form, self.barrier);
        self.kkt.adapt(length / self.step.longest);
        self.last.step_length = length;
        self.last.note = note;
        Ok(())
    }

    fn largest_step(&self) -> f64 {
        self.step.x[..self.form.n].iter().fold(0.0, |m, d| m.max(d.abs()))
    }

    /// The step is lost in the rounding of the point.
    fn is_tiny(&self) -> bool {
        let relative = self.step.x.iter().zip(&self.at.x).map(|(d, x)| d.abs() / (1.0 + x.abs()));
        relative.fold(0.0, f64::max) < 10.0 * f64::EPSILON
    }

    /// A tiny step is taken without question, so that the barrier parameter can fall; two in a row at its end end
    /// the run.
    fn take_tiny(&mut self, current: Current) -> Search {
        self.tiny += 1;
        if self.tiny > 1 && self.barrier <= self.smallest_barrier() {
            return Search::Failed(None);
        }
        match self.try_length(self.step.longest) {
            Ok(()) => {
                let length = self.step.longest;
                match self.take(current, Acceptance::Objective, length, Note::None) {
                    Ok(()) => Search::Accepted,
                    Err(reason) => Search::Failed(Some(reason)),
                }
            }
            Err(reason) => Search::Failed(Some(reason)),
        }
    }
}
