//! A study from the declaration to the answer in the terms of the vocabulary.

use std::collections::BTreeMap;

use super::catalogue;
use super::declaration::{File, Role};
use super::fits::{Fits, Model, pieces};
use super::force::ForceView;
use super::law::Law;
use super::model::{Action, Study, Target};
use super::open::open;
use super::search::{Say, Selection, search};
use super::simulate::Piece;
use crate::refine::Error;
use crate::refine::answer::{Answer, Effect, Errors, Parameter, Verdict};
use crate::refine::engine::System;
use crate::refine::engine::fit::{Fit, Free, fit};
use crate::refine::evidence::{Evidence, Signal};

/// Error in noise rms up to which the declared model leaves nothing to find.
const NOISE: f64 = 1.5;

/// Reads, searches and answers.
///
/// # Errors
/// Whatever does not fit in the declaration, the records or the system, and a declared model that cannot be simulated.
pub fn answer(file: &File, most: usize, say: Say) -> Result<(Answer, Evidence), Error> {
    let (mut study, attachments) = open(file)?;
    say("fitting the declared model");
    let declared = declared(file, &study)?;
    let survey = {
        let fits = Fits::new(&study, vec![1.0; study.outputs.len()]);
        fits.view(&[], &fits.pieces).survey(&declared.parameters, &declared.locals)
    };
    study.ranges = survey.ranges.iter().map(|range| range[1]).collect();
    let inputs: Vec<String> = study.graph.inputs.iter().map(|input| input.name.clone()).collect();
    let fed: Vec<bool> =
        (0..inputs.len()).map(|i| study.records.iter().all(|record| record.inputs[i].is_some())).collect();
    let place = |name: &str| inputs.iter().position(|input| input == name).filter(|&i| fed[i]);
    catalogue::fill(&mut study, &attachments, &survey, &place);
    if study.candidates.is_empty() {
        return Err(file.refuse_all(
            "there is no effect to look for; add an [[attachment]] with an input, its channels, and the signals of velocity and position",
        ));
    }
    let scale = scales(&study, &declared);
    let model = steps(&mut study, &scale, &declared);
    let fits = Fits::new(&study, scale);
    let selection = search(&fits, model, most, say);
    say("errors on all records");
    let found = assemble(&fits, selection);
    let unit = |name: &str| study.outputs.iter().find(|o| o.name == name).map_or("N", |o| &o.unit).to_owned();
    let signals = found.noise.iter().map(|(name, noise)| Signal {
        name: name.clone(),
        unit: unit(name),
        noise: *noise,
    });
    let evidence = Evidence { signals: signals.collect(), ..Evidence::default() };
    Ok((found, evidence))
}

fn declared(file: &File, study: &Study) -> Result<Fit, Error> {
    let spread = |o: usize| {
        let values = study.records.iter().filter(|record| record.role == Role::Estimation);
        let values: Vec<f64> = values.flat_map(|record| record.outputs[o].iter().copied()).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    let fits = Fits::new(study, (0..study.outputs.len()).map(spread).collect());
    let view = fits.view(&[], &fits.pieces);
    let locals = Fits::locals(&view);
    for (piece, local) in locals.iter().enumerate() {
        let residuals = view.residuals(piece, &study.start(), local);
        if let Some(at) = residuals.iter().position(|value| !value.is_finite()) {
            let record = &study.records[view.pieces[piece].record];
            return Err(file.refuse_all(format!(
                "the declared model cannot be simulated on {}: it diverges after {:.3} s; check parameters, units, initial states and step_s",
                record.name,
                (at % record.n) as f64 * record.step
            )));
        }
    }
    Ok(fits.declared().fit)
}

/// Error of the declared model by output on the estimation records, not less than the noise.
fn scales(study: &Study, declared: &Fit) -> Vec<f64> {
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let errors = errors(&fits, &[], &fits.pieces, &declared.parameters, Some(&declared.locals));
    study.outputs.iter().map(|o| errors.rms.get(&o.name).copied().unwrap_or(1.0).max(o.noise)).collect()
}

/// Difference steps of the candidates; those that change nothing are taken out. The declared model in the new scale.
fn steps(study: &mut Study, scale: &[f64], declared: &Fit) -> Model {
    let mut p = study.start();
    p[..study.declared].copy_from_slice(&declared.parameters[..study.declared]);
    let found: Vec<Vec<Option<f64>>> = {
        let fits = Fits::new(study, scale.to_vec());
        let base = model(&fits, &p, &declared.locals);
        (0..study.candidates.len())
            .map(|c| study.candidates[c].entries.clone().map(|index| fits.step(&base, c, index)).collect())
            .collect()
    };
    let mut kept = Vec::new();
    for (c, steps) in found.into_iter().enumerate() {
        let candidate = study.candidates[c].clone();
        if steps.iter().any(Option::is_none) {
            let why = "it changes nothing in the estimation records";
            study.not_testable.push((candidate.name(), why.into()));
            continue;
        }
        for (index, step) in candidate.entries.clone().zip(steps.into_iter().flatten()) {
            study.entries[index].free.step = step;
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
    Model { added: Vec::new(), fit: found, error, held_back: f64::NAN }
}

/// Errors of pieces in the units of the outputs; initial states are fitted where the study says so.
fn errors(fits: &Fits, added: &[usize], pieces: &[Piece], p: &[f64], locals: Option<&[Vec<f64>]>) -> Errors {
    let mut found = Errors::default();
    if pieces.is_empty() {
        return found;
    }
    let view = fits.view(added, pieces);
    let own = match locals {
        Some(locals) => locals.to_vec(),
        None => fits.grow(added, pieces, p, &[], &[0.1, 0.3, 1.0], 12).locals,
    };
    let mut sums: BTreeMap<String, (f64, f64, f64, f64)> = BTreeMap::new();
    for (r, local) in own.iter().enumerate() {
        let (predicted, measured) = (view.predict(r, p, local), view.measured(r));
        for span in view.signals(r) {
            let sum = sums.entry(span.signal).or_default();
            for (a, b) in measured[span.range.clone()].iter().zip(&predicted[span.range.clone()]) {
                *sum = (sum.0 + 1.0, sum.1 + (a - b).powi(2), sum.2 + a, sum.3 + a * a);
            }
        }
    }
    for (signal, (n, error, sum, square)) in sums {
        let spread = (square / n - (sum / n).powi(2)).max(f64::MIN_POSITIVE);
        found.rms.insert(signal.clone(), (error / n).sqrt());
        found.nrmse.insert(signal, (error / n / spread).sqrt());
    }
    found
}

/// Factor by which residuals that hang together widen intervals: power of sums over blocks against that of samples.
fn widening(residuals: &[Vec<f64>]) -> f64 {
    let all: f64 = residuals.iter().flatten().map(|r| r * r).sum();
    let power = |length: usize| {
        let blocks = residuals.iter().flat_map(|own| own.chunks_exact(length));
        blocks.map(|block| block.iter().sum::<f64>().powi(2) / length as f64).sum::<f64>() / all
    };
    [1, 8, 64, 256].into_iter().map(power).fold(1.0, f64::max).sqrt()
}

/// Parameters in the terms of the vocabulary.
fn physical(study: &Study, c: usize, p: &[f64]) -> Vec<f64> {
    let own = &study.candidates[c];
    let p = &p[own.entries.clone()];
    match own.action {
        Action::Block { law: Law::Spring, .. } => vec![p[0], -p[1] / p[0]],
        Action::Block { law: Law::Cogging, .. } => vec![p[0].hypot(p[1]), p[1].atan2(p[0]), p[2]],
        _ => p.to_vec(),
    }
}

fn effect(fits: &Fits, selection: &Selection, model: &Model, c: usize, widen: f64) -> Effect {
    let study = fits.study;
    let own = &study.candidates[c];
    let values = physical(study, c, &model.fit.parameters);
    let names = study.entries[own.entries.clone()].iter();
    let parameters = names.zip(&values).enumerate().map(|(k, (entry, value))| {
        let mut slopes = vec![0.0; model.fit.free.len()];
        for (a, free) in model.fit.free.iter().enumerate() {
            let mut moved = model.fit.parameters.clone();
            moved[free.index] += free.step;
            slopes[a] = (physical(study, c, &moved)[k] - value) / free.step;
        }
        let mut variance = 0.0;
        for a in 0..slopes.len() {
            for b in 0..slopes.len() {
                variance += slopes[a] * model.fit.covariance[(a, b)] * slopes[b];
            }
        }
        let half = 1.96 * widen * model.error * variance.max(0.0).sqrt();
        let name = entry.name.rsplit(' ').next().unwrap_or(&entry.name).to_owned();
        Parameter { name, unit: entry.unit.clone(), value: *value, interval: (value - half, value + half) }
    });
    let samples: usize = fits.pieces.iter().map(|piece| piece.range.len()).sum();
    let score = samples as f64 * (selection.declared.error / model.error).powi(2).ln();
    Effect {
        id: own.id.to_owned(),
        channel: own.channel.to_owned(),
        signal: own.signal.clone(),
        selected: false,
        group: None,
        score,
        parameters: parameters.collect(),
        reason: String::new(),
    }
}

fn effects(fits: &Fits, selection: &Selection, chosen: bool) -> Vec<Effect> {
    let best = &selection.best;
    let view = fits.view(&best.added, &fits.pieces);
    let residuals: Vec<Vec<f64>> = (0..fits.pieces.len())
        .map(|r| view.residuals(r, &best.fit.parameters, &best.fit.locals[r]))
        .collect();
    let widen = widening(&residuals);
    let percent = |from: f64, to: f64| format!("{:.1} %", 100.0 * (1.0 - to / from));
    let mut found = Vec::new();
    for &c in &best.added {
        let step = selection.path.iter().position(|(added, _)| added.contains(&c));
        let reason = match step {
            Some(k) if k > 0 => {
                let with = selection.path[k].0.len() - selection.path[k - 1].0.len() > 1;
                format!(
                    "{}lowers the error on what was kept back by {}",
                    if with { "together with its partner it " } else { "" },
                    percent(selection.path[k - 1].1, selection.path[k].1)
                )
            }
            _ => "part of the best model on what was kept back".to_owned(),
        };
        let rivals = selection.equals.iter().any(|(lacking, _)| *lacking == c);
        let group = (chosen && rivals).then_some(c);
        found.push(Effect { selected: chosen, group, reason, ..effect(fits, selection, best, c, widen) });
    }
    for (lacking, model) in &selection.equals {
        for &c in model.added.iter().filter(|c| !best.added.contains(c)) {
            let reason = "these records cannot tell it from the selected effect".to_owned();
            let group = chosen.then_some(*lacking);
            found.push(Effect { group, reason, ..effect(fits, selection, model, c, widen) });
        }
    }
    for model in &selection.singles {
        let c = model.added[0];
        let own = &fits.study.candidates[c];
        let same = |e: &Effect| e.id == own.id && e.signal == own.signal;
        let gains = model.error < 0.999 * selection.declared.error;
        if gains && !found.iter().any(same) {
            let held = if model.held_back.is_nan() {
                String::new()
            } else {
                format!(
                    ", by {} on what was kept back",
                    percent(selection.declared.held_back, model.held_back)
                )
            };
            let reason = format!(
                "alone it lowers the estimation error by {}{held}",
                percent(selection.declared.error, model.error)
            );
            let one = Effect { reason, ..effect(fits, selection, model, c, widen) };
            // A spring without stiffness has no rest position: it was fitted as something else.
            let known = |p: &Parameter| [p.value, p.interval.0, p.interval.1].iter().all(|v| v.is_finite());
            if one.parameters.iter().all(known) {
                found.push(one);
            }
        }
    }
    found
}

/// Force residual before and after on the records of a role, refitted on the force; empty without a rule.
fn force(fits: &Fits, added: &[usize], p: &[f64], roles: [Role; 2]) -> [Errors; 2] {
    let study = fits.study;
    if study.force.is_none() {
        return [Errors::default(), Errors::default()];
    }
    let of = |pieces: Vec<Piece>| ForceView { view: fits.view(added, &pieces), scale: 1.0 };
    let estimation = of(pieces(study, Role::Estimation));
    let free: Vec<Free> = fits
        .free(added)
        .into_iter()
        .filter(|free| !matches!(study.entries[free.index].target, Target::Offset))
        .collect();
    let records: Vec<usize> = (0..estimation.records()).collect();
    let none = vec![Vec::new(); records.len()];
    let found = fit(&estimation, &records, p, &free, &none, 25);
    roles.map(|role| {
        let view = of(pieces(study, role));
        let residuals: Vec<f64> =
            (0..view.records()).flat_map(|r| view.predict(r, &found.parameters, &[])).collect();
        let rms = (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len().max(1) as f64).sqrt();
        let mut errors = Errors::default();
        if let Some((.., name)) = &study.force {
            errors.rms.insert(name.clone(), rms);
            let spread = view.spread();
            errors.nrmse.insert(name.clone(), if spread > 0.0 { rms / spread } else { 0.0 });
        }
        errors
    })
}

fn assemble(fits: &Fits, selection: Selection) -> Answer {
    let study = fits.study;
    let roles = [Role::Estimation, Role::Validation];
    let all = |model: &Model| {
        let (p, added) = (&model.fit.parameters, &model.added);
        let mut found = [
            errors(fits, added, &fits.pieces, p, Some(&model.fit.locals)),
            errors(fits, added, &pieces(study, Role::Validation), p, None),
        ];
        for (errors, force) in found.iter_mut().zip(force(fits, added, p, roles)) {
            errors.rms.extend(force.rms);
            errors.nrmse.extend(force.nrmse);
        }
        found
    };
    let before = all(&selection.declared);
    let mut after = all(&selection.best);
    let outputs = || study.outputs.iter();
    let total = |errors: &Errors| -> f64 {
        outputs()
            .zip(&fits.scale)
            .map(|(o, scale)| (errors.rms.get(&o.name).unwrap_or(&0.0) / scale).powi(2))
            .sum()
    };
    let found = !selection.best.added.is_empty();
    let helps = total(&after[1]) < total(&before[1]);
    let clean = outputs().all(|o| before[1].rms.get(&o.name).is_some_and(|rms| *rms < NOISE * o.noise));
    let verdict = match (found && helps, clean) {
        (true, _) => Verdict::Effect,
        (false, true) => Verdict::Nothing,
        (false, false) => Verdict::Unexplained,
    };
    let chosen = verdict == Verdict::Effect;
    let mut effects = effects(fits, &selection, chosen);
    if found && !helps {
        for effect in effects.iter_mut().take(selection.best.added.len()) {
            "it lowers the error on estimation records but not on validation records"
                .clone_into(&mut effect.reason);
        }
        after = before.clone();
    }
    let mut noise: BTreeMap<String, f64> = outputs().map(|o| (o.name.clone(), o.noise)).collect();
    if let Some((rule, ..)) = &study.force {
        let name = study.force.as_ref().map(|force| force.3.clone()).unwrap_or_default();
        noise.insert(name, force_noise(study, rule.low_pass_hz));
    }
    let mut notes = study.notes.clone();
    notes.extend(remarks(fits, &selection, chosen));
    let unexplained = (verdict == Verdict::Unexplained).then(|| {
        let channel = study.candidates.first().map_or("actuator", |c| c.channel);
        (channel.to_owned(), Vec::new())
    });
    let left = |model: &Model| outputs().map(|o| (o.name.clone(), model.error)).collect();
    Answer {
        verdict,
        effects,
        unexplained,
        corrections: Vec::new(),
        fitted: fitted(study, if chosen { &selection.best } else { &selection.declared }),
        limit: NOISE,
        parameters: [&selection.declared, &selection.best].map(|model| model.fit.parameters.clone()),
        left: [left(&selection.declared), left(&selection.best)],
        before,
        after,
        noise,
        not_testable: study.not_testable.clone(),
        notes,
    }
}

/// Values of the free parameters of the declared system.
fn fitted(study: &Study, model: &Model) -> Vec<(String, f64)> {
    let own = study.entries.iter().zip(&model.fit.parameters);
    let own = own.filter(|(entry, _)| matches!(entry.target, Target::Declared(_)));
    own.map(|(entry, value)| (entry.name.clone(), *value)).collect()
}

/// Scatter of the driving force from sample to sample, as far as the low-pass lets it through.
fn force_noise(study: &Study, corner: f64) -> f64 {
    let records = study.records.iter().filter(|record| record.role == Role::Estimation);
    let first = records
        .flat_map(|record| record.inputs.iter().flatten().map(move |values| (values, record.step)))
        .next();
    first.map_or(1.0, |(values, step)| {
        (super::signal::scatter(values) * (2.0 * corner * step).sqrt()).max(1e-12)
    })
}

/// Sentences on declared parameters, on other records and on what is left.
fn remarks(fits: &Fits, selection: &Selection, chosen: bool) -> Vec<String> {
    let study = fits.study;
    let (before, after) = (&selection.declared, if chosen { &selection.best } else { &selection.declared });
    let mut found = Vec::new();
    for (index, entry) in study.entries[..study.declared].iter().enumerate() {
        let (was, is) = (before.fit.parameters[index], after.fit.parameters[index]);
        let unit = if entry.unit == "1" { String::new() } else { format!(" {}", entry.unit) };
        found.push(if chosen {
            format!(
                "Declared model, fitted: {} = {was:.6e}{unit} before, {is:.6e}{unit} with the effects.",
                entry.name
            )
        } else {
            format!("Declared model, fitted: {} = {was:.6e}{unit}.", entry.name)
        });
    }
    let idle = |model: &&Model| model.error >= 0.999 * before.error;
    let idle: Vec<String> =
        selection.singles.iter().filter(idle).map(|model| study.candidates[model.added[0]].name()).collect();
    if !idle.is_empty() {
        found.push(format!("Fitted alone to the declared model, these gain nothing: {}.", idle.join(", ")));
    }
    for (record, own) in study.records.iter().enumerate() {
        if own.role == Role::Estimation {
            continue;
        }
        let piece = [Piece { record, range: 0..own.n }];
        let error = |model: &Model| errors(fits, &model.added, &piece, &model.fit.parameters, None);
        let (was, is) = (error(before), error(after));
        for (signal, rms) in &was.rms {
            let after = is.rms.get(signal).copied().unwrap_or(f64::NAN);
            found.push(format!(
                "{} ({}): {signal} rms {rms:.4e} before, {after:.4e} after.",
                own.name,
                own.role.word()
            ));
        }
    }
    for (signal, noise) in study.outputs.iter().map(|o| (&o.name, o.noise)) {
        let piece = pieces(study, Role::Validation);
        let error = errors(fits, &after.added, &piece, &after.fit.parameters, None);
        let times = error.rms.get(signal).copied().unwrap_or(0.0) / noise;
        if times > 2.0 {
            found.push(format!("What is left of {signal} on validation records is {times:.1} times its noise: the model is better, not complete."));
        }
    }
    found
}
