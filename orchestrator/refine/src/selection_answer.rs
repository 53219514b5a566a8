//! The answer on a rig that nothing fits to the noise: effects and corrections for their share of the error.

use std::collections::BTreeMap;

use super::answer::{Answer, Correction, Effect, Settings, Step, Tried, Verdict, errors};
use super::engine::System;
use super::engine::candidate::Candidate;
use super::engine::fit::Free;
use super::engine::forward_selection;
use super::engine::held_out::HeldOut;
use super::engine::question::{self, Question};
use super::engine::search::{Model, Search};
use super::interval;
use super::law::rig as law;
use super::rig::open::Rig;
use super::rig::parameters::D_ACT_GAIN;
use super::rig::{port, sense};

/// Units in which errors of signals are compared [SI].
const UNITS: [(&str, f64); 4] = [("F_hat", 0.3), ("F_p", 0.3), ("x", 2e-3), ("theta", 1e-2)];

/// Signals that are judged with their units; in a sweep the motion is given and only the force is predicted.
fn units(rig: &Rig) -> BTreeMap<String, f64> {
    let all = UNITS.iter().filter(|(name, _)| rig.series.is_some() || *name == "F_p");
    all.map(|&(name, unit)| (name.to_owned(), unit)).collect()
}

/// Puts effects and corrections that take away most of the error into an answer that does not reach the noise; whether
/// there is anything better than before.
pub fn select_by_share(
    rig: &Rig,
    exact: &Search<dyn System + '_>,
    declared: &Model,
    groups: &[String],
    settings: &Settings,
    found: &mut Answer,
) -> bool {
    let windowed = rig.series.as_ref().map(super::rig::coupled::Coupled::windowed);
    let system: &dyn System = match &windowed {
        Some(windowed) => windowed,
        None => rig.system.as_ref(),
    };
    let units = units(rig);
    let held_out = HeldOut::new(system, &units);
    let rules = settings.forward_selection;
    let place = |id: &str| rig.candidates.iter().position(|c| c.id == id);
    let corrections: Vec<question::Correction> = rig
        .known(&declared.fit.parameters)
        .filter_map(|own| {
            Some(question::Correction {
                free: own.bounded(rules.max_tolerances)?,
                effect: own.entry.effect.and_then(|(id, _)| place(id)),
                declared: own.declared,
            })
        })
        .collect();
    let question = Question {
        system,
        held_out: &held_out,
        candidates: &rig.candidates,
        corrections: &corrections,
        declared: &declared.fit.parameters,
        always: &[],
        locals: vec![Vec::new(); exact.records.len()],
        may_join: &|_, _| true,
        last: &[],
        proposals: &[],
        pairs: false,
        changes: 0..0,
        free_forms: &[],
        records: exact.records.clone(),
        screened: exact.screened.clone(),
        folds: folds(&exact.records, groups),
        sense: &|candidate, model| {
            within_actuator(rig, candidate, model)
                .or_else(|| sense::objection(candidate, &model.fit, &rig.reach))
        },
        settings: rules,
        most: settings.max_effects,
    };
    let result = forward_selection::search(&question);
    // Effects behind an actuator that does not follow its model stand where the whole rig shows none.
    if result.best.added.is_empty() && found.verdict == Verdict::Effect {
        return false;
    }
    write_answer(rig, exact, &result, &units, (windowed.as_ref(), rules.min_validated_share), found);
    true
}

/// Takes an answer back that explains a part of the rig to the noise with effects that take next to nothing of the
/// error away alone, or that are within the tolerances of the declared actuator; returns whether it did.
///
/// With the whole rig recorded several effects may need each other; the actuator alone and a sweep hold too little
/// against which imitations would fail.
pub fn withdraw_small_shares(rig: &Rig, settings: &Settings, found: &mut Answer) -> bool {
    if rig.coupled.is_some() || found.verdict != Verdict::Effect {
        return false;
    }
    shares(rig, found);
    let known =
        rig.corrections.iter().find(|own| own.entry.index == D_ACT_GAIN).and_then(|own| own.tolerance);
    let small = |effect: &Effect| {
        let force =
            effect.id == "sensor.gain" && effect.signal.as_deref().is_some_and(|s| s.starts_with('F'));
        let moved = effect.parameters.first().map_or(f64::INFINITY, |p| p.value.abs());
        effect.share.is_some_and(|share| share < settings.forward_selection.min_share_alone)
            || force && known.is_some_and(|known| moved < known)
    };
    let selected = || found.effects.iter().filter(|effect| effect.selected);
    if !selected().any(small) {
        return false;
    }
    let channel = selected().map(|effect| effect.channel.as_str()).find(|channel| *channel != "sensor");
    found.unexplained = Some((channel.unwrap_or("actuator").to_owned(), Vec::new()));
    found.verdict = Verdict::Unexplained;
    true
}

/// Puts the law of the residual into an answer that names nothing.
pub fn explain_by_law(rig: &Rig, settings: &Settings, found: &mut Answer) {
    let rules = settings.forward_selection;
    let known = rig.known(&found.parameters[0]);
    let corrected: Vec<Free> = known.filter_map(|own| own.bounded(rules.max_tolerances)).collect();
    law::explain(rig, &units(rig), &corrected, found);
}

/// Whether the gain of a force sensor is off by less than the declared actuator is known to: either may be the reason.
fn within_actuator(rig: &Rig, candidate: &Candidate, model: &Model) -> Option<String> {
    let force = candidate.id == "sensor.gain" && candidate.signal.is_some_and(|name| name.starts_with('F'));
    let known = rig.corrections.iter().find(|own| own.entry.index == D_ACT_GAIN)?.tolerance?;
    let moved = candidate.free.iter().map(|free| model.fit.parameters[free.index].abs());
    (force && moved.fold(0.0, f64::max) < known)
        .then(|| "it is within the tolerance of the gain of the declared actuator".to_owned())
}

/// Shares of the error on validation records that the selected effects of an answer take away, alone and together.
pub fn shares(rig: &Rig, found: &mut Answer) {
    let windowed = rig.series.as_ref().map(|own| own.windowed().with_sensors(&found.parameters[1]));
    let system: &dyn System = match &windowed {
        Some(windowed) => windowed,
        None => rig.system.as_ref(),
    };
    let units = units(rig);
    let held_out = HeldOut::new(system, &units);
    let validation: Vec<usize> = (0..system.records()).filter(|&r| !system.estimation(r)).collect();
    let [declared, answered] = &found.parameters;
    // What an answer leaves that explains the records to the noise is the noise of the states that windows begin with.
    let floor = if found.complete { held_out.error(answered, &validation) } else { 0.0 };
    let error = |p: &[f64]| (held_out.error(p, &validation).powi(2) - floor * floor).max(0.0).sqrt();
    let before = error(declared);
    let share = |p: &[f64]| 1.0 - error(p) / before.max(f64::MIN_POSITIVE);
    found.share = Some(share(answered));
    for effect in found.effects.iter_mut().filter(|effect| effect.selected) {
        let same = |c: &&Candidate| c.id == effect.id && c.signal == effect.signal.as_deref();
        let Some(own) = rig.candidates.iter().find(same) else { continue };
        let mut p = declared.clone();
        own.free.iter().for_each(|free| p[free.index] = answered[free.index]);
        effect.share = Some(share(&p));
    }
    // Selected effects come first, the one that takes away most before the others.
    found.effects.sort_by(|a, b| {
        let of =
            |effect: &Effect| if effect.selected { effect.share.unwrap_or(0.0) } else { f64::NEG_INFINITY };
        of(b).total_cmp(&of(a))
    });
}

/// Positions of the records in groups that repeat one command; halves where there is one group.
fn folds(records: &[usize], groups: &[String]) -> Vec<Vec<usize>> {
    let mut found: Vec<(String, Vec<usize>)> = Vec::new();
    for (i, &record) in records.iter().enumerate() {
        let name = groups.get(record).filter(|name| !name.is_empty());
        let name = name.cloned().unwrap_or_else(|| format!("record {record}"));
        match found.iter_mut().find(|(own, _)| *own == name) {
            Some((_, own)) => own.push(i),
            None => found.push((name, vec![i])),
        }
    }
    if found.len() > 1 || records.len() < 2 {
        return found.into_iter().map(|(_, own)| own).collect();
    }
    let half = records.len() / 2;
    vec![(0..half).collect(), (half..records.len()).collect()]
}

/// Writes what was found into the answer.
fn write_answer(
    rig: &Rig,
    exact: &Search<dyn System + '_>,
    result: &question::Found,
    units: &BTreeMap<String, f64>,
    (windowed, least): (Option<&super::rig::coupled::Coupled>, f64),
    found: &mut Answer,
) {
    let system = rig.system.as_ref();
    let best = &result.best;
    let validation: Vec<usize> = (0..system.records()).filter(|&r| !system.estimation(r)).collect();
    // Shares compare predictions from the same true motion: that of the answer.
    let from_answer = windowed.map(|windowed| windowed.with_sensors(&best.fit.parameters));
    let judged: &dyn System = match &from_answer {
        Some(own) => own,
        None => system,
    };
    let held_out = HeldOut::new(judged, units);
    let neutral = &found.parameters[0];
    let before = held_out.error(neutral, &validation);
    let share = |p: &[f64]| 1.0 - held_out.error(p, &validation) / before;
    let alone = |c: usize, p: &[f64]| {
        let mut own = neutral.clone();
        rig.candidates[c].free.iter().for_each(|free| own[free.index] = p[free.index]);
        share(&own)
    };
    let label = |c: usize| rig.candidates[c].name();
    found.steps = result
        .steps
        .iter()
        .map(|step| Step {
            model: step.added.iter().map(|&c| label(c)).collect(),
            candidates: step
                .tried
                .iter()
                .map(|own| Tried {
                    id: label(own.candidate),
                    port: port::of_channel(rig.candidates[own.candidate].channel).map(str::to_owned),
                    held_out_gain: own.held_out,
                    rejected: own.rejected.clone(),
                })
                .collect(),
        })
        .collect();
    found.by_share = true;
    let whole = share(&best.fit.parameters);
    let effect = |c: usize, model: &Model, gain: f64, selected: bool, reason: String| {
        let own = &rig.candidates[c];
        Effect {
            id: own.id.into(),
            channel: own.channel.into(),
            signal: own.signal.map(str::to_owned),
            selected,
            score: gain,
            parameters: interval::parameters(own, &model.fit, 0.0),
            reason,
            share: Some(alone(c, &model.fit.parameters)),
            ..Effect::default()
        }
    };
    let accepted = |c: usize| {
        result.steps.iter().flat_map(|s| &s.tried).find(|t| t.candidate == c && t.rejected.is_none())
    };
    let helps = whole >= least && best.added.iter().all(|&c| alone(c, &best.fit.parameters) >= least);
    let mut effects: Vec<Effect> = Vec::new();
    for &c in best.added.iter().filter(|_| helps) {
        let own = effect(c, best, accepted(c).map_or(0.0, |t| t.gain), true, String::new());
        let reason = format!(
            "alone it takes away {:.0} % of the error on validation records",
            100.0 * own.share.unwrap_or(0.0)
        );
        let rivals: Vec<&question::Tried> =
            result.equals.iter().filter(|(accepted, _)| *accepted == c).map(|(_, t)| t).collect();
        let group = (!rivals.is_empty()).then_some(c);
        effects.push(Effect { reason, group, ..own });
        for rival in rivals {
            let reason = "these records cannot tell it from the selected effect".to_owned();
            let own = effect(rival.candidate, &rival.model, rival.gain, false, reason);
            effects.push(Effect { group, ..own });
        }
    }
    if effects.is_empty() {
        found.verdict = Verdict::Unexplained;
    } else {
        found.verdict = Verdict::Effect;
        found.unexplained = None;
        found.notes.clear();
    }
    for tried in result.steps.iter().flat_map(|step| &step.tried) {
        let own = &rig.candidates[tried.candidate];
        if !effects.iter().any(|e| e.id == own.id && e.signal.as_deref() == own.signal) {
            let reason = tried.rejected.clone().unwrap_or_default();
            effects.push(effect(tried.candidate, &tried.model, tried.gain, false, reason));
        }
    }
    found.effects = effects;
    let shown = if found.verdict == Verdict::Effect { best } else { &result.base };
    found.corrections = rig
        .corrections
        .iter()
        .filter_map(|own| {
            let a = shown.fit.free.iter().position(|free| free.index == own.entry.index)?;
            let deviation = shown.fit.covariance[(a, a)].max(0.0).sqrt();
            let tolerance = own.tolerance?;
            let correction = Correction::new(own, shown.fit.parameters[own.entry.index], deviation);
            Some(Correction { tolerance, ..correction })
        })
        .collect();
    let p = &shown.fit.parameters;
    found.share = Some(share(p));
    found.after = [errors(system, &exact.records, p), errors(system, &validation, p)];
    found.parameters[1].clone_from(p);
    let locals: Vec<Vec<f64>> =
        exact.records.iter().map(|&r| system.locals(r).iter().map(|l| l.0).collect()).collect();
    found.left[1] = exact.fit(&[], &[], p, &locals, 5).left;
    found.complete = found.left[1].iter().all(|(_, z)| *z < found.limit);
    if found.complete && found.verdict == Verdict::Unexplained {
        (found.verdict, found.unexplained) = (Verdict::Nothing, None);
    }
}
