//! The law at a port of a study: free form, formula, exact fits, the answer.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::formula::{self, PRICE};
use super::grammar::{Axis, product};
use super::surface::{Surface, knots};
use super::surrogate::Approach;
use crate::answer::{Answer, Effect, Errors, Parameter, Verdict};
use crate::engine::fit::Free;
use crate::engine::stop;
use crate::study::catalogue::{CHANNELS, Candidate};
use crate::study::declaration::{Attachment, Role};
use crate::study::errors::errors;
use crate::study::explain::Judge;
use crate::study::fits::{Fits, Model, pieces};
use crate::study::law::{Law as Block, Point, Variable};
use crate::study::model::{Action, Entry, Study, Target};
use crate::study::plant;
use crate::study::search::Say;
use crate::study::simulate::Piece;
use crate::vocabulary::Own;
use crate::vocabulary::own::Parameter as OwnParameter;

/// Share of what is left above noise that a free form has to take away for a law to be looked for.
const WORTH_A_LAW: f64 = 0.2;
/// Share of the free form's gain that a formula must reach to be named.
pub const OF_FREE_FORM: f64 = 0.95;
/// Share of the error on validation records below which a law is none.
const MIN_VALIDATED_SHARE: f64 = 0.05;
/// Share of what effects leave that a law may leave to take their place.
const MUCH_LESS: f64 = 0.5;
/// Share of a second variable in what one leaves, from which on both are needed.
const SECOND: f64 = 0.15;
/// Parts of the records, from their beginning, that a free form is brought to before the whole.
const PARTS: [f64; 2] = [0.1, 0.35];
/// Knots of a variable while variables are compared, of the one that is chosen, and of each of two.
const SCREENED: usize = 10;
const FINE: usize = 20;
const COARSE: usize = 6;
/// Weight of the gain of a form over the value that passes.
const DRIVING: f64 = 0.5;
/// Share of the best variable's gain from which on another is looked at closely.
const WORTH_TRYING: f64 = 0.5;
/// Steps of the free form towards its optimum.
const ROUNDS: usize = 3;
/// Formulas whose stability over parts of the records is asked for.
const JUDGED: usize = 3;
/// Error in rms of the noise from which on a law with a memory is tried.
const FAR: f64 = 1.5;
/// Ratio of the error of a law with a memory to the least without one, below which it is taken.
const MEMORY: f64 = 0.6;
/// Errors within this share of each other are equal.
const EQUAL: f64 = 0.03;

/// A law that was found at a port.
#[derive(Debug, Clone)]
pub struct Law {
    /// Input where it acts.
    pub port: String,
    /// Channel; empty where none is declared.
    pub channel: String,
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
struct FreeForm {
    tap: usize,
    surface: Surface,
    candidate: usize,
    at: Approach,
    /// Rms of the residuals.
    error: f64,
}

impl FreeForm {
    /// Place, height and half of the 95 % band at every knot; empty for two variables.
    fn curve(&self, residual: f64) -> Vec<[f64; 3]> {
        let [knots] = &self.surface.knots[..] else { return Vec::new() };
        let heights = self.at.smooth.heights.iter().zip(&self.at.smooth.deviation);
        knots.iter().zip(heights).map(|(x, (y, s))| [*x, *y, 1.96 * residual * s]).collect()
    }
}

struct Finder<'a> {
    attachments: &'a [Attachment],
    scale: &'a [f64],
    say: Say<'a>,
    /// Simulations with steps of second order, where they change the error of the declared model by next to nothing.
    quick: bool,
    /// What the attachments show, `[taps][n]`.
    trace: Vec<Vec<Point>>,
}

/// Puts a law into an answer that found nothing to name; the model with it, if there is one.
pub fn explain(
    study: &mut Study,
    attachments: &[Attachment],
    scale: &[f64],
    (judge, declared): (&Judge, &Model),
    found: &mut Answer,
    say: Say,
) -> Option<Model> {
    let partly = found.verdict == Verdict::Effect && !found.complete;
    if !(found.verdict == Verdict::Unexplained || partly) || stop::asked() {
        return None;
    }
    let (quick, trace) = {
        let fits = Fits::new(study, scale.to_vec());
        let view = fits.view(&[], &fits.pieces);
        let mut all: Vec<Vec<Point>> = vec![Vec::new(); study.taps.len()];
        for r in 0..fits.pieces.len() {
            let own = view.trace(r, &declared.fit.parameters, &declared.fit.locals[r]);
            all.iter_mut().zip(own).for_each(|(all, own)| all.extend(own));
        }
        (fits.quickened(declared).quick, all)
    };
    let finder = Finder { attachments, scale, say, quick, trace };
    let Outcome { law, model, after } = finder.find(study, judge, declared, found)?;
    // Effects of the list stay unless a law leaves much less than they do.
    if partly {
        let left = 1.0 - found.share.unwrap_or(0.0);
        if 1.0 - law.share > MUCH_LESS * left {
            return None;
        }
        for effect in found.effects.iter_mut().filter(|effect| effect.selected) {
            (effect.selected, effect.group) = (false, None);
            effect.reason = format!(
                "a law at {} leaves less than {:.0} % of the error that it leaves",
                law.port,
                100.0 * MUCH_LESS
            );
        }
    }
    found.notes.extend(told(&law));
    found.unexplained = Some((law.channel.clone(), law.variables.clone()));
    found.verdict = Verdict::Law;
    found.share = Some(law.share);
    found.law = Some(law);
    let fitted = study.entries[..study.declared].iter().zip(&model.fit.parameters);
    let fitted = fitted.filter(|(entry, _)| matches!(entry.target, Target::Declared(_)));
    found.fitted = fitted.map(|(entry, value)| (entry.name.clone(), *value)).collect();
    found.after = after;
    found.parameters[1].clone_from(&model.fit.parameters);
    Some(model)
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
fn extended(model: &Model, study: &Study) -> Model {
    let mut found = model.clone();
    let known = found.fit.parameters.len();
    found.fit.parameters.extend(study.entries[known..].iter().map(|entry| entry.start));
    found
}

fn push(study: &mut Study, action: Action, entries: Vec<Entry>, channel: &'static str, id: String) -> usize {
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
    fn fits<'s>(&self, study: &'s Study) -> Fits<'s> {
        Fits { quick: self.quick, ..Fits::new(study, self.scale.to_vec()) }
    }

    fn channel(&self, tap: usize) -> &'static str {
        let own = &self.attachments[tap].channels;
        CHANNELS.into_iter().find(|channel| own.first().is_some_and(|c| c == channel)).unwrap_or(CHANNELS[0])
    }

    fn unit(&self, study: &Study, tap: usize, variable: Variable) -> String {
        let own = &self.attachments[tap];
        let signal = match variable {
            Variable::Velocity => own.velocity.as_ref(),
            Variable::Position => own.position.as_ref(),
            Variable::Time => return "s".into(),
            _ => Some(&own.input),
        };
        signal.and_then(|name| plant::unit_of(&study.graph, name)).unwrap_or_else(|| "1".into())
    }

    fn axes(&self, study: &Study, tap: usize, surface: &Surface) -> Vec<Axis> {
        let axis = |(variable, knots): (&Variable, &Vec<f64>)| Axis {
            name: name(*variable),
            unit: self.unit(study, tap, *variable),
            range: (knots[0], knots[knots.len() - 1]),
        };
        surface.variables.iter().zip(&surface.knots).map(axis).collect()
    }

    /// Knots of a variable that moves at an attachment and is known there.
    fn knots(&self, study: &Study, tap: usize, variable: Variable, count: usize) -> Option<Vec<f64>> {
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
        for tap in 0..study.taps.len() {
            for variable in [Variable::Position, Variable::Velocity, Variable::Value, Variable::Time] {
                let count = if variable == Variable::Time { 16 } else { SCREENED };
                let Some(knots) = self.knots(study, tap, variable, count) else { continue };
                let surface = Surface { variables: vec![variable], knots: vec![knots] };
                if let Some(form) = self.form(study, declared, tap, surface) {
                    singles.push(form);
                }
            }
        }
        // The value that passes drives the motion, so that it seems to tell what the motion tells.
        let gain = |form: &FreeForm| {
            let drives = form.surface.variables == [Variable::Value];
            form.at.gain() * if drives { DRIVING } else { 1.0 }
        };
        singles.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        if std::env::var_os("LAW_TRACE").is_some() {
            for s in &singles {
                eprintln!(
                    "single {:?} without {} held {}",
                    s.surface.variables, s.at.smooth.without, s.at.smooth.held_out
                );
            }
        }
        let best = singles.first()?;
        let most = gain(best);
        let excess = judge.excess(declared) / declared.error.powi(2);
        let enough = |form: &FreeForm| gain(form) > WORTH_A_LAW * excess * form.at.smooth.without;
        let (tap, first) = (best.tap, best.surface.variables[0]);
        let mut forms: Vec<FreeForm> = Vec::new();
        for form in singles.iter().take(2).filter(|form| form.tap == tap) {
            if gain(form) < WORTH_TRYING * most {
                continue;
            }
            let variable = form.surface.variables[0];
            let count = if variable == Variable::Time { 30 } else { FINE };
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
            both.sort_by_key(|own| [x, v, Variable::Value].iter().position(|known| known == own).unwrap_or(3));
            if second != first && !combined.contains(&both) {
                combined.push(both);
            }
        }
        for variables in combined {
            if stop::asked() {
                continue;
            }
            let knots: Option<Vec<Vec<f64>>> =
                variables.iter().map(|own| self.knots(study, tap, *own, COARSE)).collect();
            let Some(knots) = knots else { continue };
            let surface = Surface { variables: variables.into(), knots };
            let left = forms.iter().map(|own| own.at.smooth.held_out).fold(f64::INFINITY, f64::min);
            let noise = judge.tolerated / declared.error.powi(2) * own_without(&forms);
            if left < 1.5 * noise {
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
        if std::env::var_os("LAW_TRACE").is_some() {
            for s in &forms {
                eprintln!(
                    "form {:?} without {} held {} error {} excess {excess}",
                    s.surface.variables, s.at.smooth.without, s.at.smooth.held_out, s.error
                );
            }
        }
        let left = forms.iter().map(|own| own.error).fold(declared.error, f64::min);
        if left > FAR * judge.tolerated.sqrt()
            && let Some((tap, model, own)) = self.memory(study, declared)
            && model.error < MEMORY * left
        {
            let (axes, variables) = (Vec::new(), vec![Variable::Velocity]);
            let (named, share, rivals) = (true, 1.0, Vec::new());
            let found =
                Found { tap, variables, curve: Vec::new(), effect: own, model, named, share, rivals, axes };
            return self.say_law(study, judge, declared, found, answer);
        }
        let least = forms.first()?.at.smooth.held_out;
        let simple = |form: &FreeForm| {
            form.surface.variables.len() == 1 && form.at.smooth.held_out < (1.0 + SECOND) * least
        };
        let at = forms.iter().position(simple).unwrap_or(0);
        let form = forms.swap_remove(at);
        if !enough(&form) {
            return None;
        }
        self.law(study, judge, declared, form, answer)
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
        let candidate = push(study, action, entries.collect(), self.channel(tap), "free form".to_owned());
        let base = extended(declared, study);
        let fits = self.fits(study);
        let step = fits.probe_step(&base, candidate)?;
        study.entries[first..first + count].iter_mut().for_each(|entry| entry.free.step = step);
        let fits = self.fits(study);
        let own: Vec<Free> = study.entries[first..first + count].iter().map(|entry| entry.free).collect();
        let (view, shared) =
            (fits.view(&[candidate], &beginnings(&fits.pieces, PARTS[1])), study.declared_free());
        let at = Approach::begin(&view, &surface, &base.fit.parameters, [&own, &shared], &base.fit.locals)?;
        Some(FreeForm { tap, surface, candidate, at, error: declared.error })
    }

    /// The free form at its optimum.
    fn towards(&self, study: &Study, form: FreeForm) -> Option<FreeForm> {
        let fits = self.fits(study);
        let own = study.candidates[form.candidate].entries.clone();
        let heights: Vec<Free> = own.map(|index| study.entries[index].free).collect();
        let shared = study.declared_free();
        let free = [&heights[..], &shared[..]];
        let whole = fits.view(&[form.candidate], &fits.pieces);
        // What leaves the declared model leaves it far behind at the end of a record: the beginning is understood first.
        let base = Approach::begin(&whole, &form.surface, &form.at.parameters, free, &form.at.locals)?;
        let without = base.smooth.without;
        let (mut p, mut locals) = (base.parameters, base.locals);
        for part in PARTS {
            let view = fits.view(&[form.candidate], &beginnings(&fits.pieces, part));
            let at = Approach::begin(&view, &form.surface, &p, free, &locals)?;
            let at = at.towards(&view, &form.surface, free, ROUNDS)?;
            (p, locals) = (at.parameters, at.locals);
        }
        let at = Approach::begin(&whole, &form.surface, &p, free, &locals)?;
        let mut at = at.towards(&whole, &form.surface, free, ROUNDS)?;
        at.smooth.without = without;
        let count: usize =
            fits.pieces.iter().map(|piece| piece.range.len()).sum::<usize>() * study.outputs.len();
        let error = (at.chi2 / count.max(1) as f64).sqrt();
        Some(FreeForm { at, error, ..form })
    }

    /// Formulas for a free form, fitted exactly; the law.
    fn law(
        &self,
        study: &mut Study,
        judge: &Judge,
        declared: &Model,
        form: FreeForm,
        answer: &Answer,
    ) -> Option<Outcome> {
        (self.say)("formulas for the free form");
        let axes = self.axes(study, form.tap, &form.surface);
        let list = formula::Search::new(&form.at.surrogate, &form.surface, &axes)
            .map_or(Vec::new(), |own| own.run());
        let unit = self.unit(study, form.tap, Variable::Value);
        let units = [Variable::Position, Variable::Velocity, Variable::Value]
            .map(|variable| self.unit(study, form.tap, variable));
        let gain = form.at.gain();
        let mut tried: Vec<(Model, Arc<Own>, f64, usize)> = Vec::new();
        (self.say)("exact fits of formulas");
        for own in &list {
            let share = (form.at.smooth.without - own.held_out) / gain;
            let (text, parameters) = own.formula.written(&axes, &unit);
            if std::env::var_os("LAW_TRACE").is_some() {
                eprintln!("formula {text} held {} share {share} {parameters:?}", own.held_out);
            }
            if share < OF_FREE_FORM || stop::asked() {
                continue;
            }
            let Some(effect) = effect(&text, &parameters, &units) else { continue };
            let values: Vec<f64> = effect
                .parameters
                .iter()
                .map(|p| parameters.iter().find(|own| own.0 == p.name).map_or(0.0, |own| own.2))
                .collect();
            let c = self.push_own(study, form.tap, &effect, &values);
            let mut p = self.longer(&form, study);
            study.candidates[form.candidate].entries.clone().for_each(|index| p[index] = 0.0);
            study.candidates[c].entries.clone().zip(&values).for_each(|(index, value)| p[index] = *value);
            let fits = self.fits(study);
            if let Some(model) = fits.fit_from(vec![c], &p, &form.at.locals) {
                if std::env::var_os("LAW_TRACE").is_some() {
                    eprintln!("   exact error {} (free form {})", model.error, form.error);
                }
                tried.push((model, effect, share, own.formula.complexity()));
            }
        }
        let power = |error: f64| error.powi(2);
        let ceiling = power(declared.error) - power(form.error);
        tried.retain(|(model, ..)| power(declared.error) - power(model.error) >= OF_FREE_FORM * ceiling);
        let rank = |own: &(Model, Arc<Own>, f64, usize)| own.0.error.ln() + PRICE * own.3 as f64;
        tried.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        let mut best: Option<(Model, Arc<Own>, f64)> = None;
        let mut rivals = Vec::new();
        for (model, effect, share, _) in tried.iter().take(JUDGED) {
            let fits = self.fits(study);
            let mut model = extended(model, study);
            fits.hold_back(&mut model);
            let stable =
                model.held_back.is_finite() && model.held_back < 1.5 * model.error.max(judge.power.sqrt());
            match &best {
                None if stable => best = Some((model, Arc::clone(effect), *share)),
                Some((own, ..)) if model.held_back < (1.0 + EQUAL) * own.held_back => {
                    rivals.push((effect.formula.clone(), *share));
                }
                _ => {}
            }
        }
        let named = best.is_some();
        let (model, effect, share) = match best {
            Some(own) => own,
            None => {
                let text = curve_text(&form.surface, &form.at.smooth.heights, &axes)?;
                let effect = effect(&text, &[("a".into(), "1".into(), 1.0)], &units)?;
                let c = self.push_own(study, form.tap, &effect, &[1.0]);
                let mut p = self.longer(&form, study);
                study.candidates[form.candidate].entries.clone().for_each(|index| p[index] = 0.0);
                p[study.candidates[c].entries.start] = 1.0;
                let fits = self.fits(study);
                (fits.fit_from(vec![c], &p, &form.at.locals)?, effect, 1.0)
            }
        };
        let found = Found {
            tap: form.tap,
            variables: form.surface.variables.clone(),
            curve: form.curve(model.error.max(judge.power.sqrt())),
            effect,
            model,
            named,
            share,
            rivals,
            axes,
        };
        self.say_law(study, judge, declared, found, answer)
    }

    /// The best law with a memory, at any attachment whose motion is known.
    fn memory(&self, study: &mut Study, declared: &Model) -> Option<(usize, Model, Arc<Own>)> {
        (self.say)("laws with a memory");
        let mut best: Option<(usize, Model, Arc<Own>)> = None;
        for tap in 0..study.taps.len() {
            let units = [Variable::Position, Variable::Velocity, Variable::Value]
                .map(|variable| self.unit(study, tap, variable));
            let Some(places) = self.knots(study, tap, Variable::Velocity, FINE) else { continue };
            let fastest = places.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            let travel = self
                .knots(study, tap, Variable::Position, FINE)
                .map_or(0.1 * fastest, |own| own[own.len() - 1] - own[0]);
            let stiffness = product(&[(&units[2], 1), (&units[1], -1), ("s", -1)]);
            let length = product(&[(&units[1], 1), ("s", 1)]);
            let times = [0.05, 0.3, 1.5].to_vec();
            let lengths = [0.01, 0.05, 0.25].map(|part| part * travel).to_vec();
            for (rate, unit, starts) in
                [("v - z/s", "s".to_owned(), times), ("v - abs(v)*z/s", length, lengths)]
            {
                let toml = format!(
                    "kind = \"law\"\nport = {:?}\nformula = \"k*z\"\nwords = \"law with a memory\"\n[variables]\nx = {:?}\nv = {:?}\nf = {:?}\n[states]\nz = {rate:?}\n[parameters]\nk = {{ unit = {stiffness:?} }}\ns = {{ unit = {unit:?}, start = {starts:?} }}\n",
                    port_word(&units[2]),
                    units[0],
                    units[1],
                    units[2]
                );
                let Ok(own) = Own::read(&toml).map(Arc::new) else { continue };
                let c = self.push_own(study, tap, &own, &[1.0, starts[1]]);
                study.candidates[c].starts = own.starts();
                let base = extended(declared, study);
                for index in study.candidates[c].entries.clone() {
                    let step = self.fits(study).step(&base, c, index);
                    study.entries[index].free.step = step.unwrap_or(1e-6);
                    let first = study.candidates[c].entries.start;
                    if own.parameters[index - first].name == "s" {
                        let (least, most) = (starts[0], starts[starts.len() - 1]);
                        study.entries[index].free.bounds = (0.05 * least, 20.0 * most);
                    }
                }
                let found = self.fits(study).add(&base, c);
                if std::env::var_os("LAW_TRACE").is_some() {
                    eprintln!("memory {rate} error {:?}", found.as_ref().map(|own| own.error));
                }
                let better = |own: &Model| best.as_ref().is_none_or(|known| own.error < known.1.error);
                if let Some(model) = found.filter(better) {
                    best = Some((tap, model, own));
                }
            }
        }
        best
    }

    /// Parameter vector of a free form, as long as there are entries.
    fn longer(&self, form: &FreeForm, study: &Study) -> Vec<f64> {
        let mut p = form.at.parameters.clone();
        let known = p.len();
        p.extend(study.entries[known..].iter().map(|entry| entry.start));
        p
    }

    fn push_own(&self, study: &mut Study, tap: usize, own: &Arc<Own>, values: &[f64]) -> usize {
        study.own.push(Arc::clone(own));
        let index = study.own.len() - 1;
        let first = study.entries.len();
        let entry = |(k, (p, value)): (usize, (&OwnParameter, &f64))| {
            let step = 1e-4 * value.abs().max(1e-9);
            let free = Free { index: first + k, bounds: p.bounds, step, prior: None };
            let name = format!("{} {}", own.kind, p.name);
            Entry { name, unit: p.unit.clone(), target: Target::Effect, start: 0.0, free }
        };
        let entries = own.parameters.iter().zip(values).enumerate().map(entry).collect();
        let action = Action::Block { law: Block::Own(index), tap };
        push(study, action, entries, self.channel(tap), own.kind.clone())
    }

    fn say_law(
        &self,
        study: &Study,
        judge: &Judge,
        declared: &Model,
        found: Found,
        answer: &Answer,
    ) -> Option<Outcome> {
        let fits = Fits::new(study, self.scale.to_vec());
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
        if std::env::var_os("LAW_TRACE").is_some() {
            eprintln!("validation share {share} {:?} -> {:?}", answer.before[1].rms, after[1].rms);
        }
        let gained = 1.0 - model.error / declared.error;
        if !(share >= MIN_VALIDATED_SHARE && share > 0.5 * gained) {
            return None;
        }
        let tap = found.tap;
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
            channel: self.channel(tap).to_owned(),
            selected: true,
            share: Some(share),
            parameters,
            reason: "it takes what a free form takes".into(),
            own: Some(Arc::clone(&found.effect)),
            ..Effect::default()
        };
        let covered = found
            .axes
            .iter()
            .map(|axis| (axis.name.to_owned(), axis.range.0, axis.range.1, axis.unit.clone()))
            .collect();
        let angular = study.taps[tap].angular;
        let word = |variable: &Variable| match (variable, angular) {
            (Variable::Velocity, false) => "xdot",
            (Variable::Velocity, true) => "thetadot",
            (Variable::Position, false) => "x",
            (Variable::Position, true) => "theta",
            (Variable::Time, _) => "time",
            _ => "F",
        };
        let law = Law {
            port: study.taps[tap].name.clone(),
            channel: self.channel(tap).to_owned(),
            variables: found.variables.iter().map(|own| word(own).to_owned()).collect(),
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
struct Found {
    tap: usize,
    variables: Vec<Variable>,
    curve: Vec<[f64; 3]>,
    effect: Arc<Own>,
    model: Model,
    named: bool,
    share: f64,
    rivals: Vec<(String, f64)>,
    axes: Vec<Axis>,
}

/// Largest held-out error without a form.
fn own_without(forms: &[FreeForm]) -> f64 {
    forms.iter().map(|own| own.at.smooth.without).fold(0.0, f64::max)
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
fn port_word(unit: &str) -> &'static str {
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
    if std::env::var_os("LAW_TRACE").is_some()
        && let Err(e) = &own
    {
        eprintln!("not an effect: {e}\n{toml}");
    }
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
