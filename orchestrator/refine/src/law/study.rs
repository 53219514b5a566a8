//! The law at a port of a study: free form, formula, exact fits, the answer.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::grammar::Axis;
use super::surface::{Surface, knots};
use super::surrogate::Approach;
use super::windows::{Windows, velocity};
use crate::answer::{Answer, Effect, Errors, Parameter, Verdict};
use crate::engine::fit::Free;
use crate::engine::stop;
use crate::study::answer;
use crate::study::by_share;
use crate::study::catalogue::{self, Candidate};
use crate::study::declaration::Role;
use crate::study::effects;
use crate::study::errors::errors;
use crate::study::explain::{self, Judge};
use crate::study::fits::{Fits, Model, pieces};
use crate::study::law::{Law as Block, Point, Variable};
use crate::study::model::{Action, Entry, Study, Target};
use crate::study::search::Say;
use crate::study::simulate::Piece;
use crate::vocabulary::Own;

/// Share of what is left above noise that a free form has to take away for a law to be looked for.
const MIN_SHARE_OF_EXCESS: f64 = 0.2;
/// Share of the error on validation records below which a law is none.
const MIN_VALIDATED_SHARE: f64 = 0.05;
/// Share of the error on validation records that a law has to take away where it leaves more than noise.
const MIN_SHARE_ABOVE_NOISE: f64 = 0.9;
/// Share of the error on validation records that effects have to leave for a law to be looked for in their place.
const MIN_LEFT_BY_EFFECTS: f64 = 0.02;
/// Share of what effects leave that a law may leave to take their place: one that leaves noise, and any other.
const MAX_OF_EFFECTS_AT_NOISE: f64 = 0.5;
const MAX_OF_EFFECTS: f64 = 0.1;
/// Share of a second variable in what one leaves, from which on both are needed.
const MIN_SHARE_OF_SECOND_VARIABLE: f64 = 0.15;
/// Parts of the records, from their beginning, that a free form is brought to before the whole.
pub(super) const GROWING_SHARES: [f64; 5] = [0.03, 0.07, 0.15, 0.3, 0.6];
/// Part of the records, from their beginning, on which variables are compared.
const SCREENED_SHARE_OF_RECORDS: f64 = 0.35;
/// Ratio of the error of a free form to what its quadratic form promises, up to which it is at its optimum.
const MAX_ERROR_OVER_QUADRATIC: f64 = 1.5;
/// Knots of a variable while variables are compared, of the one that is chosen, and of each of two.
const SCREENING_KNOTS: usize = 10;
pub(super) const CURVE_KNOTS: usize = 20;
const SURFACE_KNOTS: usize = 6;
/// Weight of the gain of a form over the value that passes.
const WEIGHT_OF_VALUE: f64 = 0.5;
/// Share of the best variable's gain from which on another is looked at closely.
const MIN_GAIN_OVER_BEST: f64 = 0.5;
/// Fall of the held-out error that a free form must bring, in variances of the noise.
const MIN_GAIN_IN_NOISE: f64 = 30.0;
/// Share of the least error that counts as above noise where it is at the noise.
const MIN_EXCESS_OF_LEAST: f64 = 0.03;
/// Steps of the free form towards its optimum.
const ROUNDS: usize = 3;
/// Error in rms of the noise from which on a law with a memory is tried.
const MIN_ERROR_FOR_MEMORY: f64 = 1.5;
/// Ratio of the error of a law with a memory to the least without one, below which it is taken.
const MAX_ERROR_WITH_MEMORY: f64 = 0.6;

/// A law that was found at a port.
#[derive(Debug, Clone)]
pub struct Law {
    /// Input where it acts.
    pub port: String,
    /// Channel; empty where none is declared.
    pub channel: String,
    /// Where it acts: `channel@port`, `@port`, or a channel alone.
    pub place: String,
    /// Variables in the words of the vocabulary.
    pub variables: Vec<String>,
    /// The law as an effect, with its formula and parameters.
    pub effect: Effect,
    /// Curve through the free form: place, height, half the width of its 95 % band; empty for two variables.
    pub curve: Vec<[f64; 3]>,
    /// Whether the formula is named, or the curve itself is the answer.
    pub named: bool,
    /// Share of the free form's gain on held-out parts that the formula takes.
    pub of_free_form: f64,
    /// Share of the error on validation records.
    pub share: f64,
    /// Formulas that do as well: text, share of the free form's gain.
    pub rivals: Vec<(String, f64)>,
    /// Least and largest value of each variable in the estimation records, with its unit.
    pub covered: Vec<(String, f64, f64, String)>,
    /// Mean power that the law takes out of the motion, over its mean magnitude: 1 takes energy always, 0 stores it.
    pub dissipation: Option<f64>,
    /// The law as TOML.
    pub toml: String,
}

/// One free form, fitted.
#[derive(Clone)]
pub(super) struct FreeForm {
    pub(super) tap: usize,
    pub(super) surface: Surface,
    pub(super) candidate: usize,
    pub(super) at: Approach,
    /// Rms of the residuals of whole records.
    pub(super) error: f64,
    /// Local parameters of whole records.
    pub(super) locals: Vec<Vec<f64>>,
}

impl FreeForm {
    /// Place, height and half of the 95 % band at every knot; empty for two variables.
    pub(super) fn curve(&self, residual: f64) -> Vec<[f64; 3]> {
        let [knots] = &self.surface.knots[..] else { return Vec::new() };
        let heights = self.at.smooth.heights.iter().zip(&self.at.smooth.deviation);
        knots.iter().zip(heights).map(|(x, (y, s))| [*x, *y, 1.96 * residual * s]).collect()
    }
}

pub(super) struct Finder<'a> {
    pub(super) scale: &'a [f64],
    pub(super) say: Say<'a>,
    /// Corrections of the declared model that are fitted beside a law.
    pub(super) corrections: Vec<Free>,
    /// Simulations with steps of second order, where they change the error of the declared model by next to nothing.
    pub(super) quick: bool,
    /// What the attachments show, `[taps][n]`.
    pub(super) trace: Vec<Vec<Point>>,
    /// Windows in which free forms are compared; none: whole records.
    pub(super) windows: Option<Windows>,
    /// Sum of squares that the noise of the sensors gives.
    pub(super) noise: f64,
}

/// Puts a law into an answer that found nothing to name, or effects that leave much; the model with it, if there is one.
/// `base`: the declared model with its corrections, beside which the law is fitted.
pub fn explain(
    study: &mut Study,
    scale: &[f64],
    (judge, base): (&Judge, &Model),
    found: &mut Answer,
    say: Say,
) -> Option<Model> {
    let left = 1.0 - found.share.unwrap_or(0.0);
    let partly = found.verdict == Verdict::Effect && !found.complete && left > MIN_LEFT_BY_EFFECTS;
    if !(found.verdict == Verdict::Unexplained || partly) || stop::asked() {
        return None;
    }
    let is_correction = |free: &&Free| matches!(study.entries[free.index].target, Target::Correction { .. });
    let corrections = base.fit.free.iter().filter(is_correction).copied().collect();
    let (quick, trace, windows, noise) = {
        let fits = Fits::new(study, scale.to_vec());
        let (trace, windows) = (motion(&fits, base), Windows::new(&fits, base));
        let samples: usize = fits.pieces.iter().map(|piece| piece.range.len()).sum();
        let noise: f64 = study.outputs.iter().zip(scale).map(|(o, s)| (o.noise / s).powi(2)).sum();
        (fits.quickened(base).quick, trace, windows, noise * samples as f64)
    };
    let finder = Finder { scale, say, corrections, quick, trace, windows, noise };
    let Outcome { law, model, after } = finder.find(study, judge, base, found)?;
    let fits = finder.fits(study);
    let complete = judge.explained(&fits, &model) || judge.tolerable(&fits, &model);
    // A residual of many small causes looks like something in time, or takes some of any shape.
    let most = law.share >= MIN_SHARE_ABOVE_NOISE && !law.variables.iter().any(|name| name == "time");
    if !complete && !most {
        return None;
    }
    if partly {
        // Effects of the list stay unless a law leaves much less than they do.
        if !law.named
            || 1.0 - law.share > if complete { MAX_OF_EFFECTS_AT_NOISE } else { MAX_OF_EFFECTS } * left
        {
            return None;
        }
        for effect in found.effects.iter_mut().filter(|effect| effect.selected) {
            (effect.selected, effect.group) = (false, None);
            effect.reason =
                format!("a law at {} takes away {:.0} % of the error", law.port, 100.0 * law.share);
        }
    }
    found.notes.extend(told(&law));
    found.unexplained = Some((law.place.clone(), law.variables.clone()));
    found.verdict = Verdict::Law;
    found.share = Some(law.share);
    found.complete = complete;
    found.left[1] = judge.left(&fits, &model);
    found.law = Some(law);
    found.fitted = answer::fitted(study, &model.fit.parameters);
    found.corrections = by_share::corrections_beside(study, &model, &found.corrections);
    found.after = after;
    found.parameters[1].clone_from(&model.fit.parameters);
    Some(model)
}

/// What the attachments show in the estimation records, `[taps][n]`: measured where an output shows it, of a model
/// otherwise.
fn motion(fits: &Fits, model: &Model) -> Vec<Vec<Point>> {
    let study = fits.study;
    let view = fits.view(&[], &fits.pieces);
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
            for (k, point) in trace.iter_mut().enumerate() {
                if let Some(x) = x {
                    (point.position, point.velocity) = (x[k], velocity(x, k, record.step));
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

/// Sentences on a law.
pub fn told(law: &Law) -> Vec<String> {
    let mut found = Vec::new();
    let range = |(name, low, high, unit): &(String, f64, f64, String)| {
        format!("{name} from {low:.4} to {high:.4} {unit}")
    };
    let covered: Vec<String> = law.covered.iter().map(range).collect();
    if !covered.is_empty() {
        found.push(format!(
        "The law at {} is known where the estimation records have been: {}; beyond it is an extrapolation (a curve goes on straight).",
        law.port,
        covered.join(", ")
    ));
    }
    if let Some(part) = law.dissipation {
        found.push(if part > 0.5 {
            format!("It takes energy out of the motion: mean power over mean magnitude of power {part:.2}.")
        } else if part < -0.5 {
            format!("It drives the motion: mean power over mean magnitude of power {part:.2}.")
        } else {
            format!("It stores energy and gives it back, for the most part: mean power over mean magnitude of power {part:.2}.")
        });
    }
    for (text, share) in &law.rivals {
        found
            .push(format!("Another formula does as well: {text} ({:.1} % of the free form).", 100.0 * share));
    }
    found
}

/// Model for a parameter vector that has become longer.
pub(super) fn extended(model: &Model, study: &Study) -> Model {
    let mut found = model.clone();
    let known = found.fit.parameters.len();
    found.fit.parameters.extend(study.entries[known..].iter().map(|entry| entry.start));
    found
}

/// Attachments and variables over which free forms are looked for.
fn places(study: &Study) -> Vec<(usize, Variable)> {
    let mut found = Vec::new();
    for (tap, own) in study.taps.iter().enumerate() {
        let input = study.graph.inputs.iter().position(|input| input.name == own.name);
        let fed = input.is_some_and(|i| study.records.iter().all(|record| record.inputs[i].is_some()));
        // Of ports that act alike one stands for all.
        let forces = own.attachment.port.is_none_or(|duty| duty.forces);
        let variables = [
            (Variable::Position, forces && own.signals[1].is_some()),
            (Variable::Velocity, forces && own.signals[0].is_some()),
            (Variable::Value, fed),
            (Variable::Time, forces),
        ];
        let here = variables.into_iter().filter(|(variable, there)| {
            *there && catalogue::channel_of(&own.attachment, *variable).is_some()
        });
        found.extend(here.map(|(variable, _)| (tap, variable)));
    }
    found
}

/// Channel of a law over a variable at an attachment; empty where none is declared.
fn channel(study: &Study, tap: usize, variable: Variable) -> &'static str {
    catalogue::channel_of(&study.taps[tap].attachment, variable).unwrap_or_default()
}

pub(super) fn push(
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
        needs: None,
    });
    study.candidates.len() - 1
}

impl Finder<'_> {
    pub(super) fn fits<'s>(&self, study: &'s Study) -> Fits<'s> {
        let corrections = self.corrections.clone();
        Fits { quick: self.quick, corrections, ..Fits::new(study, self.scale.to_vec()) }
    }

    pub(super) fn unit(study: &Study, tap: usize, variable: Variable) -> String {
        let [value, velocity, position] = &study.taps[tap].units;
        match variable {
            Variable::Velocity => velocity.clone(),
            Variable::Position => position.clone(),
            Variable::Time => "s".into(),
            _ => value.clone(),
        }
    }

    /// Parameters that are fitted beside a law.
    fn shared(&self, study: &Study) -> Vec<Free> {
        study.declared_free().into_iter().chain(self.corrections.iter().copied()).collect()
    }

    pub(super) fn axes(&self, study: &Study, tap: usize, surface: &Surface) -> Vec<Axis> {
        let axis = |(variable, knots): (&Variable, &Vec<f64>)| Axis {
            name: name(*variable),
            unit: Self::unit(study, tap, *variable),
            range: (knots[0], knots[knots.len() - 1]),
        };
        surface.variables.iter().zip(&surface.knots).map(axis).collect()
    }

    /// Knots of a variable that moves at an attachment and is known there.
    pub(super) fn knots(
        &self,
        study: &Study,
        tap: usize,
        variable: Variable,
        count: usize,
    ) -> Option<Vec<f64>> {
        let known = study.taps[tap].signals;
        let there = match variable {
            Variable::Velocity => known[0].is_some(),
            Variable::Position => known[1].is_some(),
            _ => true,
        };
        let values: Vec<f64> = self.trace[tap].iter().map(|point| point.of(variable)).collect();
        knots(variable, &values, count).filter(|_| there)
    }

    fn find(&self, study: &mut Study, judge: &Judge, declared: &Model, answer: &Answer) -> Option<Outcome> {
        (self.say)("free forms at the ports");
        let mut singles = Vec::new();
        for (tap, variable) in places(study) {
            let count = if variable == Variable::Time { 16 } else { SCREENING_KNOTS };
            let Some(knots) = self.knots(study, tap, variable, count) else { continue };
            let surface = Surface { variables: vec![variable], knots: vec![knots] };
            if let Some(form) = self.form(study, declared, tap, surface) {
                singles.push(form);
            }
        }
        // The value that passes drives the motion, so that it seems to tell what the motion tells.
        let gain = |form: &FreeForm| {
            let drives = form.surface.variables == [Variable::Value];
            form.at.gain() * if drives { WEIGHT_OF_VALUE } else { 1.0 }
        };
        singles.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        let best = singles.first()?;
        let most = gain(best);
        let one = self.noise / self.samples(study).max(1) as f64;
        let enough = |form: &FreeForm| {
            let excess = (form.at.smooth.without - self.noise).max(0.0);
            gain(form) > (MIN_SHARE_OF_EXCESS * excess).max(MIN_GAIN_IN_NOISE * one)
        };
        let (tap, first) = (best.tap, best.surface.variables[0]);
        let mut forms: Vec<FreeForm> = Vec::new();
        for form in singles.iter().take(2).filter(|form| form.tap == tap) {
            if gain(form) < MIN_GAIN_OVER_BEST * most {
                continue;
            }
            let variable = form.surface.variables[0];
            let count = if variable == Variable::Time { 30 } else { CURVE_KNOTS };
            let Some(knots) = self.knots(study, tap, variable, count) else { continue };
            let surface = Surface { variables: vec![variable], knots: vec![knots] };
            let fine = self.form(study, declared, tap, surface);
            forms.extend(fine.and_then(|form| self.towards(study, form)));
        }
        // Two variables where one leaves much.
        let mut pairs = Vec::new();
        let (x, v) = (Variable::Position, Variable::Velocity);
        let mut combined = vec![[x, v]];
        for second in [x, v, Variable::Value, Variable::Time] {
            let mut both = [first, second];
            both.sort_by_key(|own| {
                [x, v, Variable::Value].iter().position(|known| known == own).unwrap_or(3)
            });
            if second != first && !combined.contains(&both) {
                combined.push(both);
            }
        }
        for variables in combined {
            if stop::asked() {
                continue;
            }
            let knots: Option<Vec<Vec<f64>>> =
                variables.iter().map(|own| self.knots(study, tap, *own, SURFACE_KNOTS)).collect();
            let Some(knots) = knots else { continue };
            let surface = Surface { variables: variables.into(), knots };
            let left = forms.iter().map(|own| own.at.smooth.held_out).fold(f64::INFINITY, f64::min);
            if left < 1.2 * self.noise {
                break;
            }
            if let Some(form) = self.form(study, declared, tap, surface) {
                pairs.push(form);
            }
        }
        pairs.sort_by(|a, b| a.at.smooth.held_out.total_cmp(&b.at.smooth.held_out));
        if let Some(pair) = pairs.into_iter().next() {
            forms.extend(self.towards(study, pair));
        }
        forms.sort_by(|a, b| a.at.smooth.held_out.total_cmp(&b.at.smooth.held_out));
        let least = forms.first()?.at.smooth.held_out;
        // What one variable leaves may be as much more than what two leave.
        let more = MIN_SHARE_OF_SECOND_VARIABLE * (least - self.noise).max(MIN_EXCESS_OF_LEAST * least);
        let simple =
            |form: &FreeForm| form.surface.variables.len() == 1 && form.at.smooth.held_out < least + more;
        let at = forms.iter().position(simple).unwrap_or(0);
        let form = forms.swap_remove(at);
        let law = if enough(&form) { self.law(study, judge, declared, &form) } else { None };
        let left = law.as_ref().map_or(declared.error, |own| own.model.error);
        let memory = if left > MIN_ERROR_FOR_MEMORY * judge.tolerated.sqrt() {
            self.memory(study, declared)
        } else {
            None
        };
        let found = match memory {
            Some((tap, model, effect)) if model.error < MAX_ERROR_WITH_MEMORY * left => {
                let (axes, variables) = (Vec::new(), vec![Variable::Velocity]);
                let (named, share, rivals) = (true, 1.0, Vec::new());
                Found { tap, variables, curve: Vec::new(), effect, model, named, share, rivals, axes }
            }
            _ => law?,
        };
        self.say_law(study, judge, declared, found, answer)
    }

    /// Samples of the estimation records, of all outputs.
    fn samples(&self, study: &Study) -> usize {
        self.trace.first().map_or(0, Vec::len) * study.outputs.len()
    }

    /// Records of the windows that are held out together for a form over some variables.
    fn groups(&self, variables: &[Variable]) -> Option<Vec<usize>> {
        // A law in time is the same in every record: only another record can tell whether it is one.
        let time = variables.contains(&Variable::Time);
        let of = |(i, piece): (usize, &Piece)| if time { piece.record } else { i };
        self.windows.as_ref().map(|own| own.pieces.iter().enumerate().map(of).collect())
    }

    /// A free form beside the declared model, around zero heights.
    fn form(&self, study: &mut Study, declared: &Model, tap: usize, surface: Surface) -> Option<FreeForm> {
        let count = surface.heights();
        study.surfaces.push(surface.clone());
        let index = study.surfaces.len() - 1;
        let first = study.entries.len();
        let entries = (0..count).map(|k| {
            let free = Free {
                index: first + k,
                bounds: (f64::NEG_INFINITY, f64::INFINITY),
                step: 1e-6,
                prior: None,
            };
            let name = format!("free form height {}", k + 1);
            Entry { name, unit: "1".into(), target: Target::Effect, start: 0.0, free }
        });
        let action = Action::Block { law: Block::Surface(index), tap };
        let candidate = push(study, action, entries.collect(), "", "free form".to_owned());
        let base = extended(declared, study);
        let fits = self.fits(study);
        let step = fits.probe_step(&base, candidate)?;
        study.entries[first..first + count].iter_mut().for_each(|entry| entry.free.step = step);
        let fits = self.fits(study);
        let own: Vec<Free> = study.entries[first..first + count].iter().map(|entry| entry.free).collect();
        let (view, locals) = match &self.windows {
            Some(windows) => (windows.view(&fits, candidate), windows.begins.clone()),
            None => (
                fits.view(&[candidate], &beginnings(&fits.pieces, SCREENED_SHARE_OF_RECORDS)),
                base.fit.locals.clone(),
            ),
        };
        let free = [&own[..], &self.shared(study)[..]];
        let groups = self.groups(&surface.variables);
        let at = Approach::begin(&view, &surface, &base.fit.parameters, free, &locals, groups)?;
        Some(FreeForm { tap, surface, candidate, at, error: declared.error, locals: base.fit.locals })
    }

    /// The free form at its optimum.
    fn towards(&self, study: &Study, form: FreeForm) -> Option<FreeForm> {
        let Some(windows) = &self.windows else { return self.whole(study, form) };
        let fits = self.fits(study);
        let own = study.candidates[form.candidate].entries.clone();
        let heights: Vec<Free> = own.map(|index| study.entries[index].free).collect();
        let free = [&heights[..], &self.shared(study)[..]];
        let at = form.at.towards(&windows.view(&fits, form.candidate), &form.surface, free, 2 * ROUNDS)?;
        Some(FreeForm { at, ..form })
    }

    /// The free form at its optimum for whole records.
    pub(super) fn whole(&self, study: &Study, form: FreeForm) -> Option<FreeForm> {
        let fits = self.fits(study);
        let own = study.candidates[form.candidate].entries.clone();
        let heights: Vec<Free> = own.map(|index| study.entries[index].free).collect();
        let shared = self.shared(study);
        let free = [&heights[..], &shared[..]];
        let whole = fits.view(&[form.candidate], &fits.pieces);
        let base = Approach::begin(&whole, &form.surface, &form.at.parameters, free, &form.locals, None)?;
        let without = base.smooth.without;
        let (p, locals) = (base.parameters.clone(), base.locals.clone());
        let direct = base.towards(&whole, &form.surface, free, ROUNDS);
        let consistent = |at: &Approach| {
            at.chi2 < MAX_ERROR_OVER_QUADRATIC * at.smooth.held_out && at.smooth.held_out < without
        };
        let mut at = match direct {
            Some(at) if consistent(&at) => at,
            // What leaves the declared model leaves it far behind at the end of a record: the beginning is understood first.
            direct => {
                let grown = self.grown(&fits, &form, free, (p, locals));
                match (direct, grown) {
                    (Some(a), Some(b)) if a.chi2 < b.chi2 => a,
                    (a, b) => b.or(a)?,
                }
            }
        };
        at.smooth.without = without;
        let count: usize =
            fits.pieces.iter().map(|piece| piece.range.len()).sum::<usize>() * study.outputs.len();
        let error = (at.chi2 / count.max(1) as f64).sqrt();
        let locals = at.locals.clone();
        Some(FreeForm { at, error, locals, ..form })
    }

    /// The free form over growing parts of the records.
    fn grown(
        &self,
        fits: &Fits,
        form: &FreeForm,
        free: [&[Free]; 2],
        (mut p, mut locals): (Vec<f64>, Vec<Vec<f64>>),
    ) -> Option<Approach> {
        for part in GROWING_SHARES {
            let view = fits.view(&[form.candidate], &beginnings(&fits.pieces, part));
            let at = Approach::begin(&view, &form.surface, &p, free, &locals, None)?;
            let at = at.towards(&view, &form.surface, free, ROUNDS)?;
            (p, locals) = (at.parameters, at.locals);
        }
        let whole = fits.view(&[form.candidate], &fits.pieces);
        let at = Approach::begin(&whole, &form.surface, &p, free, &locals, None)?;
        at.towards(&whole, &form.surface, free, 2 * ROUNDS)
    }

    fn say_law(
        &self,
        study: &Study,
        judge: &Judge,
        declared: &Model,
        found: Found,
        answer: &Answer,
    ) -> Option<Outcome> {
        let fits = Fits { quick: false, ..self.fits(study) };
        let model = extended(&found.model, study);
        let again = fits.fit_from(model.added.clone(), &model.fit.parameters, &model.fit.locals);
        let model = again.unwrap_or(model);
        let declared = extended(declared, study);
        let validation = pieces(study, Role::Validation);
        let of = |model: &Model, pieces: &[_], locals| {
            errors(&fits, &model.added, pieces, &model.fit.parameters, locals)
        };
        let own = fits.as_declared(&model);
        let after = [
            errors(&fits, &model.added, &pieces(study, Role::Estimation), &own.parameters, Some(&own.locals)),
            of(&model, &validation, None),
        ];
        let share = share(study, [&answer.before[1].rms, &after[1].rms], &answer.floor[1]);
        let gained = 1.0 - model.error / declared.error;
        if !(share >= MIN_VALIDATED_SHARE && share > 0.5 * gained) {
            return None;
        }
        let tap = found.tap;
        let channel = found.variables.first().map_or("", |own| channel(study, tap, *own));
        let widen = model.error.max(judge.power.sqrt());
        let c = model.added[0];
        let place = |index: usize| model.fit.free.iter().position(|free| free.index == index);
        let parameters =
            study.candidates[c].entries.clone().zip(&found.effect.parameters).map(|(index, p)| {
                let half = place(index)
                    .map_or(f64::NAN, |a| 1.96 * widen * model.fit.covariance[(a, a)].max(0.0).sqrt());
                let value = own.parameters[index];
                Parameter {
                    name: p.name.clone(),
                    unit: p.unit.clone(),
                    value,
                    interval: (value - half, value + half),
                }
            });
        let parameters: Vec<Parameter> = parameters.collect();
        let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
        let effect = Effect {
            id: found.effect.kind.clone(),
            channel: channel.to_owned(),
            selected: true,
            share: Some(share),
            parameters,
            reason: "it takes what a free form takes".into(),
            own: Some(Arc::clone(&found.effect)),
            port: Some(study.taps[tap].name.clone()),
            wiring: effects::wiring(study, &model, c),
            ..Effect::default()
        };
        let covered = found
            .axes
            .iter()
            .map(|axis| (axis.name.to_owned(), axis.range.0, axis.range.1, axis.unit.clone()))
            .collect();
        let word = |variable: &Variable| explain::word(study, tap, *variable).to_owned();
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
            toml: found.effect.to_toml(&values),
            effect,
        };
        Some(Outcome { law, model: Model { fit: own, ..model }, after })
    }

    /// Mean power of the law over its mean magnitude, along the records; none where no velocity is known.
    fn dissipation(&self, study: &Study, tap: usize, own: &Own, values: &[f64]) -> Option<f64> {
        study.taps[tap].signals[0]?;
        let mut z = vec![0.0; own.states.len()];
        let (mut sum, mut size) = (0.0, 0.0);
        for point in &self.trace[tap] {
            let at = [point.position, point.velocity, point.value, point.time];
            let power = own.value(at, &z, values) * point.velocity;
            (sum, size) = (sum + power, size + power.abs());
            own.advance(at, &mut z, values, study.records.first().map_or(1e-3, |record| record.step));
        }
        (size > 0.0 && sum.is_finite()).then_some(sum / size)
    }
}

/// A law, the model with it, its errors on estimation and validation records.
struct Outcome {
    law: Law,
    model: Model,
    after: [Errors; 2],
}

/// Pieces of which only this part of the beginning counts.
fn beginnings(pieces: &[Piece], part: f64) -> Vec<Piece> {
    let short = |piece: &Piece| {
        let n = ((piece.range.len() as f64 * part) as usize).max(16).min(piece.range.len());
        Piece { record: piece.record, range: piece.range.start..piece.range.start + n }
    };
    pieces.iter().map(short).collect()
}

/// What was chosen, before it is said.
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

/// Name of a variable in formulas.
fn name(variable: Variable) -> &'static str {
    match variable {
        Variable::Position => "x",
        Variable::Velocity => "v",
        Variable::Time => "t",
        _ => "f",
    }
}

/// Share of the error above its floor that is taken away; outputs in units of the declared model's error.
fn share(study: &Study, [before, after]: [&BTreeMap<String, f64>; 2], floor: &BTreeMap<String, f64>) -> f64 {
    let total = |rms: &BTreeMap<String, f64>| -> f64 {
        let one = |output: &crate::study::model::Output| {
            let [own, unit] = [rms, before].map(|e| e.get(&output.name).copied().unwrap_or(0.0));
            let floor = floor.get(&output.name).copied().unwrap_or(output.noise);
            if unit > 0.0 { (own * own - floor * floor).max(0.0) / (unit * unit) } else { 0.0 }
        };
        study.outputs.iter().map(one).sum::<f64>()
    };
    let (declared, law) = (total(before), total(after));
    if declared > 0.0 { 1.0 - (law / declared).sqrt() } else { 0.0 }
}

/// Kind of the port for its unit.
pub(super) fn port_word(unit: &str) -> &'static str {
    match unit {
        "N" => "force",
        "N.m" | "N*m" => "torque",
        _ => "flow",
    }
}

/// An effect of one's own from a formula; none where its units do not fit.
pub fn effect(text: &str, parameters: &[(String, String, f64)], units: &[String; 3]) -> Option<Arc<Own>> {
    let mut toml = format!(
        "kind = \"law\"\nport = {:?}\nformula = {text:?}\nwords = \"law found in the records\"\n[variables]\nx = {:?}\nv = {:?}\nf = {:?}\n[parameters]\n",
        port_word(&units[2]),
        units[0],
        units[1],
        units[2]
    );
    for (name, unit, value) in parameters {
        toml += &format!("{name} = {{ unit = {unit:?}, start = {value:?} }}\n");
    }
    let own = Own::read(&toml);
    own.ok().map(Arc::new)
}

/// The free form itself as a formula: a curve, or curves between curves for two variables.
pub fn curve_text(surface: &Surface, heights: &[f64], axes: &[Axis]) -> Option<String> {
    let points = |knots: &[f64], heights: Vec<String>, name: &str| {
        let own = knots.iter().zip(heights).map(|(x, y)| format!("{x:.6e}, {y}"));
        format!("curve({name}, {})", own.collect::<Vec<_>>().join(", "))
    };
    let number = |height: &f64| format!("{height:.6e}");
    let text = match &surface.knots[..] {
        [knots] => points(knots, heights.iter().map(number).collect(), axes[0].name),
        [first, second] => {
            let rows = heights.chunks(second.len());
            let rows = rows.map(|row| points(second, row.iter().map(number).collect(), axes[1].name));
            points(first, rows.collect(), axes[0].name)
        }
        _ => return None,
    };
    Some(format!("a*{text}"))
}
