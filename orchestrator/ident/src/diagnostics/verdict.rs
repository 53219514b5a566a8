//! Verdict of the diagnostics, in words.

use serde::Serialize;

use super::{Diagnostics, Kind};
use airloop_series::names::counted;

/// Share of the variance of a residual below which a finding of the tests has no practical weight.
pub const MIN_SHARE_THAT_MATTERS: f64 = 0.02;
/// Residual relative to the spread of its output below which it is rounding, to which no test applies.
pub const MAX_ROUNDING_RESIDUAL: f64 = 1e-6;
/// Share of the variance of an input that past residuals must explain to be called feedback.
pub const MIN_SHARE_OF_FEEDBACK: f64 = 0.01;
/// Probability below which residuals are not taken for white.
pub const SIGNIFICANCE_LEVEL: f64 = 0.01;

/// Character of a residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Whiteness {
    /// The test finds nothing.
    White,
    /// The test finds something, but it explains next to nothing.
    PracticallyWhite,
    /// The residual can be predicted from its own past.
    Colored,
}

/// The verdict: sentences, and the facts behind them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// Findings in the data, one sentence each.
    pub sentences: Vec<String>,
    /// Whether nothing speaks against the model: every residual at least practically white, no channel with missing
    /// dynamics, all poles inside the unit circle, a parameter that can be told from zero.
    pub explains_the_data: bool,
    /// Whiteness of every residual, by output.
    pub whiteness: Vec<(String, Whiteness)>,
    /// Channels (input, output) whose residual still follows the input.
    pub missing_dynamics: Vec<(String, String)>,
    /// Channels (input, output) where the input seems to depend on past outputs; reported only where no dynamics are
    /// missing.
    pub feedback: Vec<(String, String)>,
    /// Parameters whose 95 % interval holds 0, the highest lags first.
    pub insignificant: Vec<String>,
}

/// The verdict on a model called `name`, such as `order 1`.
pub fn verdict(name: &str, diagnostics: &Diagnostics) -> Verdict {
    let mut sentences = Vec::new();
    let exact: Vec<&str> = diagnostics
        .autocorrelation
        .iter()
        .zip(&diagnostics.relative_residual)
        .filter(|(_, share)| share.is_some_and(|share| share < MAX_ROUNDING_RESIDUAL))
        .map(|(of, _)| of.output.as_str())
        .collect();
    let rounding = |output: &str| exact.contains(&output);
    let all_exact = !exact.is_empty() && exact.len() == diagnostics.autocorrelation.len();
    let whiteness: Vec<(String, Whiteness)> = diagnostics
        .autocorrelation
        .iter()
        .map(|of| {
            let kind = if of.p_value >= SIGNIFICANCE_LEVEL || rounding(&of.output) {
                Whiteness::White
            } else if of.explained_by_past < MIN_SHARE_THAT_MATTERS {
                Whiteness::PracticallyWhite
            } else {
                Whiteness::Colored
            };
            (of.output.clone(), kind)
        })
        .collect();
    let missing: Vec<_> = diagnostics
        .cross_correlation
        .iter()
        .filter(|of| !rounding(&of.output))
        .filter(|of| of.missing_dynamics > 1.0 && of.explained_by_input >= MIN_SHARE_THAT_MATTERS / 4.0)
        .collect();
    // What a model leaves of a predictable input (a chirp) looks like feedback, too, also by way of other outputs: only
    // a complete model can tell.
    let complete = missing.is_empty();
    let feedback: Vec<_> = diagnostics
        .cross_correlation
        .iter()
        .filter(|of| complete && !rounding(&of.output))
        .filter(|of| of.feedback > 1.0 && of.explained_by_residual > MIN_SHARE_OF_FEEDBACK)
        .collect();
    let unstable: Vec<_> = diagnostics.poles.iter().filter(|pole| pole.modulus >= 1.0).collect();
    let white = whiteness.iter().all(|(_, kind)| *kind != Whiteness::Colored);
    let insignificant = insignificant(diagnostics);
    let nothing_is_told = !insignificant.is_empty() && insignificant.len() == diagnostics.parameters.len();
    let explains_the_data = white && missing.is_empty() && unstable.is_empty() && !nothing_is_told;
    if let Some(pole) = unstable.first() {
        sentences.push(format!(
            "the model is unstable (pole of modulus {:.4}): it cannot be simulated; use output error, or another order",
            pole.modulus
        ));
    }
    if explains_the_data && all_exact {
        sentences.push(format!(
            "{name} explains the data to rounding: no residual is larger than {MAX_ROUNDING_RESIDUAL:e} of the spread of its output"
        ));
    } else if explains_the_data {
        let tested = || diagnostics.autocorrelation.iter().filter(|of| !rounding(&of.output));
        let smallest = tested().map(|of| of.p_value).fold(1.0, f64::min);
        let evidence = if smallest >= SIGNIFICANCE_LEVEL {
            format!("residuals white (Ljung-Box p = {smallest:.2})")
        } else {
            let most = tested().map(|of| of.explained_by_past).fold(0.0, f64::max);
            format!(
                "residuals practically white (their past explains {:.1} % of their variance; with {} samples the test sees that)",
                100.0 * most,
                diagnostics.samples
            )
        };
        sentences.push(format!(
            "the residuals do not speak against {name}: {evidence}, none follows an input{}",
            size(diagnostics)
        ));
    }
    if nothing_is_told {
        sentences.push(format!(
            "none of the {} coefficients of {name} can be told from zero: the data say nothing about this model; record longer, with a larger or richer input",
            insignificant.len()
        ));
    }
    if !exact.is_empty() && !all_exact {
        sentences.push(format!("{} is explained to rounding", exact.join(", ")));
    }
    for of in &diagnostics.autocorrelation {
        if rounding(&of.output)
            || of.p_value >= SIGNIFICANCE_LEVEL
            || of.explained_by_past < MIN_SHARE_THAT_MATTERS
        {
            continue;
        }
        let share = format!("their past explains {:.0} % of their variance", 100.0 * of.explained_by_past);
        let followed = missing.iter().any(|pair| pair.output == of.output);
        let remedy = match (diagnostics.residuals, followed) {
            (Kind::OneStep, _) => "raise the order or use output error",
            (Kind::Simulated, true) => "raise the order",
            (Kind::Simulated, false) => {
                "no input explains them, so it is colored noise or a nonlinear effect; the simulation is not improved by a noise model"
            }
        };
        sentences.push(format!("residuals of {} are colored ({share}): {remedy}", of.output));
    }
    for pair in &missing {
        let at = pair.lags.iter().zip(&pair.values).filter(|(lag, _)| **lag >= 0);
        let largest = at.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map_or(0, |(lag, _)| *lag);
        sentences.push(format!(
            "the residual of {} still follows {} (most {} later, {:.1} % of its variance): dynamics or delay of this channel are missing",
            pair.output,
            pair.input,
            counted(largest.unsigned_abs() as usize, "sample"),
            100.0 * pair.explained_by_input
        ));
    }
    for pair in &feedback {
        sentences.push(format!(
            "{} depends on past residuals of {} ({:.0} % of its variance): there seems to be feedback, and output error or instruments are then biased; record with the loop open, or use a prediction-error model",
            pair.input,
            pair.output,
            100.0 * pair.explained_by_residual
        ));
    }
    let bands = diagnostics.frequency.iter().all(|response| !response.relative_deviation.is_empty())
        && diagnostics.step.iter().all(|response| !response.standard_deviation.is_empty());
    let determined = |p: &super::Interval| p.standard_deviation.is_some();
    if !bands && !diagnostics.parameters.is_empty() && diagnostics.parameters.iter().all(determined) {
        sentences.push(format!(
            "responses of this size ({} parameters, {} poles) are given without all of their uncertainty bands, which would take too long: lower the orders for them",
            diagnostics.parameters.len(),
            diagnostics.poles.len()
        ));
    }
    let undetermined = diagnostics.parameters.iter().any(|p| p.standard_deviation.is_none());
    if undetermined {
        sentences.push(
            "the data do not determine all parameters (no covariance): lower the order, or excite more frequencies"
                .into(),
        );
    } else if !insignificant.is_empty() && !nothing_is_told {
        let shown: Vec<&str> = insignificant.iter().take(6).map(String::as_str).collect();
        let more = if insignificant.len() > shown.len() { ", ..." } else { "" };
        sentences.push(format!("the 95 % intervals of {}{more} hold 0", shown.join(", ")));
    }
    let channel = |pair: &&super::CrossCorrelation| (pair.input.clone(), pair.output.clone());
    Verdict {
        sentences,
        explains_the_data,
        whiteness,
        missing_dynamics: missing.iter().map(channel).collect(),
        feedback: feedback.iter().map(channel).collect(),
        insignificant,
    }
}

/// Parameters whose 95 % interval holds 0, the highest lags first.
fn insignificant(diagnostics: &Diagnostics) -> Vec<String> {
    let told = diagnostics
        .parameters
        .iter()
        .rev()
        .filter(|p| p.interval_95.is_some_and(|[low, high]| low <= 0.0 && 0.0 <= high))
        .filter(|p| !p.name.starts_with("direction"));
    told.map(|p| p.name.clone()).collect()
}

/// Size of the largest residual, which no test of its color tells.
fn size(diagnostics: &Diagnostics) -> String {
    let sizes = diagnostics.autocorrelation.iter().zip(&diagnostics.relative_residual);
    let largest = sizes.filter_map(|(of, share)| Some((of, (*share)?))).max_by(|a, b| a.1.total_cmp(&b.1));
    largest.map_or_else(String::new, |(of, share)| {
        format!("; that of {} is {:.2} % of the spread of its output", of.output, 100.0 * share)
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::diagnostics::response::Family;
    use crate::diagnostics::{Options, diagnose};
    use crate::model::{Arx, Model};
    use crate::output_error::refine;
    use crate::rational::Mask;
    use crate::record::Record;
    use crate::synthetic::{Noise, eq8, measure, stairs};

    fn names() -> (Vec<String>, Vec<String>) {
        (vec!["u".into()], vec!["F_hat".into(), "F_p".into()])
    }

    fn judged(mask: &Mask, records: &[Record]) -> (Verdict, Diagnostics) {
        let found = refine(&eq8(), mask, records, &Default::default()).unwrap();
        let at = |p: &DVector<f64>| mask.model(&found.model, p).to_state_space();
        let family = Family { parameters: &found.parameters, at: &at };
        let (u, y) = names();
        let diagnostics = diagnose(&found.model, Some(family), records, &u, &y, &Options::default());
        (verdict("order 1", &diagnostics), diagnostics)
    }

    #[test]
    fn the_right_order_explains_the_data_and_one_too_low_does_not() {
        let mut noise = Noise::new(11);
        let records = [measure(&eq8(), vec![stairs(3000, 40.0, &mut noise)], 0.5, &mut noise)];
        let (good, diagnostics) = judged(&Mask::of(&eq8()), &records);
        assert!(good.explains_the_data, "{:?}", good.sentences);
        assert!(
            good.sentences[0].starts_with("the residuals do not speak against order 1: residuals white"),
            "{good:?}"
        );
        assert!(serde_json::to_string(&diagnostics).unwrap().contains("\"dc_gain\""));
        // No direct term where the plant has a large one.
        let (poor, _) = judged(&Mask::full(2, 1, 1, 1, 1), &records);
        assert!(!poor.explains_the_data);
        assert!(poor.missing_dynamics.contains(&("u".into(), "F_hat".into())), "{:?}", poor.sentences);
    }

    #[test]
    fn data_without_noise_are_explained_to_rounding_and_nothing_else_is_said_of_their_residuals() {
        let mut noise = Noise::new(13);
        let records = [measure(&eq8(), vec![stairs(600, 40.0, &mut noise)], 0.0, &mut noise)];
        let (u, y) = names();
        let found = verdict("order 1", &diagnose(&eq8(), None, &records, &u, &y, &Options::default()));
        assert_eq!(found.sentences.len(), 1, "{:?}", found.sentences);
        assert!(found.sentences[0].contains("to rounding") && found.explains_the_data, "{found:?}");
    }

    #[test]
    fn feedback_is_told_only_where_it_moves_the_input() {
        let feedback = |gain: f64| {
            let mut noise = Noise::new(14);
            let n = 30_000;
            let e: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
            let mut u: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
            (1..n).for_each(|k| u[k] += gain * e[k - 1]);
            let static_gain = Arx {
                a: vec![nalgebra::DMatrix::zeros(1, 1)],
                b: vec![nalgebra::DMatrix::from_element(1, 1, 2.0)],
                sample_time: 0.01,
                input_offset: vec![0.0],
                output_offset: vec![0.0],
            };
            let y = u.iter().zip(&e).map(|(u, e)| 2.0 * u + e).collect();
            let records =
                [Record { sample_time: 0.01, inputs: vec![u], outputs: vec![y], ..Record::default() }];
            let found =
                diagnose(&static_gain, None, &records, &["u".into()], &["y".into()], &Options::default());
            (found.cross_correlation[0].feedback > 1.0, verdict("order 0", &found).feedback.len())
        };
        // 0.05^2 of the variance is significant with 30 000 samples, but nothing; 0.3^2 is much.
        assert_eq!(feedback(0.05), (true, 0));
        assert_eq!(feedback(0.3), (true, 1));
    }

    #[test]
    fn an_unstable_model_is_called_unstable() {
        let mut noise = Noise::new(12);
        let records = [measure(&eq8(), vec![stairs(300, 40.0, &mut noise)], 0.5, &mut noise)];
        let unstable = Arx { a: vec![eq8().a[0].clone() * 1.05], ..eq8() };
        let (u, y) = names();
        let options = Options { kind: Kind::OneStep, ..Options::default() };
        let found = verdict("order 1", &diagnose(&unstable, None, &records, &u, &y, &options));
        assert!(found.sentences[0].starts_with("the model is unstable"), "{:?}", found.sentences);
        assert!(!found.explains_the_data);
    }
}
