//! Place of a missing effect that no candidate explains, and the variables that it depends on.

use super::coupled::Coupled;
use super::observer::{Observer, Walk};
use crate::engine::candidate::Candidate;
use crate::engine::fit::scatter;
use crate::engine::goodness::Null;
use crate::engine::search::{Model, Rules, Search};
use crate::engine::select::{Proposal, attempt};
use crate::engine::{System, parallel};
use crate::order::{ascending, descending};

/// Walks of the actuator force that are tried: of the force itself, and of its rate, which is smoother.
const FORCE_WALKS: [Walk; 7] = [
    [0.03, 0.0, 0.0, 0.0],
    [0.1, 0.0, 0.0, 0.0],
    [0.3, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.03],
    [0.0, 0.0, 0.0, 0.003],
    [0.0, 0.0, 0.0, 0.01],
    [0.03, 0.0, 0.0, 0.003],
];
/// Time advances of the force of an actuator that are tried, as shares of a sample: its values between samples are not
/// measured, and an advance looks like a mass where friction grows with the speed.
const TIME_ADVANCES: [f64; 4] = [0.5, 0.0, 0.25, 0.75];
/// Normalized power of the innovations up to which the mechanics count as explained. The disturbance of a wrong
/// actuator is not quite a random walk, so that it need not come down to that of noise.
const MAX_LOGLIKELIHOOD_LEFT: f64 = 30.0;
/// The same as a share of what the declared model leaves: gains fixed beforehand fit a much changed model less well.
const MAX_SHARE_LEFT: f64 = 2e-4;
/// Candidates that are fitted with the gains of the declared model, and those of them that get gains of their own.
const FITTED_SINGLES: usize = 6;
/// Single candidates that a pair is built on, and candidates that each of them gets.
const PAIR_BASES: usize = 3;
/// See [`FITTED_SINGLES`].
const PARTNERS_PER_BASE: usize = 3;
/// Effects that are looked for behind a wrong actuator.
const MAX_EFFECTS: usize = 2;
/// Twice the gain of the logarithm of the likelihood that an effect behind a wrong actuator must bring.
const MIN_LOGLIKELIHOOD_GAIN: f64 = 150.0;
/// Square of Student's 97.5 % quantile for six records over that of the normal law.
const SQUARED_STUDENT_OVER_NORMAL: f64 = 1.72;

/// Conclusions from the measured force about the rest of the rig.
pub struct Findings {
    /// Mechanical candidates that explain position and angle, given the measured force.
    pub effects: Option<Model>,
    /// Models that explain them about as well.
    pub tried: Vec<Model>,
    /// Sum of squares before.
    pub declared: Model,
    /// Channel of what no candidate explains, if there is such a thing.
    pub channel: Option<String>,
    /// Variables it depends on.
    pub variables: Vec<String>,
    /// Share of the variance of the estimated force or torque that a free form over the first of them explains.
    pub share_of_free_form: f64,
    /// Whether position and angle follow the measured force, with `effects` if any, whatever the declared model leaves.
    pub explained: bool,
}

/// Traces what the candidates cannot explain.
///
/// `front`: channel in front of the cart where the forces do not follow from command and motion, if there is one.
pub fn localize(
    rig: &Coupled,
    candidates: &[Candidate],
    front: Option<&str>,
    groups: &[usize],
    p: &[f64],
) -> Findings {
    let records: Vec<usize> = (0..rig.records()).filter(|&r| rig.estimation(r)).collect();
    let locals = vec![Vec::new(); records.len()];
    let force_measured = rig.trials.iter().all(|t| t.measured.iter().any(|m| m.name == "F_p"));
    let upstream = best_walk(rig, &FORCE_WALKS, p);
    let walk = upstream.walk;
    let null = Null::simulate(&upstream, &records, p, &locals, 40, 1);
    let screened: Vec<usize> =
        (0..records.len()).filter(|&i| i == 0 || groups[records[i]] != groups[records[i - 1]]).collect();
    let around = Around { rig, candidates, records: records.clone(), screened, null };
    let declared = around.search(&upstream).fit(&[], &[], p, &locals, 1);
    let mut tried = Vec::new();
    let mut best = Tuned { observer: upstream, model: declared.clone() };
    if force_measured && front == Some("actuator") {
        for _ in 0..MAX_EFFECTS {
            let search = around.search(&best.observer);
            let found = attempt(&search, &best.model, &search.screen(&best.model), FITTED_SINGLES, f64::MIN);
            let mut tuned: Vec<Tuned> =
                found.iter().take(PARTNERS_PER_BASE).map(|model| around.tuned(model)).collect();
            tried.extend(found);
            ascending(&mut tuned, |own| own.observer.cost);
            match tuned.into_iter().next() {
                Some(better) if better.observer.cost < best.observer.cost - MIN_LOGLIKELIHOOD_GAIN => {
                    best = better
                }
                _ => break,
            }
        }
    }
    let limit = MAX_LOGLIKELIHOOD_LEFT.max(MAX_SHARE_LEFT * declared.worst());
    let explained = best.model.worst() < limit;
    if let Some(channel) = front.or((force_measured && explained).then_some("actuator")) {
        let Tuned { observer, mut model } = best;
        let follows = force_measured && model.worst() < MAX_LOGLIKELIHOOD_LEFT;
        let (variables, share_of_free_form) =
            variables(&observer, &records, &model.fit.parameters, 4, channel);
        let effects = (explained && !model.added.is_empty()).then(|| {
            // What the actuator does otherwise is no white noise; few records make the quantile of their scatter wider.
            model.fit.covariance += scatter(&observer, &records, &model.fit) * SQUARED_STUDENT_OVER_NORMAL;
            model
        });
        let channel = Some(channel.into());
        return Findings {
            effects,
            tried,
            declared,
            channel,
            variables,
            share_of_free_form,
            explained: follows,
        };
    }
    let [force, .., rate] = if force_measured { walk } else { [0.0; 4] };
    let cart = best_walk(rig, &[0.03, 0.1, 0.3].map(|c| [force, c, 0.0, rate]), p);
    let pole = best_walk(rig, &[3e-4, 1e-3, 3e-3].map(|t| [force, 0.0, t, rate]), p);
    let (channel, (variables, share_of_free_form)) = if pole.cost < cart.cost {
        ("pole".to_owned(), variables(&pole, &records, p, 6, "pole"))
    } else {
        let found = variables(&cart, &records, p, 5, "cart");
        let friction = found.0.iter().any(|name| name == "xdot");
        (if friction { "cart_friction" } else { "cart" }.to_owned(), found)
    };
    let channel = Some(channel);
    Findings { effects: None, tried, declared, channel, variables, share_of_free_form, explained: false }
}

/// The pair that explains position and angle best, given the measured force: for a search over the whole rig.
///
/// `candidates`: those behind the load cell. Nothing where the force is not measured.
pub fn pair_behind(rig: &Coupled, candidates: &[Candidate], groups: &[usize], p: &[f64]) -> Option<Proposal> {
    if !rig.trials.iter().all(|t| t.measured.iter().any(|m| m.name == "F_p")) {
        return None;
    }
    let records: Vec<usize> = (0..rig.records()).filter(|&r| rig.estimation(r)).collect();
    let locals = vec![Vec::new(); records.len()];
    let observer = Observer::around(rig, FORCE_WALKS[1], 0.0, p);
    let null = Null::simulate(&observer, &records, p, &locals, 40, 1);
    let screened: Vec<usize> =
        (0..records.len()).filter(|&i| i == 0 || groups[records[i]] != groups[records[i - 1]]).collect();
    let search = Search { system: &observer, candidates, records, screened, null, rules: Rules::default() };
    let declared = search.fit(&[], &[], p, &locals, 1);
    let singles = attempt(&search, &declared, &search.screen(&declared), FITTED_SINGLES, f64::MIN);
    singles
        .iter()
        .take(PAIR_BASES)
        .flat_map(|single| attempt(&search, single, &search.screen(single), PAIR_BASES, f64::MIN))
        .min_by(|a, b| a.fit.chi2.total_cmp(&b.fit.chi2))
        .map(|pair| Proposal { added: pair.added, parameters: pair.fit.parameters })
}

/// A model with the observer that suits it best.
struct Tuned<'a> {
    observer: Observer<'a>,
    model: Model,
}

/// Data shared by all searches around observers.
struct Around<'a> {
    rig: &'a Coupled,
    candidates: &'a [Candidate],
    records: Vec<usize>,
    screened: Vec<usize>,
    null: Null,
}

impl<'a> Around<'a> {
    fn search<'s>(&'s self, observer: &'s Observer<'a>) -> Search<'s, Observer<'a>> {
        let (records, screened, null) = (self.records.clone(), self.screened.clone(), self.null.clone());
        Search {
            system: observer,
            candidates: self.candidates,
            records,
            screened,
            null,
            rules: Rules::default(),
        }
    }

    /// The random-walk intensities that suit a model, and the model fitted again with their gains.
    fn tuned(&self, model: &Model) -> Tuned<'a> {
        let refit = |observer: &Observer<'a>, model: &Model, rounds: usize| {
            self.search(observer).fit(&model.added, &[], &model.fit.parameters, &model.fit.locals, rounds)
        };
        let first = best_walk(self.rig, &FORCE_WALKS, &model.fit.parameters);
        let model = refit(&first, model, 8);
        let observer = Observer::around(self.rig, first.walk, first.time_advance, &model.fit.parameters);
        let model = refit(&observer, &model, 3);
        Tuned { observer, model }
    }
}

/// The random-walk intensities that make the records most likely, and then the time advance.
fn best_walk<'a>(rig: &'a Coupled, walks: &[Walk], p: &[f64]) -> Observer<'a> {
    let likelier =
        |best: Observer<'a>, other: Observer<'a>| if best.cost <= other.cost { best } else { other };
    let around = |walk: Walk, time_advance: f64| Observer::around(rig, walk, time_advance, p);
    let first = walks.first().copied().unwrap_or([0.1, 0.0, 0.0, 0.0]);
    let best = walks
        .iter()
        .skip(1)
        .fold(around(first, TIME_ADVANCES[0]), |best, &walk| likelier(best, around(walk, TIME_ADVANCES[0])));
    let walk = best.walk;
    TIME_ADVANCES[1..].iter().fold(best, |best, &time_advance| likelier(best, around(walk, time_advance)))
}

/// Variables that the estimated disturbance depends on: those whose bins explain most of its variance, and the share of
/// it that the bins of the first explain.
fn variables(
    observer: &Observer,
    records: &[usize],
    p: &[f64],
    disturbance: usize,
    channel: &str,
) -> (Vec<String>, f64) {
    let passes = parallel::map(records.len(), |i| observer.pass(records[i], p));
    let mut table: Vec<(&str, Vec<f64>)> =
        ["x", "xdot", "theta", "thetadot", "F"].map(|name| (name, Vec::new())).into();
    let mut values = Vec::new();
    for pass in &passes {
        // The filter needs some time to find the disturbance.
        for (state, force) in pass.states.iter().zip(&pass.force).skip(100).step_by(4) {
            let row = [state[0], state[1], state[2], state[3], *force];
            for (column, value) in table.iter_mut().zip(row) {
                column.1.push(value);
            }
            values.push(state[disturbance]);
        }
    }
    let allowed: &[&str] = match channel {
        "pole" => &["theta", "thetadot"],
        "cart" => &["x", "xdot"],
        "piston_friction" => &["x", "xdot", "F"],
        _ => &["F", "xdot", "x"],
    };
    let mut shares: Vec<(&str, f64)> = table
        .iter()
        .filter(|(name, _)| allowed.contains(name))
        .map(|(name, column)| (*name, told(column, &values)))
        .collect();
    descending(&mut shares, |own| own.1);
    let best = shares.first().map_or(0.0, |share| share.1);
    let near = shares.into_iter().filter(|(_, share)| *share > 0.7 * best);
    (near.map(|(name, _)| name.to_owned()).collect(), best)
}

/// Share of the variance of `values` that the mean over 24 bins of equal count of `variable` tells.
fn told(variable: &[f64], values: &[f64]) -> f64 {
    let mut order: Vec<usize> = (0..variable.len()).collect();
    ascending(&mut order, |&own| variable[own]);
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let total: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let size = (values.len() / 24).max(1);
    let between: f64 = order
        .chunks(size)
        .map(|bin| {
            bin.len() as f64 * (bin.iter().map(|&i| values[i]).sum::<f64>() / bin.len() as f64 - mean).powi(2)
        })
        .sum();
    if total > 0.0 { between / total } else { 0.0 }
}
