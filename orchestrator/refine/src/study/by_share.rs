//! The effects of a study that no model explains to the noise: for their share of the error, beside corrections of the
//! declared parameters within their tolerances.

use std::collections::BTreeMap;

use super::changed;
use super::explain::{self, Judge};
use super::fits::{self, Fits};
use super::influence::{Influential, Singles, influential};
use super::model::{Study, Target};
use super::one_part;
use super::physical::contradiction;
use super::search::{Say, Selection};
use super::simulate::Piece;
use super::whole::{Whole, candidate, model};
use crate::answer::{Correction, Settings, Step, Tried};
use crate::engine::candidate::Candidate;
use crate::engine::fit::Free;
use crate::engine::forward_selection::{self, OTHERS_TAKE_MORE};
use crate::engine::held_out::HeldOut;
use crate::engine::question::{self, Found, Question};
use crate::engine::search::Model;
use crate::share::percent;

/// Records up to which spans of them are held out instead of whole ones.
const MAX_RECORDS_FOR_SPANS: usize = 2;

/// Outcome of the forward selection in the terms of a study.
pub struct ByShare {
    /// Effects with corrections, and the single ones; `declared` is the declared model as it stands.
    pub selection: Selection,
    /// The effects of the best model, other values of declared parameters among them.
    pub added: Vec<usize>,
    /// The corrections alone.
    pub corrected: fits::Model,
    /// Corrections beside the effects.
    pub corrections: Vec<Correction>,
    /// Effects that were accepted one by one, before sets of several took their place, and the parameters with them.
    pub one_by_one: (Vec<usize>, Vec<f64>),
    /// Whether the fits counted residuals as the independent samples that they hold.
    pub weighted: bool,
    /// The effects beside corrections, where those of the selection are fitted without.
    pub beside_corrections: Option<fits::Model>,
    /// Candidates tried, step by step.
    pub steps: Vec<Step>,
    /// A sentence on candidates that one part of the records alone bears out.
    pub told: Option<String>,
    /// Channel and variable of a free form that takes away much more than the effects, and the share that it takes.
    pub free_form: Option<(String, Vec<String>, f64)>,
}

impl ByShare {
    /// Whether it found the effects of another search with every correction within one tolerance.
    pub fn is_without_corrections(&self, other: &Selection) -> bool {
        let sorted = |selection: &Selection| {
            let mut added = selection.best.added.clone();
            added.sort_unstable();
            added
        };
        let small = self.corrections.iter().all(|own| own.moved.abs() < own.tolerance);
        let unchanged = self.selection.changed.is_empty() && other.changed.is_empty();
        small && unchanged && !other.best.added.is_empty() && sorted(&self.selection) == sorted(other)
    }
}

/// A study whose effects are searched for their share of the error.
pub struct Search<'a> {
    /// Fits of the study.
    pub fits: &'a Fits<'a>,
    /// Power that the noise of the sensors gives.
    pub judge: &'a Judge,
    /// Unit of the error by output.
    pub units: &'a [f64],
    /// Rules.
    pub settings: &'a Settings,
    /// Sentences for a progress display.
    pub say: Say<'a>,
}

impl Search<'_> {
    /// Searches from the fitted declared model beside what effects alone give.
    pub fn run(&self, exact: &Selection) -> ByShare {
        self.ask(exact, None, |question, known| {
            let found = forward_selection::search(question);
            let told = one_part::told(self.fits.study, question, &pieces(self.fits).0, &found);
            ByShare { told, ..answer(self.fits, &exact.declared, known, &found) }
        })
    }

    /// The effects of a selection beside corrections, fitted from `start`.
    pub fn refitted(&self, found: &ByShare, start: &[f64]) -> fits::Model {
        let again = self.ask(&found.selection, None, |question, known| {
            let again = forward_selection::refit(question, &found.added, start);
            answer(self.fits, &found.selection.declared, known, &again)
        });
        again.selection.best
    }

    /// The effects `found`, fitted again without an effect that takes away the share `alone` of the error on validation
    /// records; the effects accepted one by one in its place, where they do better on the estimation records.
    pub fn without(&self, found: &ByShare, weak: usize, alone: f64) -> ByShare {
        let (study, selection) = (self.fits.study, &found.selection);
        let rest: Vec<usize> = found.added.iter().copied().filter(|&c| c != weak).collect();
        let declared = &selection.declared.fit.parameters;
        let mut start = selection.best.fit.parameters.clone();
        study.candidates[weak].entries.clone().for_each(|index| start[index] = declared[index]);
        let mut again = self.fitted(found, &rest, &start);
        let (other, start) = &found.one_by_one;
        if !other.is_empty() && !other.contains(&weak) && *other != rest {
            let other = self.fitted(found, other, start);
            if other.selection.best.error < again.selection.best.error {
                again = other;
            }
        }
        let least = self.settings.forward_selection.min_validated_share;
        let together = format!("with the others less than {:.0} %", 100.0 * least);
        let reason = if alone < least {
            format!(
                "on validation records it takes away {} of the error alone, and {together}: it explains little without them",
                percent(alone)
            )
        } else {
            format!(
                "its 95 % interval holds zero, and {together} of the error on validation records needs it"
            )
        };
        let name = study.candidates[weak].name();
        let stands: Vec<String> =
            again.added.iter().filter_map(|&c| Some(study.candidates.get(c)?.name())).collect();
        let mut steps = found.steps.clone();
        for own in steps.iter_mut().flat_map(|step| &mut step.candidates) {
            if own.id == name {
                own.rejected = Some(reason.clone());
            } else if own.rejected.as_deref() == Some(OTHERS_TAKE_MORE) && stands.contains(&own.id) {
                own.rejected = None;
            }
        }
        ByShare { steps, ..again }
    }

    /// The effects `added` beside corrections, fitted from `start`, with the steps of the search that found others.
    pub fn fitted(&self, found: &ByShare, added: &[usize], start: &[f64]) -> ByShare {
        let again = self.ask(&found.selection, None, |question, known| {
            let again = forward_selection::refit(question, added, start);
            answer(self.fits, &found.selection.declared, known, &again)
        });
        let singles = found.selection.singles.clone();
        let (steps, told) = (found.steps.clone(), found.told.clone());
        ByShare { steps, told, selection: Selection { singles, ..again.selection }, ..again }
    }

    /// Parameters of the effects found, fitted from several values of one of them, or of one `more`.
    pub fn fitted_from(
        &self,
        found: &ByShare,
        (entry, values): (usize, &[f64]),
        more: Option<Free>,
    ) -> Option<Vec<f64>> {
        let start = |value: &f64| {
            let mut p = found.selection.best.fit.parameters.clone();
            p[entry] = *value;
            p
        };
        let starts: Vec<Vec<f64>> = values.iter().map(start).collect();
        let more = more.zip(values.first().copied());
        self.ask(&found.selection, more, |question, _| {
            forward_selection::fitted_from(question, &found.added, &starts)
        })
    }

    /// Asks the forward selection from a fitted declared model, with the effects of `proposed` as a proposal, and one
    /// more parameter that is always free, with its value in the declared model.
    fn ask<T>(
        &self,
        proposed: &Selection,
        more: Option<(Free, f64)>,
        answer: impl FnOnce(&Question, &[question::Correction]) -> T,
    ) -> T {
        let (study, declared) = (self.fits.study, &proposed.declared);
        let (pieces, folds) = pieces(self.fits);
        let view = self.fits.view(&[], &pieces);
        let whole = Whole::new(&view, self.judge.floor(self.fits), self.say);
        let units = study.outputs.iter().zip(self.units);
        let units: BTreeMap<String, f64> = units.map(|(output, unit)| (output.name.clone(), *unit)).collect();
        let held_out = HeldOut::new(&whole, &units);
        let mut candidates: Vec<Candidate> =
            (0..study.candidates.len()).map(|c| candidate(study, c)).collect();
        let mut p = declared.fit.parameters.clone();
        more.iter().for_each(|(free, value)| p[free.index] = *value);
        let p = &p[..];
        let locals = fits::locals_of(self.fits, &pieces, declared);
        let rules = self.settings.forward_selection;
        let mut known = known(study, &whole, (p, &locals), &candidates, rules.max_tolerances);
        candidates.extend(changes(study, &mut known));
        let mut always = study.declared_free();
        always.extend(more.map(|own| own.0));
        let probes = (0..study.candidates.len()).filter(|&c| study.candidates[c].probe);
        let free_forms: Vec<usize> = probes.collect();
        let alone = (0..study.candidates.len()).filter(|&c| study.candidates[c].may_stand_alone());
        let alone: Vec<usize> = alone.collect();
        let question = Question {
            system: &whole,
            held_out: &held_out,
            candidates: &candidates,
            corrections: &known,
            declared: p,
            always: &always,
            locals,
            may_join: &|c, added| {
                let Some(own) = study.candidates.get(c) else { return true };
                !own.is_resolution() && own.needs.is_none_or(|needs| added.contains(&needs))
            },
            last: &alone,
            proposals: &[(proposed.best.added.clone(), proposed.best.fit.parameters.clone())],
            pairs: true,
            free_forms: &free_forms,
            changes: study.candidates.len()..candidates.len(),
            records: (0..pieces.len()).collect(),
            screened: (0..pieces.len()).collect(),
            folds,
            sense: &|_, model| sense(study, model),
            settings: rules,
            most: self.settings.max_effects,
        };
        answer(&question, &known)
    }
}

/// Pieces to be fitted, and folds of them that are held out in turn: whole records, or spans where there are few.
fn pieces(fits: &Fits) -> (Vec<Piece>, Vec<Vec<usize>>) {
    if fits.pieces.len() > MAX_RECORDS_FOR_SPANS {
        let groups = fits.pieces.len().min(4);
        let of = |group: usize| (0..fits.pieces.len()).filter(|i| i % groups == group).collect();
        return (fits.pieces.clone(), (0..groups).map(of).collect());
    }
    let (mut spans, mut folds) = (Vec::new(), vec![Vec::new(); 2]);
    for (k, (_, inside)) in fits.folds.iter().enumerate() {
        for piece in inside {
            folds[k % 2].push(spans.len());
            spans.push(piece.clone());
        }
    }
    (spans, folds)
}

/// The corrections that the records show, most influential first, with the effects that do the same.
fn known(
    study: &Study,
    whole: &Whole,
    at: (&[f64], &[Vec<f64>]),
    candidates: &[Candidate],
    most: f64,
) -> Vec<question::Correction> {
    let singles = Singles::new(study, whole, at, candidates);
    let one = |own: Influential| {
        let twin = singles.same(&own);
        question::Correction {
            free: own.free,
            effect: twin.map(|(c, _)| c),
            declared: twin.map_or(own.declared, |(_, ratio)| ratio),
        }
    };
    influential(study, whole, at, most).into_iter().map(one).collect()
}

/// Other values of the declared parameters that no effect of the list does the same as, as candidates behind those of
/// the study.
fn changes(study: &Study, known: &mut [question::Correction]) -> Vec<Candidate> {
    let alone = known.iter_mut().filter(|own| own.effect.is_none()).enumerate();
    let one = |(k, own): (usize, &mut question::Correction)| {
        // Its value is that of the correction.
        (own.effect, own.declared) = (Some(study.candidates.len() + k), 1.0);
        changed::candidate(Free { prior: None, ..study.entries[own.free.index].free })
    };
    alone.map(one).collect()
}

/// Why a fitted candidate makes no sense, if it does not.
fn sense(study: &Study, model: &Model) -> Option<String> {
    let added: Vec<usize> = model.added.iter().copied().filter(|&c| c < study.candidates.len()).collect();
    // What is no candidate of the study, another value of a parameter, has no shape.
    let &last = added.last()?;
    let (c, why) = contradiction(study, &fits::Model::new(added, model.fit.clone(), f64::NAN))?;
    Some(if c == last { why } else { format!("`{}` beside it: {why}", study.candidates[c].name()) })
}

fn answer(fits: &Fits, declared: &fits::Model, known: &[question::Correction], found: &Found) -> ByShare {
    let study = fits.study;
    let best = model(fits, &found.best);
    let corrected = model(fits, &found.base);
    // Other values of declared parameters are no candidates of the study.
    let change = |c: usize| known.iter().find(|own| own.effect == Some(c) && c >= study.candidates.len());
    let entry = |c: usize| change(c).map(|own| &study.entries[own.free.index]);
    let name = |c: usize| {
        entry(c).map_or_else(|| study.candidates[c].name(), |own| format!("{}@{}", changed::KIND, own.name))
    };
    let port = |c: usize| entry(c).map_or_else(|| study.candidates[c].port.clone(), |own| own.name.clone());
    let names = |added: &[usize]| added.iter().map(|&c| name(c)).collect();
    let steps = found
        .steps
        .iter()
        .map(|step| Step {
            model: names(&step.added),
            candidates: step
                .tried
                .iter()
                .map(|own| Tried {
                    id: name(own.candidate),
                    port: Some(port(own.candidate)),
                    held_out_gain: own.held_out,
                    rejected: own.rejected.clone(),
                })
                .collect(),
        })
        .collect();
    let singles = found.steps.first().map_or_else(Vec::new, |step| {
        let of_the_list = step.tried.iter().filter(|own| change(own.candidate).is_none());
        of_the_list.map(|own| model(fits, &own.model)).collect()
    });
    let of_the_list = found.equals.iter().filter(|(lacking, _)| change(*lacking).is_none());
    let equals = of_the_list.map(|(lacking, own)| (*lacking, model(fits, &own.model))).collect();
    let path = vec![(Vec::new(), f64::NAN)];
    let changed = found.best.added.iter().filter_map(|&c| Some(study.entries[change(c)?.free.index].free));
    let changed = changed.map(|free| Free { prior: None, ..free }).collect();
    let selection = Selection { equals, changed, ..Selection::new(declared.clone(), best, singles, path) };
    let corrections = corrections(study, &selection.best, known);
    let free_form = found.free_form.map(|form| {
        let own = &study.candidates[form.candidate];
        (own.place(), vec![explain::name(study, form.candidate).to_owned()], form.share)
    });
    let one_by_one = found.one_by_one.clone();
    ByShare {
        selection,
        added: found.best.added.clone(),
        corrected,
        corrections,
        one_by_one,
        weighted: true,
        beside_corrections: None,
        steps,
        told: None,
        free_form,
    }
}

/// The corrections of a model.
pub fn corrections(study: &Study, model: &fits::Model, known: &[question::Correction]) -> Vec<Correction> {
    let one = |(a, free): (usize, &Free)| {
        let entry = &study.entries[free.index];
        let Target::Correction { declared, .. } = entry.target else { return None };
        let moved = model.fit.parameters[free.index];
        let half = 1.96 * (declared * model.fit.covariance[(a, a)].max(0.0).sqrt()).abs();
        let value = declared * (1.0 + moved);
        let (component, parameter) = entry.name.rsplit_once('.').unwrap_or(("", &entry.name));
        // One without a tolerance is an effect of its own.
        let tolerance = free.prior?;
        let twin = known.iter().find(|own| own.free.index == free.index).and_then(|own| own.effect);
        Some(Correction {
            id: twin.and_then(|c| study.candidates.get(c)).map(|own| own.id.to_owned()),
            component: component.into(),
            parameter: parameter.into(),
            declared,
            value,
            interval: (value - half, value + half),
            moved,
            tolerance,
            parameters: Vec::new(),
        })
    };
    model.fit.free.iter().enumerate().filter_map(one).collect()
}

/// The corrections of a model, with the ids of those known before.
pub fn corrections_beside(study: &Study, model: &fits::Model, before: &[Correction]) -> Vec<Correction> {
    let mut found = corrections(study, model, &[]);
    for own in &mut found {
        let same =
            |other: &&Correction| (&other.component, &other.parameter) == (&own.component, &own.parameter);
        own.id = before.iter().find(same).and_then(|other| other.id.clone());
    }
    found
}
