//! Where something is missing when no candidate explains it, and what it depends on.

use super::coupled::Coupled;
use super::observer::{Observer, Walk};
use crate::refine::engine::candidate::Candidate;
use crate::refine::engine::fit::scatter;
use crate::refine::engine::goodness::Null;
use crate::refine::engine::search::{Model, Search};
use crate::refine::engine::select::attempt;
use crate::refine::engine::{System, parallel};

/// Walks of the actuator force that are tried \[N per sample\].
const FORCE_WALKS: [f64; 3] = [0.03, 0.1, 0.3];
/// Normalised power of the innovations up to which the mechanics count as explained. The disturbance of a wrong actuator
/// is not quite a random walk, so that it need not come down to that of noise.
const EXPLAINED: f64 = 30.0;
/// The same as a share of what the declared model leaves: gains fixed beforehand fit a much changed model less well.
const EXPLAINED_SHARE: f64 = 2e-4;

/// Square of Student's 97.5 % quantile for six records over that of the normal law.
const FEW_RECORDS: f64 = 1.72;

/// What the measured force says about the rest of the rig.
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
}

/// Traces what the candidates cannot explain.
///
/// `pressure_fits`: whether the pressure force follows the command as declared (`None`: it is not measured).
pub fn localise(
    rig: &Coupled,
    candidates: &[Candidate],
    pressure_fits: Option<bool>,
    groups: &[usize],
    p: &[f64],
) -> Findings {
    let records: Vec<usize> = (0..rig.records()).filter(|&r| rig.estimation(r)).collect();
    let locals = vec![Vec::new(); records.len()];
    let force_measured = rig.trials.iter().all(|t| t.measured.iter().any(|m| m.name == "F_p"));
    let upstream = best_walk(rig, FORCE_WALKS.map(|q| [q, 0.0, 0.0]), p);
    let null = Null::simulate(&upstream, &records, p, &locals, 40, 1);
    let screened: Vec<usize> =
        (0..records.len()).filter(|&i| i == 0 || groups[records[i]] != groups[records[i - 1]]).collect();
    let search = Search { system: &upstream, candidates, records: records.clone(), screened, null };
    let declared = search.fit(&[], &[], p, &locals, 1);
    let limit = EXPLAINED.max(EXPLAINED_SHARE * declared.worst());
    let explained = |model: &Model| model.worst() < limit;
    let (mut effects, mut tried) = (None, Vec::new());
    if force_measured && explained(&declared) {
        let channel = if pressure_fits == Some(true) { "piston_friction" } else { "actuator" };
        let variables = variables(&upstream, &records, p, 4, channel);
        return Findings { effects, tried, declared, channel: Some(channel.into()), variables };
    }
    if force_measured && pressure_fits == Some(false) {
        let promises = search.screen(&declared);
        tried = attempt(&search, &declared, &promises, &[], 6, f64::MIN);
        if !tried.first().is_some_and(explained) {
            let pairs = tried
                .iter()
                .take(2)
                .flat_map(|base| attempt(&search, base, &search.screen(base), &[], 3, f64::MIN));
            let mut pairs: Vec<Model> = pairs.collect();
            pairs.sort_by(|a, b| a.fit.chi2.total_cmp(&b.fit.chi2));
            tried.extend(pairs);
        }
        effects = tried.iter().find(|model| explained(model)).cloned();
        if let Some(model) = &mut effects {
            // What the actuator does otherwise is no white noise; few records make the quantile of their scatter wider.
            model.fit.covariance += scatter(&upstream, &records, &model.fit) * FEW_RECORDS;
            let variables = variables(&upstream, &records, &model.fit.parameters, 4, "actuator");
            return Findings { effects, tried, declared, channel: Some("actuator".into()), variables };
        }
    }
    let q = upstream.walk[0];
    let upstream_walk = if force_measured { q } else { 0.0 };
    let cart = best_walk(rig, [0.03, 0.1, 0.3].map(|c| [upstream_walk, c, 0.0]), p);
    let pole = best_walk(rig, [3e-4, 1e-3, 3e-3].map(|t| [upstream_walk, 0.0, t]), p);
    let (channel, variables) = if pole.cost < cart.cost {
        ("pole".to_owned(), variables(&pole, &records, p, 6, "pole"))
    } else {
        let names = variables(&cart, &records, p, 5, "cart");
        let friction = names.iter().any(|name| name == "xdot");
        (if friction { "cart_friction" } else { "cart" }.to_owned(), names)
    };
    Findings { effects, tried, declared, channel: Some(channel), variables }
}

/// The walk that makes the records most likely.
fn best_walk<'a, const N: usize>(rig: &'a Coupled, walks: [Walk; N], p: &[f64]) -> Observer<'a> {
    let mut all = walks.map(|walk| Observer::around(rig, walk, p)).into_iter();
    let first = all.next();
    let best = all.fold(first, |best, other| match best {
        Some(best) if best.cost <= other.cost => Some(best),
        _ => Some(other),
    });
    best.unwrap_or_else(|| Observer::around(rig, [0.1, 0.0, 0.0], p))
}

/// Variables that the estimated disturbance depends on: those whose bins tell most of its variance.
fn variables(
    observer: &Observer,
    records: &[usize],
    p: &[f64],
    disturbance: usize,
    channel: &str,
) -> Vec<String> {
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
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let best = shares.first().map_or(0.0, |share| share.1);
    shares.into_iter().filter(|(_, share)| *share > 0.7 * best).map(|(name, _)| name.to_owned()).collect()
}

/// Share of the variance of `values` that the mean over 24 bins of equal count of `variable` tells.
fn told(variable: &[f64], values: &[f64]) -> f64 {
    let mut order: Vec<usize> = (0..variable.len()).collect();
    order.sort_by(|&a, &b| variable[a].total_cmp(&variable[b]));
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
