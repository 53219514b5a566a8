//! Exact fits in simulation of the best formulas for a free form, the choice of the law among them, and laws with a
//! memory.

use std::sync::Arc;

use super::finder::Finder;
use super::formula::{self, PRICE_PER_COMPLEXITY};
use super::free_form::{FreeForm, GROWING_SHARES};
use super::grammar::{Axis, Formula, product};
use super::place::CURVE_KNOTS;
use super::study::{Found, corrections, extended, push};
use super::written::{curve_text, effect, read};
use crate::answer::Answer;
use crate::engine::fit::Free;
use crate::engine::stop;
use crate::order::ascending;
use crate::study::declaration::Role;
use crate::study::errors::errors;
use crate::study::explain::Judge;
use crate::study::fits::{Model, pieces};
use crate::study::law::{Law as Block, Variable};
use crate::study::model::{Action, Entry, Study, Tap, Target};
use crate::study::ruling::share;
use crate::vocabulary::Own;
use crate::vocabulary::own::Parameter as OwnParameter;

/// Share of the free form's gain that a formula must reach to be named.
pub const MIN_SHARE_OF_FREE_FORM: f64 = 0.95;
/// Formulas whose stability over parts of the records is asked for.
const JUDGED: usize = 3;
/// Formulas that take less than that from whole records, after which no other is fitted where no law leaves noise.
const MAX_FUTILE: usize = 4;
/// Errors within this share of each other are equal.
const MAX_DIFFERENCE_OF_EQUALS: f64 = 0.03;
/// Ratio of the error of a formula to the less of that of the free form and of the noise, below which none comes.
const MIN_ERROR_OVER_LEAST: f64 = 0.98;
/// Share of the declared model's error, and ratio to that of the free form, up to one of which a fit to whole records
/// is at its optimum. A formula within the latter does as well as the free form.
const MAX_ERROR_OVER_DECLARED: f64 = 0.5;
const MAX_ERROR_OVER_FREE_FORM: f64 = 1.1;
/// Ratio of the error of a law with a memory, by the derivatives around the model without it, to the error of the best
/// model without one, up to which it is fitted.
const MAX_ERROR_BEFORE_FIT: f64 = 1.5;
/// Share of the declared model's power above noise from which on a free form leaves too much for any law: a law that is
/// an answer leaves next to nothing of it.
const MAX_EXCESS_OF_FREE_FORM: f64 = 0.5;

/// Share of the held-out power above noise that a free form may leave and need no validation.
const MAX_EXCESS_OF_SURE_FORM: f64 = 0.01;
/// Share of the error on validation records that a free form takes away, below which no formula for it is fitted: it
/// stands for something else in the estimation records. Less than a law needs: a formula goes on beyond the data better
/// than a curve does.
const MIN_VALIDATED_SHARE_OF_FREE_FORM: f64 = 0.7;

/// Validation records know nothing of a free form. No other is looked at then: these records judge, and choose nothing.
pub(super) struct Refuted;

/// A formula that was fitted exactly.
struct Tried {
    model: Model,
    effect: Arc<Own>,
    formula: Formula,
    /// Share of the free form's gain on held-out parts.
    share: f64,
}

impl Tried {
    fn rank(&self) -> f64 {
        rank(self.model.error, &self.formula)
    }
}

/// Rank of a formula, least first: the logarithm of the error plus a price for its complexity.
fn rank(error: f64, formula: &Formula) -> f64 {
    error.ln() + PRICE_PER_COMPLEXITY * formula.complexity() as f64
}

/// A free form, its axes, and the units of formulas.
struct Place<'a> {
    form: &'a FreeForm,
    /// The free form at its optimum for whole records.
    whole: &'a FreeForm,
    axes: &'a [Axis],
    units: &'a [String; 3],
    /// Error that noise leaves.
    noise: f64,
}

/// The formulas that are likeliest for a free form, by its quadratic forms.
fn formulas(form: &FreeForm, axes: &[Axis]) -> Vec<formula::Found> {
    formula::Search::new(&form.at.surrogate, &form.surface, axes).map_or(Vec::new(), |own| own.run())
}

impl Finder<'_> {
    /// Formulas for a free form, fitted exactly; the law, if there is one.
    ///
    /// # Errors
    /// The free form takes too little from the error on validation records.
    pub(super) fn law(
        &self,
        study: &mut Study,
        (judge, answer): (&Judge, &Answer),
        declared: &Model,
        form: &FreeForm,
    ) -> Result<Option<Found>, Refuted> {
        (self.say)("formulas for the free form");
        let axes = self.axes(study, form.tap, &form.surface);
        let list = formulas(form, &axes);
        let units = [Variable::Position, Variable::Velocity, Variable::Value]
            .map(|variable| Self::unit(study, form.tap, variable));
        // The ceiling of what a formula can do in whole records.
        let whole = if self.windows.is_some() { self.whole(study, form.clone()) } else { None };
        let whole = whole.as_ref().unwrap_or(form);
        // A formula takes no more than the free form, which therefore tells whether one can be the answer.
        let excess = |error: f64| (error * error - self.noise_of_sample(study)).max(0.0);
        let leaves_much = excess(whole.error) > MAX_EXCESS_OF_FREE_FORM * excess(declared.error);
        if whole.error > self.max_error || leaves_much {
            return Ok(None);
        }
        // One that leaves next to nothing where it was held out fails beyond its knots only, where a formula need not.
        let whole_excess = form.at.smooth.without - self.noise;
        let is_sure = form.excess(self.noise) < MAX_EXCESS_OF_SURE_FORM * whole_excess;
        if !is_sure && self.validated(study, answer, whole) < MIN_VALIDATED_SHARE_OF_FREE_FORM {
            return Err(Refuted);
        }
        let place = Place { form, whole, axes: &axes, units: &units, noise: judge.power.sqrt() };
        (self.say)("exact fits of formulas");
        let power = |error: f64| error.powi(2);
        let ceiling = power(declared.error) - power(whole.error.min(declared.error));
        let least_gain = MIN_SHARE_OF_FREE_FORM * ceiling;
        let reaches = |own: &Tried| power(declared.error) - power(own.model.error) >= least_gain;
        let mut tried = Vec::new();
        self.fit_formulas(study, declared, &place, (form, list), &reaches, &mut tried);
        // What changes slowly is lost beside the states that windows start from, and shows in whole records.
        let as_well = |own: &Tried| own.model.error < MAX_ERROR_OVER_FREE_FORM * whole.error;
        if self.windows.is_some() && !tried.iter().any(as_well) && !stop::asked() {
            let list = formulas(whole, &axes);
            self.fit_formulas(study, declared, &place, (whole, list), &reaches, &mut tried);
        }
        tried.retain(reaches);
        ascending(&mut tried, |own| own.rank());
        self.prune(study, (declared, &[]), &place, &mut tried);
        self.prune_beside_corrections(study, (judge, declared), &place, &mut tried);
        let mut best: Option<(Model, Arc<Own>, f64)> = None;
        let mut rivals = Vec::new();
        for Tried { model, effect, share, .. } in tried.iter().take(JUDGED) {
            let fits = self.fits(study);
            let mut model = extended(model, study);
            fits.hold_out(&mut model);
            let stable =
                model.held_out.is_finite() && model.held_out < 1.5 * model.error.max(judge.power.sqrt());
            match &best {
                None if stable => best = Some((model, Arc::clone(effect), *share)),
                Some((own, ..)) if model.held_out < (1.0 + MAX_DIFFERENCE_OF_EQUALS) * own.held_out => {
                    rivals.push((effect.formula.clone(), *share));
                }
                _ => {}
            }
        }
        let named = best.is_some();
        let (model, effect, share) = match best {
            Some(own) => own,
            None => match self.curve(study, &place) {
                Some(own) => own,
                None => return Ok(None),
            },
        };
        Ok(Some(Found {
            tap: form.tap,
            variables: form.surface.variables.clone(),
            curve: whole.at.curve(&whole.surface, model.error.max(judge.power.sqrt())),
            effect,
            model,
            named,
            share,
            rivals,
            axes,
        }))
    }

    /// Fits those formulas of a list exactly that may be the law, in the order of the list, and adds them to those
    /// `tried`. `form`: the free form that they were found for; `reaches`: whether a formula takes nearly all that the
    /// free form takes.
    fn fit_formulas(
        &self,
        study: &mut Study,
        declared: &Model,
        place: &Place,
        (form, list): (&FreeForm, Vec<formula::Found>),
        reaches: &dyn Fn(&Tried) -> bool,
        tried: &mut Vec<Tried>,
    ) {
        // What a formula can reach at best; one that another outranks even then needs no fit.
        let least = MIN_ERROR_OVER_LEAST * place.whole.error.min(place.noise);
        let mut fitted = 0;
        for own in list {
            // Where no law leaves noise, the likeliest formulas tell whether there is one.
            let futile = self.aim.is_share() && fitted >= MAX_FUTILE && !tried.iter().any(reaches);
            let share = (form.at.smooth.without - own.held_out) / form.at.gain();
            let best = tried.iter().map(Tried::rank).fold(f64::INFINITY, f64::min);
            let outranked = best <= rank(least, &own.formula);
            let known = tried.iter().any(|other| other.formula.same_form(&own.formula));
            if share >= MIN_SHARE_OF_FREE_FORM && !outranked && !futile && !known && !stop::asked() {
                tried.extend(self.exact(study, (declared, &[]), place, &own.formula, share));
                fitted += 1;
            }
        }
    }

    /// Share of the error on validation records that a free form takes away.
    fn validated(&self, study: &Study, answer: &Answer, form: &FreeForm) -> f64 {
        let validation = pieces(study, Role::Validation);
        let after =
            errors(&self.fits(study), &self.acting(form.candidate), &validation, &form.at.parameters, None);
        let floor = &answer.floor[1];
        share(study, [&self.lacking, &after], &[floor.clone(), floor.clone()])
    }

    /// A formula fitted to whole records, beside further `corrections` of the declared model in units of the noise;
    /// none where the fit fails, or where it shows the formula to stand for something simpler.
    fn exact(
        &self,
        study: &mut Study,
        (declared, corrections): (&Model, &[Free]),
        place: &Place,
        formula: &Formula,
        share: f64,
    ) -> Option<Tried> {
        let (text, parameters) = formula.written(place.axes, &place.units[2]);
        let effect = effect(&text, &parameters, place.units, study.taps[place.form.tap].sign)?;
        let value = |p: &OwnParameter| parameters.iter().find(|own| own.0 == p.name).map_or(0.0, |own| own.2);
        let values: Vec<f64> = effect.parameters.iter().map(value).collect();
        let (c, p) = self.start(study, place, &effect, &values);
        let (fits, locals) = (self.fits(study), &place.whole.locals);
        let added = self.acting(c);
        let direct = fits.fit_from(added.clone(), &p, locals);
        let near =
            (MAX_ERROR_OVER_DECLARED * declared.error).max(MAX_ERROR_OVER_FREE_FORM * place.whole.error);
        let gains = |model: &Model| self.aim.is_share() && model.error < declared.error;
        let model = match direct {
            Some(model) if model.error < near || gains(&model) => Some(model),
            // From the beginning of the records on: whole ones may end anywhere.
            direct => {
                let grown = fits.grow(&added, &fits.pieces, &p, &fits.free(&added), &GROWING_SHARES, 8);
                let again = fits.fit_from(added, &grown.parameters, &grown.locals);
                let better = |own: &Model| direct.as_ref().is_none_or(|other| own.error < other.error);
                if again.as_ref().is_some_and(better) { again } else { direct }
            }
        };
        let model = if corrections.is_empty() { model } else { self.in_noise(study, corrections, &model?) };
        let model = model?;
        let values = &model.fit.parameters[study.candidates[c].entries.clone()];
        let value = |name: String| {
            effect.parameters.iter().position(|own| own.name == name).map_or(0.0, |k| values[k])
        };
        let fitted = Formula { p: formula.names().into_iter().map(value).collect(), ..formula.clone() };
        let stands = formula::sines_are_seen(&fitted, &place.form.surface.knots);
        stands.then(|| Tried { model, effect, formula: formula.clone(), share })
    }

    /// A candidate for an effect, and the parameter vector with it in place of the free form.
    fn start(
        &self,
        study: &mut Study,
        place: &Place,
        effect: &Arc<Own>,
        values: &[f64],
    ) -> (usize, Vec<f64>) {
        let c = self.push_own(study, place.form.tap, effect, values);
        let mut p = place.whole.at.parameters.clone();
        let known = p.len();
        p.extend(study.entries[known..].iter().map(|entry| entry.start));
        study.candidates[place.form.candidate].entries.clone().for_each(|index| p[index] = 0.0);
        study.candidates[c].entries.clone().zip(values).for_each(|(index, value)| p[index] = *value);
        (c, p)
    }

    /// Leaves terms of the best formula out that only stand for declared parameters which are slightly off, where
    /// formulas were sought without corrections of these.
    fn prune_beside_corrections(
        &self,
        study: &mut Study,
        (judge, declared): (&Judge, &Model),
        place: &Place,
        tried: &mut Vec<Tried>,
    ) {
        let found = corrections(study, self.max_tolerances);
        let Some(best) = tried.first().filter(|own| own.formula.terms.len() > 1 && !found.is_empty()) else {
            return;
        };
        // Fits in units of the noise know nothing of a share.
        let is_share_alone = self.aim.is_share() && self.beside.is_empty();
        if is_share_alone && !self.may_leave_noise(judge, &best.model) {
            return;
        }
        let (formula, share) = (best.formula.clone(), best.share);
        let mut beside = Vec::new();
        beside.extend(self.exact(study, (declared, &found), place, &formula, share));
        if is_share_alone {
            beside.retain(|own| self.noise_left(study, judge, &found, &own.model).is_some());
        }
        self.prune(study, (declared, &found), place, &mut beside);
        let shorter = beside.into_iter().next().filter(|own| own.formula.terms.len() < formula.terms.len());
        if let Some(shorter) = shorter {
            tried.retain(|own| own.formula.terms.len() <= shorter.formula.terms.len());
            tried.insert(0, shorter);
        }
    }

    /// Leaves terms of the best formula out without which it does as well.
    fn prune(
        &self,
        study: &mut Study,
        (declared, corrections): (&Model, &[Free]),
        place: &Place,
        tried: &mut Vec<Tried>,
    ) {
        while let Some(best) = tried.first().filter(|own| own.formula.terms.len() > 1 && !stop::asked()) {
            let shorter: Vec<(Formula, f64)> =
                (0..best.formula.terms.len()).map(|k| (best.formula.without(k), best.share)).collect();
            let rank = best.rank();
            let mut found: Vec<Tried> = Vec::new();
            for (formula, share) in shorter {
                if !tried.iter().any(|own| own.formula.same_form(&formula)) {
                    let own = self.exact(study, (declared, corrections), place, &formula, share);
                    found.extend(own);
                }
            }
            let better = found.into_iter().filter(|own| own.rank() < rank);
            let Some(better) = better.min_by(|a, b| a.rank().total_cmp(&b.rank())) else { break };
            tried.insert(0, better);
        }
    }

    /// The free form itself as the law.
    fn curve(&self, study: &mut Study, place: &Place) -> Option<(Model, Arc<Own>, f64)> {
        let text = curve_text(&place.form.surface, &place.whole.at.surrogate.heights, place.axes)?;
        let effect =
            effect(&text, &[("a".into(), "1".into(), 1.0)], place.units, study.taps[place.form.tap].sign)?;
        let (c, p) = self.start(study, place, &effect, &[1.0]);
        Some((self.fits(study).fit_from(self.acting(c), &p, &place.whole.locals)?, effect, 1.0))
    }

    /// The best law with a memory, at attachments whose motion is known: all of them, or those with the given names.
    /// `left`: error of the best model without one.
    pub(super) fn memory(
        &self,
        study: &mut Study,
        (declared, left): (&Model, f64),
        ports: Option<&[String]>,
    ) -> Option<(usize, Model, Arc<Own>)> {
        (self.say)("laws with a memory");
        let is_asked = |tap: &Tap| ports.is_none_or(|ports| ports.contains(&tap.name));
        let asked = |&tap: &usize| study.taps[tap].crossed.is_none() && is_asked(&study.taps[tap]);
        let mut laws = Vec::new();
        for tap in (0..study.taps.len()).filter(asked).collect::<Vec<_>>() {
            laws.extend(self.with_memory(study, declared, tap).into_iter().map(|(c, own)| (tap, c, own)));
        }
        let (base, fits) = (extended(declared, study), self.fits(study));
        let list: Vec<usize> = laws.iter().map(|own| own.1).collect();
        let around = fits.around(&base);
        let promises = fits.promises(&base, around.as_ref(), &list);
        let mut best: Option<(usize, Model, Arc<Own>)> = None;
        for ((tap, c, own), promise) in laws.into_iter().zip(promises) {
            let near = promise.and_then(|(_, p)| fits.add_near(&base, around.as_ref(), (c, &p)));
            let near = near.filter(|own| own.error <= MAX_ERROR_BEFORE_FIT * left && !stop::asked());
            // Without derivatives around the base it was fitted.
            let found = match &around {
                Some(_) => near
                    .and_then(|own| fits.fit_from(own.added.clone(), &own.fit.parameters, &own.fit.locals)),
                None => near,
            };
            let better = |own: &Model| best.as_ref().is_none_or(|known| own.error < known.1.error);
            if let Some(model) = found.filter(better) {
                best = Some((tap, model, own));
            }
        }
        best
    }

    /// Candidates for the laws with a memory at an attachment: an element that creeps, and one that follows the path.
    fn with_memory(&self, study: &mut Study, declared: &Model, tap: usize) -> Vec<(usize, Arc<Own>)> {
        let units = [Variable::Position, Variable::Velocity, Variable::Value]
            .map(|variable| Self::unit(study, tap, variable));
        let Some(places) = self.knots(study, tap, Variable::Velocity, CURVE_KNOTS) else { return Vec::new() };
        let fastest = places.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let travel = self
            .knots(study, tap, Variable::Position, CURVE_KNOTS)
            .map_or(0.1 * fastest, |own| own[own.len() - 1] - own[0]);
        let stiffness = product(&[(&units[2], 1), (&units[1], -1), ("s", -1)]);
        let length = product(&[(&units[1], 1), ("s", 1)]);
        let times = [0.05, 0.3, 1.5].to_vec();
        let lengths = [0.01, 0.05, 0.25].map(|part| part * travel).to_vec();
        let mut found = Vec::new();
        for (rate, unit, starts) in [("v - z/s", "s".to_owned(), times), ("v - abs(v)*z/s", length, lengths)]
        {
            let tables = format!(
                "[states]\nz = {rate:?}\n[parameters]\nk = {{ unit = {stiffness:?} }}\ns = {{ unit = {unit:?}, start = {starts:?} }}\n"
            );
            let sign = study.taps[tap].sign;
            let Some(own) = read("k*z", "law with a memory", &units, sign, &tables) else { continue };
            let c = self.push_own(study, tap, &own, &[1.0, starts[1]]);
            study.candidates[c].starts = own.starts();
            let base = extended(declared, study);
            for index in study.candidates[c].entries.clone() {
                let step = self.fits(study).step(&base, c, index, &[]);
                study.entries[index].free.step = step.unwrap_or(1e-6);
                let first = study.candidates[c].entries.start;
                if own.parameters[index - first].name == "s" {
                    let (least, most) = (starts[0], starts[starts.len() - 1]);
                    study.entries[index].free.bounds = (0.05 * least, 20.0 * most);
                }
            }
            found.push((c, own));
        }
        found
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
        push(study, action, entries, "", own.kind.clone())
    }
}
