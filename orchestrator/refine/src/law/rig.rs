//! The law at the cart or at the pole of the rig, in windowed predictions.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::exact::MIN_SHARE_OF_FREE_FORM;
use super::formula::{self, PRICE};
use super::found::{self, Law};
use super::grammar::Axis;
use super::surface::{Surface, knots};
use super::surrogate::Approach;
use super::written::{curve_text, effect};
use crate::answer::{Answer, Parameter, Verdict};
use crate::engine::fit::{Fit, Free, fit};
use crate::engine::held_out::HeldOut;
use crate::engine::noise::Noise;
use crate::engine::system::{Job, Span};
use crate::engine::{System, stop};
use crate::rig::coupled::Coupled;
use crate::rig::extra::{Extra, Form};
use crate::rig::open::Rig;
use crate::rig::parameters::TABLE;
use crate::rig::port;
use crate::study::law::Variable;
use crate::vocabulary::Own;

/// Difference steps of heights: of forces \[N\] and torques \[N m\].
const STEPS: [f64; 2] = [0.05, 1e-3];
/// Share of the declared model's error that the free form has to take away on held-out parts.
const MIN_SHARE_OF_ERROR: f64 = 0.1;
/// Share of the error on validation records below which a law is none.
const MIN_VALIDATED_SHARE: f64 = 0.05;
/// Share of a second variable in what one leaves, from which on both are needed.
const MIN_SHARE_OF_SECOND_VARIABLE: f64 = 0.1;
/// Steps of the free form toward its optimum.
const ROUNDS: usize = 3;
/// Samples over which the velocity is taken.
const VELOCITY_SAMPLES: usize = 8;

/// Some records of a system.
struct Subset<'a> {
    system: &'a Coupled,
    records: Vec<usize>,
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
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        let own = |job: &Job| Job { record: self.records[job.record], ..job.clone() };
        self.system.residuals_of(&jobs.iter().map(own).collect::<Vec<_>>())
    }
}

/// A free form of one or two variables.
struct FreeForm {
    surface: Surface,
    at: Approach,
}

struct Finder<'a> {
    windowed: Coupled,
    records: Vec<usize>,
    pole: bool,
    base: Vec<f64>,
    shared: Vec<Free>,
    /// Positions and velocities of the estimation records.
    motion: [Vec<f64>; 2],
    units: &'a BTreeMap<String, f64>,
}

/// Puts a law into an answer that found nothing to name; whether there is one. `units`: those in which errors of
/// signals are compared; `corrected`: parameters that may be off by their tolerances.
pub fn explain(rig: &Rig, units: &BTreeMap<String, f64>, corrected: &[Free], found: &mut Answer) -> bool {
    let Some(coupled) = &rig.coupled else { return false };
    let channel = found.unexplained.as_ref().map(|own| own.0.clone()).unwrap_or_default();
    let pole = channel == "pole";
    let mechanics = pole || channel == "cart" || channel == "cart_friction";
    if found.verdict != Verdict::Unexplained || found.cylinder || !mechanics || stop::asked() {
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
    let motion = motion(&windowed, &records, pole);
    let finder = Finder { windowed, records, pole, base, shared, motion, units };
    let Some(law) = finder.find(&channel, found) else { return false };
    found.notes.extend(found::told(&law));
    found.unexplained = Some((channel, law.variables.clone()));
    found.verdict = Verdict::Law;
    found.share = Some(law.share);
    found.law = Some(law);
    true
}

/// Measured positions or angles with their velocities.
fn motion(windowed: &Coupled, records: &[usize], pole: bool) -> [Vec<f64>; 2] {
    let (name, dt) = (if pole { "theta" } else { "x" }, windowed.actuator.sample_time);
    let (mut positions, mut velocities) = (Vec::new(), Vec::new());
    for &record in records {
        let measured = windowed.trials[record].measured.iter().find(|own| own.name == name);
        let values = measured.map_or(&[][..], |own| &own.values[..]);
        for k in (VELOCITY_SAMPLES..values.len().saturating_sub(VELOCITY_SAMPLES)).step_by(4) {
            positions.push(values[k]);
            velocities.push(
                (values[k + VELOCITY_SAMPLES] - values[k - VELOCITY_SAMPLES])
                    / (2.0 * VELOCITY_SAMPLES as f64 * dt),
            );
        }
    }
    [positions, velocities]
}

impl Finder<'_> {
    /// The rig with a law.
    fn with(&self, form: Form) -> Coupled {
        Coupled { extra: Some(Arc::new(Extra { pole: self.pole, form })), ..self.windowed.clone() }
    }

    fn heights(&self, count: usize) -> Vec<Free> {
        let step = STEPS[usize::from(self.pole)];
        let bounds = (f64::NEG_INFINITY, f64::INFINITY);
        (0..count).map(|k| Free { index: TABLE.len() + k, bounds, step, prior: None }).collect()
    }

    fn knots(&self, variable: Variable, count: usize) -> Option<Vec<f64>> {
        knots(variable, &self.motion[usize::from(variable == Variable::Velocity)], count)
    }

    fn form(&self, variables: &[Variable], count: usize, rounds: usize) -> Option<FreeForm> {
        let knots: Option<Vec<Vec<f64>>> = variables.iter().map(|own| self.knots(*own, count)).collect();
        let surface = Surface { variables: variables.to_vec(), knots: knots? };
        let rig = self.with(Form::Surface(surface.clone()));
        let system = Subset { system: &rig, records: self.records.clone() };
        let heights = self.heights(surface.heights());
        let p = [&self.base[..], &vec![0.0; heights.len()]].concat();
        let locals = vec![Vec::new(); self.records.len()];
        let free = [&heights[..], &self.shared[..]];
        let at = Approach::begin(&system, &surface, &p, free, &locals, None)?;
        let at = if rounds > 0 { at.towards(&system, &surface, free, rounds)? } else { at };
        Some(FreeForm { surface, at })
    }

    fn axes(&self, surface: &Surface) -> Vec<Axis> {
        let axis = |(variable, knots): (&Variable, &Vec<f64>)| {
            let velocity = *variable == Variable::Velocity;
            let unit = match (self.pole, velocity) {
                (false, false) => "m",
                (false, true) => "m/s",
                (true, false) => "rad",
                (true, true) => "rad/s",
            };
            let name = if velocity { "v" } else { "x" };
            Axis { name, unit: unit.into(), range: (knots[0], knots[knots.len() - 1]) }
        };
        surface.variables.iter().zip(&surface.knots).map(axis).collect()
    }

    fn find(&self, channel: &str, answer: &mut Answer) -> Option<Law> {
        let (x, v) = (Variable::Position, Variable::Velocity);
        let mut forms: Vec<FreeForm> =
            [x, v].iter().filter_map(|own| self.form(&[*own], 20, ROUNDS)).collect();
        forms.extend(self.form(&[x, v], 7, 2));
        forms.sort_by(|a, b| a.at.smooth.held_out.total_cmp(&b.at.smooth.held_out));
        let least = forms.first()?.at.smooth.held_out;
        let simple = |form: &FreeForm| {
            form.surface.variables.len() == 1
                && form.at.smooth.held_out < (1.0 + MIN_SHARE_OF_SECOND_VARIABLE) * least
        };
        let at = forms.iter().position(simple).unwrap_or(0);
        let form = forms.swap_remove(at);
        if form.at.gain() < MIN_SHARE_OF_ERROR * form.at.smooth.without {
            return None;
        }
        let axes = self.axes(&form.surface);
        let units = match self.pole {
            false => ["m", "m/s", "N"],
            true => ["rad", "rad/s", "N.m"],
        }
        .map(str::to_owned);
        let list =
            formula::Search::new(&form.at.surrogate, &form.surface, &axes).map_or(Vec::new(), |s| s.run());
        let mut tried: Vec<(Fit, Arc<Own>, f64, usize)> = Vec::new();
        for own in &list {
            let share = (form.at.smooth.without - own.held_out) / form.at.gain();
            let (text, parameters) = own.formula.written(&axes, &units[2]);
            if share < MIN_SHARE_OF_FREE_FORM || tried.len() >= 4 || stop::asked() {
                continue;
            }
            let Some(effect) = effect(&text, &parameters, &units, 1.0) else { continue };
            let values: Vec<f64> = effect
                .parameters
                .iter()
                .map(|p| parameters.iter().find(|own| own.0 == p.name).map_or(0.0, |own| own.2))
                .collect();
            tried.push((
                self.fit(&effect, &values, &form.at.parameters),
                effect,
                share,
                own.formula.complexity(),
            ));
        }
        let ceiling = form.at.smooth.without - form.at.chi2;
        tried.retain(|(fit, ..)| form.at.smooth.without - fit.chi2 >= MIN_SHARE_OF_FREE_FORM * ceiling);
        let rank = |own: &(Fit, Arc<Own>, f64, usize)| 0.5 * own.0.chi2.ln() + PRICE * own.3 as f64;
        tried.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        let named = !tried.is_empty();
        let rivals = tried
            .iter()
            .skip(1)
            .filter(|own| own.0.chi2 < 1.06 * tried[0].0.chi2)
            .map(|own| (own.1.formula.clone(), own.2))
            .collect();
        let (best, own, share) = match tried.into_iter().next() {
            Some((fit, own, share, _)) => (fit, own, share),
            None => {
                let text = curve_text(&form.surface, &form.at.smooth.heights, &axes)?;
                let own = effect(&text, &[("a".into(), "1".into(), 1.0)], &units, 1.0)?;
                (self.fit(&own, &[1.0], &form.at.parameters), own, 1.0)
            }
        };
        let law = self.say(channel, (&form, &best, &own), (named, share, rivals), axes)?;
        answer.parameters[1] = best.parameters[..TABLE.len()].to_vec();
        let rig = self.with(Form::Formula(own));
        for (errors, validation) in answer.after.iter_mut().zip([false, true]) {
            let records: Vec<usize> =
                (0..rig.records()).filter(|&r| rig.estimation(r) != validation).collect();
            let whole = Coupled {
                trials: rig
                    .trials
                    .iter()
                    .map(|t| crate::rig::coupled::Trial { restart: None, ..t.clone() })
                    .collect(),
                ..rig.clone()
            };
            *errors = crate::answer::errors(&whole, &records, &best.parameters);
        }
        Some(law)
    }

    /// A formula fitted beside the corrections, from the optimum of the free form.
    fn fit(&self, own: &Arc<Own>, values: &[f64], start: &[f64]) -> Fit {
        let rig = self.with(Form::Formula(Arc::clone(own)));
        let system = Subset { system: &rig, records: self.records.clone() };
        let p = [&start[..TABLE.len()], values].concat();
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
        channel: &str,
        (form, best, own): (&FreeForm, &Fit, &Arc<Own>),
        (named, of_free_form, rivals): (bool, f64, Vec<(String, f64)>),
        axes: Vec<Axis>,
    ) -> Option<Law> {
        let rig = self.with(Form::Formula(Arc::clone(own)));
        let validation: Vec<usize> = (0..rig.records()).filter(|&r| !rig.estimation(r)).collect();
        let before = HeldOut::new(&self.windowed, self.units).error(&self.base, &validation);
        let after = HeldOut::new(&rig, self.units).error(&best.parameters, &validation);
        let share = 1.0 - after / before.max(f64::MIN_POSITIVE);
        if share < MIN_VALIDATED_SHARE {
            return None;
        }
        let samples: usize =
            self.records.iter().map(|&r| rig.signals(r).last().map_or(0, |span| span.range.end)).sum();
        let widen = (best.chi2 / samples.max(1) as f64).sqrt().max(1.0);
        let values = &best.parameters[TABLE.len()..];
        let known = values.iter().enumerate().map(|(k, value)| {
            let place = best.free.iter().position(|free| free.index == TABLE.len() + k).unwrap_or(0);
            (*value, 1.96 * widen * best.covariance[(place, place)].max(0.0).sqrt())
        });
        let parameters: Vec<Parameter> = found::parameters(own, known).collect();
        let moved = self.motion[0].iter().zip(&self.motion[1]);
        let powers = moved.map(|(x, v)| own.value([*x, *v, 0.0, 0.0], &[], values) * v);
        let word = |variable: &Variable| match (variable, self.pole) {
            (Variable::Velocity, false) => "xdot",
            (Variable::Velocity, true) => "thetadot",
            (_, false) => "x",
            (_, true) => "theta",
        };
        Some(Law {
            place: channel.to_owned(),
            port: port::of_channel(channel).unwrap_or_default().to_owned(),
            channel: channel.to_owned(),
            variables: form.surface.variables.iter().map(|own| word(own).to_owned()).collect(),
            curve: form.at.curve(&form.surface, widen),
            named,
            of_free_form,
            share,
            rivals,
            covered: axes.into_iter().map(|a| (a.name.to_owned(), a.range.0, a.range.1, a.unit)).collect(),
            dissipation: found::dissipation(powers),
            toml: own.to_toml(values),
            effect: found::as_effect(own, channel, share, parameters),
        })
    }
}
