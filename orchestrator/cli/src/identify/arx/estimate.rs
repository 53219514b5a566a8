//! The estimation itself: least squares, and from there what `--method` asks for.

use nalgebra::DMatrix;
use serde_json::{Value, json};

use super::{Args, MethodChoice};
use crate::identify::data::Loaded;
use airloop::Error;
use airloop_ident::arx::{self, Estimate, Names};
use airloop_ident::diagnostics::Kind;
use airloop_ident::excitation::{Excitation, excitation};
use airloop_ident::model::file::rows;
use airloop_ident::model::{Arx, Model};
use airloop_ident::output_error::OutputError;
use airloop_ident::parameters::Parameters;
use airloop_ident::playback::Playback;
use airloop_ident::rational::Mask;
use airloop_ident::score::{RecordScore, Score, Tally};
use airloop_ident::source::Source;
use airloop_ident::structure::Structure;
use airloop_ident::{instrumental_variables, output_error};

/// Condition number of the regressors above which small errors of the data turn into large ones of the coefficients.
const MAX_CONDITION_NUMBER: f64 = 3e4;

/// Samples per coefficient of an output below which a fit says little.
pub const SAMPLES_PER_COEFFICIENT: usize = 10;

/// Time constants of the slowest pole in the longest record, where poles that are slower serve as offsets.
const TIME_CONSTANTS_PER_RECORD: f64 = 3.0;

/// An estimated model with what is known about it.
pub struct Estimated {
    /// Model.
    pub model: Arx,
    /// Its structure.
    pub structure: Structure,
    /// Method of estimation.
    pub method: String,
    /// Mask of the free coefficients.
    pub mask: Mask,
    /// Those coefficients with their covariance.
    pub parameters: Parameters,
    /// Residuals that speak for or against it, and past outputs per equation that it was fitted with.
    pub residuals: (Kind, usize),
    /// Further entries under `diagnostics`.
    pub diagnostics: Value,
    /// Sentences about the data.
    pub verdict: Vec<String>,
    /// Sentences about what is doubtful.
    pub warnings: Vec<String>,
}

/// Estimates the model of a structure.
///
/// # Errors
/// Data that do not tell the coefficients apart, or are too few.
pub fn estimate(
    args: &Args,
    loaded: &Loaded,
    structure: &Structure,
    names: Names,
) -> Result<Estimated, Error> {
    let sources = loaded.estimation();
    let inputs = excitation(&sources, names.inputs, loaded.data.sample_time)?;
    let estimate = arx::estimate(&sources, structure, loaded.data.sample_time, loaded.offsets(), names)?;
    let condition: Vec<f64> = estimate.equations.iter().map(|equation| equation.condition()).collect();
    let warnings = doubts(&estimate, &condition, &inputs, names);
    let mask = mask(structure);
    let one_step = structure.na.iter().flatten().copied().max().unwrap_or(0);
    let residuals = match args.method {
        MethodChoice::LeastSquares => (Kind::OneStep, one_step),
        _ => (Kind::Simulated, 0),
    };
    let mut estimated = Estimated {
        model: estimate.model.clone(),
        structure: structure.clone(),
        method: format!("arx, {}", args.method.name()),
        parameters: in_order(&estimate.parameters(), &mask),
        mask: mask.clone(),
        residuals,
        diagnostics: json!({
            "noise_covariance": rows(&estimate.noise_covariance),
            "condition": condition,
            "excitation": inputs,
        }),
        verdict: inputs.iter().map(sentence).collect(),
        warnings,
    };
    let model = estimate.model;
    match args.method {
        MethodChoice::LeastSquares => {}
        MethodChoice::InstrumentalVariables => {
            let options = instrumental_variables::Options::default();
            let found = instrumental_variables::estimate(&model, &mask, loaded.records()?, &options)?;
            estimated.replace(found.model, found.parameters, &found.noise_covariance);
            if !found.converged {
                estimated.warnings.push(
                    "the iterations of the instrumental variables did not settle; the best of them is given"
                        .into(),
                );
            }
        }
        MethodChoice::OutputError => {
            let found = output_error(&model, &mask, loaded, &mut estimated.warnings)?;
            estimated.replace(found.model, found.parameters, &found.noise_covariance);
            let sentence = format!("output error: {}", found.outcome.describe());
            match found.outcome {
                output_error::Outcome::Converged => estimated.verdict.push(sentence),
                _ => estimated.warnings.push(sentence),
            }
        }
    }
    Ok(estimated)
}

/// Output error from the least-squares `model` on.
///
/// A pole much slower than the records makes an offset of its own of the free initial state of each, which nothing
/// simulates; where the model is no better for it when it is simulated, poles are kept as fast as the records are long.
fn output_error(
    model: &Arx,
    mask: &Mask,
    loaded: &Loaded,
    warnings: &mut Vec<String>,
) -> Result<OutputError, Error> {
    let options = output_error::Options::default();
    let found = output_error::refine(model, mask, loaded.records()?, &options)?;
    let sources = loaded.estimation();
    let [before, after] = [simulated_fit(model, &sources)?, simulated_fit(&found.model, &sources)?];
    if before.is_nan() || after.is_nan() || before <= after {
        return Ok(found);
    }
    let longest = sources.iter().map(|source| source.samples()).max().unwrap_or(1);
    let largest_pole = (1.0 - TIME_CONSTANTS_PER_RECORD / longest as f64).clamp(0.0, options.largest_pole);
    let options = output_error::Options { largest_pole, ..options };
    let faster = output_error::refine(model, mask, loaded.records()?, &options)?;
    let again = simulated_fit(&faster.model, &sources)?;
    let chosen = if again > after {
        warnings.push("a pole much slower than the records served as an offset of each of them; poles are kept as fast as the records are long".into());
        faster
    } else {
        found
    };
    let reached = again.max(after);
    if reached < before {
        warnings.push(format!(
            "output error simulates the estimation data worse ({reached:.1} %) than least squares ({before:.1} %), as it fits the initial state of every record as well: records differ by more than this structure can say; try --method least-squares, or another order"
        ));
    }
    Ok(chosen)
}

/// Mean simulated fit over outputs and records \[%\]; below all others for an unstable model, no number where an output
/// does not move.
fn simulated_fit(model: &Arx, sources: &[&dyn Source]) -> Result<f64, Error> {
    if !model.is_stable() {
        return Ok(f64::NEG_INFINITY);
    }
    let n_y = model.output_offset.len();
    let names: Vec<String> = (0..n_y).map(|i| i.to_string()).collect();
    let playback = Playback::new(model, true);
    let score = |source: &&dyn Source| -> Result<RecordScore, Error> {
        let mut tally = Tally::new(source.name(), n_y, playback.warm_up());
        playback.run(*source, &mut |played| tally.add(&played))?;
        Ok(tally.finish(&names))
    };
    let records = sources.iter().map(score).collect::<Result<Vec<_>, _>>()?;
    Ok(Score::of_records(records, &names).mean_fit_simulated.unwrap_or(f64::NAN))
}

impl Estimated {
    fn replace(&mut self, model: Arx, parameters: Parameters, noise_covariance: &DMatrix<f64>) {
        self.model = model;
        self.parameters = parameters;
        self.diagnostics["noise_covariance"] = json!(rows(noise_covariance));
    }
}

/// The parameters in the order of the mask.
fn in_order(parameters: &Parameters, mask: &Mask) -> Parameters {
    let names = mask.names();
    let place = |name: &String| parameters.names.iter().position(|known| known == name);
    let order: Vec<usize> = names.iter().filter_map(place).collect();
    let covariance = parameters.covariance.as_ref();
    Parameters {
        values: parameters.values.select_rows(&order),
        covariance: covariance.map(|covariance| covariance.select_rows(&order).select_columns(&order)),
        names,
    }
}

/// Mask of the free coefficients.
fn mask(structure: &Structure) -> Mask {
    let ones: Vec<Vec<f64>> = (0..structure.n_y()).map(|i| vec![1.0; structure.terms(i).len()]).collect();
    let ones: Vec<&[f64]> = ones.iter().map(Vec::as_slice).collect();
    let (a, b) = arx::matrices(structure, &ones);
    let free = |matrices: Vec<DMatrix<f64>>| matrices.iter().map(|m| m.map(|one| one != 0.0)).collect();
    Mask { a: free(a), b: free(b) }
}

fn sentence(input: &Excitation) -> String {
    format!(
        "{} has 99 % of its power below {:.3} Hz, {:.1} % of the band up to half the sample rate: of what the model does above, the data say nothing",
        input.input,
        input.band,
        100.0 * input.share_of_band
    )
}

fn doubts(estimate: &Estimate, condition: &[f64], inputs: &[Excitation], names: Names) -> Vec<String> {
    let mut warnings = Vec::new();
    for (j, input) in inputs.iter().enumerate() {
        let wanted = estimate.structure.nb.iter().map(|nb| nb[j]).max().unwrap_or(0);
        if input.order < wanted {
            warnings.push(format!(
                "{} tells {} coefficients apart, but nb = {wanted}: excite it with more frequencies (see `airloop excite`), or lower nb",
                input.input, input.order
            ));
        }
    }
    for (output, condition) in names.outputs.iter().zip(condition) {
        if *condition > MAX_CONDITION_NUMBER {
            warnings.push(format!(
                "the regressors of {output} are nearly dependent (condition number {condition:.1e}): single coefficients mean little; lower na and nb, excite more frequencies, or sample more slowly"
            ));
        }
    }
    let coefficients = estimate.equations.iter().map(|equation| equation.terms.len()).max().unwrap_or(0);
    if estimate.rows < (SAMPLES_PER_COEFFICIENT * coefficients) as u64 {
        warnings.push(format!(
            "only {} samples for {coefficients} coefficients per output: the fit on the estimation data flatters; judge by --validate",
            estimate.rows
        ));
    }
    warnings
}
