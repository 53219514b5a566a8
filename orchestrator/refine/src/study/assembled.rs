//! The answer of a study from what its search selected: the verdict, the model that is shown, its errors and notes.

use std::collections::BTreeMap;

use super::by_share::{self, ByShare};
use super::colored::STILL_MISSING;
use super::declaration::Role;
use super::effects::{effects, physical};
use super::errors::{errors, floor, force, force_noise};
use super::explain::{Judge, Rest};
use super::fits::{Fits, Model, pieces};
use super::model::{Study, Target};
use super::remarks;
use super::ruling::{Ruling, alone, rule, rule_by_share, share};
use super::search::Selection;
use super::steps;
use crate::answer::{Answer, Correction, Effect, Errors, Settings, Verdict};
use crate::engine::stop;

/// Sentence on the errors of windows.
const FROM_MEASURED_STATES: &str = "Windows start from measured states, whose noise is part of the errors in units of the signals. The search, shares and multiples of the floor leave it out: they are of residuals that are white where nothing but noise is left.";

/// Share of the declared model's error that an effect has to take away for the residual to be where it acts.
const MIN_SHARE_OF_NEAREST: f64 = 0.05;

/// The model of an answer, with what is printed of it.
struct Shown<'a> {
    model: &'a Model,
    parameters: Vec<f64>,
    /// Errors on estimation and validation records.
    errors: [Errors; 2],
    /// Rms that noise gives on validation records, by output.
    floor: BTreeMap<String, f64>,
    /// Share of the error on validation records that it takes away.
    share: Option<f64>,
    corrections: Vec<Correction>,
}

/// The answer of a selection: verdict, errors with what noise gives, effects, corrections and notes.
pub(super) fn assemble(
    fits: &Fits,
    judge: &Judge,
    selection: &Selection,
    by_share: Option<&ByShare>,
    settings: &Settings,
) -> Answer {
    let (study, seed) = (fits.study, settings.seed);
    let roles = [Role::Estimation, Role::Validation];
    let all = |model: &Model| {
        let added = &model.added;
        // Parameters are fitted for each error: for that of the study, which starts from smoothed derivatives as they
        // are.
        let own = fits.as_declared(model);
        let p = &own.parameters;
        let mut found = [
            errors(fits, added, &pieces(study, Role::Estimation), p, Some(&own.locals)),
            errors(fits, added, &pieces(study, Role::Validation), p, None),
        ];
        for (errors, force) in found.iter_mut().zip(force(fits, added, p, roles)) {
            errors.rms.extend(force.rms);
            errors.nrmse.extend(force.nrmse);
        }
        (own.parameters, found)
    };
    let (declared, before) = stop::finish(|| all(&selection.declared));
    let (best, after) = stop::finish(|| all(&selection.best));
    let on_validation = |model: &Model| floor(fits, model, Role::Validation, seed);
    let (of_declared, of_best) = (on_validation(&selection.declared), on_validation(&selection.best));
    let taken = |after: &Errors, floor: &BTreeMap<String, f64>| {
        share(study, [&before[1], after], &[of_declared.clone(), floor.clone()])
    };
    let share = taken(&after[1], &of_best);
    let Ruling { verdict, rest, helps } = match by_share {
        Some(found) => rule_by_share(fits, judge, found, share, &settings.forward_selection),
        None => rule(fits, judge, selection, [&before[1], &after[1]], &of_declared, share),
    };
    let chosen = verdict == Verdict::Effect;
    // Where validation records bear out the effects and refuse others that do the same on estimation records, these are
    // no rivals.
    let is_refused = |model: &Model| {
        let validation = pieces(study, Role::Validation);
        let after = stop::finish(|| {
            errors(fits, &model.added, &validation, &fits.as_declared(model).parameters, None)
        });
        taken(&after, &on_validation(model)) < settings.forward_selection.min_validated_share
    };
    let (refused, equals): (Vec<_>, Vec<_>) =
        selection.equals.iter().cloned().partition(|(_, model)| chosen && is_refused(model));
    let selection = &Selection { equals, ..selection.clone() };
    let most = settings.forward_selection.max_tolerances;
    let mut effects = effects(fits, selection, chosen, by_share, most);
    if let Some(found) = by_share {
        explain_tried(found, &mut effects);
    }
    if chosen {
        as_printed(study, selection, &best, &mut effects);
        let shares = stop::finish(|| alone(fits, selection, [&declared, &best], (&before[1], &of_declared)));
        for (effect, share) in effects.iter_mut().filter(|effect| effect.selected).zip(shares) {
            effect.share = Some(share);
            effect.reason = if share > 0.0 {
                format!("alone it takes away {:.0} % of the error on validation records", 100.0 * share)
            } else {
                "only together with the other effects it lowers the error on validation records".into()
            };
        }
    }
    if !chosen {
        let why = if helps {
            "it takes away less than what is left depends on: something else is missing"
        } else {
            "it lowers the error on estimation records but not on validation records"
        };
        for effect in effects.iter_mut().take(selection.best.added.len()) {
            why.clone_into(&mut effect.reason);
        }
    }
    // Without effects: the declared model with its corrections, where validation records bear them out.
    let with_corrections = || {
        let found = by_share.filter(|found| !found.corrections.is_empty())?;
        let model = &found.corrected;
        let ((parameters, errors), floor) = (stop::finish(|| all(model)), on_validation(model));
        let share = taken(&errors[1], &floor);
        let corrections = by_share::corrections_beside(study, model, &found.corrections);
        let stands = verdict == Verdict::Nothing || share >= settings.forward_selection.min_validated_share;
        stands.then_some(Shown { model, parameters, errors, floor, share: Some(share), corrections })
    };
    let shown = if chosen {
        let model = &selection.best;
        let corrections =
            by_share.map_or_else(|| corrections(study, selection, model), |found| found.corrections.clone());
        Shown { model, parameters: best, errors: after, floor: of_best, share: Some(share), corrections }
    } else {
        with_corrections().unwrap_or_else(|| {
            let model = &selection.declared;
            let corrections = by_share.map_or_else(|| corrections(study, selection, model), |_| Vec::new());
            let (parameters, errors) = (declared.clone(), before.clone());
            Shown { model, parameters, errors, floor: of_declared.clone(), share: None, corrections }
        })
    };
    let outputs = || study.outputs.iter();
    let mut noise: BTreeMap<String, f64> = outputs().map(|o| (o.name.clone(), o.noise)).collect();
    if let Some((.., name)) = &study.force {
        noise.insert(name.clone(), force_noise(study));
    }
    let model = shown.model;
    let floor = [floor(fits, model, Role::Estimation, seed), shown.floor];
    let printed = [&declared[..], &shown.parameters];
    let mut notes = notes(fits, selection, (model, printed), (&shown.errors[1], &floor[1]));
    notes.extend(remarks::noise(judge, model));
    notes.extend(remarks::leftover(fits, judge, model, &rest));
    notes.extend(by_share.and_then(|found| found.told.clone()));
    notes.extend(refused.iter().filter_map(|(lacking, model)| {
        let other = model.added.iter().find(|c| !selection.best.added.contains(c));
        chosen_by_validation(study, *lacking, *other?)
    }));
    let unexplained = (verdict == Verdict::Unexplained)
        .then(|| rest.place.clone().unwrap_or_else(|| (nearest_place(study, by_share), Vec::new())));
    Answer {
        verdict,
        effects,
        unexplained,
        complete: judge.explained(fits, model),
        corrections: shown.corrections,
        steps: by_share.map_or_else(|| steps::held_out(study, selection), |found| found.steps.clone()),
        by_share: by_share.is_some(),
        sample_time: study.records.iter().map(|record| record.step).fold(f64::INFINITY, f64::min),
        left_at: left_at(judge, &rest),
        partial: stop::ended(),
        share: shown.share,
        share_of_free_form: by_share.and_then(|found| found.free_form.as_ref()).map(|form| form.2),
        fitted: fitted(study, &shown.parameters),
        limit: judge.limit(),
        parameters: [declared, shown.parameters],
        left: [judge.left(fits, &selection.declared), judge.left(fits, model)],
        before,
        after: shown.errors,
        noise,
        floor,
        not_testable: study.not_testable.clone(),
        notes,
        ..Answer::default()
    }
}

/// Sentence on two candidates that estimation records cannot tell apart and validation records can; none where
/// one of them is another value of a declared parameter.
pub(super) fn chosen_by_validation(study: &Study, chosen: usize, refused: usize) -> Option<String> {
    let name = |c: usize| study.candidates.get(c).map(|own| format!("`{}`", own.name()));
    let (chosen, refused) = (name(chosen)?, name(refused)?);
    Some(format!(
        "Estimation records cannot tell {chosen} from {refused}; validation records refuse {refused} and bear out {chosen}, so here they chose."
    ))
}

/// Sentences on the study and on what a model leaves; its `errors` on validation records and what noise gives there.
/// `printed`: parameter vectors without and with the answer.
pub(super) fn notes(
    fits: &Fits,
    selection: &Selection,
    (shown, printed): (&Model, [&[f64]; 2]),
    (errors, floor): (&Errors, &BTreeMap<String, f64>),
) -> Vec<String> {
    let study = fits.study;
    let mut notes = study.notes.clone();
    notes.extend(study.loss().map(|loss| {
        format!(
            "Simulations of the search that lost an FMU count as impossible. The first was lost so: {loss}."
        )
    }));
    notes.extend(remarks::remarks(fits, selection, shown, printed));
    if !errors.white.is_empty() {
        notes.push(FROM_MEASURED_STATES.into());
    }
    for output in &study.outputs {
        let floor = floor.get(&output.name).copied().unwrap_or(output.noise);
        let times = errors.times(&output.name, Some(floor)).unwrap_or(0.0);
        if times > 2.0 {
            notes.push(format!("What is left of {} on validation records is {times:.1} times what noise of the sensors gives a true model: {STILL_MISSING}.", output.name));
        }
    }
    notes
}

/// Corrections of a model beside the changes of declared parameters that are effects of their own.
fn corrections(study: &Study, selection: &Selection, model: &Model) -> Vec<Correction> {
    let changed = |own: &Correction| {
        let name = own.path();
        selection.changed.iter().any(|free| study.entries[free.index].name == name)
    };
    let mut found = by_share::corrections(study, model, &[]);
    found.retain(|own| !changed(own));
    found
}

/// Errors that free forms at the ports would take away, in multiples of the noise.
fn left_at(judge: &Judge, rest: &Rest) -> Vec<(String, f64)> {
    rest.ports.iter().map(|(port, gain)| (port.clone(), judge.floors(*gain))).collect()
}

/// Place of the residual where no free form shows one: that of the effect which takes most of it away.
fn nearest_place(study: &Study, by_share: Option<&ByShare>) -> String {
    let tried = by_share.and_then(|found| found.steps.first()).into_iter().flat_map(|step| &step.candidates);
    let most = tried.max_by(|a, b| a.held_out_gain.total_cmp(&b.held_out_gain));
    let near = most.filter(|own| own.held_out_gain >= MIN_SHARE_OF_NEAREST);
    let own = near.and_then(|near| study.candidates.iter().find(|own| own.name() == near.id));
    own.map_or_else(|| first_place(study), |own| own.place())
}

/// Place of the residual where nothing shows a better one.
pub(super) fn first_place(study: &Study) -> String {
    study.candidates.first().map_or_else(|| "actuator".to_owned(), |c| c.place())
}

/// Says of every effect why the forward selection did not accept it.
fn explain_tried(found: &ByShare, effects: &mut [Effect]) {
    let tried: Vec<_> = found.steps.iter().flat_map(|step| &step.candidates).collect();
    for effect in effects.iter_mut().filter(|effect| !effect.selected) {
        let name =
            effect.signal.as_ref().map_or_else(|| effect.id.clone(), |s| format!("{}({s})", effect.id));
        if let Some(reason) = tried.iter().filter(|own| own.id == name).find_map(|own| own.rejected.clone()) {
            effect.reason = reason;
        }
    }
}

/// Gives the selected effects the parameters that the errors of the answer belong to.
fn as_printed(study: &Study, selection: &Selection, p: &[f64], effects: &mut [Effect]) {
    for effect in effects.iter_mut().filter(|effect| effect.selected) {
        let same = |&&c: &&usize| study.candidates[c].is(effect);
        let Some(&c) = selection.best.added.iter().find(same) else { continue };
        for (own, value) in effect.parameters.iter_mut().zip(physical(study, c, p)) {
            let half = 0.5 * (own.interval.1 - own.interval.0);
            (own.value, own.interval) = (value, (value - half, value + half));
        }
    }
}

/// Values of the free and of the corrected parameters of the declared system.
pub(crate) fn fitted(study: &Study, p: &[f64]) -> Vec<(String, f64)> {
    let own = study.entries.iter().zip(p);
    let value = |(entry, value): (&super::model::Entry, &f64)| match entry.target {
        Target::Declared(_) => Some((entry.name.clone(), *value)),
        Target::Correction { declared, .. } if *value != 0.0 => {
            Some((entry.name.clone(), declared * (1.0 + value)))
        }
        _ => None,
    };
    own.filter_map(value).collect()
}
