//! Port of a study, and variables there, over which a free form explains most of the residual.

use super::exact::Refuted;
use super::finder::Finder;
use super::free_form::FreeForm;
use super::study::{Found, Outcome, scaled};
use super::surface::Surface;
use crate::answer::Answer;
use crate::engine::stop;
use crate::order::{ascending, descending};
use crate::study::catalog;
use crate::study::explain::Judge;
use crate::study::fits::Model;
use crate::study::law::Variable;
use crate::study::model::Study;

/// Share of the excess over noise that a free form has to take away for a law to be looked for.
const MIN_SHARE_OF_EXCESS: f64 = 0.2;
/// Share of the excess over noise that a free form may leave by its quadratic form around zero heights to be brought to
/// its optimum: a law leaves next to nothing.
const MAX_EXCESS_AT_START: f64 = 0.7;
/// Share of a second variable in what one leaves, from which on both are needed.
const MIN_SHARE_OF_SECOND_VARIABLE: f64 = 0.15;
/// Held-out error of a free form in windows over that of noise, below which no other variable is looked at.
pub(super) const MAX_ERROR_WITHOUT_SECOND: f64 = 1.2;
/// Knots of a variable while variables are compared, of the one that is chosen, and of each of two.
pub(super) const SCREENING_KNOTS: usize = 10;
pub(super) const CURVE_KNOTS: usize = 20;
pub(super) const SURFACE_KNOTS: usize = 6;
/// The same in time, where a law may swing some times within a record.
const SCREENING_KNOTS_IN_TIME: usize = 24;
const CURVE_KNOTS_IN_TIME: usize = 40;
/// Weight of the gain of a form over the value that passes.
const WEIGHT_OF_VALUE: f64 = 0.5;
/// Share of the best variable's gain from which on another is looked at closely.
const MIN_GAIN_OVER_BEST: f64 = 0.5;
/// Fall of the held-out error that a free form must bring, in variances of the noise.
const MIN_GAIN_IN_NOISE: f64 = 30.0;
/// Share of the least error that counts as above noise where it is at the noise.
const MIN_EXCESS_OF_LEAST: f64 = 0.03;
/// Share of the best free form's gain from which on the same variable of another port may be the place of the law.
const MIN_GAIN_OF_OTHER_PORT: f64 = 0.9;
/// Other ports at which a law is looked for.
const MAX_OTHER_PORTS: usize = 2;
/// Ratio of the error of a law at another port to that at the first, below which the law belongs to the other port; so
/// it does where it alone leaves noise.
const MAX_ERROR_AT_OTHER_PORT: f64 = 0.95;
/// Share of the declared model's error that a law without memory has to leave for one with a memory to be tried.
const MIN_LEFT_FOR_MEMORY: f64 = 0.02;
/// Error over that of noise that has to be left for laws with a memory to be tried where effects explain much.
const MIN_FLOORS_FOR_MEMORY_OF_EFFECTS: f64 = 1.2;
/// Held-out error of a free form in windows over that of noise, up to which a law may leave noise.
const MAX_ERROR_OF_NOISE: f64 = 2.0;
/// Ratio of the power above noise that a law with a memory leaves to the least without one, below which it is taken.
const MAX_EXCESS_WITH_MEMORY: f64 = 0.36;

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
        let here = variables
            .into_iter()
            .filter(|(variable, there)| *there && catalog::channel_of(&own.attachment, *variable).is_some());
        found.extend(here.map(|(variable, _)| (tap, variable)));
    }
    found
}

impl FreeForm {
    /// Held-out error above `noise`, both sums of squares \[scale^2\].
    pub(super) fn excess(&self, noise: f64) -> f64 {
        (self.at.smooth.held_out - noise).max(0.0)
    }

    /// Whether a form around zero heights takes away so much that a law there may leave next to nothing.
    pub(super) fn is_hopeful(&self, noise: f64) -> bool {
        self.excess(noise) < MAX_EXCESS_AT_START * (self.at.smooth.without - noise).max(0.0)
    }
}

impl Finder<'_> {
    pub(super) fn find(
        &mut self,
        study: &mut Study,
        judge: &Judge,
        declared: &Model,
        answer: &Answer,
    ) -> Option<Outcome> {
        (self.say)("free forms at the ports");
        let mut singles = Vec::new();
        for (tap, variable) in places(study) {
            let count = if variable == Variable::Time { SCREENING_KNOTS_IN_TIME } else { SCREENING_KNOTS };
            let Some(knots) = self.knots(study, tap, variable, count) else { continue };
            let surface = Surface::new(vec![variable], vec![knots]);
            if let Some(form) = self.form(study, declared, tap, surface) {
                singles.push(form);
            }
        }
        let noise = self.noise;
        // The value that passes drives the motion, so that it seems to tell what the motion tells.
        let gain = |form: &FreeForm| {
            let drives = form.surface.variables == [Variable::Value];
            form.at.gain() * if drives { WEIGHT_OF_VALUE } else { 1.0 }
        };
        descending(&mut singles, gain);
        let most = gain(singles.first()?);
        let near = |form: &FreeForm| gain(form) > MIN_GAIN_OF_OTHER_PORT * most;
        let hopeful = |form: &FreeForm| form.is_hopeful(noise);
        let mut known =
            if hopeful(&singles[0]) { self.tell_ports(study, declared, &mut singles, near) } else { None };
        let best = singles.first()?;
        let one = self.noise_of_sample(study);
        let enough = |form: &FreeForm| {
            let excess = (form.at.smooth.without - noise).max(0.0);
            gain(form) > (MIN_SHARE_OF_EXCESS * excess).max(MIN_GAIN_IN_NOISE * one)
        };
        let (tap, first) = (best.tap, best.surface.variables[0]);
        let mut forms: Vec<FreeForm> = Vec::new();
        for form in singles.iter().take(2).filter(|form| form.tap == tap) {
            if gain(form) < MIN_GAIN_OVER_BEST * most || !hopeful(form) {
                continue;
            }
            let own = |known: &FreeForm| known.surface.variables == form.surface.variables;
            let fine = known.take_if(|known| own(known));
            forms.extend(fine.or_else(|| self.fine(study, declared, (tap, form.surface.variables[0]))));
        }
        let leaves = |form: &FreeForm| form.at.smooth.held_out;
        let one = forms.iter().min_by(|a, b| leaves(a).total_cmp(&leaves(b))).cloned();
        if let Some(one) = one.filter(|one| leaves(one) >= MAX_ERROR_WITHOUT_SECOND * noise) {
            forms.extend(self.beside_corrections(study, declared, &one));
        }
        let left = forms.iter().map(leaves).fold(f64::INFINITY, f64::min);
        // Two variables where one leaves much.
        if left >= MAX_ERROR_WITHOUT_SECOND * noise {
            forms.extend(self.over_two(study, declared, &singles, (tap, first)));
        }
        let form = self.simplest(forms);
        let is_place = form.is_some();
        let form = form.unwrap_or_else(|| best.clone());
        let to_noise = |form: &FreeForm| form.at.smooth.held_out < MAX_ERROR_OF_NOISE * noise;
        let aim = self.aim;
        // A residual of many small causes looks like something in time: a law there has to leave noise.
        let in_time = |form: &FreeForm| form.surface.variables.contains(&Variable::Time);
        let enough = |form: &FreeForm| (aim.is_share() && !in_time(form) || to_noise(form)) && enough(form);
        let more = |form: &FreeForm| form.at.smooth.held_out > MAX_ERROR_WITHOUT_SECOND * noise;
        let crossed = if self.wide && more(&form) { self.crossed(study, declared, &form) } else { None };
        let known = crossed.as_ref().unwrap_or(&form);
        let observed = if more(known) { self.observed(study, declared, known) } else { None };
        let mut law = None;
        for form in observed.iter().chain(&crossed).chain(is_place.then_some(&form)) {
            if law.is_none() && enough(form) {
                match self.law(study, (judge, answer), declared, form) {
                    Ok(found) => law = found,
                    Err(Refuted) => break,
                }
            }
        }
        let near = |other: &&FreeForm| {
            other.tap != form.tap
                && other.surface.variables == form.surface.variables
                && gain(other) > MIN_GAIN_OF_OTHER_PORT * most
        };
        for other in singles.iter().filter(near).take(MAX_OTHER_PORTS) {
            let Some(first) = law.as_ref().filter(|_| !stop::asked()) else { break };
            if self.explains(study, judge, &first.model) {
                break;
            }
            let least = MAX_ERROR_AT_OTHER_PORT * first.model.error;
            let found = self.fine(study, declared, (other.tap, other.surface.variables[0]));
            let found = found.and_then(|form| self.law(study, (judge, answer), declared, &form).ok()?);
            let better = |own: &Found| {
                own.model.error < least || judge.explained(&self.fits_with_all_steps(study), &own.model)
            };
            law = found.filter(|own| own.named && better(own)).or(law);
        }
        let left = law.as_ref().map_or(declared, |own| &own.model);
        let most_is_left = left.error > MIN_LEFT_FOR_MEMORY * declared.error;
        let explained = law.as_ref().is_some_and(|own| self.explains(study, judge, &own.model));
        let most = MAX_EXCESS_WITH_MEMORY * judge.excess(left);
        let left_by_effects = scaled(study, self.scale, &answer.after[0]);
        let least = left_by_effects.min(left.error);
        let floors = judge.floors(least.powi(2));
        let much = floors > MIN_FLOORS_FOR_MEMORY_OF_EFFECTS;
        let memory = if most_is_left && !explained && (self.wide || much) && !stop::asked() {
            // Friction with a memory passes for the usual one: then it is where that was found.
            let named = law.iter().map(|own| Some(study.taps[own.tap].name.clone()));
            let selected = answer.effects.iter().filter(|effect| effect.selected);
            let at_tap = |port: &&String| study.taps.iter().any(|tap| tap.name == **port);
            let of_effects = selected.map(|effect| effect.port.as_ref().filter(at_tap).cloned());
            let ports: Option<Vec<String>> = of_effects.chain(named).collect();
            self.memory(study, (declared, least), ports.as_deref().filter(|_| !self.wide))
        } else {
            None
        };
        let found = match memory {
            Some((tap, model, effect)) if judge.excess(&model) < most => {
                let (axes, variables) = (Vec::new(), vec![Variable::Velocity]);
                let (named, share, rivals) = (true, 1.0, Vec::new());
                Found { tap, variables, curve: Vec::new(), effect, model, named, share, rivals, axes }
            }
            _ => law?,
        };
        self.say_law(study, judge, declared, found, answer)
    }

    /// Free forms over two variables, the best of every port at its optimum: those with the best variable at its port,
    /// and those over position and velocity at the ports of `singles`, as a form over one variable does not tell which
    /// of them holds a law over the motion there.
    fn over_two(
        &self,
        study: &mut Study,
        declared: &Model,
        singles: &[FreeForm],
        (tap, first): (usize, Variable),
    ) -> Vec<FreeForm> {
        let mut ports = vec![tap];
        for own in singles {
            if !ports.contains(&own.tap) && ports.len() <= MAX_OTHER_PORTS {
                ports.push(own.tap);
            }
        }
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
        let mut pairs = Vec::new();
        for variables in combined {
            let count = if variables == [x, v] { ports.len() } else { 1 };
            for &port in ports.iter().take(count).take_while(|_| !stop::asked()) {
                let knots: Option<Vec<Vec<f64>>> =
                    variables.iter().map(|own| self.knots(study, port, *own, SURFACE_KNOTS)).collect();
                let Some(knots) = knots else { continue };
                let surface = Surface::new(variables.into(), knots);
                pairs.extend(self.form(study, declared, port, surface));
            }
        }
        pairs.retain(|form| form.is_hopeful(self.noise));
        ascending(&mut pairs, |own| own.at.smooth.held_out);
        let mut told: Vec<usize> = Vec::new();
        let mut found = Vec::new();
        for pair in pairs {
            if !told.contains(&pair.tap) {
                told.push(pair.tap);
                found.extend(self.toward(study, pair));
            }
        }
        found
    }

    /// The free form with the least held-out error, or one over a variable less that leaves about as much.
    fn simplest(&self, mut forms: Vec<FreeForm>) -> Option<FreeForm> {
        ascending(&mut forms, |own| own.at.smooth.held_out);
        let least = forms.first()?.at.smooth.held_out;
        // What one variable leaves may be as much more than what two leave.
        let more = MIN_SHARE_OF_SECOND_VARIABLE * (least - self.noise).max(MIN_EXCESS_OF_LEAST * least);
        let simple =
            |form: &FreeForm| form.surface.variables.len() == 1 && form.at.smooth.held_out < least + more;
        let at = forms.iter().position(simple).unwrap_or(0);
        Some(forms.swap_remove(at))
    }

    /// Whether a law leaves noise, if need be fitted in units of the noise: where signals are weighed by the residual
    /// of the declared model, the best fit may leave more of those that matter little.
    fn explains(&self, study: &Study, judge: &Judge, model: &Model) -> bool {
        let fits = self.fits_with_all_steps(study);
        let near = model.error < self.max_error;
        judge.explained(&fits, model)
            || near && self.in_noise(study, &[], model).is_some_and(|own| judge.explained(&fits, &own))
    }

    /// Puts that of the best forms first whose port is the place: ports whose motions are nearly the same are
    /// distinguished by forms with all knots. `near`: whether the gain of a form is near to the largest. Gives the form
    /// with all knots at that port, if several were compared.
    fn tell_ports(
        &self,
        study: &mut Study,
        declared: &Model,
        singles: &mut [FreeForm],
        near: impl Fn(&FreeForm) -> bool,
    ) -> Option<FreeForm> {
        let (tap, variables) = (singles[0].tap, singles[0].surface.variables.clone());
        let alike = |form: &FreeForm| form.surface.variables == variables && near(form);
        let others = (1..singles.len()).filter(|&i| singles[i].tap != tap && alike(&singles[i]));
        let places: Vec<usize> = std::iter::once(0).chain(others.take(MAX_OTHER_PORTS)).collect();
        if places.len() < 2 || stop::asked() {
            return None;
        }
        let mut fine: Vec<Option<FreeForm>> =
            places.iter().map(|&i| self.fine(study, declared, (singles[i].tap, variables[0]))).collect();
        let left =
            |form: &Option<FreeForm>| form.as_ref().map_or(f64::INFINITY, |own| own.at.smooth.held_out);
        let errors: Vec<f64> = fine.iter().map(left).collect();
        let best = (0..places.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])).unwrap_or(0);
        let best = if errors[best] < MAX_ERROR_AT_OTHER_PORT.powi(2) * errors[0] { best } else { 0 };
        singles.swap(0, places[best]);
        fine.swap_remove(best)
    }

    /// A free form over one variable with all its knots, at its optimum.
    pub(super) fn fine(
        &self,
        study: &mut Study,
        declared: &Model,
        (tap, variable): (usize, Variable),
    ) -> Option<FreeForm> {
        let count = if variable == Variable::Time { CURVE_KNOTS_IN_TIME } else { CURVE_KNOTS };
        let knots = self.knots(study, tap, variable, count)?;
        let surface = Surface::new(vec![variable], vec![knots]);
        let form = self.form(study, declared, tap, surface)?;
        self.toward(study, form)
    }

    /// Mean square of the noise of a sample \[scale^2\].
    pub(super) fn noise_of_sample(&self, study: &Study) -> f64 {
        let samples = self.trace.first().map_or(0, Vec::len) * study.outputs.len();
        self.noise / samples.max(1) as f64
    }
}
