//! Refinement of a subspace estimate by output error or prediction error, where it helps on held-out samples.

use nalgebra::DMatrix;

use super::candidates::{COMPARED_SAMPLES, Candidates};
use super::{Error, Estimate, Options, Order, estimate};
use super::{data, pieces};
use crate::model::StateSpace;
use crate::output_error::{
    Criterion, Options as Iterations, Outcome, RefinedStateSpace, StateSpaceOptions, refine_state_space,
};
use crate::record::Record;
use crate::score::score;

/// Samples the refinement works on; longer records are represented by pieces spread over them.
const REFINED_SAMPLES: usize = 100_000;
/// Iterations: most refinements settle within these, or change the model hardly any more.
const ITERATIONS: usize = 25;
/// Samples times squared number of parameters times iterations that are worth the time; at least 5 iterations are made.
const MAX_WORK: f64 = 3e8;

/// Loss of fit \[points\] on held-out samples that is no evidence against the refinement.
const MAX_FIT_LOSS: f64 = 0.25;

/// Criterion of the refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Refinement {
    /// Nothing: the subspace estimate itself.
    None,
    /// The free simulation.
    OutputError,
    /// The one-step prediction, with its gain.
    PredictionError,
}

/// Outcome of [`refine`].
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// The model that is recommended: refined if that helped, else as it was; with its innovation gain.
    pub model: StateSpace,
    /// Whether `model` is the refined one.
    pub taken: bool,
    /// Fit \[%\] on held-out samples, estimated from the rest, without and with refinement: of the simulation or of the
    /// prediction, whichever was refined; the first is minus infinity for an unstable model. `None`: not tested.
    pub held_out: Option<(f64, f64)>,
    /// The refinement with its covariance, if it was taken.
    pub details: Option<RefinedStateSpace>,
    /// Outcome in a sentence.
    pub note: String,
}

/// Refines `start`, an estimate from `records` with `options`.
///
/// A refined model fits the estimation data better as a matter of course. It is taken only if, estimated from a part of
/// the data, it fits the rest no worse (every second record, or else the last third of every record).
///
/// # Errors
/// [`Error`] of an estimate.
pub fn refine(
    records: &[Record],
    start: &Estimate,
    options: &Options,
    refinement: Refinement,
) -> Result<Refined, Error> {
    let unchanged = |note: String, held_out| Refined {
        model: start.model.clone(),
        taken: false,
        held_out,
        details: None,
        note,
    };
    let (criterion, what) = match refinement {
        Refinement::None => return Ok(unchanged(String::new(), None)),
        Refinement::OutputError => (Criterion::Simulation, "output error"),
        Refinement::PredictionError => (Criterion::Prediction, "prediction error"),
    };
    let settings = StateSpaceOptions {
        iterations: Iterations { iterations: iterations(records, start), ..Iterations::default() },
        criterion,
        direct_term: options.direct,
    };
    let held_out = on_held_out_samples(records, start.model.order(), options, &settings);
    match held_out {
        None => {
            return Ok(unchanged(
                format!(
                    "not refined by {what}: the records are too short, or not stable enough, to test it on held-out samples"
                ),
                None,
            ));
        }
        Some((before, after)) if after < before - MAX_FIT_LOSS => {
            return Ok(unchanged(
                format!(
                    "not refined by {what}: on held-out samples the fit would fall from {before:.2} % to {after:.2} %"
                ),
                held_out,
            ));
        }
        _ => {}
    }
    let Ok(details) = refine_state_space(&start.model, &some(records), &settings) else {
        return Ok(unchanged(format!("not refined by {what}: the records are too short"), held_out));
    };
    let mut model = details.model.clone();
    if criterion == Criterion::Simulation {
        model.gain = gain(records, &model, start, options)?;
    }
    let limit = if details.outcome == Outcome::Converged { "" } else { ", not to the end" };
    let tested = match held_out {
        Some((before, after)) if before.is_finite() => {
            format!("on held-out samples the fit is {after:.2} %, without refinement {before:.2} %")
        }
        _ => "without refinement the model is unstable on held-out samples".into(),
    };
    let note = format!("refined by {what} in {} iterations{limit}; {tested}", details.iterations);
    Ok(Refined { model, taken: true, held_out, details: Some(details), note })
}

/// Iterations that fit into [`MAX_WORK`].
fn iterations(records: &[Record], start: &Estimate) -> usize {
    let samples = records.iter().map(Record::len).sum::<usize>().min(REFINED_SAMPLES) as f64;
    let (n, (n_y, n_u)) = (start.model.order(), start.model.d.shape());
    let parameters = (n * (n_u + n_y) + n_y * n_u) as f64;
    ((MAX_WORK / (samples * parameters * parameters)) as usize).clamp(5, ITERATIONS)
}

/// Fits \[%\] without and with refinement on held-out samples.
fn on_held_out_samples(
    records: &[Record],
    order: usize,
    options: &Options,
    settings: &StateSpaceOptions,
) -> Option<(f64, f64)> {
    let (used, kept) = pieces::held_out(&pieces::lengths(records));
    let (used, kept) = (pieces::cut(records, &used), pieces::cut(records, &kept));
    let options = Options { order: Order::Fixed(order), ..options.clone() };
    let before = estimate(&used, &options).ok()?.model;
    let after = refine_state_space(&before, &some(&used), settings).ok()?.model;
    let names: Vec<String> = (0..before.d.nrows()).map(|i| i.to_string()).collect();
    let kept = some(&kept);
    let fit = |model: &StateSpace| {
        let score = score(model, &kept, &names);
        match settings.criterion {
            Criterion::Simulation => score.mean_fit_simulated,
            Criterion::Prediction => score.mean_fit_one_step,
        }
    };
    // Whatever is refined is better than what has no simulation at all.
    let after = fit(&after)?;
    Some((fit(&before).unwrap_or(f64::NEG_INFINITY), after))
}

/// Innovation gain of the refined model.
fn gain(
    records: &[Record],
    model: &StateSpace,
    start: &Estimate,
    options: &Options,
) -> Result<Option<DMatrix<f64>>, Error> {
    let (segments, scale) = data::scaled(records, &options.input_offset, &options.output_offset)?;
    let some = data::sparse(&segments, COMPARED_SAMPLES);
    let method = &start.method;
    let candidates = Candidates::new(&some, &[method.horizon], &[method.weighting], options.direct, false);
    let gain = candidates.gain(method, &scale.scaled(model));
    Ok(gain.map(|gain| gain * DMatrix::from_diagonal(&scale.output.map(|scale| 1.0 / scale))))
}

/// The records, or pieces of them if there are more samples than are worth the time.
fn some(records: &[Record]) -> Vec<Record> {
    pieces::cut(records, &pieces::spread(&pieces::lengths(records), REFINED_SAMPLES))
}
