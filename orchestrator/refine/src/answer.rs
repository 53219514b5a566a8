//! The answer of a search in the terms of the vocabulary: what is missing, how well it is known, what it improves.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::engine::{System, parallel};
use super::law::found::Law;
use super::rig::corrections;
use super::vocabulary::Own;

/// Beginning of the remarks that are shown with the answer, not in the report alone.
pub const WARNING: &str = "Warning: ";

/// Settings of the search.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Seed of the simulated null.
    pub seed: u64,
    /// Draws of the simulated null, half for the scale and half for the quantile.
    pub draws: usize,
    /// Most effects that are added.
    pub max_effects: usize,
    /// Settings where the noise is not reached.
    pub forward_selection: super::engine::settings::ForwardSelection,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { seed: 1, draws: 400, max_effects: 3, forward_selection: Default::default() }
    }
}

/// Verdict of a search on the records.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Verdict {
    /// Effects were found.
    Effect,
    /// Nothing is missing.
    #[default]
    Nothing,
    /// Something is missing that is none of the candidates.
    Unexplained,
    /// Something is missing that is none of the candidates, and its law was found.
    Law,
}

/// A parameter with its 95 % interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name in the vocabulary.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// 95 % interval.
    pub interval: (f64, f64),
}

/// An effect of the answer.
#[derive(Debug, Clone, Default)]
pub struct Effect {
    /// Id of the vocabulary.
    pub id: String,
    /// Channel; empty where none is declared.
    pub channel: String,
    /// Input of the system or of a component, or rate of a state, where it acts, or the output that a sensor shows;
    /// none: that of the channel.
    pub port: Option<String>,
    /// How its block is connected at the port; none: as the channel says.
    pub wiring: Option<Wiring>,
    /// Measured signal of a sensor effect.
    pub signal: Option<String>,
    /// Whether it is part of the corrected model.
    pub selected: bool,
    /// Effects of one group cannot be distinguished.
    pub group: Option<usize>,
    /// Improvement of the information criterion over the declared model.
    pub score: f64,
    /// Share of the declared model's error on validation records that it takes away alone; none: not asked.
    pub share: Option<f64>,
    /// Parameters.
    pub parameters: Vec<Parameter>,
    /// Why it was chosen or not, one sentence.
    pub reason: String,
    /// How it holds on parts of the estimation records; none: not asked.
    pub stability: Option<Stability>,
    /// Its formula, where it is an effect of one's own.
    pub own: Option<Arc<Own>>,
}

/// How a block is connected at a port of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wiring {
    /// Signal: velocity along the port.
    pub velocity: Option<String>,
    /// Signal: position along the port.
    pub position: Option<String>,
    /// Signal: load that friction grows with.
    pub load: Option<String>,
    /// Signal: pressure of a chamber.
    pub pressure: Option<String>,
    /// Velocity over which friction changes its sign.
    pub vt: f64,
    /// Velocity at which friction changes its sign.
    pub v0: f64,
    /// -1 where what is taken off is added.
    pub sign: f64,
    /// Coulomb level that presliding acts on.
    pub level: f64,
    /// Port that gets a part of what is taken off, and the value there of all of it, with its [`Wiring::sign`].
    pub into: Option<(String, f64)>,
}

impl Effect {
    /// Kind without its place: `coulomb` of `cf.coulomb` and of `coulomb@arm.tau_2`.
    pub fn kind(&self) -> &str {
        let own = self.id.split_once('@').map_or(self.id.as_str(), |(kind, _)| kind);
        own.rsplit_once('.').map_or(own, |(_, kind)| kind)
    }
}

/// An effect on parts of the estimation records, each held out in turn.
#[derive(Debug, Clone, Default)]
pub struct Stability {
    /// Parts.
    pub parts: usize,
    /// Parts on which the model with the effect is better than the one without it, fitted on the others.
    pub better: usize,
    /// Share of the error on the parts that it takes away, their geometric mean.
    pub gain: f64,
    /// Least and largest value of each parameter, fitted without one part.
    pub ranges: Vec<(f64, f64)>,
}

/// A declared parameter that is slightly off.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Id of the effect of the vocabulary that does the same, if there is one.
    pub id: Option<String>,
    /// Component.
    pub component: String,
    /// Parameter of the component.
    pub parameter: String,
    /// Declared value.
    pub declared: f64,
    /// Corrected value.
    pub value: f64,
    /// 95 % interval of `value`.
    pub interval: (f64, f64),
    /// Entry of the parameter vector: relative change, of poles absolute.
    pub moved: f64,
    /// One standard deviation of what is known beforehand, as `moved`.
    pub tolerance: f64,
    /// Parameter of the effect that does the same.
    pub parameters: Vec<Parameter>,
}

impl Correction {
    /// `component.parameter`, or the parameter of a system that is a single FMU.
    pub fn path(&self) -> String {
        match &*self.component {
            "" => self.parameter.clone(),
            component => format!("{component}.{}", self.parameter),
        }
    }

    /// A correction by `moved` with the standard deviation `deviation`, both as entries of the parameter vector.
    pub fn new(own: &corrections::Correction, moved: f64, deviation: f64) -> Correction {
        let (value, half) = (own.value(moved), 1.96 * (own.value(deviation) - own.declared).abs());
        let unit = |id: &str, name: &str| {
            let known = super::rig::parameters::TABLE.iter().find(|own| own.name == format!("{id}.{name}"));
            known.map_or(String::new(), |own| own.unit.to_owned())
        };
        let parameter = own.entry.effect.map(|(id, name)| Parameter {
            name: name.into(),
            unit: unit(id, name),
            value: value - own.declared,
            interval: (value - half - own.declared, value + half - own.declared),
        });
        Correction {
            id: own.entry.effect.map(|(id, _)| id.into()),
            component: own.component().into(),
            parameter: own.parameter().into(),
            declared: own.declared,
            value,
            interval: (value - half, value + half),
            moved,
            tolerance: own.exact().prior.unwrap_or(0.0),
            parameters: parameter.into_iter().collect(),
        }
    }
}

/// A candidate of one step of the search.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// Id, with the signal for sensors.
    pub id: String,
    /// Input where it acts, or the output that a sensor shows; none: a sensor of the rig.
    pub port: Option<String>,
    /// Share of the declared model's error on held-out estimation records that it takes away beyond the model before
    /// it.
    pub held_out_gain: f64,
    /// Why it was not accepted.
    pub rejected: Option<String>,
}

/// One step of the search.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Step {
    /// Effects found before.
    pub model: Vec<String>,
    /// Candidates, best first.
    pub candidates: Vec<Tried>,
}

/// Errors of a set of records, by signal.
#[derive(Debug, Clone, Default)]
pub struct Errors {
    /// Rms in the unit of the signal.
    pub rms: BTreeMap<String, f64>,
    /// Rms over the standard deviation of the measured signal.
    pub nrmse: BTreeMap<String, f64>,
    /// Rms in multiples of the noise of the sensor without what noise of the states gives that windows start from;
    /// empty where there are none.
    pub white: BTreeMap<String, f64>,
}

impl Errors {
    /// Error of a signal in its unit as shares count it: `white` times the `noise` of its sensor where it is known,
    /// else its rms; 0 without one.
    pub(crate) fn counted(&self, signal: &str, noise: f64) -> f64 {
        let white = self.white.get(signal).map(|own| own * noise);
        white.or(self.rms.get(signal).copied()).unwrap_or(0.0)
    }

    /// Error of a signal in multiples of that of a true model, whose rms is `floor` \[unit of the signal\]: `white`
    /// where it is known.
    pub(crate) fn times(&self, signal: &str, floor: Option<f64>) -> Option<f64> {
        let of_floor = || Some(self.rms.get(signal)? / floor?);
        self.white.get(signal).copied().or_else(of_floor)
    }
}

/// The answer.
#[derive(Debug, Clone, Default)]
pub struct Answer {
    /// Verdict on the records.
    pub verdict: Verdict,
    /// Whether every signal is within its noise limit with the answer.
    pub complete: bool,
    /// Whether the search ended before it was through.
    pub partial: bool,
    /// Shortest sample time of the records of a study \[s\].
    pub sample_time: f64,
    /// Share of the declared model's error on validation records that effects and corrections take away together.
    pub share: Option<f64>,
    /// Steps of the search, with what was held out; empty where nothing was.
    pub steps: Vec<Step>,
    /// Whether effects count for their share of the error, each residual as many samples as it holds; else for the
    /// noise that they leave.
    pub by_share: bool,
    /// Errors that free forms would still take away on estimation records, by port, in multiples of the noise; of a
    /// study.
    pub left_at: Vec<(String, f64)>,
    /// Share of the variance of the force or torque behind [`Answer::unexplained`] that a free form over its first
    /// variable explains, where the records show it.
    pub share_of_free_form: Option<f64>,
    /// Effects, selected ones first.
    pub effects: Vec<Effect>,
    /// Place and variables of what no candidate explains; the place is a channel, `channel@port`, or `@port`.
    pub unexplained: Option<(String, Vec<String>)>,
    /// Law of what no candidate explains.
    pub law: Option<Law>,
    /// Corrections of declared parameters.
    pub corrections: Vec<Correction>,
    /// Whether the declared actuator gave way to a pneumatic cylinder from first principles.
    pub cylinder: bool,
    /// Values of declared parameters that every fit was free to choose, in the corrected model.
    pub fitted: Vec<(String, f64)>,
    /// Errors of the declared and of the corrected model: estimation, validation.
    pub before: [Errors; 2],
    /// See `before`.
    pub after: [Errors; 2],
    /// Noise by signal.
    pub noise: BTreeMap<String, f64>,
    /// Error by signal that a true model shows, noise of inputs and initial states included: estimation, validation;
    /// empty where it is the noise.
    pub floor: [BTreeMap<String, f64>; 2],
    /// Normalized power of the residual of each signal under the declared and the corrected model: about 1 for noise.
    pub left: [Vec<(String, f64)>; 2],
    /// Largest of `left` that noise gives.
    pub limit: f64,
    /// Parameter vectors of the declared and of the corrected model.
    pub parameters: [Vec<f64>; 2],
    /// Effects that cannot be looked for, and why.
    pub not_testable: Vec<(String, String)>,
    /// Remarks, one sentence each.
    pub notes: Vec<String>,
}

impl Answer {
    /// Error of a signal on validation records that a true model shows; none where it is not known.
    pub fn floor_of(&self, signal: &str) -> Option<f64> {
        self.floor_on(1, signal)
    }

    /// Error of a signal on validation records in multiples of that of a true model; none where that is not known. In
    /// windows noise of the states that they start from does not count.
    pub fn times_floor(&self, errors: &Errors, signal: &str) -> Option<f64> {
        self.times_floor_on(1, errors, signal)
    }

    /// The same on estimation (0) or validation (1) records.
    pub(crate) fn times_floor_on(&self, set: usize, errors: &Errors, signal: &str) -> Option<f64> {
        errors.times(signal, self.floor_on(set, signal))
    }

    /// See [`Answer::floor_of`], on estimation (0) or validation (1) records.
    pub(crate) fn floor_on(&self, set: usize, signal: &str) -> Option<f64> {
        let floor = self.floor[set].get(signal).or(self.noise.get(signal));
        floor.copied().filter(|floor| *floor > 0.0)
    }
}

/// Fits the local parameters of records alone.
pub(super) fn fit_locals<S: System + ?Sized>(
    system: &S,
    records: &[usize],
    p: &[f64],
) -> super::engine::fit::Fit {
    let locals: Vec<Vec<f64>> =
        records.iter().map(|&r| system.locals(r).iter().map(|l| l.0).collect()).collect();
    super::engine::fit::fit(system, records, p, &[], &locals, 10)
}

/// Errors of a model on records, their initial states fitted.
pub(super) fn errors<S: System + ?Sized>(system: &S, records: &[usize], p: &[f64]) -> Errors {
    let fit = fit_locals(system, records, p);
    let parts = parallel::map(records.len(), |i| {
        let predicted = system.predict(records[i], p, &fit.locals[i]);
        let measured = system.measured(records[i]);
        system
            .signals(records[i])
            .into_iter()
            .map(|span| {
                let (m, q) = (&measured[span.range.clone()], &predicted[span.range.clone()]);
                let mean = m.iter().sum::<f64>() / m.len() as f64;
                let error: f64 = m.iter().zip(q).map(|(a, b)| (a - b).powi(2)).sum();
                let spread: f64 = m.iter().map(|a| (a - mean).powi(2)).sum();
                (span.signal, m.len(), error, spread)
            })
            .collect::<Vec<_>>()
    });
    let mut sums: BTreeMap<String, (usize, f64, f64)> = BTreeMap::new();
    for (signal, n, error, spread) in parts.into_iter().flatten() {
        let entry = sums.entry(signal).or_default();
        *entry = (entry.0 + n, entry.1 + error, entry.2 + spread);
    }
    let mut found = Errors::default();
    for (signal, (n, error, spread)) in sums {
        found.rms.insert(signal.clone(), (error / n as f64).sqrt());
        found.nrmse.insert(signal, (error / spread.max(f64::MIN_POSITIVE)).sqrt());
    }
    found
}
