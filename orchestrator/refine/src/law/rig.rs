//! The law at a place of the rig, in windowed predictions.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::exact::MIN_SHARE_OF_FREE_FORM;
use super::formula::{self, PRICE_PER_COMPLEXITY};
use super::found::{self, Law};
use super::grammar::Axis;
use super::rig_whole::Whole;
use super::surface::{Surface, knots};
use super::surrogate::Approach;
use super::written::{curve_text, effect, name};
use crate::answer::{Answer, Correction, Parameter, Verdict};
use crate::engine::fit::{Fit, Free, fit};
use crate::engine::held_out::HeldOut;
use crate::engine::noise::Noise;
use crate::engine::system::{Job, Span};
use crate::engine::{System, stop};
use crate::order::ascending;
use crate::rig::coupled::Coupled;
use crate::rig::extra::{Extra, Form, Place};
use crate::rig::open::Rig;
use crate::rig::parameters::TABLE;
use crate::study::law::{Point, Variable};
use crate::vocabulary::Own;

/// Difference steps of heights: of forces \[N\] and torques \[N m\].
const STEPS: [f64; 2] = [0.05, 1e-3];
/// Share of the declared model's error that the free form has to take away on held-out parts.
const MIN_SHARE_OF_ERROR: f64 = 0.1;
/// Share of the error on validation records below which a law is none: one over the motion of cart or pole, and any
/// other that leaves more than noise. What is left has many small causes, of which anything in time takes some.
const MIN_VALIDATED_SHARE: f64 = 0.05;
const MIN_VALIDATED_SHARE_OF_WIDE: f64 = 0.75;
/// Share of a second variable in what one leaves, from which on both are needed.
const MIN_SHARE_OF_SECOND_VARIABLE: f64 = 0.1;
/// Steps of the free form toward its optimum.
const ROUNDS: usize = 3;
/// Samples over which the velocity is taken.
const VELOCITY_SAMPLES: usize = 8;
/// Samples from one point to the next at which the motion is looked at.
const EVERY: usize = 4;
/// Free forms whose laws are fitted, and formulas of each.
const FORMS: usize = 3;
const FITTED_FORMULAS: usize = 4;
/// Mean square of the residuals of the best form over one variable, in units of the noise, below which none over two is
/// tried.
const MAX_ERROR_WITHOUT_SECOND: f64 = 1.02;

/// Variables over which free forms are tried at a place: alone, and two of them.
fn variables(place: Place) -> (&'static [Variable], &'static [[Variable; 2]]) {
    use Variable::{Position, Time, Value, Velocity};
    match place {
        Place::Command => (&[Value], &[]),
        Place::Force => (&[Time, Position, Velocity], &[]),
        _ => (&[Position, Velocity, Time], &[[Position, Velocity], [Time, Velocity]]),
    }
}

/// Places of a channel.
fn places(channel: &str) -> &'static [Place] {
    match channel {
        "actuator" => &[Place::Force, Place::Command],
        "piston_friction" => &[Place::Piston],
        "cart" | "cart_friction" => &[Place::Cart],
        "pole" => &[Place::Pole],
        _ => &[],
    }
}

/// Knots along a variable, alone and as one of two: bumps along the way and ripples of a command are narrow, and
/// friction in time changes slowly.
fn count(variable: Variable, alone: bool) -> usize {
    match (variable, alone) {
        (Variable::Value, _) => 60,
        (Variable::Time, true) => 30,
        (Variable::Position, true) => 32,
        (_, true) => 20,
        (Variable::Position, false) => 16,
        (Variable::Velocity, false) => 6,
        (_, false) => 8,
    }
}

/// Some records of a system.
pub(super) struct Subset<'a> {
    pub(super) system: &'a Coupled,
    pub(super) records: Vec<usize>,
}

impl System for Subset<'_> {
    fn records(&self) -> usize {
        self.records.len()
    }
    fn estimation(&self, _: usize) -> bool {
        true
    }
    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        self.system.locals(self.records[record])
    }
    fn signals(&self, record: usize) -> Vec<Span> {
        self.system.signals(self.records[record])
    }
    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.system.predict(self.records[record], parameters, locals)
    }
    fn measured(&self, record: usize) -> Vec<f64> {
        self.system.measured(self.records[record])
    }
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.system.whiten(self.records[record], predicted)
    }
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        self.system.redraw(self.records[record], predicted, noise)
    }
    fn side_by_side(&self) -> usize {
        self.system.side_by_side()
    }
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        let own = |job: &Job| Job { record: self.records[job.record], ..job.clone() };
        self.system.residuals_of(&jobs.iter().map(own).collect::<Vec<_>>())
    }
}

/// A free form of one or two variables.
struct FreeForm {
    place: Place,
    surface: Surface,
    at: Approach,
}

struct Finder<'a> {
    windowed: Coupled,
    records: Vec<usize>,
    channel: &'a str,
    base: Vec<f64>,
    shared: Vec<Free>,
    /// Measured motion, command and time of the estimation records.
    motion: Vec<Point>,
    units: &'a BTreeMap<String, f64>,
}

/// A law with the parameter vector of the rig behind it, and the errors with both: estimation, validation.
struct Outcome {
    law: Law,
    fit: Fit,
    whole: Whole,
}

/// Puts a law into an answer that found nothing to name; whether there is one. `units`: those in which errors of
/// signals are compared; `corrected`: parameters that may be off by their tolerances.
pub fn explain(rig: &Rig, units: &BTreeMap<String, f64>, corrected: &[Free], found: &mut Answer) -> bool {
    let Some(coupled) = &rig.coupled else { return false };
    let channel = found.unexplained.as_ref().map(|own| own.0.clone()).unwrap_or_default();
    let unknown = places(&channel).is_empty();
    if found.verdict != Verdict::Unexplained || found.cylinder || unknown || stop::asked() {
        return false;
    }
    rig.system.stage("law of what is left");
    let windowed = coupled.windowed();
    let records: Vec<usize> = (0..windowed.records()).filter(|&r| windowed.estimation(r)).collect();
    let base = found.parameters[1].clone();
    if base.len() != TABLE.len() || records.len() < 2 {
        return false;
    }
    let shared = corrected.iter().filter(|free| base[free.index] != 0.0).copied().collect();
    let motion = motion(&windowed, &records, channel == "pole");
    let finder = Finder { windowed, records, channel: &channel, base, shared, motion, units };
    let Some(Outcome { law, fit, whole }) = finder.find(found) else { return false };
    found.notes.extend(found::told(&law));
    found.notes.extend(whole.contradictions(found));
    found.unexplained = Some((channel, law.variables.clone()));
    found.verdict = Verdict::Law;
    found.share = Some(law.share);
    found.corrections = corrections(rig, &fit, &found.corrections);
    found.parameters[1] = fit.parameters[..TABLE.len()].to_vec();
    (found.left[1], found.complete, found.after) = (whole.left, whole.complete, whole.errors);
    found.law = Some(law);
    true
}

/// The corrections of an answer with the values that they have beside a law.
fn corrections(rig: &Rig, fit: &Fit, before: &[Correction]) -> Vec<Correction> {
    let one = |known: &Correction| {
        let own = rig.corrections.iter().find(|own| {
            (own.component(), own.parameter()) == (known.component.as_str(), known.parameter.as_str())
        })?;
        let place = fit.free.iter().position(|free| free.index == own.entry.index)?;
        let deviation = fit.covariance[(place, place)].max(0.0).sqrt();
        let found = Correction::new(own, fit.parameters[own.entry.index], deviation);
        Some(Correction { tolerance: known.tolerance, ..found })
    };
    before.iter().map(|known| one(known).unwrap_or_else(|| known.clone())).collect()
}

/// The rig with the law of an answer, and the parameter vector of both; none without a law.
pub fn with_law(rig: &Rig, answer: &Answer) -> Option<(Coupled, Vec<f64>)> {
    let law = answer.law.as_ref()?;
    let (own, place) = (law.effect.own.clone()?, Place::at(&law.port)?);
    let extra = Some(Arc::new(Extra { place, form: Form::Formula(own) }));
    let values = law.effect.parameters.iter().map(|p| p.value);
    let p = answer.parameters[1].iter().copied().chain(values).collect();
    Some((Coupled { extra, ..rig.coupled.clone()? }, p))
}

/// Measured positions or angles with their velocities, commands and times.
fn motion(windowed: &Coupled, records: &[usize], pole: bool) -> Vec<Point> {
    let (name, dt) = (if pole { "theta" } else { "x" }, windowed.actuator.sample_time);
    let mut found = Vec::new();
    for &record in records {
        let trial = &windowed.trials[record];
        let measured = trial.measured.iter().find(|own| own.name == name);
        let values = measured.map_or(&[][..], |own| &own.values[..]);
        for k in (VELOCITY_SAMPLES..values.len().saturating_sub(VELOCITY_SAMPLES)).step_by(EVERY) {
            let covered = values[k + VELOCITY_SAMPLES] - values[k - VELOCITY_SAMPLES];
            found.push(Point {
                position: values[k],
                velocity: covered / (2.0 * VELOCITY_SAMPLES as f64 * dt),
                value: trial.u[k],
                time: k as f64 * dt,
                ..Point::default()
            });
        }
    }
    found
}

impl Finder<'_> {
    /// The rig with a law.
    fn with(&self, place: Place, form: Form) -> Coupled {
        Coupled { extra: Some(Arc::new(Extra { place, form })), ..self.windowed.clone() }
    }

    fn heights(&self, place: Place, count: usize) -> Vec<Free> {
        let step = STEPS[usize::from(place == Place::Pole)];
        let bounds = (f64::NEG_INFINITY, f64::INFINITY);
        (0..count).map(|k| Free { index: TABLE.len() + k, bounds, step, prior: None }).collect()
    }

    fn knots(&self, variable: Variable, count: usize) -> Option<Vec<f64>> {
        let values: Vec<f64> = self.motion.iter().map(|point| point.of(variable)).collect();
        knots(variable, &values, count)
    }

    fn form(&self, place: Place, variables: &[Variable], rounds: usize) -> Option<FreeForm> {
        if stop::asked() {
            return None;
        }
        let alone = variables.len() == 1;
        let knots: Option<Vec<Vec<f64>>> =
            variables.iter().map(|own| self.knots(*own, count(*own, alone))).collect();
        let surface = Surface::new(variables.to_vec(), knots?);
        let rig = self.with(place, Form::Surface(surface.clone()));
        let system = Subset { system: &rig, records: self.records.clone() };
        let heights = self.heights(place, surface.heights());
        let p = [&self.base[..], &vec![0.0; heights.len()]].concat();
        let locals = vec![Vec::new(); self.records.len()];
        let free = [&heights[..], &self.shared[..]];
        let at = Approach::begin(&system, &surface, &p, free, &locals, None, None)?;
        let at = if rounds > 0 { at.toward(&system, &surface, free, rounds)? } else { at };
        Some(FreeForm { place, surface, at })
    }

    /// Units of position, velocity and of the value that is taken off.
    fn units(place: Place) -> [String; 3] {
        let units = if place == Place::Pole { ["rad", "rad/s", "N.m"] } else { ["m", "m/s", "N"] };
        units.map(str::to_owned)
    }

    fn axes(form: &FreeForm) -> Vec<Axis> {
        let [x, v, f] = Self::units(form.place);
        let axis = |(variable, knots): (&Variable, &Vec<f64>)| {
            let unit = match variable {
                Variable::Velocity => v.clone(),
                Variable::Time => "s".to_owned(),
                Variable::Position => x.clone(),
                _ => f.clone(),
            };
            let range = (knots[0], knots[knots.len() - 1]);
            Axis { name: name(*variable), unit, range }
        };
        form.surface.variables.iter().zip(&form.surface.knots).map(axis).collect()
    }

    fn find(&self, answer: &mut Answer) -> Option<Outcome> {
        let mut forms: Vec<FreeForm> = Vec::new();
        for &place in places(self.channel) {
            let alone = variables(place).0;
            forms.extend(alone.iter().filter_map(|own| self.form(place, &[*own], ROUNDS)));
        }
        let samples: usize =
            self.records.iter().map(|&r| self.windowed.signals(r).last().map_or(0, |s| s.range.end)).sum();
        let held_out = |form: &FreeForm| form.at.smooth.held_out;
        let least = forms.iter().map(held_out).fold(f64::INFINITY, f64::min);
        if least > MAX_ERROR_WITHOUT_SECOND * samples as f64 {
            for &place in places(self.channel) {
                forms.extend(variables(place).1.iter().filter_map(|both| self.form(place, both, 2)));
            }
        }
        ascending(&mut forms, held_out);
        // What something in time or over two variables does not explain, a simpler law may.
        let mut best: Option<Outcome> = None;
        for _ in 0..FORMS {
            let Some(at) = Self::simplest(&forms).filter(|_| !stop::asked()) else { break };
            let form = forms.remove(at);
            if form.at.gain() < MIN_SHARE_OF_ERROR * form.at.smooth.without {
                break;
            }
            let Some(found) = self.law(&form, answer) else { continue };
            let better = |known: &Outcome| {
                let formula = (found.law.named, found.whole.complete);
                formula > (known.law.named, known.whole.complete)
                    || formula == (known.law.named, known.whole.complete) && found.law.share > known.law.share
            };
            let complete = found.whole.complete && found.law.named;
            if best.as_ref().is_none_or(better) {
                best = Some(found);
            }
            if complete {
                break;
            }
        }
        best
    }

    /// The best form over one variable where two leave little less, else the best, of forms in the order of what they
    /// leave: its place.
    fn simplest(forms: &[FreeForm]) -> Option<usize> {
        let least = forms.first()?.at.smooth.held_out;
        let simple = |form: &&FreeForm| {
            form.surface.variables.len() == 1
                && form.at.smooth.held_out < (1.0 + MIN_SHARE_OF_SECOND_VARIABLE) * least
        };
        Some(forms.iter().position(|form| simple(&form)).unwrap_or(0))
    }

    /// The formula of a free form, or its curve.
    fn law(&self, form: &FreeForm, answer: &mut Answer) -> Option<Outcome> {
        let (axes, units) = (Self::axes(form), Self::units(form.place));
        let list =
            formula::Search::new(&form.at.surrogate, &form.surface, &axes).map_or(Vec::new(), |s| s.run());
        let mut tried: Vec<(Fit, Arc<Own>, f64, usize)> = Vec::new();
        for own in &list {
            let share = (form.at.smooth.without - own.held_out) / form.at.gain();
            let (text, parameters) = own.formula.written(&axes, &units[2]);
            if share < MIN_SHARE_OF_FREE_FORM || tried.len() >= FITTED_FORMULAS || stop::asked() {
                continue;
            }
            let Some(effect) = effect(&text, &parameters, &units, 1.0) else { continue };
            let values: Vec<f64> = effect
                .parameters
                .iter()
                .map(|p| parameters.iter().find(|own| own.0 == p.name).map_or(0.0, |own| own.2))
                .collect();
            tried.push((self.fit(form, &effect, &values), effect, share, own.formula.complexity()));
        }
        let ceiling = form.at.smooth.without - form.at.chi2;
        tried.retain(|(fit, ..)| form.at.smooth.without - fit.chi2 >= MIN_SHARE_OF_FREE_FORM * ceiling);
        let rank =
            |own: &(Fit, Arc<Own>, f64, usize)| 0.5 * own.0.chi2.ln() + PRICE_PER_COMPLEXITY * own.3 as f64;
        ascending(&mut tried, rank);
        let named = !tried.is_empty();
        let rivals: Vec<(String, f64)> = tried
            .iter()
            .skip(1)
            .filter(|own| own.0.chi2 < 1.06 * tried[0].0.chi2)
            .map(|own| (own.1.formula.clone(), own.2))
            .collect();
        if named {
            // One that whole records refuse gives way to the next.
            let mut rest = tried.into_iter();
            return rest.find_map(|(fit, own, share, _)| {
                self.say((form, fit, &own), (named, share, rivals.clone()), axes.clone(), answer)
            });
        }
        let text = curve_text(&form.surface, &form.at.smooth.heights, &axes)?;
        let own = effect(&text, &[("a".into(), "1".into(), 1.0)], &units, 1.0)?;
        let best = self.fit(form, &own, &[1.0]);
        self.say((form, best, &own), (named, 1.0, rivals), axes, answer)
    }

    /// A formula fitted beside the corrections, from the optimum of the free form.
    fn fit(&self, form: &FreeForm, own: &Arc<Own>, values: &[f64]) -> Fit {
        let rig = self.with(form.place, Form::Formula(Arc::clone(own)));
        let system = Subset { system: &rig, records: self.records.clone() };
        let p = [&form.at.parameters[..TABLE.len()], values].concat();
        let free = own.parameters.iter().zip(values).enumerate().map(|(k, (parameter, value))| Free {
            index: TABLE.len() + k,
            bounds: parameter.bounds,
            step: 1e-3 * value.abs().max(1e-6),
            prior: None,
        });
        let free: Vec<Free> = self.shared.iter().copied().chain(free).collect();
        let records: Vec<usize> = (0..self.records.len()).collect();
        fit(&system, &records, &p, &free, &vec![Vec::new(); records.len()], 10)
    }

    fn say(
        &self,
        (form, best, own): (&FreeForm, Fit, &Arc<Own>),
        (named, of_free_form, rivals): (bool, f64, Vec<(String, f64)>),
        axes: Vec<Axis>,
        answer: &mut Answer,
    ) -> Option<Outcome> {
        let rig = self.with(form.place, Form::Formula(Arc::clone(own)));
        let validation: Vec<usize> = (0..rig.records()).filter(|&r| !rig.estimation(r)).collect();
        let error = |system: &Coupled, p: &[f64]| HeldOut::new(system, self.units).error(p, &validation);
        let before = error(&self.windowed, &self.base).max(f64::MIN_POSITIVE);
        let whole = Whole::new(&rig, &self.records, &best);
        let (best, widen) = match &whole.exact {
            // What leaves noise over whole records is known best from these.
            Some(exact) => (exact.clone(), 1.0),
            None => {
                let samples = |&r: &usize| rig.signals(r).last().map_or(0, |span| span.range.end);
                let samples: usize = self.records.iter().map(samples).sum();
                let widen = (best.chi2 / samples.max(1) as f64).sqrt().max(1.0);
                (best, widen)
            }
        };
        let after = error(&rig, &best.parameters);
        // What a law leaves that explains the records to the noise is the noise of the states that windows begin with.
        let share = if whole.complete && after < before { 1.0 } else { 1.0 - after / before };
        let over_motion = matches!(form.place, Place::Cart | Place::Pole)
            && !form.surface.variables.contains(&Variable::Time);
        let least = if over_motion { MIN_VALIDATED_SHARE } else { MIN_VALIDATED_SHARE_OF_WIDE };
        if share.is_nan() || share < least {
            return None;
        }
        if let Some(against) = whole.refuses(&answer.before[1]) {
            let note = format!(
                "A law over {} at {} takes away {:.0} % of the error of windowed predictions, but {against}: it is none.",
                form.surface.variables.iter().map(|own| self.word(*own)).collect::<Vec<_>>().join(" and "),
                form.place.port(),
                100.0 * share,
            );
            if !answer.notes.contains(&note) {
                answer.notes.push(note);
            }
            return None;
        }
        let values = &best.parameters[TABLE.len()..];
        let known = values.iter().enumerate().map(|(k, value)| {
            let place = best.free.iter().position(|free| free.index == TABLE.len() + k).unwrap_or(0);
            (*value, 1.96 * widen * best.covariance[(place, place)].max(0.0).sqrt())
        });
        let parameters: Vec<Parameter> = found::parameters(own, known).collect();
        let dissipation = if form.place == Place::Command {
            None
        } else {
            let power = |at: &Point| own.value(at.variables(), &[], values) * at.velocity;
            found::dissipation(self.motion.iter().map(power))
        };
        let law = Law {
            place: self.channel.to_owned(),
            port: form.place.port().into(),
            channel: self.channel.to_owned(),
            variables: form.surface.variables.iter().map(|own| self.word(*own).to_owned()).collect(),
            curve: form.at.curve(&form.surface, widen),
            named,
            of_free_form,
            share,
            rivals,
            covered: axes.into_iter().map(|a| (a.name.to_owned(), a.range.0, a.range.1, a.unit)).collect(),
            dissipation,
            toml: own.to_toml(values),
            effect: found::as_effect(own, self.channel, share, parameters),
        };
        Some(Outcome { law, fit: best, whole })
    }

    /// A variable in the words of the vocabulary.
    fn word(&self, variable: Variable) -> &'static str {
        match (variable, self.channel == "pole") {
            (Variable::Velocity, false) => "xdot",
            (Variable::Velocity, true) => "thetadot",
            (Variable::Time, _) => "time",
            (Variable::Value, _) => "u",
            (_, false) => "x",
            (_, true) => "theta",
        }
    }
}
