//! Subspace identification of state-space models: N4SID, PO-MOESP and CVA (Van Overschee and De Moor, Subspace
//! Identification for Linear Systems, Kluwer 1996).
//!
//! | module | what |
//! |--------|------|
//! | `data` | records about the operating point, scaled |
//! | [`pieces`] | pieces of records that stand for all, or are held out |
//! | `hankel` | triangular factor of past and future |
//! | [`projection`] | weighted projection: observability matrix, state |
//! | [`realization`] | A and C; mirrored poles |
//! | `input_terms` | B and D on the simulated output |
//! | `gain`, `riccati` | innovation gain |
//! | [`candidates`] | every weighting and horizon for one order |
//! | [`refined`] | output-error or prediction-error refinement, where it helps on held-out samples |
//!
//! Start with [`estimate`] and [`refine`].

pub mod candidates;
mod data;
mod gain;
mod hankel;
mod input_terms;
pub mod pieces;
pub mod projection;
pub mod realization;
pub mod refined;
mod riccati;

pub use candidates::Method;
pub use projection::Weighting;
pub use realization::Realization;
pub use refined::{Refined, Refinement, refine};

use candidates::{Candidates, relative_error};
use data::{Scale, Segment, scaled};

use super::model::{Model, StateSpace};
use super::record::Record;

/// Widest factor: beyond it horizons cost more time than they bring.
const MAX_FACTOR_WIDTH: usize = 200;
/// Error relative to the signal that counts as none: rounding of the data and of the numerics.
pub const EXACT_RELATIVE_ERROR: f64 = 1e-6;
/// An order is enough if its error on held-out samples is at most this much above that of the best order.
const MAX_RELATIVE_ERROR_TO_BEST: f64 = 1.02;

/// Order of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// As given.
    Fixed(usize),
    /// The smallest order that is as good as any up to this one, on held-out samples.
    UpTo(usize),
}

/// Settings of [`estimate`].
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Order.
    pub order: Order,
    /// Weightings tried; the one with the least simulated error is taken. Default: all.
    pub weightings: Vec<Weighting>,
    /// Past and future samples of the Hankel matrices. Default: a quarter, half, three quarters and all of the longest
    /// that the data allow are tried.
    pub horizon: Option<usize>,
    /// Whether there is a direct term D. Default: yes.
    pub direct: bool,
    /// Whether poles outside the unit circle are mirrored at it. Default: no.
    pub mirror_unstable: bool,
    /// Operating point of the inputs, shape \[n_u\].
    pub input_offset: Vec<f64>,
    /// Operating point of the outputs, shape \[n_y\].
    pub output_offset: Vec<f64>,
}

impl Options {
    /// Defaults for an order about an operating point: offsets of inputs \[n_u\] and outputs \[n_y\] in their units.
    pub fn new(order: Order, input_offset: &[f64], output_offset: &[f64]) -> Options {
        Options {
            order,
            weightings: Weighting::ALL.to_vec(),
            horizon: None,
            direct: true,
            mirror_unstable: false,
            input_offset: input_offset.to_vec(),
            output_offset: output_offset.to_vec(),
        }
    }
}

/// Result of [`estimate`].
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The model, with its innovation gain.
    pub model: StateSpace,
    /// Method of estimation.
    pub method: Method,
    /// Singular values of the projection it comes from, the largest first.
    pub singular_values: Vec<f64>,
    /// Errors of the orders tried; empty if the order was given.
    pub orders: Vec<OrderError>,
    /// Warnings to the user, one sentence each.
    pub warnings: Vec<String>,
}

/// One order of the order search.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OrderError {
    /// Order n.
    pub order: usize,
    /// Relative RMS error of the simulation on the held-out samples, the mean over the outputs; `None`: unstable.
    pub held_out: Option<f64>,
}

/// Reason why a model cannot be estimated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "values as named in each message")]
pub enum Error {
    /// Too few samples.
    #[error(
        "the records are too short for order {order}: block Hankel matrices of {horizon} past and future samples need records of at least {needed} samples, the longest has {found}; record more, or lower the order"
    )]
    TooShort { order: usize, horizon: usize, needed: usize, found: usize },
    /// Order 0.
    #[error("the order is 0; a state-space model has at least one state: choose 1 or more")]
    NoOrder,
    /// The horizon leaves no room for the order.
    #[error(
        "a horizon of {horizon} samples shows at most order {most} with {n_y} outputs, not {order}; choose a longer horizon or a lower order"
    )]
    Horizon { horizon: usize, order: usize, most: usize, n_y: usize },
    /// The projection has fewer directions than the order.
    #[error(
        "the data show no model of order {order}: the singular values end at order {rank}; choose order {rank} or lower, or an input that excites more"
    )]
    Rank { order: usize, rank: usize },
    /// Records of different shape.
    #[error(
        "record `{record}` has {inputs} inputs and {outputs} outputs of equal length, or not; {n_u} and {n_y} are expected"
    )]
    Channels { record: String, inputs: usize, outputs: usize, n_u: usize, n_y: usize },
    /// A channel that never changes.
    #[error("{kind} {} is constant in all records and says nothing of the system; leave it out or record a change", index + 1)]
    Constant { kind: &'static str, index: usize },
    /// NaN or infinite.
    #[error("record `{record}`: {kind} {} is {value} at sample {sample}; cut the record or repair the sample", index + 1)]
    NotFinite { record: String, kind: &'static str, index: usize, sample: usize, value: f64 },
    /// Squares overflow.
    #[error("record `{record}`: {kind} {} is {value:e} at sample {sample}, too large for sums of squares; repair the sample, or scale the signal", index + 1)]
    TooLarge { record: String, kind: &'static str, index: usize, sample: usize, value: f64 },
    /// Numerics.
    #[error(
        "no model of order {order} came out with finite numbers; choose a lower order or check the data for outliers"
    )]
    NoModel { order: usize },
}

/// Estimates a state-space model from one or several records.
///
/// All weightings and horizons that the options allow give a candidate; the one whose free simulation is closest to the
/// estimation data is taken, stable ones first. B and D are then fitted on all samples, with an initial state for
/// every record.
///
/// # Errors
/// [`Error`].
pub fn estimate(records: &[Record], options: &Options) -> Result<Estimate, Error> {
    let (segments, scale) = scaled(records, &options.input_offset, &options.output_offset)?;
    match options.order {
        Order::Fixed(0) | Order::UpTo(0) => Err(Error::NoOrder),
        Order::Fixed(order) => {
            let horizons = horizons(&segments, order, options)?;
            let candidates = candidates(&segments, &horizons, options);
            fixed(&candidates, &scale, order)
        }
        Order::UpTo(highest) => {
            let orders = order_search(&segments, highest, options)?;
            let order = enough(&orders);
            let horizons = horizons(&segments, order, options)?;
            let candidates = candidates(&segments, &horizons, options);
            let mut estimate = fixed(&candidates, &scale, order)?;
            if order == highest {
                estimate.warnings.push(format!(
                    "order {highest} is the highest that was tried and still the best; try higher ones"
                ));
            }
            estimate.orders = orders;
            Ok(estimate)
        }
    }
}

/// Estimates of the orders 1 to `highest` from one factorization; an order may fail.
///
/// # Errors
/// [`Error`] of the records.
pub fn estimate_orders(
    records: &[Record],
    highest: usize,
    options: &Options,
) -> Result<Vec<Result<Estimate, Error>>, Error> {
    let (segments, scale) = scaled(records, &options.input_offset, &options.output_offset)?;
    let horizons = horizons(&segments, highest, options)?;
    let candidates = candidates(&segments, &horizons, options);
    Ok((1..=highest).map(|order| fixed(&candidates, &scale, order)).collect())
}

fn candidates<'a>(segments: &'a [Segment], horizons: &[usize], options: &Options) -> Candidates<'a> {
    Candidates::new(segments, horizons, &options.weightings, options.direct, options.mirror_unstable)
}

fn fixed(candidates: &Candidates, scale: &Scale, order: usize) -> Result<Estimate, Error> {
    let found = candidates.of_order(order);
    let best = found.first().ok_or_else(|| {
        let rank = candidates.rank();
        if rank < order { Error::Rank { order, rank } } else { Error::NoModel { order } }
    })?;
    let matrices = candidates.on_all_samples(best).ok_or(Error::NoModel { order })?;
    let gain = candidates.gain(&best.method, &matrices);
    let mut warnings = Vec::new();
    if gain.is_none() {
        warnings.push("the Riccati equation of the innovation gain has no stabilizing solution; the one-step prediction is the simulation".into());
    }
    let values = candidates.input_singular_values();
    let excited = values.iter().filter(|&&value| value > 1e-9 * values[0]).count();
    let wanted = (2 * order + 1) * scale.input.len();
    if excited < wanted.min(values.len()) {
        warnings.push(format!(
            "the inputs excite {excited} directions, order {order} takes {wanted}: poles and coefficients are poorly determined; use an input with more frequencies"
        ));
    }
    let model = scale.physical(&matrices, gain.as_ref());
    if best.method.stabilized {
        warnings.push("poles outside the unit circle were mirrored at it, and B and D fitted again".into());
    } else if !model.is_stable() {
        warnings.push(format!(
            "no weighting and horizon gives a stable model of order {order}; try another order, or have unstable poles mirrored at the unit circle"
        ));
    }
    let singular_values = candidates.singular_values(&best.method);
    Ok(Estimate { model, method: best.method, singular_values, orders: Vec::new(), warnings })
}

/// Past and future samples to try: a quarter, half, three quarters and all of the longest, which leaves at least twice
/// as many rows as columns and no more than [`MAX_FACTOR_WIDTH`] columns.
fn horizons(segments: &[Segment], order: usize, options: &Options) -> Result<Vec<usize>, Error> {
    let (n_u, n_y) = (options.input_offset.len(), options.output_offset.len());
    let n_z = n_u + n_y;
    let longest = segments.iter().map(Segment::len).max().unwrap_or(0);
    let rows = |horizon: usize| -> usize {
        segments.iter().map(|segment| (segment.len() + 1).saturating_sub(2 * horizon)).sum()
    };
    // Shift invariance needs a row block more than the states.
    let least = order.div_ceil(n_y) + 1;
    let fits = |horizon: usize, factor: usize| rows(horizon) >= factor * 2 * horizon * n_z;
    let too_short = |horizon: usize| {
        let needed = 2 * horizon * n_z + 2 * horizon;
        Err(Error::TooShort { order, horizon, needed, found: longest })
    };
    if let Some(horizon) = options.horizon {
        if horizon < least {
            let most = horizon.saturating_sub(1) * n_y;
            return Err(Error::Horizon { horizon, order, most, n_y });
        }
        return if fits(horizon, 1) { Ok(vec![horizon]) } else { too_short(horizon) };
    }
    if !fits(least, 1) {
        return too_short(least);
    }
    let mut most = (MAX_FACTOR_WIDTH / (2 * n_z)).max(least);
    while most > least && !fits(most, 2) {
        most -= 1;
    }
    let mut tried: Vec<usize> =
        [most.div_ceil(4), most.div_ceil(2), (3 * most).div_ceil(4), most].map(|h| h.max(least)).to_vec();
    tried.dedup();
    Ok(tried)
}

/// Errors of the orders 1 to `highest` on held-out samples, estimated from the rest.
fn order_search(segments: &[Segment], highest: usize, options: &Options) -> Result<Vec<OrderError>, Error> {
    let lengths: Vec<usize> = segments.iter().map(Segment::len).collect();
    let (used, kept) = pieces::held_out(&lengths);
    let cut = |pieces: Vec<pieces::Piece>| -> Vec<Segment> {
        pieces.into_iter().map(|(index, from, n)| segments[index].part(from, n)).collect()
    };
    let (used, kept) = (cut(used), cut(kept));
    // A short record bounds the order rather than ending the search.
    let highest = (1..=highest).rev().find(|&order| horizons(&used, order, options).is_ok()).unwrap_or(1);
    let horizons = horizons(&used, highest, options)?;
    let candidates = candidates(&used, &horizons, options);
    let kept = data::sparse(&kept, candidates::COMPARED_SAMPLES);
    let orders = (1..=highest).map(|order| {
        let found = candidates.of_order(order);
        let best = found.first().filter(|best| best.stable);
        let held_out = best.map(|best| relative_error(&kept, &best.model)).filter(|error| error.is_finite());
        OrderError { order, held_out }
    });
    Ok(orders.collect())
}

/// The smallest order that is as good as the best.
fn enough(orders: &[OrderError]) -> usize {
    let best = orders.iter().filter_map(|order| order.held_out).fold(f64::INFINITY, f64::min);
    let is_enough = |order: &&OrderError| {
        order.held_out.is_some_and(|error| error <= MAX_RELATIVE_ERROR_TO_BEST * best + EXACT_RELATIVE_ERROR)
    };
    orders.iter().find(is_enough).map_or(1, |order| order.order)
}

#[cfg(test)]
mod tests;
