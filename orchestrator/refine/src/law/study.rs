//! The law at a port of a study: free form, formula, exact fits, the answer.

use std::sync::Arc;

use super::extent::Extent;
use super::finder::{Finder, Scope};
use super::found::{Law, as_effect, dissipation, parameters as law_parameters};
use super::grammar::Axis;
use super::terms;
use super::windows::{positions, velocity};
use super::written::name;
use crate::answer::{Answer, Effect, Errors, Parameter, Verdict};
use crate::engine::fit::Free;
use crate::engine::stop;
use crate::study::assembled;
use crate::study::by_share;
use crate::study::catalog::{self, Candidate};
use crate::study::colored;
use crate::study::declaration::Role;
use crate::study::effects;
use crate::study::errors::{errors, force};
use crate::study::explain::{self, Judge};
use crate::study::fits::{Fits, Model, pieces};
use crate::study::integration;
use crate::study::law::{Point, Variable};
use crate::study::model::{Action, Entry, Output, Study, Tap};
use crate::study::ruling::share;
use crate::study::search::Say;
use crate::study::tolerance::{self, MAX_CORRECTIONS};
use crate::vocabulary::Own;

/// Share of the error on validation records below which a law is none.
const MIN_VALIDATED_SHARE: f64 = 0.05;
/// Share of the error on validation records that a law has to take away where it leaves more than noise.
const MIN_SHARE_ABOVE_NOISE: f64 = 0.9;
/// Error over that of noise up to which a law in time may leave more than noise.
const MAX_FLOORS_OF_LAW_IN_TIME: f64 = 1.15;
/// Share of the error on validation records from which on a law needs no parameter corrected beside it.
const MIN_SHARE_WITHOUT_CORRECTIONS: f64 = 0.98;
/// Power above noise that the declared model with corrections leaves, over that without, below which no law is looked
/// for before the search for shares.
const MAX_EXCESS_OF_CORRECTED: f64 = 0.1;
/// Share of the error on validation records that effects have to leave for a law to be looked for in their place.
const MIN_LEFT_BY_EFFECTS: f64 = 0.02;
/// Share of the error on validation records of which effects leave no more, where only laws without memory over the
/// motion at the port itself are tried in their place: those show whether the form of an effect is wrong.
const MAX_LEFT_FOR_SIMPLE_LAWS: f64 = 0.2;
/// Share of what effects leave that a law may leave to take their place: one that leaves noise, and any other.
const MAX_OF_EFFECTS_AT_NOISE: f64 = 0.5;
const MAX_OF_EFFECTS: f64 = 0.3;
/// Share of what a law takes away from which on effects that are terms of it are the answer, and the law a remark.
const MIN_SHARE_OF_MAIN_TERM: f64 = 0.5;
/// Share of the error on validation records from which on a law that leaves too much may be one beside effects.
const MIN_SHARE_OF_PART: f64 = 0.3;

/// Aim of the search for a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// A formula that leaves noise or next to nothing; given up once the free form predicts that none does.
    Noise,
    /// A law that explains nearly all of the residual.
    Share {
        /// Share of what a law over other variables takes away that effects must take away to have the right form.
        min_form_share: f64,
    },
}

impl Aim {
    pub(super) fn is_share(self) -> bool {
        matches!(self, Aim::Share { .. })
    }
}

/// Result of the search for a law in place of the effects of an answer.
#[derive(Debug, Default)]
pub struct InPlace {
    /// The model with the law, if there is one.
    pub law: Option<Model>,
    /// Candidates of the answer that are terms of a law which therefore does not take their place.
    pub terms: Vec<usize>,
    /// The model with a formula that takes much of the error and leaves too much to be the law alone.
    pub part: Option<Model>,
}

/// Puts a law into an answer that found nothing to name, or effects that leave much. `base`: the declared model with
/// its corrections, beside which the law is fitted; where it leaves noise declared parameters are corrected by up to
/// `max_tolerances` of their tolerances. Without a law the study stays as it is.
pub fn explain(
    study: &mut Study,
    scale: &[f64],
    model: (&Judge, &Model),
    found: &mut Answer,
    (aim, max_tolerances): (Aim, f64),
    say: Say,
) -> InPlace {
    let before = Extent::of(study);
    let mut held = InPlace::default();
    let law = sought(study, scale, model, found, (aim, max_tolerances, &mut held), say);
    if law.is_none() && held.part.is_none() {
        before.restore(study);
    }
    InPlace { law, ..held }
}

fn sought(
    study: &mut Study,
    scale: &[f64],
    (judge, base): (&Judge, &Model),
    found: &mut Answer,
    (aim, max_tolerances, held): (Aim, f64, &mut InPlace),
    say: Say,
) -> Option<Model> {
    let left = 1.0 - found.share.unwrap_or(0.0);
    let partly = found.verdict == Verdict::Effect && !found.complete && left > MIN_LEFT_BY_EFFECTS;
    if !(found.verdict == Verdict::Unexplained || partly) || stop::asked() {
        return None;
    }
    // What a law may leave that does not explain the records to the noise.
    let enough = match partly {
        true => MAX_OF_EFFECTS * scaled(study, scale, &found.after[0]),
        false => 1.0 - MIN_SHARE_ABOVE_NOISE,
    };
    let wide = !partly || left > MAX_LEFT_FOR_SIMPLE_LAWS || !aim.is_share();
    let scope = Scope { lacking: &found.before[1], enough, wide, max_tolerances };
    let mut finder = Finder::new(study, scale, (judge, base), aim, scope, say);
    let Outcome { mut law, model, after, .. } = finder.find(study, judge, base, found)?;
    let fits = finder.fits_with_all_steps(study);
    let white = judge.explained(&fits, &model) || judge.tolerable(&fits, &model);
    let colored = if white { None } else { colored::noises(&fits, judge, &model) };
    if let Some(noises) = &colored {
        let [_, floor] = colored::raised(&found.floor, study, noises);
        law.share = share(study, [&found.before[1], &after[1]], &[floor.clone(), floor]);
    }
    let complete = white || colored.is_some();
    // A residual of many small causes looks like something in time, or takes some of any shape.
    let in_time = law.variables.iter().any(|name| name == "time");
    let near_noise = judge.floors(model.error.powi(2)) < MAX_FLOORS_OF_LAW_IN_TIME;
    let most = law.share >= MIN_SHARE_ABOVE_NOISE && (!in_time || near_noise);
    let for_noise = !aim.is_share();
    if for_noise && !(law.named && (complete || law.share >= MIN_SHARE_WITHOUT_CORRECTIONS)) {
        return None;
    }
    if !complete && !most {
        let is_part = law.named && law.share >= MIN_SHARE_OF_PART && !for_noise;
        held.part = is_part.then_some(model);
        return None;
    }
    if partly {
        // Effects of the list stay unless a law leaves much less than they do, or they have not its form.
        let much = if complete { MAX_OF_EFFECTS_AT_NOISE } else { MAX_OF_EFFECTS } * left;
        if !law.named && !complete || 1.0 - law.share > much && !imitated(study, found, &law, aim) {
            return None;
        }
        let main = found.share.unwrap_or(0.0) >= MIN_SHARE_OF_MAIN_TERM * law.share;
        let is_term = |effect: &&Effect| effect.selected && terms::holds(&law, effect);
        let terms: Vec<&Effect> = found.effects.iter().filter(is_term).collect();
        if let Some(effect) = terms.first().filter(|_| main) {
            let is_held = |c: &usize| terms.iter().any(|effect| study.candidates[*c].is(effect));
            held.terms.extend((0..study.candidates.len()).filter(is_held));
            let note = terms::told(&law, effect);
            found.notes.push(note);
            return None;
        }
    }
    // Noise that is not white is told of where the answer is finished.
    put_alone(found, (&fits, judge, &model), law, after, white);
    Some(model)
}

/// Puts a law into an answer in place of its effects; see [`put`].
pub(super) fn put_alone(
    found: &mut Answer,
    model: (&Fits, &Judge, &Model),
    law: Law,
    after: [Errors; 2],
    complete: bool,
) {
    for effect in found.effects.iter_mut().filter(|effect| effect.selected) {
        (effect.selected, effect.group) = (false, None);
        effect.reason = format!("a law at {} takes away {:.0} % of the error", law.port, 100.0 * law.share);
    }
    found.unexplained = Some((law.place.clone(), law.variables.clone()));
    found.verdict = Verdict::Law;
    found.share = Some(law.share);
    put(found, model, law, after, complete);
}

/// Puts a law into an answer with what the model that has it leaves; `complete`: nothing but noise. Verdict and share
/// are the caller's.
pub(super) fn put(
    found: &mut Answer,
    (fits, judge, model): (&Fits, &Judge, &Model),
    law: Law,
    after: [Errors; 2],
    complete: bool,
) {
    found.complete = complete;
    found.left[1] = judge.left(fits, model);
    let left = (law.port.clone(), judge.floors(judge.excess(model)));
    found.left_at = if complete { Vec::new() } else { vec![left] };
    found.law = Some(law);
    found.fitted = assembled::fitted(fits.study, &model.fit.parameters);
    found.corrections = by_share::corrections_beside(fits.study, model, &found.corrections);
    found.after = after;
    found.parameters[1].clone_from(&model.fit.parameters);
}

/// Whether the effects of an answer at the port of a law only imitate it: none of them depends on a variable of the
/// law, and together they take much less away.
fn imitated(study: &Study, found: &Answer, law: &Law, aim: Aim) -> bool {
    let Aim::Share { min_form_share } = aim else { return false };
    let is_selected = |own: &Candidate| found.effects.iter().any(|effect| effect.selected && own.is(effect));
    let here = |c: &usize| {
        let own = &study.candidates[*c];
        own.port == law.port && matches!(own.action, Action::Block { .. }) && is_selected(own)
    };
    let effects: Vec<usize> = (0..study.candidates.len()).filter(here).collect();
    let apart = |&c: &usize| {
        explain::depends(study, c).iter().all(|own| !law.variables.iter().any(|name| name == own))
    };
    found.share.unwrap_or(0.0) < min_form_share * law.share
        && !effects.is_empty()
        && effects.iter().all(apart)
}

/// Signals at the attachments in the estimation records, `[taps][n]`: measured where an output shows the signal or its
/// derivative, else simulated with the model.
pub(crate) fn motion(fits: &Fits, model: &Model) -> Vec<Vec<Point>> {
    let study = fits.study;
    let view = fits.view(&model.added, &fits.pieces);
    let mut all: Vec<Vec<Point>> = vec![Vec::new(); study.taps.len()];
    for (r, piece) in fits.pieces.iter().enumerate() {
        let record = &study.records[piece.record];
        let measured = |slot: Option<usize>| {
            let output = study.outputs.iter().position(|output| Some(output.slot) == slot)?;
            Some(&record.outputs[output][piece.range.clone()])
        };
        let mut traces = view.trace(r, &model.fit.parameters, &model.fit.locals[r]);
        for ((tap, trace), all) in study.taps.iter().zip(&mut traces).zip(&mut all) {
            let (v, x) = (measured(tap.signals[0]), measured(tap.signals[1]));
            // A motion and a signal from elsewhere have nothing to do with each other.
            let apart = tap.crossed.is_some();
            let places = match (v, x, trace.first()) {
                (Some(v), None, Some(first)) if !apart => positions(first.position, v, record.step),
                _ => Vec::new(),
            };
            for (k, point) in trace.iter_mut().enumerate() {
                if let (Some(_), Some(place)) = (tap.signals[1], places.get(k)) {
                    point.position = *place;
                }
                if let Some(x) = x {
                    point.position = x[k];
                    point.velocity = if apart { point.velocity } else { velocity(x, k, record.step) };
                }
                if let Some(v) = v {
                    point.velocity = v[k];
                }
            }
            all.append(trace);
        }
    }
    all
}

/// Whether corrections of declared parameters up to `max_tolerances` of their tolerances take away nearly all of the
/// residual of the declared model, with the effects of one of some models.
pub fn corrections_explain(
    fits: &Fits,
    judge: &Judge,
    declared: &Model,
    models: &[&Model],
    max_tolerances: f64,
) -> bool {
    let study = fits.study;
    let fits =
        Fits { corrections: corrections(study, max_tolerances), ..Fits::new(study, fits.scale.clone()) };
    models.iter().any(|own| {
        let corrected = fits.fit_from(own.added.clone(), &own.fit.parameters, &own.fit.locals);
        corrected.is_some_and(|own| {
            let excess = judge.excess(&own);
            excess < MAX_EXCESS_OF_CORRECTED * judge.excess(declared) || judge.explained(&fits, &own)
        })
    })
}

/// Corrections of the declared parameters up to `most` of their tolerances; none where they are too many to be fitted
/// beside a law.
pub(super) fn corrections(study: &Study, most: f64) -> Vec<Free> {
    let found = tolerance::corrections(study, most);
    if found.len() > MAX_CORRECTIONS { Vec::new() } else { found.into_iter().map(|own| own.0).collect() }
}

/// Model for a parameter vector that has become longer.
pub(crate) fn extended(model: &Model, study: &Study) -> Model {
    let mut found = model.clone();
    let known = found.fit.parameters.len();
    found.fit.parameters.extend(study.entries.iter().skip(known).map(|entry| entry.start));
    found
}

/// Channel of a law over a variable at an attachment; empty where none is declared.
pub(super) fn channel(study: &Study, tap: usize, variable: Variable) -> &'static str {
    catalog::channel_of(&study.taps[tap].attachment, variable).unwrap_or_default()
}

pub(crate) fn push(
    study: &mut Study,
    action: Action,
    entries: Vec<Entry>,
    channel: &'static str,
    id: String,
) -> usize {
    let first = study.entries.len();
    let count = entries.len();
    study.entries.extend(entries);
    let port = match action {
        Action::Block { tap, .. } => study.taps[tap].name.clone(),
        _ => String::new(),
    };
    study.candidates.push(Candidate {
        id,
        channel,
        port,
        twin: false,
        signal: None,
        action,
        entries: first..first + count,
        starts: vec![vec![0.0; count]],
        complexity: count,
        probe: true,
        into: None,
        needs: None,
    });
    study.candidates.len() - 1
}

impl Finder<'_> {
    pub(super) fn say_law(
        &self,
        study: &mut Study,
        judge: &Judge,
        declared: &Model,
        found: Found,
        answer: &Answer,
    ) -> Option<Outcome> {
        let mut model = extended(&found.model, study);
        // Steps of integration that do for the declared model may be too coarse for the law.
        let finer = integration::finer(&self.fits_with_all_steps(study), &model);
        study.substeps = finer.unwrap_or(study.substeps);
        let study = &*study;
        let mut fits = self.fits_with_all_steps(study);
        if self.aim.is_share() || finer.is_some() {
            model =
                fits.fit_from(model.added.clone(), &model.fit.parameters, &model.fit.locals).unwrap_or(model);
        }
        // Declared parameters within their tolerances shift the parameters of a law; what leaves noise is weighed by
        // the noise.
        let all = corrections(study, self.max_tolerances);
        let in_noise = match self.aim {
            Aim::Noise => Some((all, explain::noises(study), model.clone())),
            Aim::Share { .. } if self.beside.is_empty() && judge.explained(&fits, &model) => {
                Some((self.corrections.clone(), explain::noises(study), model.clone()))
            }
            Aim::Share { .. } if model.error < self.max_error && self.may_leave_noise(judge, &model) => {
                let own = self.in_noise(study, &all, &model);
                own.and_then(|own| Some((self.noise_left(study, judge, &all, &own)?, own)))
                    .map(|(scale, own)| (all, scale, own))
            }
            Aim::Share { .. } => None,
        };
        let is_in_noise = in_noise.is_some();
        if let Some((corrections, scale, start)) = in_noise {
            fits = Fits { corrections, ..Fits::new(study, scale) };
            let fitted = fits.fit_from(start.added, &start.fit.parameters, &start.fit.locals);
            model = fitted.unwrap_or(model);
        }
        model = self.needed(&fits, model);
        let declared = extended(declared, study);
        let validation = pieces(study, Role::Validation);
        let of = |model: &Model, pieces: &[_], locals| {
            errors(&fits, &model.added, pieces, &model.fit.parameters, locals)
        };
        let own = fits.as_declared(&model);
        let mut after = [
            errors(&fits, &model.added, &pieces(study, Role::Estimation), &own.parameters, Some(&own.locals)),
            of(&model, &validation, None),
        ];
        let forces = force(&fits, &model.added, &own.parameters, [Role::Estimation, Role::Validation]);
        for (errors, force) in after.iter_mut().zip(forces) {
            errors.rms.extend(force.rms);
            errors.nrmse.extend(force.nrmse);
        }
        let floor = answer.floor[1].clone();
        let share = share(study, [&self.lacking, &after[1]], &[floor.clone(), floor]);
        let gained = 1.0 - self.error(study, &model) / declared.error;
        if !(share >= MIN_VALIDATED_SHARE && share > 0.5 * gained) {
            return None;
        }
        let tap = found.tap;
        let channel = found.variables.first().map_or("", |own| channel(study, tap, *own));
        let widen = model.error.max(if is_in_noise { 1.0 } else { judge.power.sqrt() });
        let c = *model.added.last()?;
        let place = |index: usize| model.fit.free.iter().position(|free| free.index == index);
        let known = study.candidates[c].entries.clone().map(|index| {
            let deviation = |a: usize| model.fit.covariance[(a, a)].max(0.0).sqrt();
            (own.parameters[index], place(index).map_or(f64::NAN, |a| 1.96 * widen * deviation(a)))
        });
        let parameters: Vec<Parameter> = law_parameters(&found.effect, known).collect();
        let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
        let effect = Effect {
            port: Some(study.taps[tap].name.clone()),
            wiring: effects::wiring(study, &model, c),
            ..as_effect(&found.effect, channel, share, parameters)
        };
        let covered = found
            .axes
            .iter()
            .map(|axis| (axis.name.to_owned(), axis.range.0, axis.range.1, axis.unit.clone()))
            .collect();
        let word = |variable: &Variable| explain::word(study, tap, *variable).to_owned();
        let words = sources(&found.effect.words, &study.taps[tap], &found.variables);
        let law = Law {
            port: study.taps[tap].name.clone(),
            channel: channel.to_owned(),
            place: format!("{channel}@{}", study.taps[tap].name),
            variables: found.variables.iter().map(word).collect(),
            curve: found.curve,
            named: found.named,
            of_free_form: found.share,
            share,
            rivals: found.rivals,
            covered,
            dissipation: self.dissipation(study, tap, &found.effect, &values),
            toml: Own { words, ..(*found.effect).clone() }.to_toml(&values),
            effect,
        };
        let error = self.error(study, &model);
        Some(Outcome { law, model: Model { fit: own, error, ..model }, after, widen })
    }

    /// Mean power of the law over its mean magnitude, along the records; none where no velocity is known.
    fn dissipation(&self, study: &Study, tap: usize, own: &Own, values: &[f64]) -> Option<f64> {
        let moved = study.taps[tap].crossed.unwrap_or(tap);
        study.taps[moved].signals[0]?;
        if own.port.replaces() {
            return None;
        }
        let mut z = vec![0.0; own.states.len()];
        let step = study.records.first().map_or(1e-3, |record| record.step);
        let powers = self.trace[tap].iter().zip(&self.trace[moved]).map(|(point, moved)| {
            let at = [point.position, point.velocity, point.value, point.time];
            let power = own.value(at, &z, values) * moved.velocity;
            own.advance(at, &mut z, values, step);
            power
        });
        dissipation(powers)
    }
}

/// A law, the model with it, its errors on estimation and validation records.
pub(super) struct Outcome {
    pub(super) law: Law,
    pub(super) model: Model,
    pub(super) after: [Errors; 2],
    /// Factor of the standard deviations that the covariance of its fit gives.
    pub(super) widen: f64,
}

/// Law chosen, before its sentences are written.
pub(super) struct Found {
    pub(super) tap: usize,
    pub(super) variables: Vec<Variable>,
    pub(super) curve: Vec<[f64; 3]>,
    pub(super) effect: Arc<Own>,
    pub(super) model: Model,
    pub(super) named: bool,
    pub(super) share: f64,
    pub(super) rivals: Vec<(String, f64)>,
    pub(super) axes: Vec<Axis>,
}

/// Words on a law with the signals that its letters stand for.
fn sources(words: &str, tap: &Tap, variables: &[Variable]) -> String {
    let signal = |variable: &Variable| {
        let signal = match variable {
            Variable::Position => tap.attachment.position.clone(),
            Variable::Velocity => tap.attachment.velocity.clone(),
            Variable::Value => Some(tap.name.clone()),
            _ => None,
        };
        signal.map(|signal| format!("{} = {signal}", name(*variable)))
    };
    let known: Vec<String> = variables.iter().filter_map(signal).collect();
    if known.is_empty() { words.to_owned() } else { format!("a {words}, with {}", known.join(" and ")) }
}

/// Root of the mean square over the outputs, each in units of its scale.
pub(super) fn scaled(study: &Study, scale: &[f64], errors: &Errors) -> f64 {
    let one = |(output, scale): (&Output, &f64)| (errors.counted(&output.name, output.noise) / scale).powi(2);
    let sum: f64 = study.outputs.iter().zip(scale).map(one).sum();
    (sum / scale.len().max(1) as f64).sqrt()
}
