//! A law of the rig over whole records: whether it leaves noise there, and whether it contradicts what windows say.

use super::rig::Subset;
use crate::answer::{Answer, Errors, errors};
use crate::engine::System;
use crate::engine::fit::{Fit, fit};
use crate::engine::goodness::{Null, pooled};
use crate::engine::normal::residuals;
use crate::engine::select::MARGIN;
use crate::rig::coupled::{Coupled, Trial};

/// Draws of the null of the records with the law.
const DRAWS: usize = 100;
/// Rounds of a fit to whole records.
const ROUNDS: usize = 10;
/// Ratio of the errors of a signal on validation records, after over before, from which on a law makes it worse.
const MIN_RATIO_OF_WORSE: f64 = 1.05;

/// A law over whole records.
pub struct Whole {
    /// The law fitted to whole records, where it then leaves noise.
    pub exact: Option<Fit>,
    /// Whether it does.
    pub complete: bool,
    /// Normalized powers that it leaves on estimation records, by signal.
    pub left: Vec<(String, f64)>,
    /// Errors with the law: estimation, validation.
    pub errors: [Errors; 2],
}

impl Whole {
    /// The law of the windowed rig `windowed` with the fit `best`; `records`: those of the estimation.
    pub fn new(windowed: &Coupled, records: &[usize], best: &Fit) -> Whole {
        let trials = windowed.trials.iter().map(|t| Trial { restart: None, ..t.clone() }).collect();
        let rig = Coupled { trials, ..windowed.clone() };
        let system = Subset { system: &rig, records: records.to_vec() };
        let all: Vec<usize> = (0..records.len()).collect();
        let starts: Vec<Vec<f64>> =
            all.iter().map(|&r| system.locals(r).iter().map(|local| local.0).collect()).collect();
        let found = fit(&system, &all, &best.parameters, &best.free, &starts, ROUNDS);
        let left = |fit: &Fit, null: &Null| {
            let own = residuals(&system, &all, &fit.parameters, &fit.locals);
            null.normalized(&pooled(&system, &all, &own))
        };
        let null = Null::simulate(&system, &all, &found.parameters, &found.locals, DRAWS, 1);
        let own = left(&found, &null);
        let complete = own.iter().all(|(_, z)| *z < null.quantile + MARGIN);
        let (exact, left) = if complete {
            (Some(found), own)
        } else {
            // Errors add up over whole records, so that what windows say is the better fit.
            let again = fit(&system, &all, &best.parameters, &[], &starts, ROUNDS);
            (None, left(&again, &null))
        };
        let p = exact.as_ref().map_or(&best.parameters, |own| &own.parameters);
        let errors = [true, false].map(|estimation| {
            let own: Vec<usize> = (0..rig.records()).filter(|&r| rig.estimation(r) == estimation).collect();
            errors(&rig, &own, p)
        });
        Whole { exact, complete, left, errors }
    }

    /// Signals whose error on validation records the law raises: name, error before and after, over the spread.
    fn worse(&self, before: &Errors) -> Vec<(String, f64, f64)> {
        let one = |(signal, was): (&String, &f64)| {
            let is = *self.errors[1].nrmse.get(signal)?;
            // An error that is no number is no better.
            let better = is <= MIN_RATIO_OF_WORSE * was;
            (!better).then(|| (signal.clone(), *was, is))
        };
        before.nrmse.iter().filter_map(one).collect()
    }

    /// Why whole validation records speak against the law, if they do: the error of all signals together rises, each
    /// over its spread.
    pub fn refuses(&self, before: &Errors) -> Option<String> {
        let total = |errors: &Errors| errors.nrmse.values().map(|own| own * own).sum::<f64>();
        if total(&self.errors[1]) < total(before) {
            return None;
        }
        let told = sentence(&self.worse(before));
        Some(if told.is_empty() { "over whole records the errors do not fall".to_owned() } else { told })
    }

    /// Sentences on signals whose error rises over whole validation records although windows say otherwise.
    pub fn contradictions(&self, found: &Answer) -> Option<String> {
        let worse = self.worse(&found.before[1]);
        (!worse.is_empty()).then(|| {
            format!(
                "The law makes windowed predictions better, but {}: over that time small errors add up.",
                sentence(&worse)
            )
        })
    }
}

/// Signals whose errors rise, in words.
fn sentence(worse: &[(String, f64, f64)]) -> String {
    let one = |(signal, was, is): &(String, f64, f64)| {
        format!("that of {signal} rises from {:.0} to {:.0} % of its spread", 100.0 * was, 100.0 * is)
    };
    match worse {
        [] => String::new(),
        _ if worse.iter().any(|(.., is)| !is.is_finite()) => {
            "over whole validation records the simulation with it diverges".to_owned()
        }
        _ => {
            format!("over whole validation records {}", worse.iter().map(one).collect::<Vec<_>>().join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors_of(values: [f64; 2]) -> Errors {
        let nrmse = ["theta", "x"].map(str::to_owned).into_iter().zip(values).collect();
        Errors { nrmse, ..Errors::default() }
    }

    fn whole(after: [f64; 2]) -> Whole {
        let errors = [errors_of(after), errors_of(after)];
        Whole { exact: None, complete: false, left: Vec::new(), errors }
    }

    #[test]
    fn a_law_that_makes_whole_records_worse_is_refused_and_says_why() {
        // Errors of a record whose angle is clipped: 125 % before, 169 % with the law.
        let why = whole([1.69, 0.4]).refuses(&errors_of([1.25, 0.5])).unwrap();
        assert!(why.contains("theta rises from 125 to 169 %"), "{why}");
        let why = whole([f64::NAN, 0.1]).refuses(&errors_of([1.25, 0.5])).unwrap();
        assert_eq!(why, "over whole validation records the simulation with it diverges");
    }

    #[test]
    fn a_signal_that_gets_worse_beside_others_that_gain_more_is_said() {
        let own = whole([0.60, 0.2]);
        let before = errors_of([0.55, 0.9]);
        assert_eq!(own.refuses(&before), None);
        let found = Answer { before: [Errors::default(), before], ..Answer::default() };
        assert!(own.contradictions(&found).unwrap().contains("theta"));
        assert_eq!(whole([0.5, 0.2]).contradictions(&found), None);
    }
}
