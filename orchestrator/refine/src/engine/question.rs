//! Question and result of forward selection as data: system, candidates, corrections, folds; models and steps found.

use std::ops::Range;

use super::System;
use super::candidate::Candidate;
use super::fit::Free;
use super::held_out::HeldOut;
use super::search::Model;
use super::settings::ForwardSelection as Settings;

/// A declared parameter that may be off within its tolerance.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// Its correction, with the tolerance as prior and bounds as far as a correction may go.
    pub free: Free,
    /// Candidate that does the same, if there is one: its first parameter is the correction times `declared`.
    pub effect: Option<usize>,
    /// Declared value.
    pub declared: f64,
}

/// Input of a forward selection.
pub struct Question<'a> {
    /// System.
    pub system: &'a dyn System,
    /// Error of its predictions.
    pub held_out: &'a HeldOut<'a>,
    /// Candidates.
    pub candidates: &'a [Candidate],
    /// Corrections of the declared parameters.
    pub corrections: &'a [Correction],
    /// Parameter vector of the declared model.
    pub declared: &'a [f64],
    /// Declared parameters that every fit is free to choose.
    pub always: &'a [Free],
    /// Local parameters of the declared model, by position in `records`; empty vectors where there are none.
    pub locals: Vec<Vec<f64>>,
    /// Whether a candidate may join the effects found before.
    pub may_join: &'a (dyn Fn(usize, &[usize]) -> bool + Sync),
    /// Candidates that join only the declared model, and only where no other does.
    pub last: &'a [usize],
    /// Sets of effects that another search found, with parameters to start from.
    pub proposals: &'a [(Vec<usize>, Vec<f64>)],
    /// Whether two effects are tried together where none is accepted alone.
    pub pairs: bool,
    /// Candidates that are free forms over one variable: they join no model, but show whether effects have the right
    /// form.
    pub free_forms: &'a [usize],
    /// Candidates that are another value of a declared parameter, in place of its correction and with the same entry:
    /// they join where they go beyond what a correction may do.
    pub changes: Range<usize>,
    /// Estimation records.
    pub records: Vec<usize>,
    /// Positions in `records` of those that candidates are screened on.
    pub screened: Vec<usize>,
    /// Folds of positions in `records`, each held out in turn.
    pub folds: Vec<Vec<usize>>,
    /// Why a fitted candidate makes no sense, if it does not.
    pub sense: &'a (dyn Fn(&Candidate, &Model) -> Option<String> + Sync),
    /// Settings.
    pub settings: Settings,
    /// Most effects.
    pub most: usize,
}

/// A candidate that was fitted beside the corrections and the effects found before it.
#[derive(Debug, Clone)]
pub struct Tried {
    /// Candidate.
    pub candidate: usize,
    /// The fit.
    pub model: Model,
    /// Fall of the weighted sum of squares.
    pub gain: f64,
    /// Fall of the error on held-out records, as a share of the error of the declared model.
    pub held_out: f64,
    /// Error of the residual on the held-out records \[units\].
    pub error: f64,
    /// Share of the error of the model before it that it takes away without any correction; no number where it is not
    /// asked for.
    pub alone: f64,
    /// Why it was not accepted.
    pub rejected: Option<String>,
}

/// One step of the forward selection.
#[derive(Debug, Clone)]
pub struct Step {
    /// Effects found before.
    pub added: Vec<usize>,
    /// Candidates that were fitted, best first.
    pub tried: Vec<Tried>,
}

/// Result of a forward selection.
#[derive(Debug, Clone)]
pub struct Found {
    /// Corrections alone.
    pub base: Model,
    /// Corrections and effects.
    pub best: Model,
    /// Effects that were accepted one by one, before sets of several took their place, and the parameters with them.
    pub one_by_one: (Vec<usize>, Vec<f64>),
    /// Steps, the last one without an accepted candidate unless `most` was reached.
    pub steps: Vec<Step>,
    /// Candidates that the records cannot tell from an accepted one: accepted, other model.
    pub equals: Vec<(usize, Tried)>,
    /// Error of the declared model on the estimation records \[units\].
    pub declared_error: f64,
    /// The free form that takes away much more than the effects do, if one does.
    pub free_form: Option<FreeForm>,
}

/// A free form that takes away more of the error than the effects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeForm {
    /// Candidate.
    pub candidate: usize,
    /// Share of the error on held-out records, beyond the corrections, that it takes away.
    pub share: f64,
}

impl Question<'_> {
    /// Corrections beside the effects `added`, without those that an effect takes the place of, and what is always
    /// free.
    pub(super) fn beside(&self, added: &[usize]) -> Vec<Free> {
        let kept = |c: &&Correction| !c.effect.is_some_and(|effect| added.contains(&effect));
        self.always.iter().copied().chain(self.corrections.iter().filter(kept).map(|c| c.free)).collect()
    }

    /// Whether a candidate is another value of a declared parameter.
    pub(super) fn is_change(&self, candidate: usize) -> bool {
        self.changes.contains(&candidate)
    }

    /// Whether one of some candidates is another value of a declared parameter.
    pub(super) fn changes_among(&self, candidates: &[usize]) -> bool {
        candidates.iter().any(|&c| self.is_change(c))
    }

    /// Whether a change goes beyond what the correction may do that it takes the place of.
    pub(super) fn is_beyond_correction(&self, change: usize, p: &[f64]) -> bool {
        let reach = |own: &Correction| self.settings.max_tolerances * own.free.prior.unwrap_or(f64::INFINITY);
        self.same(change).is_some_and(|own| p[own.free.index].abs() >= reach(own))
    }

    /// The correction that a candidate takes the place of.
    pub(super) fn same(&self, candidate: usize) -> Option<&Correction> {
        self.corrections.iter().find(|c| c.effect == Some(candidate))
    }

    /// Parameters with only these effects: every correction as declared.
    pub(super) fn without_corrections(&self, p: &[f64], added: &[usize]) -> Vec<f64> {
        let mut q = self.declared.to_vec();
        for free in added.iter().flat_map(|&c| &self.candidates[c].free).chain(self.always) {
            q[free.index] = p[free.index];
        }
        q
    }
}
