//! ARX and state-space models of rising order side by side (Fig. 5): which order is enough?

use serde::Serialize;

use super::arx::{self, Names};
use super::model::Model;
use super::record::{Experiments, Record};
use super::regressor::Regression;
use super::score::{Score, score};
use super::source::Source;
use super::structure::Structure;
use super::subspace::{self, Refinement};

/// Fit \[points\] below that of the best order that still counts as enough.
pub const MAX_FIT_LOSS: f64 = 0.5;

/// Fit \[%\] below which a model explains nothing, and no order is enough.
pub const MIN_FIT: f64 = 10.0;
/// Gain \[points\] of the last order over the one before from which higher ones are worth a try.
pub const MIN_GAIN_OF_HIGHER_ORDER: f64 = 1.0;

/// Family of models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Order n: na = n, nb = n + 1 from u(k) on, so that order 1 has A1, B0 and B1 (eq. 7).
    Arx,
    /// Order n: n states and a direct term.
    StateSpace,
}

impl Family {
    /// Name as in sentences.
    pub fn name(self) -> &'static str {
        match self {
            Family::Arx => "ARX",
            Family::StateSpace => "state space",
        }
    }
}

/// One model of the comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entry {
    /// Family.
    pub family: Family,
    /// Order.
    pub order: usize,
    /// Numbers that are estimated (for state space without the choice of the state basis, and without K).
    pub parameters: usize,
    /// Whether all poles are inside the unit circle; `None`: there is no model.
    pub stable: Option<bool>,
    /// Fits on the estimation records.
    pub estimation: Option<Score>,
    /// Fits on the validation records.
    pub validation: Option<Score>,
    /// Method of estimation, or the reason why there is no model.
    pub note: String,
}

impl Entry {
    /// Mean simulated fit \[%\] on validation data; `None` for an unstable model or none.
    pub fn fit(&self) -> Option<f64> {
        self.validation.as_ref()?.mean_fit_simulated
    }
}

/// Estimates all ARX orders of a range from one factorization.
///
/// # Errors
/// [`arx::Error`] of the data; what one order lacks stands in its entry.
pub fn arx_orders(
    data: &Experiments,
    orders: std::ops::RangeInclusive<usize>,
) -> Result<Vec<Entry>, arx::Error> {
    let channels = (data.inputs.len(), data.outputs.len());
    let structure = |order: usize| Structure::uniform(channels, order, order + 1, 0);
    let sources: Vec<&dyn Source> = data.estimation.iter().map(|record| record as &dyn Source).collect();
    let offsets = (data.input_offset.as_slice(), data.output_offset.as_slice());
    let names = Names { inputs: &data.inputs, outputs: &data.outputs };
    let regression = Regression::of(&sources, &structure(*orders.end()), offsets)?;
    let entry = |order: usize| {
        let structure = structure(order);
        let parameters = structure.parameters();
        match arx::solve(&regression, &structure, data.sample_time, offsets, names) {
            Ok(found) => judged(Family::Arx, order, parameters, &found.model, data, String::new()),
            Err(error) => none(Family::Arx, order, parameters, error.to_string()),
        }
    };
    Ok(orders.map(entry).collect())
}

/// Estimates all state-space orders of a range from one factorization; `done` is called after each.
///
/// # Errors
/// [`subspace::Error`] of the data; what one order lacks stands in its entry.
pub fn state_space_orders(
    data: &Experiments,
    orders: std::ops::RangeInclusive<usize>,
    options: &subspace::Options,
    refinement: Refinement,
    mut done: impl FnMut(),
) -> Result<Vec<Entry>, subspace::Error> {
    let (n_u, n_y) = (data.inputs.len(), data.outputs.len());
    let found = subspace::estimate_orders(&data.estimation, *orders.end(), options)?;
    let mut entries = Vec::new();
    for (index, found) in found.into_iter().enumerate() {
        let order = index + 1;
        if !orders.contains(&order) {
            continue;
        }
        let parameters = order * (n_u + n_y) + n_u * n_y;
        entries.push(match found {
            Err(error) => none(Family::StateSpace, order, parameters, error.to_string()),
            Ok(start) => {
                let refined = subspace::refine(&data.estimation, &start, options, refinement)?;
                let notes = [vec![start.method.describe()], start.warnings, vec![refined.note]].concat();
                let notes: Vec<String> = notes.into_iter().filter(|note| !note.is_empty()).collect();
                judged(Family::StateSpace, order, parameters, &refined.model, data, notes.join("; "))
            }
        });
        done();
    }
    Ok(entries)
}

fn judged(
    family: Family,
    order: usize,
    parameters: usize,
    model: &dyn Model,
    data: &Experiments,
    note: String,
) -> Entry {
    let scored = |records: &[Record]| Some(score(model, records, &data.outputs));
    Entry {
        family,
        order,
        parameters,
        stable: Some(model.is_stable()),
        estimation: scored(&data.estimation),
        validation: scored(&data.validation),
        note,
    }
}

fn none(family: Family, order: usize, parameters: usize, note: String) -> Entry {
    Entry { family, order, parameters, stable: None, estimation: None, validation: None, note }
}

/// The smallest stable order of a family whose simulated fit on validation data is within [`MAX_FIT_LOSS`] of the best
/// of the family; `None` if none is stable, or none reaches [`MIN_FIT`].
pub fn enough(entries: &[Entry], family: Family) -> Option<&Entry> {
    let own = || entries.iter().filter(move |entry| entry.family == family);
    let best = own().filter_map(Entry::fit).fold(f64::NEG_INFINITY, f64::max);
    own().find(|entry| entry.fit().is_some_and(|fit| best >= MIN_FIT && fit >= best - MAX_FIT_LOSS))
}

/// Whether the last order of a family that was tried is the best, and by more than [`MIN_GAIN_OF_HIGHER_ORDER`] better
/// than the one before.
fn rising(entries: &[Entry], family: Family) -> bool {
    let mut own: Vec<&Entry> = entries.iter().filter(|entry| entry.family == family).collect();
    own.sort_by_key(|entry| entry.order);
    let [.., before, last] = own[..] else { return false };
    let others = own.iter().filter(|entry| entry.order < last.order).filter_map(|entry| entry.fit());
    let (Some(fit), most) = (last.fit(), others.fold(f64::NEG_INFINITY, f64::max)) else { return false };
    // The order before may be unstable; then the best of the others counts.
    let reference = before.fit().unwrap_or(most);
    fit > most && most.is_finite() && fit > reference + MIN_GAIN_OF_HIGHER_ORDER
}

/// Causes to look at if no model explains the data.
const REMEDY: &str = "the plant may be unstable, an input may not reach the outputs, or means are large against the spread of the signals (--detrend mean)";

/// Verdict on the sufficient order, with reasons: a sentence for each family, one that compares them, and one on
/// unstable models.
pub fn verdict(entries: &[Entry]) -> Vec<String> {
    let mut sentences = Vec::new();
    let mut chosen = Vec::new();
    for family in [Family::Arx, Family::StateSpace] {
        let own: Vec<&Entry> = entries.iter().filter(|entry| entry.family == family).collect();
        let fitted = || own.iter().filter_map(|entry| Some((entry.fit()?, entry.order)));
        let Some((best, best_order)) = fitted().max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))) else {
            if !own.is_empty() {
                sentences.push(format!("{}: no order gives a stable model; {REMEDY}", family.name()));
            }
            continue;
        };
        let Some(entry) = enough(entries, family) else {
            let [first, last] = [own.first(), own.last()].map(|entry| entry.map_or(0, |entry| entry.order));
            sentences.push(format!(
                "{}: no order from {first} to {last} explains the data: the best, order {best_order}, fits validation data to {best:.2} % in simulation; {REMEDY}",
                family.name()
            ));
            continue;
        };
        let (order, fit) = (entry.order, entry.fit().unwrap_or(best));
        chosen.push((family, order, fit, entry.parameters));
        sentences.push(if rising(entries, family) {
            let option = match family {
                Family::Arx => "--arx",
                Family::StateSpace => "--state-space",
            };
            format!(
                "{}: order {best_order} is the best with a simulated fit of {best:.2} % on validation data, but the fit is still rising at the last order tried; raise {option}",
                family.name()
            )
        } else if order == best_order {
            let lowest = own.iter().all(|entry| entry.order >= order);
            let lower = format!(", and lower orders lose more than {MAX_FIT_LOSS} points");
            format!(
                "{}: order {order} is enough; its simulated fit of {fit:.2} % on validation data is the best of all orders tried{}",
                family.name(),
                if lowest { "" } else { &lower }
            )
        } else {
            format!(
                "{}: order {order} is enough; it fits validation data to {fit:.2} % in simulation, and higher orders gain {:.2} points at most (order {best_order}: {best:.2} %)",
                family.name(),
                best - fit
            )
        });
    }
    if let [(_, arx, arx_fit, arx_count), (_, space, space_fit, space_count)] = chosen[..] {
        let gain = space_fit - arx_fit;
        let (better, by) = if gain > 0.0 { ("state space", gain) } else { ("ARX", -gain) };
        sentences.push(if by <= MAX_FIT_LOSS {
            format!(
                "ARX of order {arx} ({arx_count} coefficients) and state space of order {space} ({space_count}) are as good as each other: {arx_fit:.2} % and {space_fit:.2} %"
            )
        } else {
            format!(
                "{better} is better by {by:.2} points: ARX of order {arx} with {arx_count} coefficients reaches {arx_fit:.2} %, state space of order {space} with {space_count} reaches {space_fit:.2} %"
            )
        });
    }
    let unstable: Vec<String> = entries
        .iter()
        .filter(|entry| entry.stable == Some(false))
        .map(|entry| format!("{} {}", entry.family.name(), entry.order))
        .collect();
    if !unstable.is_empty() {
        sentences.push(format!("unstable, and therefore without a simulated fit: {}", unstable.join(", ")));
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(family: Family, order: usize, fit: Option<f64>) -> Entry {
        let score = Score { mean_fit_simulated: fit, ..Score::default() };
        Entry {
            validation: Some(score),
            stable: Some(fit.is_some()),
            ..none(family, order, 3 * order, String::new())
        }
    }

    #[test]
    fn the_smallest_order_near_the_best_is_enough_and_unstable_ones_are_named() {
        let entries = [
            entry(Family::Arx, 1, Some(87.7)),
            entry(Family::Arx, 2, Some(87.9)),
            entry(Family::Arx, 3, None),
            entry(Family::StateSpace, 1, Some(85.0)),
            entry(Family::StateSpace, 2, Some(90.0)),
            entry(Family::StateSpace, 3, Some(91.2)),
        ];
        assert_eq!(enough(&entries, Family::Arx).unwrap().order, 1);
        assert_eq!(enough(&entries, Family::StateSpace).unwrap().order, 3);
        let verdict = verdict(&entries).join("\n");
        for part in [
            "ARX: order 1 is enough",
            "gain 0.20 points",
            "state space: order 3 is the best",
            "raise --state-space",
            "ARX 3",
            "3.50 points",
        ] {
            assert!(verdict.contains(part), "{part}\n{verdict}");
        }
    }

    #[test]
    fn a_family_without_a_stable_model_is_said_to_have_none() {
        let sentences = verdict(&[entry(Family::Arx, 1, None)]);
        assert!(sentences[0].starts_with("ARX: no order gives a stable model; "), "{sentences:?}");
        assert!(enough(&[entry(Family::Arx, 1, None)], Family::Arx).is_none());
    }

    #[test]
    fn a_family_that_fits_next_to_nothing_is_not_called_enough() {
        let entries = [entry(Family::Arx, 1, Some(0.4)), entry(Family::Arx, 2, Some(0.3))];
        let sentences = verdict(&entries);
        assert!(sentences[0].contains("no order from 1 to 2 explains the data"), "{sentences:?}");
        assert!(enough(&entries, Family::Arx).is_none());
    }

    #[test]
    fn a_fit_that_has_settled_at_the_last_order_is_not_rising() {
        let settled = [entry(Family::Arx, 1, Some(60.0)), entry(Family::Arx, 2, Some(60.9))];
        assert!(!rising(&settled, Family::Arx) && !rising(&settled[..1], Family::Arx));
        let below = [entry(Family::Arx, 1, Some(80.0)), entry(Family::Arx, 2, Some(60.9))];
        assert!(!rising(&below, Family::Arx));
        assert!(rising(&[entry(Family::Arx, 1, Some(60.0)), entry(Family::Arx, 2, Some(62.0))], Family::Arx));
    }
}
