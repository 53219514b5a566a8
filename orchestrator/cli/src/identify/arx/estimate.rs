//! The estimation itself: least squares, and from there what `--method` asks for.

use nalgebra::DMatrix;
use serde_json::{Value, json};

use super::{Args, MethodChoice};
use crate::identify::data::Loaded;
use airloop::Error;
use airloop_ident::arx::{self, Estimate, Names};
use airloop_ident::diagnostics::Kind;
use airloop_ident::excitation::{Excitation, excitation};
use airloop_ident::model::Arx;
use airloop_ident::model::file::rows;
use airloop_ident::parameters::Parameters;
use airloop_ident::rational::Mask;
use airloop_ident::structure::Structure;
use airloop_ident::{instrumental_variables, output_error};

/// Condition number of the regressors above which small errors of the data turn into large ones of the coefficients.
const MAX_CONDITION_NUMBER: f64 = 3e4;

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
            let options = output_error::Options::default();
            let found = output_error::refine(&model, &mask, loaded.records()?, &options)?;
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
        "{} has 99 % of its power below {:.3} Hz, {:.1} % of the band up to half the sample rate: the data speak for the model up to there",
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
    if estimate.rows < 10 * coefficients as u64 {
        warnings.push(format!(
            "only {} samples for {coefficients} coefficients per output: the fit on the estimation data flatters; judge by --validate",
            estimate.rows
        ));
    }
    warnings
}
