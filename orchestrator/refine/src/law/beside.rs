//! A law beside the effects of an answer: what these leave is looked at as else what the declared model leaves.
//!
//! A machine that lacks dry friction and something that no list holds needs both. The effects are fitted again along
//! with the law; one that only stood for a part of the law is left out.

use super::extent::Extent;
use super::study::{Aim, Finder, Outcome, Scope, extended, scaled};
use crate::answer::{Answer, Effect, Verdict};
use crate::engine::stop;
use crate::study::assembled;
use crate::study::by_share::{self, ByShare};
use crate::study::catalog::Candidate;
use crate::study::changed::corrected;
use crate::study::declaration::Role;
use crate::study::effects;
use crate::study::errors::errors;
use crate::study::explain::Judge;
use crate::study::fits::{Fits, Model, pieces};
use crate::study::model::{Action, Study};
use crate::study::ruling::share;
use crate::study::search::{Say, Selection};

/// Share of the error on validation records that effects have to leave for a law to be looked for beside them.
const MIN_LEFT_BY_EFFECTS: f64 = 0.05;
/// Share of the power that effects leave which a free form over one variable has to take away for that, and the same
/// beside an effect that alone explains too little to be named.
const MIN_SHARE_OF_FREE_FORM: f64 = 0.4;
const MIN_SHARE_OF_FREE_FORM_BESIDE_REFUSED: f64 = 0.6;
/// Effects that alone explain too little, beside which a law is looked for.
const MAX_REFUSED: usize = 2;
/// Share of what effects leave on validation records that a law has to take away where it leaves more than noise, and
/// that of the whole error that both take then.
const MIN_SHARE_OF_REST: f64 = 0.7;
const MIN_SHARE_OF_BOTH: f64 = 0.9;
/// Share of what effects leave that a law may leave by the free form it is looked for by.
const MAX_LEFT_BY_FREE_FORM: f64 = 0.1;
/// Ratio of the error without an effect to that with it, up to which the law beside it does without it.
pub(super) const MAX_ERROR_WITHOUT: f64 = 1.01;

/// Outcome of the search for effects.
pub struct Effects<'a> {
    /// Its selection.
    pub selection: &'a Selection,
    /// Its search for a share of the error, where it was asked.
    pub by_share: Option<&'a ByShare>,
    /// Candidates of the answer that are known to stand beside a law.
    pub terms: &'a [usize],
    /// Tolerances up to which declared parameters are corrected.
    pub max_tolerances: f64,
}

/// Puts a law for what effects leave into an answer; the model with both, if there is one. Where none of the effects
/// was named, because alone each explains too little, one stands beside a law with which it leaves noise. Without a law
/// the study and the answer stay as they are.
pub fn explain(
    study: &mut Study,
    scale: &[f64],
    (judge, effects): (&Judge, &Effects),
    found: &mut Answer,
    say: Say,
) -> Option<Model> {
    let bases = match found.verdict {
        _ if found.complete => Vec::new(),
        Verdict::Effect => beside_selected(study, scale, (judge, effects), found),
        Verdict::Unexplained => beside_refused(study, scale, (judge, effects)),
        _ => Vec::new(),
    };
    bases.into_iter().filter(|_| !stop::asked()).find_map(|base| {
        let before = Extent::of(study);
        let base = extended(&base, study);
        let law = sought(study, scale, (judge, &base, effects.max_tolerances), found, say);
        if law.is_none() {
            before.restore(study);
        }
        law
    })
}

/// Models with effects of an answer that leave much: all of them, those elsewhere than at a port whose effects may only
/// stand for the law, and the main one.
fn beside_selected(
    study: &Study,
    scale: &[f64],
    (judge, effects): (&Judge, &Effects),
    found: &Answer,
) -> Vec<Model> {
    let best = &extended(&effects.selection.best, study);
    let selected: Vec<&Effect> = found.effects.iter().filter(|effect| effect.selected).collect();
    let left = 1.0 - found.share.unwrap_or(1.0);
    // Changes of declared parameters have no candidate that could be fitted along.
    if left <= MIN_LEFT_BY_EFFECTS || selected.len() != best.added.len() {
        return Vec::new();
    }
    let fits = Fits { corrections: corrected(study, &best.fit), ..Fits::new(study, scale.to_vec()) };
    let part = |kept: &dyn Fn(&Candidate) -> bool| -> Option<Model> {
        let added: Vec<usize> = best.added.iter().copied().filter(|&c| kept(&study.candidates[c])).collect();
        if added.is_empty() || added.len() == best.added.len() || stop::asked() {
            return None;
        }
        fits.fit_from(added, &best.fit.parameters, &best.fit.locals)
    };
    if !effects.terms.is_empty() && effects.terms.len() < best.added.len() {
        let is_term =
            |own: &Candidate| effects.terms.iter().any(|&c| study.candidates[c].name() == own.name());
        return part(&is_term).into_iter().collect();
    }
    let place = |model: &Model| place_of_rest(&fits, judge, model, MIN_SHARE_OF_FREE_FORM);
    let mut bases: Vec<Model> = Vec::new();
    if place(best).is_some() {
        bases.push(best.clone());
    }
    let mut ports: Vec<&str> = best.added.iter().map(|&c| study.candidates[c].port.as_str()).collect();
    ports.sort_unstable();
    ports.dedup();
    for port in ports {
        let is_there = |base: &Model| place(base).is_some_and(|own| own == port);
        bases.extend(part(&|own| own.port != port).filter(is_there));
    }
    let main = part(&|own| selected.first().is_some_and(|effect| own.is(effect)));
    let is_new = |base: &Model| bases.iter().all(|other| other.added != base.added);
    let main = main.filter(|base| is_new(base) && place(base).is_some());
    bases.extend(main);
    bases
}

/// Models with the effects of which one alone does most, where none of them was named.
fn beside_refused(study: &Study, scale: &[f64], (judge, effects): (&Judge, &Effects)) -> Vec<Model> {
    let Some(by_share) = effects.by_share else { return Vec::new() };
    let corrected_model = extended(&by_share.corrected, study);
    let corrections = corrected(study, &corrected_model.fit);
    let fits = Fits { corrections, ..Fits::new(study, scale.to_vec()) };
    let best = by_share.steps.iter().find(|step| step.model.is_empty());
    let named = best.into_iter().flat_map(|step| &step.candidates).take(MAX_REFUSED);
    let is_block = |c: &usize| !matches!(study.candidates[*c].action, Action::Sensor { .. });
    let candidates = named
        .filter_map(|tried| study.candidates.iter().position(|own| own.name() == tried.id))
        .filter(is_block);
    let fitted = candidates.filter_map(|c| {
        let alone = effects.selection.singles.iter().find(|model| model.added == [c])?;
        let mut p = corrected_model.fit.parameters.clone();
        study.candidates[c].entries.clone().for_each(|index| p[index] = alone.fit.parameters[index]);
        let base = fits.fit_from(vec![c], &p, &corrected_model.fit.locals).filter(|_| !stop::asked())?;
        let near = place_of_rest(&fits, judge, &base, MIN_SHARE_OF_FREE_FORM_BESIDE_REFUSED);
        near.map(|_| base)
    });
    fitted.collect()
}

/// Port where a free form takes at least this share of the power that a model leaves.
fn place_of_rest(fits: &Fits, judge: &Judge, model: &Model, least: f64) -> Option<String> {
    let rest = judge.rest(fits, model);
    let much = rest.gain >= least * model.error.powi(2);
    let (place, _) = rest.place.filter(|_| much)?;
    Some(place.rsplit_once('@').map_or(place.as_str(), |(_, port)| port).to_owned())
}

fn sought(
    study: &mut Study,
    scale: &[f64],
    (judge, base, max_tolerances): (&Judge, &Model, f64),
    found: &mut Answer,
    say: Say,
) -> Option<Model> {
    let lacking = {
        let fits = Fits::new(study, scale.to_vec());
        let own =
            |role, locals| errors(&fits, &base.added, &pieces(study, role), &base.fit.parameters, locals);
        [own(Role::Estimation, Some(&base.fit.locals[..])), own(Role::Validation, None)]
    };
    let floors = || [found.floor[1].clone(), found.floor[1].clone()];
    let by_effects = share(study, [&found.before[1], &lacking[1]], &floors());
    let aim = Aim::Share { min_form_share: MIN_SHARE_OF_REST };
    let enough = MAX_LEFT_BY_FREE_FORM * scaled(study, scale, &lacking[0].rms);
    let scope = Scope { lacking: &lacking[1], enough, wide: false, max_tolerances };
    let mut finder = Finder::new(study, scale, (judge, base), aim, scope, say);
    let Outcome { mut law, model, after, widen } = finder.find(study, judge, base, found)?;
    let kept: Vec<usize> = base.added.iter().copied().filter(|c| model.added.contains(c)).collect();
    let complete = {
        let fits = finder.fits(study);
        judge.explained(&fits, &model) || judge.tolerable(&fits, &model)
    };
    let refused = found.verdict == Verdict::Unexplained;
    let whole = share(study, [&found.before[1], &after[1]], &floors());
    let much = law.share >= MIN_SHARE_OF_REST && whole >= MIN_SHARE_OF_BOTH;
    let enough = complete || !refused && much;
    let told = |c: &usize| found.effects.iter().any(|effect| study.candidates[*c].is(effect));
    if kept.is_empty() || !law.named || !enough || !kept.iter().all(told) {
        return None;
    }
    for effect in &mut found.effects {
        match kept.iter().find(|&&c| study.candidates[c].is(effect)) {
            Some(&c) => {
                effect.parameters = effects::parameters(study, &model, c, widen);
                effect.wiring = effects::wiring(study, &model, c);
                if !effect.selected {
                    effect.selected = true;
                    effect.share = Some(by_effects);
                    effect.reason = format!("beside the law at {} it leaves noise", law.port);
                }
            }
            None if effect.selected => {
                (effect.selected, effect.group) = (false, None);
                effect.reason = format!("the law at {} does without it", law.port);
            }
            None => {}
        }
    }
    law.share = whole - by_effects;
    (found.verdict, found.unexplained) = (Verdict::Effect, None);
    found.share = Some(whole);
    found.complete = complete;
    found.left[1] = judge.left(&finder.fits(study), &model);
    let at = (law.port.clone(), judge.floors(judge.excess(&model)));
    found.left_at = if complete { Vec::new() } else { vec![at] };
    found.law = Some(law);
    found.fitted = assembled::fitted(study, &model.fit.parameters);
    found.corrections = by_share::corrections_beside(study, &model, &found.corrections);
    found.after = after;
    found.parameters[1].clone_from(&model.fit.parameters);
    Some(model)
}
