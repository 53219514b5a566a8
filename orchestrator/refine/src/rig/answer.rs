//! The answer for the rig of the vocabulary: an explanation to the noise, the effects that matter, or a law.

use super::corrections;
use super::localize::{localize, pair_behind};
use super::open::Rig;
use super::replay::{MAX_FALL_AT_REVERSALS, left, proposals};
use super::sense::objection;
use crate::answer::{Answer, Correction, Effect, Errors, Settings, Verdict, errors, fit_locals};
use crate::engine::candidate::Candidate;
use crate::engine::fit::{Fit, Free};
use crate::engine::goodness::Null;
use crate::engine::search::{Model, Promise, Rules, Search};
use crate::engine::select::{
    Effort, MARGIN, MIN_EXCESS_OF_NULL, MIN_FALL_OF_SQUARES, Proposal, Selection, Stage, select,
};
use crate::engine::{System, stop};
use crate::explained;
use crate::interval;
use crate::moving::{self, Replacement, with_cylinder};
use crate::order::descending;
use crate::selection_answer;
use crate::watch::{Listener, Watched};

/// Share of a limited time that the search for an explanation to the noise may use.
const EXACT_SHARE_OF_TIME: f64 = 0.5;

/// Share of the error by which effects of the list may take away less than a law and stand in its place.
const MAX_SHARE_BELOW_LAW: f64 = 0.02;

/// Finds what a rig's declared model lacks; `listener` hears how far it is.
pub fn answer(rig: &Rig, groups: &[String], settings: &Settings, listener: Listener) -> Answer {
    let watched = Watched::new(rig.system.as_ref(), listener);
    let system: &dyn System = &watched;
    system.stage("declared model");
    let records: Vec<usize> = (0..system.records()).filter(|&record| system.estimation(record)).collect();
    let screened = (0..records.len())
        .filter(|&i| i == 0 || groups[records[i]].is_empty() || groups[records[i]] != groups[records[i - 1]]);
    let screened: Vec<usize> = screened.collect();
    let fit = fit_locals(system, &records, &super::parameters::neutral());
    system.stage("noise floor");
    let null = Null::simulate(system, &records, &fit.parameters, &fit.locals, settings.draws, settings.seed);
    let search =
        Search { system, candidates: &rig.candidates, records, screened, null, rules: Rules::default() };
    let declared = search.fit(&[], &[], &fit.parameters, &fit.locals, 5);
    let dimensions: Vec<Free> =
        rig.corrections.iter().filter(|own| own.of_cylinder()).map(corrections::Correction::exact).collect();
    let cylinder = rig.coupled.as_ref().and_then(|rig| with_cylinder(rig, &search, &declared, &dimensions));
    let proposed = || {
        let Some(coupled) = &rig.coupled else { return Vec::new() };
        let (groups, neutral) = (numbered(groups), super::parameters::neutral());
        let places: Vec<usize> = (0..rig.candidates.len()).filter(|&c| behind(&rig.candidates[c])).collect();
        let own: Vec<Candidate> = places.iter().map(|&c| rig.candidates[c].clone()).collect();
        let mut found = match cylinder {
            Some(_) => Vec::new(),
            None => proposals(coupled, &rig.candidates, &groups, search.null.quantile + MARGIN),
        };
        found.extend(
            pair_behind(coupled, &own, &groups, &neutral)
                .map(|pair| Proposal { added: pair.added.iter().map(|&c| places[c]).collect(), ..pair }),
        );
        found
    };
    let base = cylinder.as_ref().map_or(&declared, |cylinder| &cylinder.model);
    let corrections = |dimensions: bool| -> Vec<Free> {
        let known = rig.known(&base.fit.parameters).filter(|own| dimensions || !own.of_cylinder());
        known.map(corrections::Correction::exact).collect()
    };
    // What is left of a limited time is for effects that leave more than noise.
    stop::stage(EXACT_SHARE_OF_TIME);
    let usual = Effort { max_effects: settings.max_effects, ..Effort::default() };
    let as_declared = cylinder.as_ref().is_none_or(|cylinder| cylinder.dimensions.is_none());
    let selection = as_declared.then(|| select(&search, base.clone(), &corrections(false), usual, &proposed));
    let selection = match selection.filter(|own| own.explained || cylinder.is_none() || stop::asked()) {
        Some(own) => own,
        None => {
            // Beside a cylinder whose dimensions are off, effects show beside corrections of them alone.
            let effort = Effort { singles: 0, climbed: 0, pairs: (0, 0), ..usual };
            let sense = |added: &[usize], fit: &Fit| {
                let objection = |&c: &usize| objection(&rig.candidates[c], fit, &rig.reach);
                added.iter().all(|c| objection(c).is_none())
            };
            let (records, screened, null) =
                (search.records.clone(), search.screened.clone(), search.null.clone());
            let rules = Rules { sense: Some(&sense), ..Rules::default() };
            let search = Search { system, candidates: &rig.candidates, records, screened, null, rules };
            select(&search, base.clone(), &corrections(true), effort, &Vec::new)
        }
    };
    let mut found = assemble(rig, &search, (&declared, cylinder.as_ref()), &selection);
    if cylinder.is_some() && selection.explained {
        moving::tell(&mut found);
    }
    let exact_part = !selection.explained && trace(rig, &search, &selection, groups, &mut found);
    withdraw_what_does_not_validate(&mut found);
    stop::stage(1.0);
    let withdrawn = selection.explained && selection_answer::withdraw_small_shares(rig, settings, &mut found);
    let open = withdrawn || !selection.explained && !exact_part && cylinder.is_none();
    let improved =
        open && selection_answer::select_by_share(rig, &search, &declared, groups, settings, &mut found);
    if !improved && found.verdict == Verdict::Effect {
        selection_answer::shares(rig, &mut found);
    }
    let without_law = found.clone();
    selection_answer::explain_by_law(rig, settings, &mut found);
    // A law that leaves more than noise says that more than one thing is missing, as on a rig that is off everywhere.
    if exact_part && cylinder.is_none() && found.verdict == Verdict::Law && !found.complete {
        let mut by_share = without_law;
        let improved =
            selection_answer::select_by_share(rig, &search, &declared, groups, settings, &mut by_share);
        if improved && does_as_well_as_law(&by_share, &found) {
            found = by_share;
        }
    }
    explained::refuse_where_nothing_is(&mut found, "actuator");
    explained::refuse_where_validation_shows_more(&mut found, "actuator");
    explained::refuse_what_explains_too_little(&mut found, "actuator");
    found.partial = stop::ended();
    found
}

/// Whether effects take away about the share of a law: they say more than a formula.
fn does_as_well_as_law(effects: &Answer, law: &Answer) -> bool {
    let share = |answer: &Answer| answer.share.unwrap_or(0.0);
    effects.verdict == Verdict::Effect && share(effects) >= share(law) - MAX_SHARE_BELOW_LAW
}

/// Whether a candidate acts behind the load cell.
fn behind(c: &Candidate) -> bool {
    ["cart", "cart_friction", "pole"].contains(&c.channel)
        || c.id != "sensor.delay" && matches!(c.signal, Some("x" | "theta"))
}

/// A number for every name: that of its first place.
fn numbered(names: &[String]) -> Vec<usize> {
    names.iter().map(|name| names.iter().position(|other| other == name).unwrap_or(0)).collect()
}

/// Takes an effect back that makes the validation records worse: it was fitted to something else.
fn withdraw_what_does_not_validate(found: &mut Answer) {
    let total = |errors: &Errors| -> f64 {
        let share = |(signal, rms): (&String, &f64)| {
            found.noise.get(signal).map_or(0.0, |noise| (rms / noise).powi(2))
        };
        errors.rms.iter().map(share).sum()
    };
    // Behind a wrong actuator the simulation from the command says nothing; there the innovations have decided.
    if found.verdict != Verdict::Effect
        || found.unexplained.is_some()
        || total(&found.after[1]) < total(&found.before[1])
    {
        return;
    }
    found.verdict = Verdict::Unexplained;
    let channel = found.effects.iter().find(|e| e.selected).map_or("cart", |e| &e.channel).to_owned();
    found.unexplained = Some((channel, Vec::new()));
    for effect in &mut found.effects {
        (effect.selected, effect.group) = (false, None);
        "it lowers the error on estimation records but not on validation records"
            .clone_into(&mut effect.reason);
    }
    found.after = found.before.clone();
    found.parameters[1] = found.parameters[0].clone();
}

/// Names the channel of what no candidate explains; behind a wrong actuator, effects of the mechanics are still found.
///
/// Whether a part of the rig follows its declared model to the noise: then the rest must do so as well, and an effect
/// that leaves more is none.
fn trace(
    rig: &Rig,
    search: &Search<dyn System + '_>,
    selection: &Selection,
    groups: &[String],
    found: &mut Answer,
) -> bool {
    search.system.stage("place of what is left");
    let Some(coupled) = &rig.coupled else {
        let worst = selection.best.left.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let channel =
            if worst.is_some_and(|(signal, _)| signal == "F_hat") { "actuator" } else { "piston_friction" };
        let channel =
            if rig.candidates.iter().any(|c| c.channel == "piston_friction") { channel } else { "actuator" };
        found.unexplained = Some((channel.into(), Vec::new()));
        return false;
    };
    let left = left(coupled, &super::parameters::neutral());
    let beyond = |signal: &str, limit: f64| left.iter().any(|(name, z)| name == signal && *z > limit);
    let front = if beyond("F_hat", search.null.quantile + MARGIN) {
        Some("actuator")
    } else if left.iter().any(|(name, _)| name == "F_hat") && beyond("F_p", MAX_FALL_AT_REVERSALS) {
        Some("piston_friction")
    } else {
        None
    };
    let groups = numbered(groups);
    let candidates: Vec<_> = rig.candidates.iter().filter(|c| behind(c)).cloned().collect();
    let findings = localize(coupled, &candidates, front, &groups, &super::parameters::neutral());
    found.share_of_free_form = Some(findings.share_of_free_form);
    found.unexplained = findings.channel.map(|channel| (channel, findings.variables));
    // On a rig that is off everywhere by little the pressure force may come near the limit, but not down to the noise.
    let noise = search.null.quantile + MIN_EXCESS_OF_NULL;
    let actuator = left.iter().any(|(name, z)| name == "F_hat" && *z < noise);
    let exact = actuator || findings.explained;
    let Some(model) = findings.effects else { return exact };
    found.verdict = Verdict::Effect;
    found.notes.push("The actuator does not follow its declared model, so the mechanics were searched with the measured force of the load cell.".into());
    let gain = findings.declared.fit.chi2 - model.fit.chi2;
    let mut chosen = Vec::new();
    for &c in &model.added {
        let own = &candidates[c];
        chosen.push(Effect {
            id: own.id.into(),
            channel: own.channel.into(),
            signal: own.signal.map(str::to_owned),
            selected: true,
            group: None,
            score: gain,
            parameters: interval::parameters(own, &model.fit, 1.0),
            reason: "with it, position and angle follow the measured force".into(),
            ..Effect::default()
        });
    }
    found.effects.retain(|e| !chosen.iter().any(|c| c.id == e.id && c.signal == e.signal));
    chosen.append(&mut found.effects);
    found.effects = chosen;
    let system = rig.system.as_ref();
    let sets = [true, false].map(|estimation| {
        (0..system.records()).filter(|&r| system.estimation(r) == estimation).collect::<Vec<_>>()
    });
    found.after = [0, 1].map(|i| errors(system, &sets[i], &model.fit.parameters));
    found.parameters[1] = model.fit.parameters.clone();
    exact
}

/// Candidates shown that were screened only.
const SCREENED: usize = 8;

/// A candidate that was not fitted: what its linear step promised.
fn screened(own: &Candidate, promise: &Promise, (declared, best): (&Model, &Model), penalty: f64) -> Effect {
    // A linear step may promise more than any model can hold.
    let gain = declared.fit.chi2 - promise.chi2.max(best.fit.chi2);
    let share = 100.0 * gain / declared.fit.chi2;
    Effect {
        id: own.id.into(),
        channel: own.channel.into(),
        port: None,
        wiring: None,
        signal: own.signal.map(str::to_owned),
        selected: false,
        group: None,
        score: gain - penalty * own.free.len() as f64,
        parameters: Vec::new(),
        stability: None,
        own: None,
        share: None,
        reason: if gain < MIN_FALL_OF_SQUARES {
            "it promises no more than fitting noise gives".into()
        } else {
            format!("it promises to take {share:.0} % of the misfit away, less than others that were fitted")
        },
    }
}

/// `stated`: the declared model with the declared actuator, which errors are compared with; `cylinder`: what takes its
/// place.
fn assemble(
    rig: &Rig,
    search: &Search<dyn System + '_>,
    (stated, cylinder): (&Model, Option<&Replacement>),
    selection: &Selection,
) -> Answer {
    let system = rig.system.as_ref();
    let penalty = search.penalty();
    let criterion = |model: &Model| model.fit.chi2 + penalty * model.size(search.candidates) as f64;
    let score = |model: &Model| selection.declared.fit.chi2 - criterion(model);
    let (best, declared) = (&selection.best, &selection.declared);
    let mut effects: Vec<Effect> = Vec::new();
    let mut effect = |model: &Model, c: usize, selected: bool, group: Option<usize>, reason: String| {
        let own = &rig.candidates[c];
        let same = |e: &Effect| e.id == own.id && e.signal.as_deref() == own.signal;
        if effects.iter().any(same) {
            return;
        }
        effects.push(Effect {
            id: own.id.into(),
            channel: own.channel.into(),
            signal: own.signal.map(str::to_owned),
            selected,
            group,
            score: score(model),
            parameters: interval::parameters(own, &model.fit, penalty.exp()),
            reason,
            ..Effect::default()
        });
    };
    let verdict = match (selection.explained, best.added.is_empty()) {
        (true, true) => Verdict::Nothing,
        (true, false) => Verdict::Effect,
        (false, _) => Verdict::Unexplained,
    };
    if verdict == Verdict::Effect {
        for &c in &best.added {
            let others = selection.equals.iter().filter(|m| !m.added.contains(&c));
            let rivals: Vec<usize> =
                others.flat_map(|m| m.added.iter().copied().filter(|o| !best.added.contains(o))).collect();
            let group = (!rivals.is_empty()).then_some(c);
            effect(best, c, true, group, "with it, what is left is noise".into());
        }
        for model in &selection.equals {
            let replaced = best.added.iter().find(|c| !model.added.contains(c)).copied();
            for &c in model.added.iter().filter(|c| !best.added.contains(c)) {
                let reason = "these records cannot tell it from the selected effect".to_owned();
                effect(model, c, false, replaced, reason);
            }
        }
    }
    let mut singles: Vec<&Model> = selection.tried.iter().filter(|m| m.added.len() == 1).collect();
    descending(&mut singles, |own| score(own));
    for model in singles.into_iter().take(12) {
        let (signal, z) = model.left.iter().max_by(|a, b| a.1.total_cmp(&b.1)).cloned().unwrap_or_default();
        effect(
            model,
            model.added[0],
            false,
            None,
            format!("alone it leaves {signal} {z:.0} standard deviations above noise"),
        );
    }
    let mut seen = Vec::new();
    for promise in &selection.screened {
        let own = &rig.candidates[promise.candidate];
        let there = effects.iter().any(|e| e.id == own.id && e.signal.as_deref() == own.signal);
        if there || seen.contains(&promise.candidate) || seen.len() >= SCREENED {
            continue;
        }
        seen.push(promise.candidate);
        effects.push(screened(own, promise, (declared, best), penalty));
    }
    let fitted = match (selection.stage, cylinder) {
        (Stage::Corrected, _) => Some(&best.fit),
        (_, Some(cylinder)) if verdict != Verdict::Unexplained => cylinder.dimensions.as_ref(),
        _ => None,
    };
    let deviation = |fit: &Fit, index: usize| {
        let a = fit.free.iter().position(|f| f.index == index)?;
        Some(fit.covariance[(a, a)].max(0.0).sqrt())
    };
    let one = |own: &corrections::Correction| {
        let index = own.entry.index;
        Some(Correction::new(own, best.fit.parameters[index], deviation(fitted?, index)?))
    };
    let corrections: Vec<Correction> = rig.corrections.iter().filter_map(one).collect();
    let after_parameters =
        if verdict == Verdict::Unexplained { &stated.fit.parameters } else { &best.fit.parameters };
    let validation: Vec<usize> = (0..system.records()).filter(|&r| !system.estimation(r)).collect();
    let sets = [search.records.clone(), validation];
    let before = [0, 1].map(|i| errors(system, &sets[i], &stated.fit.parameters));
    let after = [0, 1].map(|i| errors(system, &sets[i], after_parameters));
    let noise = system
        .signals(search.records[0])
        .into_iter()
        .map(|span| {
            let declared = span.noise;
            let estimate = if selection.explained {
                after[0].rms.get(&span.signal).copied().unwrap_or(declared)
            } else {
                declared
            };
            (span.signal, estimate)
        })
        .collect();
    let mut notes = Vec::new();
    if selection.stage == Stage::Corrected && cylinder.is_none() {
        notes.push("The declared parameters are off by about a percent; they were corrected within that, which is no missing effect.".into());
    }
    Answer {
        verdict,
        effects,
        unexplained: (verdict == Verdict::Unexplained).then(|| ("actuator".to_owned(), Vec::new())),
        corrections,
        complete: selection.explained,
        before,
        after,
        noise,
        left: [stated.left.clone(), best.left.clone()],
        limit: search.null.quantile + MARGIN,
        parameters: [stated.fit.parameters.clone(), after_parameters.clone()],
        not_testable: rig.not_testable.clone(),
        notes,
        ..Answer::default()
    }
}
