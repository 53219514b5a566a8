//! A law beside the effects of an answer: what these leave is looked at as else what the declared model leaves.
//!
//! A machine that lacks dry friction and something that no list holds needs both. The effects are fitted again along
//! with the law; one that only stood for a part of the law is left out.

use super::extent::Extent;
use super::finder::{Finder, Scope};
use super::study::{Aim, Outcome, extended, put, put_alone, scaled};
use crate::answer::{Answer, Effect, Settings, Tried, Verdict};
use crate::engine::stop;
use crate::study::by_share::ByShare;
use crate::study::catalog::Candidate;
use crate::study::changed::corrected;
use crate::study::declaration::Role;
use crate::study::effects;
use crate::study::errors::errors;
use crate::study::exact;
use crate::study::explain::Judge;
use crate::study::fits::{Fits, Model, pieces};
use crate::study::law::Law;
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
/// Share of the error on validation records below which effects of an answer may be the wrong ones: those that a law
/// makes leave noise take their place.
const MAX_SHARE_OF_WEAK: f64 = 0.6;
/// Share of what effects leave on validation records that a law has to take away where it leaves more than noise, and
/// that of the whole error that both take then.
const MIN_SHARE_OF_REST: f64 = 0.7;
const MIN_SHARE_OF_BOTH: f64 = 0.9;
/// Share of what effects leave that a law may leave by the free form it is looked for by.
const MAX_LEFT_BY_FREE_FORM: f64 = 0.1;

/// Outcome of the search for effects.
pub struct Effects<'a> {
    /// Its selection.
    pub selection: &'a Selection,
    /// Its search for a share of the error, where it was asked.
    pub by_share: Option<&'a ByShare>,
    /// Candidates of the answer that are known to stand beside a law.
    pub terms: &'a [usize],
    /// A model with a law alone that leaves too much.
    pub part: Option<&'a Model>,
    /// Settings of the search.
    pub settings: &'a Settings,
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
    let weak = match found.verdict {
        _ if found.complete => return None,
        Verdict::Effect => {
            let bases = beside_selected(study, scale, (judge, effects), found);
            if let Some(law) = first(study, scale, (judge, effects, bases, false), found, say) {
                return Some(law);
            }
            found.share.is_some_and(|share| share < MAX_SHARE_OF_WEAK)
        }
        Verdict::Unexplained => true,
        _ => false,
    };
    let bases = if weak { beside_refused(study, scale, (judge, effects), say) } else { Vec::new() };
    first(study, scale, (judge, effects, bases, true), found, say)
}

/// The law beside the first of some models with effects beside which there is one.
fn first(
    study: &mut Study,
    scale: &[f64],
    (judge, effects, bases, to_noise): (&Judge, &Effects, Vec<Model>, bool),
    found: &mut Answer,
    say: Say,
) -> Option<Model> {
    bases.into_iter().filter(|_| !stop::asked()).find_map(|base| {
        let before = Extent::of(study);
        let base = extended(&base, study);
        let law = sought(study, scale, (judge, &base, effects, to_noise), found, say);
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
        let is_kept = |&c: &usize| kept(&study.candidates[c]);
        let added: Vec<usize> = best.added.iter().copied().filter(is_kept).collect();
        if added.is_empty() || stop::asked() {
            None
        } else if added.len() == best.added.len() {
            Some(best.clone())
        } else {
            fits.fit_from(added, &best.fit.parameters, &best.fit.locals)
        }
    };
    // A law has the constants of its port.
    let is_constant =
        |own: &Candidate| matches!(own.action, Action::Block { law: Law::Offset | Law::Bias, .. });
    let with_place = |kept: &dyn Fn(&Candidate) -> bool| -> Option<(Model, String)> {
        let base = part(kept)?;
        let place = place_of_rest(&fits, judge, &base, MIN_SHARE_OF_FREE_FORM)?;
        let is_own = |own: &Candidate| is_constant(own) && own.port == place;
        let has_own = base.added.iter().any(|&c| is_own(&study.candidates[c]));
        let base = if has_own { part(&|own| kept(own) && !is_own(own))? } else { base };
        Some((base, place))
    };
    if !effects.terms.is_empty() && effects.terms.len() < best.added.len() {
        let is_term =
            |own: &Candidate| effects.terms.iter().any(|&c| study.candidates[c].name() == own.name());
        return part(&is_term).into_iter().collect();
    }
    let mut bases: Vec<Model> = with_place(&|_| true).map(|(base, _)| base).into_iter().collect();
    let mut ports: Vec<&str> = best.added.iter().map(|&c| study.candidates[c].port.as_str()).collect();
    ports.sort_unstable();
    ports.dedup();
    for port in ports {
        let there = with_place(&|own| own.port != port).filter(|(_, place)| place == port);
        bases.extend(there.map(|(base, _)| base));
    }
    let main = with_place(&|own| selected.first().is_some_and(|effect| own.is(effect)));
    bases.extend(main.map(|(base, _)| base));
    let mut known = Vec::new();
    bases.retain(|base| {
        let is_new = !known.contains(&base.added);
        known.push(base.added.clone());
        is_new
    });
    bases
}

/// Models with the effects that leave noise beside a law which alone leaves too much, or else with one of those that
/// alone do most, where none is named.
fn beside_refused(
    study: &Study,
    scale: &[f64],
    (judge, effects): (&Judge, &Effects),
    say: Say,
) -> Vec<Model> {
    let with_part = effects.part.and_then(|part| {
        let fits = Fits::new(study, scale.to_vec());
        let both = exact::beside(&fits, judge, &extended(part, study), effects.settings, say)?;
        let mut p = both.fit.parameters.clone();
        let entries = part.added.iter().flat_map(|&c| study.candidates[c].entries.clone());
        entries.for_each(|index| p[index] = 0.0);
        let added = both.added.iter().copied().filter(|c| !part.added.contains(c)).collect();
        fits.fit_from(added, &p, &both.fit.locals)
    });
    if with_part.is_some() {
        return with_part.into_iter().collect();
    }
    let Some(by_share) = effects.by_share else { return Vec::new() };
    let corrected_model = extended(&by_share.corrected, study);
    let corrections = corrected(study, &corrected_model.fit);
    let fits = Fits { corrections, ..Fits::new(study, scale.to_vec()) };
    let best = by_share.steps.iter().find(|step| step.model.is_empty());
    let tried = best.into_iter().flat_map(|step| &step.candidates).take(MAX_REFUSED);
    let index = |tried: &Tried| study.candidates.iter().position(|own| own.name() == tried.id);
    let is_block = |c: &usize| !matches!(study.candidates[*c].action, Action::Sensor { .. });
    let mut candidates: Vec<usize> = tried.filter_map(index).filter(is_block).collect();
    // Where a simpler one leaves noise, the others are not tried.
    candidates.sort_by_key(|&c| study.candidates[c].complexity);
    let fitted = candidates.into_iter().filter_map(|c| {
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
    (judge, base, effects, to_noise): (&Judge, &Model, &Effects, bool),
    found: &mut Answer,
    say: Say,
) -> Option<Model> {
    let lacking = {
        let fits = Fits::new(study, scale.to_vec());
        let own =
            |role, locals| errors(&fits, &base.added, &pieces(study, role), &base.fit.parameters, locals);
        [own(Role::Estimation, Some(&base.fit.locals[..])), own(Role::Validation, None)]
    };
    let floors = |found: &Answer| [found.floor[1].clone(), found.floor[1].clone()];
    let by_effects = share(study, [&found.before[1], &lacking[1]], &floors(found));
    let aim = Aim::Share { min_form_share: MIN_SHARE_OF_REST };
    let most = MAX_LEFT_BY_FREE_FORM * scaled(study, scale, &lacking[0]);
    let max_tolerances = effects.settings.forward_selection.max_tolerances;
    let scope = Scope { lacking: &lacking[1], enough: most, wide: false, max_tolerances };
    let mut finder = Finder::new(study, scale, (judge, base), aim, scope, say);
    let Outcome { mut law, model, after, widen } = finder.find(study, judge, base, found)?;
    let kept: Vec<usize> = base.added.iter().copied().filter(|c| model.added.contains(c)).collect();
    let fits = finder.fits_with_all_steps(study);
    let complete = judge.explained(&fits, &model) || judge.tolerable(&fits, &model);
    let whole = share(study, [&found.before[1], &after[1]], &floors(found));
    let much = law.share >= MIN_SHARE_OF_REST && whole >= MIN_SHARE_OF_BOTH;
    let enough = complete || !to_noise && much && !kept.is_empty();
    if !law.named || !enough {
        return None;
    }
    // Beside them it was found, and without them it leaves noise.
    if kept.is_empty() {
        law.share = whole;
        put_alone(found, (&fits, judge, &model), law, after, complete);
        return Some(model);
    }
    for &c in &kept {
        if !found.effects.iter().any(|effect| study.candidates[c].is(effect)) {
            found.effects.push(effects::effect(&fits, effects.selection, &model, c, widen));
        }
    }
    for effect in &mut found.effects {
        match kept.iter().find(|&&c| study.candidates[c].is(effect)) {
            Some(&c) => {
                effect.parameters = effects::parameters(study, &model, c, widen);
                effect.wiring = effects::wiring(study, &model, c);
                if !effect.selected {
                    effect.selected = true;
                    // That of several is no share of one.
                    effect.share = (base.added.len() == 1).then_some(by_effects);
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
    put(found, (&fits, judge, &model), law, after, complete);
    Some(model)
}
