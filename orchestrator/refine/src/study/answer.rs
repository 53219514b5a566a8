//! A study from the declaration to the answer in the terms of the vocabulary: records and system, searches, verdict.

use super::assembled::{assemble, chosen_by_validation, first_place, fitted, notes};
use super::by_share::{self, ByShare};
use super::colored;
use super::declaration::File;
use super::effects::order;
use super::errors::errors;
use super::exact;
use super::explain::Judge;
use super::fits::{Fits, Model};
use super::influence::declared_viscous;
use super::integration;
use super::model::Study;
use super::periods;
use super::prepared::{Prepared, prepared};
use super::remarks;
use super::resolution;
use super::search::{Say, Selection, confirm, search};
use super::sign_change;
use super::smoothed;
use super::starts;
use super::whole::Whole;
use super::windowed_periods;
use super::with_corrections;
use crate::Error;
use crate::answer::{Answer, Effect, Settings, Verdict};
use crate::engine::fit::{Fit, fit};
use crate::engine::stop;
use crate::evidence::{Evidence, study as evidence};
use crate::explained;
use crate::law::beside;
use crate::law::extent::Extent;
use crate::law::found::told as sentences;
use crate::law::listed;
use crate::law::study::{self as law, Aim};

/// Share of a limited time that the search for an explanation to the noise may use.
const EXACT_SHARE_OF_TIME: f64 = 0.5;

/// Share by which finer steps of integration may change the residual of effects for them to stand: where they change it
/// by more, the error of the integration had been searched as well.
const MAX_CHANGE_BY_FINER_STEPS: f64 = 0.15;

/// Share of the error on validation records that one of several effects which do the same on estimation records must
/// take away to stand in place of another that validation records refuse: more than others, as it is chosen by them.
const MIN_SHARE_OF_OTHER_OF_EQUALS: f64 = 0.5;

/// Reads, searches and answers.
///
/// # Errors
/// A declaration, records or a system that do not fit together, and a declared model that cannot be simulated.
pub fn answer(file: &File, settings: &Settings, say: Say) -> Result<(Answer, Evidence), Error> {
    let first = attempt(file, settings, 1, say)?;
    let Some(substeps) = first.finer.filter(|_| !stop::asked()) else { return Ok(first.found) };
    say("again with finer steps of integration");
    let again = attempt(file, settings, substeps, say)?;
    // A search that had to end early knows less than the first.
    Ok(if stop::asked() { first.found } else { again.found })
}

/// Outcome of one search.
struct Attempt {
    found: (Answer, Evidence),
    /// Steps of integration per sample that the model found needs, if they are more than it had and what it leaves is
    /// the error of its integration.
    finer: Option<usize>,
}

/// One search with at least so many steps of integration per sample.
fn attempt(file: &File, settings: &Settings, least_substeps: usize, say: Say) -> Result<Attempt, Error> {
    let Prepared { mut study, declared, suspicion, .. } = prepared(file, least_substeps, say)?;
    let scale = scales(&study, &declared);
    correct(&mut study, &scale, &[], &declared.parameters);
    let mut model = steps(&mut study, &scale, &declared);
    make_stable(&mut study, &scale, &mut model);
    periods::propose(&mut study, &scale, &model);
    windowed_periods::propose(&mut study, &scale, &model);
    let fits = Fits::new(&study, scale.clone()).quickened(&model);
    let mut quick = fits.quick;
    say("noise floor");
    let mut judge = Judge::new(&fits, &model, settings.draws, settings.seed);
    let viscous = {
        let view = fits.view(&[], &fits.pieces);
        let whole = Whole::new(&view, judge.floor(&fits), say);
        let at = (&model.fit.parameters[..], &model.fit.locals[..]);
        declared_viscous(&study, &whole, at, settings.forward_selection.max_tolerances)
    };
    allow_less(&mut study, &viscous);
    // The rest of a limited time is for effects that leave more than noise.
    stop::stage(EXACT_SHARE_OF_TIME);
    let mut exact = exact::search(&Fits::new(&study, scale.clone()), &judge, &model, settings, say);
    // The error of integration may be what a second effect makes up for.
    let alone = match &exact {
        Err(best) => best.as_deref(),
        Ok(own) if own.effects() > 1 => own.singles.first(),
        Ok(_) => None,
    };
    if let Some(best) = alone
        && let Some(substeps) = integration::finer(&Fits::new(&study, scale.clone()), best)
    {
        study.substeps = substeps;
        let fits = Fits::new(&study, scale.clone());
        model = afresh(&fits, model);
        exact = exact::search(&fits, &judge, &model, settings, say);
        quick = fits.quickened(&model).quick;
    }
    // Noise of the states that windows start from grows as the model lets it.
    if let Err(Some(best)) = &exact
        && !study.starts.is_empty()
        && !stop::asked()
    {
        study.starts = starts::starts(&study, &best.added, &best.fit.parameters);
        let fits = Fits::new(&study, scale.clone());
        judge = Judge::new(&fits, best, settings.draws, settings.seed);
        model = afresh(&fits, model);
        exact = exact::search(&fits, &judge, &model, settings, say);
    }
    stop::stage(1.0);
    let fits = Fits { quick, ..Fits::new(&study, scale.clone()) };
    let selection = exact.unwrap_or_else(|_| search(&fits, &judge, model, settings.max_effects, say));
    let best = &selection.best;
    if selection.effects() > 0 {
        correct(&mut study, &scale, &best.added, &best.fit.parameters);
    }
    let selection = sign_change::settle(&mut study, &scale, &judge, selection);
    let fits = Fits::new(&study, scale.clone());
    let selection = if selection.exact {
        let best = exact::refitted(&fits, &selection.best);
        Selection { best, ..selection }
    } else {
        confirm(&fits, &judge, selection, say)
    };
    let max_tolerances = settings.forward_selection.max_tolerances;
    let declared = &selection.declared;
    let simplest = [Some(declared), Some(&selection.best), selection.singles.first()];
    let simplest: Vec<&Model> = simplest.into_iter().flatten().collect();
    // A search that has to end has no time for a law to the noise.
    let known = stop::asked()
        || judge.explained(&fits, &selection.best)
        || law::corrections_explain(&fits, &judge, declared, &simplest, max_tolerances);
    let by_law = if known {
        None
    } else {
        // A law that leaves noise needs no search for shares; effects with corrections that do say more.
        let mut found = assemble(&fits, &judge, &selection, None, settings);
        let base = &selection.declared;
        let aim = (Aim::Noise, max_tolerances);
        let found_law = law::explain(&mut study, &scale, (&judge, base), &mut found, aim, say).law;
        found_law.map(|law| (found, law))
    };
    let (selection, mut found, with_law, corrected) = match by_law {
        Some((found, law)) => (selection, found, Some(law), None),
        None => {
            let fits = Fits::new(&study, scale.clone());
            let search = by_share::Search { fits: &fits, judge: &judge, units: &scale, settings, say };
            let (mut selection, mut by_share) = with_corrections::search(&search, selection);
            say("errors on all records");
            if by_share.is_none() && stop::asked() {
                selection.best = fits.with_covariance(&selection.best);
            }
            let mut found = assemble(&fits, &judge, &selection, by_share.as_ref(), settings);
            if let Some((other, answer)) = other_of_equals(&search, (&selection, by_share.as_ref()), &found) {
                found = answer;
                (selection, by_share) = match other {
                    Refitted::BesideCorrections(own) => (own.selection.clone(), Some(*own)),
                    Refitted::Alone(own) => (*own, None),
                };
            }
            while let Some((own, (weak, alone))) =
                by_share.as_ref().zip(weakest_dependent(&search, &selection, &found))
            {
                let without = search.without(own, weak, alone);
                let rest = assemble(&fits, &judge, &without.selection, Some(&without), settings);
                if !stands_without(&found, &rest, settings) {
                    break;
                }
                (selection, found, by_share) = (without.selection.clone(), rest, Some(without));
            }
            let own = by_share.as_ref().filter(|own| own.weighted && !stop::asked());
            let own =
                own.and_then(|own| sign_change::fitted(&mut study, &scale, &judge, (settings, say), own));
            if let Some(own) = own {
                let fits = Fits::new(&study, scale.clone());
                found = assemble(&fits, &judge, &own.selection, Some(&own), settings);
                found.notes.extend(sign_change::notes(&study, &own.added));
                (selection, by_share) = (own.selection.clone(), Some(own));
            }
            let base = by_share.as_ref().map_or(&selection.declared, |found| &found.corrected).clone();
            {
                // Effects that leave noise, white or not, need no law.
                let corrected = by_share.as_ref().map(|own| &own.corrected);
                let own = shown(&found, &selection, corrected, None);
                settle(&Fits::new(&study, scale.clone()), &judge, (own, corrected), &mut found);
            }
            let aim = Aim::Share { min_form_share: settings.forward_selection.min_form_share };
            let without = found.clone();
            let before = Extent::of(&study);
            let in_place =
                law::explain(&mut study, &scale, (&judge, &base), &mut found, (aim, max_tolerances), say);
            let mut law = in_place.law;
            // One that takes the place of effects and leaves more than noise may only be their sum with another.
            if !found.complete {
                let (selection, by_share) = (&selection, by_share.as_ref());
                let (terms, part) = (&in_place.terms[..], in_place.part.as_ref());
                let effects = beside::Effects { selection, by_share, terms, part, settings };
                let mut both = without;
                let beside = beside::explain(&mut study, &scale, (&judge, &effects), &mut both, say);
                if beside.is_some() && (law.is_none() || both.complete) {
                    (found, law) = (both, beside);
                }
            }
            // A part of a law beside which no effect was found.
            if law.is_none() {
                before.restore(&mut study);
            }
            if law.is_none()
                && let Some(own) = &by_share
                && let Some((own, fine)) =
                    finely_beside(&mut study, &scale, (&judge, own), &found, (settings, say))
            {
                found = fine;
                (selection, by_share) = (own.selection.clone(), Some(own));
            }
            let corrected = by_share.filter(|_| found.verdict != Verdict::Effect).map(|own| own.corrected);
            (selection, found, law, corrected)
        }
    };
    let (selection, with_law) = match with_law {
        Some(law) => {
            listed_instead(&mut study, &scale, &judge, (selection, law), &mut found, (settings, say))
        }
        None => (selection, None),
    };
    if let Some((model, law)) = with_law.as_ref().zip(found.law.as_ref()) {
        let fits = Fits::new(&study, scale.clone());
        let printed = [&found.parameters[0][..], &found.parameters[1]];
        let mut told = notes(&fits, &selection, (model, printed), (&found.after[1], &found.floor[1]));
        told.extend(remarks::noise(&judge, model));
        told.extend(sentences(law));
        found.notes = told;
    }
    let refitted = if with_law.is_none() {
        finely(&mut study, &scale, (&judge, &selection), &found, settings)
    } else {
        None
    };
    let (selection, mut found) = refitted.unwrap_or((selection, found));
    {
        let own = shown(&found, &selection, corrected.as_ref(), with_law.as_ref()).clone();
        settle(&Fits::new(&study, scale.clone()), &judge, (&own, corrected.as_ref()), &mut found);
    }
    explained::refuse_where_nothing_is(&mut found, &first_place(&study));
    explained::refuse_where_validation_shows_more(&mut found, &first_place(&study));
    let refused = explained::refuse_what_explains_too_little(&mut found, &first_place(&study))
        || explained::refuse_other_values_of_estimation(&mut found, &first_place(&study));
    if refused {
        found.fitted = fitted(&study, &found.parameters[0]);
    }
    if let Some(suspicion) = suspicion {
        suspicion.settle(&found)?;
    }
    let fits = Fits::new(&study, scale);
    say("figures");
    let with_law = with_law.filter(|_| !refused);
    let shown = law::extended(shown(&found, &selection, corrected.as_ref(), with_law.as_ref()), fits.study);
    let declared = law::extended(&selection.declared, fits.study);
    resolution::add(&fits, &selection, &shown, &mut found);
    let finer = if found.complete { None } else { integration::finer(&fits, &shown) };
    let evidence = evidence::gather(&fits, [&declared, &shown], &found);
    Ok(Attempt { found: (found, evidence), finer })
}

/// Corrects an answer whose model, or the one with corrections in its place, leaves noise that is not white.
fn settle(fits: &Fits, judge: &Judge, (shown, corrected): (&Model, Option<&Model>), found: &mut Answer) {
    // The search for a law may have made the study longer since.
    let own = law::extended(shown, fits.study);
    // What corrections within their tolerances take away is not missing either.
    let corrected = corrected.filter(|_| found.verdict == Verdict::Unexplained);
    let _ = colored::settle(fits, judge, &own, found)
        || corrected.is_some_and(|own| colored::settle(fits, judge, &law::extended(own, fits.study), found));
}

/// The model of an answer.
fn shown<'a>(
    found: &Answer,
    selection: &'a Selection,
    corrected: Option<&'a Model>,
    with_law: Option<&'a Model>,
) -> &'a Model {
    match (with_law, corrected) {
        (Some(law), _) => law,
        _ if found.verdict == Verdict::Effect => &selection.best,
        (_, Some(corrected)) if !found.corrections.is_empty() => corrected,
        _ => &selection.declared,
    }
}

/// The same effects fitted with as many steps of integration as they need, if what they leave is its error and they
/// leave noise then. Otherwise the study stays as it is.
fn finely(
    study: &mut Study,
    scale: &[f64],
    (judge, selection): (&Judge, &Selection),
    found: &Answer,
    settings: &Settings,
) -> Option<(Selection, Answer)> {
    if found.verdict != Verdict::Effect || found.complete || stop::asked() {
        return None;
    }
    let coarse = study.substeps;
    study.substeps = integration::finer(&Fits::new(study, scale.to_vec()), &selection.best)?;
    let fits = Fits::new(study, scale.to_vec());
    let best = exact::refitted(&fits, &selection.best);
    if !judge.explained(&fits, &best) {
        study.substeps = coarse;
        return None;
    }
    let selection = Selection { best, exact: true, ..selection.clone() };
    let found = assemble(&fits, judge, &selection, None, settings);
    Some((selection, found))
}

/// The same effects beside corrections, fitted with as many steps of integration as they need, if they leave about as
/// much then: the search would find nothing else. Otherwise the study stays as it is.
fn finely_beside(
    study: &mut Study,
    scale: &[f64],
    (judge, coarse): (&Judge, &ByShare),
    found: &Answer,
    (settings, say): (&Settings, Say),
) -> Option<(ByShare, Answer)> {
    if found.verdict != Verdict::Effect || found.complete || stop::asked() {
        return None;
    }
    let (before, best) = (study.substeps, &coarse.selection.best);
    study.substeps = integration::finer(&Fits::new(study, scale.to_vec()), best)?;
    say("the effects with finer steps of integration");
    let fits = Fits::new(study, scale.to_vec());
    let search = by_share::Search { fits: &fits, judge, units: scale, settings, say };
    let fine = search.fitted(coarse, &coarse.added, &best.fit.parameters);
    let change = (fine.selection.best.error / best.error - 1.0).abs();
    let answer = (change < MAX_CHANGE_BY_FINER_STEPS && !stop::asked())
        .then(|| assemble(&fits, judge, &fine.selection, Some(&fine), settings))
        .filter(|answer| answer.verdict == Verdict::Effect);
    if answer.is_none() {
        study.substeps = before;
    }
    answer.map(|answer| (fine, answer))
}

/// Effects of the list in place of the law of an answer, where some do as well; else both as they are.
fn listed_instead(
    study: &mut Study,
    scale: &[f64],
    judge: &Judge,
    (selection, law): (Selection, Model),
    found: &mut Answer,
    (settings, say): (&Settings, Say),
) -> (Selection, Option<Model>) {
    // Friction of the list changes its sign where that of the law does.
    let sign_change = listed::sign_change(study, &law);
    let usual = sign_change.map(|(tap, vt)| (tap, std::mem::replace(&mut study.taps[tap].vt, vt)));
    let listed = listed::in_place_of(study, scale, judge, (&selection.declared, &law), found, say);
    let better = listed.and_then(|listed| {
        let listed = Selection { singles: selection.singles.clone(), ..listed };
        say("errors on all records");
        let answer = assemble(&Fits::new(study, scale.to_vec()), judge, &listed, None, settings);
        let stands = answer.verdict == Verdict::Effect && answer.complete >= found.complete;
        stands.then_some((listed, answer))
    });
    let Some((listed, mut answer)) = better else {
        if let Some((tap, vt)) = usual {
            study.taps[tap].vt = vt;
        }
        return (selection, Some(law));
    };
    answer.notes.extend(sign_change.map(|(tap, vt)| {
        let own = &study.taps[tap];
        format!("Friction at {} changes its sign over {vt:.4} {}, as in the law.", own.name, own.units[1])
    }));
    answer.notes.extend(found.law.as_ref().map(|law| {
        format!(
            "A law at {} gives the same and is no better: {}.",
            law.port,
            law.effect.own.as_ref().map_or("", |own| &own.formula)
        )
    }));
    *found = answer;
    (listed, None)
}

/// Effects that were fitted in place of others.
enum Refitted {
    BesideCorrections(Box<ByShare>),
    Alone(Box<Selection>),
}

/// Effects that estimation records cannot tell from those of a selection, where validation records refuse these and
/// bear out the others, with their answer.
fn other_of_equals(
    search: &by_share::Search,
    (selection, by_share): (&Selection, Option<&ByShare>),
    found: &Answer,
) -> Option<(Refitted, Answer)> {
    if found.verdict != Verdict::Unexplained || selection.effects() == 0 || stop::asked() {
        return None;
    }
    let by_share::Search { fits, judge, settings, .. } = *search;
    selection.equals.iter().find_map(|(lacking, model)| {
        let (other, mut answer) = match by_share {
            Some(own) => {
                let other = search.fitted(own, &model.added, &model.fit.parameters);
                let answer = assemble(fits, judge, &other.selection, Some(&other), settings);
                (Refitted::BesideCorrections(Box::new(other)), answer)
            }
            None => {
                let rest = Selection { best: model.clone(), equals: Vec::new(), ..selection.clone() };
                let other = Selection { stability: Vec::new(), ..rest };
                let answer = assemble(fits, judge, &other, None, settings);
                (Refitted::Alone(Box::new(other)), answer)
            }
        };
        let stands = answer.verdict == Verdict::Effect
            && answer.share.is_some_and(|share| share >= MIN_SHARE_OF_OTHER_OF_EQUALS);
        let new = model.added.iter().find(|c| !selection.best.added.contains(c));
        answer.notes.extend(new.and_then(|&new| chosen_by_validation(fits.study, new, *lacking)));
        stands.then_some((other, answer))
    })
}

/// The weakest effect that explains little without the other effects, or that may be zero by the interval of its first
/// parameter, and the share of the error on validation records that it takes away alone. Where all is explained, each
/// is needed. Coulomb friction needed by nothing but the search for another friction comes last; that on which
/// presliding acts stays.
fn weakest_dependent(
    search: &by_share::Search,
    selection: &Selection,
    found: &Answer,
) -> Option<(usize, f64)> {
    let (study, added) = (search.fits.study, &selection.best.added);
    if found.verdict != Verdict::Effect || found.complete || selection.effects() < 2 || stop::asked() {
        return None;
    }
    let needing = |c: usize| added.iter().map(|&o| &study.candidates[o]).filter(move |o| o.needs == Some(c));
    let softened = |c: usize| added.iter().any(|&other| study.candidates[other].acts_only_on(c));
    let least = search.settings.forward_selection.min_validated_share;
    let is_weak = |effect: &Effect, share: f64| {
        let interval = effect.parameters.first().map(|own| own.interval);
        share < least || interval.is_some_and(|(low, high)| low < 0.0 && 0.0 < high)
    };
    order(search.fits, selection)
        .into_iter()
        .zip(found.effects.iter().filter(|effect| effect.selected))
        .filter_map(|(c, effect)| {
            effect.share.filter(|share| is_weak(effect, *share)).map(|share| (c, share))
        })
        .filter(|&(c, _)| !softened(c))
        .min_by(|a, b| (needing(a.0).count().cmp(&needing(b.0).count())).then(a.1.total_cmp(&b.1)))
}

/// Whether the answer `rest` with one effect less takes nearly as much of the error on validation records away, and the
/// effect takes no large part of what it leaves.
fn stands_without(found: &Answer, rest: &Answer, settings: &Settings) -> bool {
    let rules = &settings.forward_selection;
    let [whole, part] = [found, rest].map(|answer| answer.share.unwrap_or(0.0));
    rest.verdict == Verdict::Effect
        && whole - part < rules.min_validated_share
        && whole - part < rules.min_share_of_rest * (1.0 - part)
}

/// Takes what smoothing adds to measured states from the model with the candidates `added`.
fn correct(study: &mut Study, scale: &[f64], added: &[usize], p: &[f64]) {
    let found = smoothed::errors(&Fits::new(study, scale.to_vec()).view(added, &[]), p);
    study.records.iter_mut().zip(found).for_each(|(record, own)| record.smoothed = own);
}

/// Lets viscous friction take back what the declared model has of it.
fn allow_less(study: &mut Study, viscous: &[(usize, f64)]) {
    for &(c, coefficient) in viscous {
        let bounds = &mut study.entries[study.candidates[c].entries.start].free.bounds;
        bounds.0 = bounds.0.min(-coefficient);
    }
}

/// Finer steps of integration where those of the declared model are at the edge of their stability; a note where the
/// finest are.
fn make_stable(study: &mut Study, scale: &[f64], model: &mut Model) {
    while !integration::is_stable(&Fits::new(study, scale.to_vec()), model) {
        if study.substeps >= integration::MAX_STABLE_SUBSTEPS {
            study.notes.push(format!(
                "The declared model is too stiff for {} steps of integration per sample: the least change throws it off its way, and what is said here rests on nothing. Give its fastest part more room (friction that changes its sign over a wider velocity), or the records shorter steps with `airloop resample`.",
                study.substeps
            ));
            return;
        }
        study.substeps *= 2;
        *model = afresh(&Fits::new(study, scale.to_vec()), model.clone());
    }
}

/// The declared model fitted with other steps of integration.
fn afresh(fits: &Fits, model: Model) -> Model {
    fits.fit_from(Vec::new(), &model.fit.parameters, &model.fit.locals).unwrap_or(model)
}

/// Error of the declared model by output on the estimation records, not less than the noise.
fn scales(study: &Study, declared: &Fit) -> Vec<f64> {
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let errors = errors(&fits, &[], &fits.pieces, &declared.parameters, Some(&declared.locals));
    study.outputs.iter().map(|o| errors.counted(&o.name, o.noise).max(o.noise)).collect()
}

/// Difference steps of the candidates; those that change nothing are taken out. The declared model in the new scale.
fn steps(study: &mut Study, scale: &[f64], declared: &Fit) -> Model {
    let mut p = study.start();
    p[..study.declared].copy_from_slice(&declared.parameters[..study.declared]);
    let found: Vec<Vec<Option<f64>>> = {
        let fits = Fits::new(study, scale.to_vec());
        let base = model(&fits, &p, &declared.locals);
        (0..study.candidates.len())
            .map(|c| {
                let own = &study.candidates[c];
                if own.probe {
                    return vec![fits.probe_step(&base, c); own.entries.len()];
                }
                fits.steps(&base, c)
            })
            .collect()
    };
    let mut kept = Vec::new();
    for (c, steps) in found.into_iter().enumerate() {
        let candidate = study.candidates[c].clone();
        // A parameter without influence stays as it is; a candidate of such parameters only is none.
        if steps.iter().all(Option::is_none) || candidate.probe && steps.iter().any(Option::is_none) {
            let why = "it changes nothing in the estimation records";
            if !candidate.probe {
                study.not_testable.push((candidate.name(), why.into()));
            }
            continue;
        }
        for (k, (index, step)) in candidate.entries.clone().zip(steps).enumerate() {
            let own = &mut study.entries[index].free;
            match step {
                Some(step) => own.step = step,
                None => {
                    let start = candidate.starts[candidate.starts.len() / 2][k];
                    own.bounds = (start, start);
                }
            }
        }
        kept.push((c, candidate));
    }
    let new: Vec<usize> = kept.iter().map(|(old, _)| *old).collect();
    for (_, candidate) in &mut kept {
        candidate.needs = candidate.needs.and_then(|needs| new.iter().position(|&old| old == needs));
    }
    study.candidates = kept.into_iter().map(|(_, candidate)| candidate).collect();
    let fits = Fits::new(study, scale.to_vec());
    model(&fits, &p, &declared.locals)
}

fn model(fits: &Fits, p: &[f64], locals: &[Vec<f64>]) -> Model {
    let records: Vec<usize> = (0..fits.pieces.len()).collect();
    let found = fit(&fits.view(&[], &fits.pieces), &records, p, &fits.free(&[]), locals, 10);
    let count: usize = fits.pieces.iter().map(|piece| piece.range.len()).sum();
    let error = (found.chi2 / (count * fits.study.outputs.len()).max(1) as f64).sqrt();
    Model::new(Vec::new(), found, error)
}
